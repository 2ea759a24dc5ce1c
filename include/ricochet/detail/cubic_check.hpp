// Internal: the declarations of this header may change without notice.
//
// Tests whether the cubic through the ends of an interval describes a guard inside it.
//
// Error control resolves the state, not the guard: where the state stands still or moves
// slowly, steps grow without regard to a guard that depends on time. One evaluation at an
// offset that is no simple fraction of the interval is compared with the cubic through the
// values and rates at its ends. An interval where they disagree is divided until they agree
// (src/core/resolved_parts.hpp).
#pragma once

#include <array>
#include <cmath>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/guard_view.hpp"

namespace ricochet::detail {

/// The guard at the ends of an interval, as a cubic over u in [0, 1].
struct CubicCheck {
    /// Fraction of an interval at which the guard is evaluated: the golden section, so that no
    /// guard whose period has a simple ratio to the step escapes it, and a second one for cases of
    /// doubt.
    static constexpr double inside = 0.381966;
    static constexpr double further = 0.723607;
    /// Further fractions of a step at which the guard is evaluated if the state stands still in it,
    /// so that nothing has limited its length: no gap between evaluations exceeds an eighth of it.
    static constexpr std::array<double, 8> places = {0.0902, 0.2016,  0.3069, 0.4934,
                                                     0.6123, further, 0.8278, 0.9271};

    /// The largest deviation inside the interval is assumed to be at most 64 e where it is e at
    /// `inside`: a quartic term deviates by 1.1 e, a quintic one by 1.4 e, and higher terms cancel
    /// at `inside` only by coincidence.
    static constexpr double most = 64;

    /// Where one evaluation deviates by so little that the guard stays clear by this factor,
    /// a second is not needed: a guard that does not follow its cubic agrees with it this well
    /// at `inside` one time in a thousand.
    static constexpr double doubt = 1024;

    /// Terms of guards above 1e306 overflow. Such guards are compared in a unit of this size, a
    /// power of two, which changes no bit of a result.
    static constexpr double large_unit = 0x1p600;

    double v0, b1, b2, v1;  ///< control points

    CubicCheck(double g0, double rate0, double g1, double rate1, double width) noexcept
        : v0(g0), b1(g0 + rate0 * (width / 3)), b2(g1 - rate1 * (width / 3)), v1(g1)
    {
    }

    /// The cubic at `u`.
    [[nodiscard]] double at(double u) const noexcept
    {
        const double w = 1 - u;
        return w * w * (w * v0 + 3 * u * b1) + u * u * (3 * w * b2 + u * v1);
    }

    /// How far a value at `u` is from the cubic.
    [[nodiscard]] double deviation(double u, double value) const noexcept
    {
        return std::fabs(value - at(u));
    }

    /// The lowest control point of the cubic times `sign`, excluding the start, which may be
    /// on the surface.
    [[nodiscard]] double lowest(double sign) const noexcept
    {
        return least_of(least_of(sign * b1, sign * b2), sign * v1);
    }

    /// Whether a guard that deviates by `e` inside keeps the sign of its end throughout, apart
    /// from its start, which is decided separately.
    [[nodiscard]] bool stays_clear(double e) const noexcept
    {
        return lowest(v1 < 0 ? -1 : 1) > most * e;
    }

    /// Whether its shape is close enough to the cubic for a detector to rely on.
    [[nodiscard]] bool keeps_shape(double e) const noexcept { return most * most * e <= size(); }

    /// The largest control point.
    [[nodiscard]] double size() const noexcept
    {
        return greatest_of(greatest_of(std::fabs(v0), std::fabs(b1)),
                           greatest_of(std::fabs(b2), std::fabs(v1)));
    }
};

/// `CubicCheck::inside` as a compile-time constant.
struct InsideOf {
    static constexpr double u = CubicCheck::inside;
};

}  // namespace ricochet::detail
