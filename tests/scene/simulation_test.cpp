// Scenes that are advanced from outside: the motion of `simulate`, wherever they stop on their way.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "ricochet/scene/simulate.hpp"

namespace ricochet::simulation_test {
namespace {

class ExampleScenes : public testing::TestWithParam<std::pair<const char*, double>> {};
INSTANTIATE_TEST_SUITE_P(SceneSimulation, ExampleScenes,
                         testing::Values(std::pair{"billiard", 2.0}, std::pair{"bin", 0.6},
                                         std::pair{"chain", 0.4}, std::pair{"cradle", 3.0},
                                         std::pair{"galton", 0.5}, std::pair{"gas", 0.1},
                                         std::pair{"shaker", 0.3}, std::pair{"sleepers", 1.0},
                                         std::pair{"stadium", 9.0}, std::pair{"terrain", 4.0},
                                         std::pair{"torus", 0.2}),
                         [](const auto& of) { return std::string(of.param.first); });

TEST_P(ExampleScenes, AdvanceWithTheBitsOfAWholeRun)
{
    const auto& [name, t_end] = GetParam();
    SceneFile file = load_scene(
        (std::filesystem::path(RICOCHET_SCENES) / (std::string(name) + ".json")).string());
    SceneOptions options = file.options;
    options.t_end = 1.3 * t_end;
    options.contacts = scene_contacts();
    options.sample_times.clear();
    for (int k = 0; k <= 20; ++k) options.sample_times.push_back(t_end * k / 20);
    const SceneRun whole = simulate(file.scene, options);
    options.sample_times.clear();
    std::vector<double> expected;
    for (const SceneEvent& event : whole.events) {
        if (event.t <= t_end) expected.push_back(event.t);
    }
    for (const int part : {1, 3}) {  // of the samples, stops on the way
        SceneSimulation simulation(file.scene, options);
        std::vector<double> times;
        for (std::size_t k = 0; k < whole.samples.size(); ++k) {
            const double to = whole.sample_times[k];
            for (int stop = 1; stop <= part; ++stop) {
                const double on_the_way =
                    stop == part ? to : to - (part - stop) * 0.3 / 20 * t_end / part;
                while (simulation.advance(on_the_way)) {
                    for (const SceneEvent& event : simulation.events()) {
                        EXPECT_EQ(event.t, simulation.t());
                        times.push_back(event.t);
                    }
                }
            }
            ASSERT_EQ(simulation.t(), to) << simulation.run().message;
            const SceneRun now = simulation.run();
            ASSERT_EQ(now.bodies.size(), whole.samples[k].size());
            for (std::size_t i = 0; i < now.bodies.size(); ++i) {
                ASSERT_EQ(now.bodies[i].at, whole.samples[k][i].at) << k << ' ' << i;
                ASSERT_EQ(now.bodies[i].velocity, whole.samples[k][i].velocity) << k << ' ' << i;
            }
            for (std::size_t i = 0; i < now.turns.size(); ++i) {
                ASSERT_EQ(now.turns[i].angle, whole.sample_turns[k][i].angle) << k << ' ' << i;
            }
        }
        EXPECT_EQ(times, expected);
        EXPECT_FALSE(simulation.ended());
        while (!simulation.ended()) (void)simulation.advance(2 * t_end);
        EXPECT_EQ(simulation.run().statistics.events, whole.statistics.events);
    }
}

/// A ball above a floor.
Scene lone_ball(double restitution)
{
    Scene scene({.gravity = {0, -9.81}});
    const MaterialId material = scene.material({.restitution = restitution});
    scene.wall({.normal = {0, 1}, .material = material});
    scene.disc({.name = "ball", .at = {0, 11}, .radius = 1, .material = material});
    return scene;
}

TEST(SceneSimulation, StopsAtEachBounceOfALoneBall)
{
    SceneSimulation simulation(lone_ball(0.5), {.t_end = 1e6});
    const double first = std::sqrt(2 * 10 / 9.81);
    double flight = first, t = first;
    for (int n = 0; n < 20; ++n) {
        ASSERT_TRUE(simulation.advance(5));
        // The first fall, and two halves of it for each height that is a quarter of the last.
        EXPECT_NEAR(simulation.t(), t, 4e-15) << n;
        EXPECT_EQ(simulation.events().size(), 1U);
        t += flight;
        flight /= 2;
    }
    while (simulation.advance(5)) {
    }
    EXPECT_EQ(simulation.t(), 5);
    EXPECT_TRUE(simulation.run().bodies[0].asleep);
    // To the rounding of heights of 11 m.
    EXPECT_NEAR(simulation.run().bodies[0].at[1], 1, 4e-15);
    // A time that has passed changes nothing.
    EXPECT_FALSE(simulation.advance(1));
    EXPECT_EQ(simulation.t(), 5);
}

TEST(SceneSimulation, OfABodyWithDragThatMeetsNothingGoesNoFartherThanAsked)
{
    Scene scene({.gravity = {0, -1}});
    scene.disc({.velocity = {1, 0}, .drag = 1});
    SceneSimulation simulation(scene, {.t_end = 1e9, .rtol = 1e-12, .atol = 1e-12});
    EXPECT_FALSE(simulation.advance(2));
    EXPECT_EQ(simulation.t(), 2);
    EXPECT_NEAR(simulation.run().bodies[0].at[0], 1 - std::exp(-2), 1e-10);
    EXPECT_LT(simulation.run().statistics.steps, 1000U);
}

TEST(SceneSimulation, OfShortStepsGoesOnWhereverTheEndIs)
{
    // A spring of 1e4 periods a second: steps of microseconds, 1e-8 of the whole run and less.
    Scene scene;
    const BodyId a = scene.disc({.at = {0, 0}, .radius = 0.1});
    const BodyId b = scene.disc({.at = {1.01, 0}, .radius = 0.1});
    scene.spring({.between = {a, b}, .rest = 1, .stiffness = 2e9});
    SceneSimulation simulation(scene, {.t_end = 1e9});
    EXPECT_FALSE(simulation.advance(0.01));
    EXPECT_EQ(simulation.t(), 0.01) << simulation.run().message;
    EXPECT_GT(simulation.run().statistics.steps, 2000U);
}

TEST(SceneSimulation, EndsAtItsEndOrWithTheReasonForWhichItCannotGoOn)
{
    SceneSimulation simulation(lone_ball(0.5), {.t_end = 2});
    while (simulation.advance(3)) {
    }
    EXPECT_EQ(simulation.t(), 2);
    EXPECT_TRUE(simulation.ended());
    EXPECT_EQ(simulation.run().outcome, Outcome::reached_end);

    Scene scene = lone_ball(0);
    scene.disc({.at = {0, 14}, .radius = 1});
    SceneSimulation broken(scene, {.t_end = 1e3});  // without contacts
    while (broken.advance(1e3)) {
    }
    EXPECT_TRUE(broken.ended());
    EXPECT_LT(broken.t(), 10);
    const SceneRun run = broken.run();
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_EQ(run.t, broken.t());
    EXPECT_FALSE(run.message.empty());
    EXPECT_EQ(run.involved.size(), 2U);
    EXPECT_FALSE(broken.advance(1e3));
}

TEST(SceneSimulation, OutlivesTheSceneAndCanBeMoved)
{
    std::vector<SceneSimulation> many;
    for (int k = 0; k < 3; ++k) many.emplace_back(lone_ball(0.5), SceneOptions{.t_end = 10});
    SceneSimulation moved = std::move(many[1]);
    many.clear();
    EXPECT_TRUE(moved.advance(2));
    EXPECT_FALSE(SceneSimulation(Scene(), {.t_end = 1}).advance(1));
}

TEST(SceneSimulation, RefusesSampleTimes)
{
    EXPECT_THROW(SceneSimulation(lone_ball(0.5), {.t_end = 1, .sample_times = {0.5}}),
                 std::invalid_argument);
    EXPECT_THROW(SceneSimulation(lone_ball(0.5), {}), std::invalid_argument);
}

TEST(SceneSetters, ChangeWhatHasBeenAddedAndRefuseWhatCouldNotHaveBeen)
{
    Scene scene = lone_ball(0.5);
    scene.set_gravity({0, -2});
    scene.set_start(BodyId{0}, {3, 2}, {1, 0});
    scene.set_coefficients(MaterialId{1}, 0.25, 0);
    SceneSimulation simulation(scene, {.t_end = 10});
    ASSERT_TRUE(simulation.advance(10));
    EXPECT_DOUBLE_EQ(simulation.t(), 1);  // 1 m at 2 m/s^2
    EXPECT_EQ(simulation.events()[0].after[0], (Vector2{1, 0.5}));

    const auto message = [&](auto change) -> std::string {
        try {
            change();
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return {};
    };
    EXPECT_NE(message([&] {
                  scene.set_start(BodyId{0}, {0, 0}, {});
              }).find("ball"),
              std::string::npos);
    EXPECT_NE(message([&] {
                  scene.set_start(BodyId{7}, {0, 3}, {});
              }).find('7'),
              std::string::npos);
    EXPECT_NE(message([&] { scene.set_gravity({NAN, 0}); }).find("gravity"), std::string::npos);
    EXPECT_NE(message([&] { scene.set_coefficients(MaterialId{1}, 1.5, 0); }).find("1.5"),
              std::string::npos);
    EXPECT_NE(message([&] { scene.set_coefficients(MaterialId{9}, 1, 0); }).find('9'),
              std::string::npos);
    EXPECT_EQ(scene.bodies()[0].at, (Vector2{3, 2}));
}

}  // namespace
}  // namespace ricochet::simulation_test
