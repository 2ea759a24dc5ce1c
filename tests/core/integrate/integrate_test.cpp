#include "ricochet/integrate.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "ricochet/extremum.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::integrate_test {
namespace {

using X = std::array<double, 2>;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Largest difference between the impacts of a run and the closed form.
double impact_error(const Run<X>& run, const BouncingBall& ball, double height)
{
    double worst = 0;
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        worst = std::max(worst,
                         std::abs(run.events[i].t - ball.impact_time(static_cast<int>(i), height)));
    }
    return worst;
}

// --- the source paper's run: 13 impacts to t = 20.5 ---

// An impact that is late by d finds the ball faster by g d, which makes all later
// flights longer: d grows to d (1 + 2 r / (1 - r)) = 19 d. Each of 13 impacts is
// located to the spacing of its offset, at most 4.4e-16 s and late by half of that
// on average; their sum is below 13 * 19 * 2.2e-16 = 5.4e-14 s at worst and about a
// sixth of that where they scatter. The required bound is 2e-14 s.
TEST(Integrate, FixedStepsMeetThePapersImpactsAtEveryStep)
{
    const BouncingBall ball;
    for (const double h : {1e-4, 3.7e-4, 1e-3, 1e-2, 0.037, 0.1, 0.3, 1.0}) {
        const Options options{.t_end = 20.5, .step = h};
        const auto ends = integrate(ball, {10.0, 0.0}, options, FixedStep<Rk4>{}, Ends{});
        ASSERT_EQ(ends.events.size(), 13u) << h;
        EXPECT_LE(impact_error(ends, ball, 10), 2e-14) << h;
        const auto extremum = integrate(ball, {10.0, 0.0}, options, FixedStep<Rk4>{}, Extremum{});
        ASSERT_EQ(extremum.events.size(), 13u) << h;
        EXPECT_LE(impact_error(extremum, ball, 10), 2e-14) << h;
    }
}

template <class Method, class Detector>
void expect_paper_impacts(double rtol)
{
    const BouncingBall ball;
    const auto run = integrate(ball, {10.0, 0.0}, {.t_end = 20.5, .rtol = rtol, .atol = rtol / 100},
                               ErrorControlled<Method>{}, Detector{});
    ASSERT_EQ(run.events.size(), 13u) << rtol;
    // With a flight in one step the two halves of the parabola, 36 m, cancel at the
    // impact, and half an ulp of each, 3.6e-15 m, is 2.5e-16 s at 14 m/s. With the
    // late half ulp of location that makes at most 13 * 19 * 7e-16 s = 1.7e-13 s.
    EXPECT_LE(impact_error(run, ball, 10), 1.7e-13) << rtol;
}

TEST(Simulation, KeepsATemporarySystem)
{
    Simulation simulation(BouncingBall({.restitution = 0.5}), {10, 0}, {.t_end = 2});
    Simulation moved(std::move(simulation));
    // The place of the temporary system is used again.
    const BouncingBall other({.restitution = 0.9});
    EXPECT_EQ(integrate(other, {10, 0}, {.t_end = 2}).events.size(), 1U);
    const auto run = moved.take();
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_DOUBLE_EQ(run.events[0].after[1], -0.5 * run.events[0].before[1]);
}

TEST(Integrate, ErrorControlledStepsMeetThePapersImpacts)
{
    for (const double rtol : {1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13}) {
        expect_paper_impacts<Dopri5, Ends>(rtol);
        expect_paper_impacts<Dopri5, Extremum>(rtol);
        expect_paper_impacts<Fehlberg78, Ends>(rtol);
        expect_paper_impacts<Fehlberg78, Extremum>(rtol);
        expect_paper_impacts<CashKarp54, Extremum>(rtol);
    }
}

TEST(Integrate, EveryLocatorFindsTheSameImpacts)
{
    const BouncingBall ball;
    const Options options{.t_end = 20.5, .step = 0.01};
    const auto bisected =
        integrate(ball, {10.0, 0.0}, options, FixedStep<Rk4>{}, Ends{}, Bisection{});
    const auto toms = integrate(ball, {10.0, 0.0}, options, FixedStep<Rk4>{}, Ends{}, Toms748{});
    EXPECT_LE(impact_error(bisected, ball, 10), 2e-14);
    EXPECT_LE(impact_error(toms, ball, 10), 2e-14);
}

TEST(Integrate, ThePapersToleranceGivesThePapersAccuracy)
{
    // 1e-10 absolute and relative, bisected: 13 impacts, each late by up to
    // 1e-10 (1 + t), which grows up to 19-fold in the flights that follow.
    const BouncingBall ball;
    const auto run =
        integrate(ball, {10.0, 0.0},
                  {.t_end = 20.5, .step = 0.01, .event_tolerance = 1e-10, .event_rtol = 1e-10},
                  FixedStep<Rk4>{}, Ends{}, Bisection{});
    ASSERT_EQ(run.events.size(), 13u);
    EXPECT_LE(impact_error(run, ball, 10), 13 * 19 * 21e-10);
    EXPECT_GT(impact_error(run, ball, 10), 1e-13);
}

TEST(Integrate, BallsOfOtherRestitutionsMeetTheirImpacts)
{
    for (const auto& [restitution, impacts, t_end] :
         {std::tuple{0.7, 6u, 2.25}, std::tuple{0.9, 4u, 3.0}}) {
        const BouncingBall ball({.gravity = 9.81, .restitution = restitution});
        const auto run = integrate(ball, {1.0, 0.0}, {.t_end = t_end});
        ASSERT_EQ(run.events.size(), impacts);
        EXPECT_LE(impact_error(run, ball, 1), 2e-15);
    }
}

// --- data of an event ---

TEST(Integrate, AnEventCarriesItsBracketSlopeAndStates)
{
    const BouncingBall ball;
    const auto run = integrate(ball, {10.0, 0.0}, {.t_end = 3});
    ASSERT_EQ(run.events.size(), 1u);
    const auto& event = run.events[0];
    const double speed = std::sqrt(2 * 9.81 * 10);
    // The root between neighbouring doubles is rounded to either.
    EXPECT_LE(event.bracket.lo, event.t);
    EXPECT_GE(event.bracket.hi, event.t);
    EXPECT_LE(event.bracket.hi - event.bracket.lo, 1e-15);
    EXPECT_LE(event.before[0], 0);  // beyond the surface
    EXPECT_NEAR(event.before[1], -speed, 1e-14);
    EXPECT_NEAR(event.slope, -speed, 1e-14);
    EXPECT_EQ(event.after[0], 0);
    EXPECT_NEAR(event.after[1], 0.9 * speed, 1e-14);
    EXPECT_LE(event.error, 1e-15);
}

TEST(Integrate, ATerminalEventEndsTheRunAfterItsReset)
{
    const auto run = integrate(BouncingBall(), {10.0, 0.0}, {.t_end = 20, .stop_at_event = true});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(run.t, run.events[0].t);
    EXPECT_GT(run.x[1], 0);
}

TEST(Integrate, WithRecordingOffEventsAreCountedOnly)
{
    const auto run =
        integrate(BouncingBall(), {10.0, 0.0}, {.t_end = 20.5, .record_events = false});
    EXPECT_TRUE(run.events.empty());
    EXPECT_EQ(run.statistics.events, 13u);
}

TEST(Integrate, EveryStepHasItsEvidence)
{
    const auto extremum = integrate(BouncingBall(), {10.0, 0.0}, {.t_end = 20.5, .step = 0.01},
                                    FixedStep<Rk4>{}, Extremum{});
    EXPECT_EQ(extremum.statistics.evidence.checked + 13, extremum.statistics.steps);
    const auto ends = integrate(BouncingBall(), {10.0, 0.0}, {.t_end = 20.5, .step = 0.01},
                                FixedStep<Rk4>{}, Ends{});
    EXPECT_EQ(ends.statistics.evidence.assumed + 13, ends.statistics.steps);
}

// --- trajectories ---

TEST(Integrate, SamplesLieOnTheParabolas)
{
    const BouncingBall ball;
    std::vector<double> times;
    for (int i = 0; i <= 200; ++i) {
        times.push_back(0.01 * i);
    }
    const auto run = integrate(ball, {10.0, 0.0}, {.t_end = 2, .sample_times = times});
    ASSERT_EQ(run.trajectory.t, times);
    const double t1 = ball.first_impact(10);
    const double v1 = 0.9 * 9.81 * t1;
    for (std::size_t i = 0; i < times.size(); ++i) {
        const double t = times[i];
        const double s = t - t1;
        const double u = s < 0 ? 10 - 9.81 / 2 * t * t : v1 * s - 9.81 / 2 * s * s;
        EXPECT_NEAR(run.trajectory.x[i][0], u, 1e-13) << t;
    }
}

TEST(Integrate, ASampleAtAnEventIsTheStateAfterIt)
{
    const BouncingBall ball;
    const auto first = integrate(ball, {10.0, 0.0}, {.t_end = 2});
    const double impact = first.events[0].t;
    const auto run = integrate(ball, {10.0, 0.0}, {.t_end = 2, .sample_times = {0, impact, 2}});
    ASSERT_EQ(run.trajectory.x.size(), 3u);
    EXPECT_EQ(run.trajectory.x[0], (X{10.0, 0.0}));
    EXPECT_EQ(run.trajectory.x[1], run.events[0].after);
    EXPECT_EQ(run.trajectory.x[2], run.x);
}

TEST(Integrate, SamplingDoesNotChangeTheRun)
{
    const BouncingBall ball;
    const auto plain = integrate(ball, {10.0, 0.0}, {.t_end = 20.5});
    const auto sampled =
        integrate(ball, {10.0, 0.0}, {.t_end = 20.5, .sample_times = {1, 2, 3, 5.5, 20}});
    EXPECT_EQ(plain.x, sampled.x);
    EXPECT_EQ(plain.events.back().t, sampled.events.back().t);
}

// --- systems with fewer or more declarations ---

TEST(Integrate, ASystemWithoutAGuardIsAPlainOde)
{
    struct Decay {
        void flow(double, const X& x, X& dxdt) const { dxdt = {-x[0], -2 * x[1]}; }
    };
    const auto run = integrate(Decay{}, X{1.0, 1.0}, {.t_end = 1, .rtol = 1e-12, .atol = 1e-14});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.t, 1.0);
    EXPECT_NEAR(run.x[0], std::exp(-1.0), 1e-12);
    EXPECT_EQ(run.statistics.guard_calls, 0u);
    EXPECT_EQ(run.statistics.evidence.assumed, 0u);
}

TEST(Integrate, TheEndIsHitExactlyByStepsThatDoNotDivideIt)
{
    struct Clock {
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    };
    const auto run = integrate(Clock{}, X{0.0, 0.0}, {.t_end = 1, .step = 0.3}, FixedStep<Rk4>{});
    EXPECT_EQ(run.t, 1.0);
    EXPECT_EQ(run.x[0], 1.0);
    EXPECT_EQ(run.statistics.steps, 4u);
    const auto tenths =
        integrate(Clock{}, X{0.0, 0.0}, {.t_end = 1, .step = 0.1}, FixedStep<Rk4>{});
    EXPECT_EQ(tenths.statistics.steps, 10u) << "no step for a remainder of rounding";
}

/// x' = 1 / (1e-4 + (t - 1)^2) in every component but the first, which stands still: a peak 0.01
/// wide, of area 100 (atan 200 + atan 100) from t = 0 to 3.
template <class State>
struct Peak {
    void flow(double t, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < x.size(); ++i) {
            dxdt[i] = i == 0 ? 0 : 1 / (1e-4 + (t - 1) * (t - 1));
        }
    }
};

TEST(Integrate, AQuadratureHasAnErrorEstimateWithEveryMethod)
{
    const double area = 100 * (std::atan(200.0) + std::atan(100.0));
    const auto check = [&]<class State>(State start, auto method) {
        const auto run =
            integrate(Peak<State>{}, start, {.t_end = 3, .rtol = 1e-9, .atol = 1e-9}, method);
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.x[0], 0);
        for (std::size_t i = 1; i < start.size(); ++i) {
            // Every step adds at most rtol |x| + atol; no estimate of these is too small here.
            EXPECT_NEAR(run.x[i], area, 1e-9 * (area + 1) * double(run.statistics.steps)) << i;
        }
        EXPECT_GT(run.statistics.steps, 10u);
    };
    check(X{}, ErrorControlled<Fehlberg78>{});
    check(X{}, ErrorControlled<Dopri5>{});
    check(X{}, ErrorControlled<CashKarp54>{});
    // Two blocks of four components, and three.
    check(std::vector<double>(11), ErrorControlled<Fehlberg78>{});
    check(std::vector<double>(11), ErrorControlled<Dopri5>{});
    check(std::vector<double>(11), ErrorControlled<MethodByName>{{MethodName::fehlberg78}});
}

TEST(Integrate, AnEmptyIntervalReturnsTheStart)
{
    const auto run = integrate(BouncingBall(), {10.0, 0.0}, {.t_start = 3, .t_end = 3});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.t, 3);
    EXPECT_EQ(run.x, (X{10.0, 0.0}));
}

/// x' = 1: a clock whose guard is a function of time alone, with no rate declared.
struct Chime {
    using State = X;
    static constexpr bool resets = false;
    double at = 0.7;
    Crossing crossing = Crossing::rising;
    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(double t, const X&) const { return t - at; }
};

TEST(Integrate, AGuardWithoutARateOrAResetIsLocatedAllTheSame)
{
    const auto run = integrate(Chime{}, {0.0, 0.0}, {.t_end = 1});
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, 0.7, 1.2e-16);
    EXPECT_EQ(run.events[0].before, run.events[0].after);
    EXPECT_EQ(run.t, 1);
}

TEST(Integrate, ACrossingInTheOtherDirectionIsNoEvent)
{
    const auto run = integrate(Chime{0.7, Crossing::falling}, {0.0, 0.0}, {.t_end = 1});
    EXPECT_TRUE(run.events.empty());
}

TEST(Integrate, TheTimeOfAFlowDoesNotDependOnTheDateOfItsStart)
{
    const auto early = integrate(Chime{0.7}, {0.0, 0.0}, {.t_end = 1});
    const auto late = integrate(Chime{1e6 + 0.7}, {0.0, 0.0}, {.t_start = 1e6, .t_end = 1e6 + 1});
    EXPECT_NEAR(late.events.at(0).t - 1e6, early.events.at(0).t, 1.2e-10);  // one ulp of 1e6
}

TEST(Integrate, ABallThrownFromTheFloorComesBackToIt)
{
    const BouncingBall ball;
    const auto run = integrate(ball, {0.0, 9.81}, {.t_end = 3});
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, 2, 5e-16);
}

TEST(Integrate, ABallThrownAtTheFloorItLiesOnBouncesAtOnce)
{
    const auto run = integrate(BouncingBall(), {0.0, -10.0}, {.t_end = 1});
    ASSERT_GE(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].t, 0);
    EXPECT_EQ(run.events[0].after[1], 9);
}

TEST(Integrate, ABallAtRestDoesNotFallThroughTheFloor)
{
    const auto run = integrate(BouncingBall(), {0.0, 0.0}, {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.t, 1);
    EXPECT_EQ(run.x, (X{0.0, 0.0}));
}

TEST(Integrate, AResetThatLeavesTheResidueOfLocationIsArmedByItsRate)
{
    // The reset does not put the ball back onto the floor, so that it starts its
    // next flight a rounding below it.
    struct Careless {
        using State = X;
        bool unilateral = true;
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
        [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
        void reset(double, X& x) const { x[1] *= -0.9; }
    };
    const BouncingBall ball;
    const auto run = integrate(Careless{}, {10.0, 0.0}, {.t_end = 20.5});
    ASSERT_EQ(run.events.size(), 13u);
    EXPECT_LE(impact_error(run, ball, 10), 1e-13);
}

// --- endings ---

/// A ball without a rest rule.
struct RestlessBall {
    using State = X;
    double restitution = 0.9;
    bool unilateral = true;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    void reset(double, X& x) const { x = {0, -restitution * x[1]}; }
};

TEST(Integrate, AccumulatingImpactsWithoutARestRuleEndTheRunAsZeno)
{
    const BouncingBall ball;
    const auto run = integrate(RestlessBall{}, {10.0, 0.0}, {.t_end = 40});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_EQ(run.guard, 0u);
    EXPECT_NEAR(run.t, ball.zeno_time(10), 1e-12);
    EXPECT_LT(run.events.size(), 400u);
}

TEST(Integrate, APlasticImpactWithoutARestRuleEndsTheRunAsZeno)
{
    const auto run = integrate(RestlessBall{.restitution = 0}, {10.0, 0.0}, {.t_end = 40});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_EQ(run.events.size(), 1u);
}

TEST(Integrate, AccumulatingImpactsEndInRest)
{
    // The remainder of the geometric series is no longer resolved below 16 epsilon of
    // the time, 9.7e-14 s; the impacts before it add their errors, which grow 19-fold (see
    // above). The stated error holds both.
    const BouncingBall ball;
    const auto run = integrate(ball, {10.0, 0.0}, {.t_end = 40, .sample_times = {30, 35}});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.t, 40);
    EXPECT_EQ(run.x, (X{0.0, 0.0}));
    EXPECT_EQ(run.trajectory.x, (std::vector<X>{{0, 0}, {0, 0}}));
    ASSERT_LT(run.events.size(), 400u);
    const auto& last = run.events.back();
    EXPECT_EQ(last.kind, EventKind::accumulation);
    EXPECT_NEAR(last.t, ball.zeno_time(10), 1e-12);
    EXPECT_LE(std::fabs(last.t - ball.zeno_time(10)), last.error);
    EXPECT_LE(last.error, 1e-12);
}

/// Falls freely; the flow fails from t = 1 on.
struct Failing {
    using State = X;
    static constexpr bool resets = false;
    void flow(double t, const X& x, X& dxdt) const { dxdt = {x[1], t < 1 ? -1.0 : nan}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0] - 9.9; }
};

/// Slides with v' = -3 until it rests, and then stays where it is.
struct Block {
    using State = X;
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 1;
    static GuardInfo guard_info(std::size_t) { return {.degree = 1}; }
    void flow(Mode mode, double, const X& x, X& rate) const { rate = {x[1], mode == 0 ? -3.0 : 0}; }
    double guard(std::size_t, Mode mode, double, const X& x) const { return x[1] + (mode ? 1 : 0); }
    Mode reset(std::size_t, Mode, double, X& x) const
    {
        x[1] = 0;
        return 1;
    }
};

template <class Method>
void expect_cheap_rest()
{
    const auto calls_until = [](double t_end, double v) {
        const auto run = integrate(Block{}, {1.0, v}, {.t_end = t_end, .h_max = 0.25},
                                   ErrorControlled<Method>{});
        EXPECT_EQ(run.events.size(), 1u);
        // A guard that is straight in the offset is met where it is foretold; the rest of the way
        // is less than a unit in the last place, and needs no further repeat.
        EXPECT_EQ(run.statistics.resteps, 1u) << v;
        EXPECT_NEAR(run.events[0].t, v / 3, 4e-16 * v);
        return run.statistics.guard_calls;
    };
    for (int k = 0; k < 50; ++k) {
        const double v = 2 + 0.011 * k;
        // Eight steps of rest: a value and a rate of two calls at the end, and a value inside.
        EXPECT_LE(calls_until(4, v) - calls_until(2, v), 8 * 4u) << v;
    }
}

TEST(Integrate, WhereOnlyTheTimeMovesAGuardIsEvaluatedAsInAnyStep)
{
    expect_cheap_rest<Dopri5>();
    expect_cheap_rest<Fehlberg78>();
}

TEST(Integrate, AFlowThatFailsMidwayKeepsWhatWasComputed)
{
    const auto controlled =
        integrate(Failing{}, {10.0, 0.0}, {.t_end = 2, .sample_times = {0, 0.5}});
    EXPECT_EQ(controlled.outcome, Outcome::non_finite);
    EXPECT_NEAR(controlled.t, 1, 1e-6);  // the step shrinks towards the failure
    EXPECT_LT(controlled.t, 1);
    EXPECT_NEAR(controlled.x[0], 10 - controlled.t * controlled.t / 2, 1e-12);
    EXPECT_EQ(controlled.events.size(), 1u);
    EXPECT_EQ(controlled.trajectory.t.size(), 2u);

    const auto fixed =
        integrate(Failing{}, {10.0, 0.0}, {.t_end = 2, .step = 0.1}, FixedStep<Rk4>{});
    EXPECT_EQ(fixed.outcome, Outcome::non_finite);
    EXPECT_EQ(fixed.reason, "the flow");
    EXPECT_EQ(describe(controlled),
              "the flow returned NaN or infinity, or led to a state that is not finite; the last "
              "finite state is kept");
    EXPECT_GT(fixed.t, 0.89);
    EXPECT_EQ(fixed.events.size(), 1u);
}

TEST(Integrate, AGuardThatFailsEndsTheRun)
{
    struct Blind {
        using State = X;
        static constexpr bool resets() { return false; }
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
        [[nodiscard]] double guard(double t, const X&) const { return t < 0.5 ? 1.0 : nan; }
    };
    const auto run =
        integrate(Blind{}, {0.0, 0.0}, {.t_end = 1, .step = 0.1}, FixedStep<Rk4>{}, Ends{});
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    EXPECT_EQ(run.guard, 0u);
    EXPECT_EQ(run.reason, "guard 0");
    EXPECT_LT(run.t, 0.5);
}

TEST(Integrate, AResetThatFailsEndsTheRunAtItsEvent)
{
    struct Broken {
        using State = X;
        void flow(double, const X&, X& dxdt) const { dxdt = {-1, 0}; }
        [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
        void reset(double, X& x) const { x[0] = nan; }
    };
    const auto run = integrate(Broken{}, {0.5, 0.0}, {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    EXPECT_EQ(run.reason, "the reset of guard 0");
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, 0.5, 1e-15);
}

TEST(Integrate, AResetBehindTheSurfaceIsReported)
{
    struct Sinking {
        using State = X;
        bool unilateral = true;
        void flow(double, const X&, X& dxdt) const { dxdt = {-1, 0}; }
        [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
        void reset(double, X& x) const { x[0] = -1; }
    };
    const auto run = integrate(Sinking{}, {0.5, 0.0}, {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::outside_mode);
}

TEST(Integrate, APoleIsOneEventNotAThousand)
{
    struct Pole {
        static constexpr bool resets() { return false; }
        Crossing crossing = Crossing::either;
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
        [[nodiscard]] double guard(double t, const X&) const { return std::tan(t); }
    };
    const auto run =
        integrate(Pole{}, X{0.0, 0.0}, {.t_start = 1, .t_end = 2, .step = 0.1, .max_steps = 1000},
                  FixedStep<Rk4>{});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, std::acos(0.0), 1e-15);
}

TEST(Integrate, EventsThatDoNotAdvanceTimeEndTheRun)
{
    struct Plateau {
        static constexpr bool resets() { return false; }
        Crossing crossing = Crossing::either;
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
        [[nodiscard]] double guard(double t, const X&) const
        {
            return std::max(0.0, std::abs(t - 5) - 1);
        }
    };
    for (const double step : {0.01, 0.1}) {
        const auto run =
            integrate(Plateau{}, X{0.0, 0.0}, {.t_end = 10, .step = step, .max_steps = 100'000},
                      FixedStep<Rk4>{}, Extremum{}, Bisection{});
        EXPECT_NE(run.outcome, Outcome::step_limit);
    }
}

TEST(Integrate, AVanishingComponentNeedsNoAbsoluteTolerance)
{
    struct Clock {
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    };
    const auto run = integrate(Clock{}, X{1.0, 0.0}, {.t_end = 1, .rtol = 1e-8, .atol = 0});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
}

TEST(Integrate, Toms748FollowsAResetThatLeavesTheResidueOfLocation)
{
    struct Flip {
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
        [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
        void reset(double, X& x) const { x[1] *= -0.9; }
    };
    const auto run = integrate(Flip{}, X{10.0, 0.0}, {.t_end = 20.5}, ErrorControlled<Dopri5>{},
                               Extremum{}, Toms748{});
    EXPECT_EQ(run.events.size(), 13u);
}

TEST(Integrate, AStepLimitEndsTheRun)
{
    const auto run = integrate(BouncingBall(), {10.0, 0.0},
                               {.t_end = 20, .step = 0.01, .max_steps = 50}, FixedStep<Rk4>{});
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    EXPECT_NEAR(run.t, 0.5, 1e-15);
}

TEST(Integrate, AStiffToleranceThatCannotBeMetUnderflows)
{
    struct Jump {  // a discontinuity that no step resolves
        void flow(double t, const X&, X& dxdt) const { dxdt = {t < 0.5 ? 0.0 : 1e6, 0}; }
    };
    const auto run =
        integrate(Jump{}, X{0.0, 0.0}, {.t_end = 1, .rtol = 1e-12, .atol = 1e-30, .h_min = 1e-9});
    EXPECT_EQ(run.outcome, Outcome::step_underflow);
    EXPECT_LE(run.t, 0.5 + 1e-6);
}

// --- meaningless starts ---

template <class System>
std::string refusal(const System& system, const X& start)
{
    try {
        (void)integrate(system, start, {.t_end = 1});
        return "accepted";
    } catch (const std::invalid_argument& reason) {
        return reason.what();
    }
}

TEST(Integrate, AStartThatIsNotFiniteIsRefused)
{
    EXPECT_EQ(refusal(BouncingBall(), {nan, 0.0}),
              "integrate: the start must be finite, got nan in component 0");
    EXPECT_EQ(refusal(BouncingBall(), {1.0, std::numeric_limits<double>::infinity()}),
              "integrate: the start must be finite, got inf in component 1");
}

TEST(Integrate, AStartBelowTheFloorIsRefused)
{
    EXPECT_EQ(refusal(BouncingBall(), {-1.0, 0.0}),
              "integrate: the start lies behind guard 0, which bounds the motion: expected "
              "guard >= 0 at t = 0, got -1");
}

TEST(Integrate, AStartWithoutComponentsIsRefused)
{
    EXPECT_THROW((void)integrate(BouncingBall(), std::vector<double>{}, {.t_end = 1}),
                 std::invalid_argument);
}

TEST(Integrate, AConstraintWithoutAResetIsRefused)
{
    struct Wall {
        static constexpr bool resets() { return false; }
        bool unilateral = true;
        void flow(double, const X&, X& dxdt) const { dxdt = {-1, 0}; }
        [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    };
    EXPECT_NE(refusal(Wall{}, {1.0, 0.0}), "accepted");
}

TEST(Integrate, TheLargestStepHoldsFromTheFirstStepOn)
{
    struct Clock {
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    };
    const auto run = integrate(Clock{}, X{0.0, 0.0}, {.t_end = 3, .step = 3, .h_max = 1});
    EXPECT_EQ(run.statistics.steps, 3u);
}

TEST(Integrate, TheStateTypeFollowsTheStart)
{
    const Eigen::VectorXd start = Eigen::Vector2d(10.0, 0.0);
    const ricochet::Run<Eigen::VectorXd> run = integrate(BouncingBall(), start, {.t_end = 20.5});
    EXPECT_EQ(run.events.size(), 13u);
}

}  // namespace
}  // namespace ricochet::integrate_test
