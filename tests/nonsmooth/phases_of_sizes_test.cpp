// Phases of runs whose solvers are those of other sizes, of a y that is a difference, and with laws
// that hold only where the motion rests. Tolerances as in phases_test.cpp.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "phased_runs.hpp"
#include "ricochet/ricochet.hpp"
#include "sliding_systems.hpp"

namespace ricochet::phases_of_sizes_test {
namespace {

constexpr double tolerance = 1e-9;
constexpr double infinity = std::numeric_limits<double>::infinity();

[[nodiscard]] Options until(double t_end)
{
    return {.t_end = t_end, .rtol = 1e-10, .atol = 1e-12};
}

[[nodiscard]] GuardInfo bounding()
{
    GuardInfo info;
    info.unilateral = true;
    return info;
}

/// The block and the ball of phases_test.cpp, and N - 3 components that stand still.
template <std::size_t N>
void expect_the_ball_beside_the_block()
{
    using X = std::array<double, N>;
    const Slider<N> system{.f =
                               [](double, const X& x, X& dxdt) {
                                   dxdt = {};
                                   dxdt[1] = x[2];
                                   dxdt[2] = -1;
                               },
                           .own = {{bounding(), [](double, const X& x) { return x[1]; },
                                    [](double, X& x) { x[2] = -x[2]; }}}};
    const X x0{1, 1.125, 0, 7};
    const auto run = integrate(system, x0, until(3));
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x[0], 0);
    EXPECT_NEAR(run.x[1], 1.125, tolerance);
    EXPECT_EQ(run.x[3], 7);
    ASSERT_EQ(run.events.size(), 2U);
    EXPECT_NEAR(run.events[0].t, 1, tolerance);
    EXPECT_NEAR(run.events[1].t, 1.5, tolerance);

    Simulation simulation(system, x0, until(3));
    while (simulation.step()) {
    }
    Simulation restored(system, x0, until(3));
    for (int steps = 1; restored.step(); ++steps) {
        const Snapshot saved = restored.save();
        restored.restore(saved);
    }
    EXPECT_EQ(restored.x(), simulation.x());
}

TEST(PhasesOfSizes, FourComponentsRunInALargerSolver)
{
    expect_the_ball_beside_the_block<4>();
}
TEST(PhasesOfSizes, FiveComponentsAreAVectorOfTheLoop)
{
    expect_the_ball_beside_the_block<5>();
}

/// Two blocks of mass 1 that rub on each other: y = w_0 - w_1. A time event sets both.
struct Pair {
    using State = std::array<double, 2>;
    struct Motion {
        static constexpr int state_size = 2;
        static constexpr int reaction_size = 1;
        static void smooth(double, const Eigen::Vector2d&, Eigen::Vector2d& f) { f.setZero(); }
        static void observe(Eigen::Matrix<double, 1, 2>& e) { e << 1, -1; }
        [[nodiscard]] static sets::Box<1> reaction_set(double, const Eigen::Vector2d&)
        {
            return sets::Box<1>({-1}, {1});
        }
    };
    static void flow(double, const State& x, State& dxdt)
    {
        const double force = x[0] >= x[1] ? 1 : -1;
        dxdt = {-force, force};
    }
    [[nodiscard]] static double next_time_event(double t) { return t < 1 ? 1 : infinity; }
    static void time_reset(double, State& x) { x = {0.3, 0.1 + 0.2}; }
    [[nodiscard]] static Motion set_valued() { return {}; }
};

TEST(PhasesOfSizes, AResetThatRoundingMovesOffZeroLeavesThePairHeld)
{
    const auto run = run_of(Pair{}, Pair::State{1, 0}, until(3));
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    const auto sticks = times_of(run.events, EventKind::stick);
    ASSERT_EQ(sticks.size(), 1U);
    EXPECT_NEAR(sticks[0], 0.5, tolerance);
    EXPECT_TRUE(times_of(run.events, EventKind::slip).empty());
    EXPECT_NEAR(run.x[0], 0.3, 1e-15);
    EXPECT_NEAR(run.x[1], 0.3, 1e-15);
}

/// A ball of restitution 1/2 whose speed a reaction of the floor holds when it rests.
struct RestingBall {
    using State = std::array<double, 2>;
    struct Motion {
        static constexpr int state_size = 2;
        static constexpr int reaction_size = 1;
        static void smooth(double, const Eigen::Vector2d& w, Eigen::Vector2d& f) { f << w[1], -1; }
        static void observe(Eigen::Matrix<double, 1, 2>& e) { e << 0, 1; }
        [[nodiscard]] static sets::Box<1> reaction_set(double, const Eigen::Vector2d&)
        {
            return sets::Box<1>({0}, {infinity});
        }
    };
    static void flow(double, const State& x, State& dxdt) { dxdt = {x[1], -1}; }
    [[nodiscard]] static double guard(double, const State& x) { return x[0]; }
    [[nodiscard]] static GuardInfo guard_info() { return bounding(); }
    static void reset(double, State& x) { x = {0, -0.5 * x[1]}; }
    [[nodiscard]] static Motion set_valued() { return {}; }
};

TEST(PhasesOfSizes, ABallRestsByAReactionThatIsNoneOfItsFlight)
{
    // It flies 1.5 s from 1.125 m, then 1.5, 0.75, ...: at rest from 4.5 s.
    const auto run = integrate(RestingBall{}, {1.125, 0}, until(6));
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 0, tolerance);
    EXPECT_EQ(run.x[1], 0);
    ASSERT_GE(run.phases.size(), 2U);
    EXPECT_TRUE(run.phases[1].set_valued);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::accumulation);
    EXPECT_NEAR(run.phases[1].from, 4.5, 1e-6);
    // The apex of the first flight after an impact is no rest: 9/32 m at 2.25 s.
    Options sampled = until(6);
    sampled.sample_times = {2.25};
    EXPECT_NEAR(integrate(RestingBall{}, {1.125, 0}, sampled).trajectory.x[0][0], 0.28125,
                tolerance);
}

/// The ball of phases_test.cpp, whose floor does not count from 1.4 to 1.6 s.
struct Vetoed : Slider<3> {
    [[nodiscard]] static bool enabled(std::size_t which, double t, const State&)
    {
        return which == 0 || t < 1.4 || t > 1.6;
    }
};

TEST(PhasesOfSizes, AVetoOfAnImpactOutlastsAStick)
{
    using X = Slider<3>::State;
    const Vetoed system{{.f =
                             [](double, const X& x, X& dxdt) {
                                 dxdt = {0, x[2], -1};
                             },
                         .own = {{bounding(), [](double, const X& x) { return x[1]; },
                                  [](double, X& x) { x[2] = -x[2]; }}}}};
    const auto run = run_of(system, X{2, 1.125, 0}, until(3));
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    const auto sticks = times_of(run.events, EventKind::stick);
    ASSERT_EQ(sticks.size(), 1U);
    EXPECT_NEAR(sticks[0], 2, tolerance);
    EXPECT_NEAR(run.x[1], -3.375, tolerance);
}

// It slips at 4: v(6) = 2. Implicit steps do not locate the slip; the one across it is shortened
// until its error is within the tolerance, and no step is longer than 6e-3.
TEST(PhasesOfSizes, ReactionsOfTheSameMotionOnBeltsAreFollowedByImplicitSteps)
{
    const auto run = run_of(TwoContactsOnBelts{}, TwoContacts::State{0}, until(6));
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 2, 1e-5);
    ASSERT_EQ(run.phases.size(), 2U);
    EXPECT_TRUE(run.phases[0].set_valued);
    EXPECT_NEAR(run.phases[1].from, 4, 0.01);

    Simulation simulation(TwoContactsOnBelts{}, {0.0}, until(6));
    while (simulation.advance()) {
    }
    EXPECT_EQ(simulation.x(), run.x);
}

TEST(PhasesOfSizes, ReactionsOfTheSameMotionAreHeldAndReleasedTogether)
{
    const auto run = run_of(TwoContacts{}, TwoContacts::State{0}, until(6));
    expect_end(run, TwoContacts::State{2});
    ASSERT_EQ(run.events.size(), 2U);
    for (std::size_t k = 0; k < 2; ++k) {
        EXPECT_EQ(run.events[k].kind, EventKind::slip);
        EXPECT_EQ(run.events[k].reaction, k);
        EXPECT_NEAR(run.events[k].t, 4, 1e-12);
    }
    EXPECT_EQ(run.set_valued.accepted, 0U);
}

/// A block under a load with contacts that act with factors c_i and have bounds of their own.
template <int M>
struct Contacts {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;
    std::array<double, M> factor, low, high;
    double rate = 1;

    struct Motion {
        static constexpr int state_size = 1, reaction_size = M;
        using Vector = Eigen::Matrix<double, 1, 1>;
        Contacts of;

        void smooth(double t, const Vector&, Vector& out) const { out[0] = of.rate * t; }
        void observe(Eigen::Matrix<double, M, 1>& e) const
        {
            for (int i = 0; i < M; ++i) e(i, 0) = of.factor[static_cast<std::size_t>(i)];
        }
        void act(Eigen::Matrix<double, 1, M>& g) const
        {
            for (int i = 0; i < M; ++i) g(0, i) = of.factor[static_cast<std::size_t>(i)];
        }
        [[nodiscard]] sets::Box<M> reaction_set(double, const Vector&) const
        {
            return sets::Box<M>(of.low, of.high);
        }
    };
    /// What they have together where w > 0 (side -1) or w < 0.
    [[nodiscard]] double together(int side) const
    {
        double sum = 0;
        for (std::size_t i = 0; i < M; ++i) {
            const bool lower = (factor[i] > 0) == (side < 0);
            sum += factor[i] * (lower ? low[i] : high[i]);
        }
        return sum;
    }
    void flow(double t, const State& x, State& dxdt) const
    {
        dxdt[0] = rate * t + together(x[0] >= 0 ? -1 : 1);
    }
    [[nodiscard]] Motion set_valued() const { return {*this}; }
};

// They hold the load t until it is as large as what they have together, l: v = (t - l)^2 / 2.
TEST(PhasesOfSizes, ReactionsOfTheSameMotionHaveBoundsAndDirectionsOfTheirOwn)
{
    const auto expect = [](const auto& contacts) {
        const double least = contacts.together(-1), most = contacts.together(1);
        const double load = contacts.rate > 0 ? -least : most, end = load + 1;
        const auto run = run_of(contacts, std::array<double, 1>{0}, until(end));
        expect_end(run, std::array<double, 1>{contacts.rate / 2});
        expect_times(times_of(run.events, EventKind::slip),
                     std::vector<double>(contacts.factor.size(), load));
    };
    for (const double rate : {1.0, -1.0}) {
        expect(Contacts<2>{{1, 1}, {-1, -2}, {0.5, 1}, rate});
        expect(Contacts<2>{{1, -2}, {-1, -0.5}, {1, 0.25}, rate});
        expect(Contacts<3>{{1, 2, 0.5}, {-1, -0.1, -2}, {1, 0.3, 1}, rate});
        expect(Contacts<4>{{1, 1, -1, 3}, {-1, -0.1, -2, 0}, {1, 0.3, 1, 0.2}, rate});
    }
}

TEST(PhasesOfSizes, ReactionsOfTheSameMotionStickTogether)
{
    // w' = t - 3 Sgn w from 1.5 comes to rest where t^2 / 2 - 3 t + 1.5 = 0, and slips at 3.
    const Contacts<2> contacts{{1, 1}, {-1, -2}, {1, 2}};
    const auto run = run_of(contacts, std::array<double, 1>{1.5}, until(4));
    expect_end(run, std::array<double, 1>{0.5});
    const double stops = 3 - std::sqrt(6);
    expect_times(times_of(run.events, EventKind::stick), {stops, stops});
    expect_times(times_of(run.events, EventKind::slip), {3, 3});
}

}  // namespace
}  // namespace ricochet::phases_of_sizes_test
