#include "ricochet/systems/coulomb_oscillator.hpp"

#include "entries.hpp"
#include "labels.hpp"

namespace ricochet::app {

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
        .modes = mode_names_and_set_valued<CoulombOscillator>(),
        .t_end = 10,
        .start = nullptr,
        .run = nullptr,
        .comparison_step = 0.01,
        .integrators = {"event", "handover", "bathe", "time-stepping"},
        .set_valued_step = 0.01,
        .known_solution = "event times in closed form",
        .program = "nonsmooth",
    };
}

}  // namespace ricochet::app
