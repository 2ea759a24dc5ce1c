#include "ricochet/locators.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "bracket.hpp"
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

using detail::Location;

/// Number of consecutive corrections that may fail to halve the one before.
constexpr int most_linear = 4;

/// Estimate of |g| in the bracket from its ends and their rates.
[[nodiscard]] double size_of(const GuardSample& lo, const GuardSample& hi) noexcept
{
    const double width = hi.s - lo.s;
    double size = 0;
    for (const double g : {lo.value, hi.value, lo.rate * width, hi.rate * width}) {
        if (std::fabs(g) > size && std::isfinite(g)) size = std::fabs(g);
    }
    return size;
}

/// Newton's method in a bracket that every sample narrows.
class Search {
public:
    Search(GuardPath& path, const detail::Bracket& bracket, double tolerance)
        : path_(path), bracket_(bracket), tolerance_(tolerance), end_(bracket.hi.s)
    {
        if (std::isnan(bracket_.lo.rate)) path_.complete(bracket_.lo);
        if (std::isnan(bracket_.hi.rate)) path_.complete(bracket_.hi);
        size_ = detail::larger(detail::larger(0, bracket_.lo.value), bracket_.hi.value);
        scale_ = {.size = size_of(bracket_.lo, bracket_.hi), .h = bracket_.width()};
        if (scale_.size > 1e280) unit_ = 0x1p-960;
        curvature_ = bend(bracket_.lo, bracket_.hi);
    }

    [[nodiscard]] Location run();

private:
    /// Where to sample next: s, moved into the bracket; NaN between neighbouring doubles.
    [[nodiscard]] double inside(double s, double finest) const noexcept
    {
        const auto& [lo, hi] = bracket_;
        // A root at one end may be followed by another one beside it.
        const double beside = std::max(finest, reach() / 4);
        if (s >= hi.s && slow_ == 0) s = hi.s - beside;
        if (s <= lo.s && slow_ == 0) s = lo.s + beside;
        if (!bracket_.contains(s)) s = lo.s + bracket_.width() / 2;
        return bracket_.contains(s) ? s : std::numeric_limits<double>::quiet_NaN();
    }
    [[nodiscard]] double reach() const noexcept { return straight_part * scale_.h; }
    /// Change of the rate from one sample to the other, per second, in units of `1 / unit_`.
    [[nodiscard]] double bend(const GuardSample& a, const GuardSample& b) const noexcept
    {
        return std::fabs((unit_ * b.rate - unit_ * a.rate) / (b.s - a.s));
    }

    /// Whether the curvature that a straight line neglects over the correction shifts the root by
    /// less than is asked for.
    [[nodiscard]] bool is_straight(const GuardSample& sample, double distance, double width,
                                   double finest) const noexcept
    {
        return distance <= std::min(width, std::max(reach(), finest)) &&
               distance * distance * curvature_ <=
                   std::fabs(unit_ * sample.rate) * std::max(finest, tolerance_) / 2;
    }
    [[nodiscard]] bool ends_straight(const GuardSample& sample, double correction, Location& where);
    [[nodiscard]] bool close_in(const GuardSample& sample, double s, double& noise);
    void halve_along(const GuardSample& sample);
    [[nodiscard]] double predicted();
    [[nodiscard]] double refined(double s, double u);
    [[nodiscard]] Location located(const TwoSum& root);
    void mark_jump(Location& where);
    [[nodiscard]] Location hidden(double rate, double noise);

    GuardPath& path_;
    detail::Bracket bracket_;
    double tolerance_;
    double end_;       ///< of the bracket at the start
    double size_ = 0;  ///< largest |g| among the samples at ends and by values
    detail::NoiseScale scale_;
    double unit_ = 1;       ///< less where second differences of the guard would overflow
    double curvature_ = 0;  ///< largest change of the rate per second, between samples, as `bend`
    int slow_ = 0;          ///< consecutive samples that have not halved the bracket
};

/// A guard that jumps has no slope there, and its root is the offset just beyond the jump.
[[gnu::noinline]] void Search::mark_jump(Location& where)
{
    const auto& [lo, hi] = bracket_;
    const double slope = (hi.value - lo.value) / (hi.s - lo.s);
    for (const double rate : {lo.rate, hi.rate}) {
        if (slope / rate > 0 && slope / rate <= 16) return;  // as steep as its rate
    }
    if (!detail::jumps(path_, lo, hi, size_)) return;
    where = detail::jump_at(path_, lo, hi, end_);
}

Location Search::located(const TwoSum& root)
{
    const auto& [lo, hi] = bracket_;
    const double rounding = std::fabs(hi.value / hi.rate);
    Location where{.lo = lo.s,
                   .hi = hi.s,
                   .root = root.value,
                   .root_remainder = root.remainder,
                   .slope = hi.rate,
                   .error = rounding > hi.s - lo.s ? rounding : hi.s - lo.s};
    if (detail::may_jump(lo, hi, size_)) [[unlikely]]
        mark_jump(where);
    return where;
}

/// Location of a root that noise of the guard hides for `noise` [s]. Along the flow the guard has
/// left its side at the end of the bracket, which is moved until the guard of the state there has
/// left it, too.
Location Search::hidden(double rate, double noise)
{
    auto& [lo, hi] = bracket_;
    const double width = std::max(hi.s - lo.s, noise / 4);
    for (int i = 0; i < 8 && hi.s < end_; ++i) {
        if (path_.has_left(path_.value(hi.s))) break;
        hi.s = std::min(hi.s + width, end_);
    }
    return {
        .lo = lo.s, .hi = hi.s, .root = hi.s, .slope = rate, .error = std::max(noise, hi.s - lo.s)};
}

/// Halves a bracket that had to be widened far from the root predicted by the slope at `sample`,
/// which a kink may have spoilt.
void Search::halve_along(const GuardSample& sample)
{
    auto& [lo, hi] = bracket_;
    const double narrow = std::max(tolerance_, 2 * path_.finest(hi.s));
    while (hi.s - lo.s > narrow) {
        const double s = lo.s + (hi.s - lo.s) / 2;
        if (!bracket_.contains(s)) return;
        const GuardSample at = path_.along_the_flow(sample, s);
        (path_.has_left(at) ? hi : lo) = at;
    }
}

/// Brackets the root predicted at s from `sample` as narrowly as rounding in the guard allows:
/// from the predicted root outwards until the side changes. False if it does not change between two
/// places in the bracket, and this is still wide: either the prediction was wrong, or the guard is
/// noise, which hides its root for as long as `noise` [s].
bool Search::close_in(const GuardSample& sample, double s, double& noise)
{
    auto& [lo, hi] = bracket_;
    // Three quarters of the relative epsilon always reach the next double, and
    // never pass the one after it.
    double margin = std::max(tolerance_ / 2, 0.75 * path_.finest(s));
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
    for (int count = 0; bracket_.contains(s); ++count) {
        const GuardSample at = path_.along_the_flow(sample, s);
        const int toward = path_.has_left(at) ? -1 : 1;
        if (count == 0) first = at;
        const bool repeats =
            at.value == first.value && scale_.resolves(sample.rate * (at.s - first.s));
        if (count == 0 ? scale_.may_be(at.value) : repeats && !tried) {
            tried = true;
            const double residue = scale_.may_be(at.value)
                                       ? at.value
                                       : detail::tread_height(path_, sample, at, scale_);
            noise = detail::close_in_noise(path_, sample, {s, residue}, scale_, bracket_);
            if (noise > 0) return false;
        }
        (toward < 0 ? hi : lo) = at;
        if (toward == -direction) {
            if (margin > widest / 256) halve_along(sample);
            return true;
        }
        direction = toward;
        s += toward * margin;
        margin *= 2;
        if (margin > widest) return false;  // the prediction was wrong
    }
    return bracket_.width() <= std::max(tolerance_, path_.finest(hi.s));
}

/// Ends the search where the guard is straight between `sample` and the root predicted from it.
bool Search::ends_straight(const GuardSample& sample, double correction, Location& where)
{
    const auto& [lo, hi] = bracket_;
    double noise = 0;
    if (close_in(sample, sample.s + correction, noise)) {
        const TwoSum predicted = two_sum(sample.s, correction);
        const TwoSum root = predicted.value < lo.s   ? two_sum(lo.s, 0)
                            : predicted.value > hi.s ? two_sum(hi.s, 0)
                                                     : predicted;
        path_.settle((root.value - sample.s) + root.remainder);
        where = located(root);
        return true;
    }
    if (noise > 0) where = hidden(sample.rate, noise);
    return noise > 0;
}

/// The place s, at the part u of the bracket, refined by the secant rule on the step's polynomial
/// where the guard there differs from the cubic through its ends. Its error is about a part of the
/// last correction that is as small as the change of the slope.
[[gnu::noinline]] double Search::refined(double s, double u)
{
    const auto& [lo, hi] = bracket_;
    const double h = scale_.h;
    const double rise = hi.value - lo.value;
    double slope = ((1 - u) * (1 - 3 * u) * lo.rate + u * (3 * u - 2) * hi.rate) +
                   6 * u * (1 - u) * (rise / h);
    GuardSample at = path_.dense_value(s);
    for (int k = 0; k < 3; ++k) {
        const double correction = -at.value / slope;
        const double distance = std::fabs(correction);
        if (k == 0 && distance <= 0x1p-26 * h) break;  // a cubic
        if (!(distance <= 0.1 * h && bracket_.contains(s + correction))) break;
        s += correction;
        if (distance <= 1e-6 * h) break;
        const GuardSample next = path_.dense_value(s);
        slope = (next.value - at.value) / correction;
        at = next;
    }
    return s;
}

/// Where the cubic through the ends of the bracket has its root, refined where that is cheap.
inline double Search::predicted()
{
    const auto& [lo, hi] = bracket_;
    const double u =
        detail::hermite_root(unit_ * lo.value, unit_ * lo.rate * scale_.h, unit_ * hi.value,
                             unit_ * hi.rate * scale_.h, path_.side() == Side::above ? 1 : -1);
    const double s = lo.s + scale_.h * u;
    return path_.foretells() ? refined(s, u) : s;
}

Location Search::run()
{
    auto& [lo, hi] = bracket_;
    double s = predicted();
    double past = 0;
    double last_distance = std::numeric_limits<double>::infinity();
    double last_value = std::numeric_limits<double>::infinity();
    int linear = 0;
    Location where;
    for (;;) {
        const double width = bracket_.width();
        const double finest = path_.finest(hi.s);
        if (width <= std::max(tolerance_, finest)) break;
        s = inside(s, finest);
        if (std::isnan(s)) break;

        const GuardSample sample = path_.value_and_rate(s);
        const bool beyond = path_.has_left(sample);
        curvature_ = std::max(std::max(curvature_, bend(lo, sample)), bend(sample, hi));
        const GuardSample replaced = beyond ? hi : lo;
        (beyond ? hi : lo) = sample;
        const double correction = -sample.value / sample.rate;
        const double distance = std::fabs(correction);
        if (is_straight(sample, distance, width, finest)) {
            if (ends_straight(sample, correction, where)) return where;
        } else if (scale_.may_be(sample.value) &&
                   std::fabs(last_value) < 16 * std::fabs(sample.value)) {
            const double noise = detail::close_in_noise(
                path_, sample, {s + correction, sample.value}, scale_, bracket_);
            if (noise > 0) return hidden(sample.rate, noise);
        }
        last_value = sample.value;
        // Repeatedly not halved: a root of higher order, a pole, or no root.
        linear = distance > 0.4 * last_distance && distance > 8 * finest ? linear + 1 : 0;
        last_distance = distance;
        if (linear == most_linear || !std::isfinite(correction)) {
            linear = 0;
            size_ = std::max(size_, detail::narrow_by_values(path_, bracket_, replaced, tolerance_,
                                                             1e-3 * width));
            path_.complete(lo);
            path_.complete(hi);
            s = hi.s - hi.value / hi.rate;
            slow_ = 0;
            continue;
        }
        // Converged from one side: sample the other side.
        past = distance > finest ? 0 : past > 0 ? 4 * past : finest;
        s += correction + (beyond ? -past : past);
        // Three samples have not halved the bracket: bisect.
        slow_ = bracket_.width() > width / 2 ? slow_ + 1 : 0;
        if (slow_ == 3) {
            s = lo.s + bracket_.width() / 2;
            slow_ = 0;
        }
    }
    return located({hi.s, 0});
}

}  // namespace

detail::Location Newton::locate(GuardPath& path, GuardSample lo, GuardSample hi,
                                double tolerance) const
{
    return Search(path, {lo, hi}, tolerance).run();
}

}  // namespace ricochet
