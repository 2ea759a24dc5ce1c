// An inclusion for each mode of an automaton, and guards that ask a reaction. Expected numbers are
// closed forms, and tolerances those of phased_runs.hpp.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "automata.hpp"
#include "phased_runs.hpp"
#include "refusal.hpp"

namespace ricochet::phases_by_mode_test {
namespace {

constexpr double tolerance = exact_motion;
constexpr double infinity = std::numeric_limits<double>::infinity();

using Two = std::array<double, 2>;
using Three = std::array<double, 3>;

// --- modes with inclusions of their own ---

/// A block between two belts: speed 1/2 until 1 m, then -1/2 until 0 m; friction 1.
[[nodiscard]] Automaton<2> two_belts()
{
    using Belts = Automaton<2>;
    const auto belt = [](Mode mode) { return mode == 0 ? 0.5 : -0.5; };
    GuardInfo rising, falling;
    rising.crossing = Crossing::rising;
    return {.own =
                [belt](Mode mode, double, const Two& x, Two& dxdt) {
                    dxdt = {x[1], x[1] >= belt(mode) ? -1.0 : 1.0};
                },
            .motion =
                [belt](Mode mode) {
                    return Belts::Motion{.f =
                                             [](double, const Two& x, Two& dxdt) {
                                                 dxdt = {x[1], 0};
                                             },
                                         .e = {{{0, 1}}},
                                         .lower = {-1},
                                         .upper = {1},
                                         .s = {belt(mode)}};
                },
            .transitions = {{rising,
                             [](Mode, double, const Two& x) { return x[0] - 1; },
                             [](Mode, double, Two&) -> Mode { return 1; },
                             {1}},
                            {falling,
                             [](Mode, double, const Two& x) { return x[0]; },
                             [](Mode, double, Two&) -> Mode { return 0; },
                             {0}}}};
}

TEST(PhasesByMode, ABlockIsCarriedToAndFroByTwoBelts)
{
    const auto run = run_of(two_belts(), Two{0, 0.5}, until(10));
    expect_end(run, Two{0.5, -0.5});
    expect_times(times_at(run.events, 0, EventKind::crossing), {2, 8});
    expect_times(times_at(run.events, 1, EventKind::crossing), {5});
    expect_times(times_of(run.events, EventKind::stick), {3, 6, 9});
    EXPECT_TRUE(times_of(run.events, EventKind::slip).empty());
    EXPECT_EQ(run.mode, 1U);
}

/// Speed and way of a block under the load 1/2. The brake, of at most 1, is off from 1 to 2 s.
[[nodiscard]] Automaton<2> brake()
{
    using Brake = Automaton<2>;
    enum : Mode { on, off };
    const auto load = [](double, const Two& x, Two& dxdt) { dxdt = {0.5, x[0]}; };
    return {.own =
                [load](Mode mode, double t, const Two& x, Two& dxdt) {
                    load(t, x, dxdt);
                    if (mode == on) dxdt[0] -= x[0] >= 0 ? 1 : -1;
                },
            .motion = [load](Mode mode) -> std::optional<Brake::Motion> {
                if (mode == off) return std::nullopt;
                return Brake::Motion{.f = load, .e = {{{1, 0}}}, .lower = {-1}, .upper = {1}};
            },
            .next = at_times({1, 2}),
            .tick = [](Mode, double t, Two&) -> Mode { return t < 1.5 ? off : on; }};
}

TEST(PhasesByMode, AModeWithoutAnInclusionFollowsItsOwnFlow)
{
    const auto run = run_of(brake(), Two{0, 0}, until(4));
    expect_end(run, Two{0, 0.5});
    expect_times(times_of(run.events, EventKind::stick), {3});
    EXPECT_TRUE(times_of(run.events, EventKind::slip).empty());
    expect_times(times_of(run.events, EventKind::time), {1, 2});
    Options sampled = until(4);
    sampled.sample_times = {2};
    EXPECT_NEAR(integrate(brake(), Two{0, 0}, sampled).trajectory.x[0][0], 0.5, tolerance);
}

// --- a ball that comes to rest and is lifted ---

/// Acceleration of the ball: -10, from 1 to 2 s growing to 10, then -10.
[[nodiscard]] double lift(double t)
{
    return t < 1 || t >= 2 ? -10 : -10 + 20 * (t - 1);
}
enum : Mode { flying, resting };

[[nodiscard]] GuardInfo the_floor(std::size_t reaction)
{
    GuardInfo info;
    info.name = "floor";
    info.unilateral = true;
    info.reaction = reaction;
    return info;
}

/// Height and speed of a ball of restitution 1/2, which rests in a mode of its own.
struct LiftedBall : Automaton<2> {
    [[nodiscard]] static Mode rest(std::size_t, Mode, double, State& x)
    {
        x = {0, 0};
        return resting;
    }
};
/// It leaves its rest by the reset of the slip.
struct ChangingBall : LiftedBall {
    [[nodiscard]] static Mode change(std::size_t, EventKind kind, Mode mode, double, State&)
    {
        return kind == EventKind::slip ? Mode{flying} : mode;
    }
};
/// It leaves its rest when its own flow is followed again.
struct StartingBall : LiftedBall {
    [[nodiscard]] static Mode start_mode(Mode, double, const State&) { return flying; }
};

template <class Ball>
[[nodiscard]] Ball lifted_ball()
{
    const auto fall = [](double t, const Two& x, Two& dxdt) { dxdt = {x[1], lift(t)}; };
    Ball ball;
    ball.own = [fall](Mode, double t, const Two& x, Two& dxdt) { fall(t, x, dxdt); };
    ball.motion = [fall](Mode mode) -> std::optional<typename Ball::Motion> {
        if (mode == flying) return std::nullopt;
        return typename Ball::Motion{.f = fall, .e = {{{0, 1}}}, .lower = {0}, .upper = {infinity}};
    };
    ball.transitions = {{the_floor(0), [](Mode, double, const Two& x) { return x[0]; },
                         [](Mode mode, double, Two& x) {
                             x = {0, -0.5 * x[1]};
                             return mode;
                         }}};
    ball.next = at_times({1, 2});
    return ball;
}

template <class Ball>
void expect_rest_and_flight()
{
    const Ball ball = lifted_ball<Ball>();
    const auto run = run_of(ball, Two{0.2, 0}, until(2.6));
    expect_end(run, Two{7.0 / 60, 2.5 - 6});
    const auto rests = times_of(run.events, EventKind::accumulation);
    ASSERT_EQ(rests.size(), 1U);
    EXPECT_NEAR(rests[0], 0.6, 1e-7);
    expect_times(times_of(run.events, EventKind::slip), {1.5});
    Options longer = until(2.64);
    longer.sample_times = {1.2, 2.25};
    const auto on = integrate(ball, Two{0.2, 0}, longer);
    ASSERT_EQ(on.trajectory.x.size(), 2U);
    EXPECT_NEAR(on.trajectory.x[0][0], 0, tolerance);
    EXPECT_NEAR(on.trajectory.x[1][0], 35.0 / 48, tolerance);
    EXPECT_NEAR(times_at(on.events, 0, EventKind::crossing).back(), 2.25 + std::sqrt(35.0 / 240),
                tolerance);
}

TEST(PhasesByMode, ABallComesToRestAndIsLiftedByTheResetOfItsSlip)
{
    expect_rest_and_flight<ChangingBall>();
}
TEST(PhasesByMode, ABallComesToRestAndFliesInTheModeOfItsStart)
{
    expect_rest_and_flight<StartingBall>();
}

/// The same ball, and beside it the speed of a block with friction 1.
struct BallAndBlock : Automaton<3, 2> {
    [[nodiscard]] static Mode rest(std::size_t, Mode, double, State& x)
    {
        x[0] = x[1] = 0;
        return resting;
    }
    [[nodiscard]] static Mode change(std::size_t k, EventKind kind, Mode mode, double, State&)
    {
        return k == 1 && kind == EventKind::slip ? Mode{flying} : mode;
    }
};

[[nodiscard]] BallAndBlock ball_and_block()
{
    const auto fall = [](double t, const Three& x, Three& dxdt) { dxdt = {x[1], lift(t), 0}; };
    BallAndBlock out;
    out.own = [fall](Mode, double t, const Three& x, Three& dxdt) {
        fall(t, x, dxdt);
        dxdt[2] = x[2] >= 0 ? -1 : 1;
    };
    out.motion = [fall](Mode mode) -> std::optional<BallAndBlock::Motion> {
        return BallAndBlock::Motion{.f = fall,
                                    .e = {{{0, 0, 1}, {0, 1, 0}}},
                                    .lower = {-1, 0},
                                    .upper = {1, mode == flying ? 0 : infinity}};
    };
    out.transitions = {{the_floor(1), [](Mode, double, const Three& x) { return x[0]; },
                        [](Mode mode, double, Three& x) {
                            x[0] = 0;
                            x[1] *= -0.5;
                            return mode;
                        }}};
    out.next = at_times({1, 2});
    return out;
}

TEST(PhasesByMode, ABallComesToRestWhileABlockIsHeld)
{
    const auto run = run_of(ball_and_block(), Three{0.2, 0, 0.1}, until(2.6));
    expect_end(run, Three{7.0 / 60, 2.5 - 6, 0});
    expect_times(times_of(run.events, EventKind::stick), {0.1});
    expect_times(times_of(run.events, EventKind::slip), {1.5});
    EXPECT_TRUE(times_of(run.events, EventKind::mode).empty());
    EXPECT_EQ(times_of(run.events, EventKind::accumulation).size(), 1U);
}

// --- one inclusion, and guards that ask ---

/// A ball that does not bounce, pulled down by 1 until 2 s and up after it.
struct DeadBall {
    using State = Two;
    std::size_t reaction = 0;

    [[nodiscard]] static double pull(double t) { return t < 2 ? -1 : 1; }
    static void flow(double t, const State& x, State& dxdt) { dxdt = {x[1], pull(t)}; }
    [[nodiscard]] static double guard(double, const State& x) { return x[0]; }
    [[nodiscard]] GuardInfo guard_info() const { return the_floor(reaction); }
    static void reset(double, State& x) { x = {0, 0}; }
    [[nodiscard]] static double next_time_event(double t) { return t < 2 ? 2 : infinity; }
    [[nodiscard]] static BoxMotion<2, 1> set_valued()
    {
        return {.f = flow, .e = {{{0, 1}}}, .lower = {0}, .upper = {infinity}};
    }
};

TEST(PhasesByMode, AGuardAsksItsReactionWhereAResetLeavesItAtRest)
{
    const auto run = run_of(DeadBall{}, Two{1.125, 0}, until(3));
    expect_end(run, Two{0.5, 1});
    expect_times(times_at(run.events, 0, EventKind::crossing), {1.5});
    expect_times(times_of(run.events, EventKind::stick), {1.5});
    expect_times(times_of(run.events, EventKind::slip), {2});
    ASSERT_GE(run.phases.size(), 2U);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::held);
}

/// The brake with one inclusion for both modes. Its guard, the speed, is off when the brake is.
struct GuardedBrake : Automaton<2> {
    static constexpr bool disabled_guards_end_it = true;
    void set_valued(Mode) const = delete;
    [[nodiscard]] Motion set_valued() const { return *motion(0); }
    [[nodiscard]] static Mode start_mode(Mode mode, double, const Two&) { return mode; }
};

TEST(PhasesByMode, AReactionWhoseGuardsAreDisabledIsInactive)
{
    GuardInfo speed;
    speed.crossing = Crossing::either;
    speed.resets = false;
    GuardedBrake system{brake()};
    system.transitions = {{speed, [](Mode, double, const Two& x) { return x[0]; }, {}, {1}}};
    const auto run = run_of(system, Two{0, 0}, until(4));
    expect_end(run, Two{0, 0.5});
    expect_times(times_at(run.events, 0, EventKind::stick), {3});
}

TEST(PhasesByMode, ASnapshotOfAModeWithAnInclusionIsRestoredInOneWithout)
{
    const Options options = until(4);
    const auto system = brake();
    Simulation whole(system, Two{0, 0}, options);
    std::vector<Snapshot> saved{whole.save()};
    std::vector<Mode> modes{whole.mode()};
    while (whole.step()) {
        saved.push_back(whole.save());
        modes.push_back(whole.mode());
    }
    ASSERT_NE(std::count(modes.begin(), modes.end(), modes.front()),
              static_cast<std::ptrdiff_t>(modes.size()));
    // Into a simulation at its start and into one at its end, which is in the other mode or not.
    for (const Snapshot& snapshot : saved) {
        Simulation fresh(system, Two{0, 0}, options);
        fresh.restore(snapshot);
        while (fresh.step()) {
        }
        EXPECT_EQ(fresh.x(), whole.x());
        fresh.restore(snapshot);
        while (fresh.step()) {
        }
        EXPECT_EQ(fresh.x(), whole.x());
    }
}

// --- bad input ---

TEST(PhasesByMode, AReactionThatTheInclusionDoesNotHaveIsRefused)
{
    EXPECT_EQ(refusal([] {
                  (void)integrate(DeadBall{.reaction = 1}, Two{1, 0}, until(1));
              }),
              "integrate: guard 0 has reaction 1; expected one below 1, the number of reactions "
              "of set_valued()");
}

TEST(PhasesByMode, ModesWithoutAnyInclusionAreRefused)
{
    Automaton<2> system = brake();
    system.motion = [](Mode) { return std::nullopt; };
    EXPECT_EQ(refusal([&] {
                  (void)integrate(system, Two{0, 0}, until(1));
              }),
              "integrate: set_valued(mode) gives no mode an inclusion; expected it to give one to "
              "some");
}

TEST(PhasesByMode, AStartThatContradictsTheInclusionOfItsModeIsRefused)
{
    const ChangingBall ball = lifted_ball<ChangingBall>();
    Options options = until(1);
    options.mode = resting;
    EXPECT_EQ(refusal([&] {
                  (void)integrate(ball, Two{0.2, -1}, options);
              }),
              "integrate: at the start in mode 1 y of reaction 0 is -1, where the reaction has no "
              "bound");
}

TEST(PhasesByMode, AModeWhoseInclusionIsContradictedEndsTheRunWithASentence)
{
    ChangingBall ball = lifted_ball<ChangingBall>();
    ball.tick = [](Mode, double, Two&) -> Mode { return resting; };
    const auto run = run_of(ball, Two{10, 0}, until(3));
    EXPECT_EQ(run.outcome, Outcome::not_handed_over);
    EXPECT_NEAR(run.t, 1, tolerance);
    EXPECT_EQ(run.reason, "in mode 1 y of reaction 0 is -10, where the reaction has no bound");
}

TEST(PhasesByMode, AChangeThatReturnsAnUnknownModeEndsTheRun)
{
    struct Lost : LiftedBall {
        [[nodiscard]] static Mode change(std::size_t, EventKind, Mode, double, Two&) { return 7; }
    };
    const auto run = run_of(lifted_ball<Lost>(), Two{0.2, 0}, until(2.6));
    EXPECT_EQ(run.outcome, Outcome::unknown_mode);
    EXPECT_NEAR(run.t, 1.5, tolerance);
}

/// Two reactions, of which the guards of one alone are disabled in mode 1.
struct PartlyActive : Automaton<2, 2> {
    void set_valued(Mode) const = delete;
    [[nodiscard]] Motion set_valued() const { return *motion(0); }
    [[nodiscard]] static Mode start_mode(Mode mode, double, const Two&) { return mode; }
};

TEST(PhasesByMode, AModeWithSomeReactionsInactiveIsRefused)
{
    GuardInfo speed;
    speed.crossing = Crossing::either;
    speed.resets = false;
    const auto still = [](double, const Two&, Two& dxdt) { dxdt = {0, 0}; };
    PartlyActive system;
    system.own = [](Mode, double, const Two& x, Two& dxdt) {
        dxdt = {x[0] >= 0 ? -1.0 : 1.0, x[1] >= 0 ? -1.0 : 1.0};
    };
    system.motion = [still](Mode) {
        return PartlyActive::Motion{
            .f = still, .e = {{{1, 0}, {0, 1}}}, .lower = {-1, -1}, .upper = {1, 1}};
    };
    system.transitions = {{speed, [](Mode, double, const Two& x) { return x[0]; }, {}, {1}},
                          {speed, [](Mode, double, const Two& x) { return x[1]; }, {}, {}}};
    EXPECT_EQ(refusal([&] {
                  (void)integrate(system, Two{1, 1}, until(1));
              }),
              "integrate: all guards of reaction 0 are disabled in mode 1, those of others are "
              "not; expected set_valued(mode), an inclusion for each mode");
}

}  // namespace
}  // namespace ricochet::phases_by_mode_test
