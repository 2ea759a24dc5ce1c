// Scenes with dear guards: what they promise, along real runs.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "ricochet/integrate/integrate.hpp"
#include "ricochet/systems/cavern.hpp"
#include "scene_bounds.hpp"

namespace ricochet {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// --- cavern ---

Cavern::Parameters cavern(bool skimming, std::size_t segments, Cavern::Search search)
{
    Cavern::Parameters p = skimming ? Cavern::skimming() : Cavern::Parameters{};
    p.segments = segments;
    p.search = search;
    return p;
}

TEST(Cavern, BothSearchesGiveTheSameRunToTheBit)
{
    for (const bool skimming : {false, true}) {
        const Cavern tree(cavern(skimming, 1000, Cavern::Search::tree));
        const Cavern brute(cavern(skimming, 1000, Cavern::Search::brute));
        const Options options{.t_end = 10, .step = 1e-3};
        const auto a = integrate(tree, tree.start(), options, FixedStep<Rk4>{}, Ends{});
        const auto b = integrate(brute, brute.start(), options, FixedStep<Rk4>{}, Ends{});
        EXPECT_EQ(a.outcome, Outcome::reached_end);
        ASSERT_EQ(a.events.size(), b.events.size());
        ASSERT_GT(a.events.size(), 5U);
        for (std::size_t i = 0; i < a.events.size(); ++i) {
            EXPECT_EQ(a.events[i].t, b.events[i].t);
            EXPECT_EQ(a.events[i].after, b.events[i].after);
        }
        EXPECT_EQ(a.x, b.x);
    }
}

TEST(Cavern, BoundsHoldAndTheBallStaysInside)
{
    for (const bool skimming : {false, true}) {
        for (const std::size_t segments : {100U, 10'000U}) {
            const Cavern system(cavern(skimming, segments, Cavern::Search::tree));
            const auto run = sampled_run(system, system.start(), 200, 1e-3, 80'000);
            EXPECT_EQ(run.outcome, Outcome::reached_end);
            EXPECT_GT(run.events.size(), skimming ? 1000U : 100U);
            expect_bounds_hold(sample_bounds(system, run, 0), 100'000, 0.5);
            for (std::size_t i = 0; i < run.trajectory.t.size(); ++i) {
                const auto& x = run.trajectory.x[i];
                ASSERT_GT(system.guard(run.trajectory.t[i], x), -1e-9);
                ASSERT_LE(std::hypot(x[2], x[3]), system.top_speed() * (1 + 1e-12));
            }
        }
    }
}

TEST(Cavern, TheRateIsTheDerivativeOfTheGuard)
{
    const Cavern system(cavern(false, 1000, Cavern::Search::tree));
    const auto run = sampled_run(system, system.start(), 20, 1e-3, 2000);
    std::size_t compared = 0;
    for (std::size_t i = 0; i < run.trajectory.t.size(); ++i) {
        Cavern::State x = run.trajectory.x[i];
        Cavern::State dxdt{};
        const double t = run.trajectory.t[i];
        system.flow(t, x, dxdt);
        const double rate = system.guard_rate(t, x, dxdt);
        const double h = 1e-6;
        Cavern::State ahead = x, behind = x;
        for (std::size_t k = 0; k < 2; ++k) {
            ahead[k] += h * dxdt[k];
            behind[k] -= h * dxdt[k];
        }
        const double forward = (system.guard(t, ahead) - system.guard(t, x)) / h;
        const double backward = (system.guard(t, x) - system.guard(t, behind)) / h;
        // Where another point becomes the nearest, the guard has a kink; they are rare. Else
        // it bends by v² / distance to the point: 1e2 / 0.1, times h.
        if (std::fabs(forward - backward) > 1e-2) continue;
        ++compared;
        EXPECT_NEAR(rate, (forward + backward) / 2, 1e-2);
    }
    EXPECT_GT(compared, 1900U);
}

TEST(Cavern, AnErrorControlledRunStaysInsideToo)
{
    const Cavern system(cavern(true, 10'000, Cavern::Search::tree));
    const auto run = integrate(system, system.start(), {.t_end = 50, .rtol = 1e-9, .h_max = 0.01},
                               ErrorControlled<Dopri5>{});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.events.size(), 100U);
    for (const auto& event : run.events) EXPECT_NEAR(system.guard(event.t, event.before), 0, 1e-12);
}

TEST(Cavern, AtTheWallAndBeyondIt)
{
    const std::vector<geometry::Point2> square{{-2, -2}, {2, -2}, {2, 2}, {-2, 2}};
    const Cavern system({.radius = 0.5}, square);
    EXPECT_EQ(system.guard(0, Cavern::State{0, 0, 0, 0}), 1.5);
    EXPECT_EQ(system.guard(0, Cavern::State{2, 2, 0, 0}), -0.5);
    EXPECT_EQ(system.guard(0, Cavern::State{3, 0, 0, 0}), -1.5);
    EXPECT_TRUE(std::isnan(system.guard(0, Cavern::State{nan, 0, 0, 0})));
    EXPECT_LE(system.lower_bound(0, Cavern::State{0.3, 0, 0, 0}), 1.2);
    // Across the wall the velocity turns round, reduced; along it nothing happens.
    Cavern::State x{1.5, 0, 8, 3};
    system.reset(0, x);
    EXPECT_NEAR(x[2], -7.2, 1e-14);
    EXPECT_NEAR(x[3], 3, 1e-14);
    // The kick is the least speed of departure, as far as the top speed allows.
    x = {1.5, 0, 0.1, 0};
    system.reset(0, x);
    EXPECT_NEAR(x[2], -6, 1e-14);
    x = {1.5, 0, 0, system.top_speed()};
    system.reset(0, x);
    EXPECT_NEAR(x[2], 0, 1e-7);
}

TEST(Cavern, WrongSetUpIsRefused)
{
    const auto sentence = [](Cavern::Parameters p) { return refusal([&] { Cavern{p}; }); };
    EXPECT_NE(sentence({.segments = 7}).find("segments must be at least 8, got 7"),
              std::string::npos);
    EXPECT_NE(sentence({.radius = 50}).find("does not fit"), std::string::npos);
    EXPECT_NE(sentence({.radius = 0}).find("radius"), std::string::npos);
    EXPECT_NE(sentence({.drag = 0}).find("drag"), std::string::npos);
    EXPECT_NE(sentence({.restitution = 1.1}).find("restitution"), std::string::npos);
    EXPECT_NE(sentence({.kick = 100}).find("top speed"), std::string::npos);
    EXPECT_NE(sentence({.turn = nan}).find("turn"), std::string::npos);
    const auto wall = [](const std::vector<geometry::Point2>& w) {
        return refusal([&] { Cavern(Cavern::Parameters{}, w); });
    };
    EXPECT_NE(wall({}).find("got 0"), std::string::npos);
    EXPECT_NE(wall({{0, -1}, {nan, 0}, {0, 1}}).find("vertex 1"), std::string::npos);
    EXPECT_NE(wall({{3, 3}, {4, 3}, {4, 4}}).find("does not fit at the origin"), std::string::npos);
}

}  // namespace
}  // namespace ricochet
