// TOMS 748 from Boost.Math, for guards whose slope is not to be had.
#pragma once

#include "ricochet/detect/step_probe.hpp"

namespace ricochet {

/// Inverse cubic interpolation on the values alone (Alefeld, Potra and Shi, ACM
/// Transactions on Mathematical Software 21, 1995).
struct Toms748 {
    [[nodiscard]] Location locate(GuardPath& path, GuardSample lo, GuardSample hi,
                                  double tolerance) const;
};

}  // namespace ricochet
