// Bodies with springs and drag: each island by its own steps, against `integrate` of one state.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <vector>

#include "ricochet/integrate.hpp"
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
    ids.reserve(discs.size());
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

TEST(Islands, ABodyThatCanMeetNothingTakesTheSameSteps)
{
    std::vector<double> times{0};
    for (int k = 1; k <= 300; ++k) times.push_back(0.1 * k);
    std::atomic<bool> cancelled = false;
    const auto run = [&](bool wall, double t_end) {
        Scene scene({.gravity = {0, -9.81}});
        if (wall) scene.wall({.point = {0, -1e6}, .normal = {0, 1}});
        scene.disc({.at = {0, 0}, .velocity = {3, 4}, .radius = 0.1, .drag = 0.1});
        return simulate(scene, {.t_end = t_end, .sample_times = times, .cancelled = &cancelled});
    };
    const SceneRun alone = run(false, 30);
    const SceneRun above = run(true, 30);
    EXPECT_EQ(alone.statistics.steps, above.statistics.steps);
    EXPECT_EQ(alone.bodies[0].at, above.bodies[0].at);
    ASSERT_EQ(alone.samples.size(), times.size());
    for (std::size_t k = 0; k < times.size(); ++k) {
        EXPECT_EQ(alone.samples[k][0].at, above.samples[k][0].at) << times[k];
        EXPECT_EQ(alone.samples[k][0].velocity, above.samples[k][0].velocity) << times[k];
    }
    times.clear();
    cancelled = true;
    EXPECT_EQ(run(false, 1e9).outcome, Outcome::cancelled);
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

TEST(Islands, StepsThatPassAnEndOfTerrainMeetItAsAFreeFlightDoes)
{
    // Drag that hardly acts allows steps which cross the line of a segment beyond its end, turn
    // round and come back to the segment, on either side.
    struct Flight {
        Vector2 gravity;
        Disc body;
        std::vector<Vector2> points;
    };
    const std::vector<Flight> flights{{{-3.3876206765772494, 3.0841810113600605},
                                       {.at = {1.615327156257834, 1.1712563319056377},
                                        .velocity = {2.6884990119899497, 1.4299585092965916},
                                        .radius = 0},
                                       {{2.7679533689938003, 3.863979841301556},
                                        {2.1972782510947675, 1.8134975702137925},
                                        {2.1129199415344262, 3.0413012038519258}}},
                                      {{1.5038562048824478, 2.3363130610427945},
                                       {.at = {-0.39121857, -3.71780347},
                                        .velocity = {-2.7856265, -1.0022458},
                                        .radius = 0.31127594353565141},
                                       {{-3.5900344996504092, 0.092126068675346229},
                                        {-2.3013968319426366, -1.5015171800186049},
                                        {-2.48967804276535, 1.8789432580658443}}}};
    for (const Flight& flight : flights) {
        const auto run = [&](double drag) {
            Scene scene({.gravity = flight.gravity});
            scene.terrain({.points = flight.points});
            Disc body = flight.body;
            body.drag = drag;
            body.radius > 0 ? scene.disc(body)
                            : scene.point({.at = body.at, .velocity = body.velocity, .drag = drag});
            return simulate(scene, {.t_end = 2});
        };
        const SceneRun free = run(0);
        const SceneRun stepped = run(1e-14);
        ASSERT_GE(free.events.size(), 1u);
        ASSERT_EQ(stepped.events.size(), free.events.size());
        for (std::size_t k = 0; k < free.events.size(); ++k) {
            EXPECT_NEAR(stepped.events[k].t, free.events[k].t, 1e-10);
            EXPECT_NEAR(stepped.events[k].impulse[0], free.events[k].impulse[0], 1e-8);
        }
    }
}

TEST(Islands, HopsGainNoEnergyByRounding)
{
    // Each hop is lower than the one before by the restitution, until the time resolves none.
    std::size_t runs = 0;
    for (const double restitution : {0.7, 0.8}) {
        for (int k = 1; k <= 100; ++k) {
            Scene scene({.gravity = {0, -10}});
            const auto felt = scene.material({.restitution = restitution, .friction = 0.5});
            const double floor = -k / 10.0;
            scene.wall({.point = {0, floor}, .normal = {k % 2 ? 1.0 : 0.0, 4}, .material = felt});
            scene.disc({.at = {0.3, floor + 1.5},
                        .velocity = {0.3, 0},
                        .radius = 0.1,
                        .drag = 1e-9,
                        .material = felt});
            const SceneRun run = simulate(scene, {.t_end = 20, .max_events = 2000});
            ASSERT_EQ(run.outcome, Outcome::zeno) << restitution << " " << floor;
            EXPECT_LT(run.events.size(), 400u);
            ++runs;
        }
    }
    EXPECT_EQ(runs, 200u);
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
