#include "ricochet/systems/two_contact_block.hpp"

#include "entries.hpp"
#include "run_contact.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t {
    mass,
    half_width,
    half_height,
    gravity,
    friction,
    restitution,
    height,
    tilt,
    velocity
};  // the order of parameters

TwoContactBlock system(const std::vector<double>& p)
{
    return {.mass_of_block = p[mass],
            .half_width = p[half_width],
            .half_height = p[half_height],
            .gravity = p[gravity],
            .coefficient = p[friction],
            .bounce = p[restitution]};
}

std::vector<double> start(const std::vector<double>& p)
{
    return {0, p[height], p[tilt], p[velocity], 0, 0};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const auto& p = settings.parameters;
    return run_contact(system(p), TwoContactBlock::Vector(0, p[height], p[tilt]),
                       TwoContactBlock::Vector(p[velocity], 0, 0), settings, repeats);
}

}  // namespace

SystemEntry two_contact_block_entry()
{
    return {
        .name = TwoContactBlock::name,
        .description = "A block falls on its two corners, bounces, slides and comes to rest.",
        .parameters =
            {{.name = "mass",
              .initial = 2,
              .unit = "kg",
              .range = {.lower = 0},
              .meaning = "of the block"},
             {.name = "half-width",
              .initial = 0.5,
              .unit = "m",
              .range = {.lower = 0},
              .meaning = "of the block"},
             {.name = "half-height",
              .initial = 0.25,
              .unit = "m",
              .range = {.lower = 0},
              .meaning = "of the block"},
             {.name = "gravity",
              .initial = 9.81,
              .unit = "m/s^2",
              .range = {.lower = 0},
              .meaning = "downward"},
             {.name = "friction",
              .initial = 0.4,
              .unit = "1",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "coefficient at both corners"},
             {.name = "restitution",
              .initial = 0.3,
              .unit = "1",
              .range = {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
              .meaning = "Newton's coefficient at both corners"},
             {.name = "height",
              .initial = 0.3,
              .unit = "m",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "of its centre above its height at rest, at the start"},
             {.name = "tilt",
              .initial = 0.05,
              .unit = "rad",
              .range = {},
              .meaning = "at the start, small"},
             {.name = "velocity",
              .initial = 1,
              .unit = "m/s",
              .range = {},
              .meaning = "along the ground, at the start"}},
        .state = {{.name = "x", .unit = "m", .meaning = "position of the centre"},
                  {.name = "z", .unit = "m", .meaning = "height of the centre above that at rest"},
                  {.name = "tilt", .unit = "rad", .meaning = "angle"},
                  {.name = "x'", .unit = "m/s", .meaning = "velocity along the ground"},
                  {.name = "z'", .unit = "m/s", .meaning = "velocity upward"},
                  {.name = "tilt'", .unit = "rad/s", .meaning = "rate of the angle"}},
        .guards = {{.name = "rear corner", .event = "impact"},
                   {.name = "front corner", .event = "impact"}},
        .t_end = 3,
        .start = start,
        .run = run,
        .integrators = {"handover", "time-stepping"},
        .set_valued_step = 1e-3,
    };
}

}  // namespace ricochet::app
