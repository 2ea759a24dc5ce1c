#include "scene/moving.hpp"

#include <fmt/format.h>

#include "scene/islands.hpp"

namespace ricochet::detail {

namespace {

/// What a function must keep between two times at which it was evaluated.
struct Evaluated {
    double t = 0;
    Vector2 moved{}, v{};
};

/// Notes a bound that `now` has broken since `then`. Rounding may break it by a little.
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
    world.broken = BrokenBound{!is_finite(now.moved + now.v), surface, now.t, what};
}

[[nodiscard]] Vector2 along_path(const Path& path, double s) noexcept
{
    Vector2 sum = path.c[4];
    for (std::size_t k = 4; k-- > 0;) sum = s * sum + path.c[k];
    return sum;
}
[[nodiscard]] Vector2 rate_of_path(const Path& path, double s) noexcept
{
    Vector2 sum = 4 * path.c[4];
    for (std::size_t k = 4; k-- > 1;) sum = s * sum + static_cast<double>(k) * path.c[k];
    return sum;
}

/// Of the second derivative within a path [m/s^2].
[[nodiscard]] double acceleration_of(const Path& path) noexcept
{
    double sum = 2 * norm(path.c[2]);
    if (path.degree > 2) {
        sum += path.until * (6 * norm(path.c[3]) + 12 * path.until * norm(path.c[4]));
    }
    return sum;
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
          path_(world.path(i, body_.t))
    {
        // At least this is the second derivative of the gap to a surface at rest: distances from
        // what is convex are convex along straight lines.
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
        at_ = displaced_gap(face_, now.moved, body_.radius, p_);
        return {.gap = at_.gap,
                .rate = dot(v_ - now.v, at_.normal),
                .noise = noise(v_, now.v),
                .closed = World::rounding(p_, body_.radius) + World::rounding(face_.at, 0) +
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
            const FaceGap mean = displaced_gap(face_, {}, body_.radius, p_);
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
    Path path_;
    double bend_ = 0;
    Evaluated last_{never};
    Vector2 p_{}, v_{};
    FaceGap at_{};
};

}  // namespace

Meeting meet_moving(const World& world, std::uint32_t i, std::uint32_t which, const Instant& t_end)
{
    const Body& body = world.bodies[i];
    SurfacePair pair(world, i, which);
    const double until = std::min(pair.until(), seconds(body.t, t_end));
    const Closing closing = first_closing(until, pair);
    Meeting meeting{.from = body.t, .after = closing.after};
    if (!(closing.after > 0) || !(closing.after < never)) return meeting;
    // It has hopped no higher than its place is rounded.
    if (!closing.opened) return {.from = body.t, .after = 0, .presses = true};
    meeting.after = on_map(closing.after, until, [&](double s) {
        const Instant t = body.t.after(s);
        const FaceGap at = world.moving_gap(which, body.radius, world.position(i, t), t);
        return GapAndRate{at.gap,
                          dot(world.heading(i, t) - world.surface_velocity(which, t), at.normal)};
    });
    return meeting;
}

}  // namespace ricochet::detail
