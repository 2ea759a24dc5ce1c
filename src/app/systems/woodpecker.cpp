#include "ricochet/systems/woodpecker.hpp"

#include "entries.hpp"

namespace ricochet::app {

SystemEntry woodpecker_entry()
{
    return {
        .name = Woodpecker::name,
        .description = "A toy bird on a spring climbs down a pole by impacts and jamming.",
        .source =
            "F. Pfeiffer, Mechanische Systeme mit unstetigen Übergängen, Ingenieur-Archiv "
            "54, 1984; C. Glocker and C. Studer, Multibody System Dynamics 13, 2005",
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
