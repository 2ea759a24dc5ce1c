// An oscillator with dry friction comes to rest after finitely many turns.
#pragma once

#include <numbers>
#include <string_view>

#include "ricochet/systems/friction_oscillator.hpp"

namespace ricochet {

struct SystemDescriptor;

/// A mass on a spring under Coulomb's friction of constant size.
///
/// A `FrictionOscillator` on ground at rest: the modes slip-left, slip-right and stick,
///
///     flow    mass u'' = -stiffness u -+ friction, against the motion
///     guard   stop: the velocity reaches zero
///     reset   stick where stiffness |u| <= static_friction, else turn back
///
/// Known solution: half a cosine between turning points, so that the turns are at
/// multiples of pi sqrt(mass / stiffness), each 2 friction / stiffness nearer to zero than the
/// one before; see `turning_time` and `turning_point`. By default, from u = 2, they are
/// at u = -1.4, 0.8 and -0.2, where the mass sticks.
class CoulombOscillator : public FrictionOscillator {
public:
    struct Parameters {
        double mass = 1;               ///< [kg], positive
        double stiffness = 1;          ///< [N/m], positive
        double friction = 0.3;         ///< [N] while slipping, zero or positive
        double static_friction = 0.3;  ///< [N] largest force while sticking, at least `friction`
    };

    constexpr CoulombOscillator()
        : FrictionOscillator(
              {.friction = Parameters{}.friction, .static_friction = Parameters{}.static_friction},
              Unchecked{})
    {
    }

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit CoulombOscillator(const Parameters& parameters);

    static constexpr std::string_view name = "coulomb-oscillator";
    /// Names, units, ranges and what is known; see descriptor.hpp.
    [[nodiscard]] static const SystemDescriptor& descriptor();
    static constexpr State start{2, 0};
    static constexpr Mode start_mode = slip_left;

    /// Time [s] of the n-th stop after a start at rest, n = 1, 2, ...
    [[nodiscard]] double turning_time(int n) const noexcept;

    /// Position [m] of the n-th stop after a start at rest at u = `from` [m] > 0, if the mass
    /// sticks at none of the stops before it.
    [[nodiscard]] double turning_point(int n, double from = start[0]) const noexcept;

    /// The number of stops from u = `from` [m] > 0, the last of which sticks; zero if the mass
    /// sticks at the start, the largest integer if it never does.
    [[nodiscard]] int stops(double from = start[0]) const noexcept;

private:
    double half_period_ = std::numbers::pi;        ///< [s]
    double loss_ = 2 * Parameters{}.friction;      ///< [m] amplitude lost at each turn
    double reach_ = Parameters{}.static_friction;  ///< [m] largest |u| at which it sticks
};

}  // namespace ricochet
