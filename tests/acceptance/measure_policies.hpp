// Checks of policies that reinforcement learning finds.
#pragma once

#include "measure.hpp"

namespace ricochet::bench {

/// TQC on a fault of one element by the published reward and by the additive one: what the policies
/// cost and how wrong they truly are, beside constant steps.
[[nodiscard]] Measured tqc_by_both_rewards();

}  // namespace ricochet::bench
