// Systems for tests of derivatives: a ball with closed forms, an oscillator.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <string>

#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::test {

using X1 = std::array<double, 1>;
using X2 = std::array<double, 2>;

/// Derivative at 0 of a function of one number: five points, error h^4 / 30 of the
/// fifth derivative.
template <class Function>
[[nodiscard]] double slope_at_zero(const Function& f, double h)
{
    return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
}

inline void expect_relative(double value, double expected, double tolerance,
                            const std::string& what)
{
    EXPECT_NEAR(value, expected, tolerance * std::abs(expected)) << what;
}

inline const Parameter<BouncingBall> restitution{
    .with = [](double r) { return BouncingBall({.restitution = r}); }, .nominal = 0.9};
inline const Parameter<BouncingBall> gravity{
    .with = [](double g) { return BouncingBall({.gravity = g}); }, .nominal = 9.81};

struct BallClosedForm {
    double u0 = 10, g = 9.81, r = 0.9;

    /// Time of impact n = 0, 1, ... and its derivatives by u0, v0 (at 0), r, g.
    [[nodiscard]] std::array<double, 5> impact(int n) const
    {
        const double t1 = std::sqrt(2 * u0 / g);
        double sum = 0;
        double by_r = 0;
        for (int k = 1; k <= n; ++k) {
            sum += std::pow(r, k);
            by_r += k * std::pow(r, k - 1);
        }
        const double t = t1 + 2 * t1 * sum;
        // t_1 = (v0 + sqrt(v0^2 + 2 g u0)) / g, and the speed of impact is stationary
        // at v0 = 0.
        return {t, t / (2 * u0), 1 / g, 2 * t1 * by_r, -t / (2 * g)};
    }

    /// Derivatives of (height, velocity) at t after impact n, by u0, v0, r, g: the ball
    /// left the floor at t_n with r^(n+1) sqrt(2 g u0).
    [[nodiscard]] Eigen::Matrix<double, 2, 4> state(int n, double t) const
    {
        const auto [tn, by_u0, by_v0, by_r, by_g] = impact(n);
        const double tau = t - tn;
        const double v1 = std::sqrt(2 * g * u0);
        const double vn = std::pow(r, n + 1) * v1;
        const Eigen::RowVector4d dt(by_u0, by_v0, by_r, by_g);
        const Eigen::RowVector4d dv(vn / (2 * u0), 0, (n + 1) * std::pow(r, n) * v1, vn / (2 * g));
        const Eigen::RowVector4d dg(0, 0, 0, 1);
        Eigen::Matrix<double, 2, 4> s;
        s.row(0) = tau * dv - (vn - g * tau) * dt - tau * tau / 2 * dg;
        s.row(1) = dv + g * dt - tau * dg;
        return s;
    }
};

/// The bouncing ball with derivatives in closed form.
struct ExactBall {
    using State = X2;
    double gravity = 9.81;
    double restitution = 0.9;
    double factor = 1;  // 1: the truth
    static constexpr bool unilateral = true;

    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -gravity;
    }
    template <class X>
    void flow_derivative(double, const X&, const X& s, X& ds) const
    {
        ds[0] = factor * s[1];
        ds[1] = 0;
    }
    template <class X>
    [[nodiscard]] double guard(double, const X& x) const
    {
        return x[0];
    }
    template <class X>
    [[nodiscard]] double guard_derivative(double, const X&, const X& s) const
    {
        return factor * s[0];
    }
    template <class X>
    void reset(double, X& x) const
    {
        x[0] = 0;
        x[1] *= -restitution;
    }
    template <class X>
    void reset_derivative(double, const X&, double, X& s) const
    {
        s[0] = 0;
        s[1] *= -factor * restitution;
    }
};

struct Oscillator {
    using State = X2;
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
};

}  // namespace ricochet::test
