// A periodic orbit of the restricted three-body problem.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

/// A spacecraft in the plane of the Earth and the Moon, which circle their centre of
/// mass: the restricted three-body problem, in the frame that turns with them and in
/// units of their distance, their mass and their angular velocity.
///
/// State (x, y, vx, vy). With m the mass fraction of the Moon, which is at (1 - m, 0), n = 1 - m
/// the fraction of the Earth, at (-m, 0), and r1, r2 the distances from Earth and Moon,
///
///     flow    x'' = x + 2 y' - n (x + m) / r1³ - m (x - n) / r2³
///             y'' = y - 2 x' - n y / r1³ - m y / r2³
///     guard   d/dt |position - start position|², either direction
///
/// so that the events are the points of the orbit farthest from its start (falling) and
/// nearest to it (rising). (L. F. Shampine and M. K. Gordon, Computer solution of
/// ordinary differential equations: the initial value problem, Freeman, 1975, page 246.)
///
/// Known solution: `jacobi` is conserved, and from `start` with the default mass ratio
/// the orbit is closed, with one event half way and one at the end. Functions are
/// generic in the state and its scalar.
class ThreeBody {
public:
    using State = std::array<double, 4>;
    static constexpr bool resets = false;

    struct Parameters {
        double mass_ratio = 1 / 82.45;  ///< Moon over both, in (0, 1/2]
    };

    constexpr ThreeBody() = default;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit ThreeBody(const Parameters& parameters);

    static constexpr std::string_view name = "three-body";
    static constexpr State start{1.2, 0, 0, -1.04935750983031990726};

    /// [s] Times at which the craft is farthest from the start, and back at it: Taylor series of
    /// high order in arithmetic of 34 digits or more, checked against half the step. The orbit is
    /// symmetric, so that the first is half of the second.
    static constexpr double farthest_time = 3.09608466565981985;
    static constexpr double return_time = 6.19216933131963971;

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "apsis", .crossing = Crossing::either};
    }

    template <class X>
    constexpr void flow(const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        using std::sqrt;
        const double moon = mass_ratio_;
        const double earth = 1 - moon;
        const ScalarOf<X> y2 = x[1] * x[1];
        const ScalarOf<X> from_earth = sqrt((x[0] + moon) * (x[0] + moon) + y2);
        const ScalarOf<X> from_moon = sqrt((x[0] - earth) * (x[0] - earth) + y2);
        const ScalarOf<X> a1 = earth / (from_earth * from_earth * from_earth);
        const ScalarOf<X> a2 = moon / (from_moon * from_moon * from_moon);
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = x[0] + 2 * x[3] - a1 * (x[0] + moon) - a2 * (x[0] - earth);
        dxdt[3] = x[1] - 2 * x[2] - a1 * x[1] - a2 * x[1];
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(const ScalarOf<X>& /*t*/, const X& x) const noexcept
    {
        return 2 * ((x[0] - start[0]) * x[2] + (x[1] - start[1]) * x[3]);
    }

    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& x, const D& dxdt) const noexcept
    {
        return 2 * (dxdt[0] * x[2] + dxdt[1] * x[3] + (x[0] - start[0]) * dxdt[2] +
                    (x[1] - start[1]) * dxdt[3]);
    }

    /// Jacobi's integral, conserved.
    template <class X>
    [[nodiscard]] double jacobi(const X& x) const noexcept
    {
        const double earth = 1 - mass_ratio_;
        return x[0] * x[0] + x[1] * x[1] + 2 * earth / std::hypot(x[0] + mass_ratio_, x[1]) +
               2 * mass_ratio_ / std::hypot(x[0] - earth, x[1]) - x[2] * x[2] - x[3] * x[3];
    }

private:
    double mass_ratio_ = Parameters{}.mass_ratio;
};

}  // namespace ricochet
