#include "ricochet/systems/sliding_mode.hpp"

#include "entries.hpp"

namespace ricochet::app {

SystemEntry sliding_mode_entry()
{
    return {
        .name = SlidingMode::name,
        .description = "A relay brings a disturbed state to zero and holds it there.",
        .source =
            "D. M. Riley and others, Reinforcement Learning-based adaptive "
            "time-integration for nonsmooth dynamics, section 5.1",
        .parameters = {{.name = "amplitude",
                        .initial = 1.75,
                        .unit = "1/s",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of the disturbance"},
                       {.name = "frequency",
                        .initial = 50,
                        .unit = "rad/s",
                        .range = {.lower = 0},
                        .meaning = "of the disturbance"},
                       {.name = "gain",
                        .initial = 2,
                        .unit = "1/s",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of the relay"},
                       {.name = "start",
                        .initial = SlidingMode::start,
                        .unit = "1",
                        .range = {},
                        .meaning = "w at the start"}},
        .state = {{.name = "w", .unit = "1", .meaning = "the controlled state"}},
        .guards = {{.name = "relay", .event = "switch"}},
        .modes = {"positive", "held", "negative", "set-valued"},
        .t_end = SlidingMode::t_end,
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 1.25e-3,
        .published_errors = {"PI         48 steps, 0.678 s, L2 1.94e-4",
                             "heuristic  55 steps, 0.631 s, L2 1.70e-4",
                             "TQC        0.278 s, L2 2.94e-4", "TD3        0.297 s, L2 2.71e-4"},
        .known_solution = "the state at any time",
        .program = "nonsmooth",
    };
}

}  // namespace ricochet::app
