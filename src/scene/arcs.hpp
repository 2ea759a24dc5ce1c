// The geometry of arcs: circles, and parts of them between two directions.
#pragma once

#include "scene/vector2.hpp"

namespace ricochet::detail {

/// The part of a circle that leads counterclockwise from one direction to another.
struct ArcSpan {
    Vector2 from{}, to{};  ///< directions from the centre, of length 1
    bool whole = false;    ///< a whole circle
    bool wide = false;     ///< more than half of one

    /// @param ends  on the circle; a whole circle where they are equal
    [[nodiscard]] static ArcSpan between(const Vector2& centre, const Vector2& start,
                                         const Vector2& end) noexcept
    {
        const Vector2 a = start - centre;
        const Vector2 b = end - centre;
        const double turn = cross(a, b);
        const bool opposite = turn == 0 && dot(a, b) < 0;
        return {(1 / norm(a)) * a, (1 / norm(b)) * b, start == end, turn < 0 && !opposite};
    }

    /// Whether a direction, of any length, is on the arc, or beside it by no more than this sine.
    [[nodiscard]] bool contains(const Vector2& direction, double slack) const noexcept
    {
        if (whole) return true;
        const double least = -slack * norm(direction);
        const bool after = cross(from, direction) >= least;
        const bool before = cross(direction, to) >= least;
        return wide ? after || before : after && before;
    }
};

/// The point of an arc that is nearest to p; at the centre, the start of the arc.
[[nodiscard]] inline Vector2 nearest_on_arc(const Vector2& centre, double radius,
                                            const ArcSpan& span, const Vector2& p) noexcept
{
    const Vector2 apart = p - centre;
    const double distance = norm(apart);
    const Vector2 start = centre + radius * span.from;
    if (distance == 0) return start;
    if (span.contains(apart, 0)) return centre + (radius / distance) * apart;
    const Vector2 end = centre + radius * span.to;
    return norm(p - start) <= norm(p - end) ? start : end;
}

}  // namespace ricochet::detail
