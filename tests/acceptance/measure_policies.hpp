// Checks of policies that reinforcement learning finds.
#pragma once

#include "measure.hpp"

namespace ricochet::bench {

/// TQC on a fault of one element by the published reward and by the additive one: costs and true
/// errors of the policies, beside constant steps.
[[nodiscard]] Measured tqc_by_both_rewards();

}  // namespace ricochet::bench
