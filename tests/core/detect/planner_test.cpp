// The queue of deadlines by itself: a clock takes the steps, and the guards are functions of its
// time, deferred under the speeds that they declare. Deadlines are shorter than their closed forms
// by the event tolerance, some 1e-14 of the guard.
#include "core/planner.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/event_notes.hpp"
#include "core/event_series.hpp"
#include "core/event_sets.hpp"
#include "core/planner_checks.hpp"
#include "core/planner_close.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/planned.hpp"
#include "step_of.hpp"

namespace ricochet::planner_test {
namespace {

using X = std::array<double, 1>;
using Core = detail::CoreState<X>;
using Table = detail::GuardTable<Core, false>;
using Planner = detail::Planner<Core, false>;
using Guards = std::vector<std::size_t>;
constexpr double rounding = 1e-13;
constexpr double infinity = std::numeric_limits<double>::infinity();

/// The state is the time.
struct Clock {
    using State = X;
    static constexpr bool resets = false;
    struct Guard {
        std::function<double(double)> value;
        double speed = 0;         ///< [1/s]
        double acceleration = 0;  ///< [1/s^2]
        GuardInfo info{};
    };
    std::vector<Guard> guards;

    void flow(double, const X&, X& dxdt) const { dxdt = {1}; }
    [[nodiscard]] std::size_t guard_count() const { return guards.size(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t i) const { return guards[i].info; }
    template <class V>
    [[nodiscard]] double guard(std::size_t i, double, const V& x) const
    {
        return guards[i].value(x[0]);
    }
    [[nodiscard]] double speed_bound(std::size_t i, double, const X&) const
    {
        return guards[i].speed;
    }
    [[nodiscard]] double acceleration_bound(std::size_t i, double, const X&) const
    {
        return guards[i].acceleration;
    }
};

/// Its guards declare a lower bound as well.
struct Floored : Clock {
    double floor = 0;

    [[nodiscard]] double lower_bound(std::size_t, double, const X&) const { return floor; }
};

Clock::Guard resting(double value, double speed, double acceleration = 0)
{
    return {[=](double) { return value; }, speed, acceleration};
}
/// |t - turn| + least
Clock::Guard vee(double turn, double least, double speed = 1)
{
    return {[=](double t) { return std::fabs(t - turn) + least; }, speed};
}
/// 1 - 3 t, which declares only a third of its speed.
Clock::Guard too_fast()
{
    return {[](double t) { return 1 - 3 * t; }, 1};
}

constexpr PlannerOptions exact{.margin = 0, .check_bounds = false};
constexpr PlannerOptions checked{.margin = 0, .check_bounds = true};

/// A run's planner, at the start of its first step.
template <class System = Clock>
class Plan {
public:
    explicit Plan(System system, const PlannerOptions& options = exact, double t = 0,
                  bool backward = false)
        : clock_(std::move(system)),
          planned_(options),
          adapter_(clock_, X{t}),
          system_(detail::system_table<System, X>, &adapter_),
          detector_(detail::DetectorTableOf<Planned<>, System, X>::make(planned_)),
          locator_(detail::locator_table<Newton>()),
          finders_{detector_, &planned_, locator_, &newton_},
          step(clock_, t, X{t}, 0, backward),
          table(system_, detail::GuardRules::of(detector_, system_), backward),
          search(system_, step.x0(), table.size(), finders_, {.t_end = 100}),
          planner(system_, finders_, step.x0(), backward, table.size())
    {
        table.sample_start(step, counts.guard_calls, 1);
        for (std::size_t i = 0; i < table.size(); ++i) {
            table.arm(i, detail::side_of(table.g0(i)));
        }
        counts = {};
        planner.begin(step, table);
    }
    Plan(const Plan&) = delete;
    Plan& operator=(const Plan&) = delete;

    /// Takes a step that is covered.
    void pass(double h)
    {
        ASSERT_TRUE(step.attempt(h));
        ASSERT_TRUE(planner.covers(step.time(h)));
        step.accept();
    }
    /// Takes a step beyond the deadline of a guard, and keeps its start.
    void overrun(double h)
    {
        ASSERT_TRUE(step.attempt(h));
        ASSERT_FALSE(planner.covers(step.time(h)));
        step.store_as_kept(planner.steps().add().start);
        planner.overrun(step.time(h));
    }
    [[nodiscard]] std::size_t close(double h_next = 0)
    {
        return planner.close(step, table, counts, h_next);
    }
    [[nodiscard]] Guards judged() const
    {
        return {planner.judged().begin(), planner.judged().end()};
    }

private:
    System clock_;
    Planned<> planned_;
    Newton newton_;
    detail::SystemAdapter<System, X> adapter_;
    detail::SystemAt<Core> system_;
    detail::DetectorTable<Core> detector_;
    detail::LocatorTable locator_;
    detail::Finders<Core> finders_;

public:
    test::StepOf<Dopri5, System, X> step;
    Table table;
    detail::EventSearch<Core, false> search;
    Planner planner;
    Statistics counts;
};

TEST(Planner, TheDeadlineIsTheDistanceOverTheSpeed)
{
    for (const double margin : {0.0, 0.25}) {
        const Plan plan(Clock{{resting(2, 4)}}, {.margin = margin, .check_bounds = false});
        const double limit = 0.5 / (1 + margin);
        EXPECT_NEAR(plan.planner.limit(), limit, rounding);
        EXPECT_LT(plan.planner.limit(), limit);
        EXPECT_TRUE(plan.planner.covers(plan.planner.limit()));
        EXPECT_FALSE(plan.planner.covers(limit));
        EXPECT_TRUE(std::as_const(plan.table)[0].deferred);
    }
}

TEST(Planner, WithAnAccelerationItIsTheRootOfAParabola)
{
    // v t + A t² / 2 = d
    EXPECT_NEAR(Plan(Clock{{resting(2, 1, 2)}}).planner.limit(), 1, rounding);
    EXPECT_NEAR(Plan(Clock{{resting(6, 1, 2)}}).planner.limit(), 2, rounding);
    EXPECT_NEAR(Plan(Clock{{resting(2, 0, 4)}}).planner.limit(), 1, rounding);
    EXPECT_EQ(Plan(Clock{{resting(2, 0, 0)}}).planner.limit(), infinity);
}

TEST(Planner, TheEarliestDeadlineCountsOnEitherSide)
{
    EXPECT_NEAR(Plan(Clock{{resting(3, 1), resting(2, 10), resting(1, 0)}}).planner.limit(), 0.2,
                rounding);
    EXPECT_NEAR(Plan(Clock{{resting(3, 1), resting(-2, 10)}}).planner.limit(), 0.2, rounding);
    // A guard that is disabled has none.
    Plan plan(Clock{{resting(3, 1), resting(2, 10)}});
    plan.table[1].enabled = false;
    plan.planner.begin(plan.step, plan.table);
    EXPECT_NEAR(plan.planner.limit(), 3, rounding);
}

TEST(Planner, TimesAreCountedForwardInARunBackward)
{
    // At t = 2 a guard is covered for 1/4 s, down to t = 7/4.
    const Plan plan(Clock{{resting(1, 4)}}, exact, 2, true);
    EXPECT_NEAR(plan.planner.limit(), -1.75, rounding);
    EXPECT_TRUE(plan.planner.covers(-1.76));
    EXPECT_FALSE(plan.planner.covers(-1.74));
}

TEST(Planner, AnIntervalThatTwoChecksCloseIsDeferredFromItsEnd)
{
    // The first guard falls by 2, and may by 4, per second. Two values close an interval that is
    // shorter than their sum over the speed: from 2 at t = 0 another of that size is expected to do
    // so up to 4 / 4 s.
    Plan plan(Clock{{{[](double t) { return 2 - 2 * t; }, 4}, resting(3, 1)}});
    plan.overrun(0.6);
    EXPECT_TRUE(plan.planner.in_interval());
    EXPECT_FALSE(plan.planner.covers(0));
    EXPECT_TRUE(plan.planner.hopes(1 - 1e-9));
    EXPECT_FALSE(plan.planner.hopes(1));
    EXPECT_EQ(plan.close(), Planner::none);
    EXPECT_TRUE(plan.judged().empty());
    EXPECT_EQ(plan.counts.guard_calls, 1u);  // the other guard is covered for longer
    EXPECT_NEAR(plan.planner.limit(), 0.6 + 0.8 / 4, rounding);

    // From there on the slope is known: 0.8 + (0.8 - 2 t) = 4 t.
    plan.planner.steps().clear();
    plan.step.accept();
    plan.overrun(0.25);
    EXPECT_TRUE(plan.planner.hopes(0.6 + 1.6 / 6 - 1e-9));
    EXPECT_FALSE(plan.planner.hopes(0.6 + 1.6 / 6));
}

TEST(Planner, AGuardThatComesNearAndReturnsIsClosedByItsEnds)
{
    // |t - 0.6| + 0.01 has values of 0.61 and 0.41, a second apart.
    Plan plan(Clock{{vee(0.6, 0.01)}});
    plan.pass(0.5);
    plan.overrun(0.5);
    EXPECT_EQ(plan.close(), Planner::none);
    EXPECT_EQ(plan.counts.guard_calls, 1u);
    EXPECT_NEAR(plan.planner.limit(), 1.41, rounding);
}

TEST(Planner, TheFirstStepThatNoTwoChecksCloseIsInDoubt)
{
    // |t - 0.6| - 0.01 is beyond its surface for a while: 0.59 and 0.39 do not close a second, nor
    // do 0.09 and 0.14 the quarter from 0.5. The second guard is so in the next quarter.
    Plan plan(Clock{{vee(0.6, -0.01), vee(0.85, -0.01)}});
    plan.pass(0.25);
    plan.pass(0.25);
    plan.overrun(0.25);
    plan.step.accept();
    plan.overrun(0.25);
    EXPECT_EQ(plan.close(), 0u);
    EXPECT_EQ(plan.counts.guard_calls, 5u);  // at the middle, the start and the end of two steps
    EXPECT_TRUE(plan.judged().empty());      // the step in doubt is not the current one
    EXPECT_EQ(plan.planner.limit(), -infinity);

    // The step is taken again, and now its guard is to be examined at the end of it.
    plan.step.restart(plan.planner.steps()[0].start);
    plan.planner.steps().clear();
    plan.overrun(0.25);
    EXPECT_FALSE(plan.planner.hopes(0.51));
    EXPECT_EQ(plan.close(), 0u);
    EXPECT_EQ(plan.judged(), Guards{0});
    EXPECT_EQ(plan.counts.guard_calls, 5u);  // its values there are known
    plan.planner.wake(plan.step, plan.table, plan.counts, 0.25);
    EXPECT_NEAR(plan.table.g0(0), 0.09, rounding);
    EXPECT_NEAR(plan.table.g1(0), 0.14, rounding);
}

TEST(Planner, AnIntervalIsHalvedAtTheStartsOfItsSteps)
{
    // Under twice its speed |t - 0.9| - 0.01 is covered for 0.445 s. 0.89 and 0.09 do not close a
    // second; 0.89 and 0.39 close the half, 0.39 and 0.14 the next quarter, and 0.14 and 0.09 not
    // the last.
    Plan plan(Clock{{vee(0.9, -0.01, 2)}});
    plan.pass(0.25);
    for (int k = 0; k < 3; ++k) {
        plan.overrun(0.25);
        if (k < 2) plan.step.accept();
    }
    EXPECT_EQ(plan.close(), 2u);
    EXPECT_EQ(plan.judged(), Guards{0});
    EXPECT_EQ(plan.counts.guard_calls, 3u);
}

TEST(Planner, AGuardThatMayTieWithAGivenTimeIsExaminedThere)
{
    // It is at 1e-9 of its first value at the end of the step, which two checks close.
    for (const bool given : {false, true}) {
        Plan plan(Clock{{{[](double t) { return 1 - t + 1e-9; }, 1}}});
        if (given) plan.step.pin(1, 1);
        ASSERT_TRUE(plan.step.attempt(1));
        plan.step.store_as_kept(plan.planner.steps().add().start);
        plan.planner.overrun(1 + detail::tolerances::by_rounding);
        EXPECT_EQ(plan.close(), given ? 0 : Planner::none);
        EXPECT_EQ(plan.judged(), given ? Guards{0} : Guards{});
    }
}

TEST(Planner, AnAbandonedIntervalLeavesTheDeadlinesAsTheyWere)
{
    Plan plan(Clock{{resting(2, 4), resting(3, 1)}});
    const double limit = plan.planner.limit();
    plan.overrun(4);
    plan.planner.abandon();
    EXPECT_EQ(plan.planner.limit(), limit);
    EXPECT_EQ(plan.counts.guard_calls, 0u);
}

TEST(Planner, AGuardInDoubtIsWokenAndThenDeferredFromTheEndOfItsStep)
{
    // 0.3 and 0.4 do not close a second.
    Plan plan(Clock{{{[](double t) { return 0.3 + 0.1 * t; }, 1}, resting(9, 1)}});
    plan.overrun(1);
    ASSERT_EQ(plan.close(), 0u);
    ASSERT_EQ(plan.judged(), Guards{0});
    plan.planner.wake(plan.step, plan.table, plan.counts, 1);
    EXPECT_FALSE(std::as_const(plan.table)[0].deferred);
    EXPECT_TRUE(std::as_const(plan.table)[1].deferred);
    EXPECT_EQ(plan.table.g0(0), 0.3);
    EXPECT_EQ(plan.table.g1(0), 0.4);
    EXPECT_NEAR(plan.table.start(0).rate, 0.1, 1e-9);
    EXPECT_NEAR(plan.table.end(0, 1).rate, 0.1, 1e-9);
    plan.planner.settle(plan.step, plan.table, plan.counts);
    EXPECT_TRUE(std::as_const(plan.table)[0].deferred);
    EXPECT_TRUE(plan.judged().empty());
    EXPECT_NEAR(plan.planner.limit(), 1.4, rounding);
    EXPECT_EQ(plan.counts.guard_calls, 5u);  // at the end once, and for two rates

    // 0.4 + (0.4 + 0.1 t) = t
    plan.planner.steps().clear();
    plan.step.accept();
    plan.overrun(0.5);
    EXPECT_TRUE(plan.planner.hopes(1 + 0.8 / 0.9 - 1e-9));
}

TEST(Planner, AStepInDoubtIsDividedUntilItIsCoveredOrAnEventIsSeen)
{
    // With twice the speed 0.55 and 0.55 do not close a second, but 0.05 in its middle does not
    // vanish under the bounds.
    for (const double least : {0.05, -0.05}) {
        Plan plan(Clock{{vee(0.5, least, 2)}});
        plan.overrun(1);
        ASSERT_EQ(plan.close(), 0u);
        plan.search.cover().begin();
        plan.table.forget_dips();
        plan.planner.close_inside(plan.step, plan.table, plan.search, plan.counts);
        EXPECT_EQ(plan.judged(), least > 0 ? Guards{} : Guards{0});
        EXPECT_EQ(std::as_const(plan.table)[0].examined.dips, least < 0);
        if (least > 0) {
            EXPECT_NEAR(plan.planner.limit(), 1.275, rounding);
        }
    }
}

TEST(Planner, GuardsWithoutASizeNeverSleep)
{
    const GuardInfo sign{.boolean = true};
    for (const bool plateau : {true, false}) {
        Plan plan(Clock{
            {{[=](double) { return plateau ? 0.0 : 1.0; }, 1, 0, plateau ? GuardInfo{} : sign}}});
        EXPECT_EQ(plan.planner.limit(), -infinity);
        plan.overrun(0.1);
        EXPECT_FALSE(plan.planner.hopes(0.1));
        EXPECT_EQ(plan.close(), 0u);
        EXPECT_EQ(plan.judged(), Guards{0});
        EXPECT_EQ(plan.counts.guard_calls, 0u);
    }
}

TEST(Planner, ALowerBoundReplacesTheGuardWhereItCovers)
{
    Plan plan(Floored{{{resting(2, 1)}}, 0.5});
    plan.overrun(2.25);  // 2 + 0.5 > 2.25
    EXPECT_EQ(plan.close(), Planner::none);
    EXPECT_EQ(plan.counts.bound_calls, 1u);
    EXPECT_EQ(plan.counts.guard_calls, 0u);
    EXPECT_NEAR(plan.planner.limit(), 2.75, rounding);

    // It does not cover the next step.
    Plan far(Floored{{{resting(2, 1)}}, 0.5});
    far.overrun(2.25);
    EXPECT_EQ(far.close(1), Planner::none);
    EXPECT_EQ(far.counts.guard_calls, 1u);
    EXPECT_NEAR(far.planner.limit(), 4.25, rounding);
}

TEST(Planner, AGuardBeyondItsSurfaceWhereItWasCoveredHasAWrongBound)
{
    // It was covered up to t = 1, and is at -1.4 at t = 0.8.
    Plan plan(Clock{{resting(9, 1), too_fast()}});
    plan.pass(0.4);
    plan.pass(0.4);
    plan.overrun(0.4);
    ASSERT_FALSE(plan.planner.wrong());
    EXPECT_EQ(plan.close(), 0u);
    const auto& wrong = plan.planner.wrong();
    ASSERT_TRUE(wrong);
    EXPECT_EQ(wrong->guard, 1u);
    EXPECT_FALSE(wrong->lower_bound || wrong->upper_bound);
    EXPECT_NEAR(wrong->t, 0.8, rounding);
    EXPECT_NEAR(wrong->x[0], 0.8, rounding);
    EXPECT_NEAR(wrong->value, -1.4, rounding);
    EXPECT_EQ(wrong->since, 0);
    EXPECT_EQ(wrong->value_then, 1);
    EXPECT_NEAR(wrong->allowed, 0.8, rounding * 10);
    plan.planner.forget_wrong();
    EXPECT_FALSE(plan.planner.wrong());
}

TEST(Planner, NothingIsDeferredBeyondTheEndOfTheRun)
{
    for (const double end : {0.25, 0.75}) {
        Plan plan(Clock{{resting(9, 1), too_fast()}});
        plan.pass(end);
        plan.planner.check_last(plan.step, plan.table, plan.counts);
        EXPECT_EQ(plan.counts.guard_calls, 2u);
        // At 0.25 it has not crossed, and only its change would tell.
        ASSERT_EQ(plan.planner.wrong().has_value(), end == 0.75);
        if (end == 0.25) continue;
        EXPECT_EQ(plan.planner.wrong()->guard, 1u);
        EXPECT_NEAR(plan.planner.wrong()->t, 0.75, rounding);
        EXPECT_NEAR(plan.planner.wrong()->value, -1.25, rounding);
        EXPECT_NEAR(plan.planner.wrong()->allowed, 0.75, rounding);
    }
}

TEST(Planner, ASleeperIsTestedEvery64thStepIfBoundsAreChecked)
{
    for (const auto& options : {exact, checked}) {
        Plan plan(Clock{{resting(9, 1), too_fast()}}, options);
        ASSERT_TRUE(plan.step.attempt(0.25));
        const auto pass = [&](int steps) {
            for (int k = 0; k < steps; ++k) {
                plan.planner.sample_sleeper(plan.step, plan.table, plan.counts);
            }
        };
        pass(63);
        EXPECT_EQ(plan.counts.guard_calls, 0u);
        pass(1);
        EXPECT_EQ(plan.counts.guard_calls, options.check_bounds ? 1u : 0u);
        ASSERT_EQ(plan.planner.wrong().has_value(), options.check_bounds);
        if (!options.check_bounds) continue;
        // It has changed by 3/4 where 1/4 is allowed.
        EXPECT_EQ(plan.planner.wrong()->guard, 1u);
        EXPECT_NEAR(plan.planner.wrong()->value, 0.25, rounding);
        EXPECT_NEAR(plan.planner.wrong()->allowed, 0.25, rounding);
    }
}

TEST(Planner, ABoundWithoutAMeaningCoversNothingAndIsNamedIfChecked)
{
    for (const double speed : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
        for (const auto& options : {exact, checked}) {
            const Plan plan(Clock{{resting(9, 1), resting(1, speed)}}, options);
            EXPECT_EQ(plan.planner.limit(), 0);
            ASSERT_EQ(plan.planner.wrong().has_value(), options.check_bounds);
            if (options.check_bounds) {
                EXPECT_EQ(plan.planner.wrong()->guard, 1u);
            }
        }
    }
    const Plan unlimited(Clock{{resting(1, infinity)}}, checked);
    EXPECT_EQ(unlimited.planner.limit(), 0);
    EXPECT_FALSE(unlimited.planner.wrong());
}

TEST(Planner, ALowerBoundAboveItsGuardIsNamed)
{
    for (const double floor : {0.2, 0.4}) {
        Plan plan(Floored{{{resting(0.3, 1)}}, floor}, checked);
        plan.overrun(0.35);
        EXPECT_EQ(plan.close(1e9), Planner::none);
        ASSERT_EQ(plan.planner.wrong().has_value(), floor > 0.3);
        if (floor < 0.3) continue;
        EXPECT_TRUE(plan.planner.wrong()->lower_bound);
        EXPECT_EQ(plan.planner.wrong()->allowed, floor);
        EXPECT_EQ(plan.planner.wrong()->value, 0.3);
    }
}

TEST(Planner, AWrongLowerBoundAtTheEndOfTheRunIsNamed)
{
    // 1 - t, and 1/2 as its lower bound throughout: it covers the guard at the end of the run, too.
    Plan plan(Floored{{{{[](double t) { return 1 - t; }, 1}}}, 0.5});
    plan.overrun(1.25);
    ASSERT_EQ(plan.close(), Planner::none);
    ASSERT_EQ(plan.counts.guard_calls, 0u);
    plan.step.accept();
    plan.planner.check_last(plan.step, plan.table, plan.counts);
    ASSERT_TRUE(plan.planner.wrong());
    EXPECT_TRUE(plan.planner.wrong()->lower_bound);
    EXPECT_EQ(plan.planner.wrong()->value, -0.25);
    EXPECT_EQ(plan.planner.wrong()->allowed, 0.5);
}

TEST(Planner, GoesOnFromTheNumbersOfItsChecks)
{
    Plan plan(Clock{{resting(2, 4), resting(3, 1)}});
    plan.overrun(0.6);
    ASSERT_EQ(plan.close(), Planner::none);
    std::vector<double> saved;
    plan.planner.visit([&](auto& number) { saved.push_back(static_cast<double>(number)); });

    Plan other(Clock{{resting(2, 4), resting(3, 1)}});
    ASSERT_NE(other.planner.limit(), plan.planner.limit());
    std::size_t next = 0;
    other.planner.visit([&](auto& number) {
        number = static_cast<std::remove_reference_t<decltype(number)>>(saved[next++]);
    });
    other.planner.restore(other.table);
    EXPECT_EQ(other.planner.limit(), plan.planner.limit());
}

}  // namespace
}  // namespace ricochet::planner_test
