// Van der Pol's oscillator under a rectified sine.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

namespace ricochet {

/// Problem F3 of the DETEST collection: a force that is continuous and has a kink every
/// second.
///
/// State (y, y'), dimensionless.
///
///     flow    y'' = 0.01 y' (1 - y²) - y - |sin pi t|
///     time    events at every integer, where nothing happens: steps end there
///
/// (W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial value
/// methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to 27.)
///
/// Known solution: `at_end`. Functions are generic in the state type.
class DetestF3 {
public:
    using State = std::array<double, 2>;

    static constexpr std::string_view name = "detest-f3";
    static constexpr State start{0, 0};
    static constexpr double t_end = 20;  ///< [s]

    /// The state at `t_end`: Taylor series of high order, second by second, in arithmetic
    /// of 34 digits or more, checked against half the step.
    static constexpr State at_end{-0.37269575530881774, -0.62301379492341929};

    /// The sine of the fraction of t is the same as |sin pi t| and exact to rounding.
    template <class X>
    void flow(double t, const X& x, X& dxdt) const noexcept
    {
        const double force = std::sin(std::numbers::pi * (t - std::floor(t)));
        dxdt[0] = x[1];
        dxdt[1] = 0.01 * x[1] * (1 - x[0] * x[0]) - x[0] - force;
    }

    [[nodiscard]] double next_time_event(double t) const noexcept { return std::floor(t) + 1; }
    [[nodiscard]] double previous_time_event(double t) const noexcept { return std::ceil(t) - 1; }
};

}  // namespace ricochet
