#include <ricochet/ricochet.hpp>
#include <ricochet/systems/bouncing_ball.hpp>

#include <string>

using namespace ricochet;

int main()
{
    const BouncingBall ball;
    const std::array x0{10.0, 0.0};
    Simulation simulation(ball, x0, {.t_end = 5});
    Simulation other(ball, x0, {.t_end = 5});
    simulation.advance();
    // clang-format off
BLOCK
    // clang-format on
    while (simulation.advance()) {
    }
    while (other.advance()) {
    }
    return simulation.x() == other.x() ? 0 : 1;
}
