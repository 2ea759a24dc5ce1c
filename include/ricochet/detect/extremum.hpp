// The honest classical rival: the guard and its rate at both ends of the step.
//
// The four numbers make a cubic. Where the guard heads for its surface at the start
// and away from it at the end, or the cubic's control points reach across, there may
// be an extremum on the other side: it is found on the step itself, by Newton's method
// on the rate, and only as exactly as it takes to know on which side it lies. Smooth
// guards are caught unless they turn more often within a step than a cubic can.
#pragma once

#include <algorithm>
#include <cmath>

#include "ricochet/detail/finding.hpp"

namespace ricochet {

namespace detail {

/// The guard times the sign of its armed side on a stretch, as a cubic over u in
/// [0, 1] through the values and rates at both ends.
struct GuardCubic {
    double v0, r0, v1, r1;  ///< values and rates per unit of u

    GuardCubic(double sign, const GuardSample& a, const GuardSample& b) noexcept
        : v0(sign * a.value),
          r0(sign * a.rate * (b.s - a.s)),
          v1(sign * b.value),
          r1(sign * b.rate * (b.s - a.s))
    {
    }

    /// Second derivatives at the ends, per unit of u squared.
    [[nodiscard]] double curvature0() const noexcept { return 6 * (v1 - v0) - 4 * r0 - 2 * r1; }
    [[nodiscard]] double curvature1() const noexcept { return 6 * (v0 - v1) + 2 * r0 + 4 * r1; }

    /// Where the cubic has its minimum (or maximum), if inside (0, 1); else 0.5.
    [[nodiscard]] double critical(bool minimum) const noexcept
    {
        // p'(u) = r0 + 2 b u + 3 c u^2
        const double b = 3 * (v1 - v0) - 2 * r0 - r1;
        const double c = 3 * (2 * (v0 - v1) + r0 + r1);
        const double root = std::sqrt(std::max(b * b - c * r0, 0.0));
        // At a minimum p'' = 2 (b + c u) > 0, so b + c u = root.
        const double signed_root = minimum ? root : -root;
        const double sum = b + signed_root;
        double u = minimum == (b >= 0) ? -r0 / sum : (signed_root - b) / c;
        if (!(u > 0 && u < 1)) u = 0.5;
        return u;
    }
};

}  // namespace detail

struct Extremum {
    static constexpr bool uses_rates = true;
    static constexpr bool looks_inside = true;  ///< compares each step with the cubic of its ends
    static constexpr Evidence evidence = Evidence::checked;  ///< of a step not suspected

    /// Whether a step deserves a look, in the guard times `sign`, positive on its
    /// armed side: it has left, or the control points of its cubic reach across, or it
    /// turns back from the surface. A guard that turns five times further away than it
    /// bends would have to bend five times more than its ends show.
    [[nodiscard]] static constexpr bool suspects(double sign, double g0, double rate0, double g1,
                                                 double rate1, double h) noexcept
    {
        const double v1 = sign * g1;
        const double slope0 = sign * rate0 * (h / 3);
        const double slope1 = sign * rate1 * (h / 3);
        const double b1 = sign * g0 + slope0;
        const double b2 = v1 - slope1;
        const double lowest = std::min(std::min(b1, b2), v1);
        const double highest = std::max(std::max(b1, b2), v1);
        const bool turns = (slope0 <= 0) & (slope1 > 0);
        return !(v1 > 0) | !(lowest > 0) | (turns & !(5 * lowest > 4 * highest));
    }

    /// Whether the stretch holds one crossing and nothing else, as far as its ends tell:
    /// the cubic is beyond the surface at the end, and its control points do not come
    /// back.
    [[nodiscard]] static bool leaves_plainly(double sign, const GuardSample& start,
                                             const GuardSample& end, double touch) noexcept
    {
        const double third = (end.s - start.s) / 3;
        const double b1 = sign * (start.value + start.rate * third);
        const double b2 = sign * (end.value - end.rate * third);
        return sign * end.value < -touch && !(b1 < 0 && b2 > 0) && std::isfinite(b1 + b2);
    }

    template <class Probe>
    [[nodiscard]] Finding examine(Probe& probe, Watch& watch) const
    {
        const Side side = watch.side;
        const double sign = side == Side::above ? 1 : -1;
        watch.side_after = side;
        if (side == Side::plateau) return Finding::clear(Evidence::checked);

        const detail::GuardCubic cubic(sign, watch.start, watch.end);
        const bool on_surface = is_on_surface(probe, watch, watch.end);
        // A stretch that ends inside the step ends at an event, which others have looked at.
        const bool whole = watch.end.s == probe.step().h();
        const bool returns = on_surface && whole && turns_back(probe, watch, cubic);
        const bool left = has_left(side, watch.end.value) && !returns;
        const bool known = std::isfinite(cubic.r0) && std::isfinite(cubic.r1);
        if (returns && cubic.r0 < 0 && turns_now(cubic.v1, cubic.r1, cubic.curvature1()) &&
            counts(side, probe.guard().crossing())) {
            return Finding::touching(side, watch.end);
        }
        if (left) {
            watch.side_after = opposite(side);
            if (known && cubic.v0 + cubic.r0 / 3 < 0 && cubic.v1 - cubic.r1 / 3 > 0) {
                return first_of_three(probe, watch, cubic);
            }
            if (counts(side, probe.guard().crossing())) {
                return Finding::leaving(side, watch.start, watch.end);
            }
            return Finding::clear(Evidence::checked);
        }
        if (!known) return Finding::clear(Evidence::checked);
        return look_for_pair(probe, watch, cubic);
    }

private:
    /// Whether a sample cannot be told from zero: by the rounding of the guard's values, or
    /// of the terms that it is made of.
    template <class Probe>
    [[nodiscard]] static bool is_on_surface(Probe& probe, const Watch& watch,
                                            const GuardSample& sample)
    {
        const double size = std::fabs(sample.value);
        if (size <= watch.touch) return true;
        return size <= near * watch.scale && size <= probe.blur(sample.s);
    }

    /// Of the scale of the guard, below which rounding of its terms is thought of.
    static constexpr double near = 1e-3;

    /// Whether a guard that is across its surface, or on it, and falls at this rate will turn
    /// at once: within the rounding of a rate. One that is not yet there may be overlooked
    /// at the end of a step, and is looked at from the start of the next.
    [[nodiscard]] static bool turns_now(double value, double rate, double curvature) noexcept
    {
        return value <= 0 && (rate == 0 || (rate < 0 && -rate <= 1e-9 * curvature));
    }

    /// Whether a guard that is on its surface at the end is about to turn back there. Where
    /// it leaves the band beyond the step says so; a guard that stays where it is has
    /// arrived, and in a wide band its cubic has to tell. If it is still falling, the next
    /// step will see where it turns.
    template <class Probe>
    [[nodiscard, gnu::noinline]] static bool turns_back(Probe& probe, const Watch& watch,
                                                        const detail::GuardCubic& cubic)
    {
        const double sign = watch.side == Side::above ? 1 : -1;
        const double width = probe.step().h();
        for (const double part : {1.0 / 64, 1.0 / 8, 1.0}) {
            const double beyond = sign * probe.value(watch.end.s + part * width).value;
            if (std::fabs(beyond) > watch.touch) return beyond > 0;
            if (beyond == cubic.v1) return false;
        }
        const double curvature = cubic.curvature1();
        return curvature > 0 && cubic.v1 - cubic.r1 * cubic.r1 / (2 * curvature) >= -watch.touch;
    }

    /// The guard has left its side at the end, but its cubic says that it may have left
    /// before, come back and left again.
    template <class Probe>
    [[gnu::noinline]] static Finding first_of_three(Probe& probe, Watch watch,
                                                    detail::GuardCubic cubic)
    {
        const Side side = watch.side;
        const bool leaving_counts = counts(side, probe.guard().crossing());
        const double width = watch.end.s - watch.start.s;
        const double s1 = watch.start.s + width * cubic.critical(true);
        const double s2 = watch.start.s + width * cubic.critical(false);
        const GuardSample lowest = probe.value_and_rate(s1);
        const GuardSample highest = probe.value_and_rate(s2);
        const bool dips = s1 < s2 && !has_left(side, highest.value);
        const bool touches = dips && is_on_surface(probe, watch, lowest);
        // It has to rise again, by more than the rounding of a flat root.
        const bool rises =
            std::fabs(highest.value) > std::max(watch.touch, 2 * std::fabs(lowest.value));
        if (touches && rises && leaving_counts && std::fabs(cubic.v0) > watch.touch) {
            return Finding::touching(side, lowest);
        }
        const bool pair = dips && has_left(side, lowest.value) && !touches;
        if (leaving_counts) {
            return Finding::leaving(side, watch.start, pair ? lowest : watch.end);
        }
        if (pair) return Finding::leaving(opposite(side), lowest, highest);
        return Finding::clear(Evidence::checked);
    }

    /// Both ends are on the armed side: is the extremum between them, too?
    template <class Probe>
    [[gnu::noinline]] static Finding look_for_pair(Probe& probe, Watch watch,
                                                   detail::GuardCubic cubic)
    {
        GuardSample lo = watch.start;
        GuardSample hi = watch.end;
        if (std::fabs(cubic.v0) <= watch.touch &&
            turns_now(cubic.v0, cubic.r0, cubic.curvature0())) {
            return Finding::clear(Evidence::checked);  // the step before has seen it turn
        }
        if (!(cubic.r0 <= 0 && cubic.r1 > 0)) {
            // No turn between the ends; a dip in a slope, if anything.
            if (cubic.v0 + cubic.r0 / 3 > 0 && cubic.v1 - cubic.r1 / 3 > 0) {
                return Finding::clear(Evidence::checked);
            }
            const double width = hi.s - lo.s;
            const GuardSample dip = probe.value_and_rate(lo.s + width * cubic.critical(true));
            if (is_on_surface(probe, watch, dip)) {
                // In the band at an end, it is there that the guard touches; and where it goes
                // on falling it has not turned.
                const double nearest = std::min(std::fabs(cubic.v0), std::fabs(cubic.v1));
                return nearest <= watch.touch || cubic.v1 <= std::fabs(dip.value) ||
                               !counts(watch.side, probe.guard().crossing())
                           ? Finding::clear(Evidence::checked)
                           : Finding::touching(watch.side, dip);
            }
            if (!has_left(watch.side, dip.value)) return Finding::clear(Evidence::checked);
            return pair(probe, watch, dip);
        }
        const double sign = watch.side == Side::above ? 1 : -1;
        // A kink has its extremum in a point, which only the polynomial gives exactly.
        const double resolution = probe.on_polynomial() ? probe.finest(hi.s) : 1e-9 * (hi.s - lo.s);
        GuardSample lowest = hi;
        for (int i = 0; i < most_samples && hi.s - lo.s > resolution; ++i) {
            const double width = hi.s - lo.s;
            double s = lo.s + turn(sign, lo, hi, i) * width;
            if (!(s > lo.s && s < hi.s)) s = lo.s + width / 2;
            if (!(s > lo.s && s < hi.s)) break;  // neighbouring doubles
            const GuardSample sample = probe.value_and_rate(s);
            const double value = sign * sample.value;
            const double rate = sign * sample.rate;
            if (value <= 0 && !is_on_surface(probe, watch, sample)) {
                return pair(probe, watch, sample);
            }
            if (!std::isfinite(value) || !std::isfinite(rate)) break;
            if (sign * lowest.value >= value) lowest = sample;
            // What is still to come: a parabola falls by rate^2 / (2 curvature).
            const double bend = std::min(rate - sign * lo.rate, sign * hi.rate - rate) / width;
            double fall = bend > 0 ? rate * rate / (2 * bend) : std::fabs(rate) * width;
            if (width <= coarse_part * probe.step().h() && !is_rated(probe)) {
                fall = std::max(fall, steepest(lo, sample, hi) * width);
            }
            if (value > watch.touch + 4 * fall && (value > near * watch.scale + 4 * fall ||
                                                   value > probe.blur(sample.s) + 4 * fall)) {
                return Finding::clear(Evidence::checked);
            }
            if (fall <= watch.touch / 64) break;
            (rate <= 0 ? lo : hi) = sample;
        }
        if (!is_on_surface(probe, watch, lowest)) {
            return has_left(watch.side, lowest.value) ? pair(probe, watch, lowest)
                                                      : Finding::clear(Evidence::checked);
        }
        // One that falls from its surface to its surface has not been away.
        const bool stays = watch.departs && is_on_surface(probe, watch, watch.start);
        if (stays || !counts(watch.side, probe.guard().crossing())) {
            return Finding::clear(Evidence::checked);
        }
        return Finding::touching(watch.side, lowest);
    }

    static constexpr int most_samples = 80;

    /// Of a step, below which a rate that is a difference over 1e-5 of it rounds a kink off.
    static constexpr double coarse_part = 1e-3;

    template <class Probe>
    [[nodiscard]] static constexpr bool is_rated(const Probe& probe) noexcept
    {
        if constexpr (requires { probe.guard().is_rated; }) {
            return probe.guard().is_rated;
        } else {
            return true;
        }
    }

    /// The larger of the slopes between three samples.
    [[nodiscard]] static double steepest(const GuardSample& a, const GuardSample& b,
                                         const GuardSample& c) noexcept
    {
        return std::max(std::fabs((b.value - a.value) / (b.s - a.s)),
                        std::fabs((c.value - b.value) / (c.s - b.s)));
    }

    /// Where to look for the turn of the guard times `sign`, which falls at `lo` and rises at
    /// `hi`, as a fraction of the stretch: the minimum of the cubic. Where that does not
    /// converge soon there is a kink or a flat place, and the stretch is halved.
    [[nodiscard]] static double turn(double sign, const GuardSample& lo, const GuardSample& hi,
                                     int i) noexcept
    {
        return i < 7 ? detail::GuardCubic(sign, lo, hi).critical(true) : 0.5;
    }

    /// The guard leaves its side before `beyond` and is back at the end.
    template <class Probe>
    [[nodiscard]] static Finding pair(const Probe& probe, const Watch& watch,
                                      const GuardSample& beyond)
    {
        if (counts(watch.side, probe.guard().crossing())) {
            return Finding::leaving(watch.side, watch.start, beyond);
        }
        return Finding::leaving(opposite(watch.side), beyond, watch.end);
    }
};

}  // namespace ricochet
