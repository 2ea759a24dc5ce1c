// A ball falls from 10 m and bounces: the shortest complete program.

#include <cstdio>

#include "ricochet/ricochet.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

int main()
{
    const ricochet::BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    const auto run = ricochet::integrate(ball, {10.0, 0.0}, {.t_end = 20.5});

    for (const auto& impact : run.events) {
        std::printf("impact at %.15f s, %+.6f m/s -> %+.6f m/s\n", impact.t, impact.before[1],
                    impact.after[1]);
    }
    return run.events.size() == 13 ? 0 : 1;
}
