#include "ricochet/systems/stick_slip.hpp"

#include "entries.hpp"
#include "friction_inclusion.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t {
    mass,
    stiffness,
    belt_speed,
    friction,
    weakening,
    position,
    velocity
};  // the order of parameters

StickSlip system(const std::vector<double>& p)
{
    return StickSlip({.mass = p[mass],
                      .stiffness = p[stiffness],
                      .belt_speed = p[belt_speed],
                      .friction = p[friction],
                      .weakening = p[weakening]});
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
                                                     .belt_speed = p[belt_speed],
                                                     .friction = p[friction],
                                                     .static_friction = p[friction],
                                                     .weakening = p[weakening]}),
                              {p[position], p[velocity]}, settings, repeats);
    }
    return run_system(system(settings.parameters), start(settings.parameters), settings, repeats);
}

/// Of the default parameters.
std::vector<double> exact_events(const std::vector<double>& /*p*/, double t_end)
{
    std::vector<double> times;
    for (double t = 0; t < t_end; t += StickSlip::period) {
        if (t > 0) times.push_back(t);
        if (t + StickSlip::stick_time <= t_end) times.push_back(t + StickSlip::stick_time);
    }
    return times;
}

}  // namespace

SystemEntry stick_slip_entry()
{
    return {
        .name = StickSlip::name,
        .description = "A mass held by a spring sticks to a moving belt and slips, in turn.",
        .source =
            "R. I. Leine, D. H. van Campen, A. de Kraker and L. van den Steen, Stick-slip "
            "vibrations induced by alternate friction models, Nonlinear Dynamics 16, 1998, "
            "pages 41 to 54",
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
                       {.name = "belt-speed",
                        .initial = 0.2,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "to the right"},
                       {.name = "friction",
                        .initial = 1,
                        .unit = "N",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "at sliding speed 0, and of sticking"},
                       {.name = "weakening",
                        .initial = 3,
                        .unit = "s/m",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of friction with the sliding speed"},
                       {.name = "position",
                        .initial = StickSlip::start[0],
                        .unit = "m",
                        .range = {},
                        .meaning = "at the start"},
                       {.name = "velocity",
                        .initial = StickSlip::start[1],
                        .unit = "m/s",
                        .range = {},
                        .meaning = "at the start"}},
        .state = {{.name = "u", .unit = "m", .meaning = "position"},
                  {.name = "v", .unit = "m/s", .meaning = "velocity"}},
        .guards = labels(StickSlip{}, {"stick", "slip left", "slip right"}),
        .modes = with_set_valued(mode_names<StickSlip>()),
        .t_end = 40,
        .start = start,
        .run = run,
        .start_mode = start_mode,
        .exact_events = exact_events,
        .any_parameters = false,
        .comparison_step = 0.01,
        .integrators = {"event", "handover", "bathe", "time-stepping"},
        .set_valued_step = 0.01,
    };
}

}  // namespace ricochet::app
