// Runs that cannot continue: states of a wrong dimension, time that stands still.

#include "ricochet/run.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/integrate.hpp"
#include "saved_systems.hpp"

namespace ricochet::outcome_test {
namespace {

using test::Losing;
using test::Sawtooth;
using V = std::vector<double>;

TEST(WrongDimension, ALostComponentEndsTheRunBeforeItIsRead)
{
    // `at` throws std::out_of_range where a shortened state is used.
    for (const auto where : {Losing::in_late_flow, Losing::in_reset, Losing::in_rest,
                             Losing::in_time_reset, Losing::to_nothing}) {
        const auto run = integrate(Losing{where}, V{1, 0}, {.t_end = 5});
        EXPECT_EQ(run.outcome, Outcome::wrong_dimension) << where;
        EXPECT_EQ(run.x.size(), 2u) << where;
        const auto fixed =
            integrate(Losing{where}, V{1, 0}, {.t_end = 5, .step = 0.01}, FixedStep<Rk4>{});
        EXPECT_EQ(fixed.outcome, Outcome::wrong_dimension) << where;
        EXPECT_EQ(fixed.x.size(), 2u) << where;
    }
    EXPECT_EQ(integrate(Losing{}, V{1, 0}, {.t_end = 5}).outcome, Outcome::reached_end);
}

TEST(WrongDimension, AFlowThatLosesAComponentAtTheStartIsRefused)
{
    const Losing losing{Losing::in_flow};
    EXPECT_EQ(refusal([&] {
                  (void)integrate(losing, V{1, 0}, {.t_end = 5});
              }),
              "integrate: flow resized dxdt at the start; expected the 2 components of the state, "
              "written in place");
}

/// Two of three merge at t = 1; without a mode this happens only by declaration.
struct Merging {
    using State = V;
    void flow(double, const V&, V& dxdt) const
    {
        for (double& rate : dxdt) rate = 1;
    }
    [[nodiscard]] double guard(double, const V& x) const { return x.size() < 3 ? 1 : 1 - x[0]; }
    void reset(double, V& x) const { x.pop_back(); }
};
struct MergingAsDeclared : Merging {
    static constexpr bool changes_dimension = true;
};

TEST(WrongDimension, AStateGetsShorterWhereThatIsDeclared)
{
    EXPECT_EQ(integrate(Merging{}, V{0, 0, 0}, {.t_end = 2}).outcome, Outcome::wrong_dimension);
    const auto run = integrate(MergingAsDeclared{}, V{0, 0, 0}, {.t_end = 2});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x.size(), 2u);
}

/// A reset that leaves no component, where states may get shorter.
struct Emptying : MergingAsDeclared {
    void reset(double, V& x) const { x.clear(); }
};

TEST(WrongDimension, AResetToNoComponentEndsTheRun)
{
    EXPECT_EQ(integrate(Emptying{}, V{0, 0, 0}, {.t_end = 2}).outcome, Outcome::wrong_dimension);
}

TEST(Stalled, ARunWhoseTimeStandsStillEnds)
{
    // 1000 steps of 1e-16 s against 1e-9 of 1 s.
    const Options options{
        .t_end = 1, .record_events = false, .max_steps = 100'000, .stall_steps = 1000};
    const auto run = integrate(Sawtooth{}, {0}, options);
    EXPECT_EQ(run.outcome, Outcome::stalled);
    EXPECT_LT(run.statistics.steps, 2001u);
    EXPECT_NE(std::string(describe(run.outcome)).find("stall_steps"), std::string::npos);

    // A million steps by default.
    const auto usual = integrate(Sawtooth{}, {0}, {.t_end = 1, .record_events = false});
    EXPECT_EQ(usual.outcome, Outcome::stalled);
    EXPECT_LE(usual.statistics.steps, 2'000'000u);

    // For a span of 1e-6 s a thousand steps are 1e-7; a longer wait must be requested.
    Options shorter = options;
    shorter.t_end = 1e-6;
    EXPECT_EQ(integrate(Sawtooth{}, {0}, shorter).outcome, Outcome::step_limit);
    Options patient = options;
    patient.stall_steps = 0;
    EXPECT_EQ(integrate(Sawtooth{}, {0}, patient).outcome, Outcome::step_limit);
}

/// Turns at a rate that is a billion times as high after a second.
struct Spinning {
    double faster = 1e9;
    void flow(double t, const std::array<double, 2>& x, std::array<double, 2>& dxdt) const
    {
        const double rate = t < 1 ? 1 : faster;
        dxdt = {rate * x[1], -rate * x[0]};
    }
};
struct CountedSpinning : Spinning {
    static constexpr bool resets = false;
    [[nodiscard]] GuardInfo guard_info() const { return {.resets = false}; }
    [[nodiscard]] double guard(double, const std::array<double, 2>& x) const { return x[0]; }
};

TEST(Stalled, ARunThatAHundredTimesItsStepsWouldNotEndStopsEarlyUnlessItHasEvents)
{
    // At this tolerance a step turns by at least a hundredth and at most half a radian: a thousand
    // of them advance by 1e-8 to 5e-7 s, more than 1e-9 of 5 s, less than a millionth of the second
    // before, and by more than a turn, so that there are events among them.
    const std::array<double, 2> x0 = {1.0, 0.0};
    const Options options{
        .t_end = 5, .record_events = false, .max_steps = 100'000, .stall_steps = 1000};
    const auto run = integrate(Spinning{}, x0, options);
    EXPECT_EQ(run.outcome, Outcome::stalled);
    EXPECT_LT(run.statistics.steps, 10'000u);
    EXPECT_EQ(integrate(CountedSpinning{}, x0, options).outcome, Outcome::step_limit);
    // Nothing has stalled where the pace is that of the start, however far the end lies.
    EXPECT_EQ(integrate(Spinning{1}, x0, {.t_end = 1e12, .max_steps = 100'000}).outcome,
              Outcome::step_limit);
}

TEST(EventKinds, HaveTheNamesOfTheirEnumerators)
{
    const std::vector<std::string_view> names{"crossing", "touch", "time", "accumulation",
                                              "mode",     "stick", "slip", "jump"};
    for (std::size_t i = 0; i < names.size(); ++i) {
        EXPECT_EQ(name(static_cast<EventKind>(i)), names[i]);
    }
    EXPECT_EQ(name(static_cast<EventKind>(names.size())), "unknown");
}

}  // namespace
}  // namespace ricochet::outcome_test
