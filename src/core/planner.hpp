// Deadlines of the checks of guards.
//
// After a check every guard is deferred until its bound no longer excludes an event. The earliest
// of these deadlines is compared with the end of every step; until it is reached no guard
// costs anything. A guard whose deadline has passed is pending: the steps from there on are
// tentative, and their starts are kept. The interval is closed by one check of its end; where
// that is not enough it is halved at the kept starts, and the exact detector examines the first
// step that no two checks can close.
//
// Times are counted forward: in a run backward in time they are negative.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "core/cost_comparison.hpp"
#include "core/enclosed_intervals.hpp"
#include "core/event_search.hpp"
#include "core/guard_table.hpp"
#include "core/tentative_steps.hpp"
#include "core/tolerances.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/run.hpp"

namespace ricochet::detail {

/// Last check of a guard and the deadlines that follow from it.
struct LastCheck {
    double time = 0;                                         ///< [s]
    double value = 0;                                        ///< g, or a lower bound on it
    double rate = std::numeric_limits<double>::quiet_NaN();  ///< rate of g; NaN: not evaluated
    GuardBound bound;
    bool exact = false;
    double sure = 0;   ///< [s] deadline, up to which the guard is covered
    double hoped = 0;  ///< [s] when a check is expected to close the interval; never before `sure`
    double slope = std::numeric_limits<double>::quiet_NaN();  ///< of the distance, from two checks
    bool verify = false;  ///< the exact detector examines the next step
    bool unclear =
        false;  ///< a gate clears nothing, so that the exact detector examines the next step, too
    bool refused = false;   ///< a gate had no lower bound when it was last asked
    std::size_t first = 0;  ///< index of the first tentative step beyond `sure`
    double later_time = std::numeric_limits<double>::quiet_NaN();  ///< [s] time of another check
    double later_value = 0;
    double interval = 0;  ///< [s] length of the next interval on which the guard is enclosed

    template <class Visit>
    void visit(Visit&& visit)
    {
        for (double* number :
             {&time, &value, &rate, &bound.distance, &bound.speed, &bound.acceleration, &sure,
              &hoped, &slope, &later_time, &later_value, &interval}) {
            visit(*number);
        }
        visit(exact);
        visit(verify);
        visit(unclear);
        visit(refused);
    }
};

template <class X, bool single>
class Planner {
    static constexpr double infinity = std::numeric_limits<double>::infinity();
    using Guards = GuardTable<X, single>;
    using Steps = TentativeSteps<X>;

public:
    static constexpr std::size_t none = static_cast<std::size_t>(-1);

    /// Keeps a reference to the finders.
    Planner(const SystemAt<X>& system, const Finders<X>& finders, const X& like, bool backward,
            std::size_t guards)
        : system_(system),
          detector_(&finders.detector),
          self_(finders.detecting),
          bounded_(detector_->needs_bounds),
          gated_(!bounded_ && detector_->horizon),
          costs_(detector_->metering, guards),
          backward_(backward),
          enclosures_(system, finders.detector, finders.detecting),
          steps_(detector_->longest, like),
          checks_(guards),
          deadlines_(guards),
          pending_(guards),
          judged_(guards)
    {
        for (std::size_t i = 0; i < guards; ++i) checks_.push_back({});
    }

    [[nodiscard]] Steps& steps() noexcept { return steps_; }
    [[nodiscard]] bool in_interval() const noexcept { return steps_.size() > 0; }
    /// Whether intervals are closed by enclosures of the guards.
    [[nodiscard]] bool encloses() const noexcept { return detector_->along; }

    /// Whether no guard needs a check until the time `end`.
    [[nodiscard]] bool covers(double end) const noexcept { return end <= limit_; }

    /// Time [s] until which no guard needs a check.
    [[nodiscard]] double limit() const noexcept { return limit_; }

    /// Whether planning is known to cost more than it saves, so that the exact detector is to
    /// examine every step. Intervals are closed first.
    [[nodiscard]] bool steps_aside() const noexcept { return costs_.checks() && !in_interval(); }
    void review(const Statistics& counts) { costs_.review(counts); }

    /// Plans after every guard has been armed at the start of the step, and sampled there.
    void begin(const Step<X>& step, Guards& guards)
    {
        steps_.clear();
        deadlines_.clear();
        pending_.clear();
        judged_.clear();
        const double now = clock(step.time(0));
        for (std::size_t i = 0; i < guards.size(); ++i) {
            if (!guards[i].enabled) continue;
            const double interval = checks_[i].interval;
            checks_[i] = {};
            checks_[i].interval = interval;
            checks_[i].time = now;
            checks_[i].slope = sign_of(guards[i].side) * guards.rate0(i);
            rest_from(i,
                      {.time = now,
                       .value = guards.g0(i),
                       .t = step.time(0),
                       .x = &step.x0(),
                       .exact = true},
                      step.mode(), guards);
            checks_[i].rate = guards.rate0(i);
            // No range on an interval that starts at the surface excludes it.
            if (encloses() && guards.starts_at_event(i, step)) checks_[i].verify = true;
            schedule(i);
            guards.put_to_sleep(i);
        }
        find_limit();
    }

    /// Takes over the current step, which ends at `end`, beyond the deadline of some guards. The
    /// last of the kept steps is this one.
    void overrun(double end)
    {
        while (!deadlines_.empty() && deadlines_[0].deadline < end) {
            const std::size_t i = pop();
            checks_[i].first = steps_.size() - 1;
            hoped_ = std::min(hoped_, checks_[i].verify ? -infinity : checks_[i].hoped);
            pending_.push_back(i);
        }
        limit_ = -infinity;
    }

    /// Whether the interval is expected to be closed at the time `end`.
    [[nodiscard]] bool hopes(double end) const noexcept { return end <= hoped_; }

    /// Checks every pending guard at the end of the current step and, if doubts remain, at earlier
    /// starts. Returns the first step that could not be closed, or `none`; if it is the current
    /// step, `judged` has the guards that the exact detector examines in it.
    [[nodiscard]] std::size_t close(const Step<X>& step, Guards& guards, Statistics& counts,
                                    double h_next)
    {
        assert(in_interval());
        costs_.review(counts);
        const std::size_t last = steps_.size() - 1;
        std::size_t doubt = none;
        for (const std::size_t i : pending_) {
            const bool in_doubt = std::exchange(checks_[i].verify, false);
            const std::size_t failed = encloses() ? enclose_one(i, in_doubt, step, guards, counts)
                                                  : close_one(i, step, guards, counts, h_next);
            checks_[i].first = failed;
            doubt = std::min(doubt, failed);
        }
        // Beyond an event the flow is not the motion, and a bound may fail to hold.
        if (wrong_ && doubt != none && clock(wrong_->t) > place(doubt, step).time) wrong_.reset();
        judged_.clear();
        for (const std::size_t i : pending_) {
            LastCheck& check = checks_[i];
            check.verify = doubt != none && check.first == doubt;
            if (check.verify && doubt == last) {
                judged_.push_back(i);
            } else {
                schedule(i);
            }
        }
        end_interval();
        return doubt;
    }

    /// Rolls the interval back without a check.
    void abandon()
    {
        for (const std::size_t i : pending_) schedule(i);
        end_interval();
    }

    /// Defers those of the guards to be verified that their bounds clear on a division of the
    /// current step. Tells the table which of the others have an event inside.
    void close_inside(const Step<X>& step, Guards& guards, EventSearch<X, single>& search,
                      Statistics& counts);

    /// Guards that the exact detector verifies in the current step.
    [[nodiscard]] std::span<const std::size_t> judged() const noexcept { return judged_.span(); }

    /// Wakes the guards to be verified, with their samples at both ends of the step.
    /// `last_h`: the step before it [s].
    void wake(const Step<X>& step, Guards& guards, Statistics& counts, double last_h)
    {
        for (const std::size_t i : judged()) {
            LastCheck& check = checks_[i];
            const double h = step.h();
            const Check start = check_of(step.time(0), step.x0());
            const Check end = check_of(step.time(h), step.x1());
            const double value = value_at(i, start, step.mode(), guards, counts);
            if (!(check.rate == check.rate) || check.time != start.time) {
                check.rate = costs_.time_guard([&] {
                    return guards.rate_of(i, Guards::arrival_of(step, last_h), counts.guard_calls);
                });
            }
            const double end_value = value_at(i, end, step.mode(), guards, counts);
            const double rate = costs_.time_guard(
                [&] { return guards.rate_of(i, Guards::end_of(step), counts.guard_calls); });
            guards.wake(i, {.s = 0, .value = value, .rate = check.rate},
                        {.s = h, .value = end_value, .rate = rate});
            remember(check, end.time, end_value);
            check.rate = rate;
        }
    }

    /// Defers the verified guards from the end of a step in which the exact detector has found
    /// nothing that cuts it short.
    void settle(const Step<X>& step, Guards& guards, Statistics& counts)
    {
        const double t = step.time(step.h());
        for (const std::size_t i : judged()) {
            LastCheck& check = checks_[i];
            Check end = check_of(t, step.x1());
            // A step that was shortened after `wake` ends elsewhere.
            const bool same_end = check.later_time == end.time;
            const double rate = same_end ? check.rate : std::numeric_limits<double>::quiet_NaN();
            check.verify = false;
            end.value = value_at(i, end, step.mode(), guards, counts);
            defer_from(i, end, step.mode(), guards);
            check.rate = rate;
            guards.put_to_sleep(i);
        }
        judged_.clear();
        find_limit();
    }

    /// Tests one of the deferred guards, in rotation, at the end of every 64th unchecked step, if
    /// bounds are checked.
    void sample_sleeper(const Step<X>& step, Guards& guards, Statistics& counts)
    {
        if (!bounded_ || !detector_->checks_bounds) return;
        if (++covered_ % 64 != 0 || guards.size() == 0) return;
        const std::size_t i = covered_ / 64 % guards.size();
        watch_sleeper(i, place(steps_.size(), step), step.mode(), guards, counts);
    }

    /// Checks the guards that are still deferred when the run ends, at the start of the step: a
    /// guard beyond its surface was covered by a bound that was wrong.
    void check_last(const Step<X>& step, Guards& guards, Statistics& counts)
    {
        if (!bounded_) return;
        for (std::size_t i = 0; i < guards.size(); ++i) {
            watch_sleeper(i, check_of(step.time(0), step.x0()), step.mode(), guards, counts);
        }
    }

    /// Adds the calls of gates since the last such addition.
    void add_counts(Statistics& counts) noexcept
    {
        counts.network_calls += asked_;
        counts.outside_domain += outside_;
        asked_ = outside_ = 0;
    }

    /// Whether asking the network saves time.
    [[nodiscard]] const auto& costs() const noexcept { return costs_; }

    /// The bound that a guard has violated.
    [[nodiscard]] const std::optional<WrongBound<X>>& wrong() const noexcept { return wrong_; }

    /// Forgets a recorded violation. After a restart, or a return to an earlier step, the motion
    /// from here on need not repeat it.
    void forget_wrong() noexcept { wrong_.reset(); }

    template <class Visit>
    void visit(Visit&& visit)
    {
        for (LastCheck& check : checks_) check.visit(visit);
    }

    /// Rebuilds the queue after `visit` has restored the checks.
    void restore(const Guards& guards)
    {
        deadlines_.clear();
        pending_.clear();
        judged_.clear();
        steps_.clear();
        wrong_.reset();
        for (std::size_t i = 0; i < guards.size(); ++i) {
            if (guards[i].enabled) schedule(i);
        }
        find_limit();
    }

private:
    /// A guard, and the bounds on it, at an instant.
    struct Check {
        double time = 0;  ///< [s] counted forward
        double value = 0;
        double t = 0;  ///< [s]
        const X* x = nullptr;
        bool exact = true;
        GuardBound bound{};
    };

    struct Deadline {
        double deadline;
        std::size_t guard;
    };

    [[nodiscard]] double clock(double t) const noexcept { return backward_ ? -t : t; }

    // --- the queue of deadlines: a heap, earliest first ---

    [[nodiscard]] static bool later(const Deadline& a, const Deadline& b) noexcept
    {
        return a.deadline > b.deadline;
    }

    void schedule(std::size_t i)
    {
        const LastCheck& check = checks_[i];
        deadlines_.push_back({check.verify ? -infinity : check.sure, i});
        std::push_heap(deadlines_.begin(), deadlines_.end(), later);
    }

    [[nodiscard]] std::size_t pop()
    {
        std::pop_heap(deadlines_.begin(), deadlines_.end(), later);
        const std::size_t i = deadlines_[deadlines_.size() - 1].guard;
        deadlines_.shrink(deadlines_.size() - 1);
        return i;
    }

    void find_limit() noexcept { limit_ = deadlines_.empty() ? infinity : deadlines_[0].deadline; }

    void end_interval() noexcept
    {
        pending_.clear();
        hoped_ = infinity;
        find_limit();
    }

    // --- bounds ---

    /// The guard's bounds at a check. A bound that is negative or NaN covers nothing, and is
    /// reported as wrong if bounds are checked.
    [[nodiscard]] GuardBound bound(std::size_t i, const Check& check, Mode mode, Side side)
    {
        GuardBound at{.distance = sign_of(side) * check.value, .speed = 0, .acceleration = 0};
        if (!bounded_) return at;
        const double l = system_->lipschitz(system_.adapter(), i);
        at.speed = l * system_->speed_bound(system_.adapter(), i, mode, check.t, *check.x);
        at.acceleration =
            l * system_->acceleration_bound(system_.adapter(), i, mode, check.t, *check.x);
        if (detector_->checks_bounds && !(at.speed >= 0 && at.acceleration >= 0) && !wrong_) {
            blame(i, check, check, at.speed >= 0 ? at.acceleration : at.speed);
        }
        return at;
    }

    /// Event tolerance, which the guard must not have come within. In an interval that
    /// closes, the guard is no farther away than the sum of its distances at the ends.
    [[nodiscard]] static double tolerance_of(const Guards& guards, std::size_t i, double a,
                                             double b) noexcept
    {
        return guards.touch_of(i, std::fabs(a) + std::fabs(b));
    }

    /// Defers the guard, starting from this check.
    void rest_from(std::size_t i, const Check& at, Mode mode, const Guards& guards)
    {
        LastCheck& check = checks_[i];
        Check now = at;
        now.bound = bound(i, at, mode, guards[i].side);
        plan_after(i, check, now, mode, guards);
    }

    /// Defers the guard from the end of a step that has been examined, and queues its deadline.
    void defer_from(std::size_t i, Check end, Mode mode, const Guards& guards)
    {
        end.bound = bound(i, end, mode, guards[i].side);
        check_change(i, last_check(i), end, guards);
        plan_after(i, checks_[i], end, mode, guards);
        schedule(i);
    }

    /// Time [s] from here that needs no check by a gate; 0 without a gate.
    [[nodiscard]] double horizon(const Check& at, Mode mode)
    {
        // Gates predict the future only, not the past.
        if (!detector_->horizon || backward_ || !costs_.asks()) return 0;
        const GateAnswer answer = costs_.time_network(
            [&] { return detector_->horizon(self_, system_.adapter(), mode, at.t, *at.x); });
        ++asked_;
        outside_ += answer.outside ? 1 : 0;
        if (answer.cleared > 0) costs_.note_cleared();
        return answer.cleared;
    }

    void plan_after(std::size_t i, LastCheck& check, const Check& at, Mode mode,
                    const Guards& guards)
    {
        const double passed = at.time - check.time;
        if (passed > 0) {
            check.slope = check.exact == at.exact
                              ? (at.bound.distance - check.bound.distance) / passed
                              : std::numeric_limits<double>::quiet_NaN();
        }
        check.time = at.time;
        check.value = at.value;
        check.bound = at.bound;
        check.exact = at.exact;
        check.rate = std::numeric_limits<double>::quiet_NaN();
        if (never_sleeps(guards[i])) {
            check.verify = true;
            check.sure = check.hoped = -infinity;
            return;
        }
        const double reach = tolerance_of(guards, i, at.value, at.value);
        // Rounding of the time must not lengthen the covered interval.
        const double ulps = tolerances::of_time * std::fabs(at.time);
        check.sure = at.time + detector_->sure(self_, at.bound, reach) - ulps;
        const double cleared = horizon(at, mode);
        check.unclear = gated_ && !(cleared > 0);
        if (check.unclear) check.verify = true;
        // Rounding may leave an interval open that would otherwise just close.
        const double hoped = (1 - 1e-12) * detector_->hoped(self_, at.bound, check.slope, reach);
        const double ahead = std::max({hoped, cleared, encloses() ? check.interval : 0});
        check.hoped =
            std::max(check.sure, at.time + (expects_level(check, guards[i].side) ? 0 : ahead));
    }

    /// Whether a gate is likely to have a lower bound where the cover by this check ends; any bound
    /// suffices there, so that the gate is asked immediately.
    [[nodiscard]] bool expects_level(const LastCheck& check, Side side) const noexcept
    {
        if (!detector_->level || side != Side::above) return false;
        const double slope = std::isfinite(check.slope) ? check.slope : 0;
        const double then = check.bound.distance + slope * (check.sure - check.time);
        return costs_.asks() && !check.refused && then > detector_->lowest_level;
    }

    /// Whether a guard may tie with the end of the step, before which it has not crossed.
    [[nodiscard]] static bool ties(const Step<X>& step, double from, double to) noexcept
    {
        return step.is_pinned() && std::fabs(to) <= tolerances::by_rounding * std::fabs(from);
    }

    [[nodiscard]] bool never_sleeps(const GuardRecord& record) const noexcept
    {
        return record.side == Side::plateau || (bounded_ && record.info.boolean);
    }

    [[nodiscard]] bool closes(const Guards& guards, std::size_t i, const Check& a,
                              const Check& b) const
    {
        return detector_->closes(self_, a.bound, b.bound, b.time - a.time,
                                 tolerance_of(guards, i, a.value, b.value));
    }

    // --- checks ---

    static void remember(LastCheck& check, double time, double value) noexcept
    {
        check.later_time = time;
        check.later_value = value;
    }

    /// The guard's exact value: that of the last check or another at this time, or else evaluated.
    [[nodiscard]] double value_at(std::size_t i, const Check& at, Mode mode, const Guards& guards,
                                  Statistics& counts)
    {
        const LastCheck& check = checks_[i];
        if (check.exact && check.time == at.time) return check.value;
        if (check.later_time == at.time) return check.later_value;
        return costs_.time_guard(
            [&] { return guards.view(i, mode, counts.guard_calls).value(at.t, *at.x); });
    }

    /// An exact check at the start of tentative step k; for k past the last, at the end of the
    /// current step.
    [[nodiscard]] Check check_at(std::size_t i, std::size_t k, const Step<X>& step,
                                 const Guards& guards, Statistics& counts)
    {
        Check check = place(k, step);
        check.value = value_at(i, check, step.mode(), guards, counts);
        check.bound = bound(i, check, step.mode(), guards[i].side);
        if (detector_->checks_bounds) check_bound(i, check, step.mode(), guards);
        return check;
    }

    [[nodiscard]] Check place(std::size_t k, const Step<X>& step) const
    {
        if (k == steps_.size()) return check_of(step.time(step.h()), step.x1());
        const StepStart<X>& start = steps_[k].start;
        return check_of(start.t.value, start.x);
    }
    [[nodiscard]] Check check_of(double t, const X& x) const
    {
        return {.time = clock(t), .t = t, .x = &x};
    }

    /// A check by which the lower bound there or, below the surface, the upper bound covers guard
    /// i, if one does.
    [[nodiscard]] std::optional<Check> bound_at(std::size_t i, std::size_t k, const Step<X>& step,
                                                const Guards& guards, Statistics& counts)
    {
        if (!bounded_) return std::nullopt;
        Check check;
        if (system_->upper_bound && guards[i].side == Side::below) {
            check = place(k, step);
            check.exact = false;
            ++counts.bound_calls;
            check.value =
                system_->upper_bound(system_.adapter(), i, step.mode(), check.t, *check.x);
            check.bound = bound(i, check, step.mode(), Side::below);
            return check.value < 0 ? std::optional(check) : std::nullopt;
        }
        if (!system_->lower_bound && !detector_->level) return std::nullopt;
        if (guards[i].side != Side::above) return std::nullopt;
        check = place(k, step);
        check.exact = false;
        check.value = 0;
        if (system_->lower_bound) {
            ++counts.bound_calls;
            check.value =
                system_->lower_bound(system_.adapter(), i, step.mode(), check.t, *check.x);
        }
        if (detector_->level && costs_.asks()) {
            check.value = std::max(check.value, ask_level(i, check, step.mode()));
        }
        check.bound = bound(i, check, step.mode(), Side::above);
        return check.value > 0 ? std::optional(check) : std::nullopt;
    }

    /// A lower bound of guard i from a gate; 0: none.
    [[nodiscard]] double ask_level(std::size_t i, const Check& at, Mode mode)
    {
        const GateAnswer answer = costs_.time_network([&] {
            return detector_->level(self_, system_.adapter(), {i, mode}, at.t, *at.x);
        });
        ++asked_;
        outside_ += answer.outside ? 1 : 0;
        checks_[i].refused = !(answer.cleared > 0);
        if (answer.cleared > 0) costs_.note_cleared();
        return answer.cleared;
    }

    /// The last check of guard i.
    [[nodiscard]] Check last_check(std::size_t i) const noexcept
    {
        const LastCheck& check = checks_[i];
        return {
            .time = check.time, .value = check.value, .exact = check.exact, .bound = check.bound};
    }

    /// Closes the interval of guard i; returns the first step that could not be closed, or `none`.
    [[nodiscard]] std::size_t close_one(std::size_t i, const Step<X>& step, Guards& guards,
                                        Statistics& counts, double h_next);

    /// Encloses guard i on the interval, in as few parts as it takes; returns the first step
    /// that is not proved, or `none`. @param in_doubt  its step is known not to be
    [[nodiscard]] std::size_t enclose_one(std::size_t i, bool in_doubt, const Step<X>& step,
                                          Guards& guards, Statistics& counts);

    /// Whether the range of a guard, times the sign of its side, is clear of the surface, also of a
    /// tie with the end of a step.
    [[nodiscard]] static bool is_clear(const Guards& guards, std::size_t i, const Enclosure& range,
                                       bool may_tie) noexcept
    {
        const double size = std::fabs(range.centre) + std::fabs(range.slope) + range.radius;
        const double rounding = may_tie ? tolerances::by_rounding * size : 0;
        return range.lower() > std::max(guards.touch_of(i, 2 * size), rounding);
    }

    /// Defers guard i from a time up to which it is proved to be clear.
    void defer_enclosed(std::size_t i, double time, double interval)
    {
        LastCheck& check = checks_[i];
        check.time = check.sure = time;
        check.exact = false;
        check.rate = check.later_time = std::numeric_limits<double>::quiet_NaN();
        check.interval = interval;
        check.hoped = time + interval;
    }

    /// A guard that is to be shown clear up to the end of the current step.
    struct Closing {
        std::size_t i;
        const Step<X>& step;
        const Guards& guards;
        Statistics& counts;
    };

    /// Whether the guard stays clear between a check `from`, whose cover reaches the start of
    /// tentative step `lo`, and the check `end` at the start of step `hi`. If not, returns the
    /// first step that is in doubt, with `from` moved to its start.
    [[nodiscard]] std::size_t narrow(const Closing& on, Check& from, std::size_t lo, std::size_t hi,
                                     const Check& end);

    // --- tests of the bounds ---

    void check_change(std::size_t i, const Check& from, const Check& to, const Guards& guards);

    /// Reports a guard that is across its surface although it was covered all the way between
    /// the two checks.
    void check_covered(std::size_t i, const Check& from, const Check& to, const Guards& guards);

    void blame_change(std::size_t i, const Check& from, const Check& to, const Guards& guards);

    void blame(std::size_t i, const Check& from, const Check& to, double allowed);

    /// Evaluates a deferred guard, and reports a bound as wrong that the value contradicts. A guard
    /// beyond its surface is reported whatever its bounds allow there.
    void watch_sleeper(std::size_t i, Check now, Mode mode, const Guards& guards,
                       Statistics& counts);

    /// Reports a declared bound that an exact value contradicts. Beyond the surface a bound may
    /// have ended at 0.
    void check_bound(std::size_t i, const Check& check, Mode mode, const Guards& guards);

    void check_against(double bound, std::size_t i, const Check& check, const Guards& guards);

    SystemAt<X> system_;
    const DetectorTable<X>* detector_;
    const void* self_;
    bool bounded_;  ///< defers by declared bounds
    bool gated_;    ///< defers only by what a gate clears
    NetworkCosts costs_;
    bool backward_;
    Enclosures<X> enclosures_;
    Steps steps_;
    GuardList<LastCheck, single> checks_;
    GuardList<Deadline, single> deadlines_;
    GuardList<std::size_t, single> pending_;
    GuardList<std::size_t, single> judged_;
    double limit_ = -infinity;
    double hoped_ = infinity;
    double failing_value_ = 0;
    std::uint64_t lower_bounds_used_ = 0;
    std::uint64_t covered_ = 0;  ///< steps in which no guard was examined
    std::uint64_t asked_ = 0;    ///< calls of a gate
    std::uint64_t outside_ = 0;  ///< of these, calls outside the gate's domain
    std::optional<WrongBound<X>> wrong_;
};

}  // namespace ricochet::detail
