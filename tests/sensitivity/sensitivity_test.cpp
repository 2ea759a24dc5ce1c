#include "ricochet/locators.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

#include "ricochet/rosenbrock.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/thermostat.hpp"
#include "sensitivity_systems.hpp"

namespace ricochet::sensitivity_test {
namespace {

using namespace test;

// --- the bouncing ball: t_n = t_1 + 2 t_1 (r + ... + r^n), t_1 = sqrt(2 u0 / g) ---

// Every flight is a parabola, on which the method is exact; the error is rounding in
// differences, 1e-13 of the derivative, 13 times, amplified at each impact by less than
// 19 (see integrate_test.cpp): below 3e-11.
TEST(Sensitivity, ImpactTimesOfTheBallFollowTheClosedFormInEveryDirection)
{
    const auto s =
        sensitivities(BouncingBall(), {10.0, 0.0}, {.parameters = {restitution, gravity}},
                      {.t_end = 20.5, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(s.run.outcome, Outcome::reached_end);
    ASSERT_EQ(s.events.size(), 13u);
    ASSERT_FALSE(s.undefined_at);
    for (int n = 0; n < 13; ++n) {
        const auto expected = BallClosedForm().impact(n);
        const Eigen::VectorXd& dt = s.events[static_cast<std::size_t>(n)].dt;
        ASSERT_EQ(dt.size(), 4);
        for (int j = 0; j < 4; ++j) {
            expect_relative(dt[j], expected[static_cast<std::size_t>(j) + 1], 1e-10,
                            "impact " + std::to_string(n) + ", direction " + std::to_string(j));
        }
    }
    EXPECT_EQ(s.events[0].dt[2], 0);  // the first impact does not depend on the restitution
}

TEST(Sensitivity, TheStateOfTheBallFollowsTheClosedForm)
{
    const auto s =
        sensitivities(BouncingBall(), {10.0, 0.0}, {.parameters = {restitution, gravity}},
                      {.t_end = 20.5, .rtol = 1e-12, .atol = 1e-12});
    const auto expected = BallClosedForm().state(12, 20.5);
    for (int j = 0; j < 4; ++j) {
        // Height and velocity are coupled through the flight time: the larger of
        // the two sets the scale.
        const double scale = expected.col(j).cwiseAbs().maxCoeff();
        EXPECT_LE((s.state.col(j) - expected.col(j)).cwiseAbs().maxCoeff(), 1e-10 * scale) << j;
    }
}

// At the event as it moves the height is 0 in every direction, and the speed of the
// first impact is sqrt(2 g u0).
TEST(Sensitivity, TheStateAtAMovingEventStaysOnTheSurface)
{
    const auto s = sensitivities(BouncingBall(), {10.0, 0.0}, {}, {.t_end = 5, .rtol = 1e-12});
    ASSERT_FALSE(s.events.empty());
    EXPECT_NEAR(s.events[0].at_event(0, 0), 0, 1e-12);
    EXPECT_NEAR(s.events[0].at_event(1, 0), -std::sqrt(2 * 9.81 * 10) / 20, 1e-12);
}

// The range of the restitution is [0, 1], so its differences are one-sided there. They
// are as exact for the ball, whose functions are linear in r.
TEST(Sensitivity, AtTheEdgeOfAParametersRangeDifferencesAreOneSided)
{
    for (const double r : {1.0, 0.0005}) {
        Parameter<BouncingBall> parameter = restitution;
        parameter.nominal = r;
        parameter.scale = 1;
        const BouncingBall ball({.restitution = r});
        const auto s = sensitivities(ball, {10.0, 0.0}, {false, {parameter}},
                                     {.t_end = 1.44, .rtol = 1e-12, .atol = 1e-12});
        ASSERT_EQ(s.state.cols(), 1);
        ASSERT_GE(s.events.size(), 1u);
        const auto expected = BallClosedForm{.r = r}.state(0, 1.44);
        if (s.events.size() == 1) {
            EXPECT_NEAR(s.state(1, 0), expected(1, 2), 1e-10);
        }
        EXPECT_NEAR(s.events[0].after(1, 0), std::sqrt(2 * 9.81 * 10), 1e-10);
    }
}

TEST(Sensitivity, AParameterMayMoveTheInitialStateToo)
{
    Parameter<BouncingBall> height{
        .with = [](double) { return BouncingBall(); }, .nominal = 10, .start = {1, 0}};
    const auto s = sensitivities(BouncingBall(), {10.0, 0.0}, {.parameters = {height}},
                                 {.t_end = 12, .rtol = 1e-11, .atol = 1e-12});
    ASSERT_EQ(s.state.cols(), 3);
    EXPECT_EQ(s.state.col(0), s.state.col(2));
    EXPECT_EQ(s.events.back().dt[0], s.events.back().dt[2]);
}

// --- without events ---

/// x' = A(p) x with A(p) = A + p B.
struct Linear {
    using State = std::array<double, 3>;
    double p = 0.5;

    [[nodiscard]] static Eigen::Matrix3d a()
    {
        return (Eigen::Matrix3d() << -0.1, 1, 0.2, -1.3, -0.2, 0.1, 0.3, 0, -0.5).finished();
    }
    [[nodiscard]] static Eigen::Matrix3d b()
    {
        return (Eigen::Matrix3d() << 0, 0.4, 0, 0.1, -0.2, 0, 0, 0.3, 0.1).finished();
    }
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        const Eigen::Matrix3d m = a() + p * b();
        const Eigen::Vector3d rate = m * Eigen::Vector3d(x[0], x[1], x[2]);
        for (std::size_t i = 0; i < 3; ++i) dxdt[i] = rate[static_cast<Eigen::Index>(i)];
    }
};

// exp of (A B; 0 A) has the derivative of exp(A) by p in its corner (C. Van Loan,
// Computing integrals involving the matrix exponential, 1978).
TEST(Sensitivity, WithoutEventsItIsTheMatrixExponential)
{
    const double t = 4;
    Eigen::Matrix<double, 6, 6> block = Eigen::Matrix<double, 6, 6>::Zero();
    block.topLeftCorner<3, 3>() = Linear::a() + 0.5 * Linear::b();
    block.bottomRightCorner<3, 3>() = block.topLeftCorner<3, 3>();
    block.topRightCorner<3, 3>() = Linear::b();
    const Eigen::Matrix<double, 6, 6> e = (t * block).exp();
    const Eigen::Vector3d x0(1, -0.5, 2);

    const auto s = sensitivities(
        Linear{}, {1.0, -0.5, 2.0},
        {.parameters = {{.with = [](double p) { return Linear{p}; }, .nominal = 0.5}}},
        {.t_end = t, .rtol = 1e-12, .atol = 1e-13});

    ASSERT_EQ(s.state.rows(), 3);
    ASSERT_EQ(s.state.cols(), 4);
    EXPECT_TRUE(s.events.empty());
    // A method at rtol 1e-12 over four time units, all derivatives of size one.
    const Eigen::Matrix3d by_start = e.topLeftCorner<3, 3>();
    const Eigen::Vector3d by_p = e.topRightCorner<3, 3>() * x0;
    EXPECT_LE((s.state.leftCols(3) - by_start).cwiseAbs().maxCoeff(), 2e-11);
    EXPECT_LE((s.state.col(3) - by_p).cwiseAbs().maxCoeff(), 2e-11);
}

TEST(Sensitivity, BackwardInTimeItIsTheInverse)
{
    const auto forth =
        sensitivities(Oscillator{}, {1.0, 0.5}, {}, {.t_end = 2.3, .rtol = 1e-12, .atol = 1e-13});
    const auto back = sensitivities(Oscillator{}, forth.run.x, {},
                                    {.t_start = 2.3, .t_end = 0, .rtol = 1e-12, .atol = 1e-13});
    // Two runs at 1e-12 over two time units.
    EXPECT_LE((back.state * forth.state - Eigen::Matrix2d::Identity()).cwiseAbs().maxCoeff(),
              2e-11);
}

TEST(Sensitivity, SamplesOfTheTrajectoryHaveDerivatives)
{
    const auto s =
        sensitivities(Oscillator{}, {1.0, 0.5}, {},
                      {.t_end = 3, .rtol = 1e-11, .atol = 1e-12, .sample_times = {0, 0.7, 2.1, 3}});
    ASSERT_EQ(s.trajectory.size(), 4u);
    ASSERT_EQ(s.run.trajectory.x.size(), 4u);
    for (std::size_t k = 0; k < 4; ++k) {
        const double t = s.run.trajectory.t[k];
        const Eigen::Matrix2d expected =
            (Eigen::Matrix2d() << std::cos(t), std::sin(t), -std::sin(t), std::cos(t)).finished();
        EXPECT_LE((s.trajectory[k] - expected).cwiseAbs().maxCoeff(), 1e-9) << t;
    }
}

/// x' = -L sin(x / L), whose length scale is L.
struct Small {
    using State = X1;
    double length = 1e-6;
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = -length * std::sin(x[0] / length);
    }
};

// With u = tan(x0 / 2L), x = 2 L atan(u exp(-t)).
TEST(Sensitivity, TheScaleOfAComponentSaysHowFarDifferencesReach)
{
    const double u = std::tan(0.5);
    const double e = std::exp(-1.5);
    const double expected = e * (1 + u * u) / (1 + u * u * e * e);
    const Options options{.t_end = 1.5, .rtol = 1e-11, .atol = 1e-17};
    Directions<Small> directions;
    directions.differences.scale = {1e-6};
    const auto scaled = sensitivities(Small{}, {1e-6}, directions, options);
    EXPECT_NEAR(scaled.state(0, 0), expected, 1e-9);
    const auto plain = sensitivities(Small{}, {1e-6}, {}, options);
    EXPECT_GT(std::abs(plain.state(0, 0) - expected), 1e-3);
}

// --- derivatives that a system declares ---

TEST(Sensitivity, DeclaredDerivativesGiveTheClosedForm)
{
    const auto s =
        sensitivities(ExactBall{}, {10.0, 0.0}, {}, {.t_end = 20.5, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(s.events.size(), 13u);
    for (int n = 0; n < 13; ++n) {
        const auto expected = BallClosedForm().impact(n);
        // No differences except for the guard's rate; only rounding.
        expect_relative(s.events[static_cast<std::size_t>(n)].dt[0], expected[1], 1e-11, "u0");
        expect_relative(s.events[static_cast<std::size_t>(n)].dt[1], expected[2], 1e-11, "v0");
    }
}

// Twice the derivative of the guard is twice the shift of the first impact, which
// differences would not give.
TEST(Sensitivity, WhatIsDeclaredIsBelieved)
{
    const auto s = sensitivities(ExactBall{.factor = 2}, {10.0, 0.0}, {}, {.t_end = 2});
    ASSERT_EQ(s.events.size(), 1u);
    const double t1 = std::sqrt(20 / 9.81);
    const double v1 = 9.81 * t1;
    EXPECT_NEAR(s.events[0].dt[0], 2 / v1, 1e-12);
    EXPECT_NEAR(s.events[0].before(0, 1), 2 * t1, 1e-12);
    // R_x (S + f dt) - f⁺ dt, with the velocity turned back twice as far
    EXPECT_NEAR(s.events[0].after(1, 0), -1.8 * -9.81 * 2 / v1 + 9.81 * 2 / v1, 1e-11);
}

/// Two modes whose functions all declare derivatives, in the form of a system with
/// many guards and modes. In mode 0 x' = -x, in mode 1 x' = 2 x.
struct ExactModes {
    using State = X1;
    static constexpr std::size_t guard_count = 2;

    template <class X>
    void flow(Mode mode, double, const X& x, X& dxdt) const
    {
        dxdt[0] = mode == 0 ? -x[0] : 2 * x[0];
    }
    template <class X>
    void flow_derivative(Mode mode, double, const X&, const X& s, X& ds) const
    {
        ds[0] = mode == 0 ? -s[0] : 2 * s[0];
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 ? x[0] - 1 : 3 - x[0];
    }
    template <class X>
    [[nodiscard]] double guard_derivative(std::size_t which, double, const X&, const X& s) const
    {
        return which == 0 ? s[0] : -s[0];
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const { return which == mode; }
    template <class X>
    [[nodiscard]] Mode reset(std::size_t which, Mode, double, X&) const
    {
        return which == 0 ? 1 : 0;
    }
    template <class X>
    void reset_derivative(std::size_t, Mode, double, const X&, double, X&) const
    {
    }
};

// From 2: down to 1 at log 2, up to 3 at log 2 + log(3) / 2. Both move by 1 / x0, and
// at the end x = 3 exp(-(t - t2)).
TEST(Sensitivity, DerivativesOfManyGuardsAndModesAreTaken)
{
    const auto s =
        sensitivities(ExactModes{}, {2.0}, {}, {.t_end = 1.5, .rtol = 1e-12, .atol = 1e-13});
    ASSERT_EQ(s.events.size(), 2u);
    EXPECT_NEAR(s.events[0].dt[0], 0.5, 1e-11);
    EXPECT_NEAR(s.events[1].dt[0], 0.5, 1e-11);
    const double t2 = std::log(2.0) + std::log(3.0) / 2;
    EXPECT_NEAR(s.state(0, 0), 0.5 * 3 * std::exp(-(1.5 - t2)), 1e-11);
}

// --- modes ---

// Off for log(high / low) / rate, on for log((30 - low) / (30 - high)) / rate; the first
// switch is at log(20 / low) / rate. The period is the time between every other switch.
TEST(Sensitivity, ThePeriodOfAThermostatFollowsTheClosedForm)
{
    using P = Thermostat::Parameters;
    const std::vector<Parameter<Thermostat>> parameters = {
        {.with = [](double v) { return Thermostat(P{.rate = v}); }, .nominal = 0.1},
        {.with = [](double v) { return Thermostat(P{.low = v}); }, .nominal = 18},
        {.with = [](double v) { return Thermostat(P{.high = v}); }, .nominal = 22}};
    const auto s = sensitivities(Thermostat(), {20.0}, {true, parameters},
                                 {.t_end = 20, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_GE(s.events.size(), 5u);
    const Eigen::VectorXd period = s.events[3].dt - s.events[1].dt;
    const double length = (std::log(22.0 / 18) + std::log(12.0 / 8)) / 0.1;
    // Exponentials at rtol 1e-12, over rates of about 1 per second.
    EXPECT_NEAR(period[0], 0, 1e-10);
    EXPECT_NEAR(period[1], -length / 0.1, 1e-9);
    EXPECT_NEAR(period[2], (-1.0 / 18 - 1.0 / 12) / 0.1, 1e-10);
    EXPECT_NEAR(period[3], (1.0 / 22 + 1.0 / 8) / 0.1, 1e-10);
    EXPECT_NEAR(s.events[0].dt[0], 1 / (0.1 * 20), 1e-11);
    EXPECT_NEAR(s.events[0].dt[1], -std::log(20.0 / 18) / 0.01, 1e-10);
}

// The state is not reset, but the flow changes, and with it the derivative: while the
// heater is on x = 30 - 12 exp(-0.1 (t - t_1)), so dx = -12 * 0.1 exp(..) dt_1.
TEST(Sensitivity, AChangeOfModeAloneHasASaltation)
{
    const auto s =
        sensitivities(Thermostat(), {20.0}, {}, {.t_end = 3, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(s.events.size(), 1u);
    const double t1 = 10 * std::log(20.0 / 18);
    EXPECT_NEAR(s.events[0].before(0, 0), 18.0 / 20, 1e-11);
    EXPECT_NEAR(s.events[0].after(0, 0), -1.2 * 0.5, 1e-11);
    EXPECT_NEAR(s.state(0, 0), -1.2 * std::exp(-0.1 * (3 - t1)) * 0.5, 1e-11);
}

// --- the impact oscillator ---

const Options fine{.t_end = 40, .rtol = 1e-13, .atol = 1e-13};

// Differences of runs with rtol 1e-13 over steps of 1e-3: noise 1e-12 / 1e-3 times the
// amplification of a few impacts, truncation 1e-12 of a fifth derivative.
TEST(Sensitivity, TheImpactOscillatorAgreesWithDifferencesOfRuns)
{
    const auto with = [](double frequency) { return ImpactOscillator({.frequency = frequency}); };
    const auto s =
        sensitivities(with(0.8), {0.3, 0.2}, {.parameters = {{.with = with, .nominal = 0.8}}},
                      {.t_end = 40, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_GE(s.events.size(), 4u);
    ASSERT_FALSE(s.undefined_at);
    const auto moved = [&](int direction, double by) {
        X2 x0{0.3, 0.2};
        if (direction < 2) x0[static_cast<std::size_t>(direction)] += by;
        return integrate(with(direction == 2 ? 0.8 + by : 0.8), x0, fine);
    };
    for (int j = 0; j < 3; ++j) {
        for (std::size_t i = 0; i < 2; ++i) {
            const double expected =
                slope_at_zero([&](double by) { return moved(j, by).x[i]; }, 3e-4);
            EXPECT_NEAR(s.state(static_cast<Eigen::Index>(i), j), expected,
                        1e-6 * (1 + std::abs(expected)))
                << i << j;
        }
        for (std::size_t k = 0; k < s.events.size(); ++k) {
            const double expected =
                slope_at_zero([&](double by) { return moved(j, by).events.at(k).t; }, 3e-4);
            EXPECT_NEAR(s.events[k].dt[j], expected, 1e-6 * (1 + std::abs(expected))) << k << j;
        }
    }
}

TEST(Sensitivity, TighterTolerancesConverge)
{
    const ImpactOscillator oscillator({.frequency = 0.8});
    const auto at = [&](double tolerance) {
        return sensitivities(oscillator, {0.3, 0.2}, {},
                             {.t_end = 40, .rtol = tolerance, .atol = tolerance})
            .state;
    };
    const Eigen::MatrixXd reference = at(1e-13);
    double previous = std::numeric_limits<double>::infinity();
    // The error follows the tolerance: a hundredth of it leaves less than a tenth.
    for (const double tolerance : {1e-5, 1e-7, 1e-9}) {
        const double error = (at(tolerance) - reference).cwiseAbs().maxCoeff();
        EXPECT_LT(error, previous / 10) << tolerance;
        EXPECT_LT(error, 1e4 * tolerance) << tolerance;
        previous = error;
    }
}

// --- guards and resets that depend on time ---

/// A ball on a table that moves as w = a sin(2 t).
struct MovingTable {
    using State = X2;
    double a = 0.1;
    static constexpr bool unilateral = true;

    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.81;
    }
    template <class X>
    [[nodiscard]] double guard(double t, const X& x) const
    {
        return x[0] - a * std::sin(2 * t);
    }
    template <class X>
    void reset(double t, X& x) const
    {
        x[0] = a * std::sin(2 * t);
        x[1] = -0.8 * x[1] + 1.8 * 2 * a * std::cos(2 * t);
    }
};

// As for the impact oscillator.
TEST(Sensitivity, GuardsAndResetsMayDependOnTime)
{
    const auto s = sensitivities(
        MovingTable{}, {1.0, 0.0},
        {.parameters = {{.with = [](double a) { return MovingTable{a}; }, .nominal = 0.1}}},
        {.t_end = 3, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_GE(s.events.size(), 4u);
    const auto moved = [&](int direction, double by) {
        X2 x0{1, 0};
        if (direction < 2) x0[static_cast<std::size_t>(direction)] += by;
        return integrate(MovingTable{direction == 2 ? 0.1 + by : 0.1}, x0,
                         {.t_end = 3, .rtol = 1e-13, .atol = 1e-13});
    };
    for (int j = 0; j < 3; ++j) {
        for (std::size_t k = 0; k < s.events.size(); ++k) {
            const double expected =
                slope_at_zero([&](double by) { return moved(j, by).events.at(k).t; }, 2e-5);
            EXPECT_NEAR(s.events[k].dt[j], expected, 1e-6 * (1 + std::abs(expected))) << k << j;
        }
        const double expected = slope_at_zero([&](double by) { return moved(j, by).x[0]; }, 2e-5);
        EXPECT_NEAR(s.state(0, j), expected, 1e-6 * (1 + std::abs(expected))) << j;
    }
}

// --- time events ---

/// x' = -x, and x + 1 at every multiple of the interval.
struct Doses {
    using State = X1;
    double interval = 0.5;

    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = -x[0];
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        double k = std::floor(t / interval) + 1;
        if (k * interval <= t) k += 1;
        return k * interval;
    }
    template <class X>
    void time_reset(double, X& x) const
    {
        x[0] += 1;
    }
};

// x(T) = x0 exp(-T) + sum_k exp(-(T - k interval)).
TEST(Sensitivity, TimeEventsDoNotMoveWithTheStateButWithTheirInterval)
{
    const auto s =
        sensitivities(Doses{}, {2.0},
                      {.parameters = {{.with = [](double i) { return Doses{i}; }, .nominal = 0.5}}},
                      {.t_end = 2.2, .rtol = 1e-12, .atol = 1e-13});
    ASSERT_EQ(s.events.size(), 4u);
    double by_interval = 0;
    for (int k = 1; k <= 4; ++k) {
        const EventSensitivity& event = s.events[static_cast<std::size_t>(k) - 1];
        EXPECT_EQ(s.run.events[static_cast<std::size_t>(k) - 1].kind, EventKind::time);
        EXPECT_EQ(event.dt[0], 0);
        EXPECT_NEAR(event.dt[1], k, 1e-11);
        by_interval += k * std::exp(-(2.2 - 0.5 * k));
    }
    EXPECT_NEAR(s.state(0, 0), std::exp(-2.2), 1e-11);
    EXPECT_NEAR(s.state(0, 1), by_interval, 1e-10);
}

// Two thousandths of the interval 130 times are more than a quarter of it: the dose is
// no longer distinguished from its neighbour, and a smaller scale helps.
TEST(Sensitivity, ATimeEventThatMovesTooFarIsSaidToBeLost)
{
    Parameter<Doses> interval{.with = [](double i) { return Doses{i}; }, .nominal = 0.5};
    const Options options{.t_end = 100, .rtol = 1e-8, .atol = 1e-8};
    const auto lost = sensitivities(Doses{}, {2.0}, {.parameters = {interval}}, options);
    ASSERT_TRUE(lost.undefined_at);
    EXPECT_EQ(lost.undefined_at->reason, Undefined::time_event_jumps);
    EXPECT_GT(lost.undefined_at->event, 100u);
    EXPECT_NEAR(lost.events[lost.undefined_at->event - 1].dt[1],
                static_cast<double>(lost.undefined_at->event), 1e-8);

    interval.scale = 0.01;
    const auto followed = sensitivities(Doses{}, {2.0}, {.parameters = {interval}}, options);
    EXPECT_FALSE(followed.undefined_at);
    EXPECT_NEAR(followed.events.back().dt[1], static_cast<double>(followed.events.size()), 1e-8);
}

// The differences move the event by about whole intervals, so that its neighbours take its place.
TEST(Sensitivity, ATimeEventThatMovesByWholeIntervalsIsSaidToBeLost)
{
    Parameter<Doses> interval{.with = [](double i) { return Doses{i}; }, .nominal = 0.5};
    for (const double start : {450.0, 500.0, 1000.0, 5000.0}) {
        const Options options{.t_start = start, .t_end = start + 1.2};
        const auto lost = sensitivities(Doses{}, {2.0}, {.parameters = {interval}}, options);
        ASSERT_EQ(lost.events.size(), 2u);
        ASSERT_TRUE(lost.undefined_at) << start;
        EXPECT_EQ(lost.undefined_at->event, 0u);
        EXPECT_EQ(lost.undefined_at->reason, Undefined::time_event_jumps);

        Parameter<Doses> near = interval;
        near.scale = 0.001;
        const auto followed = sensitivities(Doses{}, {2.0}, {.parameters = {near}}, options);
        EXPECT_FALSE(followed.undefined_at) << start;
        EXPECT_NEAR(followed.events[0].dt[1], start / 0.5 + 1, 1e-4);
    }
}

// --- requests ---

TEST(Sensitivity, WithoutDirectionsItIsTheRunBitForBit)
{
    const ImpactOscillator oscillator;
    const Options options{.t_end = 50, .rtol = 1e-9};
    const auto plain = integrate(oscillator, {0.0, 0.0}, options);
    const auto s = sensitivities(oscillator, {0.0, 0.0}, {.initial_state = false}, options);
    EXPECT_EQ(s.state.rows(), 2);
    EXPECT_EQ(s.state.cols(), 0);
    EXPECT_EQ(s.run.x, plain.x);
    EXPECT_EQ(s.run.statistics.steps, plain.statistics.steps);
    ASSERT_EQ(s.run.events.size(), plain.events.size());
    for (std::size_t k = 0; k < plain.events.size(); ++k) {
        EXPECT_EQ(s.run.events[k].t, plain.events[k].t);
        EXPECT_EQ(s.run.events[k].after, plain.events[k].after);
        EXPECT_EQ(s.events[k].dt.size(), 0);
    }
}

TEST(Sensitivity, AParameterThatDoesNotMatterHasExactlyNoInfluence)
{
    const Parameter<ImpactOscillator> nothing{.with = [](double) { return ImpactOscillator(); },
                                              .nominal = 3};
    const auto s = sensitivities(ImpactOscillator(), {0.0, 0.0}, {.parameters = {nothing}},
                                 {.t_end = 50, .rtol = 1e-9});
    ASSERT_GE(s.events.size(), 3u);
    for (const EventSensitivity& event : s.events) {
        EXPECT_EQ(event.dt[2], 0);
        EXPECT_EQ(event.after.col(2), Eigen::VectorXd::Zero(2));
    }
    EXPECT_EQ(s.state.col(2), Eigen::VectorXd::Zero(2));
}

TEST(Sensitivity, EveryStateTypeGivesTheSameBits)
{
    const Options options{.t_end = 8, .rtol = 1e-9};
    const auto expected = sensitivities(BouncingBall(), {10.0, 0.0}, {}, options);
    const auto expect_same = [&](const auto& x0) {
        const auto s = sensitivities(BouncingBall(), x0, {}, options);
        EXPECT_EQ(s.state, expected.state);
        EXPECT_EQ(s.run.x[0], expected.run.x[0]);
        ASSERT_EQ(s.events.size(), expected.events.size());
        EXPECT_EQ(s.events.back().dt, expected.events.back().dt);
    };
    expect_same(std::vector<double>{10, 0});
    expect_same(Eigen::Vector2d(10, 0));
    expect_same(Eigen::VectorXd(Eigen::Vector2d(10, 0)));
}

TEST(Sensitivity, OtherMethodsDetectorsAndLocatorsServeAsWell)
{
    const auto s = sensitivities(BouncingBall(), {10.0, 0.0}, {}, {.t_end = 7, .step = 0.01},
                                 FixedStep<Rk4>{}, Ends{}, Bisection{});
    ASSERT_EQ(s.events.size(), 3u);
    EXPECT_NEAR(s.events[2].dt[0], BallClosedForm().impact(2)[1], 1e-10);
}

TEST(Sensitivity, AnImplicitMethodServesAsWell)
{
    const auto s = sensitivities(BouncingBall(), {10.0, 0.0}, {.parameters = {restitution}},
                                 {.t_end = 7, .rtol = 1e-8}, ErrorControlled<Rosenbrock4>{});
    ASSERT_EQ(s.run.outcome, Outcome::reached_end);
    ASSERT_EQ(s.events.size(), 3u);
    const auto expected = BallClosedForm().impact(2);
    EXPECT_NEAR(s.events[2].dt[0], expected[1], 1e-6);
    EXPECT_NEAR(s.events[2].dt[2], expected[3], 1e-6);
}

TEST(Sensitivity, EventsAreLeftOutWhereTheyAreNotRecorded)
{
    const auto s =
        sensitivities(BouncingBall(), {10.0, 0.0}, {}, {.t_end = 7, .record_events = false});
    EXPECT_TRUE(s.events.empty());
    EXPECT_TRUE(s.run.events.empty());
    EXPECT_EQ(s.run.statistics.events, 3u);
    EXPECT_TRUE(s.state.allFinite());
}

TEST(Sensitivity, TheVariationalSystemIsASystemLikeAnyOther)
{
    const Options options{.t_end = 7, .rtol = 1e-11, .atol = 1e-12};
    const Variational<BouncingBall> ball(BouncingBall(), {10.0, 0.0}, {}, options);
    static_assert(Variational<BouncingBall>::guard_count == 1);
    static_assert(!Guarded<Variational<Oscillator>, std::vector<double>>);
    const auto run = integrate(ball, ball.start(), options);
    EXPECT_EQ(run.events.size(), 3u);
    EXPECT_EQ(ball.components(run.x), 2u);
    EXPECT_EQ(ball.last_event(run.x), run.events.back().t);
    EXPECT_NEAR(ball.last_event_derivatives(run.x)[0], BallClosedForm().impact(2)[1], 1e-10);
    EXPECT_NEAR(ball.derivatives(run.x)(1, 0), BallClosedForm().state(2, 7)(1, 0), 1e-9);
}

TEST(Sensitivity, MonodromyIsTheDerivativeOverAPeriodAndNanWhereThereIsNone)
{
    const auto m = monodromy(Oscillator{}, {1.0, 0.0}, 1.0, {.rtol = 1e-12, .atol = 1e-12});
    EXPECT_NEAR(m(0, 1), std::sin(1.0), 1e-11);
    EXPECT_NEAR(m(1, 1), std::cos(1.0), 1e-11);
    // A ball without a rest rule gets no further than 27.1 s.
    const auto none = monodromy(ExactBall{}, {10.0, 0.0}, 30.0, {});
    EXPECT_TRUE(none.array().isNaN().all());
}

TEST(Sensitivity, SetUpsThatMakeNoSenseAreRefused)
{
    const BouncingBall ball;
    const X2 x0{10, 0};
    const Options options{.t_end = 1};
    const auto refuses = [&](const Directions<BouncingBall>& directions, const std::string& part) {
        try {
            (void)sensitivities(ball, x0, directions, options);
            ADD_FAILURE() << part;
        } catch (const std::invalid_argument& error) {
            EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
        }
    };
    const auto with = [](double r) { return BouncingBall({.restitution = r}); };
    refuses({.parameters = {{.nominal = 1}}}, "`with` is empty");
    refuses({.parameters = {{.with = with}}}, "nominal must be finite");
    refuses({.parameters = {{.with = with, .nominal = 0.9, .scale = -1}}}, "scale must be");
    refuses({.parameters = {{.with = with, .nominal = 0.9, .start = {1}}}}, "start must be");
    refuses({.parameters = {{.with = with, .nominal = 7}}}, "restitution must lie in [0, 1]");
    refuses({.differences = {.step = 0}}, "step must be positive");
    refuses({.differences = {.scale = {1, -1}}}, "every scale must be positive");
    refuses({.differences = {.scale = {1}}}, "one for each of 2 components, got 1");
    EXPECT_THROW((void)sensitivities(ball, {-1.0, 0.0}, {}, options), std::invalid_argument);
}

TEST(Sensitivity, EveryReasonHasANameAndASentence)
{
    for (int k = 0; k <= static_cast<int>(Undefined::non_finite); ++k) {
        EXPECT_NE(name(static_cast<Undefined>(k)), "unknown");
        EXPECT_GT(describe(static_cast<Undefined>(k)).size(), 10u);
    }
    EXPECT_EQ(name(Undefined::grazing), "grazing");
}

}  // namespace
}  // namespace ricochet::sensitivity_test
