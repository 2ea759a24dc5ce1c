// Surfaces that move by a given motion, against roots in long double and closed forms.
#include "ricochet/scene/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::motion_test {
namespace {

constexpr double g = 9.81;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// A ball of radius 0.1, one metre above a table that moves.
Scene ball_above(const SurfaceMotion& table, double restitution = 1)
{
    Scene scene({.gravity = {0, -g}});
    const MaterialId material = scene.material({.restitution = restitution});
    scene.wall({.name = "table", .normal = {0, 1}, .material = material, .motion = table});
    scene.disc({.name = "ball", .at = {0, 1.1}, .radius = 0.1, .material = material});
    return scene;
}

/// Times of the first `count` impacts of that ball, by a scan in steps of 10 us and bisection in
/// long double.
std::vector<double> impact_times(const Oscillation& table, double restitution, std::size_t count)
{
    const long double a = table.amplitude[1];
    const long double w = 2 * std::numbers::pi_v<long double> * table.frequency;
    long double t = 0;
    long double p = 1;
    long double v = 0;
    std::vector<double> times;
    while (times.size() < count) {
        const auto gap = [&](long double s) {
            return p + v * s - static_cast<long double>(g) * s * s / 2 -
                   a * std::sin(w * (t + s) + table.phase);
        };
        long double high = 1e-5L;
        while (gap(high) > 0) high += 1e-5L;
        long double low = high - 1e-5L;
        for (int i = 0; i < 70; ++i) {
            const long double middle = (low + high) / 2;
            (gap(middle) > 0 ? low : high) = middle;
        }
        t += high;
        const long double wall = a * w * std::cos(w * t + table.phase);
        v = wall - restitution * (v - static_cast<long double>(g) * high - wall);
        p = a * std::sin(w * t + table.phase);
        times.push_back(static_cast<double>(t));
    }
    return times;
}

TEST(SceneMotion, ABallOnAVibratingTableStrikesItAtTheRootsOfItsGap)
{
    const Oscillation table{.amplitude = {0, 0.05}, .frequency = 3, .phase = 0.2};
    for (const double restitution : {1.0, 0.8}) {
        const SceneRun run = simulate(ball_above(table, restitution), {.t_end = 5});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        const std::vector<double> expected = impact_times(table, restitution, 5);
        ASSERT_GE(run.events.size(), expected.size());
        for (std::size_t k = 0; k < expected.size(); ++k) {
            // Each is located to the rounding of the time, some 1e-16 s, and errors of one grow
            // by the ratio of velocities to the next, here no more than 10 times.
            EXPECT_NEAR(run.events[k].t, expected[k], 4e-16 * std::pow(10, k)) << k;
        }
        EXPECT_EQ(run.events[0].before[1], velocity(table, run.events[0].t));
    }
}

TEST(SceneMotion, AFunctionWithBoundsIsTheOscillationThatItIs)
{
    const double w = 6 * std::numbers::pi;
    const SurfaceMotion given = GivenMotion{.displacement =
                                                [=](double t) {
                                                    return Vector2{0, 0.05 * std::sin(w * t)};
                                                },
                                            .velocity =
                                                [=](double t) {
                                                    return Vector2{0, 0.05 * w * std::cos(w * t)};
                                                },
                                            .acceleration_bound = 0.05 * w * w};
    const auto ready = simulate(ball_above(Oscillation{{0, 0.05}, 3}), {.t_end = 3});
    const auto own = simulate(ball_above(given), {.t_end = 3});
    ASSERT_GE(ready.events.size(), 5u);
    for (std::size_t k = 0; k < 5; ++k) {
        EXPECT_NEAR(own.events[k].t, ready.events[k].t, 4e-16 * std::pow(10, k)) << k;
    }
}

TEST(SceneMotion, AFastTableIsNeverPassed)
{
    // A tenth of a millimetre at 500 Hz: a fall of 1 m takes 225 periods. Every impact is on the
    // table, and no ball is ever below it.
    const Oscillation table{.amplitude = {0, 1e-4}, .frequency = 500};
    std::vector<double> times(4001);
    for (std::size_t k = 0; k < times.size(); ++k) times[k] = 1e-3 * static_cast<double>(k);
    const SceneRun run = simulate(ball_above(table), {.t_end = 4, .sample_times = times});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_GT(run.events.size(), 3u);
    for (std::size_t k = 0; k < times.size(); ++k) {
        EXPECT_GE(run.samples[k][0].at[1] - 0.1 - displacement(table, times[k])[1], -1e-15);
    }
}

TEST(SceneMotion, APistonAddsTwiceItsVelocity)
{
    // The left edge of the disc at 4.5 - t meets the piston at t: 2.25 s; then 2 * 1 + 1 m/s.
    Scene scene;
    scene.wall({.normal = {1, 0}, .motion = ConstantVelocity{{1, 0}}});
    scene.disc({.at = {5, 0}, .velocity = {-1, 0}, .radius = 0.5});
    const SceneRun run = simulate(scene, {.t_end = 10});
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].t, 2.25);
    EXPECT_EQ(run.bodies[0].velocity, (Vector2{3, 0}));
    EXPECT_EQ(run.events[0].before[1], (Vector2{1, 0}));
}

TEST(SceneMotion, ABallBouncesOnATableOfConstantVelocityAgainAndAgain)
{
    // Along itself, the table may as well be at rest: flights of 2 sqrt(2 h / g), h = 1 m. Falling
    // or rising at w it changes nothing but the frame: the ball meets it at the speed sqrt(w^2 + 2
    // g) each time, and its flights last 2 / g of that.
    for (const Vector2& w : {Vector2{}, Vector2{1, 0}, Vector2{0, -0.5}, Vector2{0, 2}}) {
        const SceneRun run = simulate(ball_above(ConstantVelocity{.velocity = w}), {.t_end = 10});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        const double speed = std::sqrt(w[1] * w[1] + 2 * g);
        const double first = (speed - w[1]) / g;
        ASSERT_EQ(run.events.size(), static_cast<std::size_t>((10 - first) * g / speed / 2) + 1);
        for (std::size_t k = 0; k < run.events.size(); ++k) {
            const double expected = first + 2 * speed / g * static_cast<double>(k);
            EXPECT_NEAR(run.events[k].t, expected, 1e-13 * (1 + expected));
            EXPECT_NEAR(run.events[k].approach(), speed, 1e-12);
        }
    }
}

TEST(SceneMotion, APistonIsElasticForBodiesAtRestThatTouch)
{
    // Before the impact their energy is zero; after it, it is the work of the piston, to rounding.
    for (int k = 0; k < 100; ++k) {
        const double speed = 0.5 + 0.015 * k;
        Scene scene;
        const MaterialId steel = scene.material({.restitution = 1, .friction = 0.5});
        scene.wall({.normal = {0, 1}, .material = steel, .motion = ConstantVelocity{{0, speed}}});
        for (const double x : {-0.5, 0.5}) {
            scene.disc({.at = {x, 2}, .radius = 0.5, .mass = 1 + 0.03 * k + x, .material = steel});
        }
        const SceneRun run = simulate(scene, {.t_end = 3.2});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        for (const BodyState& body : run.bodies) {
            EXPECT_NEAR(body.velocity[1], 2 * speed, 1e-12) << k;
        }
    }
}

TEST(SceneMotion, ASleeperWakesWhenAWallComes)
{
    // The wall stands at 0 until 1 s, then goes 3 m/s; the disc's edge is at 1.
    const PiecewiseLinear motion{{1, 2}, {{0, 0}, {3, 0}}};
    Scene scene({.gravity = {0, -g}});
    scene.wall({.normal = {0, 1}});
    scene.wall({.normal = {1, 0}, .motion = motion});
    scene.disc({.at = {1.5, 0.5}, .radius = 0.5});
    const SceneRun run = simulate(scene, {.t_end = 3, .sample_times = {1}});
    EXPECT_TRUE(run.samples[0][0].asleep);
    ASSERT_GE(run.events.size(), 1u);
    EXPECT_DOUBLE_EQ(run.events[0].t, 4.0 / 3);
    EXPECT_DOUBLE_EQ(run.bodies[0].velocity[0], 6);
    EXPECT_FALSE(run.bodies[0].asleep);
}

TEST(SceneMotion, WhatTouchesAWallIsStruckWhenTheWallJumps)
{
    // At rest beside a wall without gravity, until the wall moves at 2 m/s: elastic, it leaves at
    // 4.
    Scene scene;
    scene.wall({.normal = {1, 0}, .motion = PiecewiseLinear{{1, 2}, {{0, 0}, {2, 0}}}});
    scene.disc({.at = {0.5, 0}, .radius = 0.5});
    const SceneRun run = simulate(scene, {.t_end = 2});
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_DOUBLE_EQ(run.events[0].t, 1);
    EXPECT_EQ(run.bodies[0].velocity, (Vector2{4, 0}));
}

TEST(SceneMotion, ABoxThatMovesKeepsItsDiscs)
{
    // Closed terrain that is shaken in both directions, with its corners; runs of the box with
    // permuted labels have the same bits.
    const Oscillation shaken{.amplitude = {0.2, 0.1}, .frequency = 1.5};
    const auto box = [&](const std::vector<std::size_t>& order) {
        Scene scene({.gravity = {0, -g}});
        scene.terrain(
            {.points = {{-1, 0}, {1, 0}, {1, 2}, {-1, 2}}, .closed = true, .motion = shaken});
        for (const std::size_t i : order) {
            const auto k = static_cast<double>(i);
            scene.disc(
                {.at = {-0.75 + 0.3 * k, 1 + 0.05 * k}, .velocity = {1 - k, 0.5}, .radius = 0.1});
        }
        return scene;
    };
    const std::vector<std::size_t> order{3, 0, 5, 1, 4, 2};
    std::vector<double> times(301);
    for (std::size_t k = 0; k < times.size(); ++k) times[k] = 0.01 * static_cast<double>(k);
    const SceneOptions options{.t_end = 3, .sample_times = times};
    const SceneRun run = simulate(box({0, 1, 2, 3, 4, 5}), options);
    const SceneRun turned = simulate(box(order), options);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_GT(run.events.size(), 50u);
    for (std::size_t k = 0; k < times.size(); ++k) {
        const Vector2 moved = displacement(shaken, times[k]);
        for (std::size_t i = 0; i < 6; ++i) {
            const Vector2 p = run.samples[k][i].at;
            EXPECT_LE(std::fabs(p[0] - moved[0]), 0.9 + 1e-14);
            EXPECT_LE(std::fabs(p[1] - moved[1] - 1), 0.9 + 1e-14);
        }
    }
    for (std::size_t k = 0; k < 6; ++k) {
        EXPECT_EQ(turned.bodies[k].at, run.bodies[order[k]].at);
        EXPECT_EQ(turned.bodies[k].velocity, run.bodies[order[k]].velocity);
    }
}

TEST(SceneMotion, DragMeetsAMovingFloorOnTheMethodsMap)
{
    // Against the same ball with a drag of 1e-12, whose flight is a parabola to that.
    const Oscillation table{.amplitude = {0, 0.05}, .frequency = 3};
    Scene scene({.gravity = {0, -g}});
    scene.wall({.normal = {0, 1}, .motion = table});
    scene.disc({.at = {0, 1.1}, .radius = 0.1, .drag = 1e-12});
    const SceneRun run = simulate(scene, {.t_end = 3, .rtol = 1e-12, .atol = 1e-12});
    const std::vector<double> expected = impact_times(table, 1, 5);
    ASSERT_GE(run.events.size(), 5u);
    for (std::size_t k = 0; k < 5; ++k) {
        EXPECT_NEAR(run.events[k].t, expected[k], 1e-12 * std::pow(10, k)) << k;
    }
}

TEST(SceneMotion, ACornerOfTerrainThatMovesIsStruckOnce)
{
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> uniform(0.2, 1);
    for (int k = 0; k < 200; ++k) {
        Scene scene;
        scene.terrain({.points = {{-uniform(random), -uniform(random)},
                                  {0.1 * uniform(random), uniform(random)},
                                  {uniform(random), -uniform(random)}},
                       .closed = true,
                       .motion = ConstantVelocity{{0.01 * uniform(random), 0}}});
        scene.disc({.at = {0.06, 2}, .velocity = {0, -uniform(random)}, .radius = 0.5});
        const SceneRun run = simulate(scene, {.t_end = 20});
        ASSERT_EQ(run.events.size(), 1u) << k;
        EXPECT_EQ(run.statistics.impacts, 1u);
    }
}

TEST(SceneMotion, FrictionOnATableThatMovesSidewaysTakesOfTheSlip)
{
    // Falls with 1 m/s onto a table that goes 2 m/s sideways: the impulse of 2 m with friction 0.1
    // gives 0.2 m/s along, less than the slip.
    Scene scene;
    const MaterialId material = scene.material({.friction = 0.1});
    scene.wall({.normal = {0, 1}, .material = material, .motion = ConstantVelocity{{2, 0}}});
    scene.disc({.at = {0, 2}, .velocity = {0, -1}, .material = material});
    const SceneRun run = simulate(scene, {.t_end = 2});
    EXPECT_NEAR(run.bodies[0].velocity[0], 0.2, 1e-15);
    EXPECT_EQ(run.bodies[0].velocity[1], 1);
}

TEST(SceneMotion, LastingContactWithWhatMovesIsNamedWhereItIsNotFollowed)
{
    const SceneRun run = simulate(ball_above(Oscillation{{0, 0.05}, 1}, 0.5), {.t_end = 10});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_EQ(run.message,
              "ball presses on table: lasting contact is not followed without "
              "SceneOptions::contacts");
}

SurfaceMotion given(double acceleration, double speed, double reach, double factor = 1)
{
    return GivenMotion{.displacement =
                           [](double t) {
                               return Vector2{0, 0.05 * std::sin(20 * t)};
                           },
                       .velocity =
                           [=](double t) {
                               return Vector2{0, factor * std::cos(20 * t)};
                           },
                       .acceleration_bound = acceleration,
                       .speed_bound = speed,
                       .reach = reach};
}

TEST(SceneMotion, ABoundThatLiesIsNamed)
{
    const double infinite = std::numeric_limits<double>::infinity();
    const auto run = [](const SurfaceMotion& motion) {
        return simulate(ball_above(motion), {.t_end = 3});
    };
    EXPECT_EQ(run(given(20, infinite, infinite)).outcome, Outcome::reached_end);
    EXPECT_EQ(run(given(20, 1, 0.05)).outcome, Outcome::reached_end);
    EXPECT_EQ(run(given(2, infinite, infinite)).outcome, Outcome::wrong_bound);
    EXPECT_EQ(run(given(20, infinite, infinite, 2)).outcome, Outcome::wrong_bound);
    const SceneRun fast = run(given(20, 0.5, infinite));
    EXPECT_EQ(fast.outcome, Outcome::wrong_bound);
    EXPECT_EQ(fast.message,
              "the motion of table moves at 1 m/s, and its speed_bound is declared as 0.5 m/s, at "
              "t = 0 s");
}

TEST(SceneMotion, WhatIsNoMotionIsRefusedInASentence)
{
    const auto wall = [](const SurfaceMotion& motion) {
        return refusal([&] { static_cast<void>(ball_above(motion)); });
    };
    EXPECT_EQ(wall(Oscillation{{0, nan}}),
              "Scene: motion of table: amplitude must be finite, got nan");
    EXPECT_EQ(wall(Oscillation{{0, 1}, 0}),
              "Scene: motion of table: frequency must be positive and finite, got 0");
    EXPECT_EQ(
        wall(PiecewiseLinear{{1, 1}, {{0, 0}, {0, 1}}}),
        "Scene: motion of table: a time must be finite and above the one before it, 1, got 1");
    EXPECT_EQ(wall(PiecewiseLinear{{1}, {}}),
              "Scene: motion of table: expected as many displacements as times, and one at least, "
              "got 0 and 1");
    EXPECT_EQ(
        wall(given(nan, 1, 1)),
        "Scene: motion of table: acceleration_bound must be zero or positive, and finite, got nan");
    EXPECT_EQ(wall(GivenMotion{}),
              "Scene: motion of table: a displacement and a velocity are expected");
    const GivenMotion nowhere{.displacement =
                                  [](double) {
                                      return Vector2{0, nan};
                                  },
                              .velocity = [](double) { return Vector2{}; },
                              .acceleration_bound = 0};
    EXPECT_EQ(refusal([&] { static_cast<void>(simulate(ball_above(nowhere), {.t_end = 1})); }),
              "Scene: the motion of table is (0, nan) at t = 0, which is not finite");
    Scene scene;
    scene.terrain({.name = "slide", .points = {{0, 0}, {1, 0}}, .motion = Oscillation{}});
    scene.point({.at = {0, 1}});
    EXPECT_EQ(refusal([&] { scene.check(); }),
              "Scene: slide is terrain that moves, which discs alone can meet, and there is a "
              "point");
    EXPECT_EQ(refusal([&] {
                  static_cast<void>(simulate(ball_above(Oscillation{{0, 1}, 1e13}), {.t_end = 1}));
              }),
              "simulate: motion of table: at most 1e12 periods from time 0 to 1 s can be resolved, "
              "and a frequency of 1e+13 Hz gives 1e+13");
    // The position at the start matters.
    EXPECT_NE(refusal([&] {
                  ball_above(ConstantVelocity{{0, 1}}).check(2);
              }).find("lies behind"),
              std::string::npos);
}

TEST(SceneMotion, AFileSaysHowASurfaceMoves)
{
    const auto with = [](const std::string& motion) {
        return R"({"gravity": [0, -9.81],
            "walls": [{"point": [0, 0], "normal": [0, 1], "motion": )" +
               motion + R"(}], "bodies": [{"disc": {"radius": 0.1}, "at": [0, 1.1]}]})";
    };
    const auto events = [](const Scene& scene) {
        std::vector<double> times;
        for (const auto& event : simulate(scene, {.t_end = 2}).events) times.push_back(event.t);
        return times;
    };
    const auto same = [&](const std::string& text, const SurfaceMotion& motion) {
        EXPECT_EQ(events(read_scene(with(text)).scene), events(ball_above(motion))) << text;
    };
    same(R"({"amplitude": [0, 0.05], "frequency": 3, "phase": 0.2})",
         Oscillation{{0, 0.05}, 3, 0.2});
    same(R"({"velocity": [0, -0.5], "since": 1})", ConstantVelocity{{0, -0.5}, 1});
    same(R"({"times": [0, 1, 3], "displacements": [[0, 0], [0, 0.3], [0, 0]]})",
         PiecewiseLinear{{0, 1, 3}, {{0, 0}, {0, 0.3}, {0, 0}}});
    const auto refused = [&](const std::string& text) {
        try {
            static_cast<void>(read_scene(with(text)));
        } catch (const SceneFileError& error) {
            return std::string(error.what());
        }
        return std::string("accepted");
    };
    EXPECT_EQ(refused(R"({"amplitude": [0, 1], "frequncy": 3})"),
              "scene:2: unknown key \"frequncy\" in a motion, the nearest known is \"frequency\"");
    EXPECT_EQ(
        refused(R"({"times": [0]})"),
        "scene:2: expected \"amplitude\", \"velocity\", or \"times\" and \"displacements\" in "
        "a motion");
    EXPECT_EQ(refused(R"({"amplitude": [0, 1], "frequency": -1})"),
              "scene:2: Scene: motion of a wall: frequency must be positive and finite, got -1");
}

}  // namespace
}  // namespace ricochet::motion_test
