// Cover of a guard inside a step by the bounds that its system declares.
//
// Two values that do not close a step leave a part of it in which the guard can be at its surface:
// between the time that the first covers and the time that the second covers, backward. The guard
// is evaluated in the middle of that part, on the step's polynomial, and each half is divided in
// the same way, until all of the step is closed or the guard is found beyond its surface. Beside
// the surface, as behind an event and before a crossing, no values close the rest: the guard is
// evaluated where most of it is expected to be closed, until the rest is a 4096th of the step, or
// a quarter where every value lies on the cubic through the ends.
#pragma once

#include <algorithm>
#include <boost/container/small_vector.hpp>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>

#include "core/enclosed_intervals.hpp"
#include "core/event_hit.hpp"
#include "core/guard_table.hpp"
#include "core/step.hpp"
#include "ricochet/detail/cubic_check.hpp"
#include "ricochet/detail/detector_table.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::detail {

/// What bounds say about a guard in an interval.
struct Covered {
    bool proved = true;       ///< it stays on its side
    bool unresolved = false;  ///< the division has ended early
    bool leaves = false;      ///< it has an event between `lo` and `hi`, and none before
    Side side = Side::plateau;
    double lo = 0;  ///< [s] offset, on the side
    double hi = 0;  ///< [s] offset, beyond the surface
};

template <class X, bool single>
class StepCover {
    using Guards = GuardTable<X, single>;

public:
    /// Keeps a reference to the detector.
    StepCover(const SystemAt<X>& system, const Finders<X>& finders,
              const EventResolution& resolution)
        : system_(system),
          detector_(&finders.detector),
          self_(finders.detecting),
          resolution_(resolution),
          enclosures_(system, finders.detector, finders.detecting),
          in_use_(defers(finders.detector, *system.operator->()) &&
                  (finders.detector.needs_bounds || finders.detector.along))
    {
    }

    /// Whether steps are divided at all.
    [[nodiscard]] bool in_use() const noexcept { return !single && in_use_; }

    /// Whether the guard is covered by bounds inside steps.
    [[nodiscard]] bool covers(const GuardRecord& record) const noexcept
    {
        return in_use() && !record.info.boolean && record.side != Side::plateau;
    }

    /// Starts on another step.
    void begin() noexcept
    {
        last_.reset();
        is_described_ = false;
        refined_ = unresolved_ = false;
    }
    [[nodiscard]] bool refined() const noexcept { return refined_; }
    [[nodiscard]] bool unresolved() const noexcept { return unresolved_; }

    // --- guards that are enclosed ---

    /// Starts the next division by enclosures with a part of this length [s]; 0: of the whole step.
    void try_first(double interval) noexcept { first_interval_ = next_interval_ = interval; }
    /// Length [s] that the next interval may have.
    [[nodiscard]] double next_interval() const noexcept { return next_interval_; }
    /// Number of enclosures since it was last asked for.
    [[nodiscard]] std::uint64_t take_enclosed() noexcept { return std::exchange(enclosed_, 0); }

    /// The first event of a guard between `start`, where it is on `side`, and `end`, as far as its
    /// bounds tell. `inside`: a further value, if it lies between them.
    [[nodiscard]] Covered first_event(const Step<X>& step, const Guards& guards,
                                      const CoreGuard<X>& guard, Side side, GuardSample start,
                                      const GuardSample& inside, const GuardSample& end);

private:
    /// Enclosures of a guard in an interval. Each that closes a part takes some before it that do
    /// not, and beside the surface parts shrink to the finest.
    static constexpr std::size_t most_enclosures = 256;
    /// Part of an interval before its end in which a crossing is left to the locator, if that is no
    /// longer than `finest_part` of the step: several crossings in it would be taken for one.
    static constexpr double last_part = 0.25;
    /// Shortest part of a step that is enclosed: the resolution of a location is not far below it.
    static constexpr double finest_enclosed = 0x1p-30;
    static constexpr std::size_t most = 4096;          ///< evaluations of a guard in an interval
    static constexpr std::size_t few = 8;              ///< evaluations that tell how many it takes
    static constexpr double most_of_it = 1 - 0x1p-10;  ///< so that rounding leaves it closed
    static constexpr double finest_part = 0x1p-12;     ///< of the step, beside the surface
    /// Part of the interval that may stay open beside the surface, for a guard that follows the
    /// cubic through the ends.
    static constexpr double cubic_rest = 0x1p-2;
    /// A guard that is elsewhere than its cubic comes this close to it one time in a thousand.
    static constexpr double cubic_part = 0x1p-10;

    struct Interval {
        std::size_t guard;
        Side side;
        double from, value_from, to, value_to;
        bool operator==(const Interval&) const = default;
    };

    struct Task {
        const Step<X>& step;
        const Guards& guards;
        const CoreGuard<X>& guard;
        Side side;
    };

    struct Node {
        double s;
        GuardBound bound;
        bool done = false;  ///< the part behind it is not divided any more
    };

    [[nodiscard]] static double touch(const Task& task, const Node& a, const Node& b) noexcept
    {
        const double sum = std::fabs(a.bound.distance) + std::fabs(b.bound.distance);
        return task.guards.touch_of(task.guard.which(), sum);
    }
    [[nodiscard]] static bool is_beyond(const Task& task, const Node& node) noexcept
    {
        return node.bound.distance < -touch(task, node, node);
    }

    [[nodiscard]] static bool is_on_surface(const Task& task, const Node& node) noexcept
    {
        return std::fabs(node.bound.distance) <= touch(task, node, node);
    }

    /// The state at offset s.
    [[nodiscard]] const X& state_at(const Step<X>& step, double s)
    {
        if (s == 0) return step.x0();
        if (s == step.h()) return step.x1();
        if (x_.size() != step.x0().size()) x_ = step.x0();
        step.interpolate(s, x_);
        return x_;
    }
    [[nodiscard]] Node node(const Task& task, double s, double value, const X& x) const
    {
        const double t = task.step.time(s);
        const std::size_t i = task.guard.which();
        void* const adapter = system_.adapter();
        const double l = system_->lipschitz(adapter, i);
        const double speed = system_->speed_bound(adapter, i, task.guard.mode(), t, x);
        const double acceleration =
            system_->acceleration_bound(adapter, i, task.guard.mode(), t, x);
        return {.s = s,
                .bound = {.distance = sign_of(task.side) * value,
                          .speed = l * speed,
                          .acceleration = l * acceleration}};
    }
    [[nodiscard]] Node node(const Task& task, const GuardSample& at)
    {
        return node(task, at.s, at.value, state_at(task.step, at.s));
    }
    [[nodiscard]] Node evaluate(const Task& task, double s)
    {
        refined_ = true;
        const X& x = state_at(task.step, s);
        const double value = task.guard.value(task.step.time(s), x);
        const double deviation = cubic_.deviation((s - from_) / width_, value);
        is_cubic_ = is_cubic_ && deviation <= cubic_part * cubic_.size();
        return node(task, s, value, x);
    }

    /// Divides the interval up to the first value beyond the surface, which is returned.
    [[nodiscard]] std::optional<GuardSample> divide(const Task& task, const GuardSample& start,
                                                    const GuardSample& inside,
                                                    const GuardSample& end);

    /// Divides every part that is still open. False: there is none.
    [[nodiscard]] bool divide_parts(const Task& task, std::size_t& evaluated, double& need);

    /// Encloses the guard on the polynomial from `start` on, up to the first value beyond the
    /// surface, which is returned.
    [[nodiscard]] std::optional<GuardSample> enclose(const Task& task, const GuardSample& start,
                                                     GuardSample end);

    /// Where the part between two nodes is divided; NaN: it is closed, or is left as it is.
    /// @param need  increased by the number of evaluations that the part is expected to take
    [[nodiscard]] double place(const Task& task, const Node& lo, const Node& hi, double& need);

    /// The same for a part of which one end is clear of the surface, and the other is not.
    [[nodiscard]] double place_beside(const Task& task, const Node& clear, const Node& other,
                                      double& need);

    SystemAt<X> system_;
    const DetectorTable<X>* detector_;
    const void* self_;
    EventResolution resolution_;
    Enclosures<X> enclosures_;
    bool in_use_;
    TentativeStep<X> shape_{};  ///< of the current step's polynomial, once `is_described_`
    bool is_described_ = false;
    double first_interval_ = 0;  ///< [s]
    double next_interval_ = 0;   ///< [s]
    double clear_until_ = 0;     ///< [s] offset up to which the guard is clear
    std::uint64_t enclosed_ = 0;
    X x_{};
    boost::container::small_vector<Node, 48> nodes_, next_;
    CubicCheck cubic_{0, 0, 0, 0, 0};  ///< through the ends of the interval
    bool is_cubic_ = false;            ///< whether all values inside agree with it
    double from_ = 0;                  ///< [s] start of the interval
    double width_ = 0;                 ///< [s]
    std::optional<Interval> last_;     ///< of which `found_` tells
    Covered found_;
    bool refined_ = false;
    bool unresolved_ = false;
};

template <class X, bool single>
inline Covered StepCover<X, single>::first_event(const Step<X>& step, const Guards& guards,
                                                 const CoreGuard<X>& guard, Side side,
                                                 GuardSample start, const GuardSample& inside,
                                                 const GuardSample& end)
{
    const Interval interval{guard.which(), side, start.s, start.value, end.s, end.value};
    if (last_ && *last_ == interval) return found_;
    last_ = interval;
    found_ = {};
    if (start.s == 0 && guards.starts_at_event(guard.which(), step)) start.value = 0;
    while (start.s < end.s) {
        const Task task{step, guards, guard, side};
        const std::optional<GuardSample> beyond =
            detector_->along ? enclose(task, start, end) : divide(task, start, inside, end);
        if (!beyond) break;
        found_.proved = false;
        if (counts(side, guard.crossing())) {
            found_.leaves = true;
            found_.side = side;
            found_.lo = detector_->along ? clear_until_ : nodes_[nodes_.size() - 2].s;
            found_.hi = beyond->s;
            break;
        }
        side = opposite(side);
        start = *beyond;
    }
    unresolved_ = unresolved_ || found_.unresolved;
    return found_;
}

template <class X, bool single>
inline auto StepCover<X, single>::divide(const Task& task, const GuardSample& start,
                                         const GuardSample& inside, const GuardSample& end)
    -> std::optional<GuardSample>
{
    const double width = end.s - start.s;
    cubic_ = {start.value, start.rate, end.value, end.rate, width};
    is_cubic_ = std::isfinite(cubic_.size());
    from_ = start.s;
    width_ = width;
    nodes_.clear();
    nodes_.push_back(node(task, start));
    if (inside.s > start.s && inside.s < end.s) nodes_.push_back(node(task, inside));
    if (nodes_.size() < 2 || !is_beyond(task, nodes_[1])) nodes_.push_back(node(task, end));
    std::size_t evaluated = 0;
    double need = 0;
    while (divide_parts(task, evaluated, need)) {
        if (evaluated < most && (evaluated < few || need <= static_cast<double>(most))) continue;
        found_.proved = false;
        found_.unresolved = true;
        break;
    }
    const Node& last = nodes_.back();
    if (!is_beyond(task, last)) return std::nullopt;
    return GuardSample{.s = last.s, .value = sign_of(task.side) * last.bound.distance};
}

// Long: one search whose nodes, range and evidence its parts have in common.
template <class X, bool single>
inline auto StepCover<X, single>::enclose(const Task& task, const GuardSample& start,
                                          GuardSample end) -> std::optional<GuardSample>
{
    const Step<X>& step = task.step;
    if (!is_described_) describe_polynomial(step, shape_);
    is_described_ = true;
    if (!shape_.is_known) {
        found_.proved = false;
        return std::nullopt;
    }
    const X* const beyond = shape_.is_cubic ? nullptr : &shape_.beyond;
    const double sign = sign_of(task.side);
    const double finest = finest_enclosed * step.h();
    double open = finest;  // parts that cannot be cleared may be as long as those just before
    const std::size_t i = task.guard.which();
    const auto value_at = [&](double s) {
        refined_ = true;
        return task.guard.value(step.time(s), state_at(step, s));
    };
    const auto touch_of = [&](double size) { return task.guards.touch_of(i, 2 * size); };
    const auto is_across = [&](double value) { return sign * value < -touch_of(std::fabs(value)); };
    const double whole = end.s - start.s;
    const double left_over = std::min(last_part * whole, finest_part * step.h());
    double s = start.s;
    double width = first_interval_ > 0 ? std::min(first_interval_, whole) : whole;
    bool has_failed = first_interval_ > 0;
    first_interval_ = 0;
    // Ends the search where the interval is known to leave, and what is left of it is short. A
    // place at which the guard is expected to be beyond makes it shorter.
    const auto is_bracketed = [&](double probe) {
        if (!(end.value == end.value)) end.value = value_at(end.s);
        if (sign * end.value > touch_of(std::fabs(end.value))) return false;
        if (probe < end.s && end.s - s > left_over) {
            const double value = value_at(probe);
            if (is_across(value)) end = {.s = probe, .value = value};
        }
        return end.s - s <= left_over;
    };
    const auto bracket = [&]() -> std::optional<GuardSample> {
        found_.proved = false;
        clear_until_ = s;
        if (is_across(end.value)) return end;
        return std::nullopt;
    };
    const bool is_sampled = start.value == start.value;
    for (std::size_t tried = 0; s < end.s; ++tried) {
        if (tried == most_enclosures) {
            found_.proved = false;
            found_.unresolved = true;
            break;
        }
        const double rest = end.s - s;
        width = std::min(std::max(width, open), rest);
        if (!has_failed && width > 0.75 * rest) width = rest;
        const double to = width < rest ? s + width : end.s;
        const Enclosure range =
            enclosures_.of_part({i, task.guard.mode(), step.backward()}, sign, step, beyond, s, to);
        ++enclosed_;
        const double size = std::fabs(range.centre) + std::fabs(range.slope) + range.radius;
        const double tie = to == step.h() && step.is_pinned() ? tolerances::by_rounding * size : 0;
        if (range.lower() > std::max(touch_of(size), tie)) {
            s = to;
            const double part = intervals::after_clear(range);
            width *= part;
            next_interval_ = width;
            open = finest;
            has_failed = false;
            if (part < 0.5 && s < end.s && is_bracketed(s + 2 * width)) return bracket();
            continue;
        }
        has_failed = true;
        if (s == start.s && is_sampled && std::fabs(start.value) <= touch_of(size)) {
            // No range excludes the root at the start.
            found_.proved = false;
            width = std::min(finest_part * step.h(), rest);
            s = width < rest ? s + width : end.s;
            continue;
        }
        if (is_bracketed(to)) return bracket();
        if (width > open) {
            const bool is_known = std::isfinite(range.radius);
            if (is_known || width > step.h() / 64) {
                width *= is_known ? intervals::instead_of(range) : 0.25;
                next_interval_ = width;
                continue;
            }
        }
        found_.proved = false;
        if (!std::isfinite(range.radius)) {  // a comparison that is decided nowhere near
            found_.unresolved = true;
            break;
        }
        clear_until_ = s;
        const double value = to < end.s ? value_at(to) : end.value;
        if (is_across(value)) return GuardSample{.s = to, .value = value};
        s = to;
        open *= 2;
    }
    return std::nullopt;
}

template <class X, bool single>
inline bool StepCover<X, single>::divide_parts(const Task& task, std::size_t& evaluated,
                                               double& need)
{
    bool divided = false;
    need = 0;
    next_.clear();
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
        next_.push_back(nodes_[k]);
        if (nodes_[k].done || k + 1 == nodes_.size()) continue;
        const double s = place(task, nodes_[k], nodes_[k + 1], need);
        if (!(s > nodes_[k].s && s < nodes_[k + 1].s)) {
            next_.back().done = true;
            continue;
        }
        divided = true;
        ++evaluated;
        Node node = evaluate(task, s);
        const bool stays = is_on_surface(task, nodes_[k]) && is_on_surface(task, node) &&
                           is_on_surface(task, nodes_[k + 1]);
        next_.back().done = node.done = stays;
        next_.push_back(node);
        if (is_beyond(task, node)) break;
    }
    nodes_.swap(next_);
    return divided;
}

template <class X, bool single>
inline double StepCover<X, single>::place(const Task& task, const Node& lo, const Node& hi,
                                          double& need)
{
    constexpr double nowhere = std::numeric_limits<double>::quiet_NaN();
    const double tolerance = touch(task, lo, hi);
    const double width = hi.s - lo.s;
    const bool from_clear = lo.bound.distance > tolerance;
    const bool to_clear = hi.bound.distance > tolerance;
    if (from_clear != to_clear) {
        return from_clear ? place_beside(task, lo, hi, need) : place_beside(task, hi, lo, need);
    }
    if (from_clear) {
        if (detector_->closes(self_, lo.bound, hi.bound, width, tolerance)) return nowhere;
        const double behind = detector_->sure(self_, lo.bound, tolerance);
        const double ahead = detector_->sure(self_, hi.bound, tolerance);
        const double from = lo.s + behind;
        const double to = hi.s - ahead;
        const double speed = (1 + detector_->margin) * std::max(lo.bound.speed, hi.bound.speed);
        if (!(to > from)) return lo.s + 0.5 * width;
        const bool means = behind > 0 || ahead > 0;  // bounds that are none cover nothing
        if (means && std::isfinite(speed) && to - from > resolution_.blur(task.step.time(hi.s))) {
            const double far = std::max(lo.bound.distance, hi.bound.distance);
            const double near = std::min(lo.bound.distance, hi.bound.distance);
            need += (to - from) * speed / (far + near);
            // From the farther end, as much of the part as the value there is expected to close.
            const double closed = most_of_it * 2 * far / (speed + (far - near) / width);
            if (!(closed > 0.5 * width && closed < width)) return from + 0.5 * (to - from);
            return lo.bound.distance > hi.bound.distance ? lo.s + closed : hi.s - closed;
        }
        found_.unresolved = true;
    }
    found_.proved = false;
    const bool returns = !from_clear && width > finest_part * task.step.h();
    return returns ? lo.s + 0.5 * width : nowhere;
}

template <class X, bool single>
inline double StepCover<X, single>::place_beside(const Task& task, const Node& clear,
                                                 const Node& other, double& need)
{
    found_.proved = false;
    const double width = other.s - clear.s;  // negative behind the surface
    const double finest = is_cubic_ ? cubic_rest * width_ : finest_part * task.step.h();
    const double speed = (1 + detector_->margin) * std::max(clear.bound.speed, other.bound.speed);
    const double distance = clear.bound.distance;
    const double beyond = std::max(-other.bound.distance, 0.0);
    const double sure = detector_->sure(self_, clear.bound, 0);
    const double open = std::fabs(width) - sure;
    if (!(open > finest) || !(sure > 0) || !std::isfinite(speed)) {
        return std::numeric_limits<double>::quiet_NaN();
    }
    // The surface is expected on the line through both values.
    const double part = distance / (distance + beyond);
    const double ahead = part * std::fabs(width);
    if (ahead <= 0.5 * finest) return clear.s + std::copysign(ahead + 0.5 * finest, width);
    const double slope = distance / ahead;
    need += speed / slope;
    // With its value there, the guard is expected to be covered up to this fraction of the way.
    const double covered = most_of_it * 2 * slope / (speed + slope);
    return clear.s + std::clamp(covered, 0.5, 1 - 0x1p-9) * part * width;
}

}  // namespace ricochet::detail
