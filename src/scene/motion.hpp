// Bounds on the motion of surfaces.
#pragma once

#include <string>

#include "ricochet/scene/scene.hpp"
#include "scene/vector2.hpp"

namespace ricochet::detail {

/// Largest values, at any time or until the next break. Infinite where nothing is known.
struct MotionBounds {
    double acceleration = 0;  ///< [m/s^2]
    double speed = 0;         ///< [m/s]
    double reach = 0;         ///< [m] of the displacement
};
[[nodiscard]] MotionBounds bounds_of(const SurfaceMotion& motion);

[[nodiscard]] inline bool moves(const SurfaceMotion& motion) noexcept
{
    return !std::holds_alternative<Fixed>(motion);
}

/// The first time after t at which the velocity jumps; infinite if there is none.
[[nodiscard]] double next_break(const SurfaceMotion& motion, double t);

/// Time until which a surface stands still if it does at t; t where it moves.
[[nodiscard]] double still_until(const SurfaceMotion& motion, double t);

/// @throws std::invalid_argument in a sentence about the motion of `whose`.
void check_motion(const SurfaceMotion& motion, const std::string& whose);

/// The same for the value of a function at the start.
void check_motion_at(const SurfaceMotion& motion, double t, const std::string& whose);

}  // namespace ricochet::detail
