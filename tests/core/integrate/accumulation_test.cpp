// Impacts that accumulate: no reset is dropped, and no guard flutters forever.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <span>
#include <string>

#include "accumulating_systems.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::accumulation_test {
namespace {

using test::BallOnFloor;
using test::fault_of;
using test::LiftedBall;
using test::RestingBall;
using X = BallOnFloor::State;

TEST(Accumulation, OfThreeThousandRandomBallsNoneFallsThroughItsFloorOrFlutters)
{
    std::map<std::string, int> faults;
    for (std::uint32_t seed = 1; seed <= 3000; ++seed) {
        const std::string fault = fault_of(seed);
        if (!fault.empty()) ++faults[fault + ", seed " + std::to_string(seed)];
    }
    for (const auto& [fault, count] : faults) ADD_FAILURE() << fault;
}

TEST(Accumulation, AReboundTooSlowToBeToldIsARebound)
{
    // Restitution 0.07 on a vibrating floor: the third interval is the last that time resolves,
    // and a difference quotient does not determine the direction of the ball after it.
    EXPECT_EQ(fault_of(70164), "");
}

/// A drop falls from rest; when it lands the next one starts from rest, at the height h.
struct DrippingTap {
    double height = 1;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -10}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    void reset(double, X& x) const { x = {height, 0}; }
    void rest(double, X& x) const { x = {-1, 0}; }
};

/// A timer whose guard is flat, or saturated, at the place where its reset puts it.
struct SaturatedTimer {
    double largest = 1;
    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(double, const X& x) const
    {
        return std::min(0.0625 - x[0] * x[0], largest);
    }
    void reset(double, X& x) const { x[0] = 0; }
};

TEST(Accumulation, AResetThatLiftsAGuardOffItsSurfaceIsNoReboundHoweverItStarts)
{
    // One drop every sqrt(0.2) s, all with a rate of zero at their start.
    const auto drops = integrate(DrippingTap{}, X{1, 0}, {.t_end = 10});
    EXPECT_EQ(drops.outcome, Outcome::reached_end);
    EXPECT_EQ(drops.events.size(), 22u);
    for (const double largest : {1.0, 0.05, 0.001}) {
        const auto ticks = integrate(SaturatedTimer{largest}, X{0, 0}, {.t_end = 5.1});
        EXPECT_EQ(ticks.outcome, Outcome::reached_end) << largest;
        EXPECT_EQ(ticks.events.size(), 20u) << largest;
    }
}

/// A ball whose reset puts it back on a high floor.
struct BallOnHighFloor {
    double floor = 0;
    double restitution = 0.9;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0] - floor; }
    void reset(double, X& x) const { x = {floor, -restitution * x[1]}; }
};

/// Once per second guard 0 lifts the second component over the surface of guard 1, whose reset puts
/// it back. Between these events the second component stands still.
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

TEST(Accumulation, AGuardThatAnotherResetCarriesAcrossOncePerSecondDoesNotAccumulate)
{
    const Counter system;
    const auto run = integrate(system, X{0, 0}, {.t_end = 20.5});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 40u);
}

TEST(Accumulation, ImpactsThatAreLocatedLateDoNotFlutter)
{
    // Each impact is late by up to the tolerance and put back on the floor: the intervals stop
    // shrinking where the added energy balances the loss.
    for (const double floor : {1e4, 1e5, -1e6}) {
        for (const double tolerance : {1e-5, 1e-4, 1e-3}) {
            for (const double e : {0.5, 0.8, 0.95}) {
                const auto run = integrate(BallOnHighFloor{floor, e}, X{floor + 2, 0},
                                           {.t_end = 60, .event_tolerance = tolerance});
                const double fall = std::sqrt(2 * 2 / 9.81);
                const double limit = fall * (1 + e) / (1 - e);
                EXPECT_EQ(run.outcome, Outcome::zeno) << floor << ' ' << tolerance << ' ' << e;
                EXPECT_LT(run.events.size(), 300u);
                EXPECT_NEAR(run.t, limit, 0.02 * limit + 20 * tolerance);
            }
        }
    }
}

TEST(Accumulation, ABallThatDeclaresNothingEndsInsteadOfFalling)
{
    // Regression: for a guard that is not unilateral, a repeat was suppressed with its reset.
    for (const double tolerance : {0.0, 1e-9, 1e-6, 1e-3}) {
        const BallOnFloor ball{};
        const auto run = integrate(ball, X{1, 0}, {.t_end = 20, .event_tolerance = tolerance});
        EXPECT_EQ(run.outcome, Outcome::zeno) << tolerance;
        EXPECT_GE(run.x[0], -20 * tolerance - 1e-12) << tolerance;
        EXPECT_EQ(run.statistics.suppressed, 0u) << tolerance;
    }
}

/// The clock's reset sets it back by a rounding, after which it runs on across the surface.
struct Nudged {
    void flow(double, const std::array<double, 1>&, std::array<double, 1>& dxdt) const
    {
        dxdt = {1};
    }
    [[nodiscard]] double guard(double, const std::array<double, 1>& x) const { return 1 - x[0]; }
    void reset(double, std::array<double, 1>& x) const { x[0] -= 3e-16; }
};

TEST(Accumulation, TheSameCrossingSeenAgainIsStillOneEvent)
{
    const auto run = integrate(Nudged{}, std::array<double, 1>{0}, {.t_end = 2});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 1u);
}

TEST(Accumulation, RestHoldsOnlyOnAFloorThatStaysWhereItIs)
{
    // Without a mode of rest the state stands still, which is wrong on a moving floor.
    const RestingBall moving{{.floor = {.velocity = 0.5, .restitution = 0.5}}};
    EXPECT_EQ(integrate(moving, X{1, 0}, {.t_end = 20}).outcome, Outcome::zeno);
    const RestingBall fixed{{.floor = {.height = 1000, .restitution = 0.5}}};
    const auto run = integrate(fixed, X{1001, 0}, {.t_end = 20});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x, (X{1000, 0}));
}

TEST(Accumulation, ABallAtRestIsLiftedOffByAVibratingFloor)
{
    // The floor's acceleration exceeds that of gravity in a part of every period: the ball
    // rests and is thrown once in each, with a few dozen impacts.
    const LiftedBall ball{.floor = {.amplitude = 0.011, .frequency = 33.8, .restitution = 0.2}};
    const double period = 2 * 3.141592653589793 / 33.8;
    const auto run = integrate(ball, X{1, 0}, {.t_end = 1 + 20 * period});
    std::size_t rests = 0;
    for (const auto& event : run.events) rests += event.kind == EventKind::accumulation;
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GE(rests, 15u);
    EXPECT_LE(run.statistics.events, 40 * rests);
}

/// Sticks and slips in turn, at intervals that are equal except for rounding.
struct Relay {
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const { return which == mode; }
    void flow(Mode mode, double, const X&, X& dxdt) const { dxdt = {mode == 0 ? 1.0 : -1.0, 1}; }
    [[nodiscard]] double guard(std::size_t which, Mode, double, const X& x) const
    {
        return which == 0 ? 1 - x[0] : x[0];
    }
    Mode reset(std::size_t, Mode mode, double, X&) const { return 1 - mode; }
};

TEST(Accumulation, IntervalsThatShrinkByRoundingDoNotAccumulate)
{
    const auto run = integrate(Relay{}, X{0.3, 0}, {.t_end = 100});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 100u);
}

/// Falls onto v^2 at the rate 1, and each reset lowers that: the k-th jump is (1 - r^2) r^(2k) v^2,
/// after which the motion falls as before. All of them end when y reaches 0.
struct SinkingStair {
    double ratio = 0.9;
    double origin = 0;
    void flow(double, const X&, X& dxdt) const { dxdt = {-1, 0}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0] - origin - x[1] * x[1]; }
    void reset(double, X& x) const { x[1] *= -ratio; }
};

TEST(Accumulation, OfJumpsEndsWhereRoundingHidesThem)
{
    for (int k = 0; k < 400; ++k) {
        const SinkingStair stair{.ratio = 0.2 + 0.00175 * k, .origin = k % 4 * 0.37};
        const double y = 1.1 + 0.013 * k;
        const auto run = integrate(stair, X{stair.origin + y, 1}, {.t_end = 2 * y});
        EXPECT_EQ(run.outcome, Outcome::zeno) << k;
        // The jump that is lost, and what falls after it, is of the order of the rounding.
        EXPECT_NEAR(run.t, y, 1e-12) << k;
    }
}

/// Falls at the rate 1, and each reset lifts it by 0.3 of the last lift less 1e-4: to 0.2999,
/// 0.08987 and so on, at the eighth event to -7.7e-5, from where it falls on.
struct EndingStair {
    void flow(double, const X&, X& dxdt) const { dxdt = {-1, 0}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    void reset(double, X& x) const { x[0] = x[1] = 0.3 * x[1] - 1e-4; }
};

TEST(Accumulation, JumpsThatEndBeyondTheSurfaceDoNot)
{
    const auto run = integrate(EndingStair{}, X{1, 1}, {.t_end = 5});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 8u);
}

/// Two equal balls on a moving floor, on which they come to rest; one bit of the mode for each.
struct PairOnMovingFloor {
    using State = std::array<double, 4>;
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 4;
    double restitution = 0.5;
    double speed = 0;               // of the floor
    std::array<double, 2> floor{};  // at the start

    [[nodiscard]] double floor_at(std::size_t i, double t) const { return floor[i] + speed * t; }
    [[nodiscard]] bool enabled(std::size_t i, Mode mode) const { return (mode >> i & 1) == 0; }
    void flow(Mode mode, double, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < 2; ++i) {
            dxdt[2 * i] = enabled(i, mode) ? x[2 * i + 1] : speed;
            dxdt[2 * i + 1] = enabled(i, mode) ? -9.81 : 0;
        }
    }
    [[nodiscard]] double guard(std::size_t i, Mode, double t, const State& x) const
    {
        return x[2 * i] - floor_at(i, t);
    }
    Mode reset(std::size_t i, Mode mode, double t, State& x) const
    {
        x[2 * i] = floor_at(i, t);
        x[2 * i + 1] = speed - restitution * (x[2 * i + 1] - speed);
        return mode;
    }
    Mode rest(std::size_t i, Mode mode, double t, State& x) const
    {
        x[2 * i] = floor_at(i, t);
        x[2 * i + 1] = speed;
        return mode | Mode(1) << i;
    }
    [[nodiscard]] static GuardInfo guard_info(std::size_t)
    {
        GuardInfo info;
        info.unilateral = true;
        return info;
    }
};

TEST(Accumulation, BodiesThatComeToRestTogetherOnAMovingFloor)
{
    // The limit of the first lies beyond its last impact by the rounding of a flight,
    // in which the floor would pass the second, or leave it.
    for (const double speed : {0.161, -0.292}) {
        for (const double floor : {0.0, 37.2}) {
            const PairOnMovingFloor pair{
                .restitution = 0.6, .speed = speed, .floor = {floor, floor}};
            const auto run = integrate(
                pair, PairOnMovingFloor::State{floor + 1, speed, floor + 1, speed}, {.t_end = 3});
            ASSERT_EQ(run.outcome, Outcome::reached_end) << speed << " " << floor;
            // t0 + 2 t0 e / (1 - e), and the errors of locating so many impacts.
            const double fall = std::sqrt(2 / 9.81);
            const double limit = fall * (1 + 2 * 0.6 / 0.4);
            int rests = 0;
            for (const auto& event : run.events) {
                if (event.kind != EventKind::accumulation) continue;
                ++rests;
                EXPECT_NEAR(event.t, limit, event.error + 1e-8);
            }
            EXPECT_EQ(rests, 2);
        }
    }
}

TEST(Accumulation, NoBodyFallsThroughWhereAnotherRebounds)
{
    // Thrown up together from two floors, so that impacts coincide except for rounding: at one of
    // the first the second is a unit in the last place below its floor.
    const PairOnMovingFloor pair{.restitution = 0.61225596540089211,
                                 .speed = 0.27965981389702688,
                                 .floor = {-0.16113326978938503, 1.3236337156829157}};
    const double v = 1.8272878172954812 + pair.speed;
    const auto run = integrate(pair, PairOnMovingFloor::State{pair.floor[0], v, pair.floor[1], v},
                               {.t_end = 1.25});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.mode, 3U);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_NEAR(run.x[2 * i], pair.floor_at(i, run.t), 1e-12) << i;
    }
}

/// Balls above floors that move together, side by side; one mode for each set of those at rest.
struct BallsSideBySide {
    using State = std::array<double, 4>;
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 4;
    static constexpr double gravity = 9.81;
    double restitution;
    std::array<double, 2> height;  ///< [m] of the floors at t = 0
    double speed;                  ///< [m/s] of the floors, upward

    [[nodiscard]] double floor(std::size_t i, double t) const { return height[i] + speed * t; }
    void flow(Mode mode, double, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < 2; ++i) {
            const bool rests = (mode >> i & 1) != 0;
            dxdt[2 * i] = rests ? speed : x[2 * i + 1];
            dxdt[2 * i + 1] = rests ? 0 : -gravity;
        }
    }
    [[nodiscard]] double guard(std::size_t i, Mode, double t, const State& x) const
    {
        return x[2 * i] - floor(i, t);
    }
    [[nodiscard]] bool enabled(std::size_t i, Mode mode) const { return (mode >> i & 1) == 0; }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.unilateral = true}; }
    Mode reset(std::size_t i, Mode mode, double t, State& x) const
    {
        x[2 * i] = floor(i, t);
        x[2 * i + 1] = speed - restitution * (x[2 * i + 1] - speed);
        return mode;
    }
    Mode rest(std::size_t i, Mode mode, double t, State& x) const
    {
        x[2 * i] = floor(i, t);
        x[2 * i + 1] = speed;
        return mode | (Mode(1) << i);
    }
};

TEST(Accumulation, OfBallsThatBounceTogetherIsThatOfEach)
{
    // Equal except for rounding: in a step of a few 1e-14 s one ball has its impact, and the sign
    // of the other's guard, after its own impact, is decided by rounding.
    for (int k = 0; k < 300; ++k) {
        const double u = std::fmod(0.618033988749895 * k, 1.0);
        const double w = std::fmod(0.754877666246693 * k, 1.0);
        const BallsSideBySide balls{.restitution = 0.05 + 0.7 * u,
                                    .height = {0, 3 * w - 1.5},
                                    .speed = k % 3 == 0 ? 0 : w - 0.5};
        const double v = 0.5 + 3 * w;
        const double limit = 2 * v / balls.gravity / (1 - balls.restitution);
        const auto run = integrate(balls, {0, balls.speed + v, balls.height[1], balls.speed + v},
                                   {.t_end = 1.5 * limit});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        int rests = 0;
        for (const auto& event : run.events) {
            if (event.kind != EventKind::accumulation) continue;
            ++rests;
            // 1e-12: of the closed form, and of some 50 times that are sums of flights.
            EXPECT_NEAR(event.t, limit, event.error + 1e-12) << k;
        }
        EXPECT_EQ(rests, 2) << k;
    }
}

/// A guard that is not a number beyond its surface, where neither its reset nor its rest turns the
/// motion back, beside another guard.
struct Pressed {
    using State = std::array<double, 1>;
    static constexpr std::size_t guard_count = 2;

    void flow(double t, const State& x, State& dxdt) const
    {
        dxdt[0] = -1.1 - std::sin(t + x[0]) / 2;
    }
    [[nodiscard]] double guard(std::size_t which, double, const State& x) const
    {
        return which == 0 ? std::sqrt(x[0]) : x[0] + 100;
    }
    [[nodiscard]] double guard_rate(std::size_t which, double, const State& x,
                                    const State& dxdt) const
    {
        return which == 0 ? dxdt[0] / (2 * std::sqrt(x[0])) : dxdt[0];
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.crossing = Crossing::either}; }
    void reset(std::size_t, double, State&) const {}
    void rest(std::size_t, double, State&) const {}
};

TEST(Accumulation, ARestThatLeavesTheMotionPressingOnTheEndOfAGuardEndsTheRun)
{
    for (const double start : {0.25, 0.5, 0.75, 1.0}) {
        const Pressed pressed;
        Simulation simulation(pressed, Pressed::State{start}, {.t_end = 2});
        while (!simulation.ended() && simulation.run().events.size() < 10'000) simulation.step();
        ASSERT_TRUE(simulation.ended()) << start;
        EXPECT_EQ(simulation.run().outcome, Outcome::zeno) << start;
        EXPECT_EQ(simulation.run().guard, 0u) << start;
    }
}

/// A ball on a high floor, below a mark, whose rates come from one call.
struct HighFloor {
    static constexpr std::size_t guard_count = 2;
    double floor = 1000;

    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    void guards(double, const X& x, std::span<double> g) const
    {
        g[0] = x[0] - floor;
        g[1] = floor + 50 - x[0];
    }
    void guard_rates(double, const X&, const X& dxdt, std::span<double> rates) const
    {
        rates[0] = dxdt[0];
        rates[1] = -dxdt[0];
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.resets = which == 0, .unilateral = which == 0};
    }
    void reset(std::size_t, double, X& x) const { x = {floor, -0.5 * x[1]}; }
};

/// The same with a call for each rate.
struct HighFloorByParts : HighFloor {
    [[nodiscard]] double guard_rate(std::size_t which, double, const X&, const X& dxdt) const
    {
        return which == 0 ? dxdt[0] : -dxdt[0];
    }
};

TEST(Accumulation, RatesFromOneCallAreThoseFromACallForEach)
{
    for (const double floor : {0.0, 10.0, 1e3, 1e5}) {
        const X start{floor + 3, 0};
        const Options options{.t_end = 5, .max_steps = 5000};
        const auto together = integrate(HighFloor{floor}, start, options);
        const auto apart = integrate(HighFloorByParts{{floor}}, start, options);
        ASSERT_EQ(together.outcome, Outcome::zeno) << floor;
        EXPECT_NEAR(together.t, 3 * std::sqrt(6 / 9.81), 1e-4) << floor;
        EXPECT_EQ(together.t, apart.t) << floor;
        EXPECT_EQ(together.x, apart.x) << floor;
        EXPECT_EQ(together.events.size(), apart.events.size()) << floor;
        EXPECT_EQ(together.statistics.guard_calls, apart.statistics.guard_calls) << floor;
    }
}

}  // namespace
}  // namespace ricochet::accumulation_test
