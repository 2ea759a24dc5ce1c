#include "problems/incline_block.hpp"

#include "entries.hpp"

namespace ricochet::app {

SystemEntry incline_block_entry()
{
    return {
        .name = InclineBlock::name,
        .description =
            "A block on an inclined plane slides in two directions under a cone of friction.",
        .parameters = {{.name = "slope",
                        .initial = 0.3,
                        .unit = "rad",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of the plane, below pi/2"},
                       {.name = "friction",
                        .initial = 0.5,
                        .unit = "1",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "coefficient"},
                       {.name = "gravity",
                        .initial = 9.81,
                        .unit = "m/s^2",
                        .range = {.lower = 0},
                        .meaning = "downward"},
                       {.name = "vx",
                        .initial = 1,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "down the slope, at the start"},
                       {.name = "vy",
                        .initial = 2,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "across the slope, at the start"}},
        .state = {{.name = "vx", .unit = "m/s", .meaning = "velocity down the slope"},
                  {.name = "vy", .unit = "m/s", .meaning = "velocity across the slope"},
                  {.name = "x", .unit = "m", .meaning = "position down the slope"},
                  {.name = "y", .unit = "m", .meaning = "position across the slope"}},
        .guards = {},
        .t_end = 2,
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "bathe", "time-stepping"},
        .set_valued_step = 0.001,
        .program = "nonsmooth",
    };
}

}  // namespace ricochet::app
