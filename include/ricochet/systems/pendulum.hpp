// The plane pendulum and its turning points.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

struct SystemDescriptor;

/// A point mass on a massless rod, swinging without friction.
///
/// State x = (angle a [rad], rate w [rad/s]); its turning points are recorded, and change nothing.
///
///     flow    x' = (w, -(gravity / length) sin a)
///     guard   w, either direction
///
/// Known solution: from rest the turning points are equally spaced by half the period,
///
///     half period = pi sqrt(length / gravity) / agm(1, cos(a0 / 2)),
///
/// where agm is the arithmetic-geometric mean (Gauss; Legendre's complete elliptic
/// integral K(sin(a0 / 2)) equals pi / 2 over that mean). The first of them is the
/// start itself, which is no event. Functions are generic in the state and its
/// scalar.
class Pendulum {
public:
    using State = std::array<double, 2>;
    static constexpr bool resets = false;

    struct Parameters {
        double gravity = 9.8;  ///< [m/s²], positive
        double length = 1;     ///< [m], positive
    };

    constexpr Pendulum() = default;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit Pendulum(const Parameters& parameters);

    static constexpr std::string_view name = "pendulum";
    /// Names, units, ranges and what is known; see descriptor.hpp.
    [[nodiscard]] static const SystemDescriptor& descriptor();
    static constexpr State start{-0.05, 0};

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "turning-point", .crossing = Crossing::either};
    }

    template <class X>
    constexpr void flow(const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -stiffness_ * sin(x[0]);
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(const ScalarOf<X>& /*t*/, const X& x) const noexcept
    {
        return x[1];
    }

    /// Time [s] between turning points at +-`amplitude` [rad], which is in (-pi, pi).
    [[nodiscard]] double half_period(double amplitude = start[0]) const noexcept;

private:
    double stiffness_ = Parameters{}.gravity / Parameters{}.length;  ///< [1/s²]
};

}  // namespace ricochet
