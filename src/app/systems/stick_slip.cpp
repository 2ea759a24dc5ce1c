#include "ricochet/systems/stick_slip.hpp"

#include "entries.hpp"
#include "labels.hpp"

namespace ricochet::app {

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
        .modes = mode_names_and_set_valued<StickSlip>(),
        .t_end = 40,
        .start = nullptr,
        .run = nullptr,
        .any_parameters = false,
        .comparison_step = 0.01,
        .integrators = {"event", "handover", "bathe", "time-stepping"},
        .set_valued_step = 0.01,
        .known_solution = "event times in closed form, for the default parameters",
        .program = "nonsmooth",
    };
}

}  // namespace ricochet::app
