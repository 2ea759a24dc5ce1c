// Stiff hybrid systems, on which explicit methods are slow.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "ricochet/guard.hpp"

namespace ricochet::hosts_test {

/// Robertson's reaction with a valve: it opens when the first species has fallen to 0.5 and
/// closes when it is back at 0.7. The inflow of the first equals the outflow of the third.
struct RobertsonValve {
    using State = std::array<double, 3>;
    enum : Mode { closed, open };
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 2;
    static constexpr double inflow = 0.02;  ///< [1/s]

    template <class X>
    constexpr void flow(Mode mode, const ScalarOf<X>& /*t*/, const X& y, X& rate) const
    {
        const ScalarOf<X> slow = 0.04 * y[0];
        const ScalarOf<X> back = 1e4 * y[1] * y[2];
        const ScalarOf<X> fast = 3e7 * y[1] * y[1];
        const double in = mode == open ? inflow : 0;
        rate[0] = in - slow + back;
        rate[1] = slow - back - fast;
        rate[2] = fast - in;
    }
    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(std::size_t which, Mode /*mode*/,
                                              const ScalarOf<X>& /*t*/, const X& y) const
    {
        return which == closed ? y[0] - 0.5 : 0.7 - y[0];
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const { return which == mode; }
    [[nodiscard]] Mode reset(std::size_t which, Mode /*mode*/, double /*t*/, State& /*y*/) const
    {
        return which == closed ? open : closed;
    }
};

/// A buck converter, 24 V to about 12 V, with a switch of 10 kHz and a diode, each of 0.1 Ohm, and
/// 1 nF at the node between them: rates of 1e10/s, a million times those of the switch.
struct BuckConverter {
    using State = std::array<double, 3>;  ///< current [A], output [V], node [V]
    enum : Mode { switched_on = 1, conducts = 2 };
    static constexpr std::size_t mode_count = 4;
    static constexpr std::size_t guard_count = 2;
    static constexpr double half_period = 5e-5;  ///< [s]

    template <class X>
    constexpr void flow(Mode mode, const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const
    {
        using S = ScalarOf<X>;
        const double resistance = 0.1;
        const S through_switch = mode & switched_on ? S((24 - x[2]) / resistance) : S(0);
        const S through_diode = mode & conducts ? S(-x[2] / resistance) : S(0);
        dxdt[0] = (x[2] - x[1]) / 5e-4;
        dxdt[1] = (x[0] - x[1] / 5) / 1e-4;
        dxdt[2] = (through_switch + through_diode - x[0] - x[2] / 1e5) / 1e-9;
    }
    /// The diode conducts while the node is below ground.
    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(std::size_t which, Mode /*mode*/,
                                              const ScalarOf<X>& /*t*/, const X& x) const
    {
        return which == 0 ? x[2] : -x[2];
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        return (which == 1) == ((mode & conducts) != 0);
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double /*t*/, State& /*x*/) const
    {
        return which == 0 ? mode | conducts : mode & ~Mode{conducts};
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        return (std::floor(t / half_period + 1e-6) + 1) * half_period;
    }
    [[nodiscard]] Mode time_reset(Mode mode, double /*t*/, State& /*x*/) const
    {
        return mode ^ switched_on;
    }
};

}  // namespace ricochet::hosts_test
