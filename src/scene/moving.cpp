#include "scene/moving.hpp"

#include <fmt/format.h>

#include "scene/islands.hpp"

namespace ricochet::detail {

namespace {

/// Values of a function whose bounds must hold between two evaluations.
struct Evaluated {
    double t = 0;
    Vector2 moved{}, v{};
};

/// Records a bound that `now` has broken since `then`. Rounding may exceed it by a little.
void check_bounds(const World& world, const MovingFace& of, std::uint32_t surface,
                  const Evaluated& then, const Evaluated& now)
{
    if (!of.given || world.broken) return;
    const double s = now.t - then.t;
    const double most = of.bounds.acceleration;
    const double slack =
        1e-12 * (norm(now.moved) + norm(then.moved) + std::fabs(now.t) * norm(now.v));
    const auto breaks = [&](double found, double allowed, double rounding) {
        return found > allowed * (1 + 1e-9) + rounding;
    };
    std::string what;
    if (!is_finite(now.moved) || !is_finite(now.v)) {
        what = "is not finite";
    } else if (breaks(norm(now.moved), of.bounds.reach, 0)) {
        what = fmt::format("is displaced by {} m, and its reach is declared as {} m",
                           norm(now.moved), of.bounds.reach);
    } else if (breaks(norm(now.v), of.bounds.speed, 0)) {
        what = fmt::format("moves at {} m/s, and its speed_bound is declared as {} m/s",
                           norm(now.v), of.bounds.speed);
    } else if (breaks(norm(now.v - then.v), most * s, 1e-12 * (norm(now.v) + norm(then.v)))) {
        what = fmt::format(
            "has changed its velocity by {} m/s in {} s, and its acceleration_bound is declared as "
            "{} m/s^2",
            norm(now.v - then.v), s, most);
    } else if (breaks(norm(now.moved - then.moved - s * then.v), 0.5 * most * s * s, slack)) {
        what = fmt::format(
            "has moved by ({}, {}) m in {} s, which its velocity and acceleration_bound do not "
            "allow",
            now.moved[0] - then.moved[0], now.moved[1] - then.moved[1], s);
    } else {
        return;
    }
    world.broken = {!is_finite(now.moved + now.v),
                    fmt::format("the motion of {} {}, at t = {} s",
                                world.scene.name_of(SurfaceId{surface}), what, now.t)};
}

}  // namespace

FaceGap displaced_gap(const Face& face, const Vector2& moved, double radius, const Vector2& p)
{
    const Vector2 q = p - moved;
    if (face.kind == Face::Kind::wall) return {dot(q - face.at, face.normal) - radius, face.normal};
    const Vector2 end = face.at - face.length * turned(face.normal);
    const Vector2 apart = q - nearest_on(face.at, end, q);
    const double distance = norm(apart);
    if (distance == 0) return {-radius, face.normal};
    return {distance - radius, {apart[0] / distance, apart[1] / distance}};
}

namespace {

/// A body on its path and a face that moves.
class SurfacePair {
public:
    SurfacePair(const World& world, std::uint32_t i, std::uint32_t face)
        : world_(world),
          moving_(world.moving(face)),
          face_(world.faces[face]),
          body_(world.bodies[i]),
          radius_(world.reach_to(i, face_)),
          path_(world.path(i, body_.t))
    {
        // Lower bound of the second derivative of the gap to a surface at rest: the distance from a
        // convex set is convex along straight lines.
        const bool exact = face_.kind == Face::Kind::wall && path_.degree <= 2;
        bend_ = exact ? 2 * dot(path_.c[2], face_.normal) : -acceleration_of(path_);
    }

    [[nodiscard]] OpenGap look(double s)
    {
        const double t = body_.t.plus(s);
        const Evaluated now{t, displacement(*moving_.motion, t), velocity(*moving_.motion, t)};
        check_bounds(world_, moving_, face_.surface, last_.t <= t ? last_ : now, now);
        last_ = now;
        p_ = along_path(path_, s);
        v_ = rate_of_path(path_, s);
        at_ = displaced_gap(face_, now.moved, radius_, p_);
        return {.gap = at_.gap,
                .rate = dot(v_ - now.v, at_.normal),
                .noise = noise(v_, now.v),
                .closed = World::rounding(p_, radius_) + World::rounding(face_.at, 0) +
                          World::rounding(now.moved, 0)};
    }

    [[nodiscard]] double safe(const OpenGap& now) const
    {
        const MotionBounds& bounds = moving_.bounds;
        double ahead = falls_after(now.gap, now.rate, bend_ - bounds.acceleration, 0);
        if (bounds.speed < never) {
            const double rate = dot(v_, at_.normal) - bounds.speed;
            ahead = std::max(ahead, falls_after(now.gap, rate, bend_, 0));
        }
        if (bounds.reach < never) {
            const FaceGap mean = displaced_gap(face_, {}, radius_, p_);
            const double beyond = mean.gap - bounds.reach;
            const double rate = dot(v_, mean.normal);
            if (beyond > 0) ahead = std::max(ahead, falls_after(beyond, rate, bend_, 0));
        }
        return ahead;
    }

    [[nodiscard]] double linger(const OpenGap& now) const
    {
        const double most = moving_.bounds.acceleration - bend_;
        if (most <= 0) return never;
        return std::max(std::sqrt(2 * now.closed / most), 2 * now.rate / most);
    }

    [[nodiscard]] double next_jump(double s) const
    {
        return s + (next_break(*moving_.motion, last_.t) - last_.t);
    }

    [[nodiscard]] double until() const noexcept { return path_.until; }

private:
    const World& world_;
    const MovingFace& moving_;
    const Face& face_;
    const Body& body_;
    double radius_;
    Path path_;
    double bend_ = 0;
    Evaluated last_{never};
    Vector2 p_{}, v_{};
    FaceGap at_{};
};

}  // namespace

namespace {

/// Two bodies on the maps of their motions, with known bounds on their accelerations.
class BodyPair {
public:
    BodyPair(const World& world, std::uint32_t i, std::uint32_t j)
        : world_(world), i_(i), j_(j), from_(later(world.bodies[i].t, world.bodies[j].t))
    {
        reach_ = world.bodies[i].radius + world.bodies[j].radius;
        most_ = bound_of(i) + bound_of(j);
    }

    [[nodiscard]] OpenGap look(double s)
    {
        const Instant t = from_.after(s);
        const Evaluated now{t.plus(0), world_.position(i_, t), world_.heading(i_, t)};
        const Evaluated other{t.plus(0), world_.position(j_, t), world_.heading(j_, t)};
        keeps_bound(i_, first_, now);
        keeps_bound(j_, second_, other);
        first_ = now;
        second_ = other;
        const Vector2 apart = now.moved - other.moved;
        const double distance = norm(apart);
        return {
            .gap = distance - reach_,
            .rate = dot(apart, now.v - other.v) / distance,
            .noise = noise(now.v, other.v),
            .closed = World::rounding(now.moved, reach_) + World::rounding(other.moved, reach_)};
    }
    [[nodiscard]] double safe(const OpenGap& now) const
    {
        return falls_after(now.gap, now.rate, -most_, 0);
    }
    [[nodiscard]] double linger(const OpenGap& now) const
    {
        if (most_ == 0) return never;
        return std::max(std::sqrt(2 * now.closed / most_), 2 * now.rate / most_);
    }
    [[nodiscard]] static double next_jump(double /*s*/) { return never; }

    [[nodiscard]] const Instant& from() const noexcept { return from_; }
    [[nodiscard]] double until() const noexcept { return until_; }

private:
    double bound_of(std::uint32_t i)
    {
        const Body& body = world_.bodies[i];
        if (!body.quartic) return norm(body.a);
        until_ = std::min(until_, std::max(0.0, seconds(from_, world_.islands->end(body.island))));
        if (body.mapped) return world_.accelerations[i];
        // The map differs from the polynomial by the error of the step.
        return 1.001 * acceleration_of(world_.path(i, from_));
    }

    /// The velocities of a map have the error of its step.
    void keeps_bound(std::uint32_t i, const Evaluated& then, const Evaluated& now) const
    {
        if (!world_.bodies[i].mapped || world_.broken || !(then.t <= now.t)) return;
        const double change = norm(now.v - then.v);
        const double most = world_.accelerations[i];
        const double rounding = 1e-4 * (norm(now.v) + norm(then.v)) + world_.options.atol;
        const bool finite = is_finite(now.moved) && is_finite(now.v);
        if (finite && change <= most * (now.t - then.t) + rounding) return;
        world_.broken = {
            !finite,
            fmt::format("{} has changed its velocity by {} m/s in {} s, and no acceleration above "
                        "{} m/s^2 was declared, at t = {} s",
                        world_.scene.name_of(BodyId{i}), change, now.t - then.t, most, now.t)};
    }

    const World& world_;
    std::uint32_t i_, j_;
    Instant from_;
    double until_ = never;
    double reach_ = 0;
    double most_ = 0;
    Evaluated first_{never}, second_{never};
};

}  // namespace

Meeting meet_mapped(const World& world, std::uint32_t i, std::uint32_t j)
{
    const Body& a = world.bodies[i];
    const Body& b = world.bodies[j];
    if (a.mapped && b.mapped && a.island == b.island) return {};
    BodyPair pair(world, i, j);
    const Closing closing = first_closing(pair.until(), pair);
    Meeting meeting{.from = pair.from(), .after = closing.after};
    if (!(closing.after > 0) || !(closing.after < never)) return meeting;
    if (!closing.opened) return {.from = pair.from(), .after = 0, .presses = true};
    meeting.after = on_map(closing.after, pair.until(), [&](double s) {
        const OpenGap now = pair.look(s);
        return GapAndRate{now.gap, now.rate};
    });
    return meeting;
}

Meeting meet_moving(const World& world, std::uint32_t i, std::uint32_t which, const Instant& t_end)
{
    const Body& body = world.bodies[i];
    SurfacePair pair(world, i, which);
    const double until = std::min(pair.until(), seconds(body.t, t_end));
    const Closing closing = first_closing(until, pair);
    Meeting meeting{.from = body.t, .after = closing.after};
    if (!(closing.after > 0) || !(closing.after < never)) return meeting;
    // The gap has not opened by more than its rounding: the body presses on the surface.
    if (!closing.opened) return {.from = body.t, .after = 0, .presses = true};
    meeting.after = on_map(closing.after, until, [&](double s) {
        const Instant t = body.t.after(s);
        const double radius = world.reach_to(i, world.faces[which]);
        const FaceGap at = world.moving_gap(which, radius, world.position(i, t), t);
        return GapAndRate{at.gap,
                          dot(world.heading(i, t) - world.surface_velocity(which, t), at.normal)};
    });
    return meeting;
}

}  // namespace ricochet::detail
