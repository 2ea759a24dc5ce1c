// Internal: the declarations of this header may change without notice.
//
// The first root of a guard whose power series over a step is known.
//
// Newton's method on the polynomial p finds a root r. With u = s / r and P_k = p_k r^k,
//
//     p(u) = p(r) + (u - 1) R(u),    R(u) = sum_j S_{j+1} u^j,    S_j = sum_{k >= j} P_k
//
// and where R is negative on [0, 1], r is the first root and p falls there. The first four
// coefficients of R in Bernstein form, with the sizes of all others, mostly show that.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "ricochet/detail/series_guard.hpp"

namespace ricochet::detail {

struct SeriesRoot {
    double s = 0;      ///< [s] offset in the step
    double slope = 0;  ///< of the guard there
};

/// The polynomial of one guard, times a sign; a root at 0 is divided out.
class GuardPolynomial {
public:
    explicit GuardPolynomial(const GuardSeries& guard) noexcept
        : c_(guard.terms.coefficients + (guard.from_surface ? guard.terms.stride : 0) +
             guard.which),
          stride_(guard.terms.stride),
          last_(guard.terms.order - 4),
          sign_(guard.sign),
          top_(guard.from_surface ? 0 : (*this)[guard.terms.order])
    {
    }

    [[nodiscard]] double operator[](int k) const noexcept
    {
        return sign_ * c_[static_cast<std::size_t>(k) * stride_];
    }

    struct Point {
        double value;
        double slope;
    };
    [[nodiscard]] Point at(double s) const noexcept
    {
        const Powers power(s);
        Point sum{top_, 0};
        for (int k = last_; k >= 0; k -= 4) add(k, power, sum, [](double c) { return c; });
        return sum;
    }

    /// Whether r is the first root, and the polynomial falls there. @param slope  there
    [[nodiscard]] bool is_first_root(double r, double& slope) const noexcept
    {
        const Powers power(r);
        Point high{top_, 0};  // of the terms from the fourth on, over r^4
        Point sizes{std::fabs(top_), 0};
        for (int k = last_; k >= 4; k -= 4) {
            add(k, power, high, [](double c) { return c; });
            add(k, power, sizes, [](double c) { return std::fabs(c); });
        }
        const double c1 = (*this)[1], c2 = (*this)[2], c3 = (*this)[3];
        slope = (c1 + 2 * r * c2) +
                (3 * power.s2 * c3 + (4 * power.s3 * high.value + power.s4 * high.slope));
        const double p1 = c1 * r, p2 = c2 * power.s2, p3 = c3 * power.s3;
        const double s4 = high.value * power.s4;
        const double s3 = p3 + s4;
        const double s2 = p2 + s3;
        const double s1 = p1 + s2;
        const double tail = r * power.s4 * sizes.slope;
        const double size =
            ((std::fabs(p1) + std::fabs(p2)) + std::fabs(p3)) + (tail + 4 * power.s4 * sizes.value);
        const double b1 = s1 + (1.0 / 3) * s2;
        const double b2 = s1 + (1.0 / 3) * (2 * s2 + s3);
        const double b3 = s1 + (s2 + (s3 + s4));
        // Some 50 roundings of at most the sum of all sizes.
        return std::max(std::max(s1, b1), std::max(b2, b3)) + (tail + 0x1p-46 * size) < 0;
    }

private:
    struct Powers {
        explicit Powers(double s_) noexcept : s(s_), s2(s * s), s3(s2 * s), s4(s2 * s2) {}
        double s, s2, s3, s4;
    };

    /// sum s^4 + (terms k to k + 3)
    template <class Use>
    [[gnu::always_inline]] void add(int k, const Powers& power, Point& sum,
                                    const Use& use) const noexcept
    {
        const double a = use((*this)[k]), b = use((*this)[k + 1]);
        const double c = use((*this)[k + 2]), d = use((*this)[k + 3]);
        sum.slope = sum.slope * power.s4 +
                    (4 * power.s3 * sum.value + ((b + 2 * power.s * c) + 3 * power.s2 * d));
        sum.value = sum.value * power.s4 + ((a + power.s * b) + power.s2 * (c + power.s * d));
    }

    const double* c_;
    std::size_t stride_;
    int last_;  ///< block of four coefficients
    double sign_;
    double top_;  ///< the coefficient after it
};

/// The first root of the guard in (0, h), where the guard, times its sign, falls through it and
/// ends at `end` < 0; false where that is not certain. Terms come in groups of four, after the
/// constant.
[[nodiscard]] inline bool find_first_root(const GuardSeries& guard, double end,
                                          SeriesRoot& root) noexcept
{
    const GuardPolynomial p(guard);
    const double h = guard.h;
    // The parabola through the start, its slope and the end.
    const double v0 = p[0];
    const double v1 = guard.from_surface ? end / h : end;
    if (!(v0 > 0 && v1 < 0)) return false;
    const double r0 = p[1] * h;
    const double bend = v1 - v0 - r0;
    const double width = std::sqrt(r0 * r0 - 4 * bend * v0);
    double s = h * (r0 > 0 ? -(r0 + width) / (2 * bend) : 2 * v0 / (width - r0));
    double lo = 0;
    double hi = h;
    constexpr int most_steps = 12;
    for (int k = 0;; ++k) {
        if (!(s > lo && s < hi)) s = lo + 0.5 * (hi - lo);
        const GuardPolynomial::Point at = p.at(s);
        const double correction = -at.value / at.slope;
        (at.value > 0 ? lo : hi) = s;
        s += correction;
        // The last correction is computed from the guard itself: convergence is quadratic.
        if (std::fabs(correction) <= 0x1p-13 * s) break;
        if (k == most_steps) return false;
    }
    if (!(s > 0 && s < h)) return false;
    double slope = 0;
    if (!p.is_first_root(s, slope)) return false;
    root = {s, guard.sign * (guard.from_surface ? s * slope : slope)};
    return true;
}

}  // namespace ricochet::detail
