// Contacts of plates: with discs, points and parallel plates, and with the walls that stop them.
#pragma once

#include <cstdint>

#include "scene/world.hpp"

namespace ricochet::detail {

/// First contact of a plate with a body that is no plate, or with a parallel one, before `t_end`.
[[nodiscard]] Meeting meet_plate(const World& world, const World::Plate& plate, std::uint32_t i,
                                 const Instant& t_end);

/// Gap between a plate and another body at t, and the direction in which the plate pushes it.
[[nodiscard]] FaceGap plate_gap(const World& world, const World::Plate& plate, std::uint32_t i,
                                const Instant& t);

/// First contact of a plate with a wall that does not move.
[[nodiscard]] Meeting meet_wall(const World& world, const World::Plate& plate, std::uint32_t wall);

/// [m] Gap between a plate with its middle at p and a wall that does not move.
[[nodiscard]] double wall_gap(const Face& wall, const World::Plate& plate, const Vector2& p);

/// Keeps the side of a plate on which a point, or a parallel plate, touches it now; `normal` is the
/// direction in which the plate pushes it. Where rounding has led it to the other side, its record
/// or that of the plate, one of which begins now, is corrected.
void touch_side(World& world, World::Plate& plate, std::uint32_t i, const Vector2& normal,
                const Instant& now);

}  // namespace ricochet::detail
