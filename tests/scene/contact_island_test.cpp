// Islands of lasting contact: closed forms, rest, hand-over.

#include "scene/contact_island.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace ricochet::detail::contact_island_test {
namespace {

constexpr double g = 9.81;

auto coefficients(double restitution, double friction)
{
    return [=](std::uint32_t, std::uint32_t) { return ContactCoefficients{restitution, friction}; };
}

IslandWall floor_wall()
{
    return {.id = 0, .point = {0, 0}, .normal = {0, 1}};
}

/// A disc on a plane that rises by `slope` [rad], at the speed `v` upwards along it.
IslandSetup on_incline(double slope, double friction, double v)
{
    const double c = std::cos(slope);
    const double s = std::sin(slope);
    return {.bodies = {{.id = 7,
                        .at = {-0.1 * s, 0.1 * c},
                        .velocity = {v * c, v * s},
                        .mass = 2,
                        .radius = 0.1}},
            .walls = {{.id = 1, .point = {0, 0}, .normal = {-s, c}}},
            .gravity = {0, -g},
            .coefficients = coefficients(0, friction)};
}

TEST(ContactIsland, DiscOnInclineStopsAndSticks)
{
    // It slides up against g (sin + mu cos), stops after v / that, and tan 0.5 = 0.55 < mu. A disc
    // without spin slides like a block. The position lags by h v / 2: the rule is of order 1.
    const double up = g * (std::sin(0.5) + 0.7 * std::cos(0.5));
    for (const double h : {1e-2, 1e-3}) {
        ContactIsland island(on_incline(0.5, 0.7, 1), {.step = h}, 0);
        EXPECT_EQ(island.advance(1), IslandOutcome::asleep);
        EXPECT_EQ(island.t(), 1);
        const IslandBody disc = island.body(7);
        EXPECT_EQ(disc.velocity, (std::array{0.0, 0.0}));
        const double way = disc.at[0] * std::cos(0.5) + disc.at[1] * std::sin(0.5);
        EXPECT_NEAR(way, 0.5 / up, 0.6 * h);
        // On the plane to rounding, and held by the force that balances gravity.
        EXPECT_NEAR(-disc.at[0] * std::sin(0.5) + disc.at[1] * std::cos(0.5), 0.1, 1e-15);
        ASSERT_EQ(island.contacts().size(), 1U);
        const auto impulse = island.contacts()[0].impulse;
        EXPECT_NEAR(impulse[0] / island.contact_step(), 2 * g * std::cos(0.5), 1e-9);
        EXPECT_NEAR(std::abs(impulse[1]) / island.contact_step(), 2 * g * std::sin(0.5), 1e-9);
    }
}

TEST(ContactIsland, DiscOnSteepInclineTurnsAndSlidesDown)
{
    const double c = std::cos(0.5);
    const double s = std::sin(0.5);
    const double stops = 1 / (g * (s + 0.2 * c));
    const double down = g * (s - 0.2 * c);
    double errors[2];
    for (int k = 0; k < 2; ++k) {
        const double h = k == 0 ? 1e-2 : 1e-3;
        ContactIsland island(on_incline(0.5, 0.2, 1), {.step = h}, 0);
        EXPECT_EQ(island.advance(1), IslandOutcome::reached);
        const IslandBody disc = island.body(7);
        const double speed = disc.velocity[0] * c + disc.velocity[1] * s;
        // The step in which it stops is lost to the friction of the opposite direction.
        EXPECT_NEAR(speed, -down * (1 - stops), 2 * g * h);
        errors[k] = std::abs(disc.at[0] * c + disc.at[1] * s -
                             (stops / 2 - down * (1 - stops) * (1 - stops) / 2));
        EXPECT_LT(errors[k], 2 * h);
    }
    EXPECT_GT(errors[0], 5 * errors[1]);  // order 1
}

/// Discs fall into a bin with walls at 0 and `width`.
IslandSetup in_bin(int discs, double width, double friction, unsigned seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    IslandSetup setup{.bodies = {},
                      .walls = {{.id = 0, .point = {0, 0}, .normal = {0, 1}},
                                {.id = 1, .point = {0, 0}, .normal = {1, 0}},
                                {.id = 2, .point = {width, 0}, .normal = {-1, 0}}},
                      .gravity = {0, -g},
                      .coefficients = coefficients(0, friction)};
    const int row = std::max(1, static_cast<int>(width / 0.25));
    for (int i = 0; i < discs; ++i) {
        const double radius = 0.08 + 0.04 * uniform(random);
        setup.bodies.push_back(
            {.id = static_cast<std::uint32_t>(i),
             .at = {0.125 + 0.25 * (i % row) + 0.01 * uniform(random), 0.125 + 0.25 * (i / row)},
             .mass = radius * radius * 100,
             .radius = radius,
             .patience = 1000});
    }
    return setup;
}

TEST(ContactIsland, StackInBinComesToRestAndStaysForTenThousandSeconds)
{
    for (const double friction : {0.0, 0.5}) {
        ContactIsland island(in_bin(12, 0.7, friction, 3), {.step = 1e-3}, 0);
        double energy = island.energy();
        // With patience 1 a free fall is handed back immediately; here the discs wait in the
        // island.
        for (int i = 1; i <= 5000 && !island.asleep(); ++i) {
            const IslandOutcome outcome = island.advance(i * 1e-3);
            ASSERT_NE(outcome, IslandOutcome::not_converged);
            if (outcome == IslandOutcome::released) GTEST_FAIL() << "released at " << island.t();
            // Never more than the growth by rounding: 1e-12 of the energy at the start.
            EXPECT_LE(island.energy(), energy + 1e-12 * 60);
            energy = island.energy();
        }
        ASSERT_TRUE(island.asleep()) << friction;
        std::vector<IslandBody> before;
        for (std::uint32_t id = 0; id < 12; ++id) before.push_back(island.body(id));
        EXPECT_EQ(island.advance(1e4), IslandOutcome::asleep);
        EXPECT_EQ(island.t(), 1e4);
        double weight = 0;
        for (const IslandBody& b : before) {
            const IslandBody after = island.body(b.id);
            EXPECT_EQ(after.at, b.at);
            EXPECT_EQ(after.velocity, (std::array{0.0, 0.0}));
            weight += b.mass * g;
        }
        // The impulses that hold the stack are its weight.
        double held = 0;
        for (const IslandContact& c : island.contacts()) {
            if (c.with_wall) held += c.normal[1] * c.impulse[0] + c.normal[0] * c.impulse[1];
            EXPECT_NEAR(c.gap, 0, 1e-11);
        }
        EXPECT_NEAR(held / island.contact_step(), weight, 1e-8 * weight);
    }
}

TEST(ContactIsland, PressedPairMovesAsOneAndKeepsItsMomentum)
{
    // A spring of rest length 0.1 presses two discs of radius 0.1 together: k (0.2 - 0.1). No other
    // force acts, so the sum of momenta is constant to rounding: 1000 steps of some ulp of 3.
    IslandSetup setup{
        .bodies = {{.id = 4, .at = {0, 0}, .velocity = {1, 0.3}, .mass = 2, .radius = 0.1},
                   {.id = 9, .at = {0.2, 0}, .velocity = {1, 0.3}, .mass = 1, .radius = 0.1}},
        .springs = {{.first = 4, .second = 9, .rest = 0.1, .stiffness = 100}},
        .coefficients = coefficients(0, 0.3)};
    ContactIsland island(setup, {.step = 1e-3}, 0);
    EXPECT_EQ(island.advance(1), IslandOutcome::reached);
    const IslandBody a = island.body(4);
    const IslandBody b = island.body(9);
    EXPECT_NEAR(2 * a.velocity[0] + b.velocity[0], 3, 1e-12);
    EXPECT_NEAR(2 * a.velocity[1] + b.velocity[1], 0.9, 1e-12);
    EXPECT_NEAR(std::hypot(b.at[0] - a.at[0], b.at[1] - a.at[1]), 0.2, 1e-14);
    EXPECT_NEAR(a.at[0], 1, 1e-12);
    ASSERT_EQ(island.contacts().size(), 1U);
    EXPECT_NEAR(island.contacts()[0].impulse[0] / island.contact_step(), 10, 1e-8);
    EXPECT_EQ(island.groups().size(), 1U);
}

TEST(ContactIsland, DiscIsPushedAlongByAnother)
{
    // On a floor with friction 0.2 the first slides at 1 into the chain, which continues at a
    // common speed and stops after v^2 / (2 mu g), v = 1/4: 0.016 m, late by no more than h v.
    IslandSetup setup{
        .walls = {floor_wall()}, .gravity = {0, -g}, .coefficients = coefficients(0, 0.2)};
    for (std::uint32_t i = 0; i < 4; ++i) {
        setup.bodies.push_back(
            {.id = i, .at = {0.2 * i, 0.1}, .velocity = {i == 0 ? 1.0 : 0.0, 0}, .radius = 0.1});
    }
    setup.coefficients = [](std::uint32_t a, std::uint32_t b) {
        return ContactCoefficients{0, a == b ? 0 : 0.2};
    };
    setup.walls[0].material = 1;
    ContactIsland island(setup, {.step = 1e-4}, 0);
    EXPECT_EQ(island.advance(1), IslandOutcome::asleep);
    for (std::uint32_t i = 0; i < 4; ++i) {
        EXPECT_NEAR(island.body(i).at[0], 0.2 * i + 0.0625 / (2 * 0.2 * g), 2e-4);
    }
}

/// Two discs on the floor and a third between and above them, all of radius 0.1 and mass 1.
IslandSetup wedge(double friction)
{
    return {.bodies = {{.id = 0, .at = {-0.1, 0.1}, .radius = 0.1},
                       {.id = 1, .at = {0.1, 0.1}, .radius = 0.1},
                       {.id = 2, .at = {0, 0.1 + 0.1 * std::sqrt(3.0)}, .radius = 0.1}},
            .walls = {floor_wall()},
            .gravity = {0, -g},
            .coefficients = coefficients(0, friction)};
}

TEST(ContactIsland, WedgeOfThreeStandsOnEnoughFriction)
{
    // Forces at the boundaries of their cones, at 60 degrees and the angle f of friction from the
    // ground: it stands if tan f tan(60 deg + f) >= 1/3, mu = tan f >= (sqrt(60) - sqrt(48)) / 6 =
    // 0.1363.
    ContactIsland stands(wedge(0.14), {.step = 1e-3}, 0);
    EXPECT_EQ(stands.advance(1), IslandOutcome::asleep);
    EXPECT_EQ(stands.statistics().steps, 1U);
    ContactIsland falls(wedge(0.13), {.step = 1e-3}, 0);
    EXPECT_EQ(falls.advance(0.1), IslandOutcome::reached);
    EXPECT_GT(falls.body(1).velocity[0], 0.001);
    EXPECT_LT(falls.body(2).velocity[1], -0.001);
}

TEST(ContactIsland, DiscLeavesARoundTopWhereItsForceEnds)
{
    // A disc that slides without friction from the top of an immovable one leaves it at
    // cos(angle) = 2/3, by the balance of forces: there its gap is still of the order of rounding.
    double errors[2];
    for (int k = 0; k < 2; ++k) {
        const double h = k == 0 ? 2e-3 : 2e-4;
        const double start = 0.1;
        IslandSetup setup{.bodies = {{.id = 0, .at = {0, 1}, .mass = 1e12, .radius = 1},
                                     {.id = 1,
                                      .at = {1.1 * std::sin(start), 1 + 1.1 * std::cos(start)},
                                      .radius = 0.1}},
                          .walls = {floor_wall()},
                          .gravity = {0, -g},
                          .coefficients = coefficients(0, 0)};
        ContactIsland island(setup, {.step = h}, 0);
        std::size_t pushing = 2;
        while (pushing == 2 && island.t() < 3) {
            ASSERT_EQ(island.advance(island.t() + h), IslandOutcome::reached);
            pushing = island.contacts().size();
        }
        const IslandBody disc = island.body(1);
        const double cosine = (disc.at[1] - 1) / std::hypot(disc.at[0], disc.at[1] - 1);
        errors[k] = std::abs(cosine - 2 * std::cos(start) / 3);
        EXPECT_LT(errors[k], 5 * h);
        EXPECT_EQ(island.groups().size(), 2U);
    }
    EXPECT_GT(errors[0], 4 * errors[1]);
}

TEST(ContactIsland, IsHandedBackWhereContactHasEnded)
{
    // A disc slides at 3 m/s off the end of a table: 9 > g r, so it flies on immediately.
    IslandSetup setup{
        .bodies = {{.id = 3, .at = {-0.3001, 0.1}, .velocity = {3, 0}, .radius = 0.1}},
        .walls = {{.id = 8, .is_segment = true, .point = {-1, 0}, .end = {0, 0}}},
        .gravity = {0, -g},
        .coefficients = coefficients(0, 0)};
    ContactIsland island(setup, {.step = 1e-3}, 0);
    EXPECT_EQ(island.advance(1), IslandOutcome::released);
    EXPECT_NEAR(island.t(), 0.1, 2e-3);
    const IslandBody disc = island.body(3);
    EXPECT_NEAR(disc.velocity[0], 3, 1e-12);
    EXPECT_NEAR(disc.velocity[1], 0, 2e-3 * g);
    // With patience it stays that many steps longer.
    setup.bodies[0].patience = 5;
    ContactIsland patient(setup, {.step = 1e-3}, 0);
    EXPECT_EQ(patient.advance(1), IslandOutcome::released);
    EXPECT_NEAR(patient.t() - island.t(), 4e-3, 1e-12);
}

TEST(ContactIsland, ArrivalsThatReboundAreImpactsAtTheirTime)
{
    // On a floor without friction at 2 m/s towards a wall at 1: the rim arrives after 0.45 s.
    IslandSetup setup{.bodies = {{.id = 3, .at = {0, 0.1}, .velocity = {2, 0}, .radius = 0.1}},
                      .walls = {floor_wall(), {.id = 5, .point = {1, 0}, .normal = {-1, 0}}},
                      .gravity = {0, -g},
                      .coefficients = coefficients(0.5, 0)};
    ContactIsland island(setup, {.step = 1e-2}, 0);
    EXPECT_EQ(island.advance(1), IslandOutcome::impact);
    EXPECT_NEAR(island.t(), 0.45, 1e-14);
    ASSERT_EQ(island.arrivals().size(), 1U);
    EXPECT_EQ(island.arrivals()[0].second, 5U);
    const StrikeReport strike = island.strike();
    EXPECT_FALSE(strike.refused);
    EXPECT_NEAR(island.body(3).velocity[0], -1, 1e-12);
    EXPECT_EQ(island.advance(1), IslandOutcome::reached);
    EXPECT_NEAR(island.body(3).at[0], 0.9 - 0.55, 1e-12);
}

TEST(ContactIsland, MovingWallWakesSleepersWhenItMoves)
{
    // The wall stands until 5 s and then pushes at 0.1 m/s.
    const WallMotion motion{[](double t) {
                                return std::array{t > 5 ? 0.1 * (t - 5) : 0.0, 0.0};
                            },
                            [](double t) { return t < 5 ? 5.0 : t; }};
    IslandSetup setup{
        .bodies = {{.id = 0, .at = {0.1, 0.1}, .radius = 0.1},
                   {.id = 1, .at = {0.3, 0.1}, .radius = 0.1}},
        .walls = {floor_wall(), {.id = 6, .point = {0, 0}, .normal = {1, 0}, .motion = &motion}},
        .gravity = {0, -g},
        .coefficients = coefficients(0, 0.5)};
    ContactIsland island(setup, {.step = 1e-3}, 0);
    EXPECT_EQ(island.advance(4.9), IslandOutcome::asleep);
    EXPECT_EQ(island.wake_time(), 5);
    EXPECT_EQ(island.statistics().steps, 1U);
    EXPECT_EQ(island.advance(6), IslandOutcome::reached);
    EXPECT_NEAR(island.body(0).at[0], 0.2, 1e-12);
    EXPECT_NEAR(island.body(1).at[0], 0.4, 1e-12);
    EXPECT_NEAR(island.body(1).velocity[0], 0.1, 1e-10);
}

TEST(ContactIsland, ImpactWakesSleepers)
{
    ContactIsland island(wedge(0.5), {.step = 1e-3}, 0);
    EXPECT_EQ(island.advance(1), IslandOutcome::asleep);
    island.set_velocity(2, {0, 1});
    EXPECT_FALSE(island.asleep());
    EXPECT_EQ(island.advance(1.1), IslandOutcome::reached);
    EXPECT_GT(island.body(2).at[1], 0.1 + 0.1 * std::sqrt(3.0));
    EXPECT_TRUE(std::ranges::count(island.groups(), std::vector<std::uint32_t>{2}));
}

TEST(ContactIsland, HairsAreTakenAndOverlapsRefused)
{
    for (const double hair : {-1e-9, 1e-9}) {
        IslandSetup setup = wedge(0.5);
        setup.bodies[2].at[1] += hair;
        ContactIsland island(setup, {.step = 1e-3}, 0);
        EXPECT_LE(island.statistics().projected, 1e-9);
        EXPECT_EQ(island.advance(1), IslandOutcome::asleep);
        for (const IslandContact& c : island.contacts()) EXPECT_NEAR(c.gap, 0, 1e-12);
    }
    IslandSetup setup = wedge(0.5);
    setup.bodies[2].at[1] -= 0.01;
    try {
        ContactIsland island(setup, {}, 0);
        FAIL();
    } catch (const std::invalid_argument& error) {
        EXPECT_NE(std::string(error.what()).find("bodies 0 and 2 overlap by 0.0085"),
                  std::string::npos)
            << error.what();
    }
}

TEST(ContactIsland, LabelsDoNotChangeABit)
{
    const IslandSetup setup = in_bin(10, 0.6, 0.4, 8);
    IslandSetup other = setup;
    std::ranges::reverse(other.bodies);
    std::rotate(other.bodies.begin(), other.bodies.begin() + 3, other.bodies.end());
    std::ranges::reverse(other.walls);
    for (IslandBody& b : other.bodies) b.id = 1000 - 7 * b.id;
    ContactIsland a(setup, {.step = 1e-3}, 0);
    ContactIsland b(other, {.step = 1e-3}, 0);
    for (const double t : {0.05, 0.2, 1.0}) {
        a.advance(t);
        b.advance(t);
        for (std::uint32_t id = 0; id < 10; ++id) {
            EXPECT_EQ(a.body(id).at, b.body(1000 - 7 * id).at);
            EXPECT_EQ(a.body(id).velocity, b.body(1000 - 7 * id).velocity);
        }
    }
}

TEST(ContactIsland, CutStepsDoNotRaiseTheEnergy)
{
    ContactIsland island(in_bin(8, 0.6, 0.3, 5), {.step = 2e-3}, 0);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    double energy = island.energy();
    for (int i = 0; i < 400 && !island.asleep(); ++i) {
        const ContactIsland::Plan plan = island.plan(10);
        if (plan.outcome != IslandOutcome::reached) break;
        island.commit(i % 3 == 0 ? plan.length * uniform(random) : plan.length);
        EXPECT_LE(island.energy(), energy + 1e-11);
        energy = island.energy();
    }
    EXPECT_TRUE(island.asleep());
}

TEST(ContactIsland, RefusesAnImpactThatWouldRaiseTheEnergy)
{
    // At restitution 0.9 and friction 1, a fifth of random velocities and masses of three discs
    // that touch would gain energy, up to 13 times the initial one.
    int refused = 0;
    std::mt19937 random(2);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int trial = 0; trial < 50; ++trial) {
        IslandSetup setup = wedge(1);
        setup.coefficients = coefficients(0.9, 1);
        for (IslandBody& b : setup.bodies) {
            b.velocity = {uniform(random), uniform(random)};
            b.mass = std::pow(10, uniform(random));
        }
        ContactIsland island(setup, {}, 0);
        const double before = island.energy();
        const StrikeReport report = island.strike();
        EXPECT_LE(island.energy(), before * (1 + 1e-9));
        if (!report.refused) continue;
        EXPECT_EQ(island.energy(), before);
        EXPECT_FALSE(report.message.empty());
        if (report.law.converged) ++refused;
    }
    EXPECT_GT(refused, 5);
}

TEST(ContactIsland, ErrorsAreEstimatedByHalves)
{
    ContactIsland island(on_incline(0.5, 0.2, 1), {.step = 1e-2, .estimate_error = true}, 0);
    EXPECT_EQ(island.advance(1), IslandOutcome::reached);
    // h^2 a / 4 for constant acceleration, 1 at most here: g (sin + mu cos) = 6.4.
    EXPECT_NEAR(island.statistics().largest_error, 1e-4 * 6.42 / 4, 1e-4 * 6.42 / 20);
    EXPECT_EQ(island.statistics().steps, 200U);
}

TEST(ContactIsland, SleepSpeedIsReported)
{
    // Without friction it slides forever, at less than the speed below which it may sleep.
    IslandSetup setup{.bodies = {{.id = 0, .at = {0, 0.1}, .velocity = {1e-3, 0}, .radius = 0.1}},
                      .walls = {floor_wall()},
                      .gravity = {0, -g},
                      .coefficients = coefficients(0, 0)};
    ContactIsland never(setup, {.step = 1e-3}, 0);
    EXPECT_EQ(never.advance(2), IslandOutcome::reached);
    ContactIsland island(setup, {.step = 1e-3, .sleep_speed = 1e-2}, 0);
    EXPECT_EQ(island.advance(2), IslandOutcome::asleep);
    EXPECT_EQ(island.statistics().slept_by_speed, 1U);
    EXPECT_NEAR(island.body(0).at[0], 0.5e-3, 2e-6);
}

TEST(ContactIsland, PatienceDoublesWhereIslandsReturnAtOnce)
{
    EXPECT_EQ(next_patience(1, 0.995, 1, 1e-3), 2U);
    EXPECT_EQ(next_patience(8, 0.995, 1, 1e-3), 16U);
    EXPECT_EQ(next_patience(8, 0.5, 1, 1e-3), 1U);
}

TEST(ContactIsland, SixtyDiscsComeToRest)
{
    // Above 12 bodies matrices are sparse.
    ContactIsland island(in_bin(60, 1.6, 0.4, 11), {.step = 5e-3}, 0);
    double energy = island.energy();
    while (island.t() < 20 && !island.asleep()) {
        ASSERT_NE(island.advance(island.t() + 5e-3), IslandOutcome::not_converged);
        EXPECT_LE(island.energy(), energy * (1 + 1e-12));
        energy = island.energy();
    }
    EXPECT_TRUE(island.asleep());
    for (const IslandContact& c : island.contacts()) EXPECT_NEAR(c.gap, 0, 1e-11);
}

TEST(ContactIsland, StiffSpringsAndDampersAreStableInLongSteps)
{
    // A chain of 8 discs on springs with periods of 2 ms falls onto a floor in steps of 10 ms.
    // Springs are implicit along their lengths but not in their rotation: energy may grow by the
    // rotation in a step, to second order, and stays below that of the start.
    IslandSetup setup{
        .walls = {floor_wall()}, .gravity = {0, -g}, .coefficients = coefficients(0, 0.3)};
    for (std::uint32_t i = 0; i < 8; ++i) {
        setup.bodies.push_back({.id = i,
                                .at = {0.2 * i, 0.3 + 0.05 * i},
                                .mass = 0.1,
                                .radius = 0.05,
                                .drag = 0.01,
                                .patience = 100000});
        if (i > 0) {
            setup.springs.push_back(
                {.first = i - 1, .second = i, .rest = 0.2, .stiffness = 1e6, .damping = 1});
        }
    }
    ContactIsland island(setup, {.step = 1e-2}, 0);
    const double start = island.energy();
    double most = 0;
    for (int i = 1; i <= 400 && !island.asleep(); ++i) {
        ASSERT_NE(island.advance(i * 1e-2), IslandOutcome::not_converged);
        most = std::max(most, island.energy());
    }
    EXPECT_LE(most, start);
    EXPECT_TRUE(island.asleep());
    for (std::uint32_t i = 0; i < 8; ++i) EXPECT_NEAR(island.body(i).at[1], 0.05, 1e-9);
}

TEST(ContactIsland, WhatIsNotSolvedIsReported)
{
    // A ceiling comes down on a disc that lies on the floor.
    const WallMotion down{.displacement =
                              [](double t) {
                                  return std::array<double, 2>{0, -t};
                              },
                          .still_until = [](double t) { return t; }};
    IslandSetup setup{
        .walls = {floor_wall()}, .gravity = {0, -9.81}, .coefficients = coefficients(0, 0.3)};
    setup.walls.push_back({.id = 2, .point = {0, 1}, .normal = {0, -1}, .motion = &down});
    setup.bodies.push_back({.id = 0, .at = {0, 0.5}, .radius = 0.5});
    ContactIsland island(setup, {.step = 1e-3}, 0);
    EXPECT_EQ(island.advance(1), IslandOutcome::not_converged);
    EXPECT_GT(island.failure().residual, 0);
    EXPECT_GT(island.statistics().halvings, 0U);
}

}  // namespace
}  // namespace ricochet::detail::contact_island_test
