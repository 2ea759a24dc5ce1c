#include "problems/cavern.hpp"

#include "entries.hpp"
#include "run_system.hpp"
#include "scenes.hpp"

namespace ricochet::app {

namespace {

// the order of parameters
enum : std::size_t { segments, seed, size, radius, gravity, turn, drag, restitution, kick, launch };

}  // namespace

Cavern cavern_of(const std::vector<double>& p)
{
    return Cavern({.segments = static_cast<std::size_t>(p[segments]),
                   .seed = static_cast<std::uint64_t>(p[seed]),
                   .size = p[size],
                   .radius = p[radius],
                   .gravity = p[gravity],
                   .turn = p[turn],
                   .drag = p[drag],
                   .restitution = p[restitution],
                   .kick = p[kick],
                   .launch_speed = p[launch]});
}

namespace {

std::vector<double> start(const std::vector<double>& p)
{
    return {0, 0, p[launch], 0};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(cavern_of(settings.parameters), start(settings.parameters), settings,
                      repeats);
}

}  // namespace

SystemEntry cavern_entry()
{
    const Cavern::Parameters d;
    const Range positive{.lower = 0};
    const Range not_negative{.lower = 0, .lower_included = true};
    return {
        .name = Cavern::name,
        .description = "A ball flies through a closed cavern whose wall has many segments.",
        .parameters = {{"segments",
                        static_cast<double>(d.segments),
                        "1",
                        {.lower = 8, .upper = 1e7, .lower_included = true},
                        "of the wall"},
                       {"seed", static_cast<double>(d.seed), "1", not_negative, "of its shape"},
                       {"size", d.size, "m", positive, "mean distance of the wall"},
                       {"radius", d.radius, "m", positive, "of the ball"},
                       {"gravity", d.gravity, "m/s²", not_negative, "acceleration"},
                       {"turn", d.turn, "rad/s", {}, "of gravity"},
                       {"drag", d.drag, "1/m", positive, "deceleration over speed squared"},
                       {"restitution",
                        d.restitution,
                        "1",
                        {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
                        "at an impact"},
                       {"kick", d.kick, "m/s", not_negative, "least speed after an impact"},
                       {"launch", d.launch_speed, "m/s", not_negative, "speed at the start"}},
        .state = {{"x", "m", "to the right"},
                  {"y", "m", "up, at the start"},
                  {"vx", "m/s", "rate of x"},
                  {"vy", "m/s", "rate of y"}},
        .guards = {{"wall", "impact"}},
        .t_end = 10,
        .start = start,
        .run = run,
    };
}

}  // namespace ricochet::app
