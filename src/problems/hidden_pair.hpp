// Three zeros of a cubic, two of which hide in a long step.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

/// A cubic in time as the solution of a differential equation.
///
/// State (y); its zeros are recorded, and change nothing.
///
///     flow    y' = 3 t² + 12 t - 4
///     guard   y, either direction
///
/// From `start` at `t_start` it is y = (t + 6) (t + 2) (t - 2), which has its zeros at
/// `zeros`. Every method of order three or more is exact on it, so that error control
/// takes long steps, and a step that holds two zeros has y of one sign at both ends.
/// Functions are generic in the state and its scalar.
class HiddenPair {
public:
    using State = std::array<double, 1>;
    static constexpr bool resets = false;

    static constexpr std::string_view name = "hidden-pair";
    static constexpr double t_start = -8;  ///< [s]
    static constexpr double t_end = 4;     ///< [s]
    static constexpr State start{-120};
    static constexpr std::array<double, 3> zeros{-6, -2, 2};  ///< [s]

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "zero", .crossing = Crossing::either};
    }

    template <class X>
    constexpr void flow(const ScalarOf<X>& t, const X& /*x*/, X& dxdt) const noexcept
    {
        dxdt[0] = (3 * t + 12) * t - 4;
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(const ScalarOf<X>& /*t*/, const X& x) const noexcept
    {
        return x[0];
    }
};

}  // namespace ricochet
