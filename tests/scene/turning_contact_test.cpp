// Discs that turn in lasting contact: rolling, friction between edges, rest.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/scene/simulate.hpp"
#include "scene/contact_island.hpp"

namespace ricochet::turning_contact_test {
namespace {

using detail::ContactCoefficients;
using detail::ContactIsland;
using detail::IslandBody;
using detail::IslandOutcome;
using detail::IslandSetup;

auto coefficients(double restitution, double friction)
{
    return [=](std::uint32_t, std::uint32_t) { return ContactCoefficients{restitution, friction}; };
}

SceneOptions until(double t_end, double step = 1e-3)
{
    return {.t_end = t_end, .contacts = scene_contacts(), .contact_step = step};
}

double solid(double mass, double radius)
{
    return 0.5 * mass * radius * radius;
}

/// Largest overlap of discs [m].
double overlap(const Scene& scene, const std::vector<BodyState>& bodies)
{
    double worst = 0;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        for (std::size_t j = 0; j < i; ++j) {
            const double apart =
                std::hypot(bodies[i].at[0] - bodies[j].at[0], bodies[i].at[1] - bodies[j].at[1]);
            const double radii = scene.bodies()[i].radius + scene.bodies()[j].radius;
            worst = std::max(worst, radii - apart);
        }
    }
    return worst;
}

/// Expects that the energy of samples does not rise, beyond the rounding of its terms.
void expect_no_gain(const Scene& scene, const SceneRun& run)
{
    ASSERT_EQ(run.samples.size(), run.sample_turns.size());
    double last = std::numeric_limits<double>::infinity();
    const double first = energy(scene, run.samples[0], run.sample_turns[0]);
    for (std::size_t k = 0; k < run.samples.size(); ++k) {
        const double now = energy(scene, run.samples[k], run.sample_turns[k]);
        EXPECT_LE(now, last + 1e-12 * std::abs(first)) << k;
        last = now;
    }
}

std::vector<double> times(int count, double step)
{
    std::vector<double> all;
    for (int k = 0; k <= count; ++k) all.push_back(k * step);
    return all;
}

TEST(TurningContact, ASlippingDiscBeginsToRollAtTwoThirdsOfItsSpeed)
{
    // m v and the moment of the spin change by the same impulse of the floor, so that m v - I w / r
    // stays what it was: the final speed does not depend on the step.
    for (const double h : {1e-2, 1e-3}) {
        ContactIsland island({.bodies = {{.id = 4,
                                          .at = {0, 0.5},
                                          .velocity = {3, 0},
                                          .mass = 2,
                                          .radius = 0.5,
                                          .inertia = solid(2, 0.5)}},
                              .walls = {{.id = 0, .normal = {0, 1}}},
                              .gravity = {0, -10},
                              .coefficients = coefficients(0, 0.2)},
                             {.step = h}, 0);
        EXPECT_EQ(island.advance(1), IslandOutcome::reached);
        EXPECT_NEAR(island.body(4).velocity[0], 2, 1e-13);
        EXPECT_NEAR(island.body(4).spin, -4, 1e-12);
        EXPECT_NEAR(island.energy(), 0.75 * 2 * 4 + 2 * 10 * 0.5, 1e-12);
    }
}

TEST(TurningContact, ADiscRollsDownAnInclineOrSlips)
{
    // As on surfaces alone: the rates are exact, places lag by h v / 2.
    for (const double mu : {0.3, 0.1}) {
        ContactIsland island(
            {.bodies = {{.at = {0.3, 0.4}, .mass = 2, .radius = 0.5, .inertia = solid(2, 0.5)}},
             .walls = {{.id = 1, .normal = {0.6, 0.8}}},
             .gravity = {0, -10},
             .coefficients = coefficients(0, mu)},
            {.step = 1e-3}, 0);
        EXPECT_EQ(island.advance(1), IslandOutcome::reached);
        const IslandBody disc = island.body(0);
        const double rate = mu > 0.25 ? 4 : 6 - 8 * mu;
        EXPECT_NEAR(std::hypot(disc.velocity[0], disc.velocity[1]), rate, 1e-10);
        EXPECT_NEAR(disc.spin, mu > 0.25 ? -2 * rate : -4 * mu * 8, 1e-10);
        EXPECT_NEAR((disc.at[0] - 0.3) / 0.8, rate / 2, 0.6e-3 * rate);
    }
}

/// Momentum and angular momentum about the origin.
std::array<double, 3> momenta(const ContactIsland& island, std::uint32_t count)
{
    std::array<double, 3> sum{};
    for (std::uint32_t i = 0; i < count; ++i) {
        const IslandBody b = island.body(i);
        sum[0] += b.mass * b.velocity[0];
        sum[1] += b.mass * b.velocity[1];
        sum[2] += b.mass * (b.at[0] * b.velocity[1] - b.at[1] * b.velocity[0]);
        sum[2] += b.inertia * b.spin;
    }
    return sum;
}

TEST(TurningContact, FrictionBetweenEdgesKeepsAngularMomentum)
{
    // Two discs that press on each other, one of them turning fast; all that acts is at the point
    // where they touch.
    for (const double inertia : {0.01, 0.1}) {
        ContactIsland island({.bodies = {{.id = 0,
                                          .at = {3, 1},
                                          .velocity = {1, 0.3},
                                          .mass = 1,
                                          .radius = 0.5,
                                          .inertia = inertia,
                                          .spin = 20},
                                         {.id = 1,
                                          .at = {4.2, 1},
                                          .velocity = {-1, 0},
                                          .mass = 3,
                                          .radius = 0.7,
                                          .inertia = 0.6,
                                          .spin = -5}},
                              .coefficients = coefficients(0, 0.4)},
                             {.step = 1e-3}, 0);
        const auto before = momenta(island, 2);
        const double energy = island.energy();
        EXPECT_EQ(island.advance(1e-3), IslandOutcome::reached);
        const auto after = momenta(island, 2);
        for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(after[k], before[k], 4e-15 * 20) << k;
        EXPECT_LT(island.energy(), energy);
        // Edges that pass each other are braked: both discs turn the same way for it.
        EXPECT_LT(island.body(0).spin, 20);
        EXPECT_LT(island.body(1).spin, -5);
    }
}

TEST(TurningContact, AStrikeTurnsDiscs)
{
    // As an impact of the scene: an impulse J across changes u + r w by 1.5 J for m = 2, r = 0.5.
    ContactIsland island({.bodies = {{.at = {0, 0.5},
                                      .velocity = {1, -3},
                                      .mass = 2,
                                      .radius = 0.5,
                                      .inertia = 0.25,
                                      .spin = 2}},
                          .walls = {{.normal = {0, 1}}},
                          .coefficients = coefficients(0.5, 1)},
                         {}, 0);
    EXPECT_FALSE(island.strike().refused);
    EXPECT_NEAR(island.body(0).velocity[0], 1 - 2 / 1.5 / 2, 1e-12);
    EXPECT_NEAR(island.body(0).velocity[1], 1.5, 1e-12);
    EXPECT_NEAR(island.body(0).spin, 2 - 0.5 * 2 / 1.5 / 0.25, 1e-12);
}

TEST(TurningContact, ABeltCarriesADisc)
{
    // A floor that moves at 2 m/s along itself under a disc between two posts without friction:
    // the disc stays, and turns until its edge goes with the belt.
    detail::WallMotion belt{.displacement =
                                [](double t) {
                                    return std::array{2 * t, 0.0};
                                },
                            .still_until = [](double t) { return t; }};
    IslandSetup setup{.bodies = {{.at = {0, 0.5}, .mass = 2, .radius = 0.5, .inertia = 0.25}},
                      .walls = {{.id = 1, .normal = {0, 1}, .motion = &belt},
                                {.id = 2, .point = {0.5, 0}, .normal = {-1, 0}}},
                      .gravity = {0, -10}};
    setup.walls[1].material = 1;
    setup.coefficients = [](std::uint32_t a, std::uint32_t b) {
        return ContactCoefficients{0, a == b ? 0.3 : 0};
    };
    ContactIsland island(setup, {.step = 1e-3}, 0);
    EXPECT_EQ(island.advance(1), IslandOutcome::reached);
    EXPECT_NEAR(island.body(0).velocity[0], 0, 1e-12);
    EXPECT_NEAR(island.body(0).spin, 4, 1e-9);
}

TEST(TurningContact, ASetUpThatCannotTurnIsRefused)
{
    const auto message = [](const IslandBody& body) {
        try {
            ContactIsland({.bodies = {body}, .coefficients = coefficients(0, 0)}, {}, 0);
        } catch (const std::invalid_argument& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(message({.radius = 1, .inertia = -1}),
              "ContactIsland: inertia must be finite, zero or positive, got -1");
    EXPECT_EQ(message({.id = 3, .radius = 0, .inertia = 1}),
              "ContactIsland: the edge of body 3 must have a finite inertia I / r^2 above 0, got I "
              "= 1 kg m^2 and r = 0 m");
    EXPECT_NE(message({.radius = 1, .inertia = 1e-310}), "");
    EXPECT_NE(message({.radius = 1, .inertia = 1, .spin = std::nan("")}), "");
    EXPECT_EQ(message({.radius = 1, .inertia = 1e-30, .spin = 3}), "");
}

// --- in scenes ---

TEST(TurningContact, ADiscRollsDownASlopeBetweenTwoOthersPressedTogether)
{
    // Of three discs of 1 kg on a slope the upper one slides without friction, that in the middle
    // rolls as a solid disc, the lower one as a ring: alone they would gain speed with g sin, 2/3
    // and 1/2 of it. Their inertia in common is 1 + 1.5 + 2 kg, without friction between them.
    Scene scene({.gravity = {0, -10}});
    const auto slope = scene.material({.restitution = 0, .friction = 1});
    const auto wood = scene.material({.restitution = 0, .friction = 1});
    const auto ice = scene.material({.restitution = 0, .friction = 0});
    scene.pair({.between = {wood, wood}, .restitution = 0, .friction = 0});
    scene.wall({.normal = {0.6, 0.8}, .material = slope});
    const double r = 0.1;
    for (int k = 0; k < 3; ++k) {
        const double along = 2 * r * k;
        scene.disc({.at = {0.6 * r + 0.8 * along, 0.8 * r - 0.6 * along},
                    .radius = r,
                    .material = k == 0 ? ice : wood,
                    .inertia = k == 2 ? r * r : solid(1, r)});
    }
    const SceneRun run = simulate(scene, until(1));
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    const double rate = 6 * 3 / 4.5;
    for (std::size_t i = 0; i < 3; ++i) {
        const double v = std::hypot(run.bodies[i].velocity[0], run.bodies[i].velocity[1]);
        EXPECT_NEAR(v, rate, 1e-8) << i;
        EXPECT_NEAR(run.turns[i].spin, i == 0 ? 0 : -rate / r, 1e-7) << i;
        // A step is a straight line: what has rolled is the angle, to rounding.
        const double way = (run.bodies[i].at[0] - scene.bodies()[i].at[0]) / 0.8;
        EXPECT_NEAR(way, rate / 2, 0.6e-3 * rate);
        EXPECT_NEAR(run.turns[i].angle, i == 0 ? 0 : -way / r, 1e-8) << i;
    }
}

TEST(TurningContact, TwoDiscsInAValleyComeToRest)
{
    Scene scene({.gravity = {0, -9.81}});
    const auto stone = scene.material({.restitution = 0.3, .friction = 0.5});
    const double c = std::numbers::sqrt2 / 2;
    scene.wall({.normal = {c, c}, .material = stone});
    scene.wall({.normal = {-c, c}, .material = stone});
    scene.disc({.at = {0.02, 0.5},
                .velocity = {0.3, 0},
                .radius = 0.2,
                .mass = 1,
                .material = stone,
                .inertia = solid(1, 0.2),
                .spin = 10});
    scene.disc({.at = {0.05, 1.2},
                .radius = 0.3,
                .mass = 2,
                .material = stone,
                .inertia = solid(2, 0.3),
                .spin = -3});
    SceneOptions options = until(20);
    options.sample_times = times(200, 0.1);
    const SceneRun run = simulate(scene, options);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_TRUE(run.bodies[i].asleep) << i;
        EXPECT_EQ(run.turns[i].spin, 0) << i;
        EXPECT_EQ(run.turns[i].angle, run.sample_turns[190][i].angle) << i;
    }
    expect_no_gain(scene, run);
    EXPECT_LE(overlap(scene, run.bodies), 1e-12);
}

TEST(TurningContact, ARollingDiscPushesAnotherOneAlongTheFloor)
{
    // The impact leaves both at v0/2. The first one still turns with v0, the second one not at all:
    // friction of the floor, mu m g on both and opposite, keeps their momentum and presses them
    // together until both roll, at v0/2.
    Scene scene({.gravity = {0, -10}});
    const auto floor = scene.material({.restitution = 0, .friction = 0.3});
    const auto ball = scene.material({.restitution = 0, .friction = 0.3});
    scene.pair({.between = {ball, ball}, .restitution = 0, .friction = 0});
    scene.wall({.normal = {0, 1}, .material = floor});
    const double r = 0.1;
    scene.disc({.at = {-1, r},
                .velocity = {2, 0},
                .radius = r,
                .material = ball,
                .inertia = solid(1, r),
                .spin = -2 / r});
    scene.disc({.at = {0, r}, .radius = r, .material = ball, .inertia = solid(1, r)});
    SceneOptions options = until(2);
    options.sample_times = times(20, 0.1);
    const SceneRun run = simulate(scene, options);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_GT(run.statistics.contact_steps, 100U);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_NEAR(run.bodies[i].velocity[0], 1, 1e-9);
        EXPECT_NEAR(run.turns[i].spin, -1 / r, 1e-8);
    }
    expect_no_gain(scene, run);
}

/// The speed of a disc that rolls over the corner of a table, where it has come down by a fifth of
/// its radius.
double speed_over_a_corner(double step)
{
    Scene scene({.gravity = {0, -10}});
    const auto rubber = scene.material({.restitution = 0, .friction = 5});
    scene.terrain({.points = {{-2, 0}, {0, 0}, {0, -3}}, .material = rubber});
    const double r = 0.1;
    scene.disc({.at = {-0.1, r},
                .velocity = {0.3, 0},
                .radius = r,
                .material = rubber,
                .inertia = solid(1, r),
                .spin = -0.3 / r});
    SceneOptions options = until(0.75, step);
    options.sample_times = times(700, 1e-3);
    const SceneRun run = simulate(scene, options);
    EXPECT_EQ(run.outcome, Outcome::reached_end) << run.message;
    expect_no_gain(scene, run);
    for (std::size_t k = 0; k < run.samples.size(); ++k) {
        const BodyState& disc = run.samples[k][0];
        if (disc.at[1] > 0.8 * r) continue;
        const double v = std::hypot(disc.velocity[0], disc.velocity[1]);
        // It has turned with its centre about the corner, without slip; a straight step ends
        // (h v)^2 / 2r from the circle.
        EXPECT_NEAR(std::hypot(disc.at[0], disc.at[1]), r, step * step * v * v / r);
        EXPECT_NEAR(run.sample_turns[k][0].spin, -v / r, 0.05);
        const double exact = std::sqrt(0.09 + 4.0 / 3 * 10 * (r - disc.at[1]));
        return v - exact;
    }
    ADD_FAILURE() << "it did not come down";
    return 0;
}

TEST(TurningContact, ADiscRollsOverACorner)
{
    // Its energy about the corner, 3/4 m v^2, grows by what its centre comes down: order 1.
    const double coarse = speed_over_a_corner(1e-3);
    const double fine = speed_over_a_corner(1e-4);
    EXPECT_LT(std::abs(coarse), 5e-3);
    EXPECT_LT(std::abs(fine), 0.2 * std::abs(coarse));
}

/// Error of the speed at which a solid disc that rolls down in a bowl from the height of its centre
/// passes the lowest point, as a fraction.
double error_in_a_bowl(double step)
{
    Scene scene({.gravity = {0, -10}});
    const auto rubber = scene.material({.restitution = 0, .friction = 2});
    scene.arc({.name = "bowl", .ends = {{{-1, 0}, {1, 0}}}, .material = rubber});
    const double r = 0.1;
    const double start = 1;  // [rad] from the lowest point
    scene.disc({.at = {0.9 * std::sin(start), -0.9 * std::cos(start)},
                .radius = r,
                .material = rubber,
                .inertia = solid(1, r)});
    SceneOptions options = until(1, step);
    options.sample_times = times(999, 1e-3);
    const SceneRun run = simulate(scene, options);
    EXPECT_EQ(run.outcome, Outcome::reached_end) << run.message;
    double fastest = 0;
    for (const auto& bodies : run.samples) {
        fastest = std::max(fastest, std::hypot(bodies[0].velocity[0], bodies[0].velocity[1]));
    }
    const double exact = std::sqrt(4.0 / 3 * 10 * 0.9 * (1 - std::cos(start)));
    return fastest / exact - 1;
}

TEST(TurningContact, ADiscRollsInABowl)
{
    // 3/4 m v^2 = m g (R - r)(1 - cos) for a solid disc without slip; the error is of order 1.
    const double coarse = error_in_a_bowl(2e-3);
    const double fine = error_in_a_bowl(1e-3);
    EXPECT_LT(std::abs(coarse), 1e-2);
    EXPECT_NEAR(fine / coarse, 0.5, 0.1);
}

/// A heap of discs, most of which turn, above a bin.
Scene heap(int count, double friction)
{
    Scene scene({.gravity = {0, -9.81}});
    const auto grain = scene.material({.restitution = 0.3, .friction = friction});
    scene.wall({.normal = {0, 1}, .material = grain});
    scene.wall({.normal = {1, 0}, .material = grain});
    scene.wall({.point = {1.6, 0}, .normal = {-1, 0}, .material = grain});
    for (int k = 0; k < count; ++k) {
        const double radius = 0.08 + 0.03 * std::sin(7.0 * k);
        const double mass = 100 * radius * radius;
        const int column = k % 6;
        const double inertia = k % 5 == 4 ? 0 : solid(mass, radius);
        scene.disc({.at = {0.2 + 0.24 * column + 0.01 * std::cos(3.0 * k), 0.2 + 0.25 * (k / 6)},
                    .velocity = {0.3 * std::sin(k + 1.0), 0},
                    .radius = radius,
                    .mass = mass,
                    .material = grain,
                    .inertia = inertia,
                    .spin = inertia > 0 ? 5 * std::cos(5.0 * k) : 0});
    }
    return scene;
}

TEST(TurningContact, APileOfFiftyDiscsSettles)
{
    const Scene scene = heap(50, 0.4);
    SceneOptions options = until(8, 2e-3);
    options.sample_times = times(80, 0.1);
    const SceneRun run = simulate(scene, options);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    expect_no_gain(scene, run);
    EXPECT_LE(overlap(scene, run.bodies), 1e-10);
    EXPECT_LE(run.statistics.contact_defect, 1e-7);
    for (std::size_t i = 0; i < run.bodies.size(); ++i) {
        EXPECT_LT(std::hypot(run.bodies[i].velocity[0], run.bodies[i].velocity[1]), 1e-6) << i;
        EXPECT_LT(std::abs(run.turns[i].spin), 1e-5) << i;
    }
}

TEST(TurningContact, ACrowdOfDiscsThatTurnNeverGainsEnergy)
{
    const Scene scene = heap(80, 0.4);
    SceneOptions options = until(4, 2e-3);
    options.sample_times = times(400, 0.01);
    const SceneRun run = simulate(scene, options);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_GT(run.statistics.crowded_steps, 0U);
    expect_no_gain(scene, run);
    EXPECT_LE(overlap(scene, run.bodies), 1e-4);
}

TEST(TurningContact, ExtremeInertiasAndSpinsEndWithAnOutcome)
{
    for (const double inertia : {1e-300, 1e-12, 1e12, 1e300}) {
        for (const double spin : {0.0, 1e6, -1e200}) {
            Scene scene({.gravity = {0, -10}});
            const auto clay = scene.material({.restitution = 0, .friction = 0.5});
            scene.wall({.normal = {0, 1}, .material = clay});
            scene.disc({.at = {0, 0.5},
                        .radius = 0.5,
                        .material = clay,
                        .inertia = inertia,
                        .spin = spin});
            scene.disc({.at = {0, 1.5}, .radius = 0.5, .material = clay, .inertia = 0.1});
            SceneOptions options = until(0.05);
            options.max_events = 10'000;
            const SceneRun run = simulate(scene, options);
            if (run.outcome != Outcome::reached_end) continue;
            for (const BodyTurn& turn : run.turns) EXPECT_TRUE(std::isfinite(turn.spin));
        }
    }
}

}  // namespace
}  // namespace ricochet::turning_contact_test
