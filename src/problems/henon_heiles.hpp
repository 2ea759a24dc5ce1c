// The Henon-Heiles system and its surface of section.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

/// A star in the meridian plane of a galaxy with a potential of third degree.
///
/// State (vx, vy, x, y), dimensionless; passages through the plane x = 0 with x rising are
/// recorded, and change nothing.
///
///     flow    vx' = -x - 2 x y,  vy' = -y - x² + y²,  x' = vx,  y' = vy
///     guard   x, rising
///
/// (M. Henon and C. Heiles, The applicability of the third integral of motion: some
/// numerical experiments, Astronomical Journal 69, 1964, pages 73 to 79.)
///
/// Known solution: the energy is conserved, and from `start`, on the level 0.083333,
/// the first six passages are at `section_times`. Functions are generic in the state and its
/// scalar.
class HenonHeiles {
public:
    using State = std::array<double, 4>;
    static constexpr bool resets = false;

    static constexpr std::string_view name = "henon-heiles";
    static constexpr State start{-0.2525875586263492, -0.2178423952983717, 0, 0.2587703282931232};

    /// [s] Times of the first passages after `start`: Taylor series of high order in arithmetic of
    /// 34 digits or more, checked against half the step. They are given to more digits than a
    /// double holds.
    static constexpr std::array<double, 6> section_times{
        4.2208334830171685797, 10.552008560025788047, 15.887489913811527472,
        21.257937652710846512, 27.611348274257833980, 34.276637864819525341};

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "section", .crossing = Crossing::rising};
    }

    template <class X>
    constexpr void flow(const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = -x[2] - 2 * x[2] * x[3];
        dxdt[1] = -x[3] - x[2] * x[2] + x[3] * x[3];
        dxdt[2] = x[0];
        dxdt[3] = x[1];
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(const ScalarOf<X>& /*t*/, const X& x) const noexcept
    {
        return x[2];
    }

    /// Kinetic and potential energy, conserved.
    template <class X>
    [[nodiscard]] double energy(const X& x) const noexcept
    {
        return (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]) / 2 +
               x[3] * (x[2] * x[2] - x[3] * x[3] / 3);
    }
};

}  // namespace ricochet
