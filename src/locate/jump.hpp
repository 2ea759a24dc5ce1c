// Changes of sign without a zero: poles and jumps of a guard.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "ricochet/detect/step_probe.hpp"

namespace ricochet::detail {

/// A change of the guard across the narrowest bracket that is more than this part of the
/// guard's size in the step is no crossing of zero.
inline constexpr double jump_part = 1e-3;

/// The larger of a size and |g|, as far as that is finite.
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

/// Whether the guard jumps in the bracket or has a pole there, rather than a zero: it is
/// narrowed, as long as the guard differs too much at its ends, until the middle shows a
/// straight line or there is none. `size`: |g| in the step. What rounding of the time and
/// the state may change is no jump.
[[nodiscard, gnu::noinline]] inline bool jumps(GuardPath& path, GuardSample lo, GuardSample hi,
                                               double size)
{
    while (may_jump(lo, hi, size)) {
        const double middle = lo.s + (hi.s - lo.s) / 2;
        if (hi.s - lo.s <= path.finest(hi.s) || middle <= lo.s || middle >= hi.s) {
            // By one way of following the motion: two differ by the error of the step.
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

/// Where the guard jumps. On a pole itself it is not finite, and no state to continue from: the
/// bracket then reaches a few doubles beyond it, at most to `end`.
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
