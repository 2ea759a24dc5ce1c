// Growth toward a level that changes every second.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

/// Problem F2 of the DETEST collection: a relaxation with two alternating rates.
///
/// State (y), dimensionless; modes even and odd, of the whole part of t.
///
///     flow    y' = 55 - 1.5 y (even) or 55 - 0.5 y (odd)
///     time    events at every integer change the mode
///
/// (W. H. Enright and J. D. Pryce, Two FORTRAN packages for assessing initial value
/// methods, ACM Transactions on Mathematical Software 13, 1987, pages 1 to 27.)
///
/// Known solution: exponentials toward 110/3 and 110; see `solution`. Functions are generic in the
/// state and its scalar.
class DetestF2 {
public:
    using State = std::array<double, 1>;

    enum : Mode { even, odd };

    static constexpr std::string_view name = "detest-f2";
    static constexpr State start{110};
    static constexpr double t_end = 20;  ///< [s]
    static constexpr std::size_t mode_count = 2;

    [[nodiscard]] static constexpr std::string_view mode_name(Mode mode) noexcept
    {
        return mode == even ? "even" : "odd";
    }

    template <class X>
    constexpr void flow(Mode mode, const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = 55 - (mode == even ? 1.5 : 0.5) * x[0];
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
};

}  // namespace ricochet
