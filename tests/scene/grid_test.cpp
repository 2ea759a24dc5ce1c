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
#include "scene/calendar.hpp"
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
    cells.size(0.5, 64, 64);
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
        Grid grid;
        grid.size(world, members, false);
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

TEST(Calendars, HaveTheOrderOfASortedSet)
{
    constexpr std::uint32_t count = 500;
    for (const bool ring : {false, true}) {
        // Intervals of all magnitudes to the next event, some equal, some zero, some infinite.
        std::mt19937 generator(11);
        std::uniform_real_distribution<double> uniform(0, 1);
        Calendar calendar(count);
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

TEST(Calendars, AreTheSameToTheBit)
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
