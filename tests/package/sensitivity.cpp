// A user of the component `sensitivity`: the change of a bounce with the height of the drop.
#include <cmath>
#include <complex>
#include <cstdio>

#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

int main()
{
    const ricochet::BouncingBall ball;
    const auto s = ricochet::sensitivities(ball, {1.0, 0.0}, {}, {.t_end = 0.6});
    const auto multipliers = ricochet::floquet_multipliers(s.state);
    const bool fine = s.run.events.size() == 1 && std::isfinite(s.state(0, 0)) &&
                      std::isfinite(std::abs(multipliers[0]));
    std::puts(fine ? "fine" : "no derivative");
    return fine ? 0 : 1;
}
