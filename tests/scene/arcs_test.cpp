// Circles and arcs that do not move.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "ricochet/scene/simulate.hpp"

namespace ricochet::arcs_test {

namespace {

double length(const Vector2& v)
{
    return std::hypot(v[0], v[1]);
}

std::string refusal(const Arc& arc)
{
    Scene scene;
    try {
        scene.arc(arc);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "";
}

}  // namespace

TEST(SceneArcs, ChordsOfACircularBilliardAreEqual)
{
    // A disc of radius r inside a circle of radius R moves as a point in a circle of radius R - r.
    // A path that passes the centre at the distance d has chords of length 2 sqrt((R - r)^2 - d^2).
    // Each impact is a rounding of 1e-16 off; angles, which it changes, do not change the times.
    for (const double radius : {0.0, 0.25}) {
        Scene scene;
        scene.arc({.centre = {3, -2}, .radius = 1.25});
        if (radius > 0) {
            scene.disc({.at = {3.5, -2}, .velocity = {0, 2}, .radius = radius});
        } else {
            scene.point({.at = {3.5, -2}, .velocity = {0, 2}});
        }
        const double half = std::sqrt(std::pow(1.25 - radius, 2) - 0.25) / 2;
        const SceneRun run = simulate(scene, {.t_end = 1000});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        ASSERT_EQ(run.events.size(), static_cast<std::size_t>((1000 / half + 1) / 2));
        for (std::size_t k = 0; k < run.events.size(); ++k) {
            const double exact = (2 * static_cast<double>(k) + 1) * half;
            ASSERT_NEAR(run.events[k].t, exact, 1e-13 * (1 + exact)) << k;
            ASSERT_NEAR(length(run.events[k].after[0]), 2, 1e-13);
        }
    }
}

TEST(SceneArcs, APinIsStruckAsADiscOfGreatMass)
{
    // A disc of 1e30 kg at rest keeps its place: its speed after the impact is 1e-30. The two
    // contacts are found by different functions, each within a few roundings.
    const Disc flying{.at = {-3, 0.2}, .velocity = {1.5, 0.1}, .radius = 0.4, .mass = 1};
    Scene pin;
    pin.arc({.name = "pin", .centre = {0.5, 0.5}, .radius = 0.3});
    pin.disc(flying);
    Scene heavy;
    heavy.disc(flying);
    heavy.disc({.at = {0.5, 0.5}, .radius = 0.3, .mass = 1e30});
    const SceneRun one = simulate(pin, {.t_end = 5});
    const SceneRun two = simulate(heavy, {.t_end = 5});
    ASSERT_EQ(one.events.size(), 1U);
    ASSERT_EQ(two.events.size(), 1U);
    EXPECT_NEAR(one.events[0].t, two.events[0].t, 1e-15);
    for (std::size_t c = 0; c < 2; ++c) {
        EXPECT_NEAR(one.events[0].after[0][c], two.events[0].after[0][c], 1e-14);
        EXPECT_NEAR(one.events[0].at[c], two.events[0].at[c], 1e-15);
        EXPECT_NEAR(one.events[0].normal[c], two.events[0].normal[c], 1e-14);
    }
    EXPECT_TRUE(one.events[0].other.is_surface);
}

TEST(SceneArcs, ADiscThatFallsOnThePeakOfAPinBouncesInPlace)
{
    // From a height h above the pin: impacts at (2 k + 1) sqrt(2 h / g). Sideways the equilibrium
    // is unstable, but at x = 0 every normal is exactly vertical.
    Scene scene({.gravity = {0, -10}});
    scene.arc({.centre = {0, -1}, .radius = 1});
    scene.disc({.at = {0, 5.25}, .radius = 0.25});
    const SceneRun run = simulate(scene, {.t_end = 20});
    ASSERT_EQ(run.events.size(), 10U);
    for (std::size_t k = 0; k < run.events.size(); ++k) {
        EXPECT_NEAR(run.events[k].t, 2 * static_cast<double>(k) + 1, 1e-13 * run.events[k].t);
        EXPECT_EQ(run.events[k].after[0][0], 0);
    }
}

TEST(SceneArcs, ABodyPassesTheGapAndStrikesTheOtherSide)
{
    // The left half of the unit circle, open to the right. A point from the right passes the gap
    // and strikes it from inside at x = -1; a disc of radius r at x = -1 + r. From the left both
    // strike the outside.
    for (const double radius : {0.0, 0.1}) {
        for (const double side : {1.0, -1.0}) {
            Scene scene;
            scene.arc({.centre = {0, 0}, .ends = {{{0, 1}, {0, -1}}}});
            if (radius > 0) {
                scene.disc({.at = {3 * side, 0}, .velocity = {-side, 0}, .radius = radius});
            } else {
                scene.point({.at = {3 * side, 0}, .velocity = {-side, 0}});
            }
            const SceneRun run = simulate(scene, {.t_end = 6});
            ASSERT_EQ(run.events.size(), 1U) << radius << " " << side;
            EXPECT_NEAR(run.events[0].t, side > 0 ? 4 - radius : 2 - radius, 1e-14);
            EXPECT_EQ(run.events[0].after[0][0], side);
            EXPECT_NEAR(run.events[0].at[0], -1, 1e-14);
        }
    }
}

TEST(SceneArcs, ADiscStrikesTheEndOfAnArc)
{
    // It comes along y = 1.05 and passes the end (0, 1) by 0.05: the contact is where the centre is
    // at the distance 0.1 from it.
    Scene scene;
    scene.arc({.centre = {0, 0}, .ends = {{{0, 1}, {0, -1}}}});
    scene.disc({.at = {2, 1.05}, .velocity = {-1, 0}, .radius = 0.1});
    const SceneRun run = simulate(scene, {.t_end = 3});
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_NEAR(run.events[0].t, 2 - std::sqrt(0.01 - 0.0025), 1e-14);
    EXPECT_NEAR(run.events[0].at[1], 1, 1e-15);
}

namespace {

struct Ray {
    long double x, y, u, v;
};

/// Advances a point in the stadium of half circles of radius 1 around (-1, 0) and (1, 0) to its
/// next impact, in long double, and reflects it. Returns the time.
long double bounce_in_stadium(Ray& ray)
{
    long double first = 1e9L;
    long double nx = 0;
    long double ny = 0;
    const auto offer = [&](long double s, long double a, long double b) {
        if (s < 1e-9L || s >= first) return;
        first = s;
        nx = a;
        ny = b;
    };
    for (const long double y : {-1.0L, 1.0L}) {
        if (ray.v == 0) continue;
        const long double s = (y - ray.y) / ray.v;
        if (std::fabs(ray.x + s * ray.u) <= 1) offer(s, 0, -y);
    }
    for (const long double centre : {-1.0L, 1.0L}) {
        const long double x = ray.x - centre;
        const long double b = x * ray.u + ray.y * ray.v;
        const long double c = x * x + ray.y * ray.y - 1;
        const long double square = b * b - c;
        if (square < 0) continue;
        const long double s = -b + std::sqrt(square);
        if ((ray.x + s * ray.u) * centre >= 1)
            offer(s, centre - ray.x - s * ray.u, -ray.y - s * ray.v);
    }
    ray.x += first * ray.u;
    ray.y += first * ray.v;
    const long double along = ray.u * nx + ray.v * ny;
    ray.u -= 2 * along * nx;
    ray.v -= 2 * along * ny;
    return first;
}

Scene stadium()
{
    Scene scene;
    scene.terrain({.points = {{-1, -1}, {1, -1}}});
    scene.arc({.centre = {1, 0}, .ends = {{{1, -1}, {1, 1}}}});
    scene.terrain({.points = {{1, 1}, {-1, 1}}});
    scene.arc({.centre = {-1, 0}, .ends = {{{-1, 1}, {-1, -1}}}});
    return scene;
}

}  // namespace

TEST(SceneArcs, TheStadiumAgreesWithLongDouble)
{
    // The billiard is chaotic: a difference grows by no more than a factor 1 + 2 L / (R cos) or so,
    // here below 8 on the mean, an impact. 2^-53 * 8^8 is 2e-9 after eight impacts; the long double
    // itself is 2000 times as accurate.
    for (int k = 0; k < 20; ++k) {
        const double angle = 0.1 + 0.3 * k;
        Ray ray{0.1L, 0.2L, std::cos(angle), std::sin(angle)};
        Scene scene = stadium();
        scene.point({.at = {0.1, 0.2}, .velocity = {std::cos(angle), std::sin(angle)}});
        const SceneRun run = simulate(scene, {.t_end = 100, .max_events = 8});
        ASSERT_EQ(run.events.size(), 8U);
        const long double speed = std::hypot(ray.u, ray.v);
        ray.u /= speed;
        ray.v /= speed;
        long double t = 0;
        for (const SceneEvent& event : run.events) {
            t += bounce_in_stadium(ray) / speed;
            ASSERT_NEAR(event.t, static_cast<double>(t), 2e-9) << k;
            ASSERT_NEAR(event.at[0], static_cast<double>(ray.x), 2e-9) << k;
        }
    }
}

TEST(SceneArcs, NothingLeavesAStadium)
{
    // 10 points and 10 discs, 500 s each, past the seams of arcs and segments; the speed is kept to
    // 1e-16 an impact.
    Scene scene = stadium();
    for (int k = 0; k < 10; ++k) {
        const double angle = 0.05 + 0.61 * k;
        const Vector2 velocity{std::cos(angle), std::sin(angle)};
        scene.point({.at = {0.1 * k - 0.5, 0.9}, .velocity = velocity});
        scene.disc({.at = {0.25 * k - 1.1, -0.3}, .velocity = velocity, .radius = 0.02});
    }
    const SceneRun run = simulate(scene, {.t_end = 500, .record_events = false});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_GT(run.statistics.impacts, 4000U);
    for (std::size_t i = 0; i < run.bodies.size(); ++i) {
        const Vector2& p = run.bodies[i].at;
        const double beyond = std::max(std::fabs(p[0]) - 1, 0.0);
        EXPECT_LE(std::hypot(beyond, p[1]), 1 - scene.bodies()[i].radius + 1e-12) << i;
    }
}

TEST(SceneArcs, PinsFarAwayChangeNoBit)
{
    // The squares of terrain are divided where there are more than a dozen faces.
    const auto board = [](int rows) {
        Scene scene({.gravity = {0, -9.81}});
        const auto rubber = scene.material({.restitution = 0.4});
        for (int y = 0; y < rows; ++y) {
            for (int x = -y - 2; x <= y + 2; ++x) {
                scene.arc({.centre = {0.5 * x + 0.25 * (y % 2), -0.4 * y},
                           .radius = 0.12,
                           .material = rubber});
            }
        }
        scene.disc({.at = {0.002, 1}, .radius = 0.08, .material = rubber});
        return simulate(scene, {.t_end = 1.3});
    };
    const SceneRun few = board(6);
    const SceneRun many = board(40);
    ASSERT_GT(few.events.size(), 3U);
    ASSERT_EQ(few.events.size(), many.events.size());
    for (std::size_t k = 0; k < few.events.size(); ++k) {
        EXPECT_EQ(few.events[k].t, many.events[k].t);
        EXPECT_EQ(few.events[k].after, many.events[k].after);
    }
}

TEST(SceneArcs, AnArcThatIsNoneIsRefused)
{
    EXPECT_EQ(refusal({.name = "pin"}),
              "Scene: pin needs either a radius, or two ends that differ; found neither");
    EXPECT_EQ(refusal({.radius = 1, .ends = {{{1, 0}, {0, 1}}}}),
              "Scene: an arc needs either a radius, or two ends that differ; found both");
    EXPECT_EQ(refusal({.ends = {{{1, 0}, {0, 2}}}}),
              "Scene: the ends of an arc are 1 and 2 m from its centre; expected equal distances");
    EXPECT_EQ(refusal({.radius = -1}),
              "Scene: radius of an arc must be zero or positive, and finite, got -1");
    Scene scene;
    scene.arc({.name = "pin", .radius = 1});
    EXPECT_THROW(scene.disc({.at = {1.5, 0}, .radius = 0.6}), std::invalid_argument);
    EXPECT_NO_THROW(scene.disc({.at = {0, 0}, .radius = 0.5}));
}

TEST(SceneArcs, FilesHaveThem)
{
    const SceneFile file = read_scene(R"({
        "materials": {"steel": {"restitution": 0.5}},
        "arcs": [{"name": "pin", "centre": [0, 0], "radius": 2, "material": "steel"},
                 {"centre": [5, 0], "from": [6, 0], "to": [5, 1]}]})");
    ASSERT_EQ(file.scene.surfaces().size(), 2U);
    EXPECT_EQ(file.scene.surfaces()[0].radius, 2);
    EXPECT_EQ(file.scene.surfaces()[0].material.index, 1U);
    EXPECT_EQ(file.scene.surfaces()[1].radius, 1);
    const auto message = [](const std::string& arc) {
        try {
            static_cast<void>(read_scene("{\"arcs\": [" + arc + "]}", "s.json"));
        } catch (const SceneFileError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_EQ(
        message(R"({"centre": [0, 0]})"),
        "s.json:1: expected either \"radius\", or \"from\" and \"to\" in an arc, found neither");
    EXPECT_EQ(message(R"({"centre": [0, 0], "radius": 0})"),
              "s.json:1: expected a positive number for \"radius\", found 0");
    EXPECT_EQ(message(R"({"centre": [0, 0], "raduis": 1})"),
              "s.json:1: unknown key \"raduis\" in an arc, the nearest known is \"radius\"");
}

}  // namespace ricochet::arcs_test
