// Acceptance checks of detectors that skip evaluations of expensive guards.
#include <vector>

#include "certificates.hpp"
#include "measure.hpp"
#include "measure_gates.hpp"

namespace ricochet::bench {

std::vector<Check> guard_checks()
{
    return {
        {.topic = "guards",
         .id = "planned-cavern",
         .sentence = "cavern of 10000 segments: planned against brute force at every ms",
         .target = ">= 50x in time, the same events",
         .run = time_cavern},
        {.topic = "guards",
         .id = "planned-cavern-dopri5",
         .sentence = "the same with dopri5 at 1e-9, looked at every ms at least",
         .target = "50x in time, the same events",
         .run = time_cavern_dopri5,
         .required = false},
        {.topic = "guards",
         .id = "planned-events",
         .sentence = "cavern of 10000 segments: the planner's events, times and states",
         .target = "those of a look at every step, bit for bit, over >= 30000 events",
         .run = compare_many_events},
        {.topic = "guards",
         .id = "location-calls",
         .sentence = "exact calls to locate an event of a dear guard, rk4 and dopri5",
         .target = "<= 5 on average",
         .run = count_location},
        {.topic = "guards",
         .id = "planned-cave-body",
         .sentence = "body of 1280 faces in a cave of 20480: planned against a look at every step",
         .target = ">= 30x in time, the same events",
         .run = time_cave_body},
        {.topic = "guards",
         .id = "planned-arms",
         .sentence =
             "arms of 4 and 6 joints among 8 and 40 obstacles: planned against brute force at "
             "every ms",
         .target = ">= 10x in time, the same events",
         .run = time_arms},
        {.topic = "guards",
         .id = "planned-zones",
         .sentence = "256 guards on one state",
         .target = ">= 100x in time, the same events",
         .run = time_zones},
        {.topic = "guards",
         .id = "planned-eigenvalue",
         .sentence = "smallest eigenvalue of a matrix of order 24",
         .target = ">= 25x in exact calls, the same events",
         .run = count_eigenvalues},
        {.topic = "guards",
         .id = "bounded-eigenvalue",
         .sentence = "the same with a table of proved bounds, against the two-ended cover alone",
         .target = ">= 1.5x in exact calls, the same events",
         .run = count_bounded_eigenvalues},
        {.topic = "guards",
         .id = "certified-eigenvalue",
         .sentence = "the same with a network that is proved, against the two-ended cover alone",
         .target = ">= 1.5x in exact calls, the same events",
         .run = count_certified_eigenvalue},
        {.topic = "guards",
         .id = "metered-networks",
         .sentence = "a useless and a hostile network of 2 x 64 with the meter on, in every scene",
         .target = "<= 1.05x the time of the better of planned and every step, the same events",
         .run = time_metered_networks},
        {.topic = "guards",
         .id = "verified-events",
         .sentence = "the verified gate with random, hostile and NaN weights, in every scene",
         .target = "the events of a look at every step, bit for bit",
         .run = same_events_whatever_the_weights},
        {.topic = "guards",
         .id = "gate-arm4",
         .sentence = "boolean black box on an arm of 4 joints: a horizon gate trained here",
         .target = ">= 4x fewer calls than every step, >= 1.5x than every k without a miss, no "
                   "miss in 30000 fresh events",
         .run = [] { return gate_black_box_4(); }},
        {.topic = "guards",
         .id = "gate-arm6",
         .sentence = "the same on an arm of 6 joints among 40 obstacles",
         .target = "reported",
         .run = [] { return gate_black_box_6(3'000); },
         .required = false},
        {.topic = "guards",
         .id = "gate-no-bounds",
         .sentence = "a valued guard without bounds: slope skip, every k, a horizon gate",
         .target = "the better reported, with what each misses",
         .run = [] { return gate_without_bounds(3'000); },
         .required = false},
        {.topic = "guards",
         .id = "certificates",
         .sentence = "networks of cavern, arms and eigenvalue proved over their boxes, 2 threads",
         .target = "2-D <= 1 s, 3-D <= 10 s, 4-D <= 300 s; >= 80 % of the far states cleared; no "
                   "violation; estimate within 2x",
         .run = prove_scenes},
    };
}

}  // namespace ricochet::bench
