// A mass on a belt sticks and slips: events where the motion is smooth, set-valued steps
// where events do not lead on.
//
// Only the inclusion is declared. Sticking, slipping and their changes follow from it: the
// hand-over runs an explicit stepper on each branch, locates the changes to the step map, and
// leaves the rest to Bathe's steps, which this motion never needs.

#include <cmath>
#include <cstdio>

#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/stick_slip.hpp"

int main()
{
    using ricochet::EventKind;
    using ricochet::FrictionInclusion;

    const FrictionInclusion belt({.belt_speed = 0.2, .friction = 1, .weakening = 3});
    const auto run = ricochet::hand_over(belt, Eigen::Vector2d(1, 0.2),
                                         {.t_end = 25, .rtol = 1e-11, .atol = 1e-12});

    for (const auto& event : run.events) {
        std::printf("%12.9f s  u %+.9f m  %s\n", event.t, event.before[0],
                    event.kind == EventKind::stick ? "sticks" : "slips");
    }
    std::printf("%s at %g s: u %.9f m, friction %.6f N; %llu steps, %zu phase%s\n",
                name(run.outcome).data(), run.t, run.x[0], run.reaction[0],
                static_cast<unsigned long long>(run.statistics.steps), run.phases.size(),
                run.phases.size() == 1 ? "" : "s");
    // Slip starts again one period after the start, where it first began.
    return run.events.size() == 4 && std::abs(run.events[1].t - ricochet::StickSlip::period) < 1e-8
               ? 0
               : 1;
}
