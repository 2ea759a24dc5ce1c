// Bodies in lasting contact with surfaces that move.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "ricochet/scene/simulate.hpp"

namespace ricochet::carried_test {
namespace {

constexpr double g = 9.81;

TEST(SceneCarried, ABallThatSticksToATableIsThrownWhereTheTableFallsFaster)
{
    // With e = 0.3 bounces end while the table pushes; the ball is thrown when the table's
    // acceleration, -a w^2 sin(w t), is that of gravity: sin(w t) = g / (a w^2). Groups are
    // released at the end of a step, and are of order 1: two steps.
    const Oscillation table{.amplitude = {0, 0.05}, .frequency = 3};
    const double w = 2 * std::numbers::pi * table.frequency;
    const double phase = std::asin(g / (table.amplitude[1] * w * w));
    for (const double step : {1e-3, 1e-4}) {
        Scene scene({.gravity = {0, -g}});
        const MaterialId clay = scene.material({.restitution = 0.3});
        scene.wall({.normal = {0, 1}, .material = clay, .motion = table});
        scene.disc({.at = {0, 0.2}, .radius = 0.1, .material = clay});
        const SceneRun run =
            simulate(scene, {.t_end = 2.9, .contacts = scene_contacts(), .contact_step = step});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        std::size_t thrown = 0;
        for (const SceneEvent& event : run.events) {
            if (event.kind != SceneEvent::Kind::released) continue;
            const double turns = (event.t * w - phase) / (2 * std::numbers::pi);
            EXPECT_NEAR(event.t, (phase + 2 * std::numbers::pi * std::round(turns)) / w, 2 * step);
            ++thrown;
        }
        EXPECT_GE(thrown, 7u);
    }
}

TEST(SceneCarried, AStackSleepsOnAFloorUntilTheFloorMoves)
{
    Scene scene({.gravity = {0, -g}});
    const MaterialId clay = scene.material({.restitution = 0.5, .friction = 0.3});
    scene.wall(
        {.normal = {0, 1}, .material = clay, .motion = PiecewiseLinear{{1, 2}, {{0, 0}, {0, 1}}}});
    scene.disc({.at = {0, 0.5}, .radius = 0.5, .material = clay});
    scene.disc({.at = {0, 1.5}, .radius = 0.5, .material = clay});
    const SceneRun run =
        simulate(scene, {.t_end = 6, .contacts = scene_contacts(), .sample_times = {0.99, 1.5}});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_TRUE(run.samples[0][0].asleep);
    EXPECT_EQ(run.samples[0][1].at, (Vector2{0, 1.5}));
    EXPECT_FALSE(run.samples[1][0].asleep);
    EXPECT_NEAR(run.samples[1][1].at[1], 2, 1e-12);
    // Carried up by 1 m, thrown when it stops, and asleep again.
    EXPECT_TRUE(run.bodies[1].asleep);
    EXPECT_NEAR(run.bodies[1].at[1], 2.5, 1e-12);
}

TEST(SceneCarried, APileOnAShakenFloorStaysAboveIt)
{
    const Oscillation shaken{.amplitude = {0, 0.02}, .frequency = 5};
    Scene scene({.gravity = {0, -g}});
    const MaterialId clay = scene.material({.restitution = 0.4, .friction = 0.2});
    scene.wall({.normal = {0, 1}, .material = clay, .motion = shaken});
    scene.wall({.normal = {1, 0}, .material = clay});
    scene.wall({.point = {2, 0}, .normal = {-1, 0}, .material = clay});
    for (int i = 0; i < 12; ++i) {
        scene.disc({.at = {0.2 + 0.3 * (i % 6) + 0.02 * (i / 6), 0.3 + 0.4 * (i / 6)},
                    .radius = 0.1,
                    .material = clay});
    }
    std::vector<double> times(151);
    for (std::size_t k = 0; k < times.size(); ++k) times[k] = 0.01 * static_cast<double>(k);
    const SceneRun run =
        simulate(scene, {.t_end = 1.5, .contacts = scene_contacts(), .sample_times = times});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    // Within a step of h = 1e-3 the floor moves straight: a w^2 h^2 / 8 = 2.5e-6 m off its motion.
    for (std::size_t k = 0; k < times.size(); ++k) {
        for (const BodyState& body : run.samples[k]) {
            EXPECT_GE(body.at[1] - 0.1 - displacement(shaken, times[k])[1], -2.6e-6);
        }
    }
}

TEST(SceneCarried, WhatIsCrushedEndsTheRunWithASentence)
{
    Scene scene;
    const MaterialId clay = scene.material({.restitution = 0.5});
    scene.wall({.normal = {-1, 0}, .material = clay});
    scene.wall(
        {.point = {-3, 0}, .normal = {1, 0}, .material = clay, .motion = ConstantVelocity{{1, 0}}});
    scene.disc({.name = "egg", .at = {-1, 0}, .radius = 0.5, .material = clay});
    const SceneRun run = simulate(scene, {.t_end = 6, .contacts = scene_contacts()});
    EXPECT_EQ(run.outcome, Outcome::not_converged);
    EXPECT_NEAR(run.t, 2, 1e-9);
    EXPECT_NE(run.message.find("egg"), std::string::npos);
}

}  // namespace
}  // namespace ricochet::carried_test
