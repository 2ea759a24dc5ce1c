// Oscillators whose passages through zero are only recorded.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "ricochet/guard.hpp"

namespace ricochet::test {

/// n harmonic oscillators side by side, whose upward passages through zero are
/// recorded and change nothing.
///
/// State (u_0, v_0, u_1, v_1, ...).
///
///     flow    u_i' = v_i,  v_i' = -w_i² u_i,  w_i evenly spread over [1, 2]
///     guard   u_i, rising
///
/// Known solution: u_i = cos(w_i t + p_i) with the phases p_i of `start`.
class Oscillators {
public:
    using State = std::vector<double>;
    static constexpr bool resets = false;

    explicit Oscillators(std::size_t n) : squares_(n)
    {
        for (std::size_t i = 0; i < n; ++i) squares_[i] = frequency(i) * frequency(i);
    }

    [[nodiscard]] std::size_t guard_count() const noexcept { return squares_.size(); }
    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.crossing = Crossing::rising, .degree = 1};
    }

    template <class X>
    void flow(double /*t*/, const X& x, X& dxdt) const noexcept
    {
        for (std::size_t i = 0; i < squares_.size(); ++i) {
            dxdt[2 * i] = x[2 * i + 1];
            dxdt[2 * i + 1] = -squares_[i] * x[2 * i];
        }
    }

    template <class X>
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const X& x) const noexcept
    {
        return x[2 * which];
    }

    template <class X, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double /*t*/, const X& /*x*/,
                                    const D& dxdt) const noexcept
    {
        return dxdt[2 * which];
    }

    /// [1/s] of oscillator i.
    [[nodiscard]] double frequency(std::size_t i) const noexcept
    {
        const auto n = static_cast<double>(squares_.size());
        return n > 1 ? 1 + static_cast<double>(i) / (n - 1) : 1.5;
    }
    /// [rad] of oscillator i at time 0: spread evenly over the circle, in an order that
    /// keeps neighbours apart (multiples of the golden section).
    [[nodiscard]] static double phase(std::size_t i) noexcept
    {
        const double turns = 0.25 + 0.6180339887498949 * static_cast<double>(i + 1);
        return 6.283185307179586 * (turns - std::floor(turns));
    }

    [[nodiscard]] State start() const
    {
        State x(2 * squares_.size());
        for (std::size_t i = 0; i < squares_.size(); ++i) {
            x[2 * i] = std::cos(phase(i));
            x[2 * i + 1] = -frequency(i) * std::sin(phase(i));
        }
        return x;
    }

    /// Time [s] of upward passage k = 0, 1, ... of oscillator i after time 0.
    [[nodiscard]] double passage(std::size_t i, std::size_t k) const noexcept
    {
        constexpr double circle = 6.283185307179586;
        double angle = 0.75 * circle - phase(i);  // cos rises through 0 at 3/4 of a turn
        if (angle <= 0) angle += circle;
        return (angle + circle * static_cast<double>(k)) / frequency(i);
    }

private:
    std::vector<double> squares_;  ///< w_i² [1/s²]
};

}  // namespace ricochet::test
