#include "ricochet/systems/pendulum.hpp"

#include "../input.hpp"
#include "entries.hpp"
#include "labels.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t { gravity, length, angle, rate };  // the order of parameters

Pendulum system(const std::vector<double>& p)
{
    return Pendulum({.gravity = p[gravity], .length = p[length]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[angle], p[rate]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

/// From rest; else none are known.
std::vector<double> exact_events(const std::vector<double>& p, double t_end)
{
    std::vector<double> times;
    if (p[rate] != 0) {
        throw BadInput("the event times of pendulum are known from rest, expected rate = 0");
    }
    const double half_period = system(p).half_period(p[angle]);
    for (int n = 1; n * half_period <= t_end; ++n) times.push_back(n * half_period);
    return times;
}

}  // namespace

SystemEntry pendulum_entry()
{
    return {
        .name = Pendulum::name,
        .description =
            "A point mass on a rod swings without friction; its turning points are found.",
        .parameters = {{.name = "gravity",
                        .initial = 9.8,
                        .unit = "m/s²",
                        .range = {.lower = 0},
                        .meaning = "acceleration downward"},
                       {.name = "length",
                        .initial = 1,
                        .unit = "m",
                        .range = {.lower = 0},
                        .meaning = "of the rod"},
                       {.name = "angle",
                        .initial = Pendulum::start[0],
                        .unit = "rad",
                        .range = {.lower = -3.14, .upper = 3.14},
                        .meaning = "at the start, from the lowest point"},
                       {.name = "rate",
                        .initial = Pendulum::start[1],
                        .unit = "rad/s",
                        .range = {},
                        .meaning = "of the angle at the start"}},
        .state = {{.name = "a", .unit = "rad", .meaning = "angle"},
                  {.name = "w", .unit = "rad/s", .meaning = "rate of the angle"}},
        .guards = labels(Pendulum{}, {"turning point"}),
        .t_end = 10,
        .start = start,
        .run = run,
        .exact_events = exact_events,
        .comparison_step = 0.01,
    };
}

}  // namespace ricochet::app
