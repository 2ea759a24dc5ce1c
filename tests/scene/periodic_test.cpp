// Scenes whose cell repeats along one axis or both.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "ricochet/scene/simulate.hpp"
#include "scene/options.hpp"

namespace ricochet::periodic_test {

namespace {

/// Discs on a shaken lattice in the unit torus, with velocities whose sum is zero.
std::vector<Disc> discs(std::size_t columns, double fraction)
{
    const std::size_t count = columns * columns;
    const double pitch = 1.0 / static_cast<double>(columns);
    const double radius = std::sqrt(fraction / (static_cast<double>(count) * std::numbers::pi));
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::vector<Disc> out(count);
    Vector2 mean{};
    for (std::size_t k = 0; k < count; ++k) {
        Disc& disc = out[k];
        disc.radius = radius;
        const double play = 0.5 * (pitch / 2 - radius);
        disc.at = {(static_cast<double>(k % columns) + 0.25) * pitch + play * uniform(generator),
                   (static_cast<double>(k / columns) + 0.25) * pitch + play * uniform(generator)};
        for (double& x : disc.at) x -= std::floor(x);
        disc.velocity = {uniform(generator), uniform(generator)};
        for (std::size_t c = 0; c < 2; ++c)
            mean[c] += disc.velocity[c] / static_cast<double>(count);
    }
    for (Disc& disc : out) {
        for (std::size_t c = 0; c < 2; ++c) disc.velocity[c] -= mean[c];
    }
    return out;
}

Scene torus(const std::vector<Disc>& discs)
{
    Scene scene({.period = {1, 1}});
    for (const Disc& disc : discs) scene.disc(disc);
    return scene;
}

/// Times of the first collisions of discs on the unit torus, by trying all images of all pairs
/// after each of them.
std::vector<double> tried(std::vector<Disc> discs, std::size_t count)
{
    std::vector<double> times;
    double t = 0;
    std::array<std::size_t, 2> last{};
    while (times.size() < count) {
        double first = 1e9;
        std::array<std::size_t, 2> pair{};
        Vector2 normal{};
        for (std::size_t i = 0; i < discs.size(); ++i) {
            for (std::size_t j = 0; j < i; ++j) {
                for (int k = 0; k < 25; ++k) {
                    const Vector2 d{discs[i].at[0] - discs[j].at[0] + k % 5 - 2,
                                    discs[i].at[1] - discs[j].at[1] + k / 5 - 2};
                    const Vector2 v{discs[i].velocity[0] - discs[j].velocity[0],
                                    discs[i].velocity[1] - discs[j].velocity[1]};
                    const double reach = discs[i].radius + discs[j].radius;
                    const double b = d[0] * v[0] + d[1] * v[1];
                    const double square = v[0] * v[0] + v[1] * v[1];
                    const double c = d[0] * d[0] + d[1] * d[1] - reach * reach;
                    const double root = b * b - square * c;
                    if (b >= 0 || root < 0) continue;
                    if (last == std::array{i, j} && c < 1e-12) continue;
                    const double s = c / (std::sqrt(root) - b);
                    if (s >= first) continue;
                    first = s;
                    pair = {i, j};
                    normal = {(d[0] + s * v[0]) / reach, (d[1] + s * v[1]) / reach};
                }
            }
        }
        for (Disc& disc : discs) {
            for (std::size_t c = 0; c < 2; ++c) {
                disc.at[c] += first * disc.velocity[c];
                disc.at[c] -= std::floor(disc.at[c]);
            }
        }
        Disc& a = discs[pair[0]];
        Disc& b = discs[pair[1]];
        const double along = (a.velocity[0] - b.velocity[0]) * normal[0] +
                             (a.velocity[1] - b.velocity[1]) * normal[1];
        for (std::size_t c = 0; c < 2; ++c) {
            a.velocity[c] -= along * normal[c];
            b.velocity[c] += along * normal[c];
        }
        last = pair;
        t += first;
        times.push_back(t);
    }
    return times;
}

std::string refusal(const Scene& scene)
{
    try {
        scene.check();
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

}  // namespace

TEST(ScenePeriod, ABodyAloneComesBackFromTheOtherSide)
{
    // x = 0.25 + 1.5 t and y = 0.5 - 0.75 t without a period: 0.25 + 15 - 15 * 1 and so on.
    Scene scene({.period = {1, 2}});
    scene.disc({.at = {0.25, 0.5}, .velocity = {1.5, -0.75}, .radius = 0.1});
    const SceneRun run = simulate(scene, {.t_end = 10, .sample_times = {0.25, 1}});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_EQ(run.bodies[0].winding, (std::array<std::int32_t, 2>{15, -4}));
    EXPECT_NEAR(run.bodies[0].at[0], 0.25, 1e-13);
    EXPECT_NEAR(run.bodies[0].at[1], 1, 1e-13);
    EXPECT_EQ(run.samples[0][0].winding, (std::array<std::int32_t, 2>{0, 0}));
    EXPECT_EQ(run.samples[1][0].winding, (std::array<std::int32_t, 2>{1, -1}));
    EXPECT_NEAR(run.samples[1][0].at[1], 1.75, 1e-15);
}

TEST(ScenePeriod, DiscsMeetAcrossTheBorder)
{
    // Centres 0.4 apart across x = 0, radii 0.05 each, approaching at 3: 0.1 s. Equal masses
    // exchange their velocities.
    Scene scene({.period = {1, 0}});
    scene.disc({.at = {0.2, 0}, .velocity = {-1, 0}, .radius = 0.05});
    scene.disc({.at = {0.8, 0}, .velocity = {2, 0}, .radius = 0.05});
    const SceneRun run = simulate(scene, {.t_end = 0.2});
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_NEAR(run.events[0].t, 0.1, 1e-15);
    EXPECT_NEAR(run.events[0].after[0][0], 2, 1e-15);
    EXPECT_NEAR(run.events[0].normal[0], 1, 1e-15);
    EXPECT_NEAR(run.bodies[0].at[0], 0.1 + 0.2, 1e-14);
    EXPECT_NEAR(run.bodies[1].at[0], 0.9, 1e-14);
    EXPECT_EQ(run.bodies[1].winding[0], 0);
}

TEST(ScenePeriod, CollisionsAgreeWithATrialOfAllImages)
{
    // Both solve the same quadratic equations, in other orders: 1e-16, times at most a factor 6 or
    // so for each collision of one disc. 60 collisions of 16 discs are 8 for each: 2e-10.
    const std::vector<Disc> start = discs(4, 0.3);
    const std::vector<double> exact = tried(start, 60);
    const SceneRun run = simulate(torus(start), {.t_end = exact.back() + 1e-6});
    ASSERT_GE(run.events.size(), exact.size());
    for (std::size_t k = 0; k < exact.size(); ++k) {
        EXPECT_NEAR(run.events[k].t, exact[k], 1e-9) << k;
    }
}

TEST(ScenePeriod, MomentumAndEnergyAreKept)
{
    // Each collision changes both by rounding, 1e-16 of what one disc has.
    const std::vector<Disc> start = discs(12, 0.4);
    const Scene scene = torus(start);
    const SceneRun run = simulate(scene, {.t_end = 20, .record_events = false});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_GT(run.statistics.impacts, 10'000U);
    Vector2 momentum{};
    double energy = 0;
    double before = 0;
    for (std::size_t i = 0; i < start.size(); ++i) {
        for (std::size_t c = 0; c < 2; ++c) {
            momentum[c] += run.bodies[i].velocity[c];
            energy += std::pow(run.bodies[i].velocity[c], 2);
            before += std::pow(start[i].velocity[c], 2);
            EXPECT_GE(run.bodies[i].at[c], -1e-15);
            EXPECT_LE(run.bodies[i].at[c], 1 + 1e-15);
        }
    }
    const double count = static_cast<double>(run.statistics.impacts);
    EXPECT_NEAR(momentum[0], 0, 1e-15 * std::sqrt(count));
    EXPECT_NEAR(momentum[1], 0, 1e-15 * std::sqrt(count));
    EXPECT_NEAR(energy / before, 1, 1e-16 * std::sqrt(count));
}

TEST(ScenePeriod, CellsChangeNoBit)
{
    const Scene scene = torus(discs(10, 0.3));
    const SceneOptions options{.t_end = 1};
    const SceneRun plain = simulate(scene, options);
    for (const double side : {0.03, 0.25}) {
        detail::SceneTuning tuning;
        tuning.cell_side = side;
        tuning.lay_after = 50;
        const SceneRun other = detail::simulate(scene, options, tuning);
        ASSERT_EQ(other.events.size(), plain.events.size());
        for (std::size_t k = 0; k < plain.events.size(); ++k) {
            ASSERT_EQ(other.events[k].t, plain.events[k].t) << side << " " << k;
            ASSERT_EQ(other.events[k].after, plain.events[k].after) << side << " " << k;
        }
    }
}

TEST(ScenePeriod, PinsAcrossTheBorderAreMetFromBothSides)
{
    // A pin on the corner of the cell, of radius 0.25: a point along y = 0.125 strikes it at
    // x = 1 - sqrt(0.25^2 - 0.125^2), wherever it comes from.
    const double before = std::sqrt(0.0625 - 0.015625);
    for (const double sign : {1.0, -1.0}) {
        Scene scene({.period = {1, 1}});
        scene.arc({.centre = {0, 0}, .radius = 0.25});
        scene.point({.at = {0.5, 0.5 - 0.375 * sign}, .velocity = {1, 0}});
        const SceneRun run = simulate(scene, {.t_end = 0.4});
        ASSERT_EQ(run.events.size(), 1U);
        EXPECT_NEAR(run.events[0].t, 0.5 - before, 1e-15);
    }
}

TEST(ScenePeriod, ADiscOnAFloorGoesRound)
{
    // Thrown along a floor with a period of 2: x = 0.5 + 3 t, and hops of 2 sqrt(2 h / g) = 2 s.
    Scene scene({.gravity = {0, -2}, .period = {2, 0}});
    scene.wall({.normal = {0, 1}});
    scene.disc({.at = {0.5, 1.25}, .velocity = {3, 0}, .radius = 0.25});
    const SceneRun run = simulate(scene, {.t_end = 10});
    ASSERT_EQ(run.events.size(), 5U);
    for (std::size_t k = 0; k < 5; ++k) {
        EXPECT_NEAR(run.events[k].t, 1 + 2 * static_cast<double>(k), 1e-13);
    }
    EXPECT_NEAR(run.bodies[0].at[0] + 2 * run.bodies[0].winding[0], 30.5, 1e-13);
    EXPECT_NEAR(energy(scene, run.bodies), 0.5 * 9 + 2 * 1.25, 1e-13);
}

TEST(ScenePeriod, WhatDoesNotFitIsRefused)
{
    Scene outside({.period = {1, 0}});
    outside.disc({.name = "a", .at = {1.5, 0}, .radius = 0.1});
    EXPECT_EQ(refusal(outside), "Scene: a is at x = 1.5 m; expected 0 <= x < 1, the period");
    Scene large({.period = {1, 0}});
    large.disc({.at = {0.2, 0}, .radius = 0.15});
    large.disc({.at = {0.7, 0}, .radius = 0.15});
    EXPECT_EQ(
        refusal(large),
        "Scene: the period along x is 1 m, and the largest radius 0.15 m; expected a period of "
        "1.2015 m at least");
    Scene across({.period = {0, 1}});
    across.wall({.name = "floor", .normal = {0, 1}});
    EXPECT_EQ(
        refusal(across),
        "Scene: floor is a wall across y, along which the scene has a period; expected terrain, "
        "or a normal along the other axis");
    Scene overlapping({.period = {1, 1}});
    overlapping.disc({.at = {0.01, 0.99}, .radius = 0.1});
    overlapping.disc({.at = {0.99, 0.01}, .radius = 0.1});
    EXPECT_EQ(refusal(overlapping),
              "Scene: body 0 and body 1 overlap by 0.172 at the start, across the border of the "
              "period");
    Scene slowed({.period = {1, 1}});
    slowed.disc({.at = {0.5, 0.5}, .radius = 0.1, .drag = 1});
    EXPECT_EQ(refusal(slowed),
              "Scene: a scene with a period has no bodies with drag, and there are some");
    EXPECT_THROW(Scene({.period = {-1, 0}}), std::invalid_argument);
    EXPECT_EQ(read_scene(R"({"period": [1, 0]})").scene.settings().period, (Vector2{1, 0}));
}

}  // namespace ricochet::periodic_test
