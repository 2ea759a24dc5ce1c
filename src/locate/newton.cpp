#include "ricochet/locate/locators.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "flat.hpp"
#include "jump.hpp"
#include "noise.hpp"

namespace ricochet {

namespace detail {

double hermite_root(double v0, double r0, double v1, double r1, double sign) noexcept
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

namespace {

/// Largest fraction of a bracket over which the flow may be extrapolated: its square is 9e-16.
constexpr double straight_part = 3e-8;
/// Number of consecutive corrections that may fail to halve the one before.
constexpr int most_linear = 4;

/// A guard that jumps has no slope there, and its root is the offset just beyond the jump.
[[gnu::noinline]] void mark_jump(GuardPath& path, const GuardSample& lo, const GuardSample& hi,
                                 double size, double end, Location& where)
{
    const double slope = (hi.value - lo.value) / (hi.s - lo.s);
    for (const double rate : {lo.rate, hi.rate}) {
        if (slope / rate > 0 && slope / rate <= 16) return;  // as steep as its rate
    }
    if (!detail::jumps(path, lo, hi, size)) return;
    where = detail::jump_at(path, lo, hi, end);
}

[[nodiscard]] Location located(GuardPath& path, const GuardSample& lo, const GuardSample& hi,
                               const TwoSum& root, double size, double end)
{
    const double rounding = std::fabs(hi.value / hi.rate);
    Location where{.lo = lo.s,
                   .hi = hi.s,
                   .root = root.value,
                   .root_remainder = root.remainder,
                   .slope = hi.rate,
                   .error = rounding > hi.s - lo.s ? rounding : hi.s - lo.s};
    if (detail::may_jump(lo, hi, size)) [[unlikely]]
        mark_jump(path, lo, hi, size, end, where);
    return where;
}

/// Location of a root that noise of the guard hides for `noise` [s]. Along the flow the guard has
/// left its side at `hi`; `hi` is moved until the guard of the state there has left it, too.
[[nodiscard]] Location hidden(GuardPath& path, const GuardSample& lo, GuardSample hi, double end,
                              double rate, double noise)
{
    const double width = std::max(hi.s - lo.s, noise / 4);
    for (int i = 0; i < 8 && hi.s < end; ++i) {
        if (path.has_left(path.value(hi.s))) break;
        hi.s = std::min(hi.s + width, end);
    }
    return {
        .lo = lo.s, .hi = hi.s, .root = hi.s, .slope = rate, .error = std::max(noise, hi.s - lo.s)};
}

/// Estimate of |g| in the bracket from its ends and their rates.
[[nodiscard]] double size_of(const GuardSample& lo, const GuardSample& hi) noexcept
{
    const double width = hi.s - lo.s;
    double size = 0;
    for (const double g : {lo.value, hi.value, lo.rate * width, hi.rate * width}) {
        if (std::fabs(g) > size) size = std::fabs(g);
    }
    return size;
}

/// Change of the rate from one sample to the other, per second.
[[nodiscard]] double bend(const GuardSample& a, const GuardSample& b) noexcept
{
    return std::fabs((b.rate - a.rate) / (b.s - a.s));
}

[[nodiscard]] double first_guess(GuardPath& path, GuardSample& lo, GuardSample& hi)
{
    path.complete(lo);
    path.complete(hi);
    const double width = hi.s - lo.s;
    const double u = detail::hermite_root(lo.value, lo.rate * width, hi.value, hi.rate * width,
                                          path.side() == Side::above ? 1 : -1);
    return lo.s + u * width;
}

/// Halves a bracket that had to be widened far from the root predicted by the slope at `sample`,
/// which a kink may have spoilt.
void halve_along(GuardPath& path, const GuardSample& sample, double tolerance, GuardSample& lo,
                 GuardSample& hi)
{
    const double narrow = std::max(tolerance, 2 * path.finest(hi.s));
    while (hi.s - lo.s > narrow) {
        const double s = lo.s + (hi.s - lo.s) / 2;
        if (!(s > lo.s && s < hi.s)) return;
        const GuardSample at = path.along_the_flow(sample, s);
        (path.has_left(at) ? hi : lo) = at;
    }
}

/// Brackets the root predicted from `sample` as narrowly as rounding in the
/// guard allows: from the predicted root outwards until the side changes. False
/// if it does not change within the bracket: either the prediction was wrong, or the guard is
/// noise, which hides its root for as long as `noise` [s].
[[nodiscard]] bool close_in(GuardPath& path, const GuardSample& sample, double correction,
                            double tolerance, const detail::NoiseScale& scale, GuardSample& lo,
                            GuardSample& hi, double& noise)
{
    double s = sample.s + correction;
    // Three quarters of the relative epsilon always reach the next double, and
    // never pass the one after it.
    double margin = std::max(tolerance / 2, 0.75 * path.finest(s));
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
        const GuardSample at = path.along_the_flow(sample, s);
        const int toward = path.has_left(at) ? -1 : 1;
        if (count == 0) first = at;
        const bool repeats =
            at.value == first.value && scale.resolves(sample.rate * (at.s - first.s));
        if (count == 0 ? scale.may_be(at.value) : repeats && !tried) {
            tried = true;
            const double residue =
                scale.may_be(at.value) ? at.value : detail::tread_height(path, sample, at, scale);
            noise = detail::close_in_noise(path, sample, s, residue, scale, lo, hi);
            if (noise > 0) return false;
        }
        (toward < 0 ? hi : lo) = at;
        if (toward == -direction) {
            if (margin > widest / 256) halve_along(path, sample, tolerance, lo, hi);
            return true;
        }
        direction = toward;
        s += toward * margin;
        margin *= 2;
        if (margin > widest) return false;  // the prediction was wrong
    }
    return false;
}

}  // namespace

Location Newton::locate(GuardPath& path, GuardSample lo, GuardSample hi, double tolerance) const
{
    const double reach = straight_part * (hi.s - lo.s);
    double s = first_guess(path, lo, hi);
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
        const double finest = path.finest(hi.s);
        if (width <= std::max(tolerance, finest)) break;
        // A root at one end may be followed by another one beside it.
        const double beside = std::max(finest, reach / 4);
        if (s >= hi.s && slow == 0) s = hi.s - beside;
        if (s <= lo.s && slow == 0) s = lo.s + beside;
        if (!(s > lo.s && s < hi.s)) s = lo.s + width / 2;
        if (s <= lo.s || s >= hi.s) break;  // neighbouring doubles

        const GuardSample sample = path.value_and_rate(s);
        const bool beyond = path.has_left(sample);
        curvature = std::max({curvature, bend(lo, sample), bend(sample, hi)});
        const GuardSample replaced = beyond ? hi : lo;
        (beyond ? hi : lo) = sample;
        const double correction = -sample.value / sample.rate;
        const double distance = std::fabs(correction);
        // The curvature that a straight line neglects over that distance, as a shift in time.
        const bool straight = distance <= std::min(width, std::max(reach, finest)) &&
                              distance * distance * curvature <=
                                  std::fabs(sample.rate) * std::max(finest, tolerance) / 2;
        if (straight) {
            double noise = 0;
            if (close_in(path, sample, correction, tolerance, scale, lo, hi, noise)) {
                const TwoSum predicted = two_sum(sample.s, correction);
                const TwoSum root = predicted.value < lo.s   ? two_sum(lo.s, 0)
                                    : predicted.value > hi.s ? two_sum(hi.s, 0)
                                                             : predicted;
                path.settle((root.value - sample.s) + root.remainder);
                return located(path, lo, hi, root, size, end);
            }
            if (noise > 0) return hidden(path, lo, hi, end, sample.rate, noise);
        } else if (scale.may_be(sample.value) &&
                   std::fabs(last_value) < 16 * std::fabs(sample.value)) {
            const double noise =
                detail::close_in_noise(path, sample, s + correction, sample.value, scale, lo, hi);
            if (noise > 0) return hidden(path, lo, hi, end, sample.rate, noise);
        }
        last_value = sample.value;
        // Repeatedly not halved: a root of higher order, a pole, or no root.
        linear = distance > 0.4 * last_distance && distance > 8 * finest ? linear + 1 : 0;
        last_distance = distance;
        if (linear == most_linear || !std::isfinite(correction)) {
            linear = 0;
            detail::narrow_by_values(path, lo, hi, replaced, tolerance, 1e-3 * width, size);
            path.complete(lo);
            path.complete(hi);
            s = hi.s - hi.value / hi.rate;
            slow = 0;
            continue;
        }
        // Converged from one side: sample the other side.
        past = distance > finest ? 0 : past > 0 ? 4 * past : finest;
        s += correction + (beyond ? -past : past);
        // Three samples have not halved the bracket: bisect.
        slow = hi.s - lo.s > width / 2 ? slow + 1 : 0;
        if (slow == 3) {
            s = lo.s + (hi.s - lo.s) / 2;
            slow = 0;
        }
    }
    return located(path, lo, hi, {hi.s, 0}, size, end);
}

}  // namespace ricochet
