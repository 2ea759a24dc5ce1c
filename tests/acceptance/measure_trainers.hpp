// Checks of the trainers of policies.
#pragma once

#include "measure.hpp"

namespace ricochet::bench {

/// TQC with the networks of the source, on an environment of negligible cost.
[[nodiscard]] Measured time_of_tqc();

/// Both trainers on a linear-quadratic regulator.
[[nodiscard]] Measured cost_over_optimum();

/// Both trainers on a pendulum that must be swung up.
[[nodiscard]] Measured swing_up();

}  // namespace ricochet::bench
