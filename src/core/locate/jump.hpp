// Changes of sign without a zero: poles and jumps of a guard.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "ricochet/step_probe.hpp"

namespace ricochet::detail {

/// A change of the guard across the narrowest bracket by more than this fraction of the
/// guard's size in the step is not a crossing of zero.
inline constexpr double jump_part = 1e-3;

/// The larger of a size and |g|; the size if g is not finite.
[[nodiscard]] inline double larger(double size, double g) noexcept
{
    return std::fabs(g) > size && std::isfinite(g) ? std::fabs(g) : size;
}

/// Whether the guard may jump in the bracket: its ends differ too much for a zero.
[[nodiscard]] inline bool may_jump(const GuardSample& lo, const GuardSample& hi,
                                   double size) noexcept
{
    const double change = std::fabs(hi.value - lo.value);
    return !(change <= jump_part * size) && change > 2 * std::numeric_limits<double>::min();
}

/// Whether the guard jumps in the bracket or has a pole there, rather than a zero: while the
/// guard differs too much at its ends, the bracket is narrowed, until the middle lies on a
/// straight line or there is none. `size`: |g| in the step. A change that rounding of the time
/// and the state may cause is not a jump.
[[nodiscard, gnu::noinline]] inline bool jumps(GuardPath& path, GuardSample lo, GuardSample hi,
                                               double size)
{
    while (may_jump(lo, hi, size)) {
        const double middle = lo.s + (hi.s - lo.s) / 2;
        if (hi.s - lo.s <= path.finest(hi.s) || middle <= lo.s || middle >= hi.s) {
            // All from one evaluation of the motion: two differ by the error of the step.
            lo = path.value(lo.s);
            hi = path.value(hi.s);
            const double change = std::fabs(hi.value - lo.value);
            return path.has_left(lo) != path.has_left(hi) &&
                   (!std::isfinite(change) || change > path.rounding(hi.s));
        }
        const GuardSample sample = path.value(middle);
        const double change = std::fabs(hi.value - lo.value);
        const double bend = std::fabs(sample.value - (lo.value + hi.value) / 2);
        if (std::isfinite(change) && bend <= change / 4) return false;
        size = larger(size, sample.value);
        (path.has_left(sample) ? hi : lo) = sample;
    }
    return false;
}

/// Location of a jump. At a pole itself the guard is not finite, and there is no state to continue
/// from: the bracket then reaches a few doubles beyond it, at most to `end`.
[[nodiscard, gnu::noinline]] inline Location jump_at(GuardPath& path, const GuardSample& lo,
                                                     GuardSample hi, double end)
{
    double beyond = path.finest(hi.s);
    for (int i = 0; i < 40 && !std::isfinite(hi.value) && hi.s + beyond < end; ++i) {
        const GuardSample next = path.value(hi.s + beyond);
        if (std::isfinite(next.value) && !path.has_left(next)) break;
        hi = next;
        beyond *= 2;
    }
    return {.lo = lo.s, .hi = hi.s, .root = hi.s, .error = hi.s - lo.s, .jump = true};
}

}  // namespace ricochet::detail
