#include "ricochet/extremum.hpp"

#include <algorithm>
#include <cmath>

namespace ricochet {

namespace {

using detail::counts;
using detail::Finding;
using detail::has_left;
using detail::opposite;
using detail::Watch;

/// The guard times the sign of its armed side on an interval, as a cubic over u in
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

    /// Place of the minimum (or maximum) of the cubic, if it lies in (0, 1); else 0.5.
    [[nodiscard]] double critical(bool minimum) const noexcept
    {
        // p'(u) = r0 + 2 b u + 3 c u^2
        const double b = 3 * (v1 - v0) - 2 * r0 - r1;
        const double c = 3 * (2 * (v0 - v1) + r0 + r1);
        const double k = unit(std::max({std::fabs(b), std::fabs(c), std::fabs(r0)}));
        const double square = (k * b) * (k * b) - (k * c) * (k * r0);
        const double root = std::sqrt(std::max(square, 0.0)) / k;
        // At a minimum p'' = 2 (b + c u) > 0, so b + c u = root.
        const double signed_root = minimum ? root : -root;
        const double sum = b + signed_root;
        double u = minimum == (b >= 0) ? -r0 / sum : (signed_root - b) / c;
        if (!(u > 0 && u < 1)) u = 0.5;
        return u;
    }

private:
    /// A power of two, usually 1, that scales values of this size so that their squares
    /// neither underflow nor overflow. It changes no bit of a result.
    [[nodiscard]] static double unit(double largest) noexcept
    {
        if (largest < 0x1p-450) return 0x1p600;
        return largest > 0x1p450 ? 0x1p-600 : 1;
    }
};

/// Fraction of the scale of the guard below which rounding of its terms is considered.
constexpr double near = 1e-3;

constexpr int most_samples = 80;

/// Fraction of a step below which a rate that is a difference over 1e-5 of it smooths a kink.
constexpr double coarse_part = 1e-3;

/// A clear finding: `checked` if that is known, else only `assumed`, as where a value is NaN.
Finding clear_if(bool known) noexcept
{
    return Finding::clear(known ? Evidence::checked : Evidence::assumed);
}

/// Whether a sample cannot be distinguished from zero: because of the rounding of the guard's
/// values, or of the terms that it is computed from.
[[nodiscard]] bool is_on_surface(GuardPath& path, const Watch& watch, const GuardSample& sample)
{
    const double size = std::fabs(sample.value);
    if (size <= watch.touch) return true;
    return size <= near * watch.scale && size <= path.blur(sample.s);
}

/// Whether a guard that is across its surface, or on it, and falls at this rate will turn
/// immediately: within the rounding of its rate. A guard that is not yet there may be overlooked
/// at the end of a step, and is examined from the start of the next.
[[nodiscard]] bool turns_now(double value, double rate, double curvature) noexcept
{
    return value <= 0 && (rate == 0 || (rate < 0 && -rate <= 1e-9 * curvature));
}

/// Whether a guard that is on its surface at the end is about to turn back there. The sign with
/// which it leaves the band beyond the step decides; a guard that does not change any more has
/// arrived, and in a wide band the cubic decides. If the guard is still falling, the next
/// step will find where it turns.
[[nodiscard, gnu::noinline]] bool turns_back(GuardPath& path, const Watch& watch,
                                             const GuardCubic& cubic)
{
    const double sign = watch.side == Side::above ? 1 : -1;
    const double width = path.h();
    for (const double part : {1.0 / 64, 1.0 / 8, 1.0}) {
        if (watch.end.s + part * width > path.latest()) break;
        const double beyond = sign * path.value(watch.end.s + part * width).value;
        if (std::fabs(beyond) > watch.touch) return beyond > 0;
        if (beyond == cubic.v1) return false;
    }
    const double curvature = cubic.curvature1();
    return curvature > 0 && cubic.v1 - cubic.r1 * (cubic.r1 / (2 * curvature)) >= -watch.touch;
}

/// The larger of the slopes between three samples.
[[nodiscard]] double steepest(const GuardSample& a, const GuardSample& b,
                              const GuardSample& c) noexcept
{
    return std::max(std::fabs((b.value - a.value) / (b.s - a.s)),
                    std::fabs((c.value - b.value) / (c.s - b.s)));
}

/// Place to sample for the turn of the guard times `sign`, which falls at `lo` and rises at
/// `hi`, as a fraction of the interval: the minimum of the cubic. If that does not
/// converge soon the guard has a kink or a flat part, and the interval is halved.
[[nodiscard]] double turn(double sign, const GuardSample& lo, const GuardSample& hi, int i) noexcept
{
    return i < 7 ? GuardCubic(sign, lo, hi).critical(true) : 0.5;
}

/// The event if the guard leaves its side before `beyond` and has returned at the end.
[[nodiscard]] Finding pair(const GuardPath& path, const Watch& watch, const GuardSample& beyond)
{
    if (counts(watch.side, path.crossing())) {
        return Finding::leaving(watch.side, watch.start, beyond);
    }
    return Finding::leaving(opposite(watch.side), beyond, watch.end);
}

/// The event if the guard has left its side at the end, and by its cubic may also have left
/// before, returned and left again.
[[gnu::noinline]] Finding first_of_three(GuardPath& path, Watch watch, GuardCubic cubic)
{
    const Side side = watch.side;
    const bool leaving_counts = counts(side, path.crossing());
    const double width = watch.end.s - watch.start.s;
    const double s1 = watch.start.s + width * cubic.critical(true);
    const double s2 = watch.start.s + width * cubic.critical(false);
    const GuardSample lowest = path.value_and_rate(s1);
    const GuardSample highest = path.value_and_rate(s2);
    const bool dips = s1 < s2 && !has_left(side, highest.value);
    const bool touches = dips && is_on_surface(path, watch, lowest);
    // The guard has to rise again, by more than the rounding of a flat root.
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
    return clear_if(!std::isnan(lowest.value) && !std::isnan(highest.value));
}

/// Searches between ends that have no turn between them: for a dip in a slope.
[[nodiscard]] Finding search_in_slope(GuardPath& path, const Watch& watch, const GuardCubic& cubic)
{
    if (cubic.v0 + cubic.r0 / 3 > 0 && cubic.v1 - cubic.r1 / 3 > 0) {
        return Finding::clear(Evidence::checked);
    }
    const double lo = watch.start.s;
    const GuardSample dip = path.value_and_rate(lo + (watch.end.s - lo) * cubic.critical(true));
    if (is_on_surface(path, watch, dip)) {
        // If an end lies in the band, the guard touches there; and if it continues to
        // fall, it has not turned.
        const double nearest = std::min(std::fabs(cubic.v0), std::fabs(cubic.v1));
        return nearest <= watch.touch || cubic.v1 <= std::fabs(dip.value) ||
                       !counts(watch.side, path.crossing())
                   ? Finding::clear(Evidence::checked)
                   : Finding::touching(watch.side, dip);
    }
    if (!has_left(watch.side, dip.value)) return clear_if(!std::isnan(dip.value));
    return pair(path, watch, dip);
}

/// Determines whether the extremum between two ends on the armed side is on that side too.
[[gnu::noinline]] Finding search_for_pair(GuardPath& path, Watch watch, GuardCubic cubic)
{
    GuardSample lo = watch.start;
    GuardSample hi = watch.end;
    if (std::fabs(cubic.v0) <= watch.touch && turns_now(cubic.v0, cubic.r0, cubic.curvature0())) {
        return Finding::clear(Evidence::checked);  // the step before has found the turn
    }
    if (!(cubic.r0 <= 0 && cubic.r1 > 0)) return search_in_slope(path, watch, cubic);
    const double sign = watch.side == Side::above ? 1 : -1;
    // A kink has its extremum at a single point, which only the polynomial gives exactly.
    const double resolution = path.on_polynomial() ? path.finest(hi.s) : 1e-9 * (hi.s - lo.s);
    GuardSample lowest = hi;
    bool known = true;
    for (int i = 0; i < most_samples && hi.s - lo.s > resolution; ++i) {
        const double width = hi.s - lo.s;
        double s = lo.s + turn(sign, lo, hi, i) * width;
        if (!(s > lo.s && s < hi.s)) s = lo.s + width / 2;
        if (!(s > lo.s && s < hi.s)) break;  // neighbouring doubles
        const GuardSample sample = path.value_and_rate(s);
        const double value = sign * sample.value;
        const double rate = sign * sample.rate;
        if (value <= 0 && !is_on_surface(path, watch, sample)) {
            return pair(path, watch, sample);
        }
        known = std::isfinite(value) && std::isfinite(rate);
        if (!known) break;
        if (sign * lowest.value >= value) lowest = sample;
        // Bound on the remaining fall: a parabola falls by rate^2 / (2 curvature).
        const double bend = std::min(rate - sign * lo.rate, sign * hi.rate - rate) / width;
        // The square of a rate may underflow.
        double fall = bend > 0 ? rate * (rate / (2 * bend)) : std::fabs(rate) * width;
        if (width <= coarse_part * path.h() && !path.is_rated()) {
            fall = std::max(fall, steepest(lo, sample, hi) * width);
        }
        if (value > watch.touch + 4 * fall &&
            (value > near * watch.scale + 4 * fall || value > path.blur(sample.s) + 4 * fall)) {
            return Finding::clear(Evidence::checked);
        }
        if (fall <= watch.touch / 64) break;
        (rate <= 0 ? lo : hi) = sample;
    }
    if (!is_on_surface(path, watch, lowest)) {
        return has_left(watch.side, lowest.value) ? pair(path, watch, lowest) : clear_if(known);
    }
    // A guard that falls from its surface back to its surface has not been away from it.
    const bool stays = watch.departs && is_on_surface(path, watch, watch.start);
    if (stays || !counts(watch.side, path.crossing())) {
        return Finding::clear(Evidence::checked);
    }
    return Finding::touching(watch.side, lowest);
}

}  // namespace

bool Ends::turns_back(GuardPath& path, const Watch& watch)
{
    const double sign = watch.side == Side::above ? 1 : -1;
    const double end = watch.end.s, width = path.h();
    for (const double part : {1.0 / 64, 1.0 / 8, 1.0}) {
        if (end + part * width > path.latest()) break;
        const double beyond = path.value(end + part * width).value;
        if (beyond != 0) return sign * beyond > 0;
    }
    if (end < path.latest()) return false;  // it stays there
    // At the end of the run: of a crossing the value is halved over half the way, of a touch
    // quartered.
    const double away = std::min(width / 64, (end - watch.start.s) / 2);
    return sign * path.value(end - away / 2).value < 0.375 * sign * path.value(end - away).value;
}

Finding Extremum::examine(GuardPath& path, Watch& watch) const
{
    const Side side = watch.side;
    const double sign = side == Side::above ? 1 : -1;
    watch.side_after = side;
    if (side == Side::plateau) return Finding::clear(Evidence::checked);

    const GuardCubic cubic(sign, watch.start, watch.end);
    const bool on_surface = is_on_surface(path, watch, watch.end);
    // An interval that ends inside the step ends at an event, which has been examined already.
    const bool whole = watch.end.s == path.h();
    const bool returns = on_surface && whole && turns_back(path, watch, cubic);
    const bool left = has_left(side, watch.end.value) && !returns;
    const bool known = std::isfinite(cubic.r0) && std::isfinite(cubic.r1);
    if (returns && cubic.r0 < 0 && turns_now(cubic.v1, cubic.r1, cubic.curvature1()) &&
        counts(side, path.crossing())) {
        return Finding::touching(side, watch.end);
    }
    if (left) {
        watch.side_after = opposite(side);
        if (known && cubic.v0 + cubic.r0 / 3 < 0 && cubic.v1 - cubic.r1 / 3 > 0) {
            return first_of_three(path, watch, cubic);
        }
        if (counts(side, path.crossing())) {
            return Finding::leaving(side, watch.start, watch.end);
        }
        return clear_if(known);
    }
    if (!known) return clear_if(false);
    Finding finding = search_for_pair(path, watch, cubic);
    if (std::isnan(cubic.v1)) finding.evidence = Evidence::assumed;
    return finding;
}

}  // namespace ricochet
