#include "ricochet/monitor.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "allocations.hpp"
#include "clearing_gate.hpp"
#include "refusal.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/thermostat.hpp"
#include "rk4_host.hpp"

namespace ricochet::monitor_test {
namespace {

using test::drive;
using test::Rk4Host;
using X1 = std::array<double, 1>;
using X = std::array<double, 2>;
using X4 = std::array<double, 4>;

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// --- whole runs ---

TEST(Monitor, TheBouncingBallHasItsThirteenImpacts)
{
    // The method is exact on a parabola, so the only error is rounding: at each of 200 steps
    // at most 1e-15 m of the height, at 5 m/s or more.
    for (const double h : {0.5, 0.25, 0.1}) {
        const BouncingBall ball;
        EventMonitor monitor(ball, X{});
        const auto run = drive(ball, monitor, X{10, 0}, 20.5, h);
        EXPECT_EQ(run.verdict, Verdict::stands);
        ASSERT_EQ(run.cuts.size(), 13u) << h;
        for (int k = 0; k < 13; ++k) {
            const auto& cut = run.cuts[static_cast<std::size_t>(k)];
            EXPECT_NEAR(cut.t.value, ball.impact_time(k, 10), 1e-13) << h << ' ' << k;
            EXPECT_EQ(cut.fired, std::vector<std::size_t>{0});
            EXPECT_TRUE(cut.state_changed);
            EXPECT_FALSE(cut.accumulation);
            EXPECT_DOUBLE_EQ(cut.after[1], -0.9 * cut.before[1]);
        }
        EXPECT_EQ(run.events.size(), 13u);
        EXPECT_EQ(run.statistics.events, 13u);
    }
}

/// An oscillator with lines at `level` of the amplitude, which it passes in pairs, and a wall.
struct Lines {
    static constexpr std::size_t guard_count = 3;
    double level = 1;
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.crossing = which == 0 ? Crossing::falling : Crossing::either,
                .resets = which == 0,
                .degree = 1};
    }
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -x[0]}; }
    [[nodiscard]] double guard(std::size_t which, double t, const X& x) const
    {
        return which == 0 ? x[0] + 0.9 : which == 1 ? level - x[0] : x[0] + 0.01 * t;
    }
    void reset(std::size_t, double, X& x) const { x = {-0.9, -x[1]}; }
};

/// Steps whose paths are declared to be cubics, as they are.
template <class Step>
struct CubicStep {
    static constexpr bool is_cubic = true;
    const Step& of;
    [[nodiscard]] const Instant& t0() const { return of.t0(); }
    [[nodiscard]] double h() const { return of.h(); }
    [[nodiscard]] std::span<const double> x0() const { return of.x0(); }
    [[nodiscard]] std::span<const double> x1() const { return of.x1(); }
    [[nodiscard]] std::span<const double> rate0() const { return of.rate0(); }
    [[nodiscard]] std::span<const double> rate1() const { return of.rate1(); }
    void interpolate(double s, std::span<double> x) const { of.interpolate(s, x); }
    void interpolate_rate(double s, std::span<double> dxdt) const { of.interpolate_rate(s, dxdt); }
    void restep(double s, std::span<double> x) const { of.restep(s, x); }
};
struct Cubics {
    template <class Step>
    [[nodiscard]] CubicStep<Step> step(const Step& taken) const
    {
        return {taken};
    }
    [[nodiscard]] X rate(const X& dxdt) const { return dxdt; }
};

// Up to 1e-9 below the crest, lines are passed twice within a step. If a step is a cubic, and a
// guard of degree 1, the values and rates at its ends contain all the information of a value
// inside: the events are the same to the bit, and most steps take one evaluation of each guard, not
// two.
TEST(Monitor, KeepsATemporarySystem)
{
    EventMonitor monitor(BouncingBall({.restitution = 0.5}), {0, 0});
    // The place of the temporary system is used again.
    const BouncingBall other({.restitution = 0.9});
    const auto run = drive(other, monitor, X{10, 0}, 2, 0.1);
    ASSERT_EQ(run.cuts.size(), 1u);
    EXPECT_DOUBLE_EQ(run.cuts[0].after[1], -0.5 * run.cuts[0].before[1]);
    EventMonitor moved(std::move(monitor));
    EXPECT_EQ(drive(other, moved, X{10, 0}, 2, 0.1).cuts.size(), 1u);
}

TEST(Monitor, CubicStepsKeepTheirEventsWithFewerEvaluations)
{
    for (const double h : {0.3, 0.1, 0.07, 0.01}) {
        for (int k = 0; k < 12; ++k) {
            const Lines system{1 - std::pow(10, -k)};
            EventMonitor plain(system, X{});
            EventMonitor cubic(system, X{});
            const auto a = drive(system, plain, X{1, 0}, 40, h);
            const auto b = drive(system, cubic, X{1, 0}, 40, h, 0, Cubics{});
            ASSERT_EQ(a.verdict, Verdict::stands);
            ASSERT_EQ(a.events.size(), b.events.size()) << h << ' ' << k;
            EXPECT_GT(a.events.size(), 20u);
            for (std::size_t i = 0; i < a.events.size(); ++i) {
                EXPECT_EQ(a.events[i].t, b.events[i].t);
                EXPECT_EQ(a.events[i].guard, b.events[i].guard);
                EXPECT_EQ(a.events[i].kind, b.events[i].kind);
                EXPECT_EQ(a.events[i].after, b.events[i].after);
            }
            const auto& seen = a.statistics.evidence;
            EXPECT_EQ(seen.checked, b.statistics.evidence.checked);
            EXPECT_EQ(seen.assumed, b.statistics.evidence.assumed);
            EXPECT_LT(b.statistics.guard_calls, a.statistics.guard_calls);
        }
    }
}

/// Moves back and forth at constant speed between walls at 0 and 1, with a mark between them. With
/// dyadic numbers nothing is rounded.
struct Shuttle {
    std::size_t guard_count = 3;
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.crossing = which == 2 ? Crossing::either : Crossing::falling,
                .resets = which != 2,
                .unilateral = which != 2};
    }
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], 0}; }
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 ? x[0] : which == 1 ? 1 - x[0] : x[0] - 0.375;
    }
    void reset(std::size_t, double, X& x) const { x[1] = -x[1]; }
};

TEST(Monitor, ItsEventsAreThoseOfASimulationThatTakesTheSameSteps)
{
    const Shuttle system;
    for (const double h : {0.0625, 0.09375, 0.5, 0.75}) {
        EventMonitor monitor(system, X{});
        const auto run = drive(system, monitor, X{0.5, 0.25}, 40, h);
        const auto own =
            integrate(system, X{0.5, 0.25}, {.t_end = 40, .step = h}, FixedStep<Rk4>{});
        ASSERT_EQ(run.events.size(), own.events.size()) << h;
        for (std::size_t k = 0; k < own.events.size(); ++k) {
            const auto& a = run.events[k];
            const auto& b = own.events[k];
            // Dyadic numbers are rounded only where the wall is located, by an ulp, and the
            // simulation, but not the monitor, keeps what that takes from the position.
            EXPECT_NEAR(a.t, b.t, 2.3e-16 * b.t) << h << ' ' << k;
            EXPECT_EQ(a.guard, b.guard);
            EXPECT_EQ(a.kind, b.kind);
            EXPECT_EQ(a.before, b.before);
            EXPECT_EQ(a.after, b.after);
        }
        EXPECT_NEAR(run.x[0], own.x[0], 2.3e-16 * 40 * 0.25);
        EXPECT_EQ(run.x[1], own.x[1]);
        EXPECT_EQ(run.statistics.events, own.statistics.events);
        EXPECT_EQ(run.statistics.steps, own.statistics.steps);
        EXPECT_EQ(run.statistics.evidence.checked, own.statistics.evidence.checked);
    }
}

TEST(Monitor, NotificationsAreRecordedAndTheStepStands)
{
    const Shuttle system;
    EventMonitor monitor(system, X{});
    const auto run = drive(system, monitor, X{0.5, 0.25}, 40, 0.75);
    std::size_t marks = 0;
    for (const auto& event : run.events) marks += event.guard == 2;
    EXPECT_EQ(marks, 10u);  // once in every passage of 4 s
    for (const auto& cut : run.cuts) EXPECT_NE(cut.fired, std::vector<std::size_t>{2});
}

TEST(Monitor, ModesChangeAsTheyDoInARun)
{
    const Thermostat room;
    EventMonitor monitor(room, X1{});
    const auto run = drive(room, monitor, Thermostat::start, 60, 0.01, Thermostat::off);
    ASSERT_GE(run.cuts.size(), 8u);
    for (std::size_t k = 0; k < run.cuts.size(); ++k) {
        const auto& cut = run.cuts[k];
        EXPECT_NEAR(cut.t.value, room.switch_time(static_cast<int>(k)), 1e-9);
        EXPECT_EQ(cut.mode_before, k % 2 == 0 ? Thermostat::off : Thermostat::on);
        EXPECT_EQ(cut.mode_after, k % 2 == 0 ? Thermostat::on : Thermostat::off);
        EXPECT_FALSE(cut.state_changed);
    }
}

/// Balls side by side.
struct Balls {
    double restitution = 0.9;
    std::size_t guard_count = 2;
    static constexpr bool unilateral = true;
    void flow(double, const X4& x, X4& dxdt) const { dxdt = {x[1], -9.81, x[3], -9.81}; }
    [[nodiscard]] double guard(std::size_t which, double, const X4& x) const
    {
        return x[2 * which];
    }
    void reset(std::size_t which, double, X4& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] *= -restitution;
    }
};

TEST(Monitor, EqualBallsImpactInSetsOfTwo)
{
    const Balls balls;
    EventMonitor monitor(balls, X4{});
    const auto run = drive(balls, monitor, X4{10, 0, 10, 0}, 20.5, 0.1);
    ASSERT_EQ(run.cuts.size(), 13u);
    for (const auto& cut : run.cuts) EXPECT_EQ(cut.fired, (std::vector<std::size_t>{0, 1}));
    EXPECT_EQ(run.events.size(), 26u);
}

TEST(Monitor, AccumulatingImpactsComeToRest)
{
    const BouncingBall ball({.restitution = 0.5});
    EventMonitor monitor(ball, X{});
    const auto run = drive(ball, monitor, X{10, 0}, 20, 0.1);
    EXPECT_EQ(run.verdict, Verdict::rests);
    ASSERT_FALSE(run.cuts.empty());
    const auto& last = run.cuts.back();
    EXPECT_TRUE(last.accumulation);
    EXPECT_NEAR(last.t.value, ball.zeno_time(10), 1e-12);
    EXPECT_EQ(last.after, (X{0, 0}));
    EXPECT_EQ(last.fired, std::vector<std::size_t>{0});
    const auto own = integrate(ball, X{10, 0}, {.t_end = 20, .step = 0.1}, FixedStep<Rk4>{});
    EXPECT_NEAR(static_cast<double>(run.events.size()), static_cast<double>(own.events.size()), 3);
}

/// A ball without a rest rule.
struct Restless {
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    void reset(double, X& x) const { x[1] *= -0.5; }
};

TEST(Monitor, WithoutARestRuleAnAccumulationEndsTheRun)
{
    const Restless ball;
    EventMonitor monitor(ball, X{});
    const auto run = drive(ball, monitor, X{10, 0}, 20, 0.1);
    EXPECT_EQ(run.verdict, Verdict::ended);
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_NEAR(run.t, BouncingBall({.restitution = 0.5}).zeno_time(10), 1e-6);
    EXPECT_NEAR(run.x[0], 0, 1e-9);
}

/// The guard of a ball that starts on the floor, and falls.
TEST(Monitor, AMotionThatStartsOnItsSurfaceIsCutAtOnce)
{
    const BouncingBall ball;
    EventMonitor monitor(ball, X{});
    EXPECT_EQ(monitor.start(Instant{0}, X{0, -2}, X{-2, -9.81}, 0.1), Verdict::cut);
    EXPECT_EQ(monitor.cut().s, 0);
    EXPECT_DOUBLE_EQ(monitor.cut().after[1], 1.8);
    EXPECT_EQ(monitor.resume(X{1.8, -9.81}, 0.1), Verdict::stands);
    // At rest on the floor: neither up nor down by its rate, but down by its flow.
    EXPECT_EQ(monitor.start(Instant{0}, X{0, 0}, X{0, -9.81}, 0.1), Verdict::cut);
    EXPECT_TRUE(monitor.cut().accumulation);
    EXPECT_EQ(monitor.resume(X{0, -9.81}, 0.1), Verdict::rests);
}

/// Falls to zero at t = 1 and stays there.
struct Arriving {
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const { return x[0] < 1 ? 1 - x[0] : 0; }
    [[nodiscard]] Mode reset(Mode, double, X1&) const { return 0; }
};

TEST(Monitor, AGuardThatArrivesAndStaysHasOneEvent)
{
    for (const double h : {0.3, 0.25, 0.07}) {
        const Arriving system;
        EventMonitor monitor(system, X1{});
        const auto run = drive(system, monitor, X1{0}, 4, h);
        ASSERT_EQ(run.events.size(), 1u) << h;
        EXPECT_NEAR(run.events[0].t, 1, 1e-12);
    }
}

/// A parabola that dips below its surface by `depth` [m], around t = 1.
struct Dip {
    static constexpr bool resets = false;
    double depth = 0;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], 2}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    [[nodiscard]] X start() const { return {1 - depth, -2}; }
};

TEST(Monitor, PairsOfCrossingsInOneStepAreFoundDownToRounding)
{
    for (int k = 1; k <= 12; ++k) {
        const Dip system{std::pow(10, -k)};
        EventMonitor monitor(system, X{});
        const auto run = drive(system, monitor, system.start(), 3, 0.73);
        ASSERT_EQ(run.events.size(), 1u) << system.depth;  // the falling one of the two
        // The rounding of the height, 4e-16, moves the root by its ratio to the rate.
        const double root = 1 - std::sqrt(system.depth);
        EXPECT_NEAR(run.events[0].t, root, 2e-15 / std::sqrt(system.depth) + 1e-15);
    }
}

/// A step of a ball in a host that asks its interpolant for times, counted from the end of the
/// step, as a multistep method does: in short steps it is a staircase that misses its start.
struct ByTime {
    double t, length;
    X a, b, ra, rb;
    [[nodiscard]] double t0() const { return t; }
    [[nodiscard]] double h() const { return length; }
    [[nodiscard]] std::span<const double> x0() const { return a; }
    [[nodiscard]] std::span<const double> x1() const { return b; }
    [[nodiscard]] std::span<const double> rate0() const { return ra; }
    [[nodiscard]] std::span<const double> rate1() const { return rb; }
    void interpolate(double s, std::span<double> x) const
    {
        const double from_end = (t + s) - (t + length);
        x[0] = b[0] + from_end * (b[1] - 4.905 * from_end);
        x[1] = b[1] - 9.81 * from_end;
    }
};

TEST(Monitor, AnInterpolantThatMissesItsStartLosesNothing)
{
    const BouncingBall ball;
    for (int k = 0; k < 50; ++k) {
        const double shortest = 6e-14 + 1e-15 * k;  // [s] of the first step after an impact
        EventMonitor monitor(ball, X{});
        double t = 0;
        double h = 0.1;
        X x{10, 0};
        ASSERT_EQ(monitor.start(Instant{t}, x, X{0, -9.81}, h), Verdict::stands);
        int impacts = 0;
        while (t < 20.45) {
            const X end{x[0] + h * (x[1] - 4.905 * h), x[1] - 9.81 * h};
            const Verdict verdict =
                monitor.examine(ByTime{t, h, x, end, {x[1], -9.81}, {end[1], -9.81}});
            if (verdict == Verdict::stands) {
                t += h;
                x = end;
                h = std::fmin(10 * h, 0.1);
                continue;
            }
            ASSERT_EQ(verdict, Verdict::cut) << impacts;
            ASSERT_FALSE(monitor.cut().accumulation) << impacts;
            // A dozen roundings of the time in every flight, 2e-15 s each, and of the height in
            // every step of 0.1 s, at 3 m/s or more.
            EXPECT_NEAR(monitor.cut().t.value, ball.impact_time(impacts, 10), 1e-12);
            ++impacts;
            t = monitor.cut().t.value;
            x = monitor.cut().after;
            h = shortest;
            ASSERT_EQ(monitor.resume(X{x[1], -9.81}, h), Verdict::stands) << impacts;
        }
        EXPECT_EQ(impacts, 13) << shortest;
    }
}

/// Guard 0 lifts the second component over the surface of guard 1.
struct Chain {
    std::size_t guard_count = 2;
    void flow(double, const X& x, X& dxdt) const { dxdt = {1, 0 * x[0]}; }
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 ? 1 - x[0] : 1 - x[1];
    }
    void reset(std::size_t which, double, X& x) const { x[1] = which == 0 ? 2 : -1; }
};

TEST(Monitor, AResetThatCarriesAGuardAcrossIsASecondCutAtTheSameInstant)
{
    const Chain system;
    EventMonitor monitor(system, X{});
    const auto run = drive(system, monitor, X{0, 0}, 2, 0.3);
    ASSERT_EQ(run.cuts.size(), 2u);
    EXPECT_EQ(run.cuts[0].fired, std::vector<std::size_t>{0});
    EXPECT_EQ(run.cuts[1].fired, std::vector<std::size_t>{1});
    EXPECT_EQ(run.cuts[0].t.value, run.cuts[1].t.value);
    EXPECT_EQ(run.cuts[1].before, run.cuts[0].after);
    EXPECT_EQ(run.cuts[1].s, 0);
    EXPECT_EQ(run.x[1], -1);
}

/// A counter: once per second guard 0 lifts the second component over the surface of guard 1.
struct Counter {
    std::size_t guard_count = 2;
    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const { return 1 - x[which]; }
    void reset(std::size_t which, double, X& x) const
    {
        if (which == 0) {
            x = {0, 2};
        } else {
            x[1] = 0;
        }
    }
};

TEST(Monitor, SetsAreCountedAnewAtEveryInstant)
{
    // Two sets at each of 150 instants: no cascade is longer than two.
    const Counter system;
    EventMonitor monitor(system, X{});
    const auto run = drive(system, monitor, X{0, 0}, 150.5, 0.25);
    EXPECT_EQ(run.verdict, Verdict::stands) << describe(run.outcome);
    EXPECT_EQ(run.events.size(), 300u);
}

/// A clock that strikes every second, and a guard.
struct Clock {
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], 0}; }
    [[nodiscard]] double guard(double, const X& x) const { return 2.5 - x[0]; }
    void reset(double, X& x) const { x[1] = 0; }
    [[nodiscard]] double next_time_event(double t) const { return std::floor(t) + 1; }
    void time_reset(double, X& x) const { x[1] += 1; }
};

TEST(Monitor, TimeEventsEndTheirSteps)
{
    const Clock system;
    EventMonitor monitor(system, X{});
    const auto run = drive(system, monitor, X{0, 0}, 4.5, 0.3);
    // Speeds 0, 1, 2: the height 2.5 is met at 2.75, and again by the strikes at 3 and 4.
    ASSERT_EQ(run.cuts.size(), 7u);
    const std::array<double, 7> times{1, 2, 2.75, 3, 3, 4, 4};
    for (std::size_t k = 0; k < times.size(); ++k) {
        EXPECT_NEAR(run.cuts[k].t.value, times[k], 1e-14);
        EXPECT_EQ(run.cuts[k].on_time, k != 2 && k != 4 && k != 6);
    }
    EXPECT_NEAR(run.x[0], 2.5, 1e-14);
}

/// A ball that a clock sends up again.
struct Struck {
    static constexpr bool unilateral = true;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -8}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    void reset(double, X& x) const { x[1] *= -0.25; }
    void rest(double, X& x) const { x = {0, 0}; }
    [[nodiscard]] double next_time_event(double t) const { return 5 * std::floor(t / 5) + 5; }
    void time_reset(double, X& x) const { x[1] = 4; }
};

TEST(Monitor, AMotionAtRestIsHeldUntilATimeEvent)
{
    const Struck system;
    EventMonitor monitor(system, X{});
    const auto run = drive(system, monitor, X{1, 0}, 12, 0.1);
    std::size_t rests = 0;
    std::size_t strikes = 0;
    for (const auto& cut : run.cuts) {
        rests += cut.accumulation;
        strikes += cut.on_time;
    }
    EXPECT_EQ(strikes, 2u);
    EXPECT_EQ(rests, 3u);
    EXPECT_EQ(run.verdict, Verdict::rests);
    EXPECT_EQ(run.x, (X{0, 0}));
}

/// A ball that is thrown sideways, (x, y) and their rates, and lifted by `lift` [m/s³] from 1 s on.
/// At 1 m/s x is the time, so that a host need not know it.
struct Sideways {
    double lift = 0;
    void flow(double t, const X4& x, X4& dxdt) const
    {
        const double since = (x[2] == 1 ? x[0] : t) - 1;
        dxdt = {x[2], x[3], 0, -10 + lift * std::max(since, 0.0)};
    }
    [[nodiscard]] double guard(double, const X4& x) const { return x[1]; }
    void reset(double, X4& x) const { x[1] = 0, x[3] *= -0.5; }
    void rest(double, X4& x) const { x[1] = x[3] = 0; }
};

/// The motion of a host that keeps the components that the monitor names.
template <class System, class Monitor>
struct Keeping {
    const System* system;
    const Monitor* monitor;
    void flow(double t, const X4& x, X4& dxdt) const
    {
        system->flow(t, x, dxdt);
        for (const std::size_t c : monitor->held()) dxdt[c] = 0;
    }
};

TEST(Monitor, AThrownBallSlidesOnInAHostThatKeepsWhatRests)
{
    const Sideways ball;
    EventMonitor monitor(ball, X4{});
    const Keeping host{&ball, &monitor};
    const auto run = drive(host, monitor, X4{0, 0.1, 1, 0}, 4, 0.1);
    EXPECT_EQ(run.verdict, Verdict::stands);
    ASSERT_TRUE(run.cuts.back().accumulation);
    EXPECT_NEAR(run.cuts.back().t.value, 3 * std::sqrt(0.02), 1e-12);  // sqrt(2 h / g) 1.5 / 0.5
    EXPECT_NEAR(run.x[0], 4, 1e-12);
    EXPECT_EQ(run.x[1], 0);
    EXPECT_TRUE(std::ranges::equal(monitor.held(), std::array{1U, 3U}));
    // A host that lets them move is told so, and may go on.
    EventMonitor other(ball, X4{});
    EXPECT_THROW((void)drive(ball, other, X4{0, 0.1, 1, 0}, 4, 0.1), std::logic_error);
    EXPECT_EQ(other.outcome(), Outcome::reached_end);
}

TEST(Monitor, WhatTheFlowLiftsGoesFree)
{
    // The weight is -10 + 10 (t - 1) from 1 s on: free at 2 s, then y = 5/3 (t - 2)^3, which is
    // exact in steps of rk4. Once the ball slides, once it lies still.
    for (const double speed : {1.0, 0.0}) {
        const Sideways ball{10};
        EventMonitor monitor(ball, X4{});
        const Keeping host{&ball, &monitor};
        auto run = drive(host, monitor, X4{0, 0.1, speed, 0}, 3, 0.1);
        if (speed == 0) {
            ASSERT_EQ(run.verdict, Verdict::rests);
            ASSERT_EQ(monitor.hold(3), Verdict::cut);
            EXPECT_NEAR(monitor.cut().t.value, 2, 1e-12);
            EXPECT_TRUE(monitor.cut().fired.empty());
            EXPECT_EQ(monitor.resume(0.1), Verdict::stands);
            EXPECT_TRUE(monitor.held().empty());
            continue;
        }
        EXPECT_EQ(run.verdict, Verdict::stands);
        ASSERT_GT(run.cuts.size(), 2U);
        const auto& freed = run.cuts.back();
        EXPECT_NEAR(freed.t.value, 2, 1e-12);
        EXPECT_TRUE(freed.fired.empty());
        EXPECT_FALSE(freed.accumulation || freed.on_time);
        EXPECT_EQ(run.events.back().kind, EventKind::mode);
        EXPECT_NEAR(run.x[0], 3, 1e-12);
        EXPECT_NEAR(run.x[1], 5.0 / 3, 1e-11);
    }
}

/// A ball on a floor whose height is only known at finite times.
struct LateFloor : Struck {
    mutable bool asked_at_infinity = false;
    [[nodiscard]] double guard(double t, const X& x) const
    {
        asked_at_infinity = asked_at_infinity || !std::isfinite(t);
        return x[0];
    }
    [[nodiscard]] double next_time_event(double) const { return inf; }
};

TEST(Monitor, AGuardIsNotAskedAtTheEndOfTime)
{
    const LateFloor system;
    EventMonitor monitor(system, X{});
    const auto run = drive(system, monitor, X{1, 0}, 12, 0.1);
    EXPECT_EQ(run.verdict, Verdict::rests);
    EXPECT_FALSE(system.asked_at_infinity);
}

TEST(Monitor, AHostMayMakeTheStateAfterAnEventItself)
{
    const Dip system{0.25};  // has no reset
    EventMonitor monitor(system, X{}, {.cut_at_all = true});
    Rk4Host<Dip, 2> host(system, 0, system.start());
    ASSERT_EQ(monitor.start(Instant{0}, host.x(), host.rate(), 0.1), Verdict::stands);
    int cuts = 0;
    while (host.t() < 2) {
        const Rk4Host<Dip, 2>::Step step(host, 0.1);
        if (monitor.examine(step) == Verdict::stands) {
            host.accept(step);
            continue;
        }
        ++cuts;
        EXPECT_FALSE(monitor.cut().state_changed);
        EXPECT_NEAR(monitor.cut().t.value, 0.5, 1e-14);
        const X after{0, 3};
        host.restart(monitor.cut().t, after, 0);
        ASSERT_EQ(monitor.resume(after, 0, host.rate(), 0.1), Verdict::stands);
        EXPECT_EQ(monitor.x()[1], 3);
    }
    EXPECT_EQ(cuts, 1);
    EXPECT_GT(host.x()[0], 4);
}

// --- states of other types ---

struct EigenBall {
    static constexpr bool unilateral = true;
    void flow(double, const Eigen::VectorXd& x, Eigen::VectorXd& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.81;
    }
    [[nodiscard]] double guard(double, const Eigen::VectorXd& x) const { return x[0]; }
    void reset(double, Eigen::VectorXd& x) const { x[1] *= -0.9; }
};

TEST(Monitor, TheSystemsStatesAreOfItsOwnType)
{
    const EigenBall system;
    const BouncingBall ball;
    EventMonitor monitor(system, Eigen::VectorXd(2));
    Rk4Host<BouncingBall, 2> host(ball, 0, X{10, 0});
    Verdict verdict = monitor.start(Instant{0}, host.x(), host.rate(), 0.1);
    std::vector<double> times;
    while (host.t() < 20.45) {
        const Rk4Host<BouncingBall, 2>::Step step(host, 0.1);
        verdict = monitor.examine(step);
        if (verdict == Verdict::stands) {
            host.accept(step);
            continue;
        }
        ASSERT_EQ(verdict, Verdict::cut);
        times.push_back(monitor.cut().t.value);
        host.restart(monitor.cut().t, monitor.cut().after, 0);
        ASSERT_EQ(monitor.resume(0.1), Verdict::stands);  // by the system's own flow
    }
    ASSERT_EQ(times.size(), 13u);
    for (std::size_t k = 0; k < times.size(); ++k) {
        EXPECT_NEAR(times[k], ball.impact_time(static_cast<int>(k), 10), 1e-13);
    }
}

// --- backward in time ---

TEST(Monitor, AHostMayRunBackward)
{
    // x = t^2 - 1, from t = 2 down: above its surface until t = 1, and again from t = -1 on.
    struct Parabola {
        static constexpr bool resets() { return false; }
        void flow(double t, const X1&, X1& dxdt) const { dxdt = {2 * t}; }
        [[nodiscard]] double guard(double, const X1& x) const { return x[0]; }
    };
    struct Step {
        double t, length;
        X1 a, b, ra, rb;
        [[nodiscard]] double t0() const { return t; }
        [[nodiscard]] double h() const { return length; }
        [[nodiscard]] std::span<const double> x0() const { return a; }
        [[nodiscard]] std::span<const double> x1() const { return b; }
        [[nodiscard]] std::span<const double> rate0() const { return ra; }
        [[nodiscard]] std::span<const double> rate1() const { return rb; }
        void interpolate(double s, std::span<double> x) const { x[0] = (t - s) * (t - s) - 1; }
    };
    const Parabola system;
    EventMonitor monitor(system, X1{}, {.backward = true});
    ASSERT_EQ(monitor.start(Instant{2}, X1{3}, X1{-4}, 0.25), Verdict::stands);
    for (double t = 2; t > -2; t -= 0.25) {
        const double end = t - 0.25;
        const Step step{t, 0.25, {t * t - 1}, {end * end - 1}, {-2 * t}, {-2 * end}};
        ASSERT_EQ(monitor.examine(step), Verdict::stands);
    }
    ASSERT_EQ(monitor.events().size(), 1u);
    EXPECT_NEAR(monitor.events()[0].t, 1, 1e-14);
    EXPECT_EQ(monitor.t().value, -2);
}

// --- guards that need no evaluation ---

/// A body in a circular arena, whose distance from the wall changes no faster than it moves.
struct Arena {
    mutable int calls = 0;
    static constexpr bool unilateral = true;
    void flow(double, const X4& x, X4& dxdt) const { dxdt = {x[2], x[3], 0, 0}; }
    [[nodiscard]] double guard(double, const X4& x) const
    {
        ++calls;
        return 10 - std::hypot(x[0], x[1]);
    }
    void reset(double, X4& x) const
    {
        const double r = std::hypot(x[0], x[1]);
        const double v = (x[0] * x[2] + x[1] * x[3]) / r;
        x[2] -= 2 * v * x[0] / r;
        x[3] -= 2 * v * x[1] / r;
    }
    [[nodiscard]] double lipschitz() const { return 1; }
    [[nodiscard]] double speed_bound(double, const X4& x) const { return std::hypot(x[2], x[3]); }
    [[nodiscard]] double acceleration_bound(double, const X4&) const { return 0; }
};

TEST(Monitor, BoundsSpareAHostsGuardAndChangeNothing)
{
    const X4 start{1, -2, 0.7, 1.1};
    const Arena watched;
    EventMonitor plain(watched, X4{});
    const auto exact = drive(watched, plain, start, 200, 0.05);
    const Arena spared;
    EventMonitor planned(spared, X4{}, {}, Planned<>{});
    const auto run = drive(spared, planned, start, 200, 0.05);
    ASSERT_GE(exact.cuts.size(), 10u);
    ASSERT_EQ(run.cuts.size(), exact.cuts.size());
    for (std::size_t k = 0; k < run.cuts.size(); ++k) {
        EXPECT_EQ(run.cuts[k].t.value, exact.cuts[k].t.value);
        EXPECT_EQ(run.cuts[k].after, exact.cuts[k].after);
    }
    EXPECT_LT(5 * spared.calls, watched.calls);
    EXPECT_GT(run.statistics.checks_deferred, 3000u);
}

TEST(Monitor, StepsThatNeedNoCheckNeedNotBeShown)
{
    const Arena system;
    EventMonitor monitor(system, X4{}, {}, Planned<>{});
    Rk4Host<Arena, 4> host(system, 0, X4{0, 0, 1, 0});
    ASSERT_EQ(monitor.start(Instant{0}, host.x(), host.rate(), 0.05), Verdict::stands);
    int shown = 0;
    while (host.t() < 29) {
        const Rk4Host<Arena, 4>::Step step(host, 0.05);
        if (step.t0().plus(step.h()) <= monitor.quiet_until()) {
            host.accept(step);
            monitor.skip_to(Instant{host.t()}, host.x(), host.rate());
            continue;
        }
        ++shown;
        const Verdict verdict = monitor.examine(step);
        if (verdict == Verdict::stands) {
            host.accept(step);
        } else {
            ASSERT_EQ(verdict, Verdict::cut);
            host.restart(monitor.cut().t, monitor.cut().after, 0);
            ASSERT_EQ(monitor.resume(host.rate(), 0.05), Verdict::stands);
        }
    }
    ASSERT_EQ(monitor.events().size(), 1u);
    EXPECT_NEAR(monitor.events()[0].t, 10, 1e-13);
    EXPECT_LT(shown, 100);
    EXPECT_THROW(monitor.skip_to(Instant{1e9}, host.x(), host.rate()), std::logic_error);
}

/// A detector whose gate clears a tenth of a second in every state.
Metered<Foreseen<>> metered(MeterOptions::Decision decision)
{
    return Metered(Foreseen<>(test::clearing_gate(0.1)), {.decision = decision});
}

TEST(Monitor, AMeteredGateChangesNothingWhicheverWayIsTaken)
{
    const test::PlasticOscillator system;
    EventMonitor plain(system, X{});
    const auto exact = drive(system, plain, X{1, 0}, 20, 0.05);
    ASSERT_EQ(exact.cuts.size(), 3u);
    const auto expect_same = [&](auto& monitor) {
        const auto run = drive(system, monitor, X{1, 0}, 20, 0.05);
        ASSERT_EQ(run.cuts.size(), exact.cuts.size());
        for (std::size_t k = 0; k < run.cuts.size(); ++k) {
            EXPECT_EQ(run.cuts[k].t.value, exact.cuts[k].t.value);
            EXPECT_EQ(run.cuts[k].after, exact.cuts[k].after);
        }
    };
    EventMonitor planning(system, X{}, {}, metered(MeterOptions::Decision::always));
    expect_same(planning);
    EventMonitor checking(system, X{}, {}, metered(MeterOptions::Decision::every_step));
    expect_same(checking);
    expect_same(checking);  // once more, after a run in which every step was checked
}

/// A point that goes back and forth between two walls.
struct BouncingBox {
    using State = X;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], 0}; }
    double guard(double, const X& x) const { return 1 - std::fabs(x[0]); }
    void reset(double, X& x) const { x[1] = -x[1]; }
    double speed_bound(double, const X& x) const { return std::fabs(x[1]); }
};

TEST(Monitor, ASnapshotOfPlannedStepsIsRestoredWhereEveryStepIsChecked)
{
    const BouncingBox box;
    using Decision = MeterOptions::Decision;
    EventMonitor planning(box, X{}, {}, metered(Decision::always));
    EventMonitor checking(box, X{}, {}, metered(Decision::every_step));
    Rk4Host<BouncingBox, 2> host(box, 0, X{0, 1});
    ASSERT_EQ(planning.start(Instant{0}, host.x(), host.rate(), 0.1), Verdict::stands);
    ASSERT_EQ(checking.start(Instant{0}, host.x(), host.rate(), 0.1), Verdict::stands);
    const auto take_step = [&](auto& monitor) {
        const Rk4Host<BouncingBox, 2>::Step step(host, 0.1);
        const Verdict verdict = monitor.examine(step);
        if (verdict == Verdict::stands) host.accept(step);
        return verdict;
    };
    ASSERT_EQ(take_step(checking), Verdict::stands);
    host.restart(Instant{0}, X{0, 1}, 0);
    for (int k = 0; k < 3; ++k) ASSERT_EQ(take_step(planning), Verdict::stands);
    checking.restore(planning.save());
    int steps = 3;
    for (; take_step(checking) == Verdict::stands; ++steps) ASSERT_LT(steps, 20);
    EXPECT_NEAR(checking.cut().t.value, 1, 1e-14);
}

// --- saving ---

TEST(Monitor, ASnapshotGoesOnWithTheSameBits)
{
    const BouncingBall ball;
    EventMonitor monitor(ball, X{});
    Rk4Host<BouncingBall, 2> host(ball, 0, X{10, 0});
    ASSERT_EQ(monitor.start(Instant{0}, host.x(), host.rate(), 0.1), Verdict::stands);
    EventMonitor other(ball, X{});
    const auto advance = [](auto& of, Rk4Host<BouncingBall, 2>& with) {
        const Rk4Host<BouncingBall, 2>::Step step(with, 0.1);
        if (of.examine(step) == Verdict::stands) return with.accept(step);
        with.restart(of.cut().t, of.cut().after, 0);
        EXPECT_EQ(of.resume(with.rate(), 0.1), Verdict::stands);
    };
    for (int k = 0; k < 60; ++k) advance(monitor, host);
    const Snapshot saved = monitor.save();
    other.restore(snapshot_from_text(to_text(saved)));
    Rk4Host<BouncingBall, 2> twin = host;
    monitor.clear_events();
    for (int k = 0; k < 100; ++k) {
        advance(monitor, host);
        advance(other, twin);
    }
    ASSERT_EQ(monitor.events().size(), other.events().size());
    for (std::size_t k = 0; k < other.events().size(); ++k) {
        EXPECT_EQ(monitor.events()[k].t, other.events()[k].t);
        EXPECT_EQ(monitor.events()[k].after, other.events()[k].after);
    }
    const Balls balls;
    EventMonitor two(balls, X4{});
    EXPECT_THROW(two.restore(saved), std::invalid_argument);
    Snapshot broken = saved;
    broken.numbers[2] = nan;  // of the state
    EXPECT_THROW(other.restore(broken), std::invalid_argument);
    EXPECT_EQ(other.x()[0], host.x()[0]);
}

/// A fall that ends the run at the floor.
struct LastFall {
    using State = X;
    static constexpr bool resets = false;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -1}; }
    double guard(double, const X& x) const { return x[0]; }
    GuardInfo guard_info() const { return {.stop_after = 1}; }
};

TEST(Monitor, NothingIsLeftOfTheRunThatHasEnded)
{
    const LastFall fall;
    EventMonitor monitor(fall, X{});
    Rk4Host<LastFall, 2> host(fall, 0, X{0.005, 0});
    ASSERT_EQ(monitor.start(Instant{0}, host.x(), host.rate(), 0.2), Verdict::stands);
    const Snapshot saved = monitor.save();
    Verdict verdict = monitor.examine(Rk4Host<LastFall, 2>::Step(host, 0.2));
    if (verdict == Verdict::cut) {
        host.restart(monitor.cut().t, monitor.cut().after, 0);
        verdict = monitor.resume(host.rate(), 0.2);
    }
    ASSERT_EQ(verdict, Verdict::ended);
    ASSERT_EQ(monitor.outcome(), Outcome::stopped_by_event);
    ASSERT_EQ(monitor.guard(), 0U);
    monitor.restore(saved);
    EXPECT_EQ(monitor.outcome(), Outcome::reached_end);
    EXPECT_EQ(monitor.guard(), no_guard);
}

// --- misuse by a host ---

struct Shown {
    double t = 0, length = 0.1;
    X a{10, 0}, b{10, -0.1}, ra{0, -1}, rb{0, -1};
    [[nodiscard]] double t0() const { return t; }
    [[nodiscard]] double h() const { return length; }
    [[nodiscard]] std::span<const double> x0() const { return a; }
    [[nodiscard]] std::span<const double> x1() const { return b; }
    [[nodiscard]] std::span<const double> rate0() const { return ra; }
    [[nodiscard]] std::span<const double> rate1() const { return rb; }
    void interpolate(double s, std::span<double> x) const
    {
        HermiteStep(Instant{t}, length, a, b, ra, rb).interpolate(s, x);
    }
};

TEST(MonitorRefusals, HoldsWithoutEnd)
{
    const BouncingBall ball;
    EventMonitor monitor(ball, X{});
    ASSERT_EQ(monitor.start(Instant{1}, X{0, 0}, X{0, -9.81}, 0.1), Verdict::cut);
    ASSERT_EQ(monitor.resume(0.1), Verdict::rests);
    EXPECT_EQ(monitor.must_stop_at(), inf);
    for (const double t : {inf, -inf, nan, 1.0, 0.0}) {
        EXPECT_THROW((void)monitor.hold(t), std::invalid_argument) << t;
    }
    try {
        (void)monitor.hold(0.5);
        FAIL();
    } catch (const std::invalid_argument& refused) {
        EXPECT_STREQ(refused.what(),
                     "EventMonitor: found `hold` to 0.5 s; expected a finite time after 1 s");
    }
    EXPECT_EQ(monitor.hold(2), Verdict::rests);
    EXPECT_EQ(monitor.t().value, 2);
}

TEST(MonitorRefusals, StepsOutOfTurn)
{
    const BouncingBall ball;
    EventMonitor monitor(ball, X{});
    EXPECT_THROW((void)monitor.examine(Shown{}), std::logic_error);  // before `start`
    ASSERT_EQ(monitor.start(Instant{0}, X{10, 0}, X{0, -1}, 0.1), Verdict::stands);
    EXPECT_THROW((void)monitor.resume(0.1), std::logic_error);
    EXPECT_THROW((void)monitor.hold(1), std::logic_error);
    EXPECT_THROW((void)monitor.examine(Shown{.t = 0.1}), std::logic_error);   // a gap
    EXPECT_THROW((void)monitor.examine(Shown{.t = -0.1}), std::logic_error);  // a step back
    EXPECT_THROW((void)monitor.examine(Shown{.a = {9, 0}}), std::logic_error);
    EXPECT_THROW((void)monitor.examine(Shown{.length = 0}), std::invalid_argument);
    EXPECT_THROW((void)monitor.examine(Shown{.length = nan}), std::invalid_argument);
    EXPECT_EQ(refusal([&] {
                  (void)monitor.examine(Shown{.b = {10, nan}});
              }),
              "EventMonitor: x1 must be finite, got nan in component 1");
    // Nothing has changed.
    EXPECT_EQ(monitor.examine(Shown{}), Verdict::stands);
    EXPECT_EQ(monitor.t().value, 0.1);
    // The host forgets to resume.
    const Shown falls{
        .t = 0.1, .a = {10, -0.1}, .b = {-1, -0.2}, .ra = {-110, -1}, .rb = {-110, -1}};
    ASSERT_EQ(monitor.examine(falls), Verdict::cut);
    EXPECT_THROW((void)monitor.examine(falls), std::logic_error);
    EXPECT_THROW((void)monitor.save(), std::logic_error);
    EXPECT_EQ(monitor.resume(0.1), Verdict::stands);
    EXPECT_THROW((void)monitor.resume(0.1), std::logic_error);
}

/// A counter whose functions fail at a call of choice.
struct Failing : Counter {
    mutable int left = -1;
    [[nodiscard]] double guard(std::size_t which, double t, const X& x) const
    {
        if (left >= 0 && left-- == 0) throw std::runtime_error("no value");
        return Counter::guard(which, t, x);
    }
};

TEST(MonitorRefusals, AfterAnExceptionTheGuardsAreArmedAnew)
{
    // If guard 1 were only half armed it would be lost: it has been carried across its surface.
    for (int calls = 0; calls < 4; ++calls) {
        const Failing system;
        EventMonitor monitor(system, X{});
        Rk4Host<Failing, 2> host(system, 0, X{0.5, 0});
        ASSERT_EQ(monitor.start(Instant{0}, host.x(), host.rate(), 1), Verdict::stands);
        ASSERT_EQ(monitor.examine(Rk4Host<Failing, 2>::Step(host, 1)), Verdict::cut);
        host.restart(monitor.cut().t, monitor.cut().after, 0);
        system.left = calls;
        EXPECT_THROW((void)monitor.resume(host.rate(), 1), std::runtime_error) << calls;
        EXPECT_THROW((void)monitor.resume(host.rate(), 1), std::logic_error);
        const Rk4Host<Failing, 2>::Step step(host, 0.25);
        EXPECT_THROW((void)monitor.examine(step), std::logic_error);
        EXPECT_THROW((void)monitor.save(), std::logic_error);
        ASSERT_EQ(monitor.start(Instant{0}, X{0, 0}, X{1, 0}, 1), Verdict::stands);
        system.left = 0;
        const Rk4Host<Failing, 2> fresh(system, 0, X{0, 0});
        const Rk4Host<Failing, 2>::Step first(fresh, 0.25);
        EXPECT_THROW((void)monitor.examine(first), std::runtime_error);
        EXPECT_THROW((void)monitor.examine(first), std::logic_error);
    }
}

/// A step whose map is broken: its states inside are infinite.
template <bool by_restep>
struct BrokenStep {
    X x0_{0.5, 0}, x1_{-0.5, 0}, rate_{-1, 0};
    [[nodiscard]] Instant t0() const { return {0}; }
    [[nodiscard]] double h() const { return 1; }
    [[nodiscard]] std::span<const double> x0() const { return x0_; }
    [[nodiscard]] std::span<const double> x1() const { return x1_; }
    [[nodiscard]] std::span<const double> rate0() const { return rate_; }
    [[nodiscard]] std::span<const double> rate1() const { return rate_; }
    void interpolate(double s, std::span<double> x) const
    {
        x[0] = by_restep ? 0.5 - s : std::numeric_limits<double>::infinity();
        x[1] = 0;
    }
    void restep(double /*s*/, std::span<double> x) const requires by_restep
    {
        x[0] = std::numeric_limits<double>::infinity();
        x[1] = 0;
    }
};

TEST(MonitorRefusals, StatesInsideAStepThatAreNotFinite)
{
    // Treated as values far above the surface, they would place the event at the end of the step.
    const auto examined = [](const auto& step) {
        const BouncingBall ball;
        EventMonitor monitor(ball, X{});
        EXPECT_EQ(monitor.start(step.t0(), step.x0_, step.rate_, 1), Verdict::stands);
        return monitor.examine(step);
    };
    EXPECT_THROW((void)examined(BrokenStep<true>{}), std::domain_error);
    EXPECT_THROW((void)examined(BrokenStep<false>{}), std::domain_error);
}

TEST(MonitorRefusals, ASkipThatGoesNowhere)
{
    const BouncingBall ball;
    EventMonitor monitor(ball, X{});
    ASSERT_EQ(monitor.start(Instant{0}, X{10, 0}, X{0, -1}, 0.1), Verdict::stands);
    EXPECT_THROW(monitor.skip_to(Instant{0}, X{-3, 0}, X{0, -1}), std::logic_error);
    EXPECT_THROW(monitor.skip_to(Instant{0}, X{nan, 0}, X{0, -1}), std::invalid_argument);
    EXPECT_EQ(monitor.x()[0], 10);
}

TEST(MonitorRefusals, SnapshotsThatWouldLoseTheNextTimeEvent)
{
    const Clock system;
    EventMonitor monitor(system, X{});
    ASSERT_EQ(monitor.start(Instant{0.5}, X{0, 0}, X{0, 0}, 0.1), Verdict::stands);
    const Snapshot saved = monitor.save();
    for (const double wrong : {nan, 0.25, -inf}) {
        Snapshot broken = saved;
        broken.numbers[9] = wrong;  // after the time, three states of two components and the scale
        EXPECT_THROW(monitor.restore(broken), std::invalid_argument) << wrong;
        EXPECT_EQ(monitor.must_stop_at(), 1);
    }
}

TEST(MonitorRefusals, AMessageSaysWhatWasFoundAndExpected)
{
    const BouncingBall ball;
    EventMonitor monitor(ball, X{});
    ASSERT_EQ(monitor.start(Instant{0}, X{10, 0}, X{0, -1}, 0.1), Verdict::stands);
    try {
        (void)monitor.examine(Shown{.t = 0.5});
        FAIL();
    } catch (const std::logic_error& error) {
        EXPECT_NE(std::string(error.what()).find("0.5"), std::string::npos) << error.what();
        EXPECT_NE(std::string(error.what()).find("expected"), std::string::npos) << error.what();
    }
}

TEST(MonitorRefusals, BeyondATimeEvent)
{
    const Clock system;
    EventMonitor monitor(system, X{});
    ASSERT_EQ(monitor.start(Instant{0.95}, X{0, 0}, X{0, 0}, 0.1), Verdict::stands);
    EXPECT_EQ(monitor.must_stop_at(), 1);
    const Shown step{.t = 0.95, .a = {0, 0}, .b = {0, 0}, .ra = {0, 0}, .rb = {0, 0}};
    EXPECT_THROW((void)monitor.examine(step), std::logic_error);
    Shown shorter = step;
    shorter.length = 1 - 0.95;
    EXPECT_EQ(monitor.examine(shorter), Verdict::cut);
    EXPECT_TRUE(monitor.cut().on_time);
}

TEST(MonitorRefusals, StartsAndArraysThatAreNone)
{
    const BouncingBall ball;
    EventMonitor monitor(ball, X{});
    const std::vector<double> three(3);
    EXPECT_THROW(monitor.start(Instant{0}, three, X{}, 0.1), std::invalid_argument);
    EXPECT_THROW(monitor.start(Instant{0}, X{1, 0}, three, 0.1), std::invalid_argument);
    EXPECT_THROW(monitor.start(Instant{nan}, X{1, 0}, X{}, 0.1), std::invalid_argument);
    EXPECT_THROW(monitor.start(Instant{0}, X{nan, 0}, X{}, 0.1), std::invalid_argument);
    EXPECT_EQ(refusal([&] {
                  monitor.start(Instant{0}, X{-1, 0}, X{}, 0.1);
              }),
              "EventMonitor: the start lies behind guard 0, which bounds the motion: expected "
              "guard >= 0 at t = 0, got -1");
    EXPECT_THROW(monitor.start(Instant{0}, X{1, 0}, X{}, 0), std::invalid_argument);
    EXPECT_THROW(monitor.start(Instant{0}, X{1, 0}, X{}, inf), std::invalid_argument);
    EXPECT_EQ(refusal([&] {
                  monitor.start(Instant{0}, X{1, 0}, X{}, 0.1, 1);
              }),
              "EventMonitor: mode must be 0, the only one of the system, got 1");
    EXPECT_THROW((void)monitor.side(1), std::out_of_range);
    EXPECT_EQ(refusal([&] { (void)EventMonitor(ball, X{}, {.event_tolerance = -1}); }),
              "EventMonitor: event_tolerance must be zero or positive, and finite, got -1");
    struct Empty {
        void flow(double, const X1&, X1& dxdt) const { dxdt = {0}; }
    };
    const Empty empty;
    EXPECT_THROW((void)EventMonitor(empty, X1{}), std::invalid_argument);
}

TEST(MonitorRefusals, AGuardThatIsNoNumberEndsTheRun)
{
    struct Root {
        static constexpr bool resets() { return false; }
        void flow(double, const X1&, X1& dxdt) const { dxdt = {-1}; }
        [[nodiscard]] double guard(double, const X1& x) const { return std::sqrt(x[0]) + 1; }
    };
    const Root system;
    EventMonitor monitor(system, X1{});
    const auto run = drive(system, monitor, X1{1}, 2, 0.3);
    EXPECT_EQ(run.verdict, Verdict::ended);
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    EXPECT_NEAR(run.t, 0.9, 1e-12);  // the end of the last good step
    EXPECT_NEAR(run.x[0], 0.1, 1e-12);
}

// --- cost ---

TEST(Monitor, NothingIsAllocatedFromStepToStep)
{
    const BouncingBall ball;
    EventMonitor monitor(ball, X{}, {.record_events = false});
    Rk4Host<BouncingBall, 2> host(ball, 0, X{10, 0});
    const auto before = testing_support::allocations();
    ASSERT_EQ(monitor.start(Instant{0}, host.x(), host.rate(), 0.1), Verdict::stands);
    int cuts = 0;
    while (host.t() < 20.45) {
        const Rk4Host<BouncingBall, 2>::Step step(host, 0.1);
        if (monitor.examine(step) == Verdict::stands) {
            host.accept(step);
            continue;
        }
        ++cuts;
        host.restart(monitor.cut().t, monitor.cut().after, 0);
        ASSERT_EQ(monitor.resume(host.rate(), 0.1), Verdict::stands);
    }
    EXPECT_EQ(testing_support::allocations() - before, 0u);
    EXPECT_EQ(cuts, 13);
}

}  // namespace
}  // namespace ricochet::monitor_test
