// Runs that cannot go on: states of a wrong dimension, time that stands still.

#include "ricochet/integrate/outcome.hpp"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "ricochet/integrate/integrate.hpp"

namespace ricochet {
namespace {

using V = std::vector<double>;

/// A ball whose functions can be made to lose a component of the state.
struct Losing {
    using State = V;
    enum Where { nowhere, in_flow, in_late_flow, in_reset, in_rest, in_time_reset, to_nothing };
    Where where = nowhere;

    void flow(double t, const V& x, V& dxdt) const
    {
        dxdt = {x[1], -9.81};
        if (where == in_flow || (where == in_late_flow && t > 0.2)) dxdt.pop_back();
    }
    [[nodiscard]] double guard(double, const V& x) const { return x.at(0) + 0 * x.at(1); }
    void reset(double, V& x) const
    {
        x = {0, -0.5 * x.at(1)};
        if (where == in_reset) x.pop_back();
        if (where == to_nothing) x.clear();
    }
    void rest(double, V& x) const
    {
        x = {0, 0};
        if (where == in_rest) x.pop_back();
    }
    [[nodiscard]] double next_time_event(double t) const { return t < 0.1 ? 0.1 : 1e9; }
    void time_reset(double, V& x) const
    {
        if (where == in_time_reset) x.pop_back();
    }
};

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

/// Two of three merge at t = 1; without a mode only by declaration.
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

/// x' = 1 without an end: a guard that turns x back every 1e-16 s.
struct Sawtooth {
    using State = std::array<double, 1>;
    double period = 1e-16;  // [s]
    void flow(double, const State&, State& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const State& x) const { return period - x[0]; }
    void reset(double, State& x) const { x[0] = 0; }
};

TEST(Stalled, ARunWhoseTimeStandsStillEnds)
{
    // 1000 steps of 1e-16 s against 1e-9 of 1 s.
    const Options options{
        .t_end = 1, .record_events = false, .max_steps = 100'000, .stall_steps = 1000};
    const auto run = integrate(Sawtooth{}, {0}, options);
    EXPECT_EQ(run.outcome, Outcome::stalled);
    EXPECT_LT(run.statistics.steps, 2001u);
    EXPECT_NE(std::string(describe(run.outcome)).find("stall_steps"), std::string::npos);

    // Of a span of 1e-6 s a thousand steps are 1e-7; and who asks for it may wait.
    Options shorter = options;
    shorter.t_end = 1e-6;
    EXPECT_EQ(integrate(Sawtooth{}, {0}, shorter).outcome, Outcome::step_limit);
    Options patient = options;
    patient.stall_steps = 0;
    EXPECT_EQ(integrate(Sawtooth{}, {0}, patient).outcome, Outcome::step_limit);
}

}  // namespace
}  // namespace ricochet
