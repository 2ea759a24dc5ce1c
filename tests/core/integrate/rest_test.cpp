// Where events accumulate, and where they only follow each other fast.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <string>

#include "random_cycles.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"

namespace ricochet::rest_test {
namespace {

using test::Cycle;
using test::CycleCase;
using test::RandomCycles;

/// Expects the limit of the case by several methods and locators; those of fixed steps are exact
/// for motions with constant accelerations alone.
void expect_limit(const CycleCase& of, const std::string& label, bool polynomial = true)
{
    EXPECT_EQ(test::fault_of(of, ErrorControlled<Dopri5>{}), "") << label;
    EXPECT_EQ(test::fault_of(of, ErrorControlled<Fehlberg78>{}), "") << label;
    if (polynomial) {
        EXPECT_EQ(test::fault_of(of, FixedStep<Rk4>{}, 0.0173), "") << label;
    }
    const Options options{.t_end = 2 * of.limit + 1, .rtol = 1e-12, .atol = 1e-14};
    const auto by = [&](const auto& detector, const auto& locator) {
        return integrate(of.system, of.start, options, ErrorControlled<Dopri5>{}, detector,
                         locator);
    };
    EXPECT_EQ(test::fault_of(of, by(Extremum{}, Bisection{})), "") << label;
    EXPECT_EQ(test::fault_of(of, by(Extremum{}, Toms748{})), "") << label;
    EXPECT_EQ(test::fault_of(of, by(Ends{}, Newton{})), "") << label;
}

TEST(Limits, OfASaddleWhoseStateIsTurnedRound)
{
    // x'' = x from (0.1, 0), guards 1 - x and 1 + x: x -> -x, v -> 0.7 v. In closed form, since
    // an excursion at the speed v takes 2 atanh v.
    for (const bool disables : {false, true}) {
        CycleCase saddle = RandomCycles::saddle(1, 0.1, 0.7, disables);
        EXPECT_NEAR(saddle.limit, 8.09774537063384, 1e-12);
        expect_limit(saddle, "saddle", false);

        // Without a rest the run ends there, and names both guards.
        const Cycle open = saddle.system;
        const auto run = integrate(open, saddle.start, {.t_end = 20, .rtol = 1e-12});
        EXPECT_EQ(run.outcome, Outcome::zeno);
        EXPECT_NEAR(run.t, saddle.limit, 1e-6);
        EXPECT_EQ(run.guard + run.other_guard, 1U) << "one is 0, one is 1";
        EXPECT_LT(run.events.size(), 100U);
    }
}

TEST(Limits, OfTwoTanksAtAnyLevel)
{
    for (const double level : {0.0, 1.0, 20.0, 100.0, 1e6}) {
        for (const bool moded : {false, true}) {
            const CycleCase tanks =
                RandomCycles::tanks({level, level}, {2, 3}, 4, {level + 1, level + 1}, moded);
            EXPECT_EQ(tanks.limit, 2);
            expect_limit(tanks, std::to_string(level));
        }
    }
}

TEST(Limits, OfABlockThatRocksOnItsCorners)
{
    // x'' = x - p on the right corner and x + p on the left: p - |x| grows from p as cosh, so that
    // a half turn at the speed v takes 2 atanh(v / p). `offset` moves the guards to where they
    // have a rounding.
    for (const double offset : {0.0, 1.0, 100.0}) {
        constexpr double p = 0.3, r = 0.8, v0 = 0.2;
        CycleCase block;
        block.system.f = [=](Mode left, const auto& x, auto& dxdt) {
            const double tilt = x[0] - offset;
            dxdt = {x[1], left == 1 ? tilt + p : tilt - p, 0, 0};
        };
        block.system.g = [=](std::size_t i, Mode, const auto& x) {
            return i == 0 ? x[0] - offset : offset - x[0];
        };
        block.system.on = [](std::size_t i, Mode left) { return i == left; };
        block.system.r = [](std::size_t i, Mode, auto& x) -> Mode {
            x[1] *= r;
            return static_cast<Mode>(1 - i);
        };
        block.start = {offset, v0, 0, 0};
        for (double v = v0; v > 1e-30; v *= r) block.limit += 2 * std::atanh(v / p);
        block.slack = 1e-9 * block.limit;
        expect_limit(block, std::to_string(offset), false);
    }
}

TEST(Limits, OfARimlessWheelOnASlope)
{
    // Angle from the vertical of the spoke that stands, x'' = sin x; on the next one it stands
    // at the other end of the angle between two spokes, with the cosine of that angle of its speed.
    constexpr double slope = 0.05, half = 0.3;
    const double part = std::cos(2 * half);
    // An excursion from the angle a at the speed v: 2 cos(a - d) = 2 cos a + v^2 gives the place of
    // its turn, and with a - d + d u^2 for the angle the integrand is smooth.
    const auto excursion = [](double a, double v) {
        double d = 0;
        for (int k = 0; k < 50; ++k) d = 2 * std::asin(v * v / (4 * std::sin(a - d / 2)));
        constexpr int n = 5000;
        double sum = 0;
        for (int k = 0; k < n; ++k) {  // the midpoint rule
            const double u = (k + 0.5) / n;
            const double s = std::sin(a - d + d * u * u / 2) * std::sin(d * u * u / 2);
            sum += 2 * d * u / (2 * std::sqrt(s));
        }
        return 2 * sum / n;
    };
    CycleCase wheel;
    wheel.system.f = [](Mode, const auto& x, auto& dxdt) { dxdt = {x[1], std::sin(x[0]), 0, 0}; };
    wheel.system.g = [=](std::size_t i, Mode, const auto& x) {
        return i == 0 ? slope + half - x[0] : x[0] - (slope - half);
    };
    wheel.system.r = [=](std::size_t i, Mode mode, auto& x) {
        x[0] = i == 0 ? slope - half : slope + half;
        x[1] *= part;
        return mode;
    };
    wheel.start = {slope - half, 0.15, 0, 0};
    double v = 0.15;
    for (int k = 0; v > 1e-30; ++k, v *= part) {
        wheel.limit += excursion(k % 2 == 0 ? half - slope : half + slope, v);
    }
    wheel.slack = 1e-7 * wheel.limit;  // of the midpoint rule, whose error is of the order 1 / n^2
    expect_limit(wheel, "wheel", false);
}

TEST(Limits, OfAThousandRandomCyclesAreWithinTheirErrors)
{
    std::map<std::string, int> faults;
    for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
        const CycleCase cycle = RandomCycles(seed).any();
        const std::string fault = test::fault_of(cycle, ErrorControlled<Dopri5>{});
        if (!fault.empty()) ++faults[fault + ", seed " + std::to_string(seed)];
    }
    for (const auto& [fault, count] : faults) ADD_FAILURE() << fault;
}

TEST(Limits, OfCyclesWhoseCoarsestGuardHidesItsFlights)
{
    // Cycles over places near 0 and far from it. At the far ones the last flights are shorter than
    // a double shows, and happen at the instant of the event before; or their rounding throws the
    // motion back at each round, so that it would go on for ever (the first five).
    for (const std::uint64_t seed : {24690, 30072, 30666, 41139, 97422, 37293, 16854, 42336, 23526,
                                     20121, 55644, 82020, 12645, 48831}) {
        const CycleCase cycle = RandomCycles(seed).any();
        EXPECT_EQ(test::fault_of(cycle, ErrorControlled<Fehlberg78>{}), "") << seed;
        EXPECT_EQ(test::fault_of(cycle, ErrorControlled<Dopri5>{}), "") << seed;
    }
}

TEST(Limits, OfCyclesThatLoseTheirLastFlightsToTheRoundingOfTheirPlaces)
{
    // The last flights are cut short by rounding, or lost; the first five have one guard for all
    // places, of which each has its own rounding.
    for (const std::uint64_t seed :
         {9864, 14593, 34398, 54630, 62544, 17415, 25704, 59154, 91497}) {
        const CycleCase cycle = RandomCycles(seed).any();
        EXPECT_EQ(test::fault_of(cycle, ErrorControlled<Fehlberg78>{}), "") << seed;
        EXPECT_EQ(test::fault_of(cycle, ErrorControlled<Dopri5>{}), "") << seed;
    }
}

TEST(Limits, AreNotSeenInClocksThatStrikeAlmostTogether)
{
    EXPECT_TRUE(test::clocks_run({0, 11, 17, 20, 21, 22}));
    std::mt19937 random(4);
    for (int k = 0; k < 300; ++k) {
        std::array<int, 6> late{};
        for (int& units : late) units = std::uniform_int_distribution<>(0, 60)(random);
        EXPECT_TRUE(test::clocks_run(late)) << k;
    }
}

/// Strikes each time that x reaches `period`; after `fast` times once a second.
struct Burst {
    using State = std::array<double, 2>;
    double period = 1e-9;
    double fast = 1e300;
    std::uint32_t most = 20'000;
    void flow(double, const State&, State& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(double, const State& x) const { return period - x[0]; }
    void reset(double, State& x) const { x = {x[1] < fast ? 0 : period - 1, x[1] + 1}; }
    [[nodiscard]] GuardInfo guard_info() const { return {.stop_after = most}; }
};

/// Relay with hysteresis around zero.
struct Relay {
    using State = std::array<double, 1>;
    static constexpr std::size_t guard_count = 2, mode_count = 2;
    double width = 1e-12;
    void flow(Mode up, double, const State&, State& dxdt) const { dxdt[0] = up == 1 ? 1 : -1; }
    [[nodiscard]] double guard(std::size_t i, Mode, double, const State& x) const
    {
        return i == 0 ? x[0] + width / 2 : width / 2 - x[0];
    }
    [[nodiscard]] bool enabled(std::size_t i, Mode up) const { return i == up; }
    Mode reset(std::size_t i, Mode, double, State&) const { return i == 0 ? 1 : 0; }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.stop_after = 1500}; }
};

/// Counts the turns of sin(w t) in its state.
struct Turns {
    using State = std::array<double, 1>;
    void flow(double, const State&, State& dxdt) const { dxdt[0] = 0; }
    [[nodiscard]] double guard(double t, const State&) const { return std::sin(1e9 * t); }
    void reset(double, State& x) const { x[0] += 1; }
    [[nodiscard]] GuardInfo guard_info() const { return {.stop_after = 20'000}; }
};

TEST(Limits, AreNotSeenInFastBursts)
{
    // Pulses of a nanosecond, from 0 and after a second; 20 000 events in 2e-7 s at 1e4 s, where a
    // double resolves 2e-12 s, and a hundred slow ones after them; a billion turns in a second; and
    // a relay that switches each 1e-12 s.
    const auto outcome = [](const auto& system, auto x0, double from, double h_max = 1e300) {
        const Options options{
            .t_start = from, .t_end = from + 1e6, .h_max = h_max, .record_events = false};
        return integrate(system, x0, options).outcome;
    };
    EXPECT_EQ(outcome(Burst{}, Burst::State{}, 0), Outcome::stopped_by_event);
    EXPECT_EQ(outcome(Burst{}, Burst::State{-1, 0}, 0), Outcome::stopped_by_event);
    EXPECT_EQ(outcome(Burst{1e-11, 20'000, 20'100}, Burst::State{}, 1e4),
              Outcome::stopped_by_event);
    EXPECT_EQ(outcome(Turns{}, Turns::State{}, 0, 1e-9), Outcome::stopped_by_event);
    EXPECT_EQ(outcome(Relay{}, Relay::State{1}, 0), Outcome::stopped_by_event);
}

TEST(Limits, AreReachedWhereOnlyRoundingIsLeft)
{
    // Half a unit in the last place of 1: the relay cannot be followed.
    EXPECT_EQ(integrate(Relay{1e-16}, Relay::State{1}, {.t_end = 2}).outcome, Outcome::zeno);
}

/// A hundred turns a second.
struct Oscillator {
    using State = std::array<double, 2>;
    void flow(double, const State& x, State& dxdt) const { dxdt = {628 * x[1], -628 * x[0]}; }
};

TEST(Stalled, IsNeverSaidOfAMotionThatKeepsItsPace)
{
    // The end is 10^14 turns ahead, as if there were none.
    const auto run = integrate(Oscillator{}, {1, 0}, {.t_end = 1e12, .max_steps = 2'100'000});
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    // 150 000 events of a clock, each 0.005 s.
    const auto ticks = integrate(Burst{.period = 0.005, .most = 150'000}, {0, 0},
                                 {.t_end = 1e12, .record_events = false});
    EXPECT_EQ(ticks.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(ticks.t, 750, 1e-9);
}

TEST(Stalled, IsSaidOfEventsThatHardlyAdvanceTheTime)
{
    // After a second, 1e5 events take 1e-8 s: less than 1e-9 of the span, and 1e-6 of the second.
    const Burst burst{.period = 1e-13, .most = 10'000'000};
    const auto run = integrate(burst, {-1, 0}, {.t_end = 100, .record_events = false});
    EXPECT_EQ(run.outcome, Outcome::stalled);
    EXPECT_LE(run.statistics.events, 300'000U);
}

/// A clock with many entries of one time, each of which puts one customer before a guard that
/// serves it at once.
struct Queue {
    using State = std::array<double, 2>;
    Times time_events;

    explicit Queue(std::size_t customers) : time_events(std::vector<double>(customers, 1.0)) {}

    static void flow(double, const State&, State& dxdt) { dxdt = {0, 0}; }
    static double guard(double, const State& x) { return 0.5 - x[0]; }
    static void reset(double, State& x) { x = {0, x[1] + 1}; }
    static void rest(double, State& x) { x = {0, -1}; }
    static void time_reset(double, State& x) { x[0] = 1; }
};

TEST(Rest, AQueueThatIsServedAtOneInstantIsNoAccumulation)
{
    for (const std::size_t customers : {99, 102, 150, 990}) {
        const auto run = integrate(Queue(customers), {0, 0}, {.t_end = 2});
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.x[1], static_cast<double>(customers));
    }
}

/// Two guards throw a ball to and fro at one instant, n times.
struct PingPong {
    using State = std::array<double, 2>;
    static constexpr std::size_t guard_count = 2;
    double throws = 0;

    static void flow(double, const State& x, State& dxdt) { dxdt = {x[1] == 0 ? 1.0 : 0.0, 0}; }
    static double guard(std::size_t which, double, const State& x)
    {
        return which == 0 ? 0.5 - x[0] : x[0] + 0.5;
    }
    void reset(std::size_t which, double, State& x) const
    {
        x = {x[1] + 1 < throws ? (which == 0 ? -1.0 : 1.0) : 0.0, x[1] + 1};
    }
};

TEST(Rest, ABallThrownToAndFroAtOneInstantIsNoAccumulation)
{
    for (const double throws : {100, 210, 400, 1600}) {
        const auto run = integrate(PingPong{throws}, {0, 0}, {.t_end = 2});
        EXPECT_EQ(run.outcome, Outcome::reached_end) << throws;
        EXPECT_EQ(run.x[1], throws);
    }
    // The thousandth event of one guard at an instant is one too many.
    EXPECT_EQ(integrate(PingPong{3000}, {0, 0}, {.t_end = 2}).outcome, Outcome::endless_cascade);
}

}  // namespace
}  // namespace ricochet::rest_test
