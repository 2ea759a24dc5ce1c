// The stick-slip oscillator: a mass on a moving belt.
#pragma once

#include <string_view>

#include "ricochet/systems/friction_oscillator.hpp"

namespace ricochet {

struct SystemDescriptor;

/// A mass held by a spring on a belt that carries it along, with friction that falls
/// with the sliding speed.
///
/// A `FrictionOscillator` with, by default, unit mass and stiffness on a belt of speed
/// 0.2 and the friction 1 / (1 + 3 s); sticking holds up to its value at s = 0.
///
/// (R. I. Leine, D. H. van Campen, A. de Kraker and L. van den Steen, Stick-slip
/// vibrations induced by alternate friction models, Nonlinear Dynamics 16, 1998, pages
/// 41 to 54.)
///
/// Known solution: from `start`, the onset of slip, the mass slips back and sticks again
/// at `stick_time`; the belt carries it back to `start` by the time `period`. Sticking takes
/// (1 - stick_position) / 0.2.
class StickSlip : public FrictionOscillator {
public:
    struct Parameters {
        double mass = 1;          ///< [kg], positive
        double stiffness = 1;     ///< [N/m], positive
        double belt_speed = 0.2;  ///< [m/s]
        double friction = 1;      ///< [N] at sliding speed 0, also of sticking; >= 0
        double weakening = 3;     ///< [s/m], zero or positive
    };

    constexpr StickSlip() : FrictionOscillator(as_oscillator(Parameters{}), Unchecked{}) {}

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit StickSlip(const Parameters& parameters)
        : FrictionOscillator(as_oscillator(parameters), "StickSlip")
    {
    }

    static constexpr std::string_view name = "stick-slip";
    /// Names, units, ranges and what is known; see descriptor.hpp.
    [[nodiscard]] static const SystemDescriptor& descriptor();
    static constexpr State start{1, 0.2};
    static constexpr Mode start_mode = slip_left;

    /// Values for the default parameters, by Taylor series of high order in arithmetic of 34
    /// digits or more, checked against half the step.
    static constexpr double stick_time = 4.2959995254801548834;     ///< [s]
    static constexpr double stick_position = -0.54100635387008475;  ///< [m]
    static constexpr double period = 12.001031294830578647;         ///< [s]

private:
    [[nodiscard]] static constexpr FrictionOscillator::Parameters as_oscillator(
        const Parameters& parameters) noexcept
    {
        return {.mass = parameters.mass,
                .stiffness = parameters.stiffness,
                .belt_speed = parameters.belt_speed,
                .friction = parameters.friction,
                .static_friction = parameters.friction,
                .weakening = parameters.weakening};
    }
};

}  // namespace ricochet
