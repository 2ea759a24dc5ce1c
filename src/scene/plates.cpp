#include "scene/plates.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "scene/islands.hpp"
#include "scene/moving.hpp"

namespace ricochet::detail {

namespace {

/// A body beside a plate, in the frame of the plate.
class BesidePlate {
public:
    BesidePlate(const World& world, const World::Plate& plate, std::uint32_t i)
        : world_(world),
          plate_(plate),
          i_(i),
          radius_(world.bodies[i].radius),
          from_(later(world.bodies[i].t, world.bodies[plate.body].t)),
          body_(world.path(i, from_)),
          middle_(world.path(plate.body, from_)),
          path_(difference(body_, middle_)),
          bend_(acceleration_of(path_))
    {
        const World::Plate* other = world.plate(i);
        length_ = plate.length + (other ? other->length : 0);
        if (radius_ == 0) side_ = side_at_start();
    }

    [[nodiscard]] const Instant& from() const noexcept { return from_; }
    [[nodiscard]] double until() const noexcept { return path_.until; }

    /// Gap and normal where the body is at q relative to the middle of the plate.
    [[nodiscard]] FaceGap gap_at(const Vector2& q, double closed)
    {
        const double up = height(q);
        const double out = beyond(q);
        if (radius_ == 0) {
            // A contact is not passed: off the line, the place tells the side.
            if (std::fabs(up) > closed) side_ = up > 0 ? 1 : -1;
            if (out <= slack(closed)) return {side_ * up, side_ * plate_.normal};
        } else if (out <= 0) {
            return {std::fabs(up) - radius_, (up > 0 ? 1.0 : -1.0) * plate_.normal};
        }
        const double end = place(q) > 0 ? length_ : -length_;
        const Vector2 apart = q - end * axis();
        const double distance = norm(apart);
        return {distance - radius_, {apart[0] / distance, apart[1] / distance}};
    }

    [[nodiscard]] OpenGap look(double s)
    {
        const double closed = rounding(along_path(body_, s), along_path(middle_, s));
        const FaceGap at = gap_at(along_path(path_, s), closed);
        return {.gap = at.gap,
                .rate = dot(rate_of_path(path_, s), at.normal),
                .noise = noise(rate_of_path(body_, s), rate_of_path(middle_, s)),
                .closed = closed};
    }
    [[nodiscard]] double safe(const OpenGap& now) const
    {
        return falls_after(now.gap, now.rate, -bend_, 0);
    }
    [[nodiscard]] double linger(const OpenGap& now) const
    {
        if (bend_ == 0) return never;
        return std::max(std::sqrt(2 * now.closed / bend_), 2 * now.rate / bend_);
    }
    [[nodiscard]] static double next_jump(double /*s*/) { return never; }

    /// The first contact where a body in flight comes to the line of the plate between its ends:
    /// it cannot touch an end before.
    [[nodiscard]] std::optional<double> from_far() const
    {
        if (path_.degree > 2) return {};
        const double up = height(path_.c[0]);
        const double side = up > 0 ? 1 : -1;
        const double gap = side * up - radius_;
        if (gap <= 4 * rounding(body_.c[0], middle_.c[0])) return {};
        const double rate = side * height(path_.c[1]);
        const double after = falls_after(gap, rate, 2 * side * height(path_.c[2]), 0);
        if (after == never || beyond(along_path(path_, after)) <= 0) return after;
        return {};
    }

    /// Gap and rate by the records, or the method's own map.
    [[nodiscard]] GapAndRate on_records(double s)
    {
        const Instant t = from_.after(s);
        const Vector2 p = world_.position(i_, t);
        const Vector2 middle = world_.position(plate_.body, t);
        const FaceGap at = gap_at(p - middle, rounding(p, middle));
        return {at.gap, dot(world_.heading(i_, t) - world_.heading(plate_.body, t), at.normal)};
    }

    /// Gap and normal at t. A body on the line has come from the side on which its flight began
    /// unless it moves away from it there: then it has passed an end and come back from behind.
    [[nodiscard]] FaceGap now(const Instant& t)
    {
        const double s = seconds(from_, t);
        const Vector2 p = world_.position(i_, t);
        const Vector2 middle = world_.position(plate_.body, t);
        const double closed = rounding(p, middle) + rounding_of_flight(world_.bodies[i_], s) +
                              rounding_of_flight(world_.bodies[plate_.body], s);
        const Vector2 q = p - middle;
        const double begin = height(path_.c[0]);
        if (radius_ == 0 && std::fabs(height(q)) <= closed &&
            std::fabs(begin) > rounding(body_.c[0], middle_.c[0])) {
            const Vector2 v = world_.velocity(i_, t);
            const Vector2 w = world_.velocity(plate_.body, t);
            side_ = begin > 0 ? 1 : -1;
            if (side_ * height(v - w) > noise(v, w)) side_ = -side_;
        }
        return gap_at(q, closed);
    }

private:
    [[nodiscard]] Vector2 axis() const noexcept { return -1.0 * turned(plate_.normal); }
    [[nodiscard]] double height(const Vector2& q) const noexcept { return dot(q, plate_.normal); }
    [[nodiscard]] double place(const Vector2& q) const noexcept { return dot(q, axis()); }
    /// [m] Distance beyond the ends, along the plate; negative between them.
    [[nodiscard]] double beyond(const Vector2& q) const noexcept
    {
        return std::fabs(place(q)) - length_;
    }
    /// [m] How far beyond its ends a plate holds a point: a piston ends at the walls of a cylinder,
    /// on which a point lies up to the rounding of its place.
    [[nodiscard]] static double slack(double closed) noexcept { return 4 * closed; }
    [[nodiscard]] double rounding(const Vector2& p, const Vector2& middle) const noexcept
    {
        return World::rounding(p, radius_) + World::rounding(middle, length_);
    }

    [[nodiscard]] double side_at_start() const
    {
        const Vector2& q = path_.c[0];
        const double closed = rounding(body_.c[0], middle_.c[0]);
        const double up = height(q);
        if (std::fabs(up) > closed) return up > 0 ? 1 : -1;
        const std::int8_t known = plate_.sides[i_];
        if (known != 0 && beyond(q) <= slack(closed)) return known;
        const double rate = height(path_.c[1]);
        const bool moves = std::fabs(rate) > noise(body_.c[1], middle_.c[1]);
        return (moves ? rate : height(path_.c[2])) < 0 ? -1 : 1;
    }

    const World& world_;
    const World::Plate& plate_;
    std::uint32_t i_;
    double radius_;
    Instant from_;
    Path body_, middle_, path_;
    double bend_;
    double length_ = 0;
    double side_ = 1;  ///< of a body without a radius
};

}  // namespace

Meeting meet_plate(const World& world, const World::Plate& plate, std::uint32_t i,
                   const Instant& t_end)
{
    BesidePlate pair(world, plate, i);
    Meeting meeting{.from = pair.from()};
    if (const auto after = pair.from_far()) {
        meeting.after = *after;
        return meeting;
    }
    const double until = std::min(pair.until(), seconds(meeting.from, t_end));
    const Closing closing = first_closing(until, pair);
    meeting.after = closing.after;
    if (!(closing.after > 0) || !(closing.after < never)) return meeting;
    if (!closing.opened) return {.from = meeting.from, .after = 0, .presses = true};
    meeting.after = on_map(closing.after, until, [&](double s) { return pair.on_records(s); });
    return meeting;
}

FaceGap plate_gap(const World& world, const World::Plate& plate, std::uint32_t i, const Instant& t)
{
    return BesidePlate(world, plate, i).now(t);
}

double wall_gap(const Face& wall, const World::Plate& plate, const Vector2& p)
{
    return dot(p - wall.at, wall.normal) - plate.reach(wall.normal);
}

Meeting meet_wall(const World& world, const World::Plate& plate, std::uint32_t which)
{
    const Face& wall = world.faces[which];
    const Body& body = world.bodies[plate.body];
    Meeting meeting{.from = body.t};
    if (!plate.yields(wall.normal)) return meeting;
    const double gap = wall_gap(wall, plate, body.p);
    const double rate = dot(body.v, wall.normal);
    const double bend = dot(body.a, wall.normal);
    const double closed = World::rounding(body.p, plate.length) + World::rounding(wall.at, 0);
    // It presses where it would leave for less than the time resolves.
    const double least = std::max(noise(body.v, {}), resolution(body.t) * std::fabs(bend));
    if (gap <= closed && std::fabs(rate) <= least) {
        if (bend < 0) return {.from = body.t, .after = 0, .presses = true};
        return meeting;
    }
    meeting.after = falls_after(gap, rate, bend, closed);
    return meeting;
}

void touch_side(World& world, World::Plate& plate, std::uint32_t i, const Vector2& normal,
                const Instant& now)
{
    Body& body = world.bodies[i];
    if (body.radius > 0) return;
    const bool above = dot(normal, plate.normal) > 0;
    plate.sides[i] = above ? 1 : -1;
    if (const World::Plate* other = world.plate(i)) {
        const bool behind = dot(normal, other->normal) > 0;
        world.plates[world.plate_numbers[i]].sides[plate.body] = behind ? -1 : 1;
    }
    Body& own = world.bodies[plate.body];
    const double up = dot(world.position(i, now) - world.position(plate.body, now), plate.normal);
    if (above ? up >= 0 : up <= 0) return;
    const auto begins = [&](const Body& one) { return !before(one.t, now); };
    if (begins(body)) {
        body.p = body.p - up * plate.normal;
    } else if (begins(own) && plate.yields(plate.normal)) {
        own.p = own.p + (up / dot(plate.along, plate.normal)) * plate.along;
    }
}

}  // namespace ricochet::detail
