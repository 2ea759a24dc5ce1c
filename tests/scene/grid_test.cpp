// Cells, rings, the second grid and the type of calendar affect the order of the work but no bit of
// a run; and a gas of unequal discs against brute force.
#include "scene/grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "scene/brute_force.hpp"
#include "scene/event_queue.hpp"
#include "scene/gas.hpp"
#include "scene/options.hpp"

namespace ricochet::grid_test {
namespace {

using namespace detail;

constexpr double infinite = std::numeric_limits<double>::infinity();

/// Small discs on a lattice in the unit square, `big` of `ratio` times their radius between them.
Scene mixed(std::size_t small, std::size_t big, double ratio, double fraction, unsigned seed = 1)
{
    const double squares =
        static_cast<double>(small) / fraction + static_cast<double>(big) * ratio * ratio;
    const double radius = 1 / std::sqrt(std::numbers::pi * squares);
    std::mt19937 generator(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Scene scene;
    for (const Vector2& normal : {Vector2{0, 1}, Vector2{1, 0}, Vector2{0, -1}, Vector2{-1, 0}}) {
        const Vector2 corner{normal[0] < 0 ? 1.0 : 0.0, normal[1] < 0 ? 1.0 : 0.0};
        scene.wall({.point = corner, .normal = normal});
    }
    const auto add = [&](const Vector2& at, double r) {
        scene.disc({.at = at,
                    .velocity = {uniform(generator), uniform(generator)},
                    .radius = r,
                    .mass = r * r / (radius * radius)});
    };
    const auto columns = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(big))));
    for (std::size_t i = 0; i < big; ++i) {
        const auto place = [&](std::size_t k) {
            return (static_cast<double>(k) + 0.5) / static_cast<double>(columns);
        };
        add({place(i % columns), place(i / columns)}, ratio * radius);
    }
    const double pitch = 2.2 * radius;
    std::size_t placed = 0;
    for (double y = pitch / 2; y < 1 - radius; y += pitch) {
        for (double x = pitch / 2; x < 1 - radius && placed < small; x += pitch) {
            const Vector2 at{x, y};
            const bool free = std::ranges::all_of(scene.bodies(), [&](const Disc& disc) {
                return norm(at - disc.at) > disc.radius + radius;
            });
            if (!free) continue;
            add(at, radius);
            ++placed;
        }
    }
    EXPECT_EQ(placed, small);
    return scene;
}

void expect_same(const SceneRun& one, const SceneRun& two)
{
    ASSERT_EQ(one.outcome, two.outcome);
    ASSERT_EQ(one.events.size(), two.events.size());
    for (std::size_t k = 0; k < one.events.size(); ++k) {
        ASSERT_EQ(one.events[k].t, two.events[k].t) << k;
        ASSERT_EQ(one.events[k].body, two.events[k].body) << k;
        ASSERT_EQ(one.events[k].after, two.events[k].after) << k;
    }
    for (std::size_t i = 0; i < one.bodies.size(); ++i) {
        ASSERT_EQ(one.bodies[i].at, two.bodies[i].at) << i;
        ASSERT_EQ(one.bodies[i].velocity, two.bodies[i].velocity) << i;
    }
}

TEST(Rings, CoverEveryPlaceFromWhichABodyCanTouchOnceAndLeaveNothing)
{
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Cells cells;
    cells.size(0.5, 64, 64, false);
    const double radius = 0.2;
    for (const double big : {0.3, 1.0, 4.7, 11.0}) {
        Rings rings;
        rings.size(cells, radius, 0.15, 0.05);
        ASSERT_LE(rings.across(cells, big), 64);
        const std::uint32_t ring = rings.add(big);
        for (int turn = 0; turn < 20; ++turn) {
            const Vector2 at{20 * uniform(generator), 20 * uniform(generator)};
            rings.lay(cells, ring, 7, at);
            std::map<std::uint32_t, int> buckets;
            rings.each_bucket(cells, ring, [&](std::uint32_t b) { ++buckets[b]; });
            for (const auto& [bucket, times] : buckets) {
                EXPECT_EQ(times, 1);
                int bodies = 0;
                rings.each_on(bucket, [&](std::uint32_t body) { bodies += body == 7; });
                EXPECT_EQ(bodies, 1);
            }
            for (int k = 0; k < 1000; ++k) {
                // The big body has moved as far as it may, the other one touches it, and is as far
                // from its cell as it may be.
                const double angle = std::numbers::pi * uniform(generator);
                const double reach = big + radius * (0.5 + 0.5 * uniform(generator));
                const Vector2 middle = at + Vector2{std::copysign(0.15, uniform(generator)),
                                                    std::copysign(0.15, uniform(generator))};
                const Vector2 place =
                    middle + Vector2{reach * std::cos(angle) + 0.05 * uniform(generator),
                                     reach * std::sin(angle) + 0.05 * uniform(generator)};
                const auto cell = cells.cell_of(place);
                EXPECT_TRUE(buckets.contains(cells.bucket_of(cell.x, cell.y)));
            }
            rings.lift(cells, ring, 7);
            for (std::uint32_t b = 0; b < cells.buckets(); ++b) {
                rings.each_on(b, [&](std::uint32_t) { ADD_FAILURE() << b; });
            }
        }
        // No cell in the middle of a large one.
        rings.lay(cells, ring, 7, {0.25, 0.25});
        int asked = 0;
        rings.each_on(cells.bucket_of(0, 0), [&](std::uint32_t) { ++asked; });
        EXPECT_EQ(asked, big > 0.5 ? 0 : 1) << big;
    }
}

TEST(Grid, MakesThoseBigThatCostMoreInTheCellsOfAll)
{
    const auto big_of = [](const Scene& scene) {
        const SceneOptions options{.t_end = 1};
        World world(scene, options);
        std::vector<std::uint32_t> members(world.bodies.size());
        for (std::uint32_t i = 0; i < members.size(); ++i) members[i] = i;
        std::vector<Vector2> places;
        for (const Body& body : world.bodies) places.push_back(body.p);
        Grid grid;
        grid.size(world, members, places, false);
        return std::ranges::count_if(world.bodies, &Body::big);
    };
    EXPECT_EQ(big_of(mixed(2000, 4, 20, 0.3)), 4);
    EXPECT_EQ(big_of(mixed(2000, 30, 5, 0.3)), 30);
    EXPECT_EQ(big_of(test::gas({.count = 1000})), 0);
    EXPECT_EQ(big_of(test::gas({.count = 1000, .fraction = 0.3, .spread = 0.3})), 0);
    EXPECT_EQ(big_of(mixed(10, 1, 5, 0.05)), 0);  // so few are all tested
}

TEST(Grid, ChangesNoBitOfAMixedGas)
{
    for (const auto& [small, big, ratio] :
         {std::tuple{600, 3, 15.0}, std::tuple{300, 40, 3.0}, std::tuple{500, 1, 30.0}}) {
        const Scene scene =
            mixed(static_cast<std::size_t>(small), static_cast<std::size_t>(big), ratio, 0.3);
        const SceneOptions options{.t_end = 0.03};
        const SceneRun one = simulate(scene, options, {.big_above = infinite});
        EXPECT_GT(one.events.size(), 200U);
        expect_same(one, simulate(scene, options, SceneTuning{}));
        const double least = scene.bodies().back().radius;
        expect_same(one, simulate(scene, options, {.big_above = 1.5 * least}));
        expect_same(one, simulate(scene, options, {.big_above = 0.5 * least}));  // all are big
    }
}

TEST(Grid, AsksLessWithBigBodiesInASecondOne)
{
    const Scene scene = mixed(2000, 4, 20, 0.3);
    const SceneOptions options{.t_end = 0.004, .record_events = false};
    const auto asked = [&](double big_above) {
        return simulate(scene, options, {.big_above = big_above}).statistics.predictions;
    };
    EXPECT_GT(asked(infinite), 20 * simulate(scene, options).statistics.predictions);
}

TEST(Grid, ChangesNoBitOfStepsTerrainSleepersAndPoints)
{
    Scene scene({.gravity = {0.3, -2}});
    const MaterialId rough = scene.material({.restitution = 0.8});
    scene.wall({.normal = {1, 0}});
    scene.wall({.point = {10, 0}, .normal = {-1, 0}});
    scene.terrain({.points = {{-1, 1}, {3, 0}, {6, 0.5}, {11, 0}}, .material = rough});
    const BodyId heavy = scene.disc({.at = {3, 4}, .radius = 1, .mass = 40, .drag = 0.5});
    const BodyId other = scene.disc({.at = {7, 4}, .radius = 1.2, .mass = 50});
    scene.spring({.between = {heavy, other}, .rest = 3.5, .stiffness = 100});
    scene.disc({.at = {5, 7}, .velocity = {-1, 0}, .radius = 0.9, .mass = 30});
    std::mt19937 generator(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int i = 0; i < 60; ++i) {
        const Vector2 at{0.5 + 0.6 * (i % 15), 8.5 + 0.5 * (i / 15)};
        const Vector2 velocity{uniform(generator), uniform(generator)};
        const double drag = i % 5 == 0 ? 0.1 : 0.0;
        if (i % 7 == 0) {
            scene.point({.at = at, .velocity = velocity, .mass = 0.3, .drag = drag});
        } else {
            scene.disc({.at = at, .velocity = velocity, .radius = 0.1, .mass = 0.3, .drag = drag});
        }
    }
    const SceneOptions options{.t_end = 4};
    const SceneRun one = simulate(scene, options, {.big_above = infinite});
    EXPECT_GT(one.events.size(), 300U) << one.message;
    expect_same(one, simulate(scene, options, {.big_above = 0.5}));
    expect_same(one, simulate(scene, options, {.big_above = 0.5, .ring_from = 0}));
    expect_same(one, simulate(scene, options, {.big_above = 0.95}));
}

TEST(Grid, WakesABigSleeperAndASmallOne)
{
    // Without gravity a body at rest sleeps: the small disc strikes the big one, which drifts
    // into a small sleeper behind it.
    Scene scene;
    scene.disc({.at = {0, 0}, .radius = 5, .mass = 2});
    scene.disc({.at = {-20, 0}, .velocity = {1, 0}, .radius = 0.1});
    scene.disc({.at = {12, 0}, .radius = 0.1});
    for (int i = 0; i < 30; ++i) scene.disc({.at = {1.0 * i - 15, 9}, .radius = 0.1});
    const SceneRun run = simulate(scene, {.t_end = 60}, {.big_above = 1});
    ASSERT_EQ(run.events.size(), 2U);
    // From -20 to -5.1; then the big one goes from 5 to 11.9 at 2/3 m/s.
    EXPECT_NEAR(run.events[0].t, 14.9, 1e-13);
    EXPECT_NEAR(run.events[1].t, 14.9 + 6.9 * 1.5, 1e-13);
    expect_same(run, simulate(scene, {.t_end = 60}, {.big_above = infinite}));
}

TEST(Grid, AMixedGasCollidesAsByBruteForceInLongDouble)
{
    // An error grows by the ratio of a free path to a radius, some 5 to 20 times at every collision
    // of a small disc. The first 60 collisions of 40 discs are three a disc: 20^3 1e-16 = 1e-12.
    const Scene scene = mixed(40, 2, 6, 0.2);
    const SceneRun run = simulate(scene, {.t_end = 100, .max_events = 60},
                                  {.big_above = 0.9 * scene.bodies()[0].radius});
    ASSERT_EQ(run.events.size(), 60U);
    test::BruteForce exact(scene);
    for (std::size_t k = 0; k < 60; ++k) {
        EXPECT_NEAR(run.events[k].t, static_cast<double>(exact.next()), 1e-12) << k;
    }
}

/// Discs and points above terrain, some with drag, under gravity.
Scene above_terrain(std::size_t count, std::size_t segments)
{
    Scene scene({.gravity = {0, -1}});
    const MaterialId stone = scene.material({.restitution = 0.9});
    scene.wall({.normal = {1, 0}});
    scene.wall({.point = {10, 0}, .normal = {-1, 0}});
    std::vector<Vector2> points;
    for (std::size_t k = 0; k <= segments; ++k) {
        const double x = 12.0 * static_cast<double>(k) / static_cast<double>(segments) - 1;
        points.push_back({x, 0.3 * std::sin(3 * x) + 0.02 * std::sin(40 * x)});
    }
    scene.terrain({.points = points, .material = stone});
    std::mt19937 generator(6);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (std::size_t i = 0; i < count; ++i) {
        const Vector2 at{0.3 + 0.3 * static_cast<double>(i % 32),
                         1 + 0.3 * static_cast<double>(i / 32) + 0.02 * uniform(generator)};
        const Vector2 velocity{uniform(generator), uniform(generator)};
        const double drag = i % 5 == 0 ? 0.05 : 0.0;
        if (i % 3 == 0) {
            scene.point({.at = at, .velocity = velocity, .drag = drag});
        } else {
            scene.disc({.at = at, .velocity = velocity, .radius = 0.03, .drag = drag});
        }
    }
    return scene;
}

TEST(Grid, ChangesNoBitWhateverItsSideAndHoweverOftenItIsLaid)
{
    const std::vector<Scene> scenes{test::gas({.count = 200, .gravity = {0.1, -1}, .spread = 0.3}),
                                    above_terrain(80, 150), mixed(300, 2, 12, 0.3)};
    for (const Scene& scene : scenes) {
        const SceneOptions options{.t_end = 4, .max_events = 500};
        const SceneRun one = simulate(scene, options);
        EXPECT_GT(one.events.size(), 150U) << one.message;
        for (const double side : {0.02, 0.15, 1.0, 30.0}) {
            expect_same(one, simulate(scene, options, {.cell_side = side}));
        }
        for (const std::uint64_t acts : {20U, 333U}) {
            const SceneRun run = simulate(scene, options, {.lay_after = acts});
            EXPECT_GT(run.statistics.layings, 1U);
            expect_same(one, run);
        }
    }
}

/// First contacts tested, and crossings, per event.
double work_each(const SceneRun& run)
{
    const SceneStatistics& s = run.statistics;
    return static_cast<double>(s.predictions + 3 * s.crossings) / static_cast<double>(s.events);
}

/// 400 discs in a box of 40: in its middle, or all over it while two walls close in on them.
Scene in_void(bool contracts)
{
    Scene scene;
    scene.wall({.point = {0, 0}, .normal = {1, 0}});
    scene.wall({.point = {0, 0}, .normal = {0, 1}});
    const double speed = contracts ? -1 : 0;
    scene.wall({.point = {40, 40}, .normal = {-1, 0}, .motion = ConstantVelocity{{speed, 0}}});
    scene.wall({.point = {40, 40}, .normal = {0, -1}, .motion = ConstantVelocity{{0, speed}}});
    std::mt19937 generator(9);
    std::uniform_real_distribution<double> uniform(-1, 1);
    const double wide = contracts ? 36 : 1;
    for (int i = 0; i < 400; ++i) {
        const Vector2 at{(i % 20 + 0.5) / 20 - 0.5, (i / 20 + 0.5) / 20 - 0.5};
        scene.disc({.at = {20 + wide * at[0], 20 + wide * at[1]},
                    .velocity = {0.2 * uniform(generator), 0.2 * uniform(generator)},
                    .radius = 0.015});
    }
    return scene;
}

TEST(Grid, FollowsAGasThatExpandsAndOneThatContracts)
{
    for (const bool contracts : {false, true}) {
        const Scene scene = in_void(contracts);
        const SceneOptions options{.t_end = contracts ? 38.0 : 150.0, .record_events = false};
        const double at_start = 0.65 * (contracts ? 36 : 1) / 20;
        const SceneRun held = simulate(scene, options, {.cell_side = at_start});
        const SceneRun run = simulate(scene, options);
        EXPECT_GE(run.statistics.layings, 1U);
        EXPECT_EQ(run.statistics.events, held.statistics.events);
        EXPECT_LT(work_each(run), 0.7 * work_each(held)) << (contracts ? "contracts" : "expands");
    }
}

TEST(Grid, IsNotSpoiledByABodyFarAway)
{
    // In a box of terrain, since nothing lies behind a wall.
    Scene scene;
    scene.terrain({.points = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}}});
    const Scene others = test::gas({.count = 400});
    for (const Disc& disc : others.bodies()) {
        scene.disc({.at = disc.at, .velocity = disc.velocity, .radius = disc.radius});
    }
    const SceneOptions options{.t_end = 0.5, .record_events = false};
    const double without = work_each(simulate(scene, options));
    scene.disc({.at = {1e4, 1e4}, .velocity = {-1, 0}, .radius = 0.01});
    scene.disc({.at = {1e4, 1e4 + 1}, .velocity = {1, 0}, .radius = 0.01});
    EXPECT_LT(work_each(simulate(scene, options)), 1.2 * without);
}

TEST(Grid, TestsNoPointAgainstAnother)
{
    Scene scene;
    for (const Vector2& normal : {Vector2{0, 1}, Vector2{1, 0}, Vector2{0, -1}, Vector2{-1, 0}}) {
        const Vector2 corner{normal[0] < 0 ? 1.0 : 0.0, normal[1] < 0 ? 1.0 : 0.0};
        scene.wall({.point = corner, .normal = normal});
    }
    std::mt19937 generator(8);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int i = 0; i < 500; ++i) {
        scene.point({.at = {uniform(generator), uniform(generator)},
                     .velocity = {uniform(generator) - 0.5, uniform(generator) - 0.5}});
    }
    const SceneOptions options{.t_end = 20};
    const SceneRun alone = simulate(scene, options);
    EXPECT_EQ(alone.statistics.alone, 500U);
    // Of four walls no more than two are approached.
    EXPECT_LE(work_each(alone), 3.0);
    // With terrain they are one group, which has no cells.
    scene.terrain({.points = {{0.4, 0.5}, {0.6, 0.5}}});
    const SceneRun one_group = simulate(scene, options);
    EXPECT_EQ(one_group.statistics.groups, 1U);
    EXPECT_LE(work_each(one_group), 6.0);
    // With few discs points are tested against these alone.
    scene.disc({.at = {0.5, 0.7}, .radius = 0.02});
    scene.disc({.at = {0.3, 0.2}, .velocity = {0.1, 0}, .radius = 0.02});
    EXPECT_LE(work_each(simulate(scene, options)), 40.0);
}

TEST(FaceTree, HasEveryFaceThatCanBeTouched)
{
    const Scene scene = above_terrain(1, 500);
    const SceneOptions options{.t_end = 1};
    const World world(scene, options);
    std::mt19937 generator(10);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (const double radius : {0.0, 1e-3, 0.1, 3.0}) {
        FaceTree tree;
        tree.lay(world, radius);
        double faces = 0;
        for (int k = 0; k < 3000; ++k) {
            // Some far from terrain, some on it.
            const double x = 5 + 7 * uniform(generator);
            const double height = k % 3 == 0 ? 5.0 : k % 3 == 1 ? 0.5 : radius;
            const Vector2 p{x, 0.3 * std::sin(3 * x) + height * uniform(generator)};
            const std::uint32_t square = tree.at(p);
            const auto [low, high] = tree.square(square);
            for (std::size_t c = 0; c < 2; ++c) {
                ASSERT_LE(low[c], p[c]);
                ASSERT_LT(p[c], high[c]);
            }
            const std::vector<std::uint32_t>& near = tree.faces(square);
            EXPECT_TRUE(std::ranges::is_sorted(near));
            std::vector<std::uint32_t> within;
            tree.append_within(p, radius, within);
            const std::set<std::uint32_t> found(within.begin(), within.end());
            for (std::uint32_t f = world.wall_count; f < world.fixed_count; ++f) {
                const Face& face = world.faces[f];
                const Vector2 end = face.at - face.length * turned(face.normal);
                const double apart = norm(p - nearest_on(face.at, end, p));
                EXPECT_EQ(found.contains(f), apart <= radius);
                if (apart > radius + tree.outside()) continue;
                EXPECT_TRUE(std::ranges::binary_search(near, f)) << radius << " " << f;
            }
            faces += static_cast<double>(near.size());
        }
        if (radius < 0.01) {
            EXPECT_LT(faces / 3000, 12);
        }
    }
}

TEST(FaceTree, LeadsFromSquareToSquareWithoutGaps)
{
    const Scene scene = above_terrain(1, 500);
    const SceneOptions options{.t_end = 1};
    const World world(scene, options);
    FaceTree tree;
    tree.lay(world, 0.01);
    std::mt19937 generator(11);
    std::uniform_real_distribution<double> uniform(0, 1);
    // From side to side: each square begins where the one before it ends.
    for (const std::size_t axis : {0U, 1U}) {
        for (const bool upwards : {true, false}) {
            Vector2 p{10 * uniform(generator), 0.3 * uniform(generator)};
            p[axis] = upwards ? -100.0 : 100.0;
            std::uint32_t square = tree.at(p);
            int count = 0;
            for (; count < 10'000; ++count) {
                const double edge =
                    upwards ? tree.square(square).high[axis] : tree.square(square).low[axis];
                if (!std::isfinite(edge)) break;
                p[axis] = edge;
                const std::uint32_t next = tree.beyond(square, p, axis, upwards);
                ASSERT_NE(next, square);
                const Square& there = tree.square(next);
                EXPECT_EQ(upwards ? there.low[axis] : there.high[axis], edge);
                square = next;
            }
            EXPECT_GT(count, 4);
            EXPECT_LT(count, 10'000);
        }
    }
}

TEST(FaceTree, ABallMeetsFewFacesWhateverItsSizeAndTheirNumber)
{
    // In a polygon a ball of any radius tests as few faces; a thousand times as many sides cost the
    // crossings of ten more halvings. A ball of 0.1 reaches thousands of 30 000 sides at a time.
    for (const std::size_t sides : {30U, 1000U, 30'000U}) {
        for (const double radius : {1e-5, 1e-3, 0.1}) {
            if (static_cast<double>(sides) * radius > 1000) continue;
            Scene scene;
            std::vector<Vector2> points;
            for (std::size_t k = 0; k < sides; ++k) {
                const double angle =
                    2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(sides);
                points.push_back({std::cos(angle), std::sin(angle)});
            }
            points.push_back(points[0]);
            scene.terrain({.points = points});
            scene.disc({.at = {0.1, 0.2}, .velocity = {0.7, 0.4}, .radius = radius});
            const SceneRun run = simulate(scene, {.t_end = 1000});
            EXPECT_GT(run.statistics.events, 300U);
            EXPECT_LT(work_each(run), 300) << sides << " sides, radius " << radius;
        }
    }
}

/// Entries in their order, as a sorted set.
class Sorted {
public:
    void set(std::uint32_t body, double t)
    {
        if (times_.contains(body)) order_.erase({times_[body], body});
        times_.erase(body);
        if (!(t < infinite)) return;
        times_[body] = t;
        order_.insert({t, body});
    }
    [[nodiscard]] const std::set<std::pair<double, std::uint32_t>>& order() const { return order_; }

private:
    std::map<std::uint32_t, double> times_;
    std::set<std::pair<double, std::uint32_t>> order_;
};

TEST(EventQueues, HaveTheOrderOfASortedSet)
{
    constexpr std::uint32_t count = 500;
    for (const bool ring : {false, true}) {
        // Intervals of all magnitudes to the next event, some equal, some zero, some infinite.
        std::mt19937 generator(11);
        std::uniform_real_distribution<double> uniform(0, 1);
        EventQueue calendar(count);
        for (int round = 0; round < 2; ++round) {
            calendar.clear(ring);
            EXPECT_TRUE(calendar.empty());
            Sorted sorted;
            double now = 0;
            const auto set = [&](std::uint32_t body) {
                const double kind = uniform(generator);
                double t = now + std::pow(10, 6 * uniform(generator) - 4);
                if (kind < 0.1) t = now;
                if (kind > 0.9) t = std::ceil(now + 1);
                if (kind > 0.99) t = infinite;
                calendar.set(body, {t, 0});
                sorted.set(body, t);
            };
            for (std::uint32_t i = 0; i < count; ++i) set(i);
            for (int k = 0; k < 20'000; ++k) {
                ASSERT_FALSE(calendar.empty());
                const auto [t, body] = *sorted.order().begin();
                ASSERT_EQ(calendar.first_time().value, t) << k;
                ASSERT_EQ(calendar.first(), body) << k;
                now = t;
                set(body);
                set(static_cast<std::uint32_t>(count * uniform(generator)));
                // Bodies without an entry may get one again.
                if (k % 100 == 0) set(static_cast<std::uint32_t>(count * uniform(generator)));
            }
            for (std::uint32_t i = 0; i < count; ++i) calendar.set(i, no_instant);
            EXPECT_TRUE(calendar.empty());
        }
    }
}

TEST(EventQueues, AreTheSameToTheBit)
{
    for (const std::size_t count : {3, 200}) {
        const Scene scene = test::gas({.count = count, .gravity = {0.1, -1}, .spread = 0.2});
        const SceneOptions options{.t_end = count == 3 ? 50.0 : 5.0};
        const SceneRun one = simulate(scene, options, {.ring_from = 1'000'000});
        EXPECT_GT(one.events.size(), 200U);
        expect_same(one, simulate(scene, options, {.ring_from = 0}));
    }
}

}  // namespace
}  // namespace ricochet::grid_test
