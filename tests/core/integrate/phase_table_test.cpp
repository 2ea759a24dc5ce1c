// The loop with a stepper for each kind of phase, and steps that end at a change of their own.
//
// A sawtooth: x' = 1 up to x = 1, which a guard of the system finds; then x' = -2 down to x = 1/2,
// which the stepper of that phase locates by itself. From 0 it turns at 1, 1.25, 1.75, 2, 2.5, ...
// Both flows are constant, so that steps are exact, and 1e-12 holds the rounding of a hundred.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "core/phase_table.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/ricochet.hpp"

namespace ricochet::detail {
namespace {

constexpr double exact = 1e-12;

class Sawtooth {
public:
    using C = SmallState;

    explicit Sawtooth(std::vector<double> ticks = {}) : ticks_(std::move(ticks))
    {
        up_ = kernel_by_name<C>(MethodName::dopri5, 1);
        down_ = kernel_by_name<C>(MethodName::fehlberg78, 1);
        down_.reach = [](void*, StepState<C>& step, double, double, double) {
            return (step.x0[0] - 0.5) / 2;
        };
        down_.ends_at_change = [](void*, const StepState<C>& step) {
            return std::fabs(step.x1[0] - 0.5) < exact;
        };
        make_table();
        make_phases();
    }
    Sawtooth(const Sawtooth&) = delete;
    Sawtooth& operator=(const Sawtooth&) = delete;

    [[nodiscard]] RunBindings<C> setup()
    {
        RunBindings<C> out;
        out.system = &table_;
        out.adapter = this;
        out.kernel = &up_;
        out.detector = DetectorTableOf<Extremum, Sawtooth, std::array<double, 1>>::make(extremum_);
        out.detecting = &extremum_;
        out.locator = locator_table<Newton>();
        out.locating = &newton_;
        return out;
    }

    /// Lets rising phases go on at a glance.
    void glance()
    {
        phases_.goes_on = [](void* adapter, Mode mode, double, const C&, bool) {
            at(adapter).looks += falls(mode);
            return !falls(mode);
        };
    }

    int ticks = 0;    ///< resets of time events so far
    int looks = 0;    ///< times that a glance was not enough
    int reviews = 0;  ///< calls of `review`

private:
    [[nodiscard]] static Sawtooth& at(void* adapter) { return *static_cast<Sawtooth*>(adapter); }
    [[nodiscard]] static bool falls(Mode mode) { return mode >= own_modes; }

    void make_table()
    {
        table_.guarded = table_.moded = table_.fixed_dimension = table_.guard_alone = true;
        table_.forward_only = true;
        table_.calls_of_rate = 2;
        table_.phases = &phases_;
        table_.flow = [](void*, Mode mode, double, const C&, C& dxdt) {
            dxdt[0] = falls(mode) ? -2 : 1;
            return true;
        };
        table_.mode_count = [](void*) { return std::size_t{2} * own_modes; };
        table_.guard_count = [](void*) { return std::size_t{1}; };
        table_.name = [](void*) { return std::string("sawtooth"); };
        table_.info = [](void*, std::size_t) {
            GuardInfo info;
            info.crossing = Crossing::rising;
            return info;
        };
        table_.guards = [](void*, Mode, double, const C& x, std::span<double> g) {
            g[0] = x[0] - 1;
        };
        table_.guard = [](void*, std::size_t, Mode, double, const C& x) { return x[0] - 1; };
        table_.rate = [](void*, GuardInMode, ScaledTime, const C&, const C& dxdt) {
            return dxdt[0];
        };
        table_.reset = [](void*, std::size_t, Mode mode, double, C&) { return mode; };
        table_.next_time_event = [](void* adapter, double t) {
            for (const double tick : at(adapter).ticks_) {
                if (tick > t) return tick;
            }
            return std::numeric_limits<double>::infinity();
        };
        table_.time_reset = [](void* adapter, Mode mode, double, C&) {
            ++at(adapter).ticks;
            return mode;
        };
    }

    void make_phases()
    {
        phases_.adapter = this;
        phases_.own_guards = [](void*) { return std::size_t{1}; };
        phases_.stepper = [](void* adapter, Mode mode) -> Stepper<C> {
            Sawtooth& me = at(adapter);
            return {falls(mode) ? &me.down_ : &me.up_, adapter, me.table_.flow};
        };
        phases_.enter = [](void*, Mode mode, double, C&) { return mode; };
        phases_.decide = [](void* adapter, const PhaseSet<C>& set, C&) -> Mode {
            Sawtooth& me = at(adapter);
            me.changes_.clear();
            if (set.on_change) me.changes_.push_back({.reaction = 0, .kind = EventKind::mode});
            if (falls(set.before)) return set.on_change ? 0 : set.after;
            return set.fired.empty() ? set.after : own_modes;
        };
        phases_.changes = [](void* adapter) {
            return std::span<const ReactionChange>(at(adapter).changes_);
        };
        phases_.records = [](void*, std::size_t) { return true; };
        phases_.review = [](void* adapter, const PhaseStep<C>&, C&) {
            ++at(adapter).reviews;
            return PhaseVerdict{};
        };
        phases_.give_up = [](void*, const PhaseEnd<C>&, C&) { return PhaseVerdict{}; };
        phases_.save = [](void*, std::vector<double>& memory) { memory.clear(); };
        phases_.restore = [](void*, const std::vector<double>&) {};
    }

    std::vector<double> ticks_;
    StepKernel<C> up_, down_;
    Extremum extremum_;
    Newton newton_;
    SystemTable<C> table_;
    PhaseTable<C> phases_;
    std::vector<ReactionChange> changes_;
};

[[nodiscard]] SmallState zero()
{
    return SmallState(1);
}

[[nodiscard]] Options until(double t_end)
{
    return {.t_end = t_end, .h_max = 0.4};
}

void expect_turns(const std::vector<Event<SmallState>>& events)
{
    const std::vector<double> turns{1, 1.25, 1.75, 2, 2.5, 2.75};
    ASSERT_EQ(events.size(), turns.size());
    for (std::size_t k = 0; k < turns.size(); ++k) {
        EXPECT_NEAR(events[k].t, turns[k], exact) << k;
        const bool located = k % 2 == 1;
        EXPECT_EQ(events[k].kind, located ? EventKind::mode : EventKind::crossing) << k;
        EXPECT_EQ(events[k].guard, located ? no_guard : 0U) << k;
        EXPECT_EQ(events[k].reaction, located ? 0U : no_reaction) << k;
        EXPECT_EQ(events[k].mode_before, 0U) << k;
        EXPECT_EQ(events[k].mode_after, 0U) << k;
    }
}

TEST(PhaseTable, StepsAreTakenByTheStepperOfThePhase)
{
    Sawtooth system;
    const auto loop = make_loop(system.setup(), zero(), until(3));
    const auto run = loop->take();
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 0.75, exact);
    EXPECT_EQ(run.mode, 0U);
    expect_turns(run.events);
}

TEST(PhaseTable, APhaseThatGoesOnAtAGlanceIsNotReviewed)
{
    Sawtooth each, glanced;
    glanced.glance();
    const auto run = make_loop(each.setup(), zero(), until(3))->take();
    const auto same = make_loop(glanced.setup(), zero(), until(3))->take();
    EXPECT_EQ(glanced.reviews, glanced.looks);
    EXPECT_GT(glanced.reviews, 0);
    EXPECT_LT(glanced.reviews, each.reviews);
    EXPECT_EQ(same.x, run.x);
    expect_turns(same.events);
}

TEST(PhaseTable, ATimeEventAtALocatedChangeIsAMemberOfItsSet)
{
    Sawtooth system({0.3, 1.25, 2.2});
    const auto loop = make_loop(system.setup(), zero(), until(3));
    const auto run = loop->take();
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 0.75, exact);
    EXPECT_EQ(system.ticks, 3);
    EXPECT_EQ(run.statistics.events, 9U);
    ASSERT_EQ(run.events.size(), 9U);
    EXPECT_EQ(run.events[2].kind, EventKind::time);
    EXPECT_EQ(run.events[3].kind, EventKind::mode);
    EXPECT_NEAR(run.events[3].t, 1.25, exact);
}

TEST(PhaseTable, ARunGoesOnFromASnapshotOfAnyPhaseWithTheSameBits)
{
    Sawtooth system;
    const auto whole = make_loop(system.setup(), zero(), until(3));
    while (whole->step()) {
    }
    auto loop = make_loop(system.setup(), zero(), until(3));
    while (loop->step()) {
        const Snapshot saved = loop->save();
        loop = make_loop(system.setup(), zero(), until(3));
        loop->restore(saved);
    }
    EXPECT_EQ(loop->x(), whole->x());
    EXPECT_EQ(loop->t(), whole->t());
}

TEST(PhaseTable, StopAtEventStopsAtALocatedChange)
{
    Sawtooth system;
    Options options = until(3);
    options.stop_at_event = true;
    options.t_start = 0;
    SmallState start = zero();
    start[0] = 0.75;
    const auto loop = make_loop(system.setup(), start, options);
    const auto first = loop->take();
    EXPECT_EQ(first.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(first.t, 0.25, exact);
    options.mode = own_modes;
    const auto falling = make_loop(system.setup(), start, options);
    const auto second = falling->take();
    EXPECT_EQ(second.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(second.guard, no_guard);
    EXPECT_NEAR(second.t, 0.125, exact);
}

}  // namespace
}  // namespace ricochet::detail
