// The bracket that a locator narrows.
#pragma once

#include "ricochet/step_probe.hpp"

namespace ricochet::detail {

/// Offsets between which a guard leaves its side.
struct Bracket {
    GuardSample lo;
    GuardSample hi;

    [[nodiscard]] double width() const noexcept { return hi.s - lo.s; }
    [[nodiscard]] bool contains(double s) const noexcept { return s > lo.s && s < hi.s; }
};

}  // namespace ricochet::detail
