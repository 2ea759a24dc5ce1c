// A forced oscillator whose force changes its sign every second.
#pragma once

#include <array>
#include <cmath>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

/// Problem F1 of the DETEST collection: an unstable oscillator under a square wave.
///
/// State (y, y'), dimensionless; modes even and odd, of the whole part of t.
///
///     flow    y'' = 0.2 y' - (pi² + 0.01) y + 1 (even) or - 1 (odd)
///     time    events at every integer change the mode
///
/// (W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial value
/// methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to 27.)
///
/// Known solution: the roots of the characteristic polynomial are 0.1 +- i pi, so that
/// over a second the state's distance from the equilibrium +-1 / (pi² + 0.01) is
/// multiplied by -exp(0.1); see `solution`. Functions are generic in the state and its
/// scalar.
class DetestF1 {
public:
    using State = std::array<double, 2>;

    enum : Mode { even, odd };

    static constexpr std::string_view name = "detest-f1";
    static constexpr State start{0, 0};
    static constexpr double t_end = 20;  ///< [s]
    static constexpr std::size_t mode_count = 2;

    [[nodiscard]] static constexpr std::string_view mode_name(Mode mode) noexcept
    {
        return mode == even ? "even" : "odd";
    }

    template <class X>
    constexpr void flow(Mode mode, const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = x[1];
        dxdt[1] = 0.2 * x[1] - stiffness * x[0] + (mode == even ? 1 : -1);
    }

    [[nodiscard]] double next_time_event(double t) const noexcept { return std::floor(t) + 1; }
    [[nodiscard]] double previous_time_event(double t) const noexcept { return std::ceil(t) - 1; }

    template <class X>
    [[nodiscard]] Mode time_reset(Mode mode, double /*t*/, X& /*x*/) const noexcept
    {
        return mode == even ? odd : even;
    }

    /// The state at t >= 0 [s] from `start` at time 0.
    [[nodiscard]] static State solution(double t) noexcept;

private:
    static constexpr double stiffness = 9.8796044010893586188;  // pi² + 0.01
};

}  // namespace ricochet
