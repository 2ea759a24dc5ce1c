// Restitution by pair and by speed, and thermal walls.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "ricochet/scene/simulate.hpp"

namespace ricochet::materials_test {

namespace {

/// A disc of radius 0.1 that bounces between two walls with a gap of 0.8 for its centre.
Scene between_walls(const Material& body, const Material& wall, const Vector2& velocity)
{
    Scene scene;
    const MaterialId one = scene.material(body);
    const MaterialId two = scene.material(wall);
    scene.wall({.point = {0, 0}, .normal = {1, 0}, .material = two});
    scene.wall({.point = {1, 0}, .normal = {-1, 0}, .material = two});
    scene.disc({.at = {0.5, 0}, .velocity = velocity, .radius = 0.1, .material = one});
    return scene;
}

std::string refusal(const Material& material)
{
    Scene scene;
    try {
        scene.material(material);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

}  // namespace

TEST(SceneMaterials, APairHasItsOwnCoefficients)
{
    // Steel on steel 0.9, rubber on rubber 0.5: without a pair the smaller of both; with one, its
    // own, larger than either.
    for (const bool with_pair : {false, true}) {
        Scene scene;
        const auto steel = scene.material({.name = "steel", .restitution = 0.9, .friction = 0.1});
        const auto rubber = scene.material({.name = "rubber", .restitution = 0.5, .friction = 1});
        if (with_pair) {
            scene.pair({.between = {rubber, steel}, .restitution = 0.95, .friction = 0.25});
        }
        scene.wall({.normal = {0, 1}, .material = steel});
        scene.disc({.at = {0, 2}, .velocity = {3, -1}, .radius = 1, .material = rubber});
        const SceneRun run = simulate(scene, {.t_end = 2});
        ASSERT_EQ(run.events.size(), 1U);
        const double e = with_pair ? 0.95 : 0.5;
        const double mu = with_pair ? 0.25 : 0.1;
        EXPECT_NEAR(run.events[0].after[0][1], e, 1e-15);
        EXPECT_NEAR(run.events[0].after[0][0], 3 - mu * (1 + e), 1e-15);
    }
}

TEST(SceneMaterials, RestitutionFollowsThePowerOfTheSpeed)
{
    // e(v) = 1 - (1 - 0.6) (v / 2)^0.75, 0.6 above 2 m/s: a recursion for the speeds.
    const Scene scene = between_walls(
        {.restitution = 0.6, .by_speed = PowerOfSpeed{.speed = 2, .exponent = 0.75}}, {}, {8, 0});
    const SceneRun run = simulate(scene, {.t_end = 5});
    ASSERT_GT(run.events.size(), 6U);
    double v = 8;
    double t = 0.4 / 8;
    for (const SceneEvent& event : run.events) {
        EXPECT_NEAR(event.t, t, 1e-13 * (1 + t));
        EXPECT_NEAR(std::fabs(event.before[0][0]), v, 1e-14 * v);
        v *= v >= 2 ? 0.6 : 1 - 0.4 * std::pow(v / 2, 0.75);
        EXPECT_NEAR(std::fabs(event.after[0][0]), v, 1e-14 * v);
        t += 0.8 / v;
    }
}

TEST(SceneMaterials, TablesAndFunctionsAreFollowedAndTheSmallerApplies)
{
    const TableOfSpeed table{.speeds = {1, 3}, .restitutions = {0.9, 0.5}};
    EXPECT_DOUBLE_EQ(restitution_at(table, 1, 0.5), 0.9);
    EXPECT_DOUBLE_EQ(restitution_at(table, 1, 2), 0.7);
    EXPECT_DOUBLE_EQ(restitution_at(table, 1, 4), 0.5);
    EXPECT_EQ(restitution_at([](double v) { return 2 - v; }, 0.3, 0.5), 1);
    const Scene scene = between_walls(
        {.by_speed = table}, {.by_speed = [](double v) { return v > 1.2 ? 0.8 : 0.1; }}, {2, 0});
    const SceneRun run = simulate(scene, {.t_end = 3});
    ASSERT_GE(run.events.size(), 3U);
    EXPECT_NEAR(run.events[0].after[0][0], -2 * 0.7, 1e-15);
    EXPECT_NEAR(run.events[1].after[0][0], 1.4 * 0.8, 1e-15);
    EXPECT_NEAR(run.events[2].after[0][0], -1.12 * 0.1, 1e-15);
}

TEST(SceneMaterials, AThermalWallSendsAGasOfItsTemperatureBack)
{
    // Discs of mass 2 between thermal walls with kT = 3. What leaves a wall has the density of a
    // flux: the mean of v_n^2 is 2 kT / m with the standard deviation 2 kT / m, that of v_t^2 is kT
    // / m with sqrt(2) kT / m; both are compared within 4 standard errors, and so is v_t with 0.
    Scene scene;
    scene.wall({.point = {0, 0}, .normal = {1, 0}, .temperature = 3});
    scene.wall({.point = {1, 0}, .normal = {-1, 0}, .temperature = 3});
    for (int i = 0; i < 20; ++i) {
        scene.disc({.at = {0.5, 100.0 * i}, .velocity = {1, 0}, .radius = 0.1, .mass = 2});
    }
    const SceneRun run = simulate(scene, {.t_end = 400, .seed = 7});
    double normal = 0;
    double across = 0;
    double mean = 0;
    double count = 0;
    for (const SceneEvent& event : run.events) {
        if (!event.other.is_surface) continue;
        normal += std::pow(event.after[0][0], 2);
        across += std::pow(event.after[0][1], 2);
        mean += event.after[0][1];
        count += 1;
        EXPECT_NEAR(event.impulse[0], 2 * (event.after[0][0] - event.before[0][0]), 1e-13);
        EXPECT_NEAR(event.impulse[1], 2 * (event.after[0][1] - event.before[0][1]), 1e-13);
    }
    ASSERT_GT(count, 5000);
    EXPECT_NEAR(normal / count, 3, 4 * 3 / std::sqrt(count));
    EXPECT_NEAR(across / count, 1.5, 4 * 1.5 * std::sqrt(2 / count));
    EXPECT_NEAR(mean / count, 0, 4 * std::sqrt(1.5 / count));
}

TEST(SceneMaterials, ThermalWallsRepeatWithTheirSeed)
{
    Scene scene;
    scene.wall({.point = {0, 0}, .normal = {1, 0}, .temperature = 1});
    scene.wall({.point = {1, 0}, .normal = {-1, 0}, .temperature = 1});
    scene.disc({.at = {0.5, 0}, .velocity = {1, 0}, .radius = 0.1});
    const SceneRun one = simulate(scene, {.t_end = 10});
    const SceneRun again = simulate(scene, {.t_end = 10, .sample_times = {1, 2, 5}});
    const SceneRun other = simulate(scene, {.t_end = 10, .seed = 2});
    ASSERT_EQ(one.events.size(), again.events.size());
    for (std::size_t k = 0; k < one.events.size(); ++k) {
        EXPECT_EQ(one.events[k].after, again.events[k].after);
    }
    EXPECT_NE(one.events[0].after, other.events[0].after);
}

TEST(SceneMaterials, WhatIsNoMaterialIsRefused)
{
    EXPECT_EQ(refusal({.name = "a", .by_speed = PowerOfSpeed{.speed = 0}}),
              "Scene: material \"a\": speed must be positive and finite, got 0");
    EXPECT_EQ(
        refusal({.name = "a", .by_speed = TableOfSpeed{.speeds = {1}}}),
        "Scene: material \"a\": expected as many restitutions as speeds, and one at least, got 0 "
        "and 1");
    EXPECT_EQ(
        refusal({.name = "a", .by_speed = TableOfSpeed{.speeds = {1, 1}, .restitutions = {0, 0}}}),
        "Scene: material \"a\": a speed must be finite and above the one before it, 1, got 1");
    Scene scene;
    const auto steel = scene.material({.name = "steel"});
    scene.pair({.between = {steel, steel}, .restitution = 0.5});
    EXPECT_THROW(scene.pair({.between = {steel, steel}}), std::invalid_argument);
    EXPECT_THROW(scene.pair({.between = {steel, MaterialId{9}}}), std::invalid_argument);
    EXPECT_THROW(scene.wall({.normal = {0, 1}, .temperature = -1}), std::invalid_argument);
}

TEST(SceneMaterials, FilesHaveThem)
{
    const SceneFile file = read_scene(R"({
        "materials": {"steel": {"restitution": {"above": 0.7, "speed": 2, "exponent": 0.2}},
                      "clay": {"restitution": {"speeds": [0, 1], "restitutions": [0.8, 0.1]}}},
        "pairs": [{"between": ["clay", "steel"], "restitution": 0.25, "friction": 0.5}],
        "walls": [{"point": [0, 0], "normal": [0, 1], "temperature": 2}],
        "run": {"t_end": 1, "seed": 12}})");
    EXPECT_EQ(file.options.seed, 12U);
    EXPECT_EQ(file.scene.surfaces()[0].temperature, 2);
    const auto materials = file.scene.materials();
    ASSERT_EQ(materials.size(), 3U);
    for (const Material& material : materials) {
        if (material.name == "steel") {
            EXPECT_EQ(std::get<PowerOfSpeed>(material.by_speed).exponent, 0.2);
            EXPECT_EQ(material.restitution, 0.7);
        }
    }
    EXPECT_EQ(file.scene.pair_of(1, 2)->friction, 0.5);
    const auto message = [](const std::string& text) {
        try {
            static_cast<void>(read_scene(text, "s.json"));
        } catch (const SceneFileError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(message(R"({"materials": {"a": {}}, "pairs": [{"between": ["a", "b"]}]})"),
              "s.json:1: there is no material \"b\", the nearest known is \"a\"");
    EXPECT_EQ(message(R"({"materials": {"a": {"restitution": {"above": 0.5}}}})"),
              "s.json:1: expected \"speed\" in a restitution");
}

}  // namespace ricochet::materials_test
