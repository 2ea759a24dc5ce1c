#include "problems/incline_block.hpp"

#include "entries.hpp"
#include "run_inclusion.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t { slope, friction, gravity, vx, vy };  // the order of parameters

InclineBlock system(const std::vector<double>& p)
{
    return InclineBlock({.slope = p[slope], .friction = p[friction], .gravity = p[gravity]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[vx], p[vy], 0, 0};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_inclusion(system(p), InclineBlock::Vector(p[vx], p[vy], 0, 0), settings, repeats);
}

}  // namespace

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
        .start = start,
        .run = run,
        .integrators = {"handover", "bathe", "time-stepping"},
        .set_valued_step = 0.001,
    };
}

}  // namespace ricochet::app
