// States of earlier runs, given back to a motion: what they continue, and what is refused.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "problems/super_twisting.hpp"
#include "refusal.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet::saved_states_test {
namespace {

using One = Eigen::Matrix<double, 1, 1>;

/// w' = load + r, |r| <= 1.
struct Relay {
    static constexpr int state_size = 1;
    static constexpr int reaction_size = 1;
    double load = 0.3;
    void smooth(double, const One&, One& f) const { f[0] = load; }
    static sets::IntervalSet reaction_set(double, const One&) { return {-1, 1}; }
};

TEST(SavedStates, ASetValuedPhaseBeginsWhereTheEventsBeforeItEnd)
{
    const SuperTwisting system;
    const auto whole = hand_over(system, Eigen::Vector2d(1, 0), {.t_end = 10});
    ASSERT_EQ(whole.phases.size(), 2U);
    const double middle = whole.phases[1].from / 2;
    const auto first = hand_over(system, Eigen::Vector2d(1, 0), {.t_end = middle});
    const auto rest = HandOver<SuperTwisting>(system, first, {.t_end = 10}).take();

    ASSERT_EQ(rest.outcome, Outcome::reached_end);
    ASSERT_EQ(rest.phases.size(), 2U);
    EXPECT_NEAR(rest.phases[1].from, whole.phases[1].from, 1e-4);
    EXPECT_TRUE(rest.phases[1].set_valued);
    EXPECT_LE(rest.events.size(), whole.events.size());
}

TEST(SavedStates, WhatAReactionHoldsUpToTheErrorOfStepsIsHeldFromTheStart)
{
    const HandOver<Relay>::State start{
        .t = 0, .w = One::Constant(1e-15), .reaction = One::Constant(-0.3)};
    const auto run = HandOver<Relay>(Relay{}, start, {.t_end = 1}).take();
    EXPECT_TRUE(run.events.empty());
    EXPECT_EQ(run.x[0], 0);
    EXPECT_NEAR(run.reaction[0], -0.3, 1e-15);
}

TEST(SavedStates, WhatIsNoStateIsRefused)
{
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    SetValuedMotion<Relay> motion(Relay{}, One::Constant(1), {.t_end = 1, .step = 0.1});
    const auto good = motion.state();
    const auto refused = [&](double t, double w, double reaction) {
        return refusal([&] { motion.restart({t, One::Constant(w), One::Constant(reaction)}); });
    };
    EXPECT_EQ(refused(nan, 1, -1), "inclusion: the time at the start must be finite, not nan");
    EXPECT_EQ(refused(0, nan, -1), "inclusion: the initial state is not finite");
    EXPECT_EQ(refused(0, 1, nan), "inclusion: the reaction at the start is not finite");
    EXPECT_THROW(motion.restart(nan, One::Constant(1)), std::invalid_argument);
    EXPECT_EQ(motion.state().t, good.t);
    EXPECT_EQ(motion.run(), Outcome::reached_end);
}

/// w' = r, sized at run time.
struct Sized {
    static constexpr int state_size = Eigen::Dynamic;
    static constexpr int reaction_size = Eigen::Dynamic;
    static int size() { return 2; }
    static int reactions() { return 2; }
    static void smooth(double, const Eigen::VectorXd&, Eigen::VectorXd& f) { f.setZero(); }
    static sets::Box<2> reaction_set(double, const Eigen::VectorXd&)
    {
        return sets::Box<2>({-1, -1}, {1, 1});
    }
};

TEST(SavedStates, AnotherSizeIsRefused)
{
    const Eigen::VectorXd start = Eigen::Vector2d(1, 1);
    const SetValuedOptions options{.t_end = 1, .step = 0.1};
    SetValuedMotion<Sized> motion(Sized{}, start, options);
    const auto refused = [&](int components, int reactions) {
        return refusal([&] {
            motion.restart(
                {0, Eigen::VectorXd::Ones(components), -Eigen::VectorXd::Ones(reactions)});
        });
    };
    EXPECT_EQ(refused(2, 2), "accepted");
    EXPECT_EQ(refused(1, 2),
              "inclusion: the initial state must have as many components as the system, not 1");
    EXPECT_EQ(refused(2, 3),
              "inclusion: the start must have as many reactions as the system, not 3");
    EXPECT_THROW(motion.restart(0, Eigen::VectorXd::Ones(3)), std::invalid_argument);
}

/// Friction on the first component.
struct Loaded {
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 1;
    static void smooth(double t, const Eigen::Vector2d& w, Eigen::Vector2d& f)
    {
        const double load = std::sin(6.5587836136678508 * t + 5.1130662026723801);
        f[0] = -1.9307551525372673 * w[0] - 0.60916231752842842 * w[1] + 2.3647981706406727 * load +
               0.65323076161880711;
        f[1] = 1.1752732706299525 * w[0] + 1.4992100967283024 * w[1] + 1.4410244029845805 * load;
    }
    static sets::IntervalSet reaction_set(double, const Eigen::Vector2d&)
    {
        return sets::IntervalSet::symmetric(0.91598101144046828);
    }
};

TEST(SavedStates, ARunThatEndsAtAnEventRecordsNoChangesThatAreNone)
{
    const Eigen::Vector2d start(0.35715470556968443, -0.36869651681179905);
    const auto whole = hand_over(Loaded{}, start, {.t_end = 2});
    ASSERT_EQ(whole.events.size(), 3U);
    for (const auto& change : whole.events) {
        const auto run = hand_over(Loaded{}, start, {.t_end = change.t});
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_LE(run.events.size(), 3U);
        for (const auto& event : run.events) EXPECT_NE(event.mode_before, event.mode_after);
    }
}

TEST(SavedStates, NoLimitOfStepsIsPassedWhereThePhaseChanges)
{
    const auto with = [](std::uint64_t most) {
        return hand_over(SuperTwisting{}, Eigen::Vector2d(1, 0), {.t_end = 10, .max_steps = most});
    };
    const auto whole = with(1'000'000);
    const std::uint64_t before = whole.statistics.steps - whole.set_valued.accepted;
    for (std::uint64_t most = before - 1; most <= before + 2; ++most) {
        const auto run = with(most);
        EXPECT_EQ(run.outcome, Outcome::step_limit);
        EXPECT_EQ(run.statistics.steps - run.set_valued.accepted + run.set_valued.attempted, most);
    }
}

}  // namespace
}  // namespace ricochet::saved_states_test
