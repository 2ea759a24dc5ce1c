// Systems whose phases have closed forms: shortest sticks, laws without a guard, relays that act
// two integrations away. Tolerances as in phased_runs.hpp.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "automata.hpp"
#include "phased_runs.hpp"

namespace ricochet::phases_systems_test {
namespace {

using One = std::array<double, 1>;
using Two = std::array<double, 2>;

/// A system without modes, and without guards unless it is given one.
template <std::size_t N, int M>
struct Plain {
    using State = std::array<double, N>;
    using Motion = BoxMotion<static_cast<int>(N), M>;

    std::function<void(double t, const State& x, State& dxdt)> own;
    Motion motion;
    void flow(double t, const State& x, State& dxdt) const { own(t, x, dxdt); }
    [[nodiscard]] const Motion& set_valued() const { return motion; }
};

[[nodiscard]] double sign(double y)
{
    return y >= 0 ? 1 : -1;
}

[[nodiscard]] Plain<1, 1> block(std::function<double(double)> load)
{
    return {.own = [load](double t, const One& x, One& dxdt) { dxdt[0] = load(t) - sign(x[0]); },
            .motion = {.f = [load](double t, const One&, One& dxdt) { dxdt[0] = load(t); },
                       .e = {{{1}}},
                       .lower = {-1},
                       .upper = {1}}};
}

/// A block on the ground with friction 1/4 that a wall at 1 throws back elastically; no guard of
/// its own stands for its speed. State (position, velocity).
struct BlockAtWall {
    using State = std::array<double, 2>;
    static void flow(double, const State& x, State& dxdt)
    {
        dxdt = {x[1], x[1] > 0 ? -0.25 : 0.25};
    }
    static double guard(double, const State& x) { return 1 - x[0]; }
    static void reset(double, State& x) { x[1] = -x[1]; }
    [[nodiscard]] static BoxMotion<2, 1> set_valued()
    {
        return {.f =
                    [](double, const State& x, State& dxdt) {
                        dxdt = {x[1], 0};
                    },
                .e = {{{0, 1}}},
                .lower = {-0.25},
                .upper = {0.25}};
    }
};

TEST(PhasesSystems, ABlockThatAWallThrowsBackSlidesOn)
{
    // Speed 2 falls by 1/4 each second whatever its sign: at rest at 8, after 8 m, of which 1 m was
    // before the wall.
    for (const double h_max : {std::numeric_limits<double>::infinity(), 0.1}) {
        Options options = until(10);
        options.h_max = h_max;
        const auto run = run_of(BlockAtWall{}, BlockAtWall::State{0, 2}, options);
        expect_end(run, BlockAtWall::State{-6, 0});
        expect_times(times_of(run.events, EventKind::stick), {8});
    }
}

// w' = 2 t - 2 above zero: from 1 - d it reaches zero at 1 - sqrt(d), and slips at 1.
TEST(PhasesSystems, ASpeedThatGrazesZeroTouchesItOnce)
{
    const auto run = run_of(block([](double t) { return 2 * t - 1; }), One{1}, until(2));
    expect_end(run, One{1});
    // Rounding decides whether it is a touch, or a stick and a slip at one time.
    for (const auto& event : run.events) EXPECT_NEAR(event.t, 1, 1e-4);
    EXPECT_LE(run.events.size(), 2U);
}

TEST(PhasesSystems, ASpeedThatStaysOffZeroHasNoEvent)
{
    const auto run = run_of(block([](double t) { return 2 * t - 1; }), One{1 + 1e-6}, until(2));
    expect_end(run, One{1 + 1e-6});
    EXPECT_TRUE(run.events.empty());
}

TEST(PhasesSystems, ABlockStopsWithoutAGuard)
{
    const auto run = run_of(block([](double) { return 0; }), One{1}, until(2));
    expect_end(run, One{0}, 0);
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_EQ(run.events[0].kind, EventKind::stick);
    EXPECT_EQ(run.events[0].guard, no_guard);
    EXPECT_EQ(run.events[0].reaction, 0U);
    EXPECT_NEAR(run.events[0].t, 1, exact_motion);
}

TEST(PhasesSystems, TwoBlocksStickInOneSet)
{
    const auto still = [](double, const Two&, Two& dxdt) { dxdt = {0, 0}; };
    const Plain<2, 2> system{
        .own =
            [](double, const Two& x, Two& dxdt) {
                dxdt = {-sign(x[0]), -sign(x[1])};
            },
        .motion = {.f = still, .e = {{{1, 0}, {0, 1}}}, .lower = {-1, -1}, .upper = {1, 1}}};
    const auto run = run_of(system, Two{1, 1}, until(2));
    expect_end(run, Two{0, 0}, 0);
    ASSERT_EQ(run.events.size(), 2U);
    EXPECT_EQ(run.events[0].t, run.events[1].t);
    EXPECT_NEAR(run.events[0].t, 1, exact_motion);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(run.events[i].kind, EventKind::stick);
        EXPECT_EQ(run.events[i].reaction, i);
    }
}

/// x'' = -Sgn x, a relay that acts two integrations away: state (x, x').
struct Relay {
    using State = Two;
    static constexpr bool resets = false;
    struct Motion {
        static constexpr int state_size = 2, reaction_size = 1;
        static void smooth(double, const Eigen::Vector2d& w, Eigen::Vector2d& f) { f << w[1], 0; }
        static void act(Eigen::Vector2d& g) { g << 0, 1; }
        [[nodiscard]] static sets::Box<1> reaction_set(double, const Eigen::Vector2d&)
        {
            return sets::Box<1>({-1}, {1});
        }
    };
    static constexpr Crossing crossing = Crossing::either;
    static void flow(double, const State& x, State& dxdt) { dxdt = {x[1], -sign(x[0])}; }
    [[nodiscard]] static double guard(double, const State& x) { return x[0]; }
    [[nodiscard]] static Motion set_valued() { return {}; }
};

TEST(PhasesSystems, ARelayTwoIntegrationsAwaySwitchesAtItsCrossings)
{
    const double root = std::numbers::sqrt2;
    const auto run = run_of(Relay{}, Two{1, 0}, until(4 * root));
    expect_end(run, Two{1, 0});
    expect_times(times_of(run.events, EventKind::mode), {root, 3 * root});
}

/// The twisting controller, x'' = -2 Sgn x - Sgn x'.
struct Twisting {
    using State = Two;
    struct Motion {
        static constexpr int state_size = 2, reaction_size = 2;
        static void smooth(double, const Eigen::Vector2d& w, Eigen::Vector2d& f) { f << w[1], 0; }
        static void observe(Eigen::Matrix2d& e) { e.setIdentity(); }
        static void act(Eigen::Matrix2d& g) { g << 0, 0, 1, 1; }
        [[nodiscard]] static sets::Box<2> reaction_set(double, const Eigen::Vector2d&)
        {
            return sets::Box<2>({-2, -1}, {2, 1});
        }
    };
    static void flow(double, const State& x, State& dxdt)
    {
        dxdt = {x[1], -2 * sign(x[0]) - sign(x[1])};
    }
    [[nodiscard]] static Motion set_valued() { return {}; }
};

TEST(PhasesSystems, ATwistingControllerComesToRest)
{
    // Towards zero it accelerates by 1, away from it by 3: from the k-th turn it takes sqrt 2 /
    // 3^(k/2) to zero and a third of that to the next turn.
    const double root = std::numbers::sqrt2, ratio = 1 / std::sqrt(3.0);
    const auto run = run_of(Twisting{}, Two{1, 0}, until(7));
    expect_end(run, Two{0, 0}, 0);
    const auto turns = times_of(run.events, EventKind::mode);
    ASSERT_GT(turns.size(), 20U);
    for (std::size_t k = 0; k < 10; ++k) {
        const double turned = root * (4.0 / 3) * (1 - std::pow(ratio, k)) / (1 - ratio);
        EXPECT_NEAR(turns[2 * k], turned + root * std::pow(ratio, k), exact_motion) << k;
    }
    ASSERT_EQ(run.phases.size(), 2U);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::accumulation);
    EXPECT_NEAR(run.phases[1].from, root * (4.0 / 3) / (1 - ratio), 1e-8);
}

}  // namespace
}  // namespace ricochet::phases_systems_test
