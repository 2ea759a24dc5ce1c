#include "problems/super_twisting.hpp"

#include "entries.hpp"

namespace ricochet::app {

SystemEntry super_twisting_entry()
{
    return {
        .name = SuperTwisting::name,
        .description =
            "A continuous control with a relay in its integral holds a disturbed state at zero.",
        .source =
            "A. Levant, Sliding order and sliding accuracy in sliding mode control, "
            "International Journal of Control 58, 1993",
        .parameters =
            {{.name = "gain-1",
              .initial = 3,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "of the square root"},
             {.name = "gain-2",
              .initial = 2.2,
              .unit = "1",
              .range = {.lower = 0},
              .meaning = "of the relay"},
             {.name = "amplitude",
              .initial = 1,
              .unit = "1",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "of the disturbance"},
             {.name = "frequency",
              .initial = 1,
              .unit = "rad/s",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "of the disturbance"},
             {.name = "x1", .initial = 1, .unit = "1", .range = {}, .meaning = "at the start"},
             {.name = "x2", .initial = 0, .unit = "1", .range = {}, .meaning = "at the start"}},
        .state = {{.name = "x1", .unit = "1", .meaning = "the sliding variable"},
                  {.name = "x2", .unit = "1", .meaning = "integral part and disturbance"}},
        .guards = {{.name = "relay", .event = "switch"}},
        .modes = {"positive", "held", "negative", "set-valued"},
        .t_end = 10,
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 0.005,
        .program = "nonsmooth",
    };
}

}  // namespace ricochet::app
