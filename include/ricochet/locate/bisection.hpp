// Bisection on the step's own map: the plainest location, and the source paper's.
#pragma once

#include "ricochet/detect/step_probe.hpp"

namespace ricochet {

/// Halves the bracket until it is no wider than the tolerance or its ends are
/// neighbouring doubles. Only the side of the guard is used, so any guard will do; its
/// values say at the end whether it has a zero there.
struct Bisection {
    [[nodiscard]] Location locate(GuardPath& path, GuardSample lo, GuardSample hi,
                                  double tolerance) const;
};

}  // namespace ricochet
