// Impacts of several contacts at one instant: waves, all together, symmetry, labels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <random>
#include <tuple>
#include <vector>

#include "ricochet/scene/simulate.hpp"
#include "scene/gas.hpp"

namespace ricochet::impacts_test {
namespace {

/// Balls in contact on a line; the first arrives at speed 1.
Scene cradle(int balls, double restitution = 1)
{
    Scene scene;
    const MaterialId steel = scene.material({.restitution = restitution});
    scene.disc({.at = {-3, 0}, .velocity = {1, 0}, .radius = 0.5, .material = steel});
    for (int i = 1; i < balls; ++i) {
        scene.disc({.at = {1.0 * i, 0}, .radius = 0.5, .material = steel});
    }
    return scene;
}

TEST(Impacts, ACradleHandsTheVelocityToTheLastBall)
{
    for (int balls = 2; balls <= 9; ++balls) {
        const SceneRun run = simulate(cradle(balls), {.t_end = 4});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        double momentum = 0;
        double energy = 0;
        for (int i = 0; i < balls; ++i) {
            const auto& body = run.bodies[static_cast<std::size_t>(i)];
            EXPECT_NEAR(body.velocity[0], i == balls - 1 ? 1 : 0, 1e-14) << balls << " " << i;
            momentum += body.velocity[0];
            energy += body.velocity[0] * body.velocity[0];
        }
        EXPECT_NEAR(momentum, 1, 1e-14) << balls;
        EXPECT_NEAR(energy, 1, 1e-14) << balls;
        EXPECT_EQ(run.statistics.events, 1u);
        EXPECT_EQ(run.statistics.impacts, static_cast<std::uint64_t>(balls - 1));
    }
}

TEST(Impacts, RestitutionAndFrictionTogetherGainNoEnergy)
{
    // Three discs that touch, with any velocities: Newton's law with Coulomb's law gains energy in
    // a fifth of such impacts.
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> velocity(-1, 1), mass(0.2, 5);
    for (int k = 0; k < 2000; ++k) {
        Scene scene;
        const MaterialId rubber = scene.material({.restitution = 0.9, .friction = 1});
        double before = 0;
        for (int i = 0; i < 3; ++i) {
            const double angle = 2 * M_PI * i / 3;
            const double radius = 1 / std::sqrt(3.0);
            const Disc disc{.at = {radius * std::cos(angle), radius * std::sin(angle)},
                            .velocity = {velocity(random), velocity(random)},
                            .radius = 0.5,
                            .mass = mass(random),
                            .material = rubber};
            scene.disc(disc);
            before += 0.5 * disc.mass *
                      (disc.velocity[0] * disc.velocity[0] + disc.velocity[1] * disc.velocity[1]);
        }
        const SceneRun run = simulate(scene, {.t_end = 0.01});
        EXPECT_LE(energy(scene, run.bodies), before * (1 + 1e-12)) << k;
    }
}

/// Discs in a box, some without restitution, all with friction: they come together in clusters,
/// past which others slide.
Scene sticky(unsigned seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Scene scene;
    const MaterialId soft = scene.material({.restitution = 0, .friction = 0.3});
    const MaterialId hard = scene.material({.restitution = 1, .friction = 0.45});
    for (const Vector2& normal : {Vector2{0, 1}, Vector2{1, 0}, Vector2{0, -1}, Vector2{-1, 0}}) {
        const Vector2 corner{normal[0] < 0 ? 6.0 : 0.0, normal[1] < 0 ? 6.0 : 0.0};
        scene.wall({.point = corner, .normal = normal, .material = hard});
    }
    for (int k = 0; k < 36; ++k) {
        Disc disc;
        disc.at = {0.5 + k % 6, 0.5 + k / 6};
        for (double& x : disc.at) x += 0.05 * uniform(random);
        for (double& v : disc.velocity) v = 2 * uniform(random);
        disc.radius = 0.35 + 0.08 * uniform(random);
        disc.mass = 1 + 0.5 * uniform(random);
        disc.material = uniform(random) < -0.3 ? soft : hard;
        scene.disc(disc);
    }
    return scene;
}

/// The largest number of events at one time.
std::size_t most_at_once(const std::vector<SceneEvent>& events)
{
    std::size_t most = 0, count = 0;
    for (std::size_t k = 0; k < events.size(); ++k) {
        if (k > 0 && events[k].number == events[k - 1].number) continue;
        count = k > 0 && events[k].t == events[k - 1].t ? count + 1 : 1;
        most = std::max(most, count);
    }
    return most;
}

TEST(Impacts, ClustersWithoutRestitutionAreStruckOnce)
{
    for (unsigned seed = 0; seed < 60; ++seed) {
        const SceneRun run = simulate(sticky(seed), {.t_end = 20, .max_events = 20'000});
        EXPECT_EQ(run.outcome, Outcome::reached_end) << seed << ": " << run.message;
        // A disc that bounces in a gap that closes has many impacts within a few ulp.
        EXPECT_LE(most_at_once(run.events), 50u) << seed;
        for (std::size_t i = 0; i < run.bodies.size(); ++i) {
            for (const double x : run.bodies[i].at) {
                EXPECT_NEAR(x, 3, 3.001 - 0.27) << seed << " " << i;
            }
        }
    }
}

TEST(Impacts, ASmallDiscIsMetAfterALongWay)
{
    Scene scene;
    scene.disc({.at = {0, 0}, .velocity = {1000, 0}, .radius = 1e-3});
    scene.disc({.at = {1e6, 0}, .radius = 1e-3});
    const SceneRun run = simulate(scene, {.t_end = 1e4});
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, 1000 - 2e-6, 4e-13);
    EXPECT_EQ(run.bodies[1].velocity[0], 1000);
}

TEST(Impacts, AllTogetherIsNewtonsLawForTheWholeCradle)
{
    const SceneRun run = simulate(cradle(5), {.t_end = 4, .impacts = ImpactLaw::together});
    EXPECT_NEAR(run.bodies[0].velocity[0], -0.6, 1e-14);
    for (std::size_t i = 1; i < 5; ++i) EXPECT_NEAR(run.bodies[i].velocity[0], 0.4, 1e-14);
}

TEST(Impacts, AllTogetherIsNewtonsLawForAnyMasses)
{
    for (const double friction : {0.0, 0.3}) {
        for (const double mass : {1.0, 1e3, 1e4, 1e6}) {
            Scene scene;
            const MaterialId material = scene.material({.restitution = 0.5, .friction = friction});
            scene.wall({.normal = {0, 1}, .material = material});
            scene.disc({.at = {0, 1}, .material = material});
            scene.disc({.at = {0, 4}, .velocity = {0, -1}, .mass = mass, .material = material});
            const SceneRun run = simulate(scene, {.t_end = 2, .impacts = ImpactLaw::together});
            EXPECT_NEAR(run.bodies[0].velocity[1], 0, 1e-15 * mass) << mass;
            EXPECT_NEAR(run.bodies[1].velocity[1], 0.5, 1e-15 * mass) << mass;
            EXPECT_EQ(run.statistics.impacts, 2u) << mass;
        }
    }
}

/// A disc strikes two that touch it at +-30 degrees at one time.
Scene wedge(bool swapped)
{
    Scene scene;
    const double x = std::cos(M_PI / 6);
    const double y = std::sin(M_PI / 6);
    scene.disc({.at = {-1, 0}, .velocity = {1, 0}, .radius = 0.5});
    scene.disc({.at = {x, swapped ? -y : y}, .radius = 0.5});
    scene.disc({.at = {x, swapped ? y : -y}, .radius = 0.5});
    return scene;
}

TEST(Impacts, ASymmetricStrikeIsSymmetricWhateverTheLabels)
{
    // Impulses p along +-30 degrees: the striker keeps 1 - 2 p cos 30, and each contact separates
    // as fast as it approached: p - (1 - 2 p cos 30) cos 30 = cos 30, so
    // p = 2 cos 30 / (1 + 2 cos^2 30) = 0.4 sqrt(3).
    for (const ImpactLaw law : {ImpactLaw::waves, ImpactLaw::together}) {
        const SceneRun one = simulate(wedge(false), {.t_end = 2, .impacts = law});
        const SceneRun two = simulate(wedge(true), {.t_end = 2, .impacts = law});
        EXPECT_NEAR(one.bodies[0].velocity[0], -0.2, 1e-14);
        EXPECT_NEAR(one.bodies[0].velocity[1], 0, 1e-15);
        EXPECT_NEAR(one.bodies[1].velocity[0], 0.6, 1e-14);
        EXPECT_NEAR(one.bodies[1].velocity[1], 0.2 * std::sqrt(3.0), 1e-14);
        EXPECT_NEAR(one.bodies[1].velocity[1], -one.bodies[2].velocity[1], 1e-15);
        EXPECT_EQ(one.bodies[0].velocity, two.bodies[0].velocity);
        EXPECT_EQ(one.bodies[1].velocity, two.bodies[2].velocity);
    }
}

TEST(Impacts, ARackIsSymmetric)
{
    Scene scene;
    const double root = std::sqrt(3.0);
    for (int row = 0; row < 3; ++row) {
        for (int k = 0; k <= row; ++k) {
            scene.disc({.at = {row * root / 2, k - 0.5 * row}, .radius = 0.5});
        }
    }
    scene.disc({.at = {-3, 0}, .velocity = {1, 0}, .radius = 0.5});
    const SceneRun run = simulate(scene, {.t_end = 3});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    const auto& b = run.bodies;
    for (const auto& [left, right] : {std::pair{1, 2}, std::pair{3, 5}}) {
        const BodyState& l = b[static_cast<std::size_t>(left)];
        const BodyState& r = b[static_cast<std::size_t>(right)];
        EXPECT_NEAR(l.velocity[0], r.velocity[0], 1e-15);
        EXPECT_NEAR(l.velocity[1], -r.velocity[1], 1e-15);
    }
    double momentum = 0;
    double square = 0;
    for (const BodyState& body : b) {
        momentum += body.velocity[0];
        square += body.velocity[0] * body.velocity[0] + body.velocity[1] * body.velocity[1];
    }
    EXPECT_NEAR(momentum, 1, 1e-14);
    EXPECT_NEAR(square, 1, 1e-14);
}

TEST(Impacts, PackingsKeepMomentumAndEnergyUnderAnyLabels)
{
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    for (int trial = 0; trial < 20; ++trial) {
        std::vector<Disc> discs;
        for (int k = 0; k < 25; ++k) {
            discs.push_back({.at = {1.0 * (k % 5), 1.0 * (k / 5)},
                             .velocity = {normal(generator), normal(generator)},
                             .radius = 0.5,
                             .mass = 0.5 + std::fabs(normal(generator))});
        }
        std::vector<std::size_t> order(discs.size());
        std::iota(order.begin(), order.end(), 0u);
        std::shuffle(order.begin(), order.end(), generator);
        Scene one;
        Scene two;
        for (const Disc& disc : discs) one.disc(disc);
        for (const std::size_t k : order) two.disc(discs[k]);
        const SceneRun first = simulate(one, {.t_end = 1e-3});
        const SceneRun second = simulate(two, {.t_end = 1e-3});
        const double before = energy(one, test::start_of(one));
        EXPECT_NEAR(energy(one, first.bodies) / before, 1, 1e-14);
        for (std::size_t c = 0; c < 2; ++c) {
            double momentum = 0;
            double size = 0;
            for (std::size_t k = 0; k < discs.size(); ++k) {
                momentum += discs[k].mass * (first.bodies[k].velocity[c] - discs[k].velocity[c]);
                size += discs[k].mass * std::fabs(discs[k].velocity[c]);
            }
            EXPECT_NEAR(momentum / size, 0, 1e-14);
        }
        for (std::size_t k = 0; k < order.size(); ++k) {
            EXPECT_EQ(first.bodies[order[k]].velocity, second.bodies[k].velocity);
        }
    }
}

TEST(Impacts, ACornerTurnsAVelocityRound)
{
    Scene scene;
    scene.wall({.normal = {0, 1}});
    scene.wall({.normal = {1, 0}});
    scene.disc({.at = {2, 2}, .velocity = {-1, -1}});
    const SceneRun run = simulate(scene, {.t_end = 2});
    EXPECT_EQ(run.statistics.events, 1u);
    EXPECT_NEAR(run.bodies[0].at[0], 2, 1e-15);
    EXPECT_EQ(run.bodies[0].velocity, (Vector2{1, 1}));
}

TEST(Impacts, TerrainIsMetOnItsSegmentsAndItsEnds)
{
    // A roof of two slopes of 45 degrees: a point straight down onto one goes off sideways; a disc
    // onto the ridge goes straight up again.
    Scene scene({.gravity = {0, -10}});
    scene.terrain({.name = "roof", .points = {{-2, 0}, {0, 2}, {2, 0}}});
    scene.point({.at = {1, 6}});
    scene.disc({.at = {0, 7.5}, .radius = 0.5});
    const SceneRun run = simulate(scene, {.t_end = 1.2});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    ASSERT_GE(run.events.size(), 2u);
    for (std::size_t k = 0; k < 2; ++k) {
        const SceneEvent& event = run.events[k];
        const bool point = event.body == 0;
        EXPECT_NEAR(event.t, 1, 1e-15);
        EXPECT_NEAR(event.after[0][0], point ? 10 : 0, 1e-13);
        EXPECT_NEAR(event.after[0][1], point ? 0 : 10, 1e-13);
    }
    EXPECT_NE(run.events[0].body, run.events[1].body);
}

/// A ball of 1.36 m/s strikes the first of fifteen that touch each other, whose places in their
/// triangle are `slot_of` the bodies 1 to 15.
struct Rack {
    Scene scene;
    std::vector<std::size_t> slot_of;
};

Rack rack(const Vector2& at, bool mirrored, const std::vector<std::size_t>& order)
{
    const double radius = 0.0286;
    const double sign = mirrored ? -1 : 1;
    Rack made;
    std::vector<Disc> discs;
    for (std::size_t row = 0; row < 5; ++row) {
        for (std::size_t k = 0; k <= row; ++k) {
            const double across = 2 * static_cast<double>(k) - static_cast<double>(row);
            discs.push_back({.at = {at[0] + std::sqrt(3.0) * radius * static_cast<double>(row),
                                    at[1] + sign * across * radius},
                             .radius = radius,
                             .mass = 1});
        }
    }
    made.slot_of.push_back(15);
    made.scene.disc(
        {.at = {at[0] - 0.5, at[1]}, .velocity = {1.36, 0}, .radius = radius, .mass = 1});
    for (const std::size_t slot : order) {
        made.scene.disc(discs[slot]);
        made.slot_of.push_back(slot);
    }
    return made;
}

TEST(Impacts, ARackHasTheSameImpactsWhereverItStandsMirroredAndPermuted)
{
    // At coordinates of 1000 m the direction between two centres has a rounding of 1e-13 / 0.06,
    // and an impulse as much.
    const double tolerance = 1e-10;
    using Impact = std::tuple<std::size_t, std::size_t, double>;
    const auto first_event = [](const Rack& made) {
        const SceneRun run = simulate(made.scene, {.t_end = 1, .max_events = 1});
        std::vector<Impact> out;
        for (const SceneEvent& event : run.events) {
            EXPECT_FALSE(event.other.is_surface);
            const auto [a, b] =
                std::minmax(made.slot_of[event.body], made.slot_of[event.other.index]);
            out.emplace_back(a, b, std::hypot(event.impulse[0], event.impulse[1]));
        }
        std::ranges::sort(out);
        return out;
    };
    std::vector<std::size_t> order(15);
    std::iota(order.begin(), order.end(), std::size_t{0});
    const std::vector<Impact> expected = first_event(rack({0, 0}, false, order));
    // None of them is rounding, and all are in pairs but for those on the axis.
    ASSERT_EQ(expected.size(), 10U);
    for (const auto& [a, b, impulse] : expected) EXPECT_GT(impulse, 1e-6) << a << " " << b;
    std::mt19937 random(5);
    for (const Vector2& at :
         {Vector2{0, 0}, Vector2{0.3, 0.7}, Vector2{12.34, -5.6}, Vector2{-1000.1, 777.7}}) {
        for (int turn = 0; turn < 4; ++turn) {
            if (turn > 0) std::ranges::shuffle(order, random);
            const std::vector<Impact> found = first_event(rack(at, turn % 2 == 1, order));
            ASSERT_EQ(found.size(), expected.size()) << at[0] << ", turn " << turn;
            for (std::size_t k = 0; k < found.size(); ++k) {
                EXPECT_EQ(std::get<0>(found[k]), std::get<0>(expected[k])) << k;
                EXPECT_EQ(std::get<1>(found[k]), std::get<1>(expected[k])) << k;
                EXPECT_NEAR(std::get<2>(found[k]), std::get<2>(expected[k]), tolerance) << k;
            }
        }
    }
}

TEST(Impacts, EnergyOfAGasDoesNotDrift)
{
    // The rounding of an elastic impact is a few units in the last place of either sign: after n of
    // them among 100 discs it is below 1e-14 sqrt(n / 1e5) of the whole, by trial ten times less.
    // Where |n|^2 is not corrected it grows by 1e-16 at each impact, to 1e-13 here.
    const Scene scene = test::gas({.count = 100, .fraction = 0.3});
    const double start = energy(scene, test::start_of(scene));
    for (const std::uint64_t events : {100'000U, 400'000U}) {
        const SceneRun run = simulate(scene, {.t_end = 1e9, .max_events = events});
        const double drift = std::fabs(energy(scene, run.bodies) / start - 1);
        EXPECT_LT(drift, 1e-14 * std::sqrt(static_cast<double>(events) / 1e5)) << events;
    }
}

/// A disc in a regular polygon of elastic walls, none of which is along an axis.
Scene disc_in_polygon(int sides, double gravity = 0)
{
    Scene scene({.gravity = {0, -gravity}});
    Terrain walls{.closed = true};
    for (int k = 0; k < sides; ++k) {
        const double angle = 0.1 + 2 * std::numbers::pi * k / sides;
        walls.points.push_back({std::cos(angle), std::sin(angle)});
    }
    scene.terrain(walls);
    scene.disc({.at = {0.1, 0.2}, .velocity = {1, 0.6}, .radius = 0.01});
    return scene;
}

TEST(Impacts, EnergyBetweenSlantedWallsDoesNotDrift)
{
    // A wall rounds in the same way each time that it is hit. What an impact gains by rounding is
    // undone by the next ones: the gain stays below some units in the last place, however many.
    for (const int sides : {3, 5, 8}) {
        const Scene scene = disc_in_polygon(sides);
        const double start = energy(scene, test::start_of(scene));
        for (const std::uint64_t events : {1000U, 100'000U}) {
            const SceneRun run = simulate(scene, {.t_end = 1e9, .max_events = events});
            ASSERT_EQ(run.statistics.impacts, events);
            EXPECT_NEAR(energy(scene, run.bodies) / start, 1, 2e-15) << sides << ", " << events;
        }
    }
}

TEST(Impacts, EnergyBetweenSlantedWallsDoesNotDriftUnderGravity)
{
    // Each flight rounds velocity and place once more, to either side: after n of them some
    // 2^-53 sqrt(n) of the whole.
    const auto whole = [](const BodyState& body) {
        return 0.5 * (body.velocity[0] * body.velocity[0] + body.velocity[1] * body.velocity[1]) +
               2 * body.at[1];
    };
    const Scene scene = disc_in_polygon(5, 2);
    const double start = whole(test::start_of(scene)[0]);
    for (const std::uint64_t events : {1000U, 100'000U}) {
        const SceneRun run = simulate(scene, {.t_end = 1e9, .max_events = events});
        const double most = 4 * 0x1p-53 * std::sqrt(static_cast<double>(events));
        EXPECT_NEAR(whole(run.bodies[0]) / start, 1, most) << events;
    }
}

}  // namespace
}  // namespace ricochet::impacts_test
