// Prescribed motions of surfaces: translations as functions of time, with bounds from which a run
// proves that it misses no contact.
//
// A surface is translated, without rotation, from the position in its description. It pushes the
// bodies that it meets; bodies do not affect its motion.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <variant>
#include <vector>

namespace ricochet {

/// A surface that stays where it is described.
struct Fixed {};

/// displacement(t) = amplitude sin(2 pi frequency t + phase)
struct Oscillation {
    std::array<double, 2> amplitude{};  ///< [m]
    double frequency = 1;               ///< [Hz], positive
    double phase = 0;                   ///< [rad]
};

/// displacement(t) = velocity (t - since) for all t, including t < since
struct ConstantVelocity {
    std::array<double, 2> velocity{};  ///< [m/s]
    double since = 0;                  ///< [s] time of zero displacement
};

/// Linear interpolation between displacements at given times; at rest before the first and after
/// the last of them. At a time where the velocity changes, the later velocity applies.
struct PiecewiseLinear {
    std::vector<double> times{};                         ///< [s] strictly ascending, at least one
    std::vector<std::array<double, 2>> displacements{};  ///< [m] one for each time
};

/// Motion given by functions without side effects. The velocity must be the derivative of the
/// displacement and continuous. If a bound is found to be violated between two evaluations, the run
/// ends with `Outcome::wrong_bound`; a violation that is not detected may cause a missed contact.
struct GivenMotion {
    std::function<std::array<double, 2>(double t)> displacement{};         ///< [m]
    std::function<std::array<double, 2>(double t)> velocity{};             ///< [m/s]
    double acceleration_bound = std::numeric_limits<double>::quiet_NaN();  ///< [m/s^2] required
    double speed_bound = std::numeric_limits<double>::infinity();          ///< [m/s] optional
    double reach = std::numeric_limits<double>::infinity();  ///< [m] of |displacement|, optional
};

using SurfaceMotion =
    std::variant<Fixed, Oscillation, ConstantVelocity, PiecewiseLinear, GivenMotion>;

/// Displacement [m] and velocity [m/s] of a surface at the time t [s].
[[nodiscard]] std::array<double, 2> displacement(const SurfaceMotion& motion, double t);
[[nodiscard]] std::array<double, 2> velocity(const SurfaceMotion& motion, double t);

}  // namespace ricochet
