// Problems whose event times are known, with the digits of their references.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::bench {

/// A system with its reference.
template <class S, class X>
struct Problem {
    using System = S;
    using State = X;

    std::string name;
    System system;
    X x0;
    double t_end = 0;            ///< [s]
    std::vector<double> events;  ///< [s] every event up to t_end, ascending
};

using BallProblem = Problem<BouncingBall, std::array<double, 2>>;

/// The ball of Saunders, Steyer and Kuether (SAND2023-06682C), dropped from 10 m.
/// Event times are t1 = sqrt(20 / 9.81), t_{n+1} = t_n + 2 t1 0.9^n in arithmetic
/// of 34 digits, written down with 19 or 20.
[[nodiscard]] inline BallProblem b1()
{
    return {.name = "b1",
            .system = BouncingBall({.gravity = 9.81, .restitution = 0.9}),
            .x0 = {10, 0},
            .t_end = 20.5,
            .events = {1.427843122927064467, 3.997960744195780508, 6.311066603337624944,
                       8.392861876565284937, 10.266477622470178930, 11.952731793784583525,
                       13.470360547967547659, 14.836226426732215381, 16.065505717620416330,
                       17.171857079419797184, 18.167573305039239953, 19.063717908096738445,
                       19.870248050848487088}};
}

/// A ball that loses more: restitution 0.7, from 1 m, to just after impact 6 (its
/// impacts accumulate at 2.5586 s). Closed form as for `b1`, 16 digits.
[[nodiscard]] inline BallProblem b2()
{
    return {.name = "b2",
            .system = BouncingBall({.gravity = 9.81, .restitution = 0.7}),
            .x0 = {1, 0},
            .t_end = 2.25,
            .events = {0.4515236409857309, 1.083656738365754, 1.52614990653177, 1.835895124247982,
                       2.05271677664933, 2.204491933330273}};
}

/// Restitution 0.9, from 1 m, four impacts. Closed form as for `b1`, 16 digits.
[[nodiscard]] inline BallProblem b3()
{
    return {
        .name = "b3",
        .system = BouncingBall({.gravity = 9.81, .restitution = 0.9}),
        .x0 = {1, 0},
        .t_end = 3,
        .events = {0.4515236409857308, 1.264266194760045, 1.995734493156927, 2.654055961714119}};
}

/// A spiral that winds outwards to a limit cycle, with a reset that moves it back inside: smooth,
/// nonlinear, and solved in closed form from event to event. Except for rounding, all error is that
/// of the method.
///
///     flow    x' = x (1 - x² - y²) - 3 y,  y' = y (1 - x² - y²) + 3 x
///     guard   0.9² - x² - y², falling
///     reset   (x, y)⁺ = (x, y)⁻ / 2
///
/// In polar coordinates the angle is 3 t, and 1 / r² - 1 decays as exp(-2 t).
struct Spiral {
    using State = std::array<double, 2>;

    static constexpr double turn = 3;      ///< [1/s] angular velocity
    static constexpr double rim = 0.9;     ///< radius of the event surface
    static constexpr double shrink = 0.5;  ///< factor of the reset

    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const noexcept
    {
        const double growth = 1 - x[0] * x[0] - x[1] * x[1];
        dxdt[0] = x[0] * growth - turn * x[1];
        dxdt[1] = x[1] * growth + turn * x[0];
    }

    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const noexcept
    {
        return rim * rim - x[0] * x[0] - x[1] * x[1];
    }

    template <class X>
    [[nodiscard]] double guard_rate(double /*t*/, const X& x, const X& dxdt) const noexcept
    {
        return -2 * (x[0] * dxdt[0] + x[1] * dxdt[1]);
    }

    template <class X>
    void reset(double /*t*/, X& x) const noexcept
    {
        x[0] *= shrink;
        x[1] *= shrink;
    }

    [[nodiscard]] static double excess(double r) noexcept { return 1 / (r * r) - 1; }

    /// [s] from radius `shrink` * `rim` to the rim.
    [[nodiscard]] static double period() noexcept
    {
        return 0.5 * std::log(excess(shrink * rim) / excess(rim));
    }

    /// The solution from (shrink * rim, 0) at time t [s], between events.
    [[nodiscard]] static State solution(double t) noexcept
    {
        const double flight = std::fmod(t, period());
        const double r = 1 / std::sqrt(1 + excess(shrink * rim) * std::exp(-2 * flight));
        return {r * std::cos(turn * t), r * std::sin(turn * t)};
    }
};

/// Four and a half flights of the spiral.
[[nodiscard]] inline Problem<Spiral, Spiral::State> spiral()
{
    const double period = Spiral::period();
    return {.name = "spiral",
            .system = {},
            .x0 = {Spiral::shrink * Spiral::rim, 0},
            .t_end = 4.5 * period,
            .events = {period, 2 * period, 3 * period, 4 * period}};
}

/// A pendulum of 1 m, x'' = -9.8 sin x, with a guard far above it: the cost of a guard that never
/// fires.
struct WatchedPendulum {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;

    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.8 * std::sin(x[0]);
    }

    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const noexcept
    {
        return x[0] + 10;
    }

    template <class X>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const X& dxdt) const noexcept
    {
        return dxdt[0];
    }
};

/// The flow of another system without its guard, for the cost of the plain step.
template <class System>
class Unguarded {
public:
    using State = typename System::State;

    explicit Unguarded(System system) : system_(std::move(system)) {}

    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        system_.flow(t, x, dxdt);
    }

private:
    System system_;
};

}  // namespace ricochet::bench
