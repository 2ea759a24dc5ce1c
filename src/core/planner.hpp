// Which guards need a look, and when.
//
// After a look at it every guard sleeps until its bound no longer covers it. The earliest
// of these deadlines is compared with the end of every step; while it is not reached
// nothing else is done, however many guards there are. A guard whose deadline has passed
// *owes* a look: the steps from there on are tentative, and their starts are kept. The
// stretch is closed by one look at its end; where that is not enough it is halved at the
// kept starts, and the first step that no two looks can close is put before the exact
// detector.
//
// Times are counted forward: in a run backward in time they are negative.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "core/event_search.hpp"
#include "core/guard_bank.hpp"
#include "core/metering.hpp"
#include "core/tentative_steps.hpp"
#include "ricochet/detect/cover.hpp"
#include "ricochet/hybrid/statistics.hpp"
#include "ricochet/integrate/run.hpp"

namespace ricochet::detail {

/// What is known of a guard since it was last looked at.
struct LastLook {
    double time = 0;                                         ///< [s]
    double value = 0;                                        ///< g, or a lower bound of it
    double rate = std::numeric_limits<double>::quiet_NaN();  ///< of g; NaN: not asked for
    GuardBound bound;
    bool exact = false;
    double sure = 0;   ///< [s] the deadline
    double hoped = 0;  ///< [s] when a look is hoped to close the stretch; never before `sure`
    double slope = std::numeric_limits<double>::quiet_NaN();  ///< of the distance, from two looks
    bool judge = false;     ///< the next step is one for the exact detector
    bool unclear = false;   ///< a gate clears nothing, so that the next step is, too
    bool refused = false;   ///< a gate had no lower bound when it was last asked
    std::size_t first = 0;  ///< of the tentative steps, the first beyond `sure`
    double later_time = std::numeric_limits<double>::quiet_NaN();  ///< [s] of another look
    double later_value = 0;

    template <class Visit>
    void visit(Visit&& visit)
    {
        for (double* number :
             {&time, &value, &rate, &bound.distance, &bound.speed, &bound.acceleration, &sure,
              &hoped, &slope, &later_time, &later_value}) {
            visit(*number);
        }
        visit(exact);
        visit(judge);
        visit(unclear);
        visit(refused);
    }
};

template <class X, bool single>
class Planner {
    static constexpr double infinity = std::numeric_limits<double>::infinity();
    using Bank = GuardBank<X, single>;
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
          meter_(detector_->metering, guards),
          backward_(backward),
          steps_(detector_->longest, like),
          looks_(guards),
          calendar_(guards),
          owing_(guards),
          judged_(guards)
    {
        for (std::size_t i = 0; i < guards; ++i) looks_.push_back({});
    }

    [[nodiscard]] Steps& steps() noexcept { return steps_; }
    [[nodiscard]] bool in_stretch() const noexcept { return steps_.size() > 0; }

    /// Whether nothing need be looked at until the time `end`.
    [[nodiscard]] bool covers(double end) const noexcept { return end <= limit_; }

    /// Until when nothing need be looked at.
    [[nodiscard]] double limit() const noexcept { return limit_; }

    /// Whether planning is known to cost more than it saves, so that the exact detector is to
    /// look at every step. Stretches are closed first.
    [[nodiscard]] bool steps_aside() const noexcept { return meter_.checks() && !in_stretch(); }
    void look_back(const Statistics& counts) { meter_.look_back(counts); }

    /// Every guard has just been armed at the start of the step, and sampled there.
    void begin(const Step<X>& step, Bank& bank)
    {
        steps_.clear();
        calendar_.clear();
        owing_.clear();
        judged_.clear();
        const double now = clock(step.time(0));
        for (std::size_t i = 0; i < bank.size(); ++i) {
            if (!bank[i].enabled) continue;
            looks_[i] = {};
            looks_[i].time = now;
            looks_[i].slope = sign_of(bank[i].side) * bank.rate0(i);
            rest_from(i,
                      {.time = now,
                       .value = bank.g0(i),
                       .t = step.time(0),
                       .x = &step.x0(),
                       .exact = true},
                      step.mode(), bank);
            looks_[i].rate = bank.rate0(i);
            schedule(i);
            bank.put_to_sleep(i);
        }
        find_limit();
    }

    /// The step in hand, which ends at `end`, passes the deadline of some guards. The last
    /// of the kept steps is this one.
    void overrun(double end)
    {
        while (!calendar_.empty() && calendar_[0].deadline < end) {
            const std::size_t i = pop();
            looks_[i].first = steps_.size() - 1;
            hoped_ = std::min(hoped_, looks_[i].judge ? -infinity : looks_[i].hoped);
            owing_.push_back(i);
        }
        limit_ = -infinity;
    }

    /// Whether the stretch is hoped to be closed at the time `end`.
    [[nodiscard]] bool hopes(double end) const noexcept { return end <= hoped_; }

    /// Looks at every guard that owes one, at the end of the step in hand and wherever that
    /// leaves a doubt. Returns the first step that could not be closed, or `none`; the guards
    /// to be judged in it, if it is the step in hand, are in `judged`.
    [[nodiscard]] std::size_t close(const Step<X>& step, Bank& bank, Statistics& counts,
                                    double h_next)
    {
        meter_.look_back(counts);
        const std::size_t last = steps_.size() - 1;
        std::size_t doubt = none;
        for (const std::size_t i : owing_) {
            looks_[i].judge = false;
            const std::size_t failed = close_one(i, step, bank, counts, h_next);
            looks_[i].first = failed;
            doubt = std::min(doubt, failed);
        }
        // Beyond an event the flow is not the motion, and breaks no promise.
        if (wrong_ && doubt != none && clock(wrong_->t) > place(doubt, step).time) wrong_.reset();
        judged_.clear();
        for (const std::size_t i : owing_) {
            LastLook& look = looks_[i];
            look.judge = doubt != none && look.first == doubt;
            if (look.judge && doubt == last) {
                judged_.push_back(i);
            } else {
                schedule(i);
            }
        }
        end_stretch();
        return doubt;
    }

    /// The stretch is taken back without a look.
    void abandon()
    {
        for (const std::size_t i : owing_) schedule(i);
        end_stretch();
    }

    /// The guards that the exact detector is to judge in the step in hand.
    [[nodiscard]] std::span<const std::size_t> judged() const noexcept { return judged_.span(); }

    /// Hands the judged guards over to the bank, with their samples at both ends of the step.
    /// `last_h`: the step before it [s].
    void wake(const Step<X>& step, Bank& bank, Statistics& counts, double last_h)
    {
        for (const std::size_t i : judged()) {
            LastLook& look = looks_[i];
            const double value = value_at(i, clock(step.time(0)), step.time(0), step.x0(),
                                          step.mode(), bank, counts);
            if (!(look.rate == look.rate) || look.time != clock(step.time(0))) {
                look.rate = meter_.time_guard([&] {
                    return bank.rate_of(i, step.mode(), step.time(0), step.x0(), step.rate0(),
                                        last_h, counts.guard_calls);
                });
            }
            const double h = step.h();
            const double end = value_at(i, clock(step.time(h)), step.time(h), step.x1(),
                                        step.mode(), bank, counts);
            const double rate = meter_.time_guard([&] {
                return bank.rate_of(i, step.mode(), step.time(h), step.x1(), step.rate1(), h,
                                    counts.guard_calls);
            });
            bank.wake(i, {.s = 0, .value = value, .rate = look.rate},
                      {.s = h, .value = end, .rate = rate});
            remember(look, clock(step.time(h)), end);
            look.rate = rate;
        }
    }

    /// The exact detector has found nothing that cuts the step short: the judged guards sleep
    /// from its end on.
    void settle(const Step<X>& step, Bank& bank)
    {
        const double t = step.time(step.h());
        for (const std::size_t i : judged()) {
            LastLook& look = looks_[i];
            const double rate = look.rate;
            look.judge = false;
            Look end{.time = clock(t), .value = look.later_value, .t = t, .x = &step.x1()};
            end.bound = bound(i, end, step.mode(), bank[i].side);
            check_change(i, last_look(i), end, bank);
            note(i, look, end, step.mode(), bank);
            look.rate = rate;
            schedule(i);
            bank.put_to_sleep(i);
        }
        judged_.clear();
        find_limit();
    }

    /// One of the sleeping guards, each in its turn, at the end of the step in hand: of every
    /// 64th step without a look, and only if bounds are checked.
    void sample_sleeper(const Step<X>& step, Bank& bank, Statistics& counts)
    {
        if (!bounded_ || !detector_->checks_bounds) return;
        if (++covered_ % 64 != 0 || bank.size() == 0) return;
        const std::size_t i = covered_ / 64 % bank.size();
        const double t = step.time(step.h());
        watch_sleeper(i, t, step.x1(), step.mode(), bank, counts);
    }

    /// A last look at the guards that sleep when the run ends, at the start of the step: one
    /// that is beyond its surface was covered by a wrong bound.
    void look_last(const Step<X>& step, Bank& bank, Statistics& counts)
    {
        if (!bounded_) return;
        for (std::size_t i = 0; i < bank.size(); ++i) {
            watch_sleeper(i, step.time(0), step.x0(), step.mode(), bank, counts);
        }
    }

    /// Adds what gates were asked since the last time.
    void add_counts(Statistics& counts) noexcept
    {
        counts.network_calls += asked_;
        counts.outside_domain += outside_;
        asked_ = outside_ = 0;
    }

    /// Of a network, whether asking it pays.
    [[nodiscard]] const auto& meter() const noexcept { return meter_; }

    /// A bound that a guard has broken.
    [[nodiscard]] const std::optional<WrongBound<X>>& wrong() const noexcept { return wrong_; }

    template <class Visit>
    void visit(Visit&& visit)
    {
        for (LastLook& look : looks_) look.visit(visit);
    }

    /// After `visit` has restored the looks.
    void restore(const Bank& bank)
    {
        calendar_.clear();
        owing_.clear();
        judged_.clear();
        steps_.clear();
        for (std::size_t i = 0; i < bank.size(); ++i) {
            if (bank[i].enabled) schedule(i);
        }
        find_limit();
    }

private:
    /// A guard at an instant.
    struct Look {
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

    // --- the calendar: a heap, earliest first ---

    [[nodiscard]] static bool later(const Deadline& a, const Deadline& b) noexcept
    {
        return a.deadline > b.deadline;
    }

    void schedule(std::size_t i)
    {
        const LastLook& look = looks_[i];
        calendar_.push_back({look.judge ? -infinity : look.sure, i});
        std::push_heap(calendar_.begin(), calendar_.end(), later);
    }

    [[nodiscard]] std::size_t pop()
    {
        std::pop_heap(calendar_.begin(), calendar_.end(), later);
        const std::size_t i = calendar_[calendar_.size() - 1].guard;
        calendar_.shrink(calendar_.size() - 1);
        return i;
    }

    void find_limit() noexcept { limit_ = calendar_.empty() ? infinity : calendar_[0].deadline; }

    void end_stretch() noexcept
    {
        owing_.clear();
        hoped_ = infinity;
        find_limit();
    }

    // --- bounds ---

    /// The guard's bounds at a look. One that is negative or no number covers nothing, and is
    /// named if bounds are checked.
    [[nodiscard]] GuardBound bound(std::size_t i, const Look& look, Mode mode, Side side)
    {
        GuardBound at{.distance = sign_of(side) * look.value, .speed = 0, .acceleration = 0};
        if (!bounded_) return at;
        const double l = system_->lipschitz(system_.door(), i);
        at.speed = l * system_->speed_bound(system_.door(), i, mode, look.t, *look.x);
        at.acceleration = l * system_->acceleration_bound(system_.door(), i, mode, look.t, *look.x);
        if (detector_->checks_bounds && !(at.speed >= 0 && at.acceleration >= 0) && !wrong_) {
            blame(i, look, look, at.speed >= 0 ? at.acceleration : at.speed);
        }
        return at;
    }

    /// Half the width of the band that a guard must not have reached. Within a stretch that
    /// closes, it is no further away than the sum of its distances at the ends.
    [[nodiscard]] static double band(const Bank& bank, std::size_t i, double a, double b) noexcept
    {
        return bank.touch_of(i, std::fabs(a) + std::fabs(b));
    }

    /// The guard sleeps from this look on.
    void rest_from(std::size_t i, const Look& at, Mode mode, const Bank& bank)
    {
        LastLook& look = looks_[i];
        Look now = at;
        now.bound = bound(i, at, mode, bank[i].side);
        note(i, look, now, mode, bank);
    }

    /// Time [s] without a look that a gate gives from here; 0 without a gate.
    [[nodiscard]] double horizon(const Look& at, Mode mode)
    {
        // Gates have learned what comes, not what was.
        if (!detector_->horizon || backward_ || !meter_.asks()) return 0;
        const GateAnswer answer = meter_.time_network(
            [&] { return detector_->horizon(self_, system_.door(), mode, at.t, *at.x); });
        ++asked_;
        outside_ += answer.outside ? 1 : 0;
        if (answer.cleared > 0) meter_.note_cleared();
        return answer.cleared;
    }

    void note(std::size_t i, LastLook& look, const Look& at, Mode mode, const Bank& bank)
    {
        const double passed = at.time - look.time;
        if (passed > 0) {
            look.slope = look.exact == at.exact ? (at.bound.distance - look.bound.distance) / passed
                                                : std::numeric_limits<double>::quiet_NaN();
        }
        look.time = at.time;
        look.value = at.value;
        look.bound = at.bound;
        look.exact = at.exact;
        look.rate = std::numeric_limits<double>::quiet_NaN();
        if (never_sleeps(bank[i])) {
            look.judge = true;
            look.sure = look.hoped = -infinity;
            return;
        }
        const double reach = band(bank, i, at.value, at.value);
        // Rounding of the time must not lengthen what is covered.
        const double ulps = 4 * std::numeric_limits<double>::epsilon() * std::fabs(at.time);
        look.sure = at.time + detector_->sure(self_, at.bound, reach) - ulps;
        const double cleared = horizon(at, mode);
        look.unclear = gated_ && !(cleared > 0);
        if (look.unclear) look.judge = true;
        // What would just close is left open by rounding.
        const double hoped = (1 - 1e-12) * detector_->hoped(self_, at.bound, look.slope, reach);
        const double ahead = std::max(hoped, cleared);
        look.hoped = std::max(look.sure, at.time + (expects_level(look, bank[i].side) ? 0 : ahead));
    }

    /// Whether a gate is likely to have a lower bound where the cover of this look ends: any will
    /// do there, so that it is asked at once.
    [[nodiscard]] bool expects_level(const LastLook& look, Side side) const noexcept
    {
        if (!detector_->level || side != Side::above) return false;
        const double slope = std::isfinite(look.slope) ? look.slope : 0;
        const double then = look.bound.distance + slope * (look.sure - look.time);
        return meter_.asks() && !look.refused && then > detector_->lowest_level;
    }

    [[nodiscard]] bool never_sleeps(const GuardRecord& record) const noexcept
    {
        return record.side == Side::plateau || (bounded_ && record.info.boolean);
    }

    [[nodiscard]] bool closes(const Bank& bank, std::size_t i, const Look& a, const Look& b) const
    {
        return detector_->closes(self_, a.bound, b.bound, b.time - a.time,
                                 band(bank, i, a.value, b.value));
    }

    // --- looking ---

    static void remember(LastLook& look, double time, double value) noexcept
    {
        look.later_time = time;
        look.later_value = value;
    }

    /// The guard's exact value, unless it is known from the last look or another.
    [[nodiscard]] double value_at(std::size_t i, double time, double t, const X& x, Mode mode,
                                  const Bank& bank, Statistics& counts)
    {
        LastLook& look = looks_[i];
        if (look.exact && look.time == time) return look.value;
        if (look.later_time == time) return look.later_value;
        return meter_.time_guard(
            [&] { return bank.view(i, mode, counts.guard_calls).value(t, x); });
    }

    /// An exact look at the start of tentative step k; past the last, at the end of the step
    /// in hand.
    [[nodiscard]] Look look_at(std::size_t i, std::size_t k, const Step<X>& step, const Bank& bank,
                               Statistics& counts)
    {
        Look look = place(k, step);
        look.value = value_at(i, look.time, look.t, *look.x, step.mode(), bank, counts);
        look.bound = bound(i, look, step.mode(), bank[i].side);
        if (detector_->checks_bounds) check_bound(i, look, step.mode(), bank);
        return look;
    }

    [[nodiscard]] Look place(std::size_t k, const Step<X>& step) const
    {
        if (k == steps_.size()) {
            const double t = step.time(step.h());
            return {.time = clock(t), .t = t, .x = &step.x1()};
        }
        const StepStart<X>& start = steps_[k].start;
        return {.time = clock(start.t.value), .t = start.t.value, .x = &start.x};
    }

    /// What a lower bound says there, or below the surface an upper one; false: nothing.
    [[nodiscard]] bool bound_at(std::size_t i, std::size_t k, const Step<X>& step, const Bank& bank,
                                Statistics& counts, Look& look)
    {
        if (!bounded_) return false;
        if (system_->upper_bound && bank[i].side == Side::below) {
            look = place(k, step);
            look.exact = false;
            ++counts.bound_calls;
            look.value = system_->upper_bound(system_.door(), i, step.mode(), look.t, *look.x);
            look.bound = bound(i, look, step.mode(), Side::below);
            return look.value < 0;
        }
        if (!system_->lower_bound && !detector_->level) return false;
        if (bank[i].side != Side::above) return false;
        look = place(k, step);
        look.exact = false;
        look.value = 0;
        if (system_->lower_bound) {
            ++counts.bound_calls;
            look.value = system_->lower_bound(system_.door(), i, step.mode(), look.t, *look.x);
        }
        if (detector_->level && meter_.asks()) {
            look.value = std::max(look.value, ask_level(i, look, step.mode()));
        }
        look.bound = bound(i, look, step.mode(), Side::above);
        return look.value > 0;
    }

    /// A lower bound of guard i by a gate; 0: none.
    [[nodiscard]] double ask_level(std::size_t i, const Look& at, Mode mode)
    {
        const GateAnswer answer = meter_.time_network(
            [&] { return detector_->level(self_, system_.door(), i, mode, at.t, *at.x); });
        ++asked_;
        outside_ += answer.outside ? 1 : 0;
        looks_[i].refused = !(answer.cleared > 0);
        if (answer.cleared > 0) meter_.note_cleared();
        return answer.cleared;
    }

    /// The last look at guard i.
    [[nodiscard]] Look last_look(std::size_t i) const noexcept
    {
        const LastLook& look = looks_[i];
        return {.time = look.time, .value = look.value, .exact = look.exact, .bound = look.bound};
    }

    /// Closes what guard i owes; returns the first step that could not be, or `none`.
    [[nodiscard]] std::size_t close_one(std::size_t i, const Step<X>& step, Bank& bank,
                                        Statistics& counts, double h_next);

    /// Whether guard i stays clear between a look `from`, whose cover reaches the start of
    /// tentative step `lo`, and the look `end` at the start of step `hi`. If not, returns the
    /// first step that is in doubt, with `from` moved to its start.
    [[nodiscard]] std::size_t narrow(std::size_t i, Look& from, std::size_t lo, std::size_t hi,
                                     const Look& end, const Step<X>& step, const Bank& bank,
                                     Statistics& counts);

    // --- are the bounds true? ---

    void check_change(std::size_t i, const Look& from, const Look& to, const Bank& bank);

    /// The guard was covered from one look to the other. That it is nevertheless across its
    /// surface is seen without asking for it.
    void check_covered(std::size_t i, const Look& from, const Look& to, const Bank& bank);

    void blame_change(std::size_t i, const Look& from, const Look& to, const Bank& bank);

    void blame(std::size_t i, const Look& from, const Look& to, double allowed);

    /// A guard that sleeps cannot be beyond its surface, whatever bounds say of it there.
    void watch_sleeper(std::size_t i, double t, const X& x, Mode mode, const Bank& bank,
                       Statistics& counts);

    /// Whether an exact value contradicts the bound that would have stood in for it. Beyond the
    /// surface a bound may well have ended at 0.
    void check_bound(std::size_t i, const Look& look, Mode mode, const Bank& bank);

    void check_against(double bound, std::size_t i, const Look& look, const Bank& bank);

    SystemAt<X> system_;
    const DetectorTable<X>* detector_;
    const void* self_;
    bool bounded_;  ///< puts off by declared bounds
    bool gated_;    ///< puts off nothing but what a gate clears
    Metering meter_;
    bool backward_;
    Steps steps_;
    GuardList<LastLook, single> looks_;
    GuardList<Deadline, single> calendar_;
    GuardList<std::size_t, single> owing_;
    GuardList<std::size_t, single> judged_;
    double limit_ = -infinity;
    double hoped_ = infinity;
    double failing_value_ = 0;
    std::uint64_t lower_bounds_used_ = 0;
    std::uint64_t covered_ = 0;  ///< steps that no guard was looked at in
    std::uint64_t asked_ = 0;    ///< calls of a gate
    std::uint64_t outside_ = 0;  ///< of its domain
    std::optional<WrongBound<X>> wrong_;
};

}  // namespace ricochet::detail
