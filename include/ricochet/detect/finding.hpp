// What a detector says of a step.
#pragma once

#include "ricochet/hybrid/guard.hpp"
#include "ricochet/hybrid/guard_view.hpp"
#include "ricochet/hybrid/statistics.hpp"

namespace ricochet {

/// The guard over one step: the side on which it is armed, and its values at
/// both ends. A detector fills in `end`, which is the start of the next step.
struct Watch {
    Side side = Side::plateau;
    GuardSample start;
    GuardSample end;
};

/// Either "clear", with its evidence, or a stretch of the step in which the guard
/// leaves `side`: still on it at `lo`, across or on the surface at `hi`.
struct Finding {
    bool hit = false;
    Evidence evidence = Evidence::assumed;
    Side side = Side::plateau;
    GuardSample lo;
    GuardSample hi;
    bool late = false;  ///< the guard had left its side before the step began

    [[nodiscard]] static constexpr Finding clear(Evidence evidence) noexcept
    {
        Finding finding;
        finding.evidence = evidence;
        return finding;
    }

    [[nodiscard]] static constexpr Finding leaving(Side side, const GuardSample& lo,
                                                   const GuardSample& hi) noexcept
    {
        return {.hit = true, .side = side, .lo = lo, .hi = hi};
    }
};

}  // namespace ricochet
