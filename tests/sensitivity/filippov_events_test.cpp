// Guards, resets, stops and time events of the fields, watched beside their switching surfaces.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <random>
#include <span>
#include <vector>

#include "filippov_runs.hpp"
#include "ricochet/filippov.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/simulation.hpp"
#include "ricochet/stop.hpp"
#include "ricochet/times.hpp"

namespace ricochet::filippov_events_test {
namespace {

using test::tight;

using X1 = std::array<double, 1>;
using X2 = std::array<double, 2>;

constexpr double never = std::numeric_limits<double>::infinity();

/// h = y; fields (1, 1) below and (1, `slope` x + `above`) above; a wall at x = 1.
struct Walled {
    using State = X2;
    static constexpr std::size_t surface_count = 1;
    static constexpr bool unilateral = true;

    double slope = 0, above = -1;
    double lift = 0.25;  ///< y after the wall
    bool lifts = true;   ///< else the wall leaves y alone

    [[nodiscard]] double surface(std::size_t, double, const X2& x) const { return x[1]; }
    [[nodiscard]] double surface_rate(std::size_t, double, const X2&, const X2& v) const
    {
        return v[1];
    }
    void field(std::size_t region, double, const X2& x, X2& v) const
    {
        v = {1, region != 0 ? slope * x[0] + above : 1.0};
    }
    [[nodiscard]] double guard(double, const X2& x) const { return 1 - x[0]; }
    void reset(double, X2& x) const
    {
        x[0] = 0;
        if (lifts) x[1] = lift;
    }
};

/// Also by steps, with a new simulation after every tenth, which has to end in the same state.
template <class Fields, class X>
Run<X> run(const Filippov<Fields>& system, const X& x0, double t_end)
{
    const Options options = tight(t_end, system.start_mode(0, x0));
    auto steps = std::make_unique<Simulation<Filippov<Fields>, X>>(system, x0, options);
    for (int k = 1; steps->step(); ++k) {
        if (k % 10 != 0) continue;
        const Snapshot saved = steps->save();
        steps = std::make_unique<Simulation<Filippov<Fields>, X>>(system, x0, options);
        steps->restore(saved);
    }
    Run<X> out = integrate(system, x0, options);
    EXPECT_EQ(steps->run().outcome, out.outcome);
    for (std::size_t i = 0; i < x0.size(); ++i) EXPECT_NEAR(steps->x()[i], out.x[i], 1e-12);
    return out;
}

// It slides to the wall, is lifted off its surface, lands a quarter later, and so on.
TEST(FilippovEvents, AWallLiftsASlidingMotionOffItsSurface)
{
    const Filippov<Walled> system;
    const auto r = run(system, X2{0, 0}, 3.5);
    ASSERT_EQ(r.outcome, Outcome::reached_end);
    const std::vector<double> times = {1, 1.25, 2, 2.25, 3, 3.25};
    ASSERT_EQ(r.events.size(), times.size());
    for (std::size_t i = 0; i < times.size(); ++i) {
        EXPECT_NEAR(r.events[i].t, times[i], 1e-12);
        const bool wall = i % 2 == 0;
        EXPECT_EQ(r.events[i].guard, wall ? system.own_guard(0) : 1);
        EXPECT_EQ(r.events[i].mode_after, system.mode_of(wall ? Place::above : Place::sliding));
    }
    EXPECT_NEAR(r.x[0], 0.5, 1e-12);
    EXPECT_EQ(r.x[1], 0);
}

// At x = 1 the exit fires together with the wall, after which the surface attracts again.
TEST(FilippovEvents, AnExitThatFiresWithAWallIsDecidedAfterItsReset)
{
    const Filippov<Walled> system({.slope = 1, .above = -1, .lifts = false});
    const auto r = run(system, X2{0, 0}, 2.5);
    ASSERT_EQ(r.outcome, Outcome::reached_end);
    ASSERT_EQ(r.events.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_NEAR(r.events[i].t, i < 2 ? 1 : 2, 1e-12);
        EXPECT_EQ(r.events[i].guard, i % 2 == 0 ? 3 : system.own_guard(0));
        EXPECT_EQ(r.events[i].mode_after, system.mode_of(Place::sliding));
    }
    EXPECT_NEAR(r.x[0], 0.5, 1e-12);
    EXPECT_EQ(r.x[1], 0);
}

/// x' = 0.5 - F(t) sgn x: F = 1 before 1 and 0.3 after; at 1 the state is moved by `jump`. With a
/// second surface far away.
template <std::size_t surfaces>
struct Moved {
    using State = X2;
    static constexpr std::size_t surface_count = surfaces;
    double jump = -0.5;

    [[nodiscard]] double surface(std::size_t which, double, const X2& x) const
    {
        return which == 0 ? x[0] : x[1] - 7;
    }
    [[nodiscard]] double surface_rate(std::size_t which, double, const X2&, const X2& v) const
    {
        return v[which];
    }
    void field(std::size_t region, double t, const X2&, X2& v) const
    {
        const double friction = t < 1 ? 1 : 0.3;
        v = {0.5 - ((region & 1) != 0 ? friction : -friction), 0};
    }
    [[nodiscard]] double next_time_event(double t) const { return t < 1 ? 1 : never; }
    void time_reset(double, X2& x) const { x[0] += jump; }
};

TEST(FilippovEvents, ATimeEventThatMovesTheStateOffItsSurfaceStandsThoughAnExitFires)
{
    const Filippov<Moved<1>> one;
    const auto r = integrate(one, X2{0, 0}, tight(2, one.start_mode(0, X2{0, 0})));
    ASSERT_EQ(r.outcome, Outcome::reached_end);
    EXPECT_NEAR(r.x[0], 0.075, 1e-13);
    const Filippov<Moved<2>> two;
    const auto r2 = integrate(two, X2{0, 0}, tight(2, two.start_mode(0, X2{0, 0})));
    ASSERT_EQ(r2.outcome, Outcome::reached_end);
    EXPECT_NEAR(r2.x[0], 0.075, 1e-13);
    const Filippov<Moved<1>> up({.jump = 0.25});
    const auto r3 = integrate(up, X2{0, 0}, tight(2, up.start_mode(0, X2{0, 0})));
    EXPECT_NEAR(r3.x[0], 0.45, 1e-13);
}

/// A block of 1 kg with dry friction 1 N, pushed by `push`, with walls at 0 and 1 that return
/// `restitution` of the speed: x = (position, speed).
struct Block {
    using State = X2;
    static constexpr std::size_t surface_count = 1;
    std::size_t guard_count = 2;  // as many as there are walls
    double push = 2, restitution = 0.5;

    [[nodiscard]] double surface(std::size_t, double, const X2& x) const { return x[1]; }
    void field(std::size_t region, double, const X2& x, X2& v) const
    {
        v = {x[1], push - (region != 0 ? 1 : -1)};
    }
    [[nodiscard]] double guard(std::size_t which, double, const X2& x) const
    {
        return which == 0 ? x[0] : 1 - x[0];
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.name = which == 0 ? "left wall" : "right wall", .unilateral = true};
    }
    void reset(std::size_t, double, X2& x) const { x[1] *= -restitution; }
    void rest(std::size_t which, double, X2& x) const { x = {which == 0 ? 0.0 : 1.0, 0}; }
};

// Away from the wall it brakes at 3 m/s2, back it accelerates at 1: speeds shrink by e / sqrt 3.
TEST(FilippovEvents, ABlockWithFrictionReboundsFromItsWall)
{
    const Filippov<Block> system;
    const auto r = run(system, X2{0.5, 0}, 1.6);
    ASSERT_EQ(r.outcome, Outcome::reached_end);
    ASSERT_GE(r.events.size(), 3u);
    const double v = 0.5;  // after the first impact, at speed 1
    EXPECT_NEAR(r.events[0].t, 1, 1e-12);
    EXPECT_EQ(r.events[0].guard, system.own_guard(1));
    EXPECT_EQ(system.guard_info(r.events[0].guard).name, "right wall");
    EXPECT_NEAR(r.events[1].t, 1 + v / 3, 1e-12);
    EXPECT_EQ(r.events[1].mode_after, system.mode_of(Place::above));
    const double back = std::sqrt(v * v / 3);
    EXPECT_NEAR(r.events[2].t, 1 + v / 3 + back, 1e-11);
    EXPECT_NEAR(r.events[2].before[1], back, 1e-11);
}

TEST(FilippovEvents, ReboundsThatAccumulateComeToRestAtTheWallOfTheFields)
{
    const Filippov<Block> system({.push = -2});
    const auto r = run(system, X2{0.5, 0}, 6);
    ASSERT_EQ(r.outcome, Outcome::reached_end);
    EXPECT_EQ(r.x, (X2{0, 0}));
    // Of a round: v/3 out and v/sqrt 3 back, the next v is v/(2 sqrt 3).
    const double q = 0.5 / std::sqrt(3.0);
    const double limit = 1 + 0.5 * (1 / 3.0 + 1 / std::sqrt(3.0)) / (1 - q);
    ASSERT_FALSE(r.events.empty());
    EXPECT_EQ(r.events.back().kind, EventKind::accumulation);
    EXPECT_NEAR(r.events.back().t, limit, 1e-9);
}

TEST(FilippovEvents, ABlockThatSticksBeforeItsWallNeverMeetsIt)
{
    const Filippov<Block> system({.push = 0});
    const auto r = run(system, X2{0.25, 1}, 4);
    ASSERT_EQ(r.events.size(), 1u);
    EXPECT_EQ(r.mode, system.mode_of(Place::sliding));
    EXPECT_NEAR(r.x[0], 0.75, 1e-12);
}

/// A belt at 1/2 m/s carries a block with friction 1 into a wall at 1, which returns 1.5 times the
/// speed.
struct Bumper {
    using State = X2;
    static constexpr std::size_t surface_count = 1;

    [[nodiscard]] double surface(std::size_t, double, const auto& x) const { return x[1] - 0.5; }
    [[nodiscard]] double surface_rate(std::size_t, double, const auto&, const auto& v) const
    {
        return v[1];
    }
    void field(std::size_t region, double, const auto& x, auto& v) const
    {
        v[0] = x[1];
        v[1] = region != 0 ? -1 : 1;
    }
    template <class X>
    [[nodiscard]] ScalarOf<X> guard(const ScalarOf<X>&, const X& x) const
    {
        return 1 - x[0];
    }
    static constexpr bool unilateral = true;
    template <class X>
    void reset(const ScalarOf<X>&, X& x) const
    {
        x[1] = -1.5 * x[1];
    }
};

TEST(FilippovEvents, ABeltThatCarriesABlockIntoABumperIsThrownBackEveryTime)
{
    const Filippov<Bumper> system;
    const auto r = run(system, X2{0, 0.5}, 10);
    ASSERT_EQ(r.outcome, Outcome::reached_end);
    std::size_t impacts = 0;
    for (const auto& event : r.events) {
        if (event.guard != system.own_guard(0)) continue;
        EXPECT_NEAR(event.t, 2 + 1.5625 * static_cast<double>(impacts), 1e-11);
        ++impacts;
    }
    EXPECT_EQ(impacts, 6u);
    EXPECT_NEAR(r.x[0], 0.876953125, 1e-11);
    EXPECT_NEAR(r.x[1], -0.5625, 1e-11);
}

TEST(FilippovEvents, AnotherSimulationGoesOnFromEverySnapshot)
{
    const Filippov<Bumper> system;
    const X2 x0 = {0, 0.5};
    const Options options = tight(10, system.start_mode(0, x0));
    const auto whole = integrate(system, x0, options);
    Simulation first(system, x0, options);
    for (int i = 0; i < 30; ++i) (void)first.step();
    Simulation second(system, x0, options);
    second.restore(first.save());
    while (!second.ended()) (void)second.step();
    EXPECT_EQ(second.x(), whole.x);
    EXPECT_EQ(second.mode(), whole.mode);
}

// --- sections, stops, vetoes ---

/// A line that moves at speed 1 and slides along y = 0; sections at 1, a stop at 2.
struct Sections {
    using State = X2;
    static constexpr std::size_t surface_count = 1;
    static constexpr std::size_t guard_count = 2;
    static constexpr bool resets = false;
    double vetoed_until = 0;

    [[nodiscard]] double surface(std::size_t, double, const X2& x) const { return x[1]; }
    void field(std::size_t region, double, const X2&, X2& v) const
    {
        v = {1, region != 0 ? -1.0 : 1.0};
    }
    void guards(double, const X2& x, std::span<double> g) const
    {
        g[0] = x[0] - 1;
        g[1] = 2 - x[0];
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.crossing = Crossing::either, .stop_after = which == 1 ? 1u : 0u};
    }
    [[nodiscard]] bool enabled(std::size_t which, double t, const X2&) const
    {
        return which == 1 || t >= vetoed_until;
    }
};

TEST(FilippovEvents, SectionsAreRecordedAndAStopEndsTheRunWhileItSlides)
{
    const Filippov<Sections> system;
    const auto r = run(system, X2{0, 0}, 5);
    ASSERT_EQ(r.events.size(), 2u);
    EXPECT_EQ(r.events[0].guard, system.own_guard(0));
    EXPECT_NEAR(r.events[0].t, 1, 1e-12);
    EXPECT_EQ(r.events[0].mode_after, system.mode_of(Place::sliding));
    EXPECT_EQ(r.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(r.t, 2, 1e-12);
    const auto vetoed = run(Filippov<Sections>({.vetoed_until = 1.5}), X2{0, 0}, 5);
    EXPECT_EQ(vetoed.events.size(), 1u);
}

/// Two guards of a sliding motion that fire together: their increments add, as without surfaces.
struct Doses {
    using State = X2;
    static constexpr std::size_t surface_count = 1;
    static constexpr std::size_t guard_count = 2;
    bool conflict = false;

    [[nodiscard]] double surface(std::size_t, double, const X2& x) const { return x[1]; }
    void field(std::size_t region, double, const X2&, X2& v) const
    {
        v = {1, region != 0 ? -1.0 : 1.0};
    }
    [[nodiscard]] double guard(std::size_t which, double t, const X2&) const
    {
        return which == 0 ? 1 - t : 3 * (1 - t);
    }
    void reset(std::size_t which, double, X2& x) const
    {
        x[1] = conflict && which == 0 ? 7 : x[1] + 0.5;
    }
};

TEST(FilippovEvents, ResetsOfTheFieldsThatFireTogetherAreMergedAsInAnySystem)
{
    const auto r = run(Filippov<Doses>(), X2{0, 0}, 1.5);
    EXPECT_EQ(r.outcome, Outcome::reached_end);
    EXPECT_NEAR(r.x[1], 0.5, 1e-12);
    const auto against = run(Filippov<Doses>({.conflict = true}), X2{0, 0}, 1.5);
    EXPECT_EQ(against.outcome, Outcome::conflicting_resets);
    EXPECT_EQ(against.guard, Filippov<Doses>::own_guard(0));
}

/// The same, taken together by the fields; and a reset that ends the run.
struct Taken : Doses {
    void reset(const FiredGuards& fired, double, X2& x) const
    {
        x[1] = static_cast<double>(fired.size());
        if (conflict) throw StopRun("enough");
    }
};

TEST(FilippovEvents, FieldsMayTakeTheWholeSetAndMayStopTheRun)
{
    const auto r = run(Filippov<Taken>(), X2{0, 0}, 1.5);
    EXPECT_NEAR(r.x[1], 1.5, 1e-12);
    Taken stopping;
    stopping.conflict = true;
    const auto stopped = run(Filippov<Taken>(stopping), X2{0, 0}, 1.5);
    EXPECT_EQ(stopped.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(stopped.reason, "enough");
    EXPECT_EQ(stopped.x[1], 2);
}

/// A reset that carries the state across its surface by numbers that do not add up exactly.
struct Rounded {
    using State = X2;
    static constexpr std::size_t surface_count = 1;

    [[nodiscard]] double surface(std::size_t, double, const X2& x) const { return x[1]; }
    void field(std::size_t region, double, const X2&, X2& v) const
    {
        v = {1, region != 0 ? -1.0 : 1.0};
    }
    [[nodiscard]] double guard(double, const X2& x) const { return 1 - x[0]; }
    void reset(double, X2& x) const { x[1] = x[1] - 0.1 - 0.2; }
};

TEST(FilippovEvents, ASurfaceWithinRoundingCountsAsMet)
{
    const Filippov<Rounded> system;
    const auto r = run(system, X2{0.75, 0.55}, 2);
    ASSERT_EQ(r.events.size(), 1u);
    EXPECT_EQ(r.events[0].guard, system.own_guard(0));
    EXPECT_NE(r.events[0].before[1] - 0.1 - 0.2, 0);
    EXPECT_EQ(r.mode, system.mode_of(Place::sliding));
    EXPECT_EQ(r.x[1], 0);
}

// --- motions that have nothing to do with one another ---

/// Two blocks with dry friction 1 under loads of their own (one surface each), a ball that bounces
/// beside them, and a tick that does nothing: x = (speeds of the blocks, height, speed of the
/// ball).
template <std::size_t surfaces>
struct Beside {
    using State = std::array<double, 4>;
    static constexpr std::size_t surface_count = surfaces;
    static constexpr bool unilateral = true;
    std::array<double, 2> load = {1.5, 1.5}, frequency = {1, 2};
    double restitution = 0.5;
    Times time_events = every(0.25);

    [[nodiscard]] double surface(std::size_t which, double, const State& x) const
    {
        return x[which];
    }
    [[nodiscard]] double surface_rate(std::size_t which, double, const State&, const State& v) const
    {
        return v[which];
    }
    void field(std::size_t region, double t, const State& x, State& v) const
    {
        for (std::size_t i = 0; i < 2; ++i) {
            const double friction = (region >> i & 1) != 0 ? 1 : -1;
            v[i] = i < surfaces ? load[i] * std::sin(frequency[i] * t) - friction : 0.0;
        }
        v[2] = x[3];
        v[3] = -10;
    }
    [[nodiscard]] double guard(double, const State& x) const { return x[2]; }
    void reset(double, State& x) const { x[3] *= -restitution; }
    void rest(double, State& x) const { x[2] = x[3] = 0; }
};

/// The ball beside no block: its height at t, after the same bounces.
double height_of_ball(double height, double restitution, double t_end)
{
    double t = std::sqrt(height / 5);
    double v = restitution * 10 * t;
    if (t_end < t) return height - 5 * t_end * t_end;
    for (; v > 1e-12; v *= restitution) {
        if (t_end < t + v / 5) return v * (t_end - t) - 5 * (t_end - t) * (t_end - t);
        t += v / 5;
    }
    return 0;
}

TEST(FilippovEvents, BlocksBallsAndTicksDoNotDisturbOneAnother)
{
    std::mt19937 random(18);
    std::uniform_real_distribution<double> unit;
    std::size_t sticks = 0;
    for (int k = 0; k < 200; ++k) {
        Beside<2> both;
        for (double& load : both.load) load = 0.8 + unit(random);
        for (double& frequency : both.frequency) frequency = 0.5 + 2 * unit(random);
        both.restitution = 0.3 + 0.5 * unit(random);
        Beside<1> first;
        first.load = both.load;
        first.frequency = both.frequency;
        first.restitution = both.restitution;
        const double height = 0.1 + unit(random);
        const std::array<double, 4> x0 = {unit(random) - 0.5, unit(random) - 0.5, height, 0};
        const auto two = run(Filippov(both), x0, 6);
        const auto one = run(Filippov(first), x0, 6);
        ASSERT_EQ(two.outcome, Outcome::reached_end) << k << describe(two);
        ASSERT_EQ(one.outcome, Outcome::reached_end) << k << describe(one);
        const double right = height_of_ball(height, both.restitution, 6);
        EXPECT_NEAR(two.x[2], right, 1e-9) << k;
        EXPECT_NEAR(one.x[2], right, 1e-9) << k;
        EXPECT_NEAR(two.x[0], one.x[0], 1e-10) << k;
        sticks += Filippov<Beside<1>>::place(0, one.mode) == Place::sliding;
    }
    EXPECT_GT(sticks, 20u);
}

// --- derivatives ---

// x(10) of the bumper depends on the speed that the wall returns, but not on the start, which it
// forgets while it is carried: only the time of the impacts does.
TEST(FilippovEvents, DerivativesPassThroughWallsOfTheFields)
{
    using System = Filippov<Bumper>;
    const System system;
    const X2 x0 = {0, 0.5};
    Options options = tight(3, system.start_mode(0, x0));
    const auto s = sensitivities(system, x0, {}, options);
    ASSERT_FALSE(s.undefined_at) << name(s.undefined_at->reason);
    // Impact at 2 - 2 x0; then v = -3/4 + s, s since the impact: x = 1 - 3/4 s + s^2/2 at t = 3.
    EXPECT_NEAR(s.state(1, 0), 2, 1e-8);
    EXPECT_NEAR(s.state(0, 0), 2 * (-0.75 + 1), 1e-8);
}

}  // namespace
}  // namespace ricochet::filippov_events_test
