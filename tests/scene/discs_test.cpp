// Discs in a box: against brute force, conservation, labels, reversal; single bodies.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/scene/simulate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "scene/brute_force.hpp"
#include "scene/gas.hpp"

namespace ricochet::discs_test {
namespace {

using test::BruteForce;
using test::gas;

TEST(Discs, TheFirstSixtyCollisionsAreThoseOfBruteForceInLongDouble)
{
    // An error grows by the ratio of a free path to a radius, some 5 times, at every collision of
    // a disc: with ten discs 60 collisions are 12 a disc, and 1e-16 becomes 1e-16 5^12 = 2.4e-8;
    // the first 20 are 4 a disc, 6e-14.
    for (unsigned seed = 1; seed <= 5; ++seed) {
        const Scene scene = gas({.count = 10, .fraction = 0.2, .spread = 0.3, .seed = seed});
        const SceneRun run = simulate(scene, {.t_end = 100, .max_events = 60});
        ASSERT_EQ(run.outcome, Outcome::step_limit);
        ASSERT_EQ(run.events.size(), 60u);
        BruteForce exact(scene);
        for (std::size_t k = 0; k < 60; ++k) {
            EXPECT_NEAR(run.events[k].t, static_cast<double>(exact.next()), k < 20 ? 1e-12 : 1e-6)
                << k;
        }
    }
}

TEST(Discs, EnergyStaysAndNothingOverlaps)
{
    // Samples are at arbitrary times: discs that overlap there have overlapped at their last
    // collision. Of equal discs the collisions themselves are sampled, where they are nearest.
    for (const std::size_t count : {10, 100, 1000}) {
        const Scene scene = gas({.count = count});
        SceneOptions options{.t_end = 3e4 / std::pow(static_cast<double>(count), 1.5)};
        const SceneRun first = simulate(scene, options);
        options.record_events = false;
        for (std::size_t k = 1; k <= 20; ++k) {
            options.sample_times.push_back(first.events[k * (first.events.size() - 1) / 20].t);
        }
        const SceneRun run = simulate(scene, options);
        EXPECT_GT(run.statistics.impacts, 10'000u) << count;
        EXPECT_NEAR(energy(scene, run.bodies) / energy(scene, test::start_of(scene)), 1, 1e-12);
        for (const auto& states : run.samples) {
            EXPECT_LE(test::overlap(scene, states), 1e-13 * 2 * scene.bodies()[0].radius) << count;
        }
    }
    const Scene scene = gas({.count = 30, .spread = 0.4});
    SceneOptions options{.t_end = 600, .record_events = false};
    for (int k = 1; k <= 100; ++k) options.sample_times.push_back(6.0 * k);
    const SceneRun run = simulate(scene, options);
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.statistics.impacts, 20'000u);
    const double start = energy(scene, test::start_of(scene));
    EXPECT_NEAR(energy(scene, run.bodies) / start, 1, 1e-12);
    double largest = 0;
    for (const auto& states : run.samples)
        largest = std::max(largest, test::overlap(scene, states));
    double radius = 0;
    for (const Disc& disc : scene.bodies()) radius = std::max(radius, disc.radius);
    EXPECT_LE(largest, 1e-13 * 2 * radius);
}

TEST(Discs, OtherLabelsGiveTheSameBits)
{
    for (const std::size_t count : {10, 60, 1000}) {
        std::vector<std::size_t> order(count);
        std::iota(order.begin(), order.end(), 0u);
        std::shuffle(order.begin(), order.end(), std::mt19937(7));
        const test::Gas wanted{.count = count,
                               .restitution = count < 1000 ? 1 : 0.99,
                               .gravity = {0.1, -1},
                               .spread = 0.2};
        const double t_end = count < 1000 ? 20 : 0.5;
        const SceneRun one = simulate(gas(wanted), {.t_end = t_end});
        const SceneRun two = simulate(gas(wanted, order), {.t_end = t_end});
        ASSERT_EQ(one.events.size(), two.events.size());
        EXPECT_GT(one.events.size(), t_end * static_cast<double>(count));
        for (std::size_t k = 0; k < one.events.size(); ++k) {
            ASSERT_EQ(one.events[k].t, two.events[k].t) << k;
        }
        for (std::size_t k = 0; k < count; ++k) {
            EXPECT_EQ(one.bodies[order[k]].at, two.bodies[k].at);
            EXPECT_EQ(one.bodies[order[k]].velocity, two.bodies[k].velocity);
        }
    }
}

TEST(Discs, SamplesChangeNoBit)
{
    const Scene scene = gas({.count = 20, .gravity = {0, -2}});
    const SceneRun plain = simulate(scene, {.t_end = 10});
    SceneOptions options{.t_end = 10};
    for (int k = 0; k < 1000; ++k) options.sample_times.push_back(0.01 * k);
    const SceneRun sampled = simulate(scene, options);
    ASSERT_EQ(sampled.samples.size(), 1000u);
    for (std::size_t i = 0; i < plain.bodies.size(); ++i) {
        EXPECT_EQ(plain.bodies[i].at, sampled.bodies[i].at);
        EXPECT_EQ(plain.bodies[i].velocity, sampled.bodies[i].velocity);
    }
}

TEST(Discs, ReversedVelocitiesLeadBack)
{
    // Four collisions a disc and back are eight: 1e-16 5^8 = 4e-11.
    for (const std::size_t count : {10, 100, 1000}) {
        const Scene scene = gas({.count = count});
        const SceneRun there = simulate(scene, {.t_end = 100, .max_events = 2 * count});
        Scene turned;
        for (const Scene::Surface& s : scene.surfaces()) {
            turned.wall({.point = s.points[0], .normal = s.normal});
        }
        for (std::size_t i = 0; i < count; ++i) {
            Disc disc = scene.bodies()[i];
            disc.material = {};
            disc.at = there.bodies[i].at;
            disc.velocity = {-there.bodies[i].velocity[0], -there.bodies[i].velocity[1]};
            turned.disc(disc);
        }
        const SceneRun back = simulate(turned, {.t_end = there.t});
        for (std::size_t i = 0; i < count; ++i) {
            for (std::size_t c = 0; c < 2; ++c) {
                EXPECT_NEAR(back.bodies[i].at[c], scene.bodies()[i].at[c], 1e-10) << count;
            }
        }
    }
}

TEST(Discs, InelasticCollapseComesToAnEnd)
{
    // Three discs on a line, restitution 0.05: below 7 - 4 sqrt(3) = 0.0718 the outer ones trap the
    // middle one, and infinitely many collisions take a finite time.
    Scene scene;
    const MaterialId putty = scene.material({.restitution = 0.05});
    for (const double x : {0.0, 2.0, 3.0}) {
        scene.disc({.at = {x, 0}, .velocity = {1 - x / 1.5, 0}, .radius = 0.25, .material = putty});
    }
    const SceneRun run = simulate(scene, {.t_end = 10});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    for (const BodyState& body : run.bodies) {
        EXPECT_NEAR(body.velocity[0], (1 - 1.0 / 3 - 1) / 3, 1e-14);
    }
}

TEST(Discs, ADenseGasOfLittleRestitutionComesToAnEnd)
{
    // With collisions taken one after another this gas stops at a time near 1.
    const Scene scene = gas({.count = 30, .fraction = 0.5, .restitution = 0.3});
    const SceneRun run = simulate(scene, {.t_end = 1.5, .record_events = false});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_LT(energy(scene, run.bodies), 0.1 * energy(scene, test::start_of(scene)));
    EXPECT_LE(test::overlap(scene, run.bodies), 1e-13);
}

TEST(Discs, RecentImpactsAreElasticWhereThatIsAskedFor)
{
    Scene scene;
    const MaterialId putty = scene.material({.restitution = 0.05});
    for (const double x : {0.0, 2.0, 3.0}) {
        scene.disc({.at = {x, 0}, .velocity = {1 - x / 1.5, 0}, .radius = 0.25, .material = putty});
    }
    const SceneRun run = simulate(scene, {.t_end = 10, .elastic_within = 1e-4});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.statistics.collapses, 0u);
    EXPECT_GT(run.events.size(), 3u);
}

TEST(Discs, BallsThatMeetNoneBounceAsEachDoesByItself)
{
    // Impact k of a drop from h: t0 (1 + 2 (e + ... + e^k)), t0 = sqrt(2 h / g). `integrate` finds
    // the same up to its own errors.
    const double g = 9.81;
    Scene scene({.gravity = {0, -g}});
    const MaterialId steel = scene.material({.restitution = 0.9});
    scene.wall({.normal = {0, 1}, .material = steel});
    for (int i = 0; i < 20; ++i) {
        scene.disc({.at = {i * 1.0, 1.25 + 0.1 * i}, .radius = 0.25, .material = steel});
    }
    const SceneRun run = simulate(scene, {.t_end = 6});
    EXPECT_EQ(run.statistics.alone, 20u);
    EXPECT_TRUE(std::ranges::is_sorted(run.events, {}, &SceneEvent::t));
    for (std::uint32_t i = 0; i < 20; ++i) {
        std::vector<double> times;
        for (const SceneEvent& event : run.events) {
            if (event.body == i) times.push_back(event.t);
        }
        const double t0 = std::sqrt(2 * (1 + 0.1 * i) / g);
        double sum = t0;
        double flight = 2 * t0;
        const auto ball = integrate(BouncingBall({.gravity = g, .restitution = 0.9}),
                                    {1 + 0.1 * i, 0.0}, {.t_end = 6});
        ASSERT_EQ(times.size(), ball.events.size());
        for (std::size_t k = 0; k < times.size(); ++k) {
            EXPECT_NEAR(times[k], sum, 1e-14 * (1 + sum));
            EXPECT_NEAR(times[k], ball.events[k].t, 1e-12);
            sum += flight *= 0.9;
        }
    }
}

TEST(Discs, ABallAloneBouncesFromTheStartAsAfterASearch)
{
    // A sample at the start makes the run search for the first impact; otherwise it is computed
    // directly. The cases are discs and points, inclined, slow, inelastic, with friction, and
    // beginning at a late time.
    std::mt19937_64 random(7);
    const auto any = [&](double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random);
    };
    std::size_t impacts = 0;
    for (int k = 0; k < 2000; ++k) {
        const double incline = k % 3 == 0 ? any(-1, 1) : 0;
        const double pull = k % 5 == 0 ? any(-0.5, 0.5) : 0;
        Scene scene({.gravity = {9.81 * std::sin(pull), -9.81 * std::cos(pull)}});
        const std::array restitutions{0.0, 1e-9, 0.5, 0.9, 1.0};
        const MaterialId material =
            scene.material({.restitution = restitutions[static_cast<std::size_t>(k) % 5],
                            .friction = k % 4 == 0 ? 0.3 : 0});
        const Vector2 normal{std::sin(incline), std::cos(incline)};
        scene.wall({.normal = normal, .material = material});
        const double radius = k % 8 < 4 ? 0.25 : 0;
        const double height = radius + (k % 7 == 0 ? 1e-12 : any(0, 3));
        const Vector2 at{height * normal[0], height * normal[1]};
        const Vector2 velocity{k % 2 == 0 ? 0 : any(-2, 2), any(-2, 2)};
        const double mass = any(0.5, 2);
        if (radius > 0) {
            scene.disc({.at = at,
                        .velocity = velocity,
                        .radius = radius,
                        .mass = mass,
                        .material = material});
        } else {
            scene.point({.at = at, .velocity = velocity, .mass = mass, .material = material});
        }
        SceneOptions options{.t_start = k % 6 == 0 ? any(-1e3, 1e3) : 0};
        options.t_end = options.t_start + any(0.5, 5);
        const SceneRun direct = simulate(scene, options);
        options.sample_times = {options.t_start};
        const SceneRun searched = simulate(scene, options);
        ASSERT_EQ(direct.outcome, searched.outcome) << k;
        ASSERT_EQ(direct.statistics.impacts, searched.statistics.impacts) << k;
        ASSERT_EQ(direct.events.size(), searched.events.size()) << k;
        for (std::size_t e = 0; e < direct.events.size(); ++e) {
            EXPECT_EQ(direct.events[e].t, searched.events[e].t) << k;
            EXPECT_EQ(direct.events[e].before, searched.events[e].before) << k;
            EXPECT_EQ(direct.events[e].after, searched.events[e].after) << k;
            EXPECT_EQ(direct.events[e].impulse, searched.events[e].impulse) << k;
        }
        EXPECT_EQ(direct.bodies[0].at, searched.bodies[0].at) << k;
        EXPECT_EQ(direct.bodies[0].velocity, searched.bodies[0].velocity) << k;
        EXPECT_EQ(direct.bodies[0].asleep, searched.bodies[0].asleep) << k;
        impacts += direct.statistics.impacts;
    }
    EXPECT_GT(impacts, 10'000u);
}

TEST(Discs, ABallWithDragBouncesAloneAsBelowAFarCeiling)
{
    // Alone above the only wall, impacts are resolved without a search for contacts.
    std::mt19937_64 random(11);
    const auto any = [&](double from, double to) {
        return std::uniform_real_distribution<>(from, to)(random);
    };
    std::uint64_t impacts = 0;
    for (int k = 0; k < 300; ++k) {
        const std::array restitutions{0.0, 1e-9, 0.5, 0.9, 1.0};
        const double restitution = restitutions[static_cast<std::size_t>(k) % 5];
        const double friction = k % 4 == 0 ? 0.3 : 0;
        const double incline = k % 3 == 0 ? any(-1, 1) : 0;
        const Vector2 normal{std::sin(incline), std::cos(incline)};
        const double height = 0.25 + any(0, 3);
        const double speed = any(-2, 2);
        const double drag = std::exp(any(-14, 1));
        const double mass = any(0.5, 2);
        const auto run = [&](bool ceiling) {
            Scene scene({.gravity = {0, -9.81}});
            const MaterialId material =
                scene.material({.restitution = restitution, .friction = friction});
            scene.wall({.normal = normal, .material = material});
            if (ceiling)
                scene.wall({.point = {1e3 * normal[0], 1e3 * normal[1]},
                            .normal = {-normal[0], -normal[1]}});
            scene.disc({.at = {height * normal[0], height * normal[1]},
                        .velocity = {k % 2 == 0 ? 0 : speed, speed},
                        .radius = 0.25,
                        .mass = mass,
                        .drag = drag,
                        .material = material});
            return simulate(scene, {.t_end = 5, .max_events = 2000});
        };
        const SceneRun alone = run(false);
        const SceneRun below = run(true);
        ASSERT_EQ(alone.outcome, below.outcome) << k;
        ASSERT_EQ(alone.statistics.impacts, below.statistics.impacts) << k;
        ASSERT_EQ(alone.statistics.waves, below.statistics.waves) << k;
        ASSERT_EQ(alone.events.size(), below.events.size()) << k;
        for (std::size_t e = 0; e < alone.events.size(); ++e) {
            EXPECT_EQ(alone.events[e].t, below.events[e].t) << k;
            EXPECT_EQ(alone.events[e].number, below.events[e].number) << k;
            EXPECT_EQ(alone.events[e].before, below.events[e].before) << k;
            EXPECT_EQ(alone.events[e].after, below.events[e].after) << k;
            EXPECT_EQ(alone.events[e].impulse, below.events[e].impulse) << k;
        }
        EXPECT_EQ(alone.bodies[0].at, below.bodies[0].at) << k;
        EXPECT_EQ(alone.bodies[0].velocity, below.bodies[0].velocity) << k;
        impacts += alone.statistics.impacts;
    }
    EXPECT_GT(impacts, 1000u);
}

TEST(Discs, ABallThatBouncesAloneCanBeCancelled)
{
    Scene scene({.gravity = {0, -9.81}});
    scene.wall({.normal = {0, 1}});
    scene.disc({.at = {0, 1.5}, .radius = 0.25});
    const std::atomic<bool> cancelled = true;
    const SceneRun run = simulate(scene, {.t_end = 1e7, .cancelled = &cancelled});
    EXPECT_EQ(run.outcome, Outcome::cancelled);
    EXPECT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.t, run.events[0].t);
}

TEST(Discs, FrictionActsAtEveryBounceWhereGravityPullsAlongTheWall)
{
    // The first impact stops the slip, and gravity makes the ball slip again. With a second wall,
    // far away, the ball is the same.
    const auto run = [](bool second_wall) {
        Scene scene({.gravity = {1, -9.81}});
        const MaterialId rough = scene.material({.restitution = 0.5, .friction = 0.9});
        scene.wall({.normal = {0, 1}, .material = rough});
        if (second_wall) scene.wall({.point = {-1000, 0}, .normal = {1, 0}, .material = rough});
        scene.disc(
            {.at = {0, 1.3}, .velocity = {0.3, 0}, .radius = 0.25, .mass = 1, .material = rough});
        return simulate(scene, {.t_end = 1.2});
    };
    const SceneRun one = run(false);
    const SceneRun two = run(true);
    ASSERT_EQ(one.events.size(), 3u);
    ASSERT_EQ(two.events.size(), 3u);
    for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(one.events[k].t, two.events[k].t, 1e-14);
        EXPECT_NEAR(one.events[k].after[0][0], 0, 1e-15);  // friction stops the slip
        EXPECT_NEAR(two.events[k].after[0][0], 0, 1e-15);
    }
    EXPECT_NEAR(one.bodies[0].at[0], two.bodies[0].at[0], 1e-14);
}

TEST(Discs, WhatACeilingSendsBackMeetsOthers)
{
    // With g = 0.2: the lower disc reaches the ceiling at 9 after 1.0 s and comes back, where it
    // would still be above the other one without a ceiling.
    for (const double up : {1.0, -1.0}) {
        for (const bool floor_first : {true, false}) {
            Scene scene({.gravity = {0, -0.2 * up}});
            for (const bool low : {floor_first, !floor_first}) {
                scene.wall(
                    {.point = {0, low ? -30.0 * up : 10.0 * up}, .normal = {0, low ? up : -up}});
            }
            scene.disc({.at = {0, 0}, .velocity = {0, 9.1 * up}});
            scene.disc({.at = {0.5, -8 * up}});
            const SceneRun run = simulate(scene, {.t_end = 3});
            ASSERT_EQ(run.events.size(), 2u) << up << floor_first;
            EXPECT_NEAR(run.events[0].t, 1.0, 1e-9);
            EXPECT_FALSE(run.events[1].other.is_surface);
        }
    }
}

TEST(Discs, SleepersAreStruckAndHaveNoEventsBefore)
{
    // One after the other along a row of equal discs: the velocity is passed on.
    Scene scene;
    for (int i = 0; i < 100; ++i) scene.disc({.at = {3.0 * i, 0}});
    scene.disc({.at = {-5, 0}, .velocity = {1, 0}});
    const SceneRun run = simulate(scene, {.t_end = 49.5});
    ASSERT_EQ(run.events.size(), 47u);
    for (std::size_t k = 0; k < run.events.size(); ++k) {
        EXPECT_DOUBLE_EQ(run.events[k].t, 3.0 + static_cast<double>(k));
    }
    EXPECT_EQ(run.statistics.events, 47u);
    EXPECT_FALSE(run.bodies[46].asleep && run.bodies[46].velocity[0] != 0);
    EXPECT_TRUE(run.bodies[60].asleep);
}

TEST(Discs, AFastDiscPaysForNoCells)
{
    Scene scene;
    scene.disc({.at = {0, 0}, .velocity = {1e6, 0}, .radius = 0.05});
    scene.disc({.at = {1e6, 0}, .radius = 0.05});
    const SceneRun run = simulate(scene, {.t_end = 10});
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_DOUBLE_EQ(run.events[0].t, (1e6 - 0.1) / 1e6);
    EXPECT_LE(run.statistics.crossings, 4U);
}

}  // namespace
}  // namespace ricochet::discs_test
