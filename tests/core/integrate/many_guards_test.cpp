// Many guards in one state: what an event of one of them costs, and that the others are not lost.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <random>
#include <vector>

#include "ricochet/integrate.hpp"

namespace ricochet::many_guards_test {
namespace {

/// Rooms that cool towards 0 and, while heated, warm towards 30, switched at 18 and 22. The state
/// is the temperature of each room and whether it is heated.
struct Thermostats {
    using State = std::vector<double>;
    std::size_t rooms = 1;

    [[nodiscard]] std::size_t guard_count() const { return rooms; }
    void flow(double, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < rooms; ++i) {
            dxdt[2 * i] = -0.1 * (x[2 * i] - 30 * x[2 * i + 1]);
            dxdt[2 * i + 1] = 0;
        }
    }
    template <class V>
    [[nodiscard]] double guard(std::size_t i, double, const V& x) const
    {
        return x[2 * i + 1] == 0 ? x[2 * i] - 18 : 22 - x[2 * i];
    }
    template <class V, class D>
    [[nodiscard]] double guard_rate(std::size_t i, double, const V& x, const D& dxdt) const
    {
        return x[2 * i + 1] == 0 ? dxdt[2 * i] : -dxdt[2 * i];
    }
    void reset(std::size_t i, double, State& x) const { x[2 * i + 1] = 1 - x[2 * i + 1]; }
};

/// Temperatures at the start, spread over a cycle.
std::vector<double> spread(std::size_t rooms)
{
    std::vector<double> from(rooms);
    for (std::size_t i = 0; i < rooms; ++i) {
        from[i] = 18.5 + 3 * (static_cast<double>(i) + 0.5) / static_cast<double>(rooms);
    }
    return from;
}

auto run_from(const std::vector<double>& temperatures, double rtol = 1e-6)
{
    std::vector<double> x0;
    for (const double temperature : temperatures) x0.insert(x0.end(), {temperature, 0});
    return integrate(Thermostats{temperatures.size()}, x0,
                     {.t_end = 20, .rtol = rtol, .atol = rtol});
}

TEST(ManyGuards, NearlyEveryEventTakesOneRepeatOfTheStep)
{
    // Two where the quartic and the step's own map lie further apart than the motion is straight:
    // in the long steps from one group of rooms to the next.
    for (const std::size_t rooms : {10U, 100U}) {
        for (const double rtol : {1e-4, 1e-6, 1e-8}) {
            const auto run = run_from(spread(rooms), rtol);
            ASSERT_EQ(run.events.size(), 7 * rooms);  // cooling takes 2.0 s, heating 4.1 s
            EXPECT_LE(static_cast<double>(run.statistics.resteps),
                      1.25 * static_cast<double>(run.events.size()))
                << rooms << " rooms, rtol " << rtol;
        }
    }
}

TEST(ManyGuards, RoomsAlikeSwitchTogether)
{
    for (const std::size_t pairs : {5U, 20U}) {
        std::vector<double> twice = spread(pairs);
        twice.insert(twice.end(), twice.begin(), twice.begin() + static_cast<long>(pairs));
        const auto once = run_from(spread(pairs));
        const auto run = run_from(twice);
        ASSERT_EQ(run.events.size(), 2 * once.events.size());
        for (std::size_t i = 0; i < once.events.size(); ++i) {
            const auto& first = run.events[2 * i];
            const auto& second = run.events[2 * i + 1];
            EXPECT_EQ(first.guard, once.events[i].guard);
            EXPECT_EQ(second.guard, first.guard + pairs);
            EXPECT_EQ(second.t, first.t);
            EXPECT_EQ(second.before, first.before);
        }
    }
}

TEST(ManyGuards, EventsDoNotDependOnTheOrderOfTheGuards)
{
    std::mt19937 random(1);
    for (const std::size_t rooms : {10U, 40U}) {
        const std::vector<double> from = spread(rooms);
        const auto run = run_from(from);
        std::vector<std::size_t> order(rooms);
        std::iota(order.begin(), order.end(), 0U);
        std::shuffle(order.begin(), order.end(), random);
        std::vector<double> shuffled(rooms);
        for (std::size_t i = 0; i < rooms; ++i) shuffled[i] = from[order[i]];
        const auto other = run_from(shuffled);
        ASSERT_EQ(other.events.size(), run.events.size());
        for (std::size_t i = 0; i < run.events.size(); ++i) {
            EXPECT_EQ(other.events[i].t, run.events[i].t);
            EXPECT_EQ(order[other.events[i].guard], run.events[i].guard);
        }
    }
}

/// A clock in the first component. At 1 s the reset of guard 0 moves a component that another guard
/// reads across its surface, and at 2 s back.
struct Carried {
    using State = std::vector<double>;
    static constexpr std::size_t guard_count = 40;
    static constexpr std::size_t carried = 33;

    static void flow(double, const State&, State& dxdt)
    {
        std::fill(dxdt.begin(), dxdt.end(), 0.0);
        dxdt[0] = 1;
    }
    template <class V>
    [[nodiscard]] static double guard(std::size_t which, double, const V& x)
    {
        return which == 0 ? x[0] - x[1] : x[1 + which];
    }
    static void reset(std::size_t which, double, State& x)
    {
        if (which != 0) return;
        x[1] += 1;
        x[1 + carried] = -x[1 + carried];
    }
    static constexpr GuardInfo guard_info(std::size_t which)
    {
        return {.crossing = which == 0 ? Crossing::rising : Crossing::either,
                .resets = which == 0 || which == carried};
    }
};

TEST(ManyGuards, OneThatAResetCarriesAcrossFiresAtTheSameInstant)
{
    std::vector<double> x0(1 + Carried::guard_count, 3.0);
    x0[0] = 0;
    x0[1] = 1;
    const auto run = integrate(Carried{}, x0, {.t_end = 2.5});
    ASSERT_EQ(run.events.size(), 4U);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(run.events[i].guard, i % 2 == 0 ? 0 : Carried::carried);
        EXPECT_NEAR(run.events[i].t, i < 2 ? 1 : 2, 1e-14);
    }
}

/// x' = 1; waves, of which each is a guard that no reset depends on.
struct Waves {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;
    std::vector<std::array<double, 3>> waves;  ///< frequency, phase and level of each

    [[nodiscard]] std::size_t guard_count() const { return waves.size(); }
    static void flow(double, const State&, State& dxdt) { dxdt = {1}; }
    template <class V>
    [[nodiscard]] double guard(std::size_t i, double, const V& x) const
    {
        return std::sin(waves[i][0] * x[0] + waves[i][1]) - waves[i][2];
    }
    static constexpr GuardInfo guard_info(std::size_t) { return {.crossing = Crossing::either}; }
};

TEST(ManyGuards, EachIsFoundAsIfItWereAlone)
{
    // Steps of up to a third of a period: the waves deviate from cubics, and some need a second
    // evaluation inside a step, while most do not.
    std::mt19937 random(2);
    std::uniform_real_distribution<double> part(0, 1);
    Waves all;
    for (int i = 0; i < 60; ++i) {
        all.waves.push_back({0.2 + 3.8 * part(random) * part(random), 6 * part(random),
                             1.4 * (2 * part(random) - 1)});
    }
    const Options options{.t_end = 20, .step = 0.5};
    const auto together = integrate(all, Waves::State{0}, options, FixedStep<Dopri5>{});
    std::size_t events = 0;
    for (std::size_t i = 0; i < all.waves.size(); ++i) {
        const Waves one{{all.waves[i]}};
        const auto alone = integrate(one, Waves::State{0}, options, FixedStep<Dopri5>{});
        std::vector<double> times;
        for (const auto& event : together.events) {
            if (event.guard == i) times.push_back(event.t);
        }
        ASSERT_EQ(times.size(), alone.events.size()) << i;
        for (std::size_t k = 0; k < times.size(); ++k) {
            EXPECT_NEAR(times[k], alone.events[k].t, 1e-12) << i;
        }
        events += times.size();
    }
    EXPECT_EQ(events, together.events.size());
    EXPECT_GT(events, 100U);
}

}  // namespace
}  // namespace ricochet::many_guards_test
