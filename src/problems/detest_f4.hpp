// A pulse, followed by a change of the flow.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

/// Problem F4 of the DETEST collection: a steep pulse, then a decay.
///
/// State (y), dimensionless; modes pulse and decay.
///
///     flow    pulse (t <= 10): y' = -2/21 - 120 (t - 5) / (1 + 4 (t - 5)²)¹⁶
///             decay (t > 10):  y' = -2 y
///     time    an event at 10 changes the mode
///
/// (W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial value
/// methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to 27.)
///
/// The flow of the pulse does not depend on y. On such quadratures the error estimate of
/// Fehlberg's pair of order 7 (8) is zero, whatever the step: it is the difference of
/// stages at equal times, 41/840 (k1 + k11 - k12 - k13). Run it with a largest step of
/// 0.05, or it steps over the pulse.
///
/// Known solution: y = 1 - 2 t / 21 + (1 + 4 (t - 5)²)⁻¹⁵ - 101⁻¹⁵ up to y(10) = 1/21,
/// then exp(-2 (t - 10)) / 21; see `solution`. Functions are generic in the state and its
/// scalar.
class DetestF4 {
public:
    using State = std::array<double, 1>;

    enum : Mode { pulse, decay };

    static constexpr std::string_view name = "detest-f4";
    static constexpr State start{1};
    static constexpr double change = 10;  ///< [s]
    static constexpr double t_end = 20;   ///< [s]
    static constexpr std::size_t mode_count = 2;

    [[nodiscard]] static constexpr std::string_view mode_name(Mode mode) noexcept
    {
        return mode == pulse ? "pulse" : "decay";
    }

    template <class X>
    constexpr void flow(Mode mode, const ScalarOf<X>& t, const X& x, X& dxdt) const noexcept
    {
        if (mode == decay) {
            dxdt[0] = -2 * x[0];
            return;
        }
        const ScalarOf<X> s = t - 5;
        ScalarOf<X> power = 1 + 4 * s * s;
        for (int i = 0; i < 4; ++i) power *= power;
        dxdt[0] = -2.0 / 21 - 120 * s / power;
    }

    [[nodiscard]] double next_time_event(double t) const noexcept
    {
        return t < change ? change : std::numeric_limits<double>::infinity();
    }
    [[nodiscard]] double previous_time_event(double t) const noexcept
    {
        return t > change ? change : -std::numeric_limits<double>::infinity();
    }

    template <class X>
    [[nodiscard]] Mode time_reset(Mode mode, double /*t*/, X& /*x*/) const noexcept
    {
        return mode == pulse ? decay : pulse;
    }

    /// The state at t >= 0 [s] from `start` at time 0.
    [[nodiscard]] static State solution(double t) noexcept;
};

}  // namespace ricochet
