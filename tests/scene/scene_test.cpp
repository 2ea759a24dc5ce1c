// Two discs in a box, in C++ and as JSON; rest and sliding; refusals.
#include "ricochet/scene/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>

#include "refusal.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::scene_test {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

void add_box(Scene& scene, double side, MaterialId material = {})
{
    scene.wall({.name = "floor", .point = {0, 0}, .normal = {0, 1}, .material = material});
    scene.wall({.name = "left", .point = {0, 0}, .normal = {1, 0}, .material = material});
    scene.wall({.name = "ceiling", .point = {0, side}, .normal = {0, -1}, .material = material});
    scene.wall({.name = "right", .point = {side, 0}, .normal = {-1, 0}, .material = material});
}

TEST(Scene, TwoDiscsOnALineMeetAndStrikeTheWalls)
{
    // Centres at 1 and 3, radii 1/4: the gap of 1.5 closes at speed 2 in 0.75 s; equal masses
    // exchange velocities, and each goes back to its wall, 0.75 + 0.75 s away at speed 1 and 1.
    Scene scene;
    add_box(scene, 4);
    const BodyId a = scene.disc({.name = "a", .at = {1, 2}, .velocity = {1, 0}, .radius = 0.25});
    const BodyId b = scene.disc({.name = "b", .at = {3, 2}, .velocity = {-1, 0}, .radius = 0.25});
    const SceneRun run = simulate(scene, {.t_end = 3});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 3u);
    EXPECT_DOUBLE_EQ(run.events[0].t, 0.75);
    EXPECT_EQ(run.events[0].body, a.index);
    EXPECT_EQ(run.events[0].other, (Partner{false, b.index}));
    EXPECT_EQ(run.events[0].impulse, (Vector2{-2, 0}));
    EXPECT_EQ(run.events[0].before[0], (Vector2{1, 0}));
    EXPECT_EQ(run.events[0].after[0], (Vector2{-1, 0}));
    EXPECT_EQ(run.events[0].after[1], (Vector2{1, 0}));
    EXPECT_DOUBLE_EQ(run.events[1].t, 2.25);
    EXPECT_DOUBLE_EQ(run.events[2].t, 2.25);
    EXPECT_TRUE(run.events[1].other.is_surface);
    EXPECT_DOUBLE_EQ(run.bodies[a.index].at[0], 1);
    EXPECT_DOUBLE_EQ(run.bodies[b.index].at[0], 3);
}

TEST(Scene, AFileIsTheSceneThatItDescribes)
{
    const std::string text = R"({
        "gravity": [0, -9.81],
        "materials": {"steel": {"restitution": 0.9, "friction": 0.2}},
        "walls": [{"name": "floor", "point": [0, 0], "normal": [0, 2], "material": "steel"}],
        "bodies": [{"name": "a", "disc": {"radius": 0.1, "mass": 2}, "at": [0, 2],
                    "velocity": [0.5, 0], "material": "steel"},
                   {"name": "drop", "point": {"mass": 1}, "at": [5, 1]},
                   {"name": "row", "grid": [3, 2], "spacing": [1, 1.5], "at": [10, 1],
                    "disc": {"radius": 0.2}}],
        "springs": [{"between": ["a", "drop"], "rest": 0.5, "stiffness": 100, "damping": 0.1}],
        "run": {"t_end": 2, "rtol": 1e-9, "impacts": "together", "sample_times": [0.5, 1]}
    })";
    const SceneFile file = read_scene(text);
    ASSERT_EQ(file.scene.bodies().size(), 8u);
    EXPECT_EQ(file.scene.bodies()[0].mass, 2);
    EXPECT_EQ(file.scene.bodies()[1].radius, 0);
    EXPECT_EQ(file.scene.bodies()[7].name, "row 2 1");
    EXPECT_EQ(file.scene.bodies()[7].at, (Vector2{12, 2.5}));
    EXPECT_EQ(file.scene.surfaces()[0].normal, (Vector2{0, 1}));
    EXPECT_EQ(file.scene.materials()[file.scene.bodies()[0].material.index].friction, 0.2);
    EXPECT_EQ(file.scene.springs()[0].stiffness, 100);
    EXPECT_EQ(file.options.t_end, 2);
    EXPECT_EQ(file.options.impacts, ImpactLaw::together);
    EXPECT_EQ(file.options.sample_times.size(), 2u);
}

/// The message with which `text` is refused.
std::string trouble(const std::string& text)
{
    try {
        static_cast<void>(read_scene(text, "bin.json"));
    } catch (const SceneFileError& error) {
        return error.what();
    }
    return "accepted";
}

TEST(Scene, ErrorsInAFileNameTheLineTheKeyAndWhatWasExpected)
{
    EXPECT_EQ(trouble("{\n\"gravity\": [0, 1],\n\"bodys\": []}"),
              "bin.json:3: unknown key \"bodys\" in a scene, the nearest known is \"bodies\"");
    EXPECT_EQ(trouble("{\"bodies\": [\n{\"disc\": {\"radius\": \"big\"},\n \"at\": [0, 0]}]}"),
              "bin.json:2: expected a number for \"radius\", found \"big\"");
    EXPECT_EQ(trouble("{\"bodies\": [\n\n{\"at\": [0, 0]}]}"),
              "bin.json:3: expected \"disc\" or \"point\" in a body, found neither");
    EXPECT_EQ(trouble("{\"bodies\": [{\"disc\": {\"radius\": 1},\n\"at\": [0]}]}"),
              "bin.json:2: expected two numbers for \"at\", found [0]");
    EXPECT_EQ(trouble("{\"bodies\": [{\"disc\": {\"radius\": 1}}]}"),
              "bin.json:1: expected \"at\" in a body");
    EXPECT_EQ(trouble("{\"materials\": {\"steel\": {}},\n\"walls\": [{\"point\": [0, 0],\n"
                      "\"normal\": [0, 1], \"material\": \"stel\"}]}"),
              "bin.json:3: there is no material \"stel\", the nearest known is \"steel\"");
    EXPECT_EQ(trouble("{\"gravity\": [0, 1],\n \"gravity\": [0, 2]}"),
              "bin.json:2: key \"gravity\" appears twice");
    EXPECT_EQ(trouble("{\"gravity\": [0, 1]\n \"walls\": []}"),
              "bin.json:2: expected JSON, found an error at its byte 27");
    EXPECT_EQ(trouble("{\"gravity\": [0, 1e9],\n\"memory_limit\":\n-1e400}"),
              "bin.json:3: expected JSON, found a number out of range");
    EXPECT_EQ(trouble("{\"bodies\": [{\"disc\": {\"radius\": 1},\n \"at\": [0, 0],\n \"grid\": "
                      "[10000, 10000], \"spacing\": [3, 3]}]}"),
              "bin.json:1: Scene: 1e+08 bodies need about 51.2 GB, and memory_limit allows 4 GB");
    EXPECT_EQ(trouble("{\"bodies\": [{\"name\": \"a\", \"point\": {}, \"at\": [0, 0]}],\n"
                      "\"springs\": [{\"between\": [\"a\", \"b\"]}]}"),
              "bin.json:2: Scene: there is no body \"b\", the nearest known is \"a\"");
    EXPECT_EQ(trouble("{\"bodies\": [{\"disc\": {}, \"at\": [0, 0]},\n"
                      "{\"disc\": {}, \"at\": [1.5, 0]}]}"),
              "bin.json:2: Scene: body 0 and body 1 overlap by 0.5 at the start");
    EXPECT_EQ(trouble("{\"bodies\": [{\"disc\": {}, \"at\": [0, 0], \"grid\": [2, 1], \"spacing\": "
                      "[3, 3]},\n{\"disc\": {},\n\"at\": [4.5, 0]}]}"),
              "bin.json:2: Scene: body 1 and body 2 overlap by 0.5 at the start");
    EXPECT_EQ(trouble(std::string(100000, '[')),
              "bin.json:1: expected at most 8 levels of JSON, found more");
}

TEST(Scene, WrongValuesAreRefusedInOneSentence)
{
    Scene scene;
    scene.wall({.name = "floor", .normal = {0, 1}});
    scene.disc({.name = "a", .at = {0, 5}});
    const auto disc = [&](const Disc& d) { return refusal([&] { scene.disc(d); }); };
    EXPECT_EQ(disc({.name = "b", .radius = 0}),
              "Scene: b: radius must be positive and finite, got 0");
    EXPECT_EQ(disc({.name = "b", .at = {0, 9}, .mass = -1}),
              "Scene: b: mass must be positive and finite, got -1");
    EXPECT_EQ(disc({.name = "b", .at = {nan, 9}}), "Scene: b: position must be finite, got nan");
    EXPECT_EQ(disc({.name = "a", .at = {5, 5}}), "Scene: the name \"a\" is given twice");
    EXPECT_EQ(disc({.name = "b", .at = {5, 0.75}}),
              "Scene: b at (5, 0.75) lies behind \"floor\" by 0.25");
    EXPECT_EQ(disc({.name = "b", .at = {5, 5}, .material = {7}}),
              "Scene: the material of b is number 7, and there are 1");
    EXPECT_EQ(refusal([&] { scene.material({.name = "rubber", .restitution = 1.2}); }),
              "Scene: material \"rubber\": restitution must lie in [0, 1], got 1.2");
    EXPECT_EQ(refusal([&] {
                  scene.wall({.normal = {0, 0}});
              }),
              "Scene: the normal of a wall has no length");
    for (const double size : {1e-300, 1e300}) EXPECT_NO_THROW(scene.wall({.normal = {0, size}}));
    // Their squares overflow: such discs flew through walls.
    EXPECT_EQ(disc({.name = "b", .velocity = {0, -1e160}}),
              "Scene: b: velocity must lie in [-1e150, 1e150], got -1e+160");
    EXPECT_EQ(disc({.name = "b", .at = {1e160, 0}}),
              "Scene: b: position must lie in [-1e150, 1e150], got 1e+160");
    scene.disc({.name = "b", .at = {1.5, 5}});
    EXPECT_EQ(refusal([&] { static_cast<void>(simulate(scene, {.t_end = 1})); }),
              "Scene: a and b overlap by 0.5 at the start");
    Scene far;
    far.terrain({.name = "plain", .points = {{-1e19, 0}, {1e19, 0}}});
    far.disc({.name = "a", .at = {0, 3}});
    EXPECT_EQ(refusal([&] { static_cast<void>(simulate(far, {.t_end = 1})); }),
              "Scene: plain is so far away that its coordinates are rounded by 1.8e+04 m, more "
              "than the radius 1 m of a");
    Scene fine;
    EXPECT_EQ(refusal([&] { static_cast<void>(simulate(fine, {})); }),
              "simulate: t_end must be finite and above t_start 0, got nan");
}

TEST(Scene, ABallComesToRestOnTheFloorAndSleepsUntilItIsStruck)
{
    // From 1 m with restitution 1/2 the impacts end at t0 (1 + e) / (1 - e) = 3 sqrt(2 / g).
    Scene scene({.gravity = {0, -10}});
    const MaterialId clay = scene.material({.name = "clay", .restitution = 0.5});
    scene.wall({.name = "floor", .normal = {0, 1}, .material = clay});
    scene.disc({.name = "ball", .at = {0, 1.5}, .radius = 0.5, .material = clay});
    const SceneRun run = simulate(scene, {.t_end = 1e4});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    ASSERT_EQ(run.events.back().kind, SceneEvent::Kind::held);
    EXPECT_NEAR(run.events.back().t, 3 * std::sqrt(0.2), 1e-14);
    EXPECT_TRUE(run.bodies[0].asleep);
    EXPECT_EQ(run.bodies[0].velocity, (Vector2{0, 0}));
    EXPECT_NEAR(run.bodies[0].at[1], 0.5, 1e-15);

    scene.disc(
        {.name = "shot", .at = {-40, 0.5}, .velocity = {4, 0}, .radius = 0.5, .material = clay});
    const SceneRun struck = simulate(scene, {.t_end = 20});
    ASSERT_EQ(struck.outcome, Outcome::reached_end) << struck.message;
    // They meet after 39 / 4 s; with e = 1/2 the shot keeps a quarter of its speed.
    EXPECT_NEAR(struck.events.back().t, 39.0 / 4, 1e-12);
    EXPECT_NEAR(struck.bodies[0].velocity[0], 3, 1e-12);
    EXPECT_NEAR(struck.bodies[1].velocity[0], 1, 1e-12);
    EXPECT_EQ(struck.bodies[0].velocity[1], 0);
}

TEST(Scene, EachBounceOfABallAloneHasItsNumber)
{
    Scene scene({.gravity = {0, -10}});
    const auto rubber = scene.material({.restitution = 0.5});
    scene.wall({.point = {0, 0}, .normal = {0, 1}, .material = rubber});
    scene.disc({.at = {0, 2}, .radius = 0.1, .material = rubber});
    for (const std::uint64_t most : {SceneOptions{}.max_events, std::uint64_t{5}}) {
        const SceneRun run = simulate(scene, {.t_end = 10, .max_events = most});
        for (std::size_t k = 0; k < run.statistics.events; ++k) {
            EXPECT_EQ(run.events[k].number, k);
            EXPECT_EQ(run.events[k].kind, SceneEvent::Kind::impact);
        }
        EXPECT_EQ(run.events.back().number + 1, run.statistics.events);
        EXPECT_EQ(run.outcome, most == 5 ? Outcome::step_limit : Outcome::reached_end);
    }
}

TEST(Scene, EventsOfRestCountTowardsTheLastOne)
{
    Scene scene({.gravity = {0, -10}});
    const auto felt = scene.material({.restitution = 0, .friction = 0.5});
    scene.wall({.point = {0, 0}, .normal = {0, 1}, .material = felt});
    scene.disc({.at = {0, 0.1}, .velocity = {1, 0}, .radius = 0.1, .material = felt});
    const SceneRun all = simulate(scene, {.t_end = 3});
    ASSERT_EQ(all.statistics.events, 1u);
    ASSERT_EQ(all.events.back().kind, SceneEvent::Kind::stopped);
    const SceneRun run = simulate(scene, {.t_end = 3, .max_events = 1});
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    EXPECT_EQ(run.t, all.events.back().t);
}

TEST(Scene, FrictionStopsWhatSlides)
{
    // Speed 3 under friction 0.25 and g = 10: stops after 1.2 s and 1.8 m.
    Scene scene({.gravity = {0, -10}});
    const MaterialId wood = scene.material({.name = "wood", .restitution = 0, .friction = 0.25});
    scene.wall({.normal = {0, 1}, .material = wood});
    scene.disc({.at = {0, 1}, .velocity = {3, 0}, .material = wood});
    const SceneRun run = simulate(scene, {.t_end = 5});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].kind, SceneEvent::Kind::stopped);
    EXPECT_NEAR(run.events[0].t, 1.2, 1e-15);
    EXPECT_NEAR(run.bodies[0].at[0], 1.8, 1e-15);
    EXPECT_TRUE(run.bodies[0].asleep);
}

TEST(Scene, LastingContactOfDiscsEndsTheRunAndNamesThem)
{
    Scene scene({.gravity = {0, -10}});
    scene.wall({.normal = {0, 1}});
    scene.disc({.name = "lower", .at = {0, 1}});
    scene.disc({.name = "upper", .at = {0, 3}});
    const SceneRun run = simulate(scene, {.t_end = 5});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_EQ(run.involved, (std::vector<std::uint32_t>{0, 1}));
    EXPECT_EQ(run.message,
              "lower and upper press on each other: lasting contact is not followed without "
              "SceneOptions::contacts");
    EXPECT_EQ(run.t, 0);
}

TEST(Scene, OverlapsAreFoundAsByATestOfAllPairs)
{
    std::mt19937 random(3);
    int refused = 0;
    for (int k = 0; k < 400; ++k) {
        // Spread along x, along y, or along both.
        const double width = k % 3 == 0 ? 1 : 60;
        const double height = k % 3 == 1 ? 1 : 60;
        Scene scene;
        bool overlap = false;
        for (int i = 0; i < 12; ++i) {
            const auto any = [&](double low, double high) {
                return std::uniform_real_distribution<double>(low, high)(random);
            };
            const Disc disc{.at = {any(0, width), any(0, height)}, .radius = any(0.1, 3)};
            for (const Disc& other : scene.bodies()) {
                const double apart = std::hypot(disc.at[0] - other.at[0], disc.at[1] - other.at[1]);
                overlap = overlap || apart < disc.radius + other.radius;
            }
            scene.disc(disc);
        }
        if (overlap) {
            EXPECT_THROW(scene.check(0), std::invalid_argument) << k;
        } else {
            EXPECT_NO_THROW(scene.check(0)) << k;
        }
        refused += overlap ? 1 : 0;
    }
    EXPECT_GT(refused, 100);
    EXPECT_LT(refused, 390);
}

}  // namespace
}  // namespace ricochet::scene_test
