// Internal: the declarations of this header may change without notice.
//
// A guard whose power series over a step is known.
//
// In the fraction u = s / h of the step let p(u) = sum_k q_k u^k, positive on the armed side. The
// first four terms in Bernstein form, minus the sizes of all others and a bound of the rounding,
// are below p everywhere, which usually decides a step. Otherwise the whole polynomial is brought
// into Bernstein form and halved until each part has no change of sign, or one (Farouki 2012,
// section 5.3). Cases that rounding leaves open are reported as such.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/detail/guard_view.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::detail {

/// First event of the polynomial of a guard in an interval of a step, apart from a root at its
/// start.
struct SeriesInterval {
    enum class Kind {
        clear,     ///< stays on its side
        crossing,  ///< has one root between `lo` and `hi`, and leaves its side there
        unsure,    ///< is clear before `lo`, and not known up to `hi`
    };
    Kind kind = Kind::unsure;
    double lo = 0;  ///< [s] offset in the step
    double hi = 0;  ///< [s]
};

/// The power series of one guard over a step, and what the guard is checked for.
struct GuardSeries {
    SeriesTerms terms;  ///< of all guards
    std::size_t which = 0;
    double h = 0;     ///< [s] length of the step
    double sign = 1;  ///< of the armed side: times this, the guard is positive there
    /// Whether the guard starts on its surface: there is a root at 0, which does not count.
    bool from_surface = false;
    double touch = 0;  ///< value of the guard, times `sign`, down to which it is clear
};

/// Sizes of the last two terms of guard i at h together, which measure the terms that its series
/// omits.
[[nodiscard, gnu::always_inline]] inline double last_terms(const SeriesTerms& terms, std::size_t i,
                                                           double h) noexcept
{
    const double* const top =
        terms.coefficients + i + static_cast<std::size_t>(terms.order) * terms.stride;
    const double h2 = h * h;
    const double h4 = h2 * h2;
    double power = h4 / h;
    for (int k = 8; k <= terms.order; k += 4) power *= h4;
    return power * (std::fabs(top[0]) * h + std::fabs(*(top - terms.stride)));
}

/// Whether the series of guard i, with the values g0 and g1 at its ends, has converged at h. One
/// that has not is no evidence: the step suits the flow, and a guard may vary faster.
[[nodiscard, gnu::always_inline]] inline bool series_converges(const SeriesTerms& terms,
                                                               std::size_t i, double h, double g0,
                                                               double g1) noexcept
{
    return last_terms(terms, i, h) <= 0x1p-20 * std::max(std::fabs(g0), std::fabs(g1));
}

/// Whether the guard stays clear in (0, h], proved except for the terms that its series omits. A
/// root at the start is divided out.
[[nodiscard, gnu::always_inline]] inline bool series_clears(const GuardSeries& guard) noexcept
{
    const SeriesTerms& terms = guard.terms;
    const double sign = guard.sign, h = guard.h, touch = guard.touch;
    const double* const g = terms.coefficients + guard.which;
    const std::size_t n = terms.stride;
    const auto size_of = [&](int k) { return std::fabs(g[static_cast<std::size_t>(k) * n]); };
    const double h2 = h * h;
    const double h4 = h2 * h2;
    double tail = size_of(terms.order);
    for (int k = terms.order - 4; k >= 4; k -= 4) {
        tail = tail * h4 +
               ((size_of(k) + h * size_of(k + 1)) + h2 * (size_of(k + 2) + h * size_of(k + 3)));
    }
    tail *= h4;
    const double q0 = sign * g[0];
    const double q1 = sign * g[n] * h;
    const double q2 = sign * g[2 * n] * h2;
    const double q3 = sign * g[3 * n] * (h * h2);
    // Some 50 roundings of at most the sum of all sizes.
    const double size = ((std::fabs(q0) + std::fabs(q1)) + (std::fabs(q2) + std::fabs(q3))) + tail;
    const double less = (tail + 4 * last_terms(terms, guard.which, h)) + 0x1p-47 * size;
    if (guard.from_surface) {
        if (std::fabs(q0) > touch + 0x1p-44 * size) return false;
        const double middle = q1 + 0.5 * q2;
        return std::min(std::min(q1, middle), q1 + (q2 + q3)) - less > 0 &&
               q0 + (q1 + (q2 + q3)) - less > touch;
    }
    const double b1 = q0 + (1.0 / 3) * q1;
    const double b2 = q0 + (1.0 / 3) * (2 * q1 + q2);
    const double b3 = q0 + (q1 + (q2 + q3));
    return std::min(std::min(q0, b1), std::min(b2, b3)) - less > touch;
}

/// As `series_clears`, with more terms, up to all of them. Takes a copy, so that the caller's stays
/// in registers for `series_clears`, which decides nearly every step.
[[nodiscard]] bool series_clears_closely(GuardSeries guard) noexcept;

/// First event of the guard between the samples `start` and `end` in the step. Where the samples
/// differ from the series, which omits its last terms, nothing smaller than the difference is
/// certain.
[[nodiscard]] SeriesInterval first_leaving(const GuardSeries& guard, const GuardSample& start,
                                           const GuardSample& end) noexcept;

}  // namespace ricochet::detail
