// Intervals of a motion on which guards are enclosed: their tubes, and how long the next one is.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "core/guard_table.hpp"
#include "core/step.hpp"
#include "core/tentative_steps.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/detector_table.hpp"
#include "ricochet/detail/motion_tube.hpp"

namespace ricochet::detail {

/// Lengths of intervals, as parts of the last one, from the range of the guard on it. Its radius
/// grows with the square of the length, as that of a chord does.
namespace intervals {

inline constexpr double most_growth = 4;
/// Part of the distance from the surface that is planned with: the rest is for what the range of
/// the last interval does not tell.
inline constexpr double part_of_distance = 0.8;

/// The length at which a guard that starts at `distance`, changes by `slope` over the last interval
/// and had the radius `radius` there is expected to be clear.
[[nodiscard]] inline double clear_part(double distance, double slope, double radius) noexcept
{
    const double closing = std::max(-slope, 0.0);
    const double c = part_of_distance * distance;
    const double root = std::sqrt(closing * closing + 4 * radius * c);
    return 2 * c / (closing + root);
}

/// After an interval on which the guard, times the sign of its side, had this range.
[[nodiscard]] inline double after_clear(const Enclosure& range) noexcept
{
    const double part = clear_part(range.centre + range.slope, 2 * range.slope, range.radius);
    return part > 0 ? std::min(part, most_growth) : 0.5;
}

/// Instead of an interval on which it had this range, which includes the surface.
[[nodiscard]] inline double instead_of(const Enclosure& range) noexcept
{
    const double part = clear_part(range.centre - range.slope, 2 * range.slope, range.radius);
    return part > 0 ? std::clamp(part, 0x1p-4, 0.75) : 0.25;
}

}  // namespace intervals

/// Bound of the distance of a polynomial from the cubic through its ends, from divided differences
/// over double nodes: max |p''''| h^4 / 384, where the fourth derivative of a product of k factors
/// is at most k (k - 1) (k - 2) (k - 3).
[[nodiscard]] inline double beyond_cubic(int k, double coefficient) noexcept
{
    return std::fabs(coefficient) * static_cast<double>(k * (k - 1) * (k - 2) * (k - 3)) / 384;
}

/// The same of component i of a step's polynomial.
template <class X>
[[nodiscard]] double beyond_cubic(const DenseParts<X>& step, std::size_t i) noexcept
{
    double sum = 0;
    if (step.nodes == DenseNodes::series) {
        double power = step.h * step.h * step.h;
        for (int k = 4; k <= step.series.order; ++k) {
            power *= step.h;
            const std::size_t at = static_cast<std::size_t>(k) * step.series.stride + i;
            sum += beyond_cubic(k, power * step.series.coefficients[at]);
        }
        return sum;
    }
    const auto component = [i](const X* x) { return (*x)[static_cast<decltype(x->size())>(i)]; };
    // The departure from the tangent, which is zero with its slope at the start.
    std::array<double, 8> u{}, d{};
    std::array<double, 8> slope{};
    std::size_t n = 2;
    const std::size_t inner = step.nodes == DenseNodes::end          ? 0
                              : step.nodes == DenseNodes::thirds_end ? 2
                                                                     : 1;
    for (std::size_t k = 0; k <= inner; ++k) {
        const double at = static_cast<double>(k + 1) / static_cast<double>(inner + 1);
        for (int twice = step.slope[k] ? 2 : 1; twice > 0; --twice) {
            u[n] = at;
            d[n] = component(step.w[k]);
            slope[n] = step.slope[k] ? step.h * component(step.slope[k]) : 0;
            ++n;
        }
    }
    for (std::size_t order = 1; order < n; ++order) {
        for (std::size_t k = n - 1; k >= order; --k) {
            const double gap = u[k] - u[k - order];
            d[k] = gap > 0 ? (d[k] - d[k - 1]) / gap : slope[k];
        }
        if (order >= 4) sum += beyond_cubic(static_cast<int>(order), d[order]);
    }
    return sum;
}

/// Describes the current step for the tubes that it will be in.
template <class X>
void describe_polynomial(const Step<X>& step, TentativeStep<X>& to)
{
    to.is_known = step.has_known_polynomial();
    to.is_cubic = to.is_known && step.is_cubic();
    if (!to.is_known || to.is_cubic) return;
    const DenseParts<X> parts = step.dense();
    if (to.beyond.size() != step.x0().size()) to.beyond = step.x0();
    for (std::size_t i = 0; i < step.x0().size(); ++i) {
        to.beyond[static_cast<decltype(to.beyond.size())>(i)] = beyond_cubic(parts, i);
    }
}

/// Ranges of guards on intervals of kept steps, and of parts of the current one.
template <class X>
class Enclosures {
public:
    Enclosures(const SystemAt<X>& system, const DetectorTable<X>& detector, const void* self)
        : system_(system), detector_(&detector), self_(self)
    {
        if (detector_->along) nodes_.reserve(std::max(detector_->longest, std::size_t{1}) + 1);
    }

    /// Range of a guard, times `sign`, from the start of kept step `lo` to that of `hi`, or to the
    /// end of the current step if that is one beyond the last.
    [[nodiscard]] Enclosure of_steps(const GuardInMode& of, double sign, const Step<X>& step,
                                     TentativeSteps<X>& steps, std::size_t lo, std::size_t hi)
    {
        nodes_.clear();
        const StepStart<X>& first = steps[lo].start;
        bool known = true;
        for (std::size_t k = lo; k < hi; ++k) {
            const TentativeStep<X>& at = steps[k];
            known = known && at.is_known;
            nodes_.push_back({.s = std::fabs(since(first.t, at.start.t)),
                              .x = &at.start.x,
                              .rate = &at.start.rate,
                              .beyond = at.is_cubic ? nullptr : &at.beyond});
        }
        if (!known) return Enclosure::unknown();
        double end = 0;
        if (hi == steps.size()) {
            nodes_.push_back(
                {.s = nodes_.back().s + step.h(), .x = &step.x1(), .rate = &step.rate1()});
            end = step.time(step.h());
        } else {
            const StepStart<X>& at = steps[hi].start;
            nodes_.push_back({.s = std::fabs(since(first.t, at.t)), .x = &at.x, .rate = &at.rate});
            end = at.t.value;
        }
        return range(of, sign, first.t.value, end);
    }

    /// Range of a guard, times `sign`, between two offsets of the current step.
    /// @param beyond  of the step, null: it is a cubic
    [[nodiscard]] Enclosure of_part(const GuardInMode& of, double sign, const Step<X>& step,
                                    const X* beyond, double from, double to)
    {
        place(step, from, x0_, rate0_);
        place(step, to, x1_, rate1_);
        const double part = (to - from) / step.h();
        nodes_.clear();
        nodes_.push_back({.s = 0,
                          .x = &x0_,
                          .rate = &rate0_,
                          .beyond = beyond,
                          .part = part * part * part * part});
        nodes_.push_back({.s = to - from, .x = &x1_, .rate = &rate1_});
        return range(of, sign, step.time(from), step.time(to));
    }

private:
    [[nodiscard]] static double since(const Instant& from, const Instant& to) noexcept
    {
        return (to.value - from.value) + (to.remainder - from.remainder);
    }

    void place(const Step<X>& step, double s, X& x, X& rate)
    {
        if (x.size() != step.x0().size()) x = rate = step.x0();
        if (s == 0) {
            assign(x, step.x0());
            assign(rate, step.rate0());
        } else if (s == step.h()) {
            assign(x, step.x1());
            assign(rate, step.rate1());
        } else {
            step.interpolate(s, x);
            step.rate_of_polynomial(s, rate);
        }
    }

    [[nodiscard]] Enclosure range(const GuardInMode& of, double sign, double t0, double t1) const
    {
        const MotionTube<X> tube(t0, t1, nodes_);
        const Enclosure range = detector_->along(self_, system_.adapter(), of, tube);
        return {sign * range.centre, sign * range.slope, range.radius};
    }

    SystemAt<X> system_;
    const DetectorTable<X>* detector_;
    const void* self_;
    std::vector<TubeNode<X>> nodes_;
    X x0_{}, x1_{}, rate0_{}, rate1_{};
};

}  // namespace ricochet::detail
