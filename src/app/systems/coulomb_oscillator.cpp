#include "ricochet/systems/coulomb_oscillator.hpp"

#include "../input.hpp"
#include "entries.hpp"
#include "friction_inclusion.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t {
    mass,
    stiffness,
    friction,
    static_friction,
    position,
    velocity
};  // the order of parameters

CoulombOscillator system(const std::vector<double>& p)
{
    return CoulombOscillator({.mass = p[mass],
                              .stiffness = p[stiffness],
                              .friction = p[friction],
                              .static_friction = p[static_friction]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[position], p[velocity]};
}

Mode start_mode(const std::vector<double>& p)
{
    return system(p).mode_at(p[position], p[velocity]);
}

TimedRun run(const RunSettings& settings, int repeats)
{
    if (settings.set_valued) {
        const auto& p = settings.parameters;
        return run_oscillator(FrictionInclusion::of({.mass = p[mass],
                                                     .stiffness = p[stiffness],
                                                     .friction = p[friction],
                                                     .static_friction = p[static_friction]}),
                              {p[position], p[velocity]}, settings, repeats);
    }
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

/// From rest on the right; else none are known.
std::vector<double> exact_events(const std::vector<double>& p, double t_end)
{
    const CoulombOscillator oscillator = system(p);
    std::vector<double> times;
    if (p[velocity] != 0 || !(p[position] > 0) || p[friction] == 0) {
        throw BadInput(
            "the event times of coulomb-oscillator are known with friction and from rest, expected "
            "velocity = 0, position > 0 and friction > 0");
    }
    for (int n = 1; n <= oscillator.stops(p[position]) && oscillator.turning_time(n) <= t_end;
         ++n) {
        times.push_back(oscillator.turning_time(n));
    }
    return times;
}

}  // namespace

SystemEntry coulomb_oscillator_entry()
{
    return {
        .name = CoulombOscillator::name,
        .description = "A mass on a spring comes to rest under dry friction after a few turns.",
        .parameters = {{.name = "mass",
                        .initial = 1,
                        .unit = "kg",
                        .range = {.lower = 0},
                        .meaning = "of the oscillator"},
                       {.name = "stiffness",
                        .initial = 1,
                        .unit = "N/m",
                        .range = {.lower = 0},
                        .meaning = "of the spring"},
                       {.name = "friction",
                        .initial = 0.3,
                        .unit = "N",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "while slipping"},
                       {.name = "static-friction",
                        .initial = 0.3,
                        .unit = "N",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "that sticking bears, at least friction"},
                       {.name = "position",
                        .initial = CoulombOscillator::start[0],
                        .unit = "m",
                        .range = {},
                        .meaning = "at the start"},
                       {.name = "velocity",
                        .initial = CoulombOscillator::start[1],
                        .unit = "m/s",
                        .range = {},
                        .meaning = "at the start"}},
        .state = {{.name = "u", .unit = "m", .meaning = "position"},
                  {.name = "v", .unit = "m/s", .meaning = "velocity"}},
        .guards = labels(CoulombOscillator{}, {"stop", "pulled left", "pulled right"}),
        .modes = with_set_valued(mode_names<CoulombOscillator>()),
        .t_end = 10,
        .start = start,
        .run = run,
        .start_mode = start_mode,
        .exact_events = exact_events,
        .comparison_step = 0.01,
        .integrators = {"event", "handover", "bathe", "time-stepping"},
        .set_valued_step = 0.01,
    };
}

}  // namespace ricochet::app
