// Discs that turn.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "gas.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::turning_test {

namespace {

/// A solid disc of mass 2 and radius 0.5 that falls on a floor at 3 m/s, with the velocity u along
/// it and a spin.
SceneRun thrown(double u, double spin, double restitution, double friction)
{
    Scene scene;
    const auto rubber = scene.material({.restitution = restitution, .friction = friction});
    scene.wall({.normal = {0, 1}, .material = rubber});
    scene.disc({.at = {0, 3.5},
                .velocity = {u, -3},
                .radius = 0.5,
                .mass = 2,
                .material = rubber,
                .inertia = 0.25,
                .spin = spin});
    return simulate(scene, {.t_end = 1.5});
}

}  // namespace

TEST(TurningDiscs, GripOrSlipAsCoulombsLawSays)
{
    // The edge moves along the floor with s = u + r w (counterclockwise spin carries the lowest
    // point along +x). An impulse J across changes it by J (1/m + r^2/I) = 1.5 J; friction takes
    // all of it, J = -s / 1.5, or as much as mu (1 + e) m v = mu * 9.
    struct Case {
        double u, spin, friction;
    };
    for (const Case& c :
         {Case{1, 2, 1}, Case{5, 2, 0.1}, Case{-5, 2, 0.1}, Case{0, 20, 0.2}, Case{-1, 2, 1}}) {
        const SceneRun run = thrown(c.u, c.spin, 0.5, c.friction);
        ASSERT_EQ(run.events.size(), 1U);
        const double s = c.u + 0.5 * c.spin;
        const double most = c.friction * 9;
        const double across = std::clamp(-s / 1.5, -most, most);
        EXPECT_NEAR(run.bodies[0].velocity[0], c.u + across / 2, 1e-14);
        EXPECT_NEAR(run.bodies[0].velocity[1], 1.5, 1e-14);
        ASSERT_EQ(run.turns.size(), 1U);
        EXPECT_NEAR(run.turns[0].spin, c.spin + 0.5 * across / 0.25, 1e-14);
        EXPECT_NEAR(run.turns[0].angle, c.spin * 1 + run.turns[0].spin * 0.5, 1e-14);
    }
}

TEST(TurningDiscs, MomentumAboutThePlaneIsKeptAndEnergyIsNotGained)
{
    // In a collision of free discs the sum of m x v + I w about the origin is kept, to rounding.
    Scene scene;
    const auto rough = scene.material({.restitution = 0.8, .friction = 0.4});
    scene.disc({.at = {0, 0},
                .velocity = {1, 0.2},
                .radius = 0.5,
                .mass = 1,
                .material = rough,
                .inertia = 0.1,
                .spin = 3});
    scene.disc({.at = {3, 0.4},
                .velocity = {-1, 0},
                .radius = 0.7,
                .mass = 3,
                .material = rough,
                .inertia = 0.6,
                .spin = -5});
    const auto moment = [&](const std::vector<BodyState>& bodies,
                            const std::vector<BodyTurn>& turns) {
        double sum = 0;
        for (std::size_t i = 0; i < 2; ++i) {
            const auto& [at, v, asleep, winding] = bodies[i];
            const Disc& disc = scene.bodies()[i];
            sum += disc.mass * (at[0] * v[1] - at[1] * v[0]) + disc.inertia * turns[i].spin;
        }
        return sum;
    };
    const SceneRun before = simulate(scene, {.t_end = 0.1});
    const SceneRun after = simulate(scene, {.t_end = 2});
    ASSERT_EQ(after.events.size(), 1U);
    EXPECT_NE(after.turns[0].spin, 3);
    EXPECT_NEAR(moment(after.bodies, after.turns), moment(before.bodies, before.turns), 1e-14);
    EXPECT_LT(energy(scene, after.bodies, after.turns), energy(scene, before.bodies, before.turns));
}

TEST(TurningDiscs, ASlippingDiscBeginsToRoll)
{
    // A solid disc laid on a floor at 3 m/s without spin: it slips until v = 2/3 of that, after
    // v0 / (3 mu g), and then rolls for ever.
    Scene scene({.gravity = {0, -10}});
    const auto felt = scene.material({.restitution = 0, .friction = 0.2});
    scene.wall({.normal = {0, 1}, .material = felt});
    scene.disc({.at = {0, 0.5},
                .velocity = {3, 0},
                .radius = 0.5,
                .mass = 2,
                .material = felt,
                .inertia = 0.25});
    const SceneRun run = simulate(scene, {.t_end = 2, .sample_times = {0.25, 0.5}});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_NEAR(run.samples[0][0].velocity[0], 2.5, 1e-14);
    EXPECT_NEAR(run.sample_turns[0][0].spin, -0.5 * 2 * 2 / 0.25 * 0.25, 1e-14);
    EXPECT_NEAR(run.samples[1][0].velocity[0], 2, 1e-14);
    EXPECT_NEAR(run.bodies[0].velocity[0], 2, 1e-14);
    EXPECT_NEAR(run.turns[0].spin, -4, 1e-13);
    EXPECT_NEAR(run.bodies[0].at[0], 3 * 0.5 - 0.25 + 2 * 1.5, 1e-13);
    EXPECT_NEAR(run.turns[0].angle, -0.5 * 8 * 0.25 - 4 * 1.5, 1e-13);
    EXPECT_FALSE(run.bodies[0].asleep);
}

TEST(TurningDiscs, ADiscRollsDownAnInclineOrSlips)
{
    // Of a slope with sin = 0.6 and cos = 0.8: it rolls with 2/3 of g sin while mu >= tan / 3 =
    // 0.25; at mu = 0.1 it slips with g (sin - mu cos), and turns with 2 mu g cos / r.
    for (const double mu : {0.3, 0.1}) {
        Scene scene({.gravity = {0, -10}});
        const auto wood = scene.material({.restitution = 0, .friction = mu});
        scene.wall({.normal = {0.6, 0.8}, .material = wood});
        scene.disc({.at = {0.3, 0.4}, .radius = 0.5, .mass = 2, .material = wood, .inertia = 0.25});
        const SceneRun run = simulate(scene, {.t_end = 2});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        const double rate = mu > 0.25 ? 4 : 6 - 8 * mu;
        const double turning = mu > 0.25 ? rate / 0.5 : 2 * mu * 8 / 0.5;
        EXPECT_NEAR(std::hypot(run.bodies[0].velocity[0], run.bodies[0].velocity[1]), 2 * rate,
                    1e-13);
        EXPECT_NEAR(run.turns[0].spin, -2 * turning, 1e-13);
        EXPECT_NEAR(run.turns[0].angle, -2 * turning, 1e-13);
        EXPECT_NEAR(run.bodies[0].at[0] - 0.3, 2 * rate * 0.8, 1e-13);
    }
}

TEST(TurningDiscs, WithoutFrictionTheSpinChangesNothing)
{
    const Scene plain = test::gas({.count = 30, .restitution = 1});
    Scene turning;
    for (const Scene::Surface& wall : plain.surfaces()) {
        turning.wall({.point = wall.points[0], .normal = wall.normal});
    }
    for (Disc disc : plain.bodies()) {
        disc.material = {};
        disc.inertia = 1;
        disc.spin = 5;
        turning.disc(disc);
    }
    const SceneRun one = simulate(plain, {.t_end = 1});
    const SceneRun two = simulate(turning, {.t_end = 1});
    ASSERT_EQ(one.events.size(), two.events.size());
    for (std::size_t k = 0; k < one.events.size(); ++k) {
        ASSERT_EQ(one.events[k].t, two.events[k].t);
        ASSERT_EQ(one.events[k].after, two.events[k].after);
    }
    EXPECT_EQ(two.turns[0].spin, 5);
    EXPECT_NEAR(two.turns[0].angle, 5, 1e-15);
}

TEST(TurningDiscs, ARoughGasKeepsItsEnergyOrLosesIt)
{
    // Without loss along the normal, friction takes energy across, and never gives any.
    Scene scene;
    const auto rough = scene.material({.restitution = 1, .friction = 0.5});
    const Scene like = test::gas({.count = 40});
    for (const Scene::Surface& wall : like.surfaces()) {
        scene.wall({.point = wall.points[0], .normal = wall.normal, .material = rough});
    }
    for (Disc disc : like.bodies()) {
        disc.material = rough;
        disc.inertia = 0.5 * disc.radius * disc.radius;
        scene.disc(disc);
    }
    std::vector<double> times;
    for (int k = 0; k <= 20; ++k) times.push_back(0.1 * k);
    const SceneRun run = simulate(scene, {.t_end = 2, .sample_times = times});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    double last = 1e9;
    for (std::size_t k = 0; k < run.samples.size(); ++k) {
        const double now = energy(scene, run.samples[k], run.sample_turns[k]);
        EXPECT_LE(now, last * (1 + 1e-13));
        last = now;
    }
    EXPECT_LT(last, 0.9 * energy(scene, run.samples[0], run.sample_turns[0]));
}

TEST(TurningDiscs, LastingContactOfThemIsNotFollowed)
{
    Scene scene({.gravity = {0, -10}});
    const auto clay = scene.material({.restitution = 0, .friction = 0.5});
    scene.wall({.normal = {0, 1}, .material = clay});
    for (const double y : {0.5, 1.5}) {
        scene.disc({.at = {0, y}, .radius = 0.5, .material = clay, .inertia = 0.1});
    }
    const SceneRun run = simulate(scene, {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::zeno);
}

TEST(TurningDiscs, FilesHaveThem)
{
    const SceneFile file = read_scene(R"({"bodies": [
        {"disc": {"radius": 2, "mass": 3, "inertia": "solid"}, "at": [0, 0], "angle": 1, "spin": 4},
        {"disc": {"radius": 2, "mass": 3, "inertia": "ring"}, "at": [9, 0]},
        {"disc": {"inertia": 0.25}, "at": [20, 0]}]})");
    EXPECT_EQ(file.scene.bodies()[0].inertia, 6);
    EXPECT_EQ(file.scene.bodies()[0].spin, 4);
    EXPECT_EQ(file.scene.bodies()[0].angle, 1);
    EXPECT_EQ(file.scene.bodies()[1].inertia, 12);
    EXPECT_EQ(file.scene.bodies()[2].inertia, 0.25);
    const auto message = [](const std::string& body) {
        try {
            static_cast<void>(read_scene("{\"bodies\": [" + body + "]}", "s.json"));
        } catch (const SceneFileError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(
        message(R"({"disc": {"inertia": "hollow"}, "at": [0, 0]})"),
        "s.json:1: expected a number, \"solid\" or \"ring\" for \"inertia\", found \"hollow\"");
    EXPECT_EQ(message(R"({"point": {}, "at": [0, 0], "spin": 1})"),
              "s.json:1: a point has no angle and no spin");
    EXPECT_EQ(message(R"({"disc": {}, "at": [0, 0], "spin": 1})"),
              "s.json:1: Scene: body 0: has a spin of 1 rad/s and no inertia");
}

}  // namespace ricochet::turning_test
