#include "ricochet/faults/incremental.hpp"

#include "base/require.hpp"

namespace ricochet {

void validate(const SpringBlock& block)
{
    detail::require_positive("SpringBlock", "mass", block.mass);
    detail::require_not_negative("SpringBlock", "stiffness", block.stiffness);
    detail::require_positive("SpringBlock", "normal_force", block.normal_force);
}

}  // namespace ricochet
