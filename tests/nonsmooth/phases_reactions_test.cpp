// Reactions of runs with phases: at the sample times, at the end and while a simulation goes on.
// Expected numbers are closed forms. In branches, and where both sides of a law are at a bound,
// they are exact but for the rounding of the state; implicit stages are solved to 1e-12 of the
// forces, so that 1e-9 holds all of them.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "phased_runs.hpp"

namespace ricochet::phases_reactions_test {
namespace {

using One = std::array<double, 1>;
using Two = std::array<double, 2>;
using Row = std::vector<double>;

void expect_row(const Row& found, const Row& expected, double error = exact_motion)
{
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
        if (std::isnan(expected[i])) {
            EXPECT_TRUE(std::isnan(found[i])) << i;
        } else {
            EXPECT_NEAR(found[i], expected[i], error) << i;
        }
    }
}
template <class Run>
void expect_rows(const Run& run, const std::vector<Row>& expected, double error = exact_motion)
{
    ASSERT_EQ(run.trajectory.t.size(), expected.size());
    ASSERT_EQ(run.reactions.size(), expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) {
        SCOPED_TRACE(run.trajectory.t[k]);
        expect_row(run.reactions[k], expected[k], error);
    }
}

[[nodiscard]] Options sampled(double t_end, std::vector<double> times)
{
    Options options = until(t_end);
    options.sample_times = std::move(times);
    return options;
}

/// w' = t - 3 Sgn w: it stops at 3 - 2 sqrt 2 from w = 0.5, and slips at 3.
[[nodiscard]] Slider<1> under_growing_load()
{
    return {.f = [](double t, const One&, One& dxdt) { dxdt = {t}; }, .friction = 3};
}

// --- at sample times ---

TEST(Reactions, AreTheBoundInOwnPhasesAndTheLoadInBranches)
{
    const double stop = 3 - std::sqrt(8.0);
    Slider<1> system = under_growing_load();
    const auto times = std::vector{0.0, 0.1, 0.2, 2.05, 3.5, 6.0};
    const std::vector<Row> expected{{-3}, {-3}, {-0.2}, {-2.05}, {-3}, {-3}};
    const auto run = integrate(system, {0.5}, sampled(6, times));
    expect_end(run, One{4.5});
    expect_times(times_of(run.events, EventKind::stick), {stop});
    expect_rows(run, expected);
    expect_row(run.reaction, {-3});
    // Ticks that do nothing change nothing.
    system.next = [](double t) { return (std::floor(10 * t + 1e-9) + 1) / 10; };
    expect_rows(integrate(system, {0.5}, sampled(6, times)), expected);
}

TEST(Reactions, AtAnEventAreThoseAfterIt)
{
    // The block stops at 0.5, and a tick at 1 throws it to the other side.
    Slider<1> system{.f = [](double, const One&, One& dxdt) { dxdt = {0.5}; }};
    system.next = at_times({1});
    system.kick = [](double, One& x) { x[0] = -1; };
    const auto run = integrate(system, {0.25}, sampled(1.5, {0.25, 0.5, 0.75, 1, 1.25}));
    expect_times(times_of(run.events, EventKind::stick), {0.5});
    expect_rows(run, {{-1}, {-0.5}, {-0.5}, {1}, {1}});
}

TEST(Reactions, OfAStartAtRestAreThoseThatHold)
{
    const Slider<1> system{.f = [](double, const One&, One& dxdt) { dxdt = {0.5}; }};
    expect_rows(integrate(system, {0}, sampled(1, {0, 1})), {{-0.5}, {-0.5}});
}

TEST(Reactions, ThatDependOnOneAnotherAreTheLeastInTheSet)
{
    // Loads up to 2 are shared equally; the bound of the first is 1, that of the second 3.
    const auto run = integrate(TwoContacts{}, {0.0}, sampled(6, {0, 1, 2, 3, 3.5, 5}));
    expect_rows(run, {{0, 0}, {-0.5, -0.5}, {-1, -1}, {-1, -2}, {-1, -2.5}, {-1, -3}});
    expect_row(run.reaction, {-1, -3});
}

/// A disc that slides, and stops at 1.
struct Disc {
    using State = Two;
    struct Motion {
        static constexpr int state_size = 2, reaction_size = 2;
        static void smooth(double, const Eigen::Vector2d&, Eigen::Vector2d& f) { f.setZero(); }
        static sets::Ball<2> reaction_set(double, const Eigen::Vector2d&)
        {
            return sets::Ball<2>(1);
        }
    };
    static void flow(double, const State&, State& dxdt) { dxdt = {0, 0}; }
    static Motion set_valued() { return {}; }
};

TEST(Reactions, OfADiscPointAgainstItsSpeed)
{
    const auto run = integrate(Disc{}, Two{0.6, 0.8}, sampled(2, {0, 0.5, 1.5}));
    expect_rows(run, {{-0.6, -0.8}, {-0.6, -0.8}, {0, 0}});
}

// --- of an inclusion alone ---

template <class System>
void expect_reactions(const System& system, const StateOf<System>& w0, std::vector<double> times,
                      const std::vector<Row>& expected)
{
    const double t_end = times.back();
    const auto run = hand_over(system, w0, {.t_end = t_end, .sample_times = std::move(times)});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.trajectory.t.size(), expected.size());
    ASSERT_EQ(run.reactions.size(), expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) {
        SCOPED_TRACE(run.trajectory.t[k]);
        expect_row(run.reactions[k], expected[k]);
    }
}

/// w' = t - 3 Sgn w, as a set without branches.
struct GrowingLoadBySteps {
    static constexpr int state_size = 1, reaction_size = 1;
    using Vector = Eigen::Matrix<double, 1, 1>;
    static void smooth(double t, const Vector&, Vector& f) { f[0] = t; }
    static sets::Ball<1> reaction_set(double, const Vector&) { return sets::Ball<1>(3); }
};

TEST(Reactions, OfAnInclusionAloneAreThoseOfItsSamples)
{
    const auto times = std::vector{0.0, 0.1, 0.2, 2.05, 3.5, 6.0};
    const std::vector<Row> expected{{-3}, {-3}, {-0.2}, {-2.05}, {-3}, {-3}};
    const Slider<1> system = under_growing_load();
    expect_reactions(system.set_valued(), GrowingLoadBySteps::Vector(0.5), times, expected);
    expect_reactions(GrowingLoadBySteps{}, GrowingLoadBySteps::Vector(0.5), times, expected);
}

/// Five contacts, of which the last has the bounds 3 and the others 1, hold one body under the load
/// t.
struct FiveContacts {
    static constexpr int state_size = Eigen::Dynamic, reaction_size = Eigen::Dynamic;

    struct Friction {
        [[nodiscard]] static std::size_t dimension() { return 5; }
        [[nodiscard]] static double lower(std::size_t i) { return -upper(i); }
        [[nodiscard]] static double upper(std::size_t i) { return i == 4 ? 3 : 1; }
        void project(std::span<const double> z, std::span<double> p) const
        {
            detail::clamp(*this, z, p);
        }
        void derivative(std::span<const double> z, std::span<double> d) const
        {
            detail::clamp_derivative(*this, z, d);
        }
    };
    [[nodiscard]] static int size() { return 1; }
    [[nodiscard]] static int reactions() { return 5; }
    static void smooth(double t, const Eigen::VectorXd&, Eigen::VectorXd& f)
    {
        f.setConstant(1, t);
    }
    static void observe(Eigen::MatrixXd& e) { e.setOnes(5, 1); }
    static void act(Eigen::MatrixXd& g) { g.setOnes(1, 5); }
    [[nodiscard]] static Friction reaction_set(double, const Eigen::VectorXd&) { return {}; }
};

TEST(Reactions, OfAnInclusionAloneThatDependOnOneAnotherAreTheLeast)
{
    expect_reactions(TwoContacts::Motion{}, TwoContacts::Motion::Vector(0.0), {0, 1, 2, 3, 3.5, 5},
                     {{0, 0}, {-0.5, -0.5}, {-1, -1}, {-1, -2}, {-1, -2.5}, {-1, -3}});
    expect_reactions(FiveContacts{}, Eigen::VectorXd::Zero(1), {0, 1, 6, 8},
                     {{0, 0, 0, 0, 0},
                      {-0.2, -0.2, -0.2, -0.2, -0.2},
                      {-1, -1, -1, -1, -2},
                      {-1, -1, -1, -1, -3}});
}

// --- modes without an inclusion, and states without a reaction ---

/// The ball of phases.md: it rests from 0.6 to 1.5.
struct LiftedBall {
    using State = Two;  // height, speed
    enum : Mode { flying, resting };
    static constexpr std::size_t mode_count = 2;

    static double pull(double t) { return t < 1 ? -10 : -10 + 20 * (t - 1); }
    static void flow(Mode, double t, const State& x, State& dxdt) { dxdt = {x[1], pull(t)}; }
    static double guard(Mode, double, const State& x) { return x[0]; }
    static GuardInfo guard_info() { return {.unilateral = true, .reaction = 0}; }
    static Mode reset(Mode mode, double, State& x)
    {
        x = {0, -0.5 * x[1]};
        return mode;
    }
    static Mode rest(Mode, double, State& x)
    {
        x = {0, 0};
        return resting;
    }
    static double next_time_event(double t) { return t < 1 ? 1 : INFINITY; }

    struct Floor {
        static constexpr int state_size = 2, reaction_size = 1;
        static void smooth(double t, const Eigen::Vector2d& w, Eigen::Vector2d& f)
        {
            f << w[1], pull(t);
        }
        static void observe(Eigen::Matrix<double, 1, 2>& e) { e << 0, 1; }
        static sets::IntervalSet reaction_set(double, const Eigen::Vector2d&)
        {
            return sets::IntervalSet::half_line();
        }
    };
    static std::optional<Floor> set_valued(Mode mode)
    {
        return mode == resting ? std::optional<Floor>(Floor{}) : std::nullopt;
    }
    static Mode change(std::size_t, EventKind kind, Mode mode, double, State&)
    {
        return kind == EventKind::slip ? Mode{flying} : mode;
    }
};

TEST(Reactions, AreEmptyWhereTheModeHasNoInclusion)
{
    const auto run = integrate(LiftedBall{}, {0.2, 0}, sampled(2, {0.1, 0.8, 1, 1.25, 1.75}));
    expect_rows(run, {{}, {10}, {10}, {5}, {}});
    EXPECT_TRUE(run.reaction.empty());
}

/// A speed that a floor bounds from below: it has no bound to go to where it falls.
struct Falling {
    using State = One;
    struct Motion {
        static constexpr int state_size = 1, reaction_size = 1;
        using Vector = Eigen::Matrix<double, 1, 1>;
        static void smooth(double, const Vector&, Vector& f) { f << -1; }
        static sets::IntervalSet reaction_set(double, const Vector&)
        {
            return sets::IntervalSet::half_line();
        }
    };
    static void flow(double, const State&, State& dxdt) { dxdt = {-1}; }
    static Motion set_valued() { return {}; }
};

TEST(Reactions, AreNaNWhereTheReactionHasNoBound)
{
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const auto run = integrate(Falling{}, {1}, sampled(2, {0.5, 1.5}));
    expect_end(run, One{-1});
    expect_rows(run, {{0}, {nan}});
    expect_row(run.reaction, {nan});
}

// --- simulations ---

template <class System, class X>
void expect_the_same_after_snapshots(const System& system, const X& x0, const Options& options)
{
    Simulation simulation(system, x0, options);
    for (int steps = 1; simulation.step(); ++steps) {
        if (steps % 10 != 0) continue;
        Simulation restored(system, x0, options);
        restored.restore(simulation.save());
        EXPECT_EQ(restored.reaction(), simulation.reaction()) << simulation.t();
    }
    Simulation restored(system, x0, options);
    restored.restore(simulation.save());
    EXPECT_EQ(restored.reaction(), simulation.reaction());
    EXPECT_EQ(restored.take().reaction, simulation.take().reaction);
}

TEST(Reactions, OfASimulationAreThoseOfItsSnapshots)
{
    expect_the_same_after_snapshots(under_growing_load(), One{0.5}, until(6));
    expect_the_same_after_snapshots(TwoContacts{}, One{0}, until(6));
}

TEST(Reactions, OfASimulationAreThoseAfterItsLastStep)
{
    const Slider<1> system = under_growing_load();
    Simulation simulation(system, {0.5}, until(6));
    expect_row(simulation.reaction(), {-3});
    while (simulation.step()) {
        const double t = simulation.t();
        const bool held = t > 3 - std::sqrt(8.0) - 1e-12 && t < 3;
        expect_row(simulation.reaction(), {held ? -t : -3});
    }
}

/// The contacts, and beside them a height that crosses a section at 2.3, inside a step.
struct ContactsAndSection {
    using State = Two;
    static constexpr bool resets = false;
    struct Motion {
        static constexpr int state_size = 2, reaction_size = 2;
        static void smooth(double t, const Eigen::Vector2d&, Eigen::Vector2d& f) { f << t, 1; }
        static void observe(Eigen::Matrix2d& e) { e << 1, 0, 1, 0; }
        static sets::Box<2> reaction_set(double, const Eigen::Vector2d&)
        {
            return sets::Box<2>({-1, -3}, {1, 3});
        }
    };
    static void flow(double t, const State& x, State& dxdt)
    {
        dxdt = {t - (x[0] >= 0 ? 4 : -4), 1};
    }
    static double guard(double, const State& x) { return x[1] - 2.3; }
    static GuardInfo guard_info() { return {.crossing = Crossing::either, .resets = false}; }
    static Motion set_valued() { return {}; }
};

TEST(Reactions, OfAdvanceAreThoseOfWhatItShows)
{
    Simulation simulation(ContactsAndSection{}, Two{0, 0}, sampled(3.5, {1, 2, 3}));
    std::vector<Row> rows;
    std::vector<double> times;
    while (simulation.advance()) {
        times.push_back(simulation.t());
        rows.push_back(simulation.reaction());
    }
    expect_times(times, {1, 2, 2.3, 3});
    ASSERT_EQ(rows.size(), 4U);
    expect_row(rows[0], {-0.5, -0.5});
    expect_row(rows[1], {-1, -1});
    expect_row(rows[2], {-1, -1.3});
    expect_row(rows[3], {-1, -2});
    const Slider<2> held{.f =
                             [](double t, const Two&, Two& dxdt) {
                                 dxdt = {t, 1};
                             },
                         .friction = 5,
                         .own = {{{.crossing = Crossing::either, .resets = false},
                                  [](double, const Two& x) { return x[1] - 2.3; }}}};
    Simulation in_branches(held, Two{0, 0}, until(4));
    ASSERT_TRUE(in_branches.advance());
    EXPECT_NEAR(in_branches.t(), 2.3, exact_motion);
    expect_row(in_branches.reaction(), {-2.3});
}

TEST(Reactions, AfterARestartAreThoseOfTheNewState)
{
    const Slider<1> system = under_growing_load();
    Simulation simulation(system, {0.5}, sampled(6, {0.1, 1, 2}));
    while (simulation.t() < 2.5) ASSERT_TRUE(simulation.step());
    ASSERT_EQ(simulation.run().reactions.size(), 3U);
    simulation.restart(1.5, {-1});
    EXPECT_EQ(simulation.run().reactions.size(), 2U);
    expect_row(simulation.reaction(), {3});
    // From -1 it stops at sqrt(2) - 3 + ..., before 2: (t + 3)^2 = 4.5^2 + 2.
    const auto run = simulation.take();
    expect_rows(run, {{-3}, {-1}, {-2}});
}

TEST(Reactions, WithoutSetValuedMotionThereAreNone)
{
    struct Clock {
        using State = One;
        static void flow(double, const State&, State& dxdt) { dxdt = {1}; }
    };
    const auto run = integrate(Clock{}, {0}, sampled(1, {0.5}));
    EXPECT_TRUE(run.reactions.empty() && run.reaction.empty() && run.phases.empty());
    EXPECT_TRUE(Simulation(Clock{}, {0}, until(1)).reaction().empty());
}

}  // namespace
}  // namespace ricochet::phases_reactions_test
