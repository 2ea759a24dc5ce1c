#include "problems/rolling_ball.hpp"

#include "entries.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t {
    mass,
    radius,
    friction,
    resistance,
    plate_speed,
    plate_frequency,
    gravity,
    velocity,
    spin
};  // the order of parameters

RollingBall system(const std::vector<double>& p)
{
    return RollingBall({.mass = p[mass],
                        .radius = p[radius],
                        .friction = p[friction],
                        .resistance = p[resistance],
                        .plate_speed = p[plate_speed],
                        .plate_frequency = p[plate_frequency],
                        .gravity = p[gravity]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[velocity], p[spin]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_inclusion(system(p), RollingBall::Vector(p[velocity], p[spin]), settings, repeats);
}

}  // namespace

SystemEntry rolling_ball_entry()
{
    return {
        .name = RollingBall::name,
        .description = "A ball slides, rolls and comes to rest on a moving plate.",
        .parameters = {{.name = "mass",
                        .initial = 0.2,
                        .unit = "kg",
                        .range = {.lower = 0},
                        .meaning = "of the ball"},
                       {.name = "radius",
                        .initial = 0.05,
                        .unit = "m",
                        .range = {.lower = 0},
                        .meaning = "of the ball"},
                       {.name = "friction",
                        .initial = 0.3,
                        .unit = "1",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "coefficient of sliding"},
                       {.name = "resistance",
                        .initial = 0.001,
                        .unit = "m",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "lever arm of the resistance to rolling"},
                       {.name = "plate-speed",
                        .initial = 0.1,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "largest speed of the plate"},
                       {.name = "plate-frequency",
                        .initial = 0,
                        .unit = "rad/s",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of the plate; 0: a constant speed"},
                       {.name = "gravity",
                        .initial = 9.81,
                        .unit = "m/s^2",
                        .range = {.lower = 0},
                        .meaning = "downward"},
                       {.name = "velocity",
                        .initial = 1,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "at the start"},
                       {.name = "spin",
                        .initial = 0,
                        .unit = "rad/s",
                        .range = {},
                        .meaning = "at the start"}},
        .state = {{.name = "v", .unit = "m/s", .meaning = "velocity"},
                  {.name = "spin", .unit = "rad/s", .meaning = "rolling towards v where positive"}},
        .guards = {{.name = "contact", .event = "switch"}, {.name = "rolling", .event = "switch"}},
        .modes = {"sliding ahead, spinning ahead", "rolling ahead", "sliding back, spinning ahead",
                  "sliding ahead, no spin", "at rest on the plate", "sliding back, no spin",
                  "sliding ahead, spinning back", "rolling back", "sliding back, spinning back",
                  "set-valued"},
        .t_end = 6,
        .start = start,
        .run = run,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 0.005,
    };
}

}  // namespace ricochet::app
