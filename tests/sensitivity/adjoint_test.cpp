// Gradients by the adjoint against closed forms and forward mode, one case at a time.

#include "ricochet/sensitivity/adjoint.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <stdexcept>
#include <vector>

#include "sensitivity_systems.hpp"

namespace ricochet::adjoint_test {
namespace {

using namespace test;

/// The bouncing ball as a template over the scalar of its parameters.
template <class P>
struct FamilyBall {
    using State = X2;
    static constexpr bool unilateral = true;
    P gravity, restitution;

    template <class S>
    void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -gravity;
    }
    template <class S>
    [[nodiscard]] S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return x[0];
    }
    template <class S>
    void reset(const S& /*t*/, std::array<S, 2>& x) const
    {
        x[0] = 0;
        x[1] = -restitution * x[1];
    }
    template <class S>
    void rest(const S& /*t*/, std::array<S, 2>& x) const
    {
        x[0] = 0;
        x[1] = 0;
    }
};

const auto make_ball = [](auto p) {
    return FamilyBall<typename decltype(p)::value_type>{p[0], p[1]};
};
const Family ball{make_ball, {9.81, 0.9}};

constexpr X2 start{10, 0};

/// The state at a fixed time after impact n, and its derivatives by start, gravity and restitution,
/// in the order (u0, v0, g, r).
void expect_state_slopes(const Gradient& by, std::size_t component, int n, double t,
                         double tolerance)
{
    const auto s = BallClosedForm{}.state(n, t);
    const auto c = static_cast<Eigen::Index>(component);
    expect_relative(by.start[0], s(c, 0), tolerance, "by the height");
    expect_relative(by.start[1], s(c, 1), tolerance, "by the velocity");
    expect_relative(by.parameters[0], s(c, 3), tolerance, "by gravity");
    expect_relative(by.parameters[1], s(c, 2), tolerance, "by restitution");
}

// Flights are parabolas, which every step integrates exactly, so that only rounding is left: some
// units in the last place for each of 13 impacts.
TEST(Adjoint, ThirteenImpactsOfTheBallToRounding)
{
    const auto run = adjoint(ball, start, {.t_end = 20.5, .rtol = 1e-10, .atol = 1e-10});
    ASSERT_GE(run.run().events.size(), 13u);
    const BallClosedForm exact;
    for (const int n : {0, 5, 12}) {
        const Gradient by = run.gradient(
            LossSlopes<X2>{.events = {{.event = static_cast<std::size_t>(n), .t = 1}}});
        const auto [t, by_u0, by_v0, by_r, by_g] = exact.impact(n);
        expect_relative(run.run().events[static_cast<std::size_t>(n)].t, t, 1e-14, "time");
        expect_relative(by.start[0], by_u0, 1e-13, "by the height");
        expect_relative(by.start[1], by_v0, 1e-13, "by the velocity");
        expect_relative(by.parameters[0], by_g, 1e-13, "by gravity");
        if (n == 0) {
            EXPECT_EQ(by.parameters[1], 0);
        } else {
            expect_relative(by.parameters[1], by_r, 1e-13, "by restitution");
        }
    }
}

TEST(Adjoint, SamplesAndEndAreThoseAtFixedTimes)
{
    // Impacts 0 and 1 are at 1.43 and 4.0 s, impact 2 is at 6.3 s.
    const auto run = adjoint(ball, start, {.t_end = 5.5, .sample_times = {1, 5}});
    ASSERT_EQ(run.run().trajectory.x.size(), 2u);
    for (const std::size_t c : {std::size_t{0}, std::size_t{1}}) {
        X2 unit{};
        unit[c] = 1;
        LossSlopes<X2> late{.samples = {X2{}, unit}};
        expect_state_slopes(run.gradient(late), c, 1, 5, 1e-11);
        expect_state_slopes(run.gradient(LossSlopes<X2>{.end = unit}), c, 1, 5.5, 1e-11);
    }
    // Before the first impact: x = (u0 - g t^2 / 2, -g t).
    const Gradient early = run.gradient(LossSlopes<X2>{.samples = {X2{1, 0}, X2{}}});
    EXPECT_NEAR(early.start[0], 1, 1e-12);
    EXPECT_NEAR(early.start[1], 1, 1e-12);
    EXPECT_NEAR(early.parameters[0], -0.5, 1e-12);
    EXPECT_EQ(early.parameters[1], 0);
}

// A loss as functions: the value, and the slopes that they write.
TEST(Adjoint, ALossOfFunctionsIsTheSumOfItsTerms)
{
    const auto run = adjoint(ball, start, {.t_end = 5.5, .sample_times = {1, 5}});
    const Loss<X2> loss{.sample =
                            [](std::size_t, double, const X2& x, X2& slope) {
                                slope[0] = 2 * x[0];
                                return x[0] * x[0];
                            },
                        .end =
                            [](double, const X2& x, X2& slope) {
                                slope[1] = 3;
                                return 3 * x[1];
                            },
                        .event =
                            [](std::size_t, const Event<X2>& event, EventSlope<X2>& slope) {
                                slope.t = 1;
                                (*slope.after)[1] = 0.5;
                                return event.t + 0.5 * event.after[1];
                            }};
    const Gradient by = run.gradient(loss);
    const auto value = [&](double u0) {
        const auto other = adjoint(ball, X2{u0, 0}, {.t_end = 5.5, .sample_times = {1, 5}});
        return other.gradient(loss).value;
    };
    // Differences of a smooth function of size 100: h^4 / 30 of the fifth derivative is 1e-13, and
    // rounding 1e-14 / h.
    EXPECT_NEAR(by.start[0], slope_at_zero([&](double h) { return value(start[0] + h); }, 1e-3),
                1e-9);
    EXPECT_EQ(by.value, value(start[0]));
}

// The sample has the state after the event, and the derivatives of the motion behind it, as in
// forward mode.
TEST(Adjoint, ASampleAtAnEventIsBehindIt)
{
    const double t1 = integrate(ball.system(), start, {.t_end = 2}).events[0].t;
    const Options options{.t_end = 2, .sample_times = {t1}};
    const auto run = adjoint(ball, start, options);
    ASSERT_EQ(run.run().events[0].t, t1);
    const auto forward =
        sensitivities(BouncingBall{}, start, {.parameters = {gravity, restitution}},
                      {.t_end = 2, .sample_times = {t1}});
    EXPECT_EQ(run.run().trajectory.x[0], run.run().events[0].after);
    for (const std::size_t c : {std::size_t{0}, std::size_t{1}}) {
        X2 unit{};
        unit[c] = 1;
        const Gradient by = run.gradient(LossSlopes<X2>{.samples = {unit}});
        const auto& s = forward.trajectory[0];
        const auto row = static_cast<Eigen::Index>(c);
        EXPECT_NEAR(by.start[0], s(row, 0), 1e-9);
        EXPECT_NEAR(by.start[1], s(row, 1), 1e-9);
        EXPECT_NEAR(by.parameters[0], s(row, 2), 1e-9);
        EXPECT_NEAR(by.parameters[1], s(row, 3), 1e-9);
    }
}

TEST(Adjoint, ARunThatEndsAtItsEventHasTheStateAtAFixedTimeAndTheEventOnTheMove)
{
    const auto run = adjoint(ball, start, {.t_end = 20, .stop_at_event = true});
    const double v1 = std::sqrt(2 * 9.81 * 10);
    // v- = -sqrt(2 g u0) at the impact, wherever it is.
    const Gradient before =
        run.gradient(LossSlopes<X2>{.events = {{.event = 0, .before = X2{0, 1}}}});
    EXPECT_NEAR(before.start[0], -9.81 / v1, 1e-12);
    EXPECT_NEAR(before.parameters[0], -10 / v1, 1e-12);
    const Gradient end = run.gradient(LossSlopes<X2>{.end = X2{0, 1}});
    expect_state_slopes(end, 1, 0, run.run().t, 1e-11);
}

// The ball lies still after infinitely many impacts: nothing at a fixed time depends on anything.
TEST(Adjoint, AfterInfinitelyManyImpactsTheBallRests)
{
    const Family slow{make_ball, {9.81, 0.5}};
    const auto run = adjoint(slow, start, {.t_end = 8, .sample_times = {7}});
    ASSERT_EQ(run.run().outcome, Outcome::reached_end);
    ASSERT_EQ(run.run().events.back().kind, EventKind::accumulation);
    ASSERT_EQ(run.run().trajectory.x[0], (X2{0, 0}));
    const Gradient by = run.gradient(LossSlopes<X2>{.samples = {X2{1, 1}}, .end = X2{1, 1}});
    for (const double each : by.start) EXPECT_EQ(each, 0);
    for (const double each : by.parameters) EXPECT_EQ(each, 0);
    // The limit moves as the last impact does: t = t1 (1 + r) / (1 - r), to the difference that is
    // left at the last impact, of which n r^n remains: 1e-9.
    const Gradient limit =
        run.gradient(LossSlopes<X2>{.events = {{.event = run.run().events.size() - 1, .t = 1}}});
    const double t1 = std::sqrt(20 / 9.81);
    expect_relative(limit.start[0], 3 * t1 / 20, 1e-9, "by the height");
    expect_relative(limit.parameters[1], t1 * 2 / 0.25, 1e-6, "by restitution");
}

/// The same ball without a rule of rest.
struct RestlessBall {
    using State = X2;
    static constexpr bool unilateral = true;
    void flow(double, const X2& x, X2& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const X2& x) const { return x[0]; }
    void reset(double, X2& x) const { x = {0, -0.5 * x[1]}; }
};

// Its functions are no templates: products are differences, of functions that are linear.
TEST(Adjoint, ARunThatEndsInZenoKeepsTheDerivativesOfItsEvents)
{
    const auto run = adjoint(RestlessBall{}, start, {.t_end = 20});
    ASSERT_EQ(run.run().outcome, Outcome::zeno);
    const Gradient by = run.gradient(LossSlopes<X2>{.events = {{.event = 9, .t = 1}}});
    const auto exact = BallClosedForm{.r = 0.5}.impact(9);
    expect_relative(by.start[0], exact[1], 1e-9, "by the height");
    expect_relative(by.start[1], exact[2], 1e-9, "by the velocity");
}

/// An oscillator that is turned back by a wall at `wall`, whose surface leans by the velocity.
template <class P>
struct Leaning {
    using State = X2;
    P wall, lean;

    template <class S>
    void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0] - 0.1 * x[1];
    }
    template <class S>
    [[nodiscard]] S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return wall - x[0] - lean * x[1];
    }
    template <class S>
    void reset(const S& /*t*/, std::array<S, 2>& x) const
    {
        x[1] = -0.9 * x[1];
    }
};
const auto make_leaning = [](auto p) {
    return Leaning<typename decltype(p)::value_type>{p[0], p[1]};
};

// The guard is far from its surface right after the reset, as the velocity turns.
TEST(Adjoint, AGuardOfTheVelocity)
{
    for (const double lean : {-0.3, 0.3}) {
        const Family family{make_leaning, {0.5, lean}};
        const Options options{.t_end = 7, .rtol = 1e-12, .atol = 1e-12};
        const auto run = adjoint(family, X2{0, 1}, options);
        using System = Leaning<double>;
        const auto by = [&](std::size_t j) {
            return Parameter<System>{.with =
                                         [=](double value) {
                                             System system{0.5, lean};
                                             (j == 0 ? system.wall : system.lean) = value;
                                             return system;
                                         },
                                     .nominal = j == 0 ? 0.5 : lean};
        };
        const auto forward =
            sensitivities(family.system(), X2{0, 1}, {.parameters = {by(0), by(1)}}, options);
        ASSERT_EQ(run.run().events.size(), forward.run.events.size());
        ASSERT_GE(run.run().events.size(), 2u);
        const Gradient end = run.gradient(LossSlopes<X2>{.end = X2{1, 0}});
        EXPECT_NEAR(end.start[0], forward.state(0, 0), 1e-9) << lean;
        EXPECT_NEAR(end.start[1], forward.state(0, 1), 1e-9) << lean;
        EXPECT_NEAR(end.parameters[0], forward.state(0, 2), 1e-9) << lean;
        EXPECT_NEAR(end.parameters[1], forward.state(0, 3), 1e-9) << lean;
    }
}

// x = sin t goes beyond the wall by 1e-10, less than the tolerances tell. Steps of 1e-3 by RK4 have
// an error of 1e-14.
TEST(Adjoint, BehindAGrazingEventThereIsNoGradient)
{
    const Options options{
        .t_end = 2, .step = 1e-3, .rtol = 1e-9, .atol = 1e-9, .sample_times = {0.5, 1.9}};
    struct Undamped : Leaning<double> {
        void flow(double, const X2& x, X2& dxdt) const { dxdt = {x[1], -x[0]}; }
    };
    const auto run = adjoint(Undamped{{1 - 1e-10, 0.0}}, X2{0, 1}, options, FixedStep<Rk4>{});
    ASSERT_TRUE(run.undefined_at());
    EXPECT_EQ(run.undefined_at()->reason, Undefined::grazing);
    EXPECT_EQ(run.undefined_at()->event, 0u);
    const Gradient late = run.gradient(LossSlopes<X2>{.samples = {X2{}, X2{1, 0}}});
    EXPECT_TRUE(std::isnan(late.start[0]));
    const Gradient time = run.gradient(LossSlopes<X2>{.events = {{.event = 0, .t = 1}}});
    EXPECT_TRUE(std::isnan(time.start[1]));
    const Gradient early = run.gradient(LossSlopes<X2>{.samples = {X2{1, 0}, X2{}}});
    EXPECT_NEAR(early.start[0], std::cos(0.5), 1e-12);
}

/// Two points that move freely, each with a wall of its own; or with one for both, behind which the
/// order of the walls decides.
struct TwoWalls {
    using State = std::array<double, 4>;
    static constexpr std::size_t guard_count = 2;
    double turn = 0;  ///< by which the first wall turns the second velocity

    template <class S>
    void flow(const S& /*t*/, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = 0.0 * x[0];
        dxdt[2] = x[3];
        dxdt[3] = 0.0 * x[0];
    }
    template <class S>
    [[nodiscard]] S guard(std::size_t which, const S& /*t*/, const std::array<S, 4>& x) const
    {
        return 1.0 - x[2 * which];
    }
    template <class S>
    void reset(std::size_t which, const S& /*t*/, std::array<S, 4>& x) const
    {
        if (which == 0) x[3] = x[3] - turn * x[1];
        x[2 * which + 1] = -0.5 * x[2 * which + 1];
    }
};

TEST(Adjoint, EventsTogetherCountWhereTheirOrderDoesNot)
{
    using X4 = TwoWalls::State;
    const X4 both{0, 1, 0, 1};
    const auto apart = adjoint(TwoWalls{}, both, {.t_end = 2});
    ASSERT_EQ(apart.run().events.size(), 2u);
    EXPECT_FALSE(apart.undefined_at());
    // Behind the wall x = 1 - (t - 1 / v) v / 2 and 3/2 - v t / 2 is the same: at 2 its derivative
    // by v is -1, and that by the start is -1/2.
    const Gradient second = apart.gradient(LossSlopes<X4>{.end = X4{0, 0, 1, 0}});
    EXPECT_NEAR(second.start[0], 0, 1e-12);
    EXPECT_NEAR(second.start[1], 0, 1e-12);
    EXPECT_NEAR(second.start[2], -0.5, 1e-12);
    EXPECT_NEAR(second.start[3], -1, 1e-12);
    const auto mixed = adjoint(TwoWalls{.turn = 0.25}, both, {.t_end = 2});
    ASSERT_TRUE(mixed.undefined_at());
    EXPECT_EQ(mixed.undefined_at()->reason, Undefined::simultaneous);
    EXPECT_TRUE(std::isnan(mixed.gradient(LossSlopes<X4>{.end = X4{0, 0, 1, 0}}).start[2]));
}

/// An oscillator with a recorded section and kicks at given times.
struct Kicked {
    using State = X2;
    static constexpr bool resets = false;
    Times times{{1.0, 2.5}};
    static constexpr double level = 0.5;

    template <class S>
    void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    [[nodiscard]] double guard(double, const X2& x) const { return level - x[0]; }
    [[nodiscard]] const Times& time_events() const { return times; }
    template <class S>
    void time_reset(const S& /*t*/, std::array<S, 2>& x) const
    {
        x[1] = 0.5 * x[1];
    }
};

// Between kicks the motion is a rotation, and a kick halves the velocity.
TEST(Adjoint, TimeEventsStayAndRecordedEventsMove)
{
    const auto run = adjoint(Kicked{}, X2{0, 1}, {.t_end = 3, .rtol = 1e-12, .atol = 1e-12});
    const auto rotation = [](double t) {
        return Eigen::Matrix2d{{std::cos(t), std::sin(t)}, {-std::sin(t), std::cos(t)}};
    };
    const Eigen::Matrix2d kick{{1, 0}, {0, 0.5}};
    const Eigen::Matrix2d all = rotation(0.5) * kick * rotation(1.5) * kick * rotation(1);
    const Gradient end = run.gradient(LossSlopes<X2>{.end = X2{1, 0}});
    EXPECT_NEAR(end.start[0], all(0, 0), 1e-10);
    EXPECT_NEAR(end.start[1], all(0, 1), 1e-10);
    // x = v0 sin t reaches the level at asin(1/2): dt = -(cos t dx0 + sin t dv0) / cos t.
    const auto first = std::ranges::find(run.run().events, EventKind::crossing, &Event<X2>::kind);
    ASSERT_NE(first, run.run().events.end());
    const auto index = static_cast<std::size_t>(first - run.run().events.begin());
    const Gradient time = run.gradient(LossSlopes<X2>{.events = {{.event = index, .t = 1}}});
    EXPECT_NEAR(time.start[0], -1, 1e-8);
    EXPECT_NEAR(time.start[1], -std::tan(std::numbers::pi / 6), 1e-8);
}

/// A ball whose products are members; `factor` 1 is the truth.
struct MemberBall : RestlessBall {
    static constexpr std::size_t parameter_count = 1;
    double factor = 1;
    void flow_vjp(double, const X2&, const X2& w, const Cotangent& to) const { to.x[1] += w[0]; }
    void guard_vjp(double, const X2&, double w, const Cotangent& to) const { to.x[0] += w; }
    void reset_vjp(double, const X2& x, const X2& w, const Cotangent& to) const
    {
        to.x[1] += -0.5 * w[1] * factor;
        to.p[0] += -x[1] * w[1];
    }
};

TEST(Adjoint, MembersOfTheSystemAreUsedAndKnowItsParameters)
{
    const BallClosedForm closed{.r = 0.5};
    for (const double factor : {1.0, 2.0}) {
        MemberBall system;
        system.factor = factor;
        const auto run = adjoint(system, start, {.t_end = 3});
        const Gradient by = run.gradient(LossSlopes<X2>{.end = X2{0, 1}});
        ASSERT_EQ(by.parameters.size(), 1u);
        const auto s = closed.state(1, 3);
        ASSERT_EQ(run.run().events.size(), 2u);
        if (factor == 1) {
            expect_relative(by.start[0], s(1, 0), 1e-11, "by the height");
            expect_relative(by.parameters[0], s(1, 2), 1e-11, "by restitution");
        } else {
            EXPECT_GT(std::abs(by.start[0] - s(1, 0)), 0.1);
        }
    }
}

TEST(Adjoint, ParametersOneByOneAreDifferences)
{
    const std::vector<Parameter<BouncingBall>> by{gravity, restitution};
    const auto run = adjoint(BouncingBall{}, by, start, {.t_end = 5.5});
    // Differences of functions that are linear in each parameter: rounding, 1e-13 / 1e-3.
    expect_state_slopes(run.gradient(LossSlopes<X2>{.end = X2{1, 0}}), 0, 1, 5.5, 1e-9);
}

TEST(Adjoint, BackwardInTime)
{
    // Up from (5, -12) at 1 backward: x = 5 - 12 (t - 1) - g (t - 1)^2 / 2.
    const auto run =
        adjoint(ball, X2{5, -12}, {.t_start = 1, .t_end = 0.5, .sample_times = {0.75}});
    const Gradient end = run.gradient(LossSlopes<X2>{.end = X2{1, 0}});
    EXPECT_NEAR(end.start[1], -0.5, 1e-12);
    EXPECT_NEAR(end.parameters[0], -0.125, 1e-12);
    EXPECT_NEAR(end.t_start, 12 - 9.81 * 0.5, 1e-11);
    const Gradient sample = run.gradient(LossSlopes<X2>{.samples = {X2{1, 0}}});
    EXPECT_NEAR(sample.start[1], -0.25, 1e-12);
}

TEST(Adjoint, RefusesSlopesThatTheRunDoesNotHave)
{
    const auto run = adjoint(ball, start, {.t_end = 2, .sample_times = {1}});
    EXPECT_THROW((void)run.gradient(LossSlopes<X2>{.samples = {X2{}, X2{}}}),
                 std::invalid_argument);
    EXPECT_THROW((void)run.gradient(LossSlopes<X2>{.events = {{.event = 1}}}),
                 std::invalid_argument);
}

TEST(Adjoint, MemoryIsAStateAndAFewNumbersAStep)
{
    const auto run = adjoint(ball, start, {.t_end = 20.5, .step = 0.01}, FixedStep<Rk4>{});
    EXPECT_LE(run.bytes(), (run.run().statistics.steps + 2 * run.run().events.size()) * 9 * 8);
}

}  // namespace
}  // namespace ricochet::adjoint_test
