// Given motions of surfaces: translations as functions of time, with bounds by which a run proves
// that no earlier contact exists.
//
// A surface is translated, without rotation, from its described position. Bodies that it meets are
// pushed with its velocity; no body moves a surface.
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

/// displacement(t) = velocity (t - since), from the beginning of time on
struct ConstantVelocity {
    std::array<double, 2> velocity{};  ///< [m/s]
    double since = 0;                  ///< [s] when the surface is where it is described
};

/// Linear interpolation between displacements at given times; at rest before the first and after
/// the last of them. At a time where the velocity changes, the later velocity applies.
struct PiecewiseLinear {
    std::vector<double> times{};                         ///< [s] strictly ascending, at least one
    std::vector<std::array<double, 2>> displacements{};  ///< [m] one for each time
};

/// A motion by functions without side effects. The velocity must be the derivative of the
/// displacement and continuous. A bound that is found broken between two evaluations ends the run
/// as `Outcome::wrong_bound`; one that is broken unseen may lose a contact.
struct GivenMotion {
    std::function<std::array<double, 2>(double t)> displacement{};         ///< [m]
    std::function<std::array<double, 2>(double t)> velocity{};             ///< [m/s]
    double acceleration_bound = std::numeric_limits<double>::quiet_NaN();  ///< [m/s^2] required
    double speed_bound = std::numeric_limits<double>::infinity();          ///< [m/s] saves work
    double reach = std::numeric_limits<double>::infinity();  ///< [m] |displacement|, saves work
};

using SurfaceMotion =
    std::variant<Fixed, Oscillation, ConstantVelocity, PiecewiseLinear, GivenMotion>;

/// Displacement [m] and velocity [m/s] of a surface at the time t [s].
[[nodiscard]] std::array<double, 2> displacement(const SurfaceMotion& motion, double t);
[[nodiscard]] std::array<double, 2> velocity(const SurfaceMotion& motion, double t);

}  // namespace ricochet
