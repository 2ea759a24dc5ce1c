// Newton's method inside a bracket, with the slope from the flow: the default.
//
// The first guess is the root of the cubic through the guard and its rates at both
// ends of the bracket. Once a sample is so near the root that the motion from there
// is straight to the last bit, the rest of the way is taken along the flow at that
// sample, which costs no further step: the bracket closes around the root at the
// price of guard calls alone, and does not widen with the rounding of a long step.
// That the guard is straight does not say that the rest of the state is: the way
// is never longer than a small part of the bracket, of which the square is rounding.
#pragma once

#include <algorithm>
#include <cmath>

#include "ricochet/detect/step_probe.hpp"

namespace ricochet {

namespace detail {

/// Root in [0, 1] of the cubic with values v0, v1 and slopes r0, r1 at 0 and 1,
/// where it leaves the side of `sign` (1: above, -1: below). Newton's method starts
/// from the root of the parabola through v0, r0 and v1, which for a guard that bends
/// one way is already near; a start on the surface is not taken for the root.
[[nodiscard]] inline double hermite_root(double v0, double r0, double v1, double r1,
                                         double sign) noexcept
{
    // v0 + r0 u + q u^2, the root at which it falls (for sign 1)
    const double q = v1 - v0 - r0;
    const double root = std::sqrt(r0 * r0 - 4 * q * v0);
    double u = sign * r0 > 0 ? -(r0 + sign * root) / (2 * q) : 2 * v0 / (sign * root - r0);
    if (!(u > 0 && u < 1)) u = 1;

    const double b = 3 * (v1 - v0) - 2 * r0 - r1;
    const double c = 2 * (v0 - v1) + r0 + r1;
    double lo = 0;
    double hi = 1;
    for (int i = 0; i < 40; ++i) {
        const double p = v0 + u * (r0 + u * (b + u * c));
        const double slope = r0 + u * (2 * b + u * 3 * c);
        const double next = u - p / slope;
        if (std::fabs(next - u) <= 1e-8 * u) return next;  // convergence is quadratic
        (sign * p <= 0 ? hi : lo) = u;
        u = next > lo && next < hi ? next : 0.5 * (lo + hi);
    }
    return u;
}

}  // namespace detail

struct Newton {
    template <class Probe>
    [[nodiscard]] Location locate(Probe& probe, GuardSample lo, GuardSample hi,
                                  double tolerance) const
    {
        const double reach = straight_part * (hi.s - lo.s);
        double s = first_guess(probe, lo, hi);
        double curvature = bend(lo, hi);
        double past = 0;
        for (int slow = 0;;) {
            const double width = hi.s - lo.s;
            const double finest = probe.finest(hi.s);
            if (width <= std::max(tolerance, finest)) break;
            // A root at an end is looked for beside it.
            const double beside = std::max(finest, reach / 4);
            if (s >= hi.s && slow == 0) s = hi.s - beside;
            if (s <= lo.s && slow == 0) s = lo.s + beside;
            if (!(s > lo.s && s < hi.s)) s = lo.s + width / 2;
            if (s <= lo.s || s >= hi.s) break;  // neighbouring doubles

            const GuardSample sample = probe.value_and_rate(s);
            const bool beyond = probe.has_left(sample);
            curvature = std::max({curvature, bend(lo, sample), bend(sample, hi)});
            (beyond ? hi : lo) = sample;
            const double correction = -sample.value / sample.rate;
            const double distance = std::fabs(correction);
            // What a straight line neglects over that distance, as a shift in time.
            const bool straight =
                distance <= std::min(width, std::max(reach, finest)) &&
                distance * distance * curvature <=
                    std::fabs(sample.rate) * std::max(finest, tolerance) / 2;
            if (straight && close_in(probe, sample, correction, tolerance, lo, hi)) {
                const TwoSum predicted = two_sum(sample.s, correction);
                const TwoSum root = predicted.value < lo.s   ? two_sum(lo.s, 0)
                                    : predicted.value > hi.s ? two_sum(hi.s, 0)
                                                             : predicted;
                probe.settle((root.value - sample.s) + root.remainder);
                return located(lo, hi, root);
            }
            // Converged from one side: reach for the other.
            past = distance > finest ? 0 : past > 0 ? 4 * past : finest;
            s += correction + (beyond ? -past : past);
            // Three samples that do not halve the bracket: bisect.
            slow = hi.s - lo.s > width / 2 ? slow + 1 : 0;
            if (slow == 3) {
                s = lo.s + (hi.s - lo.s) / 2;
                slow = 0;
            }
        }
        return located(lo, hi, {hi.s, 0});
    }

private:
    /// Of a bracket, along which the flow may be followed: its square is 9e-16.
    static constexpr double straight_part = 3e-8;

    [[nodiscard]] static Location located(const GuardSample& lo, const GuardSample& hi,
                                          const TwoSum& root) noexcept
    {
        const double rounding = std::fabs(hi.value / hi.rate);
        return {.lo = lo.s,
                .hi = hi.s,
                .root = root.value,
                .root_remainder = root.remainder,
                .slope = hi.rate,
                .error = rounding > hi.s - lo.s ? rounding : hi.s - lo.s};
    }

    /// Change of the rate from one sample to another, per second.
    [[nodiscard]] static double bend(const GuardSample& a, const GuardSample& b) noexcept
    {
        return std::fabs((b.rate - a.rate) / (b.s - a.s));
    }

    template <class Probe>
    [[nodiscard]] static double first_guess(Probe& probe, GuardSample& lo, GuardSample& hi)
    {
        probe.complete(lo);
        probe.complete(hi);
        const double width = hi.s - lo.s;
        const double u = detail::hermite_root(lo.value, lo.rate * width, hi.value, hi.rate * width,
                                              probe.side() == Side::above ? 1 : -1);
        return lo.s + u * width;
    }

    /// Brackets the root predicted from `sample` as narrowly as rounding in the
    /// guard allows: from the predicted root outwards until the side changes. False
    /// if it does not change within the bracket: the prediction was wrong.
    template <class Probe>
    [[nodiscard]] static bool close_in(Probe& probe, const GuardSample& sample, double correction,
                                       double tolerance, GuardSample& lo, GuardSample& hi)
    {
        double s = sample.s + correction;
        // Three quarters of the relative epsilon always reach the next double, and
        // never pass the one after it.
        double margin = std::max(tolerance / 2, 0.75 * probe.finest(s));
        const double widest = 0x1p20 * margin;
        int direction = 0;
        if (s <= lo.s) {
            direction = 1;
            s = lo.s + margin;
        } else if (s >= hi.s) {
            direction = -1;
            s = hi.s - margin;
        }
        while (s > lo.s && s < hi.s) {
            const GuardSample at = probe.along_the_flow(sample, s);
            const int toward = probe.has_left(at) ? -1 : 1;
            (toward < 0 ? hi : lo) = at;
            if (toward == -direction) return true;
            direction = toward;
            s += toward * margin;
            margin *= 2;
            if (margin > widest) return false;  // the prediction was wrong
        }
        return false;
    }
};

}  // namespace ricochet
