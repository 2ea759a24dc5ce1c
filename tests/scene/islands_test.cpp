// Bodies with springs and drag: each island by its own steps, against `integrate` of one state.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "ricochet/integrate/integrate.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::islands_test {
namespace {

/// Two dumbbells that fly at each other: x, y, x', y' of four discs, all pairs of different
/// dumbbells as guards, elastic.
struct Dumbbells {
    using State = std::vector<double>;
    static constexpr std::size_t guard_count = 4;
    double stiff = 0, soft = 0, radius = 0;

    static std::array<std::size_t, 2> pair(std::size_t which) { return {which / 2, 2 + which % 2}; }
    void flow(double, const State& x, State& rate) const
    {
        for (std::size_t i = 0; i < 16; i += 4) {
            rate[i] = x[i + 2];
            rate[i + 1] = x[i + 3];
            rate[i + 2] = rate[i + 3] = 0;
        }
        for (const std::size_t a : {std::size_t{0}, std::size_t{8}}) {
            const double dx = x[a + 4] - x[a];
            const double dy = x[a + 5] - x[a + 1];
            const double length = std::hypot(dx, dy);
            const double pull = (a == 0 ? stiff : soft) * (length - 1) / length;
            rate[a + 2] += pull * dx;
            rate[a + 3] += pull * dy;
            rate[a + 6] -= pull * dx;
            rate[a + 7] -= pull * dy;
        }
    }
    double guard(std::size_t which, double, const State& x) const
    {
        const auto [a, b] = pair(which);
        return std::hypot(x[4 * a] - x[4 * b], x[4 * a + 1] - x[4 * b + 1]) - 2 * radius;
    }
    void reset(std::size_t which, double, State& x) const
    {
        const auto [i, j] = pair(which);
        const std::size_t a = 4 * i;
        const std::size_t b = 4 * j;
        const double dx = x[a] - x[b];
        const double dy = x[a + 1] - x[b + 1];
        const double u =
            ((x[a + 2] - x[b + 2]) * dx + (x[a + 3] - x[b + 3]) * dy) / (dx * dx + dy * dy);
        x[a + 2] -= u * dx;
        x[a + 3] -= u * dy;
        x[b + 2] += u * dx;
        x[b + 3] += u * dy;
    }
};

TEST(Islands, DumbbellsWithOwnStepsStrikeAsInOneState)
{
    // Both at a relative tolerance of 1e-11: the first impacts agree to some hundred times that.
    const double radius = 0.2;
    Scene scene;
    const std::array<Disc, 4> discs{{{.at = {0, 0}, .velocity = {1, 0.3}, .radius = radius},
                                     {.at = {0.1, 1.1}, .velocity = {1, -0.2}, .radius = radius},
                                     {.at = {3, 0.2}, .velocity = {-1, 0.1}, .radius = radius},
                                     {.at = {3, 1.0}, .velocity = {-0.5, 0}, .radius = radius}}};
    std::vector<BodyId> ids;
    for (const Disc& disc : discs) ids.push_back(scene.disc(disc));
    scene.spring({.between = {ids[0], ids[1]}, .rest = 1, .stiffness = 1000});
    scene.spring({.between = {ids[2], ids[3]}, .rest = 1, .stiffness = 20});
    const SceneRun run = simulate(scene, {.t_end = 3, .rtol = 1e-11, .atol = 1e-12});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;

    Dumbbells::State x0;
    for (const Disc& d : discs)
        x0.insert(x0.end(), {d.at[0], d.at[1], d.velocity[0], d.velocity[1]});
    const auto whole =
        integrate(Dumbbells{1000, 20, radius}, x0, {.t_end = 3, .rtol = 1e-11, .atol = 1e-12});
    ASSERT_EQ(run.events.size(), whole.events.size());
    ASSERT_GE(run.events.size(), 1u);
    for (std::size_t k = 0; k < run.events.size(); ++k) {
        EXPECT_NEAR(run.events[k].t, whole.events[k].t, 1e-8);
    }
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_NEAR(run.bodies[i].at[0], whole.x[4 * i], 1e-7);
        EXPECT_NEAR(run.bodies[i].velocity[1], whole.x[4 * i + 3], 1e-6);
    }
    EXPECT_NEAR(run.events[0].t, whole.events[0].t, 1e-10);
}

TEST(Islands, DragSlowsAsInTheClosedForm)
{
    // v = v0 exp(-t c/m), x = v0 m/c (1 - exp(-t c/m)); the wall at 1.5 + radius is met when
    // exp(-t/2) = 1 - 1.5 / 2.
    Scene scene;
    scene.wall({.name = "wall", .point = {1.7, 0}, .normal = {-1, 0}});
    scene.disc({.at = {0, 0}, .velocity = {1, 0}, .radius = 0.2, .mass = 2, .drag = 1});
    const SceneRun run = simulate(scene, {.t_end = 4, .rtol = 1e-10, .sample_times = {1.0}});
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, 2 * std::log(4.0), 1e-9);
    EXPECT_NEAR(run.events[0].after[0][0], -0.25, 1e-9);
    EXPECT_NEAR(run.samples[0][0].at[0], 2 * (1 - std::exp(-0.5)), 1e-9);
}

TEST(Islands, AnIslandTakesTheSameStepsWhateverElseMoves)
{
    const auto build = [](bool others) {
        Scene scene;
        const BodyId a = scene.disc({.at = {0, 0}, .velocity = {0, 1}, .radius = 0.1});
        const BodyId b = scene.disc({.at = {1, 0}, .velocity = {0, -1}, .radius = 0.1});
        scene.spring({.between = {a, b}, .rest = 0.8, .stiffness = 50});
        if (others) {
            const BodyId c = scene.disc({.at = {9, 0}, .velocity = {0, 5}, .radius = 0.1});
            const BodyId d = scene.disc({.at = {10, 0}, .velocity = {0, -5}, .radius = 0.1});
            scene.spring({.between = {c, d}, .rest = 1, .stiffness = 1e5});
            for (int i = 0; i < 5; ++i) scene.disc({.at = {6, 3.0 * i}, .radius = 0.5});
        }
        return scene;
    };
    const SceneRun alone = simulate(build(false), {.t_end = 5});
    const SceneRun among = simulate(build(true), {.t_end = 5});
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(alone.bodies[i].at, among.bodies[i].at);
        EXPECT_EQ(alone.bodies[i].velocity, among.bodies[i].velocity);
    }
}

TEST(Islands, DragThatIsTooStiffEndsTheRunInASentence)
{
    for (const double drag : {1e9, 1e12}) {
        Scene scene({.gravity = {0, -9.81}});
        scene.disc({.name = "feather", .at = {0, 0}, .drag = drag});
        const SceneRun run = simulate(scene, {.t_end = 100});
        EXPECT_EQ(run.outcome, Outcome::stalled);
        EXPECT_LT(run.statistics.steps, 2000U);
        EXPECT_EQ(
            run.message,
            "the steps of the island of feather are shorter than 1e-8 of the run: its drag or "
            "a spring is too stiff for the method");
    }
    // A spring ten thousand times as stiff as usual does not cost more than its steps.
    Scene scene({.gravity = {0, -9.81}});
    scene.disc({.at = {0, 0}, .drag = 1e4});
    const SceneRun run = simulate(scene, {.t_end = 10});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    // Where drag and weight balance it sinks at g / drag, within the tolerance of 1e-8.
    EXPECT_NEAR(run.bodies[0].velocity[1], -9.81e-4, 1e-8);
}

}  // namespace
}  // namespace ricochet::islands_test
