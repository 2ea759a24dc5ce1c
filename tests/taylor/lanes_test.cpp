#include "ricochet/taylor/lanes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace ricochet::lanes_test {
namespace {

using Two = std::array<double, 2>;
using Four = std::array<double, 4>;
using Series = ErrorControlled<Taylor>;

/// Hénon and Heiles' motion, with its section x = 0 in one direction.
struct HenonHeiles {
    using State = Four;
    static constexpr bool resets = false;
    static constexpr Crossing crossing = Crossing::rising;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = -x[0] - 2.0 * x[0] * x[1];
        dxdt[3] = x[1] * x[1] - x[1] - x[0] * x[0];
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 4>& x) const
    {
        return x[0];
    }
};

/// A pendulum beside a wall that records the object of every call.
struct Pendulum {
    using State = Two;
    static constexpr bool unilateral = true;
    double ratio = 1, wall = -0.5;
    std::vector<const Pendulum*>* calls = nullptr;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -ratio * sin(x[0]);
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        if constexpr (std::is_same_v<S, double>) {
            if (calls) calls->push_back(this);
        }
        return x[0] - wall;
    }
    void reset(double /*t*/, State& x) const
    {
        x[0] = wall;
        x[1] *= -0.95;
    }
};

/// A forced oscillator beside a wall; its guard cannot be evaluated from `broken` [s] on.
struct Impact {
    using State = Two;
    static constexpr bool unilateral = true;
    double frequency = 0.8, wall = 1;
    double broken = std::numeric_limits<double>::infinity();
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cos;
        dxdt[0] = x[1];
        dxdt[1] = cos(frequency * t) - x[0] - 0.1 * x[1];
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& t, const std::array<S, 2>& x) const
    {
        if constexpr (std::is_same_v<S, double>) {
            if (t > broken) throw std::runtime_error("broken");
        }
        return wall - x[0];
    }
    void reset(double /*t*/, State& x) const
    {
        x[0] = wall;
        x[1] *= -0.8;
    }
};

/// Flows with every operation that a series has.
struct Powers {
    using State = Two;
    double a = 0.3;
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cbrt, std::exp, std::log, std::pow, std::sqrt;
        const S r = 2.0 + x[0] * x[0];
        dxdt[0] = x[1] / sqrt(r) - a / r;
        dxdt[1] = exp(-r) - pow(r, 0.7) * x[0] + 0.1 * log(r + t) - cbrt(r) / (1.0 - x[1] / 9.0);
    }
};
struct Angles {
    using State = Two;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::tanh, std::atan, std::atan2;
        dxdt[0] = tanh(x[1]);
        dxdt[1] = -atan(x[0]) + 0.01 * atan2(x[1], 3.0 + 0.1 * x[0]);
    }
};
struct Arcs {
    using State = Two;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::asin, std::acos, std::sinh, std::cosh;
        dxdt[0] = asin(0.3 * x[1]) - 0.1 * cosh(0.2 * x[0]);
        dxdt[1] = acos(0.3 * x[0]) - 2.0 - 0.1 * sinh(0.2 * x[1]);
    }
};

/// Kicked once a unit of time.
struct Kicked {
    using State = Two;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::tan;
        dxdt[0] = x[1];
        dxdt[1] = -tan(0.2 * x[0]);
    }
    [[nodiscard]] double next_time_event(double t) const { return std::floor(t) + 1; }
    void time_reset(double /*t*/, State& x) const { x[1] = 0.5 * x[1] + 0.1; }
};

struct Ball {
    using State = Two;
    static constexpr bool unilateral = true;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.81;
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return x[0];
    }
    void reset(double /*t*/, State& x) const
    {
        x[0] = 0;
        x[1] *= -0.9;
    }
};

/// A spring of the ninth power beside a wall, from which series start whose last two terms vanish.
struct FlatBowl {
    using State = Two;
    static constexpr bool unilateral = true;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::pow;
        dxdt[0] = x[1];
        dxdt[1] = -pow(x[0], 9);
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return x[0];
    }
    void reset(double /*t*/, State& x) const { x = {0, -0.95 * x[1]}; }
};

static_assert(runs_in_lanes<HenonHeiles> && runs_in_lanes<Pendulum> && runs_in_lanes<Impact>);
static_assert(runs_in_lanes<Powers> && runs_in_lanes<Angles> && runs_in_lanes<Arcs>);
static_assert(runs_in_lanes<Kicked> && runs_in_lanes<FlatBowl>);
static_assert(!runs_in_lanes<Ball>);  // a polynomial, whose steps end at events

[[nodiscard]] bool same_bits(double a, double b)
{
    return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}
template <std::size_t n>
[[nodiscard]] bool same_bits(const std::array<double, n>& a, const std::array<double, n>& b)
{
    for (std::size_t i = 0; i < n; ++i) {
        if (!same_bits(a[i], b[i])) return false;
    }
    return true;
}

template <class X>
void expect_same(const Run<X>& lane, const Run<X>& alone, const std::string& what)
{
    SCOPED_TRACE(what);
    EXPECT_EQ(lane.outcome, alone.outcome);
    EXPECT_TRUE(same_bits(lane.t, alone.t) && same_bits(lane.x, alone.x));
    EXPECT_EQ(std::memcmp(&lane.statistics, &alone.statistics, sizeof(Statistics)), 0);
    ASSERT_EQ(lane.events.size(), alone.events.size());
    for (std::size_t i = 0; i < lane.events.size(); ++i) {
        const auto& a = lane.events[i];
        const auto& b = alone.events[i];
        EXPECT_TRUE(a.kind == b.kind && a.guard == b.guard && same_bits(a.t, b.t) &&
                    same_bits(a.before, b.before) && same_bits(a.after, b.after) &&
                    same_bits(a.slope, b.slope) && same_bits(a.error, b.error) &&
                    same_bits(a.bracket.lo, b.bracket.lo) && same_bits(a.bracket.hi, b.bracket.hi))
            << "event " << i;
    }
    ASSERT_EQ(lane.trajectory.x.size(), alone.trajectory.x.size());
    for (std::size_t i = 0; i < lane.trajectory.x.size(); ++i) {
        EXPECT_TRUE(same_bits(lane.trajectory.x[i], alone.trajectory.x[i])) << "sample " << i;
    }
    EXPECT_EQ(lane.solution.size(), alone.solution.size());
}

/// Compares the runs of all systems in lanes with the same runs alone; returns their events.
template <class System>
std::size_t expect_bits_of_runs_alone(const std::vector<System>& systems,
                                      const std::vector<typename System::State>& starts,
                                      const Options& options, const Series& method = {})
{
    const auto lanes = integrate_lanes(systems, starts, options, method);
    EXPECT_TRUE(lanes.complete && lanes.failures.empty());
    EXPECT_EQ(lanes.rows.size(), starts.size());
    std::size_t events = 0;
    for (std::size_t row = 0; row < starts.size(); ++row) {
        if (!lanes.rows[row]) {
            ADD_FAILURE() << "no run " << row;
            continue;
        }
        const auto alone = integrate(systems[row], starts[row], options, method);
        expect_same(*lanes.rows[row], alone, "row " + std::to_string(row));
        events += alone.events.size();
    }
    return events;
}

/// Random starts around `middle`.
template <std::size_t n>
[[nodiscard]] std::vector<std::array<double, n>> starts_around(const std::array<double, n>& middle,
                                                               double width, std::size_t count)
{
    std::mt19937_64 random(count);
    std::uniform_real_distribution<double> draw(-width, width);
    std::vector<std::array<double, n>> starts(count, middle);
    for (auto& start : starts) {
        for (double& component : start) component += draw(random);
    }
    return starts;
}

template <class System>
std::size_t expect_bits_of_runs_alone(const System& system,
                                      const std::vector<typename System::State>& starts,
                                      const Options& options, const Series& method = {})
{
    return expect_bits_of_runs_alone(std::vector<System>(starts.size(), system), starts, options,
                                     method);
}

TEST(Lanes, SectionsOfHenonAndHeilesHaveTheBitsOfRunsAlone)
{
    // Of each order; eleven runs are two full sets of lanes and three runs.
    const auto starts = starts_around(Four{0, 0.1, 0.3, 0.05}, 0.1, 11);
    for (const double tolerance : {1e-7, 1e-10, 1e-15}) {
        const Options options{.t_end = 60, .rtol = tolerance, .atol = tolerance};
        EXPECT_GT(expect_bits_of_runs_alone(HenonHeiles{}, starts, options), 80U);
    }
}

TEST(Lanes, RunsBackwardInTimeHaveTheBitsOfRunsAlone)
{
    const auto starts = starts_around(Four{0, 0.1, 0.3, 0.05}, 0.1, 6);
    const Options options{.t_start = 50, .t_end = -10, .rtol = 1e-12, .atol = 1e-13};
    EXPECT_GT(expect_bits_of_runs_alone(HenonHeiles{}, starts, options), 40U);
    const auto forced = starts_around(Two{0.2, 0.1}, 0.1, 5);
    EXPECT_GT(expect_bits_of_runs_alone(Impact{}, forced, options), 5U);
}

TEST(Lanes, PendulumsOfDifferentLengthsBesideWallsHaveTheBitsOfRunsAlone)
{
    const auto starts = starts_around(Two{1.2, 0}, 0.3, 14);
    std::vector<Pendulum> systems(starts.size());
    for (std::size_t i = 0; i < systems.size(); ++i) {
        systems[i].ratio = 0.5 + 0.2 * static_cast<double>(i);
        systems[i].wall = -0.1 * static_cast<double>(i);
    }
    const Options options{.t_end = 40, .rtol = 1e-12, .atol = 1e-12};
    EXPECT_GT(expect_bits_of_runs_alone(systems, starts, options), 50U);
}

TEST(Lanes, ForcedImpactOscillatorsHaveTheBitsOfRunsAlone)
{
    const auto starts = starts_around(Two{0, 0}, 0.5, 9);
    for (const double tolerance : {1e-9, 1e-12, 2e-16}) {
        const Options options{.t_end = 80, .rtol = tolerance, .atol = tolerance};
        EXPECT_GT(expect_bits_of_runs_alone(Impact{}, starts, options), 60U);
    }
}

TEST(Lanes, BouncingBallsHaveTheBitsOfRunsAlone)
{
    const auto starts = starts_around(Two{10, 0}, 1, 5);
    EXPECT_GT(expect_bits_of_runs_alone(Ball{}, starts, {.t_end = 18, .rtol = 1e-12}), 40U);
}

TEST(Lanes, SeriesWhoseLastTermsVanishHaveTheBitsOfRunsAlone)
{
    const auto starts = starts_around(Two{1, 0}, 0.2, 9);
    for (const double tolerance : {1e-6, 1e-9, 1e-13}) {
        const Options options{.t_end = 60, .rtol = tolerance, .atol = tolerance};
        EXPECT_GT(expect_bits_of_runs_alone(FlatBowl{}, starts, options), 40U);
    }
}

TEST(Lanes, FunctionsInTheFlowHaveTheBitsOfRunsAlone)
{
    const auto starts = starts_around(Two{0.5, 0.2}, 0.4, 7);
    const Options options{.t_end = 20, .rtol = 1e-13, .atol = 1e-13};
    expect_bits_of_runs_alone(Powers{}, starts, options);
    expect_bits_of_runs_alone(Angles{}, starts, options);
    expect_bits_of_runs_alone(Arcs{}, starts, options);
}

TEST(Lanes, TimeEventsHaveTheBitsOfRunsAlone)
{
    const auto starts = starts_around(Two{0.5, 0.2}, 0.4, 6);
    EXPECT_EQ(expect_bits_of_runs_alone(Kicked{}, starts, {.t_end = 30.5, .h_max = 0.2}), 6 * 30U);
}

TEST(Lanes, OptionsThatEndOrObserveRunsAreHeeded)
{
    const auto starts = starts_around(Two{0, 0}, 0.5, 6);
    std::vector<double> samples;
    for (int k = 1; k < 40; ++k) samples.push_back(0.7 * k);
    // Runs end at their first impacts, at different times; after the same number of steps; are
    // sampled and recorded on a part of their way; have a tolerance for each component.
    expect_bits_of_runs_alone(Impact{}, starts, {.t_end = 80, .stop_at_event = true});
    expect_bits_of_runs_alone(Impact{}, starts, {.t_end = 80, .max_steps = 30});
    expect_bits_of_runs_alone(Impact{}, starts, {.t_end = 60, .sample_times = samples});
    expect_bits_of_runs_alone(Impact{}, starts, {.t_end = 20, .record_steps = true});
    expect_bits_of_runs_alone(Impact{}, starts,
                              {.t_end = 60, .rtol = 1e-9, .component_atol = {1e-6, 1e-12}});
    expect_bits_of_runs_alone(Impact{}, starts, {.t_end = 30, .h_max = 0.01});
    expect_bits_of_runs_alone(Impact{}, starts, {.t_end = 60}, Series{{.order = 16}});
}

TEST(Lanes, ExceptionsStayWithTheirRuns)
{
    // One guard throws in the middle of its run, which is in a lane beside others; one start is not
    // finite, which is refused before the first step.
    auto starts = starts_around(Two{0, 0}, 0.5, 10);
    std::vector<Impact> systems(starts.size());
    systems[2].broken = 20;
    starts[7][1] = std::numeric_limits<double>::quiet_NaN();
    const Options options{.t_end = 50, .rtol = 1e-12, .atol = 1e-12};
    const auto lanes = integrate_lanes(systems, starts, options);
    ASSERT_EQ(lanes.failures.size(), 2U);
    EXPECT_EQ(lanes.failures[0].row, 2U);
    EXPECT_EQ(lanes.failures[0].message, "broken");
    EXPECT_THROW(std::rethrow_exception(lanes.failures[0].exception), std::runtime_error);
    EXPECT_EQ(lanes.failures[1].row, 7U);
    EXPECT_THROW(std::rethrow_exception(lanes.failures[1].exception), std::invalid_argument);
    for (std::size_t row = 0; row < starts.size(); ++row) {
        if (row == 2 || row == 7) {
            EXPECT_FALSE(lanes.rows[row]);
            continue;
        }
        ASSERT_TRUE(lanes.rows[row]) << row;
        expect_same(*lanes.rows[row], integrate(systems[row], starts[row], options, Series{}),
                    "row " + std::to_string(row));
    }
}

TEST(Lanes, ACancelledSetOfRunsEndsCancelled)
{
    const std::atomic<bool> cancelled = true;
    const auto starts = starts_around(Two{0, 0}, 0.5, 6);
    const auto lanes = integrate_lanes(Impact{}, starts, {.t_end = 50, .cancelled = &cancelled});
    for (const auto& run : lanes.rows) EXPECT_EQ(run->outcome, Outcome::cancelled);
}

TEST(Lanes, AsManySystemsAsStartsAreAskedFor)
{
    const std::vector<Impact> systems(2);
    EXPECT_THROW(static_cast<void>(integrate_lanes(systems, std::vector<Two>(3), {.t_end = 1})),
                 std::invalid_argument);
    EXPECT_TRUE(integrate_lanes(Impact{}, std::vector<Two>{}, {.t_end = 1}).rows.empty());
}

TEST(Lanes, FourRunsTakeTheirStepsInTurns)
{
#ifndef __OPTIMIZE__
    GTEST_SKIP() << "without optimisation runs are alone";
#endif
    if (detail::fuses_products()) GTEST_SKIP() << "where products are fused runs are alone";
    // The guards of four runs are called in turns, and those of the fifth run once a lane is free.
    // Runs one after another would show as five blocks of calls.
    std::vector<const Pendulum*> calls;
    std::vector<Pendulum> systems(5);
    for (auto& system : systems) system.calls = &calls;
    const auto starts = starts_around(Two{1.2, 0}, 0.3, 5);
    static_cast<void>(integrate_lanes(systems, starts, {.t_end = 50, .rtol = 1e-12}));
    std::size_t turns = 0;
    for (std::size_t i = 1; i < calls.size(); ++i) turns += calls[i] != calls[i - 1] ? 1 : 0;
    EXPECT_GT(turns, 200U);
}

/// Packs in registers of two doubles. The runs above use registers of four, if there are any.
TEST(Lanes, RoughPowersHaveTheBitsOfTheirDoubles)
{
    using Pack = detail::LanePack<false>;
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> exponent(-1000, 1000), part(1, 2);
    for (int k = 0; k < 1000; ++k) {
        Pack x, y;
        for (std::size_t lane = 0; lane < detail::lane_count; ++lane) {
            y.set(lane, exponent(random));
            x.set(lane, std::ldexp(part(random), static_cast<int>(y[lane])));
        }
        const Pack log = rough_log2(x), power = rough_exp2(y);
        for (std::size_t lane = 0; lane < detail::lane_count; ++lane) {
            ASSERT_TRUE(same_bits(log[lane], detail::rough_log2(x[lane]))) << x[lane];
            ASSERT_TRUE(same_bits(power[lane], detail::rough_exp2(y[lane]))) << y[lane];
        }
    }
}

}  // namespace
}  // namespace ricochet::lanes_test
