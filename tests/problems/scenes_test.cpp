// Scenes with expensive guards: their promises, along real runs.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "problems/cavern.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/opaque.hpp"
#include "problems/planar_arm.hpp"
#include "problems/zones.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/nn/model.hpp"
#include "scene_bounds.hpp"

namespace ricochet::scenes_test {
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
        // Where another point becomes the nearest, the guard has a kink; kinks are rare. Otherwise
        // its second derivative is v² / distance to the point: 1e2 / 0.1, times h.
        if (std::fabs(forward - backward) > 1e-2) continue;
        ++compared;
        EXPECT_NEAR(rate, (forward + backward) / 2, 1e-2);
    }
    EXPECT_GT(compared, 1900U);
}

/// Two states in a box of half-widths `h`, in which `bound` limits the difference of the guard.
template <class System>
void expect_slack_holds(const System& system, const typename System::State& middle,
                        const typename System::State& spread, std::size_t pairs)
{
    using X = typename System::State;
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> uniform(-1, 1);
    double closest = 0;
    for (std::size_t k = 0; k < pairs; ++k) {
        const double size = std::pow(10.0, -6 * std::fabs(uniform(random)));
        X a = middle;
        X b = middle;
        X half{};
        for (std::size_t i = 0; i < a.size(); ++i) {
            a[i] += spread[i] * uniform(random);
            b[i] = a[i] + size * spread[i] * uniform(random);
            half[i] = std::fabs(b[i] - a[i]);
        }
        const double change = std::fabs(system.guard(0, a) - system.guard(0, b));
        const double slack = system.guard_slack(half);
        ASSERT_LE(change, slack) << k;
        closest = std::max(closest, change / slack);
        for (double& h : half) h *= 2;
        ASSERT_GE(system.guard_slack(half), slack);
    }
    EXPECT_GT(closest, 0.5);  // the bound is not trivial
}

TEST(Cavern, TheGuardChangesByNoMoreThanItsSlack)
{
    const Cavern system(cavern(false, 1000, Cavern::Search::tree));
    expect_slack_holds(system, {0, 0, 0, 0}, {12, 12, 5, 5}, 20'000);
    EXPECT_EQ(system.parameter("segments"), 1000.0);
    EXPECT_EQ(system.parameter("launch"), 5.0);
    EXPECT_EQ(system.parameter("weight"), std::nullopt);
    const Cavern square({}, {{-3, -3}, {3, -3}, {3, 3}, {-3, 3}});
    EXPECT_EQ(square.parameter("seed"), std::nullopt);  // says nothing of this wall
    EXPECT_EQ(square.parameter("radius"), 0.1);
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
    // Across the wall the velocity is reversed and reduced; along it nothing changes.
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

// --- zones ---

/// The guard as given in the header.
double flower(double r, double angle, double t, double radius, double a, int m, double turn)
{
    const double s = 2 * r * r / (r * r + radius * radius);
    return r - radius * (1 + a * s * std::cos(m * (angle - turn * t)));
}

TEST(Zones, BoundsHoldForEveryZone)
{
    const Zones system;
    ASSERT_EQ(system.guard_count(), 256U);
    const auto run = sampled_run(system, system.start(), 60, 1e-2, 1500);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.events.size(), 100U);
    BoundsSampled all;
    for (std::size_t which = 0; which < system.guard_count(); ++which) {
        const BoundsSampled one = sample_bounds(system, run, which);
        all.samples += one.samples;
        all.broken_way += one.broken_way;
        all.broken_speed += one.broken_speed;
        all.broken_lower += one.broken_lower;
        all.closest_way = std::max(all.closest_way, one.closest_way);
    }
    expect_bounds_hold(all, 100'000, 0.5);
}

TEST(Zones, AreFlowersThatTurn)
{
    // A single zone is found by its values: g = -radius in the centre, r - radius (1 + 2 a
    // cos) far away; its petals repeat with the angle.
    const Zones system({.count = 5, .turn = 2});
    std::size_t inside = 0;
    for (std::size_t which = 0; which < 5; ++which) {
        for (int i = 0; i < 2000; ++i) {
            const Zones::State x{0.005 * i - 5, 0.0037 * i - 3, 1, 0.3};
            const double g = system.guard(which, 1.5, x);
            EXPECT_LE(system.lower_bound(which, 1.5, x), g);
            if (g < 0) ++inside;
            // The rate against a difference along the motion, with turning zones.
            const Zones::State dxdt{x[2], x[3], 0, 0};
            const double h = 1e-6;
            const auto moved = [&](double by) {
                return system.guard(which, 1.5 + by,
                                    Zones::State{x[0] + by * x[2], x[1] + by * x[3], 0, 0});
            };
            // Third derivatives of some 1e3 times h² and rounding of 1e-15 / h.
            EXPECT_NEAR(system.guard_rate(which, 1.5, x, dxdt), (moved(h) - moved(-h)) / (2 * h),
                        1e-6);
        }
    }
    EXPECT_GT(inside, 10U);
    EXPECT_TRUE(std::isnan(system.guard(0, 0, Zones::State{nan, 0, 0, 0})));
    EXPECT_NEAR(flower(1, 0, 0, 1, 0.2, 3, 0), -0.2, 1e-15);
}

TEST(Zones, AllTogetherAreTheSameAsEachAlone)
{
    const Zones system;
    std::vector<double> all(system.guard_count());
    const Zones::State x{0.3, -1.7, 0.2, 0.1};
    system.guards(3.5, x, all);
    for (std::size_t i = 0; i < all.size(); ++i) EXPECT_EQ(all[i], system.guard(i, 3.5, x));
}

TEST(Zones, WrongSetUpIsRefused)
{
    EXPECT_NE(refusal([] { Zones({.count = 0}); }).find("count must be positive"),
              std::string::npos);
    EXPECT_NE(refusal([] { Zones({.size = -1}); }).find("size"), std::string::npos);
    EXPECT_NE(refusal([] { Zones({.turn = nan}); }).find("turn"), std::string::npos);
}

// --- smallest eigenvalue ---

TEST(LeastEigenvalue, BoundsHold)
{
    const LeastEigenvalue system;
    const auto run = sampled_run(system, system.start(), 100, 1e-2, 60'000);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.events.size(), 4U);
    expect_bounds_hold(sample_bounds(system, run, 0), 100'000, 0.05);
}

TEST(LeastEigenvalue, ItsTableBoundsItFromBothSidesAndClosely)
{
    const LeastEigenvalue system({.table = 4});
    EXPECT_EQ(system.tabulated(), 625U);
    const auto run = sampled_run(system, system.start(), 100, 1e-2, 60'000);
    expect_bounds_hold(sample_bounds(system, run, 0), 100'000, 0.05);
    // Entries off the diagonal have a deviation of 0.25 / sqrt(3), so that the curvature along a
    // load is about 2 * 0.02 * (1 + 1/2 + ... + 1/23) = 0.15, where eigenvalues are 1 apart. With
    // cells of 0.5 both errors are some 4 * 0.15 * 0.5² / 8 = 0.02; where eigenvalues come close,
    // more.
    double below = 0;
    double above = 0;
    for (const auto& x : run.trajectory.x) {
        const double g = system.guard(0, x);
        below += g - system.lower_bound(0, x);
        above += system.upper_bound(0, x) - g;
    }
    const auto n = static_cast<double>(run.trajectory.x.size());
    EXPECT_LT(below / n, 0.1);
    EXPECT_LT(above / n, 0.1);
    const LeastEigenvalue::State outside{1.1, 0, 0, 0};
    EXPECT_EQ(system.lower_bound(0, outside), -std::numeric_limits<double>::infinity());
    EXPECT_EQ(system.upper_bound(0, outside), std::numeric_limits<double>::infinity());
}

TEST(LeastEigenvalue, ItsTableSavesChecksOnBothSidesAndKeepsTheEvents)
{
    for (const double level : {1.3, 1.55}) {
        const Options options{.t_end = level < 1.5 ? 40.0 : 20, .step = level < 1.5 ? 4e-3 : 2e-3};
        const auto planned = [&](const LeastEigenvalue& system) {
            return integrate(system, system.start(), options, FixedStep<Rk4>{}, Planned{});
        };
        const LeastEigenvalue plain({.level = level});
        const auto every = integrate(plain, plain.start(), options, FixedStep<Rk4>{}, Extremum{});
        const auto without = planned(plain);
        const auto with = planned(LeastEigenvalue({.level = level, .table = 8}));
        ASSERT_GT(every.events.size(), 1U) << level;
        for (const auto* run : {&without, &with}) {
            ASSERT_EQ(run->events.size(), every.events.size());
            for (std::size_t i = 0; i < every.events.size(); ++i) {
                EXPECT_EQ(run->events[i].t, every.events[i].t);
                EXPECT_EQ(run->events[i].before, every.events[i].before);
            }
            EXPECT_EQ(run->x, every.x);
        }
        EXPECT_LT(1.5 * static_cast<double>(with.statistics.guard_calls),
                  static_cast<double>(without.statistics.guard_calls))
            << level;
    }
}

TEST(LeastEigenvalue, ItsProvedNetworkSavesChecksAndKeepsTheEvents)
{
    const Model model = load_model(RICOCHET_MODELS "/eigenvalue-certified.safetensors");
    EXPECT_EQ(why_void(model), "");
    const LeastEigenvalue system;
    const Options options{.t_end = 40, .step = 4e-3};
    const auto run = [&](const auto& detector) {
        return integrate(system, system.start(), options, FixedStep<Rk4>{}, detector);
    };
    const auto every = run(Extremum{});
    const auto planned = run(Planned<>({.check_bounds = false}));
    const auto proved = run(Certified<>(model, {.check_bounds = false}));
    ASSERT_GT(every.events.size(), 1U);
    ASSERT_EQ(proved.events.size(), every.events.size());
    for (std::size_t i = 0; i < every.events.size(); ++i) {
        EXPECT_EQ(proved.events[i].t, every.events[i].t);
        EXPECT_EQ(proved.events[i].before, every.events[i].before);
    }
    EXPECT_EQ(proved.x, every.x);
    EXPECT_LT(1.5 * static_cast<double>(proved.statistics.guard_calls),
              static_cast<double>(planned.statistics.guard_calls));
}

TEST(LeastEigenvalue, RateIsTheDerivativeAlongTheMotion)
{
    const LeastEigenvalue system;
    for (int i = 0; i < 200; ++i) {
        const LeastEigenvalue::State q{std::sin(i), std::cos(2.0 * i), std::sin(3.0 * i), 0.3};
        const LeastEigenvalue::State rates{1, -0.5, 0.25, 2};
        const auto moved = [&](double by) {
            LeastEigenvalue::State at = q;
            for (std::size_t k = 0; k < 4; ++k) at[k] += by * rates[k];
            return system.guard(0, at);
        };
        // Eigenvalues are some 0.1 apart: third derivatives below 1e4, times h² = 1e-8.
        const double h = 1e-4;
        EXPECT_NEAR(system.guard_rate(0, q, rates), (moved(h) - moved(-h)) / (2 * h), 1e-4);
    }
}

TEST(LeastEigenvalue, TheSlowFormHasTheSameValuesAndTakesItsTime)
{
    const LeastEigenvalue fast;
    const LeastEigenvalue slow({.slow = 2e-3});
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < 5; ++i) {
        const LeastEigenvalue::State q{0.1 * i, 0.2, 0.3, -0.4};
        EXPECT_EQ(fast.guard(0, q), slow.guard(0, q));
    }
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    EXPECT_GE(spent.count(), 5 * 2e-3);
    EXPECT_TRUE(std::isnan(fast.guard(0, LeastEigenvalue::State{nan, 0, 0, 0})));
    EXPECT_NE(refusal([] { LeastEigenvalue({.slow = -1}); }).find("slow"), std::string::npos);
    EXPECT_NE(refusal([] { LeastEigenvalue({.table = 49}); }).find("table"), std::string::npos);
    EXPECT_NE(refusal([] { LeastEigenvalue({.amplitude = 0}); }).find("amplitude"),
              std::string::npos);
}

/// Runs with a check at every step and planned: the same events, bit for bit, up to the first dip
/// inside a step that only the bounds show. Returns the ratio of their exact calls.
template <class Stepping, class System>
double saved_by_planning(const System& system, const Options& options)
{
    const auto every = integrate(system, system.start(), options, Stepping{}, Extremum{});
    const auto planned =
        integrate(system, system.start(), options, Stepping{}, Planned<>({.check_bounds = false}));
    EXPECT_EQ(every.outcome, Outcome::reached_end);
    EXPECT_EQ(planned.outcome, every.outcome);
    EXPECT_EQ(planned.statistics.unmet_conditions, 0U);
    EXPECT_GT(every.events.size(), 0U);
    for (std::size_t i = 0; i < std::min(planned.events.size(), every.events.size()); ++i) {
        if (planned.events[i].t < every.events[i].t) {
            EXPECT_GT(i, 10U);  // the motion is another one from here on
            return static_cast<double>(every.statistics.guard_calls) /
                   static_cast<double>(planned.statistics.guard_calls);
        }
        EXPECT_EQ(planned.events[i].t, every.events[i].t);
        EXPECT_EQ(planned.events[i].guard, every.events[i].guard);
        EXPECT_EQ(planned.events[i].before, every.events[i].before);
        EXPECT_EQ(planned.events[i].after, every.events[i].after);
    }
    EXPECT_EQ(planned.events.size(), every.events.size());
    EXPECT_EQ(planned.x, every.x);
    return static_cast<double>(every.statistics.guard_calls) /
           static_cast<double>(planned.statistics.guard_calls);
}

TEST(PlannedScenes, ACavernHasTheEventsOfACheckAtEveryStep)
{
    for (const bool skimming : {false, true}) {
        const Cavern system(cavern(skimming, 10'000, Cavern::Search::tree));
        saved_by_planning<FixedStep<Rk4>>(system, {.t_end = skimming ? 200.0 : 100, .step = 1e-3});
        saved_by_planning<ErrorControlled<Dopri5>>(system,
                                                   {.t_end = 500, .rtol = 1e-9, .atol = 1e-9});
    }
}

double saved_on_eigenvalue(double level)
{
    return saved_by_planning<FixedStep<Rk4>>(LeastEigenvalue({.level = level}),
                                             {.t_end = 20, .step = 1e-3});
}

TEST(PlannedScenes, AnEigenvalueIsComputedATwentyFifthAsOften)
{
    EXPECT_GE(saved_on_eigenvalue(1.3), 25);
}

TEST(PlannedScenes, AnEigenvalueWithManyEventsIsComputedATwentyFifthAsOften)
{
    EXPECT_GE(saved_on_eigenvalue(1.55), 25);
}

TEST(PlannedScenes, ZonesAndArmsHaveTheEventsOfACheckAtEveryStep)
{
    saved_by_planning<FixedStep<Rk4>>(Zones{}, {.t_end = 10, .step = 1e-3});
    saved_by_planning<FixedStep<Rk4>>(PlanarArm<4>({.obstacles = 8}), {.t_end = 60, .step = 1e-3});
}

// --- arm ---

template <std::size_t N>
void expect_same_run(std::size_t obstacles)
{
    ArmScene::Parameters p{.obstacles = obstacles};
    const PlanarArm<N> tree(p);
    p.search = ArmScene::Search::brute;
    const PlanarArm<N> brute(p);
    const Options options{.t_end = 10, .step = 1e-3};
    const auto a = integrate(tree, tree.start(), options, FixedStep<Rk4>{}, Ends{});
    const auto b = integrate(brute, brute.start(), options, FixedStep<Rk4>{}, Ends{});
    EXPECT_EQ(a.outcome, Outcome::reached_end);
    EXPECT_GT(a.events.size(), 1U);
    ASSERT_EQ(a.events.size(), b.events.size());
    for (std::size_t i = 0; i < a.events.size(); ++i) EXPECT_EQ(a.events[i].t, b.events[i].t);
    EXPECT_EQ(a.x, b.x);
}

TEST(PlanarArm, BothSearchesGiveTheSameRunToTheBit)
{
    expect_same_run<4>(8);
    expect_same_run<6>(40);
}

template <std::size_t N>
void expect_arm_bounds(std::size_t obstacles)
{
    const PlanarArm<N> system({.obstacles = obstacles});
    const auto run = sampled_run(system, system.start(), 200, 1e-3, 60'000);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.events.size(), 20U);
    expect_bounds_hold(sample_bounds(system, run, 0), 100'000, 0.3);
    for (std::size_t i = 0; i < run.trajectory.t.size(); ++i) {
        ASSERT_GT(system.guard(run.trajectory.t[i], run.trajectory.x[i]), -1e-9);
    }
}

TEST(PlanarArm, BoundsHoldAndTheArmStaysOutside)
{
    expect_arm_bounds<4>(8);
    expect_arm_bounds<6>(40);
}

TEST(PlanarArm, TheGuardChangesByNoMoreThanItsSlack)
{
    expect_slack_holds(PlanarArm<4>({.obstacles = 8}), {0, 0, 0, 0, 0, 0, 0, 0},
                       {3, 3, 3, 3, 1, 1, 1, 1}, 20'000);
    expect_slack_holds(PlanarArm<2>(), {0, 0, 0, 0}, {3, 3, 1, 1}, 20'000);
    const PlanarArm<2> arm({.obstacles = 8, .seed = 3});
    EXPECT_EQ(arm.parameter("obstacles"), 8.0);
    EXPECT_EQ(arm.parameter("seed"), 3.0);
    EXPECT_EQ(arm.parameter("joints"), std::nullopt);
}

TEST(PlanarArm, TheRateIsTheDerivativeOfTheGuard)
{
    const PlanarArm<4> system;
    const auto run = sampled_run(system, system.start(), 20, 1e-3, 2000);
    std::size_t compared = 0;
    for (std::size_t i = 0; i < run.trajectory.t.size(); ++i) {
        const auto& x = run.trajectory.x[i];
        PlanarArm<4>::State dxdt{};
        system.flow(run.trajectory.t[i], x, dxdt);
        const auto moved = [&](double by) {
            auto at = x;
            for (std::size_t k = 0; k < 4; ++k) at[k] += by * dxdt[k];
            return system.guard(0, at);
        };
        const double h = 1e-6;
        const double forward = (moved(h) - moved(0)) / h;
        const double backward = (moved(0) - moved(-h)) / h;
        // Kinks, where another point becomes the nearest, are rare; otherwise the second derivative
        // is speed² / distance, at most 1e2 / 0.02, times h.
        if (std::fabs(forward - backward) > 1e-2) continue;
        ++compared;
        EXPECT_NEAR(system.guard_rate(0, x, dxdt), (forward + backward) / 2, 1e-2);
    }
    EXPECT_GT(compared, 1900U);
}

TEST(PlanarArm, TheLowerBoundOftenTellsThatThereIsRoom)
{
    const PlanarArm<4> system({.obstacles = 8});
    const auto run = sampled_run(system, system.start(), 50, 1e-3, 5000);
    std::size_t far = 0, told = 0;
    for (std::size_t i = 0; i < run.trajectory.t.size(); ++i) {
        // Discs of radius 2 / 4 / 12 and cells of 4 / 256 cost 0.06 at most.
        if (system.guard(0, run.trajectory.x[i]) < 0.08) continue;
        ++far;
        if (system.lower_bound(0, run.trajectory.x[i]) > 0) ++told;
    }
    EXPECT_GT(far, 100U);
    EXPECT_EQ(told, far);
}

TEST(PlanarArm, WrongSetUpIsRefused)
{
    using geometry::Point2;
    const std::vector<Point2> away{{0, 5}, {1, 5}, {0, 6}};
    const std::vector<Point2> around{{-9, -9}, {9, -9}, {9, 9}, {-9, 9}};
    const auto sentence = [](const std::vector<std::vector<Point2>>& obstacles) {
        return refusal([&] { PlanarArm<4>(ArmScene::Parameters{}, obstacles); });
    };
    EXPECT_EQ(sentence({away}), "accepted");
    EXPECT_NE(sentence({}).find("no obstacle"), std::string::npos);
    EXPECT_NE(sentence({away, around}).find("obstacle 1 must leave link 0 free"),
              std::string::npos);
    EXPECT_NE(sentence({away, {{0, 5}, {nan, 5}, {0, 6}}}).find("obstacle 1: Outline: vertex 1"),
              std::string::npos);
    EXPECT_NE(sentence({away, {{0, 5}}}).find("obstacle 1"), std::string::npos);
    const auto with = [](ArmScene::Parameters p) { return refusal([&] { PlanarArm<4>{p}; }); };
    EXPECT_NE(with({.obstacles = 0}).find("obstacles"), std::string::npos);
    EXPECT_NE(with({.reach = nan}).find("reach"), std::string::npos);
    EXPECT_NE(with({.least_rate = 9}).find("least_rate"), std::string::npos);
    EXPECT_NE(with({.discs = 0}).find("discs"), std::string::npos);
    const PlanarArm<4> system;
    auto x = system.start();
    x[2] = nan;
    EXPECT_TRUE(std::isnan(system.guard(0, x)));
    EXPECT_EQ(system.lower_bound(0, x), -std::numeric_limits<double>::infinity());
}

// --- seen through a pinhole ---

template <class System>
concept HasSpeedBound = requires(const System& s, const typename System::State& x)
{
    s.speed_bound(0.0, x);
};

TEST(Opaque, ABlackBoxMeetsTheSameObstaclesAndCostsWhatItSays)
{
    const PlanarArm<4> arm({.obstacles = 8});
    const BlackBox box(arm, 20e-6);
    const Options options{.t_end = 10, .step = 1e-3};
    const auto known = integrate(arm, arm.start(), options, FixedStep<Rk4>{}, Ends{});
    const auto start = std::chrono::steady_clock::now();
    const auto run = integrate(box, box.start(), options, FixedStep<Rk4>{}, Ends{});
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    ASSERT_EQ(run.events.size(), known.events.size());
    ASSERT_GT(run.events.size(), 1U);
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        // Bisection and Newton's method converge to the same root of the step's map; later motion
        // magnifies their difference of a few units in the last place.
        EXPECT_NEAR(run.events[i].t, known.events[i].t, 1e-9);
    }
    EXPECT_GE(spent.count(), 20e-6 * static_cast<double>(run.statistics.guard_calls) * 0.99);
}

TEST(Opaque, AHiddenGuardHasNeitherRateNorBounds)
{
    using Arm = PlanarArm<4>;
    static_assert(RatedGuard<Arm, Arm::State> && !RatedGuard<Hidden<Arm>, Arm::State>);
    static_assert(!HasSpeedBound<Hidden<Arm>> && HasSpeedBound<Arm>);
    const Arm arm({.obstacles = 8});
    const Hidden hidden(arm);
    const Options options{.t_end = 10, .step = 1e-3};
    const auto known = integrate(arm, arm.start(), options, FixedStep<Rk4>{}, Ends{});
    const auto run = integrate(hidden, hidden.start(), options, FixedStep<Rk4>{}, Ends{});
    ASSERT_EQ(run.events.size(), known.events.size());
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_NEAR(run.events[i].t, known.events[i].t, 1e-9);
    }
    EXPECT_NE(refusal([&] { BlackBox(arm, 2); }).find("cost must lie in [0, 1] s"),
              std::string::npos);
    EXPECT_NE(refusal([&] { Hidden(arm, -1); }).find("cost"), std::string::npos);
}

}  // namespace
}  // namespace ricochet::scenes_test
