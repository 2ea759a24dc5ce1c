// Plates: bodies that move along a line, such as pistons.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "gas.hpp"
#include "refusal.hpp"
#include "ricochet/scene/measure.hpp"
#include "ricochet/scene/simulate.hpp"
#include "scene/options.hpp"

namespace ricochet::plates_test {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// The impulse of an elastic impact of two masses that approach at u.
double elastic(double m, double n, double u)
{
    return 2 * u / (1 / m + 1 / n);
}

/// A point of mass 1 between a wall at 0 and a plate of mass m that comes from x with the speed w,
/// event by event in long double.
struct Squeezed {
    struct Event {
        long double t, v, w;
        bool wall;
    };
    long double m, p, v, x, w;
    long double t = 0;

    Event next()
    {
        const long double to_plate = v > w ? (x - p) / (v - w) : -1;
        const long double to_wall = v < 0 ? -p / v : -1;
        const bool wall = to_wall >= 0 && (to_plate < 0 || to_wall < to_plate);
        const long double s = wall ? to_wall : to_plate;
        t += s;
        p += s * v;
        x += s * w;
        if (wall) {
            v = -v;
            p = 0;
        } else {
            const long double change = 2 * (v - w) / (1 + m);
            v -= m * change;
            w += change;
            p = x;
        }
        return {t, v, w, wall};
    }
};

Scene squeezed(const Squeezed& start, const Vector2& direction)
{
    // Along any line, with a plate as high as the point needs.
    const Vector2 across{-direction[1], direction[0]};
    const auto at = [&](double along, double beside) {
        return Vector2{along * direction[0] + beside * across[0],
                       along * direction[1] + beside * across[1]};
    };
    const auto x = static_cast<double>(start.x);
    Scene scene;
    scene.wall({.normal = direction});
    scene.point({.at = at(static_cast<double>(start.p), 0),
                 .velocity = at(static_cast<double>(start.v), 0)});
    scene.plate({.name = "piston",
                 .ends = {at(x, -1), at(x, 1)},
                 .along = direction,
                 .speed = static_cast<double>(start.w),
                 .mass = static_cast<double>(start.m)});
    return scene;
}

/// A gas of discs of mass 1 between x = 0 and a piston at x = 2 in a cylinder one metre high, at
/// kT = 1, and the energy of the gas.
struct Cylinder {
    Scene scene;
    std::size_t count = 0;
    BodyId piston{};
    [[nodiscard]] double gas_energy(const SceneRun& run) const
    {
        double sum = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const Vector2& v = run.bodies[i].velocity;
            sum += 0.5 * (v[0] * v[0] + v[1] * v[1]);
        }
        return sum;
    }
};
Cylinder cylinder(double radius, double mass, double speed, unsigned seed)
{
    Cylinder out;
    Scene& scene = out.scene;
    scene.wall({.normal = {1, 0}});
    scene.wall({.normal = {0, 1}});
    scene.wall({.point = {0, 1}, .normal = {0, -1}});
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<Vector2> velocities(200);
    Vector2 mean{};
    for (Vector2& v : velocities) {
        v = {normal(generator), normal(generator)};
        for (std::size_t c = 0; c < 2; ++c) mean[c] += v[c] / 200;
    }
    for (std::size_t k = 0; k < 200; ++k) {
        scene.disc({.at = {0.1 * static_cast<double>(k % 20) + 0.05,
                           0.1 * static_cast<double>(k / 20) + 0.05},
                    .velocity = {velocities[k][0] - mean[0], velocities[k][1] - mean[1]},
                    .radius = radius});
    }
    out.count = 200;
    out.piston = scene.plate({.name = "piston",
                              .ends = {{{2, 0}, {2, 1}}},
                              .along = {1, 0},
                              .speed = speed,
                              .mass = mass});
    return out;
}

/// p A / N kT of hard discs that cover a fraction of the area (D. Henderson, A simple equation of
/// state for hard discs, Molecular Physics 30, 1975).
double henderson(double fraction)
{
    return (1 + fraction * fraction / 8) / ((1 - fraction) * (1 - fraction));
}

}  // namespace

TEST(Plates, ADiscStrikesAPlateInTheClosedForm)
{
    // The edge of the disc is 1.5 m away and comes at 3 m/s: at 0.5 s. Of the impulse along the
    // line nothing is lost; across it the smooth plate does nothing.
    for (const double side : {1.0, -1.0}) {
        Scene scene;
        scene.disc(
            {.at = {-2 * side, 0.25}, .velocity = {2 * side, 0.5}, .radius = 0.5, .mass = 2});
        scene.plate({.name = "piston", .ends = {{{0, 0}, {0, 1}}}, .speed = side, .mass = 4});
        const SceneRun run = simulate(scene, {.t_end = 1});
        ASSERT_EQ(run.events.size(), 1U);
        // At a right angle to itself: from (0, 0) to (0, 1) it is turned to (-1, 0).
        const double w = -side;
        const double p = elastic(2, 4, 2 + 1);
        const SceneEvent& event = run.events[0];
        EXPECT_NEAR(event.t, 0.5, 1e-15);
        EXPECT_EQ(event.body, 0U);
        EXPECT_EQ(event.other, (Partner{false, 1}));
        EXPECT_NEAR(event.impulse[0], -side * p, 1e-14);
        EXPECT_EQ(event.impulse[1], 0);
        EXPECT_NEAR(event.normal[0], -side, 1e-15);
        EXPECT_NEAR(event.at[0], -0.5 * side, 1e-15);
        EXPECT_NEAR(event.at[1], 0.5, 1e-15);
        EXPECT_NEAR(event.approach(), 3, 1e-14);
        EXPECT_NEAR(run.bodies[0].velocity[0], side * (2 - p / 2), 1e-14);
        EXPECT_EQ(run.bodies[0].velocity[1], 0.5);
        EXPECT_NEAR(run.bodies[1].velocity[0], w + side * p / 4, 1e-14);
        EXPECT_EQ(run.bodies[1].velocity[1], 0);
        EXPECT_NEAR(energy(scene, run.bodies), energy(scene, test::start_of(scene)), 1e-14);
    }
}

TEST(Plates, AnEndIsStruckAlongTheLineOfCentres)
{
    // The lower end, in the frame of the plate: the disc comes along x at the distance b below it
    // and touches where the line of centres has the slope b / sqrt(r^2 - b^2). The guide takes what
    // the impulse has across the line, so that the plate counts with m / n_x^2.
    const double r = 0.5, b = 0.3;
    Scene scene;
    scene.disc({.at = {-2, -b}, .velocity = {1, 0}, .radius = r});
    scene.plate({.ends = {{{0, 0}, {0, 1}}}, .along = {1, 0}, .mass = 3});
    const SceneRun run = simulate(scene, {.t_end = 4});
    ASSERT_EQ(run.events.size(), 1U);
    const double c = std::sqrt(r * r - b * b);
    EXPECT_NEAR(run.events[0].t, 2 - c, 1e-14);
    const Vector2 n{-c / r, -b / r};
    const double p = 2 * (c / r) / (1 + n[0] * n[0] / 3);
    EXPECT_NEAR(run.bodies[0].velocity[0], 1 + p * n[0], 1e-14);
    EXPECT_NEAR(run.bodies[0].velocity[1], p * n[1], 1e-14);
    EXPECT_NEAR(run.bodies[1].velocity[0], -p * n[0] / 3, 1e-14);
    EXPECT_NEAR(energy(scene, run.bodies), 0.5, 1e-14);
    EXPECT_NEAR(std::hypot(run.events[0].at[0], run.events[0].at[1]), 0, 1e-14);
}

TEST(Plates, ASqueezedPointBouncesAsInLongDouble)
{
    // 200 impacts in the squeeze of a plate, whose closest approach multiplies the speed of the
    // point: errors of a time grow by the speed that the plate brings, and stay below 1e-12.
    for (const double angle : {0.0, 0.7, 2.0, 4.5}) {
        Squeezed exact{.m = 1e4L, .p = 0.4L, .v = 1, .x = 1, .w = -0.05L};
        const Scene scene = squeezed(exact, {std::cos(angle), std::sin(angle)});
        const SceneRun run = simulate(scene, {.t_end = 1e4, .max_events = 200});
        ASSERT_EQ(run.events.size(), 200U) << run.message;
        for (const SceneEvent& event : run.events) {
            const Squeezed::Event expected = exact.next();
            ASSERT_EQ(event.other.is_surface, expected.wall) << event.number;
            EXPECT_NEAR(event.t, static_cast<double>(expected.t), 1e-12);
            EXPECT_NEAR(std::hypot(event.after[0][0], event.after[0][1]),
                        static_cast<double>(std::fabs(expected.v)), 1e-11);
        }
    }
}

TEST(Plates, TheSpeedOfASqueezedPointTimesItsRoomIsAnAdiabaticInvariant)
{
    // v L for a plate that is slow beside the point; the plate turns where the energy is that of
    // the point alone: v^2 = v_0^2 + m w^2 there, and L = v_0 L_0 / v to the order w / v.
    const double m = 1e6, w = 1e-3;
    Scene scene = squeezed({.m = m, .p = 0.5L, .v = 1, .x = 1, .w = -w}, {1, 0});
    SceneOptions options{.t_end = 1e4};
    double least = 1, fastest = 0;
    options.record_events = false;
    options.observe = [&](const SceneEvent& event) {
        if (event.other.is_surface) return;
        least = std::min(least, event.at[0]);
        fastest = std::max(fastest, std::fabs(event.after[0][0]));
    };
    const SceneRun run = simulate(scene, options);
    const double most = std::sqrt(1 + m * w * w);
    EXPECT_NEAR(fastest, most, 2 * w);
    EXPECT_NEAR(least, 1 / most, 2 * w);
    EXPECT_NEAR(energy(scene, run.bodies), 0.5 * (1 + m * w * w), 1e-13);
}

TEST(Plates, APistonCompressesAGasAlongItsAdiabat)
{
    // N discs have U = N kT, so that dU = -p dA with p A = N kT z(f), f = N pi r^2 / A, makes
    // d log T = -z d log A. The centres have the area (L - 2 r) (h - 2 r); z is taken at the
    // fraction of discs in it. The piston comes at a twentieth of the mean speed of discs and
    // turns; where it does the gas has had all of its energy. Compression raises the temperature
    // more the faster it is: by (w / c) of the change, 4 % here; 200 discs at one instant have a
    // temperature to 1 / sqrt(200) in each component, but their energy is exact.
    const double r = 0.004, mass = 1e5, speed = 0.06;
    const Cylinder start = cylinder(r, mass, -speed, 3);
    const double before = start.gas_energy(simulate(start.scene, {.t_end = 1e-9}));
    SceneOptions options{.t_end = 60, .record_events = false};
    double least = 2;
    double inner = 0;
    options.observe = [&](const SceneEvent& event) {
        const bool piston = !event.other.is_surface && event.other.index == start.piston.index;
        if (piston && event.after[1][0] <= 0) least = event.at[0];
    };
    const SceneRun whole = simulate(start.scene, options);
    ASSERT_EQ(whole.outcome, Outcome::reached_end) << whole.message;
    EXPECT_NEAR(energy(start.scene, whole.bodies), before + 0.5 * mass * speed * speed, 1e-10);
    inner = before + 0.5 * mass * speed * speed;  // all of it, where the piston turns
    const auto area = [&](double length) { return (length - 2 * r) * (1 - 2 * r); };
    double log_t = 0;
    const int steps = 1000;
    for (int k = 0; k < steps; ++k) {
        const double a = area(2) * std::pow(area(least) / area(2), (k + 0.5) / steps);
        log_t -=
            henderson(200 * std::numbers::pi * r * r / a) * std::log(area(least) / area(2)) / steps;
    }
    EXPECT_LT(least, 1.2);
    EXPECT_NEAR(std::log(inner / before) / log_t, 1, 0.05);
}

TEST(Plates, MomentumAlongTheLineIsKeptWithoutWalls)
{
    // Discs around a plate in the open: each impact on its faces gives to one what it takes from
    // the other, along the line; on smooth faces nothing happens across.
    std::mt19937 generator(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Scene scene;
    for (int k = 0; k < 40; ++k) {
        scene.disc({.at = {0.7 + 0.2 * (k % 5), -3.9 + 0.2 * k},
                    .velocity = {-1 + 0.3 * uniform(generator), 0.1 * uniform(generator)},
                    .radius = 0.05,
                    .mass = 1.5 + uniform(generator)});
        scene.disc({.at = {-0.7 - 0.2 * (k % 5), -3.9 + 0.2 * k},
                    .velocity = {1 + 0.3 * uniform(generator), 0.1 * uniform(generator)},
                    .radius = 0.05,
                    .mass = 1.5 + uniform(generator)});
    }
    scene.plate({.ends = {{{0, -20}, {0, 20}}}, .mass = 7});
    const auto along_x = [&](const std::vector<BodyState>& states) {
        double sum = 0;
        for (std::size_t i = 0; i < states.size(); ++i) {
            sum += scene.bodies()[i].mass * states[i].velocity[0];
        }
        return sum;
    };
    const SceneRun run = simulate(scene, {.t_end = 20});
    EXPECT_GT(run.events.size(), 80U);
    EXPECT_NEAR(along_x(run.bodies), along_x(test::start_of(scene)), 1e-13);
    EXPECT_NEAR(energy(scene, run.bodies), energy(scene, test::start_of(scene)), 1e-13);
}

TEST(Plates, NoPointTunnelsAndImpactsKeepTheEnergy)
{
    // A piston without friction between two gases of points: each point stays on its side. What the
    // impacts on the piston change the energy does not add up: each is undone as far as it is
    // known, to some 2e-17 J, and 1e4 such errors make 2e-15 J at random.
    std::mt19937 generator(7);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (const Vector2& along : {Vector2{1, 0}, Vector2{0.6, 0.8}}) {
        const Vector2 across{-along[1], along[0]};
        const auto at = [&](double x, double y) {
            return Vector2{x * along[0] + y * across[0], x * along[1] + y * across[1]};
        };
        Scene scene;
        scene.wall({.normal = along});
        scene.wall({.point = at(2, 0), .normal = {-along[0], -along[1]}});
        scene.wall({.normal = across});
        scene.wall({.point = at(0, 1), .normal = {-across[0], -across[1]}});
        for (int k = 0; k < 40; ++k) {
            const double x = uniform(generator) + (k < 20 ? 0 : 1);
            scene.point({.at = at(x, uniform(generator)),
                         .velocity = at(uniform(generator) - 0.5, uniform(generator) - 0.5),
                         .mass = 0.5 + uniform(generator)});
        }
        const BodyId piston =
            scene.plate({.ends = {at(1, 0), at(1, 1)}, .along = along, .mass = 3});
        const auto energy_of = [&](std::uint32_t i, const Vector2& v) {
            return 0.5L * static_cast<long double>(scene.bodies()[i].mass) *
                   (static_cast<long double>(v[0]) * v[0] + static_cast<long double>(v[1]) * v[1]);
        };
        long double gained = 0;
        std::uint64_t strikes = 0;
        SceneOptions options{.t_end = 1e6, .record_events = false, .max_events = 30'000};
        options.observe = [&](const SceneEvent& event) {
            if (event.other.is_surface) return;
            gained +=
                energy_of(event.body, event.after[0]) - energy_of(event.body, event.before[0]);
            gained += energy_of(event.other.index, event.after[1]) -
                      energy_of(event.other.index, event.before[1]);
            ++strikes;
        };
        const SceneRun run = simulate(scene, options);
        ASSERT_EQ(run.statistics.events, 30'000U) << run.message;
        EXPECT_GT(strikes, 5000U);
        EXPECT_LT(std::fabs(gained), 5e-15L);
        const auto place = [&](std::size_t i) {
            const Vector2& p = run.bodies[i].at;
            return p[0] * along[0] + p[1] * along[1];
        };
        for (std::size_t i = 0; i < 40; ++i) {
            const double beyond = place(i) - place(piston.index);
            EXPECT_GT(i < 20 ? -beyond : beyond, -1e-14) << i;
            EXPECT_GT(place(i), -1e-14);
            EXPECT_LT(place(i), 2 + 1e-14);
        }
    }
}

TEST(Plates, APointGoesAroundAnEndAndIsHeldOnTheOtherSide)
{
    // Thrown up behind the plate it falls over the end, and then upon the plate from above.
    Scene scene({.gravity = {0, -10}});
    scene.point({.at = {1.5, -1}, .velocity = {-1, 6}});
    scene.plate({.ends = {{{-1, 0}, {1, 0}}}, .along = {1, 0}, .mass = 1e9});
    // y = -1 + 6 s - 5 s^2 is 0 at s = 0.2 (x = 1.3, beside the plate) and at s = 1 (x = 0.5).
    const SceneRun run = simulate(scene, {.t_end = 1.7});
    ASSERT_EQ(run.events.size(), 1U) << run.message;
    EXPECT_NEAR(run.events[0].t, 1, 1e-14);
    EXPECT_NEAR(run.events[0].at[0], 0.5, 1e-14);
    EXPECT_NEAR(run.events[0].normal[1], 1, 1e-14);
    EXPECT_NEAR(run.bodies[0].at[1], 0.7 * 4 - 0.49 * 5, 1e-13);
}

TEST(Plates, OnADiagonalLineGravityAndWallsActAlongIt)
{
    // A plate on a slope of 3 in 4 falls with 0.6 g, meets the floor with its lower end after
    // sqrt(2 * 1 / (0.6 * 0.6 g)) s, and hops up the slope: the floor gives it n_y / m of each
    // impulse along the slope. With restitution 0.5 the flights take 1/2, 1/4, ... of twice the
    // fall.
    const double g = 10, fall = std::sqrt(2 / (0.36 * g));
    Scene scene({.gravity = {0, -g}});
    const MaterialId dull = scene.material({.restitution = 0.5});
    scene.wall({.name = "floor", .normal = {0, 1}, .material = dull});
    scene.plate({.name = "sledge",
                 .ends = {{{-1, 1}, {1, 1}}},
                 .along = {4, 3},
                 .mass = 2,
                 .material = dull});
    const SceneRun run = simulate(scene, {.t_end = 6});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    double t = fall, v = 0.6 * g * fall;
    std::size_t k = 0;
    for (; k < 30; ++k) {
        const SceneEvent& event = run.events.at(k);
        EXPECT_EQ(event.kind, SceneEvent::Kind::impact);
        EXPECT_NEAR(event.t, t, 1e-13);
        EXPECT_NEAR(-event.before[0][1], 0.6 * v, 1e-12);
        v *= 0.5;
        t += 2 * v / (0.6 * g);
    }
    EXPECT_EQ(run.events.back().kind, SceneEvent::Kind::held);
    EXPECT_NEAR(run.events.back().t, 3 * fall, 1e-12);
    EXPECT_TRUE(run.bodies[0].asleep);
    EXPECT_NEAR(run.bodies[0].at[1], 0, 1e-14);
}

TEST(Plates, APlateAtRestOnItsStopIsStruckOff)
{
    // A point falls on the plate, of the same mass, at rest on a slanted stop under its left end:
    // the impact goes through it to the elastic stop, and back.
    Scene scene({.gravity = {0, -10}});
    scene.wall({.point = {-1, 0}, .normal = {1, 1}});
    scene.plate({.ends = {{{-1, 0}, {1, 0}}}, .mass = 1});
    scene.point({.at = {0.5, 5}});
    const SceneRun run = simulate(scene, {.t_end = 1.01});
    ASSERT_EQ(run.events.size(), 3U) << run.message;
    for (const SceneEvent& event : run.events) {
        EXPECT_NEAR(event.t, 1, 1e-14);
        EXPECT_EQ(event.number, 0U);
    }
    EXPECT_TRUE(run.events[1].other.is_surface);
    EXPECT_NEAR(run.events[1].after[0][1], 10, 1e-13);
    EXPECT_NEAR(run.bodies[1].velocity[1], 10 - 0.1, 1e-12);
    EXPECT_NEAR(energy(scene, run.bodies), 50, 1e-12);
    EXPECT_TRUE(run.bodies[0].asleep);
}

TEST(Plates, ParallelPlatesExchangeTheirSpeedsAndDoNotPass)
{
    Scene scene;
    scene.wall({.normal = {1, 0}});
    scene.wall({.point = {10, 0}, .normal = {-1, 0}});
    scene.plate({.name = "left", .ends = {{{2, 0}, {2, 1}}}, .along = {1, 0}, .speed = 1});
    scene.plate({.name = "right", .ends = {{{5, 0.5}, {5, 2}}}, .along = {1, 0}, .speed = -2});
    scene.plate({.name = "above", .ends = {{{5, 3}, {5, 4}}}, .along = {1, 0}, .speed = -2});
    const SceneRun run = simulate(scene, {.t_end = 200});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_NEAR(run.events[0].t, 1, 1e-15);
    EXPECT_EQ(run.events[0].other, (Partner{false, 1}));
    EXPECT_EQ(run.bodies[0].velocity[0] * run.bodies[0].velocity[0] +
                  run.bodies[1].velocity[0] * run.bodies[1].velocity[0],
              5);
    double left = 2, right = 5;
    for (double t = 0.5; t < 200; t += 1.7) {
        const SceneRun part = simulate(scene, {.t_end = t});
        left = part.bodies[0].at[0];
        right = part.bodies[1].at[0];
        EXPECT_LE(left, right + 1e-13);
    }
    // The one above meets nothing but the walls.
    for (const SceneEvent& event : run.events) {
        if (event.body == 2 || (!event.other.is_surface && event.other.index == 2)) {
            EXPECT_TRUE(event.other.is_surface);
        }
    }
}

TEST(Plates, DiscsThatArriveTogetherStrikeOneAfterTheOther)
{
    // Rows of a lattice with equal velocities: by symmetry many reach the piston at one time, up to
    // rounding. One that the others leave closer than rounding resolves is struck, not pressed.
    Scene scene;
    for (const Vector2& normal : {Vector2{0, 1}, Vector2{1, 0}, Vector2{0, -1}, Vector2{-1, 0}}) {
        scene.wall({.point = {normal[0] < 0 ? 2.2 : 0, normal[1] < 0 ? 1.0 : 0}, .normal = normal});
    }
    for (int k = 0; k < 81; ++k) {
        scene.disc({.at = {0.1 + 0.2 * (k % 9), 0.1 + 0.1 * (k / 9)},
                    .velocity = {0.8, 0.6},
                    .radius = 0.02});
    }
    for (int k = 0; k < 72; ++k) {
        scene.disc({.at = {0.2 + 0.2 * (k % 9), 0.15 + 0.1 * (k / 9)},
                    .velocity = {-0.8, -0.6},
                    .radius = 0.02});
    }
    scene.plate({.ends = {{{2, 0}, {2, 1}}}, .along = {1, 0}, .speed = -0.6, .mass = 250});
    const SceneRun run = simulate(scene, {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_NEAR(energy(scene, run.bodies), energy(scene, test::start_of(scene)), 1e-11);
}

TEST(Plates, AMovingWallDrivesAPlate)
{
    // A wall at 1 m/s comes upon a plate at rest: it leaves at twice that.
    Scene scene;
    scene.wall(
        {.point = {-1, 0}, .normal = {1, 0}, .motion = ConstantVelocity{.velocity = {1, 0}}});
    scene.plate({.ends = {{{0, 0}, {0, 1}}}, .along = {1, 0}});
    const SceneRun run = simulate(scene, {.t_end = 1.5});
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_NEAR(run.events[0].t, 1, 1e-14);
    EXPECT_NEAR(run.bodies[0].velocity[0], 2, 1e-14);
}

TEST(Plates, FrictionTurnsADiscAsOnAWallOfTheSameMass)
{
    // A plate that slides along itself is struck on its face: it takes no impulse along the normal,
    // and friction moves it. The slip s = u + r w ends where J (1/m + r^2/I + 1/M) = -s.
    const double m = 2, r = 0.5, inertia = 0.25, mass = 3, u = 1, spin = 2;
    Scene scene;
    const MaterialId rubber = scene.material({.restitution = 0.5, .friction = 1});
    scene.plate({.ends = {{{-9, 0}, {9, 0}}}, .along = {1, 0}, .mass = mass, .material = rubber});
    scene.disc({.at = {0, 3.5},
                .velocity = {u, -3},
                .radius = r,
                .mass = m,
                .material = rubber,
                .inertia = inertia,
                .spin = spin});
    const SceneRun run = simulate(scene, {.t_end = 1.5});
    ASSERT_EQ(run.events.size(), 1U);
    const double across = -(u + r * spin) / (1 / m + r * r / inertia + 1 / mass);
    EXPECT_NEAR(run.bodies[1].velocity[0], u + across / m, 1e-13);
    EXPECT_NEAR(run.bodies[1].velocity[1], 1.5, 1e-13);
    EXPECT_NEAR(run.bodies[0].velocity[0], -across / mass, 1e-13);
    EXPECT_NEAR(run.turns[1].spin, spin + r * across / inertia, 1e-13);
}

TEST(Plates, LabelsCellsAndSamplesChangeNoBit)
{
    const auto build = [](bool first) {
        Scene scene;
        const auto plate = [&] {
            scene.plate({.name = "piston",
                         .ends = {{{2, 0}, {2, 1}}},
                         .along = {1, 0},
                         .speed = -0.4,
                         .mass = 20});
        };
        scene.wall({.normal = {1, 0}});
        scene.wall({.normal = {0, 1}});
        scene.wall({.point = {0, 1}, .normal = {0, -1}});
        if (first) plate();
        std::mt19937 generator(3);
        std::uniform_real_distribution<double> uniform(-1, 1);
        for (int k = 0; k < 50; ++k) {
            scene.disc({.name = "disc " + std::to_string(k),
                        .at = {0.1 + 0.18 * (k % 10), 0.1 + 0.18 * (k / 10)},
                        .velocity = {uniform(generator), uniform(generator)},
                        .radius = 0.04});
        }
        if (!first) plate();
        return scene;
    };
    const Scene scene = build(false);
    const SceneOptions options{.t_end = 5};
    const SceneRun run = simulate(scene, options);
    EXPECT_GT(run.events.size(), 500U);
    const auto same = [&](const SceneRun& other, const Scene& of) {
        ASSERT_EQ(other.events.size(), run.events.size());
        for (std::size_t k = 0; k < run.events.size(); ++k) {
            ASSERT_EQ(other.events[k].t, run.events[k].t) << k;
        }
        for (std::uint32_t i = 0; i < run.bodies.size(); ++i) {
            const std::uint32_t j = of.body(scene.name_of(BodyId{i})).index;
            EXPECT_EQ(other.bodies[j].at, run.bodies[i].at);
        }
    };
    const Scene relabelled = build(true);
    same(simulate(relabelled, options), relabelled);
    same(detail::simulate(scene, options, {.cell_side = 0.3}), scene);
    same(detail::simulate(scene, options, {.lay_after = 7}), scene);
    SceneOptions sampled = options;
    sampled.sample_times = {0.1, 1.7, 3.3};
    same(simulate(scene, sampled), scene);
    EXPECT_NE(explain(scene, options).find("1 plate of the bodies"), std::string::npos);
}

TEST(Plates, ADragIsMetOnTheMethodsMap)
{
    // A disc slowed by drag c follows x = v m / c (1 - exp(-c t / m)): it reaches the plate, 0.5 m
    // from its edge, at t = -log(0.5) for v = m = c = 1.
    Scene scene;
    scene.disc({.at = {0, 0}, .velocity = {1, 0}, .radius = 0.25, .drag = 1});
    scene.plate({.ends = {{{0.75, -1}, {0.75, 1}}}, .along = {1, 0}, .mass = 1e12});
    const SceneRun run = simulate(scene, {.t_end = 2, .rtol = 1e-12, .atol = 1e-13});
    ASSERT_EQ(run.events.size(), 1U) << run.message;
    EXPECT_NEAR(run.events[0].t, std::log(2.0), 1e-10);
}

TEST(Plates, AGasIsMeasuredWithoutItsPiston)
{
    // The piston is a wall for the measures: its energy is not that of the gas.
    const Cylinder start = cylinder(0.004, 1e5, -0.01, 3);
    SceneMeasure measure(start.scene, {.t_start = 0, .t_end = 1, .blocks = 2, .area = 2});
    SceneOptions options{.t_end = 1, .record_events = false};
    std::uint64_t on_walls = 0;
    std::uint64_t on_piston = 0;
    options.observe = [&](const SceneEvent& event) {
        measure.add(event);
        on_walls += event.other.is_surface;
        on_piston += !event.other.is_surface && event.other.index == start.piston.index;
    };
    const SceneRun run = simulate(start.scene, options);
    const SceneMeasures found = measure.result();
    ASSERT_GT(on_piston, 20U);
    EXPECT_NEAR(found.wall_rate.mean, static_cast<double>(on_walls + on_piston), 1e-9);
    EXPECT_NEAR(found.temperature.mean, start.gas_energy(run) / 199, 0.02);
}

TEST(Plates, LastingContactIsNamed)
{
    // A disc without restitution on a plate that hangs on nothing but its mass.
    Scene scene({.gravity = {0, -10}});
    const MaterialId clay = scene.material({.restitution = 0});
    scene.wall({.point = {-1, 0}, .normal = {1, 1}, .material = clay});
    scene.plate({.name = "lid", .ends = {{{-1, 0}, {1, 0}}}, .material = clay});
    scene.disc({.name = "ball", .at = {0, 1}, .radius = 0.5, .material = clay});
    const SceneRun run = simulate(scene, {.t_end = 2});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_NE(run.message.find("lid is in lasting contact, which of plates is followed on walls"),
              std::string::npos)
        << run.message;
}

TEST(Plates, WhatIsNoPlateIsRefusedInASentence)
{
    const Plate good{.name = "piston", .ends = {{{0, 0}, {0, 1}}}};
    const auto with = [&](const std::function<void(Plate&)>& change) {
        Plate plate = good;
        change(plate);
        return refusal([&] { Scene().plate(plate); });
    };
    EXPECT_EQ(with([](Plate& p) { p.ends[1] = p.ends[0]; }),
              "Scene: piston has no length: its ends are equal");
    EXPECT_NE(with([](Plate& p) { p.ends[1][0] = nan; }).find("piston: end"), std::string::npos);
    EXPECT_NE(with([](Plate& p) {
                  p.along = {nan, 0};
              }).find("piston: direction"),
              std::string::npos);
    EXPECT_NE(with([](Plate& p) { p.speed = nan; }).find("piston: speed"), std::string::npos);
    EXPECT_NE(with([](Plate& p) { p.mass = 0; }).find("piston: mass must be positive"),
              std::string::npos);
    EXPECT_NE(with([](Plate& p) { p.material = {7}; }).find("material of piston"),
              std::string::npos);

    const auto check = [&](const std::function<void(Scene&)>& add, const Vector2& period = {}) {
        Scene scene({.period = period});
        scene.plate(good);
        add(scene);
        return refusal([&] { scene.check(); });
    };
    EXPECT_EQ(check([](Scene& s) {
                  s.disc({.name = "ball", .at = {0.05, 0.9}, .radius = 0.1});
              }),
              "Scene: piston and ball overlap by 0.05 at the start");
    EXPECT_EQ(check([](Scene& s) {
                  s.point({.name = "dust", .at = {0, 0.25}});
              }),
              "Scene: dust lies on piston at the start; expected it on one side");
    EXPECT_EQ(check([](Scene& s) { s.point({.name = "dust", .at = {0, 1.25}}); }), "accepted");
    EXPECT_EQ(check([](Scene& s) {
                  s.plate({.name = "tilted", .ends = {{{2, 0}, {3, 1}}}});
              }),
              "Scene: piston and tilted are not parallel; expected parallel plates");
    EXPECT_NE(check([](Scene& s) {
                  s.wall({.point = {0, 0.5}, .normal = {0, 1}});
              }).find("piston at (0, 0.5) lies behind a wall by 0.5"),
              std::string::npos);
    EXPECT_EQ(check([](Scene& s) {
                  s.terrain({.name = "hill", .points = {{3, -1}, {3, 0.5}}});
              }),
              "Scene: hill lies in the way of piston; plates meet walls, not terrain");
    EXPECT_NE(check([](Scene& s) {
                  s.arc({.centre = {3, 1.4}, .radius = 0.5});
              }).find("lies in the way of piston"),
              std::string::npos);
    EXPECT_EQ(check([](Scene& s) { s.terrain({.points = {{3, 1}, {4, 1}, {5, 7}}}); }), "accepted");
    EXPECT_EQ(check([](Scene& s) {
                  s.wall({.point = {2, 0}, .normal = {-1, 0}});
                  s.terrain({.points = {{3, -1}, {3, 0.5}}});
              }),
              "accepted");
    EXPECT_NE(check([](Scene& s) {
                  s.terrain({.points = {{3, 5}, {4, 5}}, .motion = Oscillation{}});
              }).find("is terrain that moves, which a scene with plates has not"),
              std::string::npos);
    EXPECT_NE(check([](Scene&) {}, {4, 4}).find("a scene with a period has no plates"),
              std::string::npos);
    EXPECT_EQ(refusal([&] {
                  Scene scene;
                  const BodyId ball = scene.disc({.at = {3, 0}});
                  scene.spring({.between = {scene.plate(good), ball}});
              }),
              "Scene: a spring ends at piston, which is a plate");
}

TEST(Plates, AFileHasPlates)
{
    const SceneFile file = read_scene(R"({
      "materials": {"brass": {"restitution": 0.5}},
      "walls": [{"point": [0, 0], "normal": [1, 0], "material": "brass"}],
      "bodies": [{"name": "ball", "disc": {"radius": 0.1}, "at": [0.5, 0.5]}],
      "plates": [{"name": "piston", "from": [1, 0], "to": [1, 1], "along": [2, 0], "speed": -3,
                  "mass": 5, "material": "brass"}],
      "run": {"t_end": 1}})");
    ASSERT_EQ(file.scene.plates().size(), 1U);
    EXPECT_EQ(file.scene.plates()[0].body, 1U);
    EXPECT_EQ(file.scene.plates()[0].along, (Vector2{1, 0}));
    EXPECT_EQ(file.scene.bodies()[1].velocity, (Vector2{-3, 0}));
    EXPECT_EQ(file.scene.bodies()[1].mass, 5);
    EXPECT_EQ(file.scene.bodies()[1].material.index, 1U);
    EXPECT_GT(simulate(file.scene, file.options).events.size(), 3U);

    const auto message = [](const std::string& plate) {
        try {
            static_cast<void>(read_scene(
                "{\n\"bodies\": [{\"disc\": {}, \"at\": [0, 0]}],\n\"plates\": [\n" + plate + "]}",
                "p.json"));
        } catch (const SceneFileError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(message(R"({"from": [3, 0]})"), R"(p.json:4: expected "to" in a plate)");
    EXPECT_EQ(message(R"({"from": [3, 0], "to": [3, 1], "sped": 1})"),
              R"(p.json:4: unknown key "sped" in a plate, the nearest known is "speed")");
    EXPECT_EQ(message(R"({"from": [3, 0], "to": [3, 0]})"),
              "p.json:4: Scene: plate 1 has no length: its ends are equal");
    EXPECT_EQ(message(R"({"from": [0.5, 0], "to": [3, 0]})"),
              "p.json:4: Scene: body 1 and body 0 overlap by 0.5 at the start");
}

}  // namespace ricochet::plates_test
