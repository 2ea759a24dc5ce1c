// Descriptions of bodies in contact; `ricochet-nonsmooth` runs them.
#include "entries.hpp"
#include "problems/incline_block.hpp"
#include "problems/rolling_ball.hpp"
#include "ricochet/systems/two_contact_block.hpp"
#include "ricochet/systems/woodpecker.hpp"

namespace ricochet::app {

namespace {

std::vector<std::string_view> coulomb()
{
    return {"at each contact, with the normal force N >= 0:",
            "|F| <= friction N, and equal to it against the sliding velocity where that is not 0"};
}

}  // namespace

// --- incline block ---

SystemEntry incline_block_entry()
{
    return {
        .name = InclineBlock::name,
        .description =
            "A block on an inclined plane slides in two directions under a cone of friction.",
        .equations =
            {"vx' = gravity sin(slope) + rx,  vy' = ry",
             "|r| <= friction gravity cos(slope), and equal to it against v where v is not 0"},
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

// --- rolling ball ---

// Long: one entry of the list of systems.
SystemEntry rolling_ball_entry()
{
    return {
        .name = RollingBall::name,
        .description = "A ball slides, rolls and comes to rest on a moving plate.",
        .equations = {"mass v' = F,  |F| <= friction mass gravity, against v - radius spin - s",
                      "2/5 mass radius^2 spin' = -radius F + M,  |M| <= resistance mass gravity, "
                      "against spin",
                      "s = plate-speed cos(plate-frequency t), the velocity of the plate"},
        .parameters = {{.name = "mass",
                        .initial = 0.2,
                        .unit = "kg",
                        .range = {.lower = 0},
                        .meaning = "of the ball"},
                       {.name = "radius",
                        .initial = 0.05,
                        .unit = "m",
                        .range = {.lower = 0},
                        .meaning = "of the ball"},
                       {.name = "friction",
                        .initial = 0.3,
                        .unit = "1",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "coefficient of sliding"},
                       {.name = "resistance",
                        .initial = 0.001,
                        .unit = "m",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "lever arm of the resistance to rolling"},
                       {.name = "plate-speed",
                        .initial = 0.1,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "largest speed of the plate"},
                       {.name = "plate-frequency",
                        .initial = 0,
                        .unit = "rad/s",
                        .range = {.lower = 0, .lower_included = true},
                        .meaning = "of the plate; 0: a constant speed"},
                       {.name = "gravity",
                        .initial = 9.81,
                        .unit = "m/s^2",
                        .range = {.lower = 0},
                        .meaning = "downward"},
                       {.name = "velocity",
                        .initial = 1,
                        .unit = "m/s",
                        .range = {},
                        .meaning = "at the start"},
                       {.name = "spin",
                        .initial = 0,
                        .unit = "rad/s",
                        .range = {},
                        .meaning = "at the start"}},
        .state = {{.name = "v", .unit = "m/s", .meaning = "velocity"},
                  {.name = "spin", .unit = "rad/s", .meaning = "rolling towards v where positive"}},
        .guards = {{.name = "contact", .event = "switch"}, {.name = "rolling", .event = "switch"}},
        .modes = {"sliding ahead, spinning ahead", "rolling ahead", "sliding back, spinning ahead",
                  "sliding ahead, no spin", "at rest on the plate", "sliding back, no spin",
                  "sliding ahead, spinning back", "rolling back", "sliding back, spinning back",
                  "set-valued"},
        .t_end = 6,
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "event", "bathe", "time-stepping"},
        .set_valued_step = 0.005,
        .program = "nonsmooth",
    };
}

// --- two contact block ---

// Long: one entry of the list of systems.
SystemEntry two_contact_block_entry()
{
    return {
        .name = TwoContactBlock::name,
        .description = "A block falls on its two corners, bounces, slides and comes to rest.",
        .equations = coulomb(),
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
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "time-stepping"},
        .set_valued_step = 1e-3,
        .program = "nonsmooth",
    };
}

// --- woodpecker ---

SystemEntry woodpecker_entry()
{
    return {
        .name = Woodpecker::name,
        .description = "A toy bird on a spring climbs down a pole by impacts and jamming.",
        .source =
            "F. Pfeiffer, Mechanische Systeme mit unstetigen Übergängen, Ingenieur-Archiv "
            "54, 1984; C. Glocker and C. Studer, Multibody System Dynamics 13, 2005",
        .equations = coulomb(),
        .parameters =
            {{.name = "friction",
              .initial = 0.3,
              .unit = "1",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "coefficient at all contacts"},
             {.name = "beak-restitution",
              .initial = 0.5,
              .unit = "1",
              .range = {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
              .meaning = "of the beak on the pole"},
             {.name = "spring",
              .initial = 5.6e-3,
              .unit = "N m",
              .range = {.lower = 0},
              .meaning = "between sleeve and bird"},
             {.name = "gravity",
              .initial = 9.81,
              .unit = "m/s^2",
              .range = {.lower = 0},
              .meaning = "downward"}},
        .state = {{.name = "y", .unit = "m", .meaning = "height of the sleeve"},
                  {.name = "sleeve", .unit = "rad", .meaning = "angle of the sleeve"},
                  {.name = "bird", .unit = "rad", .meaning = "angle of the bird"},
                  {.name = "y'", .unit = "m/s", .meaning = "velocity of the sleeve"},
                  {.name = "sleeve'", .unit = "rad/s", .meaning = "rate of the sleeve"},
                  {.name = "bird'", .unit = "rad/s", .meaning = "rate of the bird"}},
        .guards = {{.name = "beak", .event = "impact"},
                   {.name = "lower edge", .event = "impact"},
                   {.name = "upper edge", .event = "impact"}},
        .t_end = 1,
        .start = nullptr,
        .run = nullptr,
        .integrators = {"handover", "time-stepping"},
        .set_valued_step = 2e-5,
        .program = "nonsmooth",
    };
}

}  // namespace ricochet::app
