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
#include <limits>

#include "ricochet/detect/step_probe.hpp"
#include "ricochet/detail/flat.hpp"
#include "ricochet/detail/jump.hpp"
#include "ricochet/detail/noise.hpp"

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
        const detail::NoiseScale scale{.size = size_of(lo, hi), .h = hi.s - lo.s};
        double size = detail::larger(detail::larger(0, lo.value), hi.value);
        const double end = hi.s;
        double curvature = bend(lo, hi);
        double past = 0;
        double last_distance = std::numeric_limits<double>::infinity();
        double last_value = std::numeric_limits<double>::infinity();
        int linear = 0;
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
            const GuardSample replaced = beyond ? hi : lo;
            (beyond ? hi : lo) = sample;
            const double correction = -sample.value / sample.rate;
            const double distance = std::fabs(correction);
            // What a straight line neglects over that distance, as a shift in time.
            const bool straight = distance <= std::min(width, std::max(reach, finest)) &&
                                  distance * distance * curvature <=
                                      std::fabs(sample.rate) * std::max(finest, tolerance) / 2;
            if (straight) {
                double noise = 0;
                if (close_in(probe, sample, correction, tolerance, scale, lo, hi, noise)) {
                    const TwoSum predicted = two_sum(sample.s, correction);
                    const TwoSum root = predicted.value < lo.s   ? two_sum(lo.s, 0)
                                        : predicted.value > hi.s ? two_sum(hi.s, 0)
                                                                 : predicted;
                    probe.settle((root.value - sample.s) + root.remainder);
                    return located(probe, lo, hi, root, size, end);
                }
                if (noise > 0) return hidden(probe, lo, hi, end, sample.rate, noise);
            } else if (scale.may_be(sample.value) &&
                       std::fabs(last_value) < 16 * std::fabs(sample.value)) {
                const double noise = detail::close_in_noise(probe, sample, s + correction,
                                                            sample.value, scale, lo, hi);
                if (noise > 0) return hidden(probe, lo, hi, end, sample.rate, noise);
            }
            last_value = sample.value;
            // Not by half nearer, again and again: a root of higher order, a pole, or none.
            linear = distance > 0.4 * last_distance && distance > 8 * finest ? linear + 1 : 0;
            last_distance = distance;
            if (linear == most_linear || !std::isfinite(correction)) {
                linear = 0;
                detail::narrow_by_values(probe, lo, hi, replaced, tolerance, 1e-3 * width, size);
                probe.complete(lo);
                probe.complete(hi);
                s = hi.s - hi.value / hi.rate;
                slow = 0;
                continue;
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
        return located(probe, lo, hi, {hi.s, 0}, size, end);
    }

private:
    /// Of a bracket, along which the flow may be followed: its square is 9e-16.
    static constexpr double straight_part = 3e-8;
    /// Corrections in sequence that are not by half shorter than the one before.
    static constexpr int most_linear = 4;

    template <class Probe>
    [[nodiscard]] static Location located(Probe& probe, const GuardSample& lo,
                                          const GuardSample& hi, const TwoSum& root, double size,
                                          double end)
    {
        const double rounding = std::fabs(hi.value / hi.rate);
        Location where{.lo = lo.s,
                       .hi = hi.s,
                       .root = root.value,
                       .root_remainder = root.remainder,
                       .slope = hi.rate,
                       .error = rounding > hi.s - lo.s ? rounding : hi.s - lo.s};
        if (detail::may_jump(lo, hi, size)) [[unlikely]]
            mark_jump(probe, lo, hi, size, end, where);
        return where;
    }

    /// A guard that jumps has no slope there, and its root is the place beyond.
    template <class Probe>
    [[gnu::noinline]] static void mark_jump(Probe& probe, const GuardSample& lo,
                                            const GuardSample& hi, double size, double end,
                                            Location& where)
    {
        const double slope = (hi.value - lo.value) / (hi.s - lo.s);
        for (const double rate : {lo.rate, hi.rate}) {
            if (slope / rate > 0 && slope / rate <= 16) return;  // as steep as it says
        }
        if (!detail::jumps(probe, lo, hi, size)) return;
        where = detail::jump_at(probe, lo, hi, end);
    }

    /// A root that the noise of the guard hides for as long as `noise` [s]. Along the flow the
    /// guard has left its side at `hi`; that the state there has, too, is seen to.
    template <class Probe>
    [[nodiscard]] static Location hidden(Probe& probe, const GuardSample& lo, GuardSample hi,
                                         double end, double rate, double noise)
    {
        const double width = std::max(hi.s - lo.s, noise / 4);
        for (int i = 0; i < 8 && hi.s < end; ++i) {
            if (probe.has_left(probe.value(hi.s))) break;
            hi.s = std::min(hi.s + width, end);
        }
        return {.lo = lo.s,
                .hi = hi.s,
                .root = hi.s,
                .slope = rate,
                .error = std::max(noise, hi.s - lo.s)};
    }

    /// |g| in the bracket, as far as its ends and their rates tell.
    [[nodiscard]] static double size_of(const GuardSample& lo, const GuardSample& hi) noexcept
    {
        const double width = hi.s - lo.s;
        double size = 0;
        for (const double g : {lo.value, hi.value, lo.rate * width, hi.rate * width}) {
            if (std::fabs(g) > size) size = std::fabs(g);
        }
        return size;
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

    /// Halves a bracket that had to be widened far from where the slope at `sample`, which a
    /// kink may have spoilt, predicted the root.
    template <class Probe>
    static void halve_along(Probe& probe, const GuardSample& sample, double tolerance,
                            GuardSample& lo, GuardSample& hi)
    {
        const double narrow = std::max(tolerance, 2 * probe.finest(hi.s));
        while (hi.s - lo.s > narrow) {
            const double s = lo.s + (hi.s - lo.s) / 2;
            if (!(s > lo.s && s < hi.s)) return;
            const GuardSample at = probe.along_the_flow(sample, s);
            (probe.has_left(at) ? hi : lo) = at;
        }
    }

    /// Brackets the root predicted from `sample` as narrowly as rounding in the
    /// guard allows: from the predicted root outwards until the side changes. False
    /// if it does not change within the bracket: the prediction was wrong, or the guard is
    /// noise, which hides its root for as long as `noise` [s].
    template <class Probe>
    [[nodiscard]] static bool close_in(Probe& probe, const GuardSample& sample, double correction,
                                       double tolerance, const detail::NoiseScale& scale,
                                       GuardSample& lo, GuardSample& hi, double& noise)
    {
        double s = sample.s + correction;
        // Three quarters of the relative epsilon always reach the next double, and
        // never pass the one after it.
        double margin = std::max(tolerance / 2, 0.75 * probe.finest(s));
        const double widest = 0x1p20 * margin;
        int direction = 0;
        GuardSample first;
        bool tried = false;
        if (s <= lo.s) {
            direction = 1;
            s = lo.s + margin;
        } else if (s >= hi.s) {
            direction = -1;
            s = hi.s - margin;
        }
        for (int count = 0; s > lo.s && s < hi.s; ++count) {
            const GuardSample at = probe.along_the_flow(sample, s);
            const int toward = probe.has_left(at) ? -1 : 1;
            if (count == 0) first = at;
            const bool repeats =
                at.value == first.value && scale.resolves(sample.rate * (at.s - first.s));
            if (count == 0 ? scale.may_be(at.value) : repeats && !tried) {
                tried = true;
                const double residue = scale.may_be(at.value)
                                           ? at.value
                                           : detail::tread_height(probe, sample, at, scale);
                noise = detail::close_in_noise(probe, sample, s, residue, scale, lo, hi);
                if (noise > 0) return false;
            }
            (toward < 0 ? hi : lo) = at;
            if (toward == -direction) {
                if (margin > widest / 256) halve_along(probe, sample, tolerance, lo, hi);
                return true;
            }
            direction = toward;
            s += toward * margin;
            margin *= 2;
            if (margin > widest) return false;  // the prediction was wrong
        }
        return false;
    }
};

}  // namespace ricochet
