// Acceptance checks of set-valued motion.
#include <vector>

#include "measure.hpp"

namespace ricochet::bench {

std::vector<Check> nonsmooth_checks()
{
    return {
        {.topic = "nonsmooth",
         .id = "hand-over-sliding",
         .sentence = "sliding mode and its training case, handed over",
         .target = "t* within 1e-12 s, the state exactly 0 afterwards",
         .run = hand_over_sliding_mode},
        {.topic = "nonsmooth",
         .id = "hand-over-circuit",
         .sentence = "diode circuit and its training case, handed over",
         .target = "all changes in order, times within 1e-9 s, final states within 1e-10",
         .run = hand_over_circuit},
        {.topic = "nonsmooth",
         .id = "circuit-time",
         .sentence = "diode circuit to a relative L2 error of 1e-8",
         .target = "<= 50 us",
         .run = time_circuit_to_1e8},
        {.topic = "nonsmooth",
         .id = "sliding-time",
         .sentence = "sliding mode to an L2 error of 1.7e-4",
         .target = "<= 50 us",
         .run = time_sliding_mode},
        {.topic = "nonsmooth",
         .id = "bathe-time",
         .sentence = "Bathe's steps on the diode circuit to a relative L2 error of 2.5e-3",
         .target = "<= 1 ms",
         .run = time_bathe_on_circuit},
        {.topic = "nonsmooth",
         .id = "set-valued-work",
         .sentence = "run time against error: hand-over, Bathe with every controller",
         .target = "shown",
         .run = compare_work},
        {.topic = "nonsmooth",
         .id = "bathe-orders",
         .sentence = "order of Bathe's steps: smooth, located jumps, jumps stepped over",
         .target = "2, 2, below 1.6",
         .run = observe_bathe_orders},
        {.topic = "nonsmooth",
         .id = "set-valued-energy",
         .sentence = "largest growth of the energy in a step, oscillator with Coulomb friction",
         .target = "none for backward Euler and without friction; 1.07 up to the natural step",
         .run = grow_energy},
        {.topic = "nonsmooth",
         .id = "random-contacts",
         .sentence = "1e5 random contact problems of 1 to 50 contacts",
         .target = "residual <= 1e-10 or reported, none loops",
         .run = solve_contacts},
    };
}

}  // namespace ricochet::bench
