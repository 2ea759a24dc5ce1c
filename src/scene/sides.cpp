// Determines the side of a segment on which a point is. Its rounded coordinates do not determine
// it for a point on the line, so its record keeps the sides of the segments that it touches.
#include <algorithm>

#include "scene/world.hpp"

namespace ricochet::detail {

namespace {

[[nodiscard]] double height(const Face& face, const Vector2& p) noexcept
{
    if (face.kind == Face::Kind::arc) return norm(p - face.at) - face.length;
    return dot(p - face.at, face.normal);
}

/// The direction in which the height grows at p.
[[nodiscard]] Vector2 upwards(const Face& face, const Vector2& p) noexcept
{
    if (face.kind != Face::Kind::arc) return face.normal;
    const Vector2 apart = p - face.at;
    return (1 / norm(apart)) * apart;
}

[[nodiscard]] double rounding_at(const Face& face, const Vector2& p) noexcept
{
    const double of_circle = face.kind == Face::Kind::arc ? 8 * epsilon * face.length : 0;
    return World::rounding(p, 0) + World::blur(face, 0) + of_circle;
}

/// Whether the chain turns to the side of its normals from one segment to the next, so that the
/// angle on that side is the smaller one.
[[nodiscard]] bool turns_up(const Face& first, const Face& second) noexcept
{
    return dot(turned(first.normal), second.normal) >= 0;
}

}  // namespace

bool World::begins_above(const Body& body, std::uint32_t f) const
{
    const Face& face = faces[f];
    const double up = height(face, body.p);
    if (body.radius > 0 || std::fabs(up) > rounding_at(face, body.p)) return up > 0;
    for (const std::uint32_t which : {f, face.previous, face.next}) {
        if (which == none) continue;
        for (const std::uint32_t side : body.sides) {
            if (side != none && side / 2 == which) return side % 2 == 1;
        }
    }
    // Nothing is known before the first contact: the motion then determines the side, and a point
    // that does not move lies upon the segment.
    const Vector2 up_here = upwards(face, body.p);
    const double rate = dot(body.v, up_here);
    if (std::fabs(rate) > noise(body.v, {})) return rate > 0;
    return dot(gravity, up_here) <= 0;
}

/// A body that reaches an arc comes from the side against which it moves, unless it has just left
/// it: through the gap of an arc it may have come to the other side.
bool World::arrives_outside(const Body& body, std::uint32_t f, const Vector2& p,
                            const Vector2& v) const
{
    const Face& face = faces[f];
    const double up = height(face, p);
    const double rounding = 4 * rounding_at(face, p);
    if (body.radius > 0 || std::fabs(up) > rounding) return up > 0;
    const double rate = dot(v, upwards(face, p));
    const bool has_moved = norm(p - body.p) > rounding;
    return has_moved && std::fabs(rate) > noise(v, {}) ? rate < 0 : begins_above(body, f);
}

bool World::arrives_above(const Body& body, std::uint32_t f, const Vector2& p,
                          const Vector2& v) const
{
    const Face& face = faces[f];
    if (face.kind == Face::Kind::arc) return arrives_outside(body, f, p, v);
    if (body.radius > 0) return height(face, p) > 0;
    const bool above = begins_above(body, f);
    const double start = height(face, body.p);
    const double rounding = rounding_at(face, body.p);
    if (std::fabs(start) <= rounding) return above;
    if (body.quartic) {
        // A step may cross the line more than once.
        const double up = height(face, p);
        if (std::fabs(up) > 4 * rounding_at(face, p)) return up > 0;
        const double falls = -dot(v, face.normal);
        return std::fabs(falls) > noise(v, {}) ? falls > 0 : above;
    }
    // The point has passed the end of the segment, turned round, and come back from behind.
    const double rate = dot(v, face.normal) * (above ? 1 : -1);
    const double before = dot(body.v, face.normal) * (above ? 1 : -1);
    const double bend = std::fabs(dot(body.a, face.normal));
    const double lowest = std::fabs(start) - before * before / (2 * bend);
    const bool behind = before < 0 && rate > noise(v, {}) && lowest < -rounding;
    return above != behind;
}

void World::make_one(std::vector<Side>& sides) const
{
    for (Side& first : sides) {
        for (Side& second : sides) {
            if (faces[first.face].next != second.face || first.above == second.above) continue;
            first.above = second.above = !turns_up(faces[first.face], faces[second.face]);
        }
    }
}

void World::remember(Body& body, const std::vector<Side>& sides, double flown) const
{
    for (const Side& side : sides) {
        const Face& face = faces[side.face];
        const auto joins = [&](const Side& other) { return other.face == face.previous; };
        if (std::ranges::none_of(sides, joins)) continue;
        // The corner itself: beside it by a rounding, the point would be on neither segment.
        if (norm(body.p - face.at) <= end_slack(face, body.p, flown)) body.p = face.at;
    }
    // Repeated up to twenty times: at a corner, moving onto one line may leave another by rounding.
    for (int k = 0; k < 20; ++k) {
        bool moved = false;
        for (const Side& side : sides) {
            const double up = height(faces[side.face], body.p);
            if (side.above ? up >= 0 : up <= 0) continue;
            body.p = body.p - up * upwards(faces[side.face], body.p);
            moved = true;
        }
        if (!moved) break;
    }
    body.sides.fill(none);
    for (std::size_t k = 0; k < std::min(sides.size(), body.sides.size()); ++k) {
        body.sides[k] = 2 * sides[k].face + (sides[k].above ? 1 : 0);
    }
}

double World::corner_slack(const Face& face, std::uint32_t other, const Vector2& p,
                           double flown) const
{
    const double least = end_slack(face, p, flown);
    if (other == none) return least;
    const double sine = std::fabs(dot(turned(face.normal), faces[other].normal));
    const double rounding = rounding_at(face, p) + rounding_at(faces[other], p) + 2 * flown;
    return std::clamp(rounding / sine, least, std::max(least, 1e-3 * face.length));
}

bool World::holds(const Face& face, const Vector2& p, double flown) const
{
    const double along = -dot(p - face.at, turned(face.normal));
    return along >= -corner_slack(face, face.previous, p, flown) &&
           along <= face.length + corner_slack(face, face.next, p, flown);
}

bool World::passes_end(const Body& body, std::uint32_t f, bool above, const Vector2& p,
                       const Vector2& v, double flown) const
{
    const Face& face = faces[f];
    const double along = -dot(p - face.at, turned(face.normal));
    for (const bool at_start : {true, false}) {
        const std::uint32_t other = at_start ? face.previous : face.next;
        const double inside = at_start ? along : face.length - along;
        if (other == none || inside > corner_slack(face, other, p, flown)) continue;
        const Face& beside = faces[other];
        const bool up = at_start ? turns_up(beside, face) : turns_up(face, beside);
        const bool side = arrives_above(body, other, p, v) == above ? above : !up;
        if (side != above) return true;
        if (side == up || inside > end_slack(face, p, flown)) continue;
        // At an outer corner a point strikes only if it moves behind both segments.
        const double rate = dot(v, beside.normal) * (side ? 1 : -1);
        if (rate >= -noise(v, {})) return true;
    }
    return false;
}

}  // namespace ricochet::detail
