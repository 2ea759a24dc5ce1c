// Points and small discs among segments: bodies inside stay inside.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

#include "ricochet/scene/simulate.hpp"

namespace ricochet::terrain_test {
namespace {

/// Distance of p to a closed polygon, negative outside.
double inside_by(const std::vector<Vector2>& polygon, const Vector2& p)
{
    double nearest = std::numeric_limits<double>::infinity();
    bool inside = false;
    for (std::size_t k = 0; k < polygon.size(); ++k) {
        const Vector2& a = polygon[k];
        const Vector2& b = polygon[(k + 1) % polygon.size()];
        const double dx = b[0] - a[0];
        const double dy = b[1] - a[1];
        const double part =
            std::clamp(((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / (dx * dx + dy * dy), 0.0, 1.0);
        nearest = std::min(nearest, std::hypot(p[0] - a[0] - part * dx, p[1] - a[1] - part * dy));
        if ((a[1] > p[1]) != (b[1] > p[1]) && p[0] < a[0] + (p[1] - a[1]) * dx / dy) {
            inside = !inside;
        }
    }
    return inside ? nearest : -nearest;
}

/// A polygon around the origin with corners of both kinds, some of them sharp.
std::vector<Vector2> star(std::mt19937_64& random)
{
    std::uniform_real_distribution<double> part(0, 1);
    const int corners = 3 + static_cast<int>(random() % 8);
    const bool regular = random() % 4 == 0;
    const double turn = regular ? 0 : part(random);
    std::vector<Vector2> polygon;
    for (int k = 0; k < corners; ++k) {
        const double shift = regular ? 0.5 : 0.8 * part(random);
        const double angle = 2 * std::numbers::pi * (k + shift + turn) / corners;
        const double radius = regular ? 1 : 0.25 + 0.75 * part(random);
        polygon.push_back({radius * std::cos(angle), radius * std::sin(angle)});
    }
    return polygon;
}

struct Trial {
    Scene scene;
    std::vector<Vector2> polygon;
};

/// Bodies of this radius in a polygon, made of one chain or of separate segments, of which every
/// second one may start at its other end.
Trial trial(std::uint64_t seed, double radius, bool turned = false)
{
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> part(0, 1);
    const auto one_of = [&](std::initializer_list<double> values) {
        return *(values.begin() + random() % values.size());
    };
    const double gravity = one_of({0, 1, 9.81});
    Trial made{Scene({.gravity = {0, -gravity}}), star(random)};
    const double restitution = one_of({0, 0.3, 0.7, 0.95, 1});
    const double friction = one_of({0, 0, 0.1, 0.6, 2});
    const MaterialId material =
        made.scene.material({.restitution = restitution, .friction = friction});
    if (random() % 2 == 0) {
        made.scene.terrain({.points = made.polygon, .closed = true, .material = material});
    } else {
        for (std::size_t k = 0; k < made.polygon.size(); ++k) {
            std::vector<Vector2> ends{made.polygon[k], made.polygon[(k + 1) % made.polygon.size()]};
            if (turned && k % 2 == 1) std::swap(ends[0], ends[1]);
            made.scene.terrain({.points = ends, .material = material});
        }
    }
    for (int tries = 0; tries < 100; ++tries) {
        const Vector2 at{2 * part(random) - 1, 2 * part(random) - 1};
        if (inside_by(made.polygon, at) <= 1.01 * radius) continue;
        Vector2 velocity{2 * part(random) - 1, 2 * part(random) - 1};
        if (random() % 4 == 0) {
            // Into a corner.
            const Vector2& corner = made.polygon[random() % made.polygon.size()];
            velocity = {corner[0] - at[0], corner[1] - at[1]};
        } else if (random() % 4 == 0) {
            velocity = {};
        }
        if (radius == 0) {
            made.scene.point({.at = at, .velocity = velocity, .material = material});
        } else {
            made.scene.disc(
                {.at = at, .velocity = velocity, .radius = radius, .material = material});
        }
        break;
    }
    return made;
}

SceneRun run_of(const Trial& made, const SceneContacts* contacts, const std::vector<double>& times)
{
    return simulate(
        made.scene,
        {.t_end = 5, .contacts = contacts, .sample_times = times, .max_events = 1'000'000});
}

std::vector<double> sample_times()
{
    std::vector<double> times;
    for (int k = 0; k <= 20; ++k) times.push_back(0.25 * k);
    return times;
}

void stays_inside(std::uint64_t seed, double radius, bool turned = false)
{
    const Trial made = trial(seed, radius, turned);
    if (made.scene.bodies().empty()) return;
    const std::vector<double> times = sample_times();
    const SceneRun run = run_of(made, radius > 0 ? scene_contacts() : nullptr, times);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << "seed " << seed << ": " << run.message;
    double most = energy(made.scene, run.samples[0]);
    for (std::size_t k = 0; k < run.samples.size(); ++k) {
        const BodyState& body = run.samples[k][0];
        // Coordinates and velocities are of size 1 to 5, and a run has up to some thousand impacts
        // whose place is rounded to some ulp.
        ASSERT_GE(inside_by(made.polygon, body.at) - radius, -1e-12)
            << "seed " << seed << " at " << times[k];
        const double now = energy(made.scene, run.samples[k]);
        ASSERT_LE(now, most + 1e-11) << "seed " << seed << " at " << times[k];
        most = std::min(most, now);
    }
}

/// Whether gravity keeps a disc of this radius on a corner of the polygon that it passes: its
/// centre is on a circle, and gravity pulls it towards the corner by more than v^2 / radius.
bool held_by_corner(const Trial& made, const BodyState& body, double radius)
{
    const Vector2 g = made.scene.settings().gravity;
    const double square = std::pow(std::hypot(body.velocity[0], body.velocity[1]), 2);
    return std::ranges::any_of(made.polygon, [&](const Vector2& corner) {
        const Vector2 apart{body.at[0] - corner[0], body.at[1] - corner[1]};
        const double distance = std::hypot(apart[0], apart[1]);
        const double pull = -(g[0] * apart[0] + g[1] * apart[1]) / distance;
        const bool touches = std::fabs(distance - radius) <= 1e-12;
        return touches && pull > square / radius;
    });
}

TEST(Terrain, PointsInPolygonsStayInside)
{
    for (std::uint64_t seed = 0; seed < 4000; ++seed) stays_inside(seed, 0);
}

TEST(Terrain, APointThatSlidesOverAnAlmostFlatCornerStaysInside)
{
    // Its angle of 1.2e-3 rad turns the rounding across the segments into 800 times as much along
    // them.
    stays_inside(26927, 0);
}

TEST(Terrain, APointPassesAlmostFlatCornersOfSeparateSegmentsAsThoseOfOneChain)
{
    // Seed 122656 has an angle of 2e-6 rad between two segments, for either start of each.
    for (const bool turned : {false, true}) {
        stays_inside(122656, 0, turned);
        for (std::uint64_t seed = 0; seed < 1000; ++seed) stays_inside(seed, 0, turned);
    }
}

TEST(Terrain, ElasticPointsWithFrictionComeToRestInACorner)
{
    // Friction leads them into hops that strike both sides at a right angle, lower than the
    // rounding of their place.
    for (const std::uint64_t seed : {20506U, 31829U, 50995U, 66179U, 115630U}) {
        stays_inside(seed, 0);
        const Trial made = trial(seed, 0);
        EXPECT_TRUE(run_of(made, nullptr, {}).bodies[0].asleep) << "seed " << seed;
    }
}

TEST(Terrain, DiscsNeedTheContactLibraryOnlyWhereACornerHoldsThem)
{
    int held = 0;
    for (std::uint64_t seed = 0; seed < 3000; ++seed) {
        const Trial made = trial(seed, 0.01);
        if (made.scene.bodies().empty()) continue;
        const SceneRun run = run_of(made, nullptr, {});
        if (run.outcome == Outcome::reached_end) continue;
        ASSERT_EQ(run.outcome, Outcome::zeno) << "seed " << seed << ": " << run.message;
        EXPECT_TRUE(held_by_corner(made, run.bodies[0], 0.01)) << "seed " << seed;
        ++held;
    }
    EXPECT_GT(held, 0);
}

TEST(Terrain, ADiscThatSlidesAgainstAnEndJoinsAGroup)
{
    Scene scene({.gravity = {-2.1256968260063425, -3.9994461092242144}});
    const auto felt = scene.material({.restitution = 0.58153606538496727});
    scene.terrain({.points = {{-3.0065591970911396, 1.50215979090334},
                              {-3.2012551555534361, 4.735926542785597},
                              {-2.2033979558311936, 2.6336864871397752}},
                   .material = felt});
    scene.terrain({.points = {{-3.6630743730191067, 2.5579871597377979},
                              {-1.4929900854609977, 2.0645926054344454},
                              {-3.2873188486702665, 2.808687515579412}},
                   .closed = true,
                   .material = felt});
    scene.terrain({.points = {{0.86328965654305279, 1.016717672579402},
                              {-1.4555277618724458, 2.3922690033102065},
                              {-1.391225595093184, 1.8833172688116726},
                              {-0.48188624212318221, 3.684398197636344}},
                   .closed = true,
                   .material = felt});
    scene.disc({.at = {-0.80120678982145321, 4.7435874565828069},
                .velocity = {0.036532840603773487, -2.5775264588650559},
                .radius = 0.72792611724691125,
                .mass = 1.1346343371730434,
                .material = felt});
    const SceneRun run = simulate(scene, {.t_end = 5, .contacts = scene_contacts()});
    EXPECT_EQ(run.outcome, Outcome::reached_end) << run.message;
    EXPECT_LT(run.events.size(), 2000u);
    EXPECT_TRUE(run.bodies[0].asleep);
    // Without the solver a sentence says so.
    EXPECT_EQ(simulate(scene, {.t_end = 5}).outcome, Outcome::zeno);
}

TEST(Terrain, SmallDiscsInPolygonsStayInside)
{
    for (std::uint64_t seed = 0; seed < 4000; ++seed) stays_inside(seed, 0.01);
}

TEST(Terrain, APointWithDragThatFliesIntoACornerIsThrownBack)
{
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(-0.3, 0.3);
    for (int k = 0; k < 200; ++k) {
        const Vector2 corner{0, 0.5 + uniform(random)};
        const Vector2 at{uniform(random), -1 + uniform(random)};
        Scene scene;
        scene.terrain({.points = {{-1, 0}, corner, {1, 0}}});
        scene.point({.at = at,
                     .velocity = {3 * (corner[0] - at[0]), 3 * (corner[1] - at[1])},
                     .drag = 0.03 + std::fabs(uniform(random))});
        EXPECT_FALSE(simulate(scene, {.t_end = 1}).events.empty()) << k;
    }
}

TEST(Terrain, ADiscThatSlidesOverAJointStaysOnTheLine)
{
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> part(0, 1);
    for (int k = 0; k < 400; ++k) {
        Scene scene({.gravity = {0, -1 - 9 * part(random)}});
        const MaterialId soft = scene.material({.restitution = 0});
        // Beside long coordinates the ends of both halves are rounded.
        const Vector2 joint{100 * part(random), 100 * part(random)};
        const Vector2 along{0.3 + part(random), 0.3 + part(random)};
        const double length = std::hypot(along[0], along[1]);
        const Vector2 normal{-along[1] / length, along[0] / length};
        scene.terrain({.points = {{joint[0] - along[0], joint[1] - along[1]},
                                  joint,
                                  {joint[0] + along[0], joint[1] + along[1]}},
                       .material = soft});
        const double radius = 0.03 + 0.1 * part(random);
        const double high = radius + 0.02;
        scene.disc({.at = {joint[0] + 0.5 * along[0] + high * normal[0],
                           joint[1] + 0.5 * along[1] + high * normal[1]},
                    .radius = radius,
                    .material = soft});
        SceneOptions options{.t_end = 4, .max_events = 1000};
        for (int i = 1; i < 400; ++i) options.sample_times.push_back(0.01 * i);
        for (const auto& row : simulate(scene, options).samples) {
            const Vector2 p{row[0].at[0] - joint[0], row[0].at[1] - joint[1]};
            if (p[0] * along[0] + p[1] * along[1] < -length * length) break;
            ASSERT_GT(p[0] * normal[0] + p[1] * normal[1], radius - 1e-12) << k;
        }
    }
}

TEST(Terrain, ALineLongerThanAnyNumberOfCellsIsStruckWhereItIs)
{
    constexpr double radius = 0.1;
    for (const Vector2& end : {Vector2{1e5, 1e5}, Vector2{1e12, 0.0}}) {
        Scene scene({.gravity = {0, -10}});
        scene.terrain({.points = {{-end[0], -end[1]}, end}});
        const double slope = end[1] / end[0];
        for (int i = 0; i < 30; ++i) {
            const double x = 0.5 * i;
            // It falls by i + 1 centimetres.
            const double above = radius * std::sqrt(1 + slope * slope) + 0.01 * (i + 1);
            scene.disc({.at = {x, slope * x + above}, .radius = radius, .mass = 1});
        }
        const SceneRun run = simulate(scene, {.t_end = 0.3, .contacts = scene_contacts()});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        std::vector<double> first(30, 1);
        for (const SceneEvent& event : run.events) {
            first[event.body] = std::min(first[event.body], event.t);
        }
        for (int i = 0; i < 30; ++i) {
            const auto body = static_cast<std::size_t>(i);
            EXPECT_NEAR(first[body], std::sqrt(0.002 * (i + 1)), 1e-9) << end[0] << ", disc " << i;
        }
    }
}

/// A point that is thrown so that it meets the corner of a wedge at the origin, where coordinates
/// have no rounding of their own, and its half plane.
struct Wedge {
    double low = 0, high = 0;  ///< [rad] directions of its two sides
    Vector2 at{}, v{};

    [[nodiscard]] static Vector2 side(double angle)
    {
        return {6 * std::cos(angle), 6 * std::sin(angle)};
    }
    /// [m] Distance by which p lies outside; negative inside.
    [[nodiscard]] double outside_by(const Vector2& p) const
    {
        const double mean = (low + high) / 2;
        return std::max(
            {p[0] * std::sin(low) - p[1] * std::cos(low),
             p[1] * std::cos(high) - p[0] * std::sin(high),
             p[0] * std::cos(mean) + p[1] * std::sin(mean) - 6 * std::cos((high - low) / 2)});
    }
};

constexpr double gravity = 9.81;

std::optional<Wedge> random_wedge(std::mt19937_64& random)
{
    std::uniform_real_distribution<double> part(0, 1);
    Wedge wedge{.low = 0.04 + 2.8 * part(random)};
    wedge.high = std::min(3.1, wedge.low + 0.02 + (random() % 2 == 0 ? 0.1 : 1.3) * part(random));
    const double direction = wedge.low + (wedge.high - wedge.low) * (0.2 + 0.6 * part(random));
    const double away = 0.3 + 2 * part(random);
    const double duration = 0.1 + 0.5 * part(random);
    wedge.at = {away * std::cos(direction), away * std::sin(direction)};
    wedge.v = {-wedge.at[0] / duration, -wedge.at[1] / duration + 0.5 * gravity * duration};
    for (int k = 1; k < 40; ++k) {
        const double t = duration * k / 40;
        const Vector2 p{wedge.at[0] + wedge.v[0] * t,
                        wedge.at[1] + wedge.v[1] * t - 0.5 * gravity * t * t};
        if (wedge.outside_by(p) > -1e-3 * std::hypot(p[0], p[1])) return {};
    }
    return wedge;
}

TEST(Terrain, APointThatMeetsTwoSegmentsAtOnceStaysInside)
{
    std::mt19937_64 random(7);
    for (int k = 0; k < 900;) {
        const std::optional<Wedge> found = random_wedge(random);
        if (!found) continue;
        const Wedge& wedge = *found;
        Scene scene({.gravity = {0, -gravity}});
        const MaterialId material =
            scene.material({.restitution = std::array{1.0, 0.9, 0.5, 0.0}[random() % 4],
                            .friction = random() % 3 == 0 ? 0.3 : 0});
        const Vector2 low = Wedge::side(wedge.low), high = Wedge::side(wedge.high);
        if (k % 3 == 0) {
            scene.terrain({.points = {high, {0, 0}, low}, .closed = true, .material = material});
        } else if (k % 3 == 1) {
            scene.terrain({.points = {low, high, {0, 0}}, .closed = true, .material = material});
        } else {
            scene.terrain({.points = {high, {0, 0}}, .material = material});
            scene.terrain({.points = {low, {0, 0}}, .material = material});
            scene.terrain({.points = {high, low}, .material = material});
        }
        scene.point({.at = wedge.at, .velocity = wedge.v, .material = material});
        const SceneRun run =
            simulate(scene, {.t_end = 3, .record_events = false, .max_events = 20'000});
        // A point on a side is outside by the rounding of the sines and cosines of its check.
        ASSERT_LT(wedge.outside_by(run.bodies[0].at), 1e-12) << k;
        ++k;
    }
}

TEST(Terrain, APointThatFallsIntoACornerBouncesForEver)
{
    for (const double slope : {1.0, 0.5, 2.0}) {
        Scene scene({.gravity = {0, -gravity}});
        scene.terrain({.points = {{-4, 4}, {0, 0}, {4, 4 * slope}}});
        scene.point({.at = {0, 2}});
        const SceneRun run = simulate(scene, {.t_end = 100});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        const auto& [at, velocity, asleep, winding] = run.bodies[0];
        EXPECT_GT(at[1], std::max(-at[0], slope * at[0]) - 1e-12);
        // The energy of one kilogram, to the rounding of some hundred impacts.
        const double energy =
            gravity * at[1] + (velocity[0] * velocity[0] + velocity[1] * velocity[1]) / 2;
        EXPECT_NEAR(energy, 2 * gravity, 1e-11);
    }
}

}  // namespace
}  // namespace ricochet::terrain_test
