// Checks of steps chosen by a network.
#pragma once

#include "measure.hpp"

namespace ricochet::bench {

/// Gains in Newton iterations at a relative L2 error of the velocity of 1e-2, median of five seeds,
/// on faults of 10 x 10, 25 x 25 and 50 x 50 elements, 3 and 5 km.
[[nodiscard]] Measured gain_over_classical_rules();
[[nodiscard]] Measured gain_over_heuristic();
[[nodiscard]] Measured gain_over_constant_steps();
[[nodiscard]] Measured final_slip_of_policies();

/// Gains on random problems on which no policy was trained.
[[nodiscard]] Measured gain_on_held_out_faults();
[[nodiscard]] Measured gain_on_sliding_mode();
[[nodiscard]] Measured gain_on_diode_circuit();

[[nodiscard]] Measured time_of_training();

}  // namespace ricochet::bench
