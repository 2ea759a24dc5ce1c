// Bodies that stay in contact with each other: rest, sleep, waking, energy, labels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "gas.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::lasting_test {
namespace {

constexpr double g = 9.81;

/// Twelve discs above a bin, added in this order.
Scene above_bin(double restitution, double friction, const std::vector<std::size_t>& order = {})
{
    Scene scene({.gravity = {0, -g}});
    const MaterialId clay = scene.material({.restitution = restitution, .friction = friction});
    scene.wall({.name = "floor", .normal = {0, 1}, .material = clay});
    scene.wall({.name = "left", .normal = {1, 0}, .material = clay});
    scene.wall({.name = "right", .point = {0.75, 0}, .normal = {-1, 0}, .material = clay});
    for (std::size_t k = 0; k < 12; ++k) {
        const std::size_t i = order.empty() ? k : order[k];
        const auto column = static_cast<double>(i % 3);
        const std::size_t below = i / 3;
        const auto row = static_cast<double>(below);
        scene.disc({.at = {0.13 + 0.22 * column + 0.003 * static_cast<double>(i % 4) - 0.001 * row,
                           0.3 + 0.25 * row},
                    .radius = 0.08 + 0.01 * column,
                    .mass = 1 + 0.1 * static_cast<double>(i % 5),
                    .material = clay});
    }
    return scene;
}

bool all_asleep(const std::vector<BodyState>& bodies)
{
    return std::ranges::all_of(bodies, &BodyState::asleep);
}

double largest_overlap(const Scene& scene, const std::vector<BodyState>& states)
{
    double largest = 0;
    for (std::size_t i = 0; i < states.size(); ++i) {
        const double r = scene.bodies()[i].radius;
        largest = std::max(largest, r - states[i].at[1]);
        for (std::size_t j = 0; j < i; ++j) {
            const Vector2& a = states[i].at;
            const Vector2& b = states[j].at;
            largest = std::max(largest,
                               r + scene.bodies()[j].radius - std::hypot(a[0] - b[0], a[1] - b[1]));
        }
    }
    return largest;
}

TEST(LastingContact, AStackDroppedIntoABinComesToRestAndKeepsEveryBitForTenThousandSeconds)
{
    for (const double restitution : {0.0, 0.3, 0.7}) {
        for (const double friction : {0.0, 0.4}) {
            const Scene scene = above_bin(restitution, friction);
            SceneOptions options{
                .t_end = 1e4, .contacts = scene_contacts(), .record_events = false};
            for (int k = 1; k < 200; ++k) options.sample_times.push_back(0.05 * k);
            const SceneRun run = simulate(scene, options);
            ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
            ASSERT_TRUE(all_asleep(run.samples.back())) << restitution << ' ' << friction;
            ASSERT_TRUE(all_asleep(run.bodies));
            for (std::size_t i = 0; i < run.bodies.size(); ++i) {
                EXPECT_EQ(run.bodies[i].at, run.samples.back()[i].at);
                EXPECT_EQ(run.bodies[i].velocity, (Vector2{0, 0}));
            }
            // Rounding of some thousand impacts, and of gaps left by steps: 1e-12 of 60 J.
            double before = energy(scene, test::start_of(scene));
            for (const auto& sample : run.samples) {
                const double now = energy(scene, sample);
                EXPECT_LE(now, before + 1e-9);
                before = now;
                EXPECT_LE(largest_overlap(scene, sample), 1e-10);
            }
        }
    }
}

TEST(LastingContact, LabelsDoNotChangeABit)
{
    std::vector<std::size_t> order(12);
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::reverse(order);
    std::rotate(order.begin(), order.begin() + 5, order.end());
    const SceneOptions options{.t_end = 6, .contacts = scene_contacts()};
    for (const double friction : {0.0, 0.4}) {
        const SceneRun run = simulate(above_bin(0.3, friction), options);
        const SceneRun other = simulate(above_bin(0.3, friction, order), options);
        for (std::size_t k = 0; k < order.size(); ++k) {
            EXPECT_EQ(run.bodies[order[k]].at, other.bodies[k].at);
            EXPECT_EQ(run.bodies[order[k]].velocity, other.bodies[k].velocity);
        }
    }
}

TEST(LastingContact, AStruckSleeperWakesAndSleepsAgain)
{
    // Two discs on a floor and one between and above them, asleep; a fourth one falls onto it.
    Scene scene({.gravity = {0, -g}});
    const MaterialId clay = scene.material({.restitution = 0.2, .friction = 0.8});
    scene.wall({.normal = {0, 1}, .material = clay});
    scene.disc({.at = {-0.1, 0.1}, .radius = 0.1, .material = clay});
    scene.disc({.at = {0.1, 0.1}, .radius = 0.1, .material = clay});
    scene.disc({.at = {0, 0.1 + 0.1 * std::sqrt(3.0)}, .radius = 0.1, .material = clay});
    scene.disc({.at = {0.04, 2}, .radius = 0.1, .material = clay});
    const SceneRun run =
        simulate(scene, {.t_end = 10, .contacts = scene_contacts(), .sample_times = {0.5, 9}});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    for (std::size_t i = 0; i < 3; ++i) EXPECT_TRUE(run.samples[0][i].asleep);
    // It falls from 2 to about 0.47: sqrt(2 1.53 / g) = 0.56 s.
    const auto slept_after = [&](std::uint32_t body, double t) {
        return std::ranges::any_of(run.events, [&](const SceneEvent& event) {
            return event.kind == SceneEvent::Kind::slept && event.body == body && event.t > t;
        });
    };
    for (const std::uint32_t i : {0U, 1U, 2U}) EXPECT_TRUE(slept_after(i, 0.55));
    EXPECT_NE(run.samples[1][2].at, run.samples[0][2].at);
    EXPECT_TRUE(all_asleep(run.samples[1]));
    const auto joined = std::ranges::count(run.events, SceneEvent::Kind::joined, &SceneEvent::kind);
    EXPECT_GE(joined, 3);
    // Entries of one number are of one time, and each number is an event.
    for (std::size_t k = 1; k < run.events.size(); ++k) {
        const bool same = run.events[k].number == run.events[k - 1].number;
        EXPECT_EQ(run.events[k].number, run.events[k - 1].number + (same ? 0 : 1));
        if (same) {
            EXPECT_EQ(run.events[k].t, run.events[k - 1].t);
        }
    }
    EXPECT_EQ(run.events.back().number + 1, run.statistics.events);
}

TEST(LastingContact, ACradleAtRestHandsItsImpulseOn)
{
    // Elastic discs in a row on a smooth floor: the last one leaves with the speed of the first.
    Scene scene({.gravity = {0, -g}});
    scene.wall({.normal = {0, 1}});
    for (int i = 0; i < 5; ++i) scene.disc({.at = {2.0 * i, 1}});
    scene.disc({.at = {-4, 1}, .velocity = {1, 0}});
    const SceneRun run = simulate(scene, {.t_end = 3, .contacts = scene_contacts()});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_NEAR(run.bodies[4].velocity[0], 1, 1e-14);
    EXPECT_NEAR(run.bodies[4].at[0], 9, 1e-13);
    for (const std::size_t i : {0U, 1U, 2U, 3U, 5U}) EXPECT_EQ(run.bodies[i].velocity[0], 0);
}

TEST(LastingContact, ADiscIsPushedDownAnInclineByAnother)
{
    // A smooth disc behind a rough one of equal mass on a plane that falls at 0.5 rad: together
    // they slide at g (sin - mu cos / 2), in steps of order 1: h a t / 2 behind at most.
    const double c = std::cos(0.5);
    const double s = std::sin(0.5);
    Scene scene({.gravity = {0, -g}});
    const MaterialId rough = scene.material({.restitution = 0, .friction = 0.4});
    const MaterialId smooth = scene.material({.restitution = 0});
    scene.wall({.normal = {s, c}, .material = rough});
    const auto on_plane = [&](double along) { return Vector2{along * c + s, -along * s + c}; };
    scene.disc({.at = on_plane(2), .material = rough});
    scene.disc({.at = on_plane(-1e-9), .material = smooth});
    const SceneRun run =
        simulate(scene, {.t_end = 1, .contacts = scene_contacts(), .contact_step = 1e-4});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    const double rate = g * (s - 0.2 * c);
    for (const std::size_t i : {0U, 1U}) {
        const Vector2& v = run.bodies[i].velocity;
        EXPECT_NEAR(v[0] * c - v[1] * s, rate, 2e-4 * g);
    }
    const Vector2 apart{run.bodies[0].at[0] - run.bodies[1].at[0],
                        run.bodies[0].at[1] - run.bodies[1].at[1]};
    EXPECT_NEAR(std::hypot(apart[0], apart[1]), 2, 1e-8);
}

TEST(LastingContact, OfAPointNearTerrainIsNotFollowed)
{
    Scene scene({.gravity = {0, -g}});
    const MaterialId clay = scene.material({.restitution = 0.2, .friction = 0.4});
    scene.terrain({.points = {{-1, 1}, {0, 0}, {1, 1}}, .material = clay});
    // With drag it advances by steps; without, impacts bring it to rest in the corner.
    scene.point({.name = "dust", .at = {0.1, 1}, .drag = 0.1, .material = clay});
    const SceneRun run = simulate(scene, {.t_end = 5, .contacts = scene_contacts()});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_EQ(run.message,
              "'dust' is a point in lasting contact near terrain; only discs can be in lasting "
              "contact there");
}

TEST(LastingContact, AChainOfSpringsSlidesOverAnEdge)
{
    Scene scene({.gravity = {0, -g}});
    const MaterialId rope = scene.material({.restitution = 0.2, .friction = 0.05});
    scene.terrain({.points = {{-3, 0}, {0, 0}, {0, -4}}, .material = rope});
    BodyId last{};
    for (int i = 0; i < 10; ++i) {
        const double along = -1.25 + 0.2 * i;
        const Vector2 at = along < 0.05 ? Vector2{along, 0.05} : Vector2{0.05, 0.1 - along};
        const BodyId next = scene.disc({.at = at, .radius = 0.05, .mass = 0.1, .material = rope});
        if (i > 0) {
            scene.spring({.between = {last, next}, .rest = 0.2, .stiffness = 200, .damping = 0.2});
        }
        last = next;
    }
    SceneOptions options{.t_end = 1.5, .contacts = scene_contacts()};
    for (int k = 1; k < 60; ++k) options.sample_times.push_back(0.025 * k);
    const SceneRun run = simulate(scene, options);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    // Three of ten hang at the start and pull the others after them.
    EXPECT_LT(run.bodies[0].at[1], -0.2);
    double before = energy(scene, test::start_of(scene));
    for (const auto& sample : run.samples) {
        // In a step springs turn by h |v| / length, which changes their energy to second order: see
        // contact_island_test.
        EXPECT_LE(energy(scene, sample), before + 1e-3);
        before = energy(scene, sample);
    }
}

TEST(LastingContact, AGasThatCollapsesComesToItsEnd)
{
    const Scene scene = test::gas({.count = 30, .fraction = 0.5, .restitution = 0.3});
    const SceneRun run =
        simulate(scene, {.t_end = 5, .contacts = scene_contacts(), .record_events = false});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_LE(test::overlap(scene, run.bodies), 1e-12);
}

TEST(LastingContact, SamplesChangeNoBit)
{
    const Scene scene = above_bin(0.3, 0.4);
    SceneOptions options{.t_end = 0.5, .contacts = scene_contacts()};
    const SceneRun plain = simulate(scene, options);
    for (int k = 1; k < 500; ++k) options.sample_times.push_back(1e-3 * k);
    const SceneRun sampled = simulate(scene, options);
    EXPECT_EQ(plain.events.size(), sampled.events.size());
    for (std::size_t i = 0; i < plain.bodies.size(); ++i) {
        EXPECT_EQ(plain.bodies[i].at, sampled.bodies[i].at);
        EXPECT_EQ(plain.bodies[i].velocity, sampled.bodies[i].velocity);
    }
}

TEST(LastingContact, ADumbbellOnTheFloorComesToAnyEnd)
{
    // The last step is the rounding left at the end of the run.
    for (const double t_end : {9.0, 10.0, 20.0}) {
        for (const double damping : {0.0, 0.1, 1.0, 5.0}) {
            for (const double lift : {0.0, 0.5}) {
                Scene scene({.gravity = {0, -9.81}});
                const auto dull = scene.material({.restitution = 0.3});
                scene.wall({.normal = {0, 1}, .material = dull});
                const auto a = scene.disc({.at = {0, 0.5 + lift}, .radius = 0.5, .material = dull});
                const auto b =
                    scene.disc({.at = {1.65, 0.5 + lift}, .radius = 0.5, .material = dull});
                scene.spring(
                    {.between = {a, b}, .rest = 1.5, .stiffness = 100, .damping = damping});
                const SceneRun run =
                    simulate(scene, {.t_end = t_end, .contacts = scene_contacts()});
                EXPECT_EQ(run.outcome, Outcome::reached_end) << t_end << ", " << damping;
                EXPECT_LE(run.statistics.contact_steps, 1010 * t_end);
            }
        }
    }
}

}  // namespace
TEST(LastingContact, ADiscComesToRestInABowl)
{
    // The lower half of the unit circle. Without spin friction holds a disc where the slope is
    // below its coefficient; the gap is closed to the rounding of the steps' projection, 1e-9 m
    // here.
    Scene scene({.gravity = {0, -g}});
    const MaterialId clay = scene.material({.restitution = 0.4, .friction = 0.2});
    scene.arc({.name = "bowl", .ends = {{{-1, 0}, {1, 0}}}, .material = clay});
    scene.disc({.at = {-0.6, -0.2}, .radius = 0.1, .material = clay});
    const SceneRun run = simulate(scene, {.t_end = 20, .contacts = scene_contacts()});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_TRUE(run.bodies[0].asleep);
    const Vector2& p = run.bodies[0].at;
    EXPECT_NEAR(std::hypot(p[0], p[1]), 0.9, 1e-9);
    EXPECT_LE(std::fabs(p[0] / p[1]), 0.2 + 1e-9);
    EXPECT_LT(p[1], 0);
}

}  // namespace ricochet::lasting_test
