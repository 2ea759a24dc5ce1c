// The observer of a scene: every event, in order, with nothing kept.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <vector>

#include "ricochet/scene/simulate.hpp"
#include "scene/gas.hpp"

namespace ricochet::observer_test {
namespace {

TEST(Observer, SeesTheEventsOfARunInOrderWhichAreNotKept)
{
    const Scene scene = test::gas({.count = 60, .restitution = 0.9, .gravity = {0.2, -1}});
    const SceneRun kept = simulate(scene, {.t_end = 3});
    ASSERT_GT(kept.events.size(), 300U);
    std::vector<SceneEvent> seen;
    const SceneRun run = simulate(
        scene, {.t_end = 3, .record_events = false, .observe = [&](const SceneEvent& event) {
                    seen.push_back(event);
                }});
    EXPECT_TRUE(run.events.empty());
    EXPECT_EQ(run.statistics.events, kept.statistics.events);
    ASSERT_EQ(seen.size(), kept.events.size());
    for (std::size_t k = 0; k < seen.size(); ++k) {
        EXPECT_EQ(seen[k].t, kept.events[k].t) << k;
        EXPECT_EQ(seen[k].body, kept.events[k].body) << k;
        EXPECT_EQ(seen[k].after, kept.events[k].after) << k;
    }
}

TEST(Observer, SeesBodiesThatNeverMeetInTheOrderOfTime)
{
    Scene scene({.gravity = {0, -1}});
    scene.wall({.normal = {0, 1}});
    for (int i = 0; i < 5; ++i) {
        scene.disc({.at = {10.0 * i, 1.0 + 0.1 * i}, .radius = 0.1});
    }
    double last = 0;
    std::size_t count = 0;
    const auto look = [&](const SceneEvent& event) {
        EXPECT_GE(event.t, last);
        last = event.t;
        ++count;
        // The place is that below the centre, on the floor, up to the rounding of a flight of 2 m.
        EXPECT_NEAR(event.at[1], 0, 1e-14);
        EXPECT_NEAR(event.at[0], 10.0 * event.body, 1e-14);
        EXPECT_EQ(event.normal, (Vector2{0, 1}));
        EXPECT_NEAR(event.approach(), std::sqrt(2 * (0.9 + 0.1 * event.body)), 1e-12);
    };
    const SceneRun run = simulate(scene, {.t_end = 50, .record_events = false, .observe = look});
    EXPECT_EQ(count, run.statistics.impacts);
    EXPECT_GT(count, 60U);
}

TEST(Observer, SeesTheNormalTowardsTheBodyOfTheEvent)
{
    // The body with the lower index is on the right: it is pushed to the right, at the place
    // between the two.
    Scene scene;
    scene.disc({.at = {2, 0}, .radius = 0.5});
    scene.disc({.at = {0, 0}, .velocity = {3, 0}, .radius = 0.25});
    std::size_t count = 0;
    const auto look = [&](const SceneEvent& event) {
        ++count;
        EXPECT_EQ(event.body, 0U);
        EXPECT_EQ(event.normal, (Vector2{1, 0}));
        EXPECT_GT(event.impulse[0], 0);
        EXPECT_DOUBLE_EQ(event.approach(), 3);
        // Between the edges of both, the left one of the first body.
        EXPECT_NEAR(event.at[0], 1.5, 1e-14);
    };
    (void)simulate(scene, {.t_end = 2, .observe = look});
    EXPECT_EQ(count, 1U);
}

TEST(Observer, ThrowsThroughTheRun)
{
    const Scene scene = test::gas({.count = 10});
    const auto refuse = [](const SceneEvent&) { throw std::runtime_error("full"); };
    EXPECT_THROW((void)simulate(scene, {.t_end = 3, .observe = refuse}), std::runtime_error);
}

}  // namespace
}  // namespace ricochet::observer_test
