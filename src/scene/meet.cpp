// First contacts.
#include <algorithm>

#include "scene/islands.hpp"
#include "scene/moving.hpp"

namespace ricochet::detail {

namespace {

/// |path|^2 - reach^2.
[[nodiscard]] Polynomial squared(const Path& path, const Squares& now)
{
    Polynomial c{};
    for (int i = 0; i <= path.degree; ++i) {
        for (int j = 0; j <= path.degree; ++j) {
            const auto a = static_cast<std::size_t>(i);
            const auto b = static_cast<std::size_t>(j);
            c[a + b] += dot(path.c[a], path.c[b]);
        }
    }
    c[0] = now.at_once;
    c[1] = 2 * now.rate;
    return c;
}

/// Bound of the distance from its start that the path reaches within `until`.
[[nodiscard]] double reach_of(const Path& path) noexcept
{
    double sum = 0;
    for (int k = path.degree; k > 0; --k) {
        sum = (sum + norm(path.c[static_cast<std::size_t>(k)])) * path.until;
    }
    return sum;
}

/// Whether one coordinate is enough to keep the path farther than `reach` from the origin.
[[nodiscard]] bool stays_beyond(const Path& path, double reach) noexcept
{
    for (std::size_t c = 0; c < 2; ++c) {
        double sum = 0;
        for (int k = path.degree; k > 0; --k) {
            sum = (sum + std::fabs(path.c[static_cast<std::size_t>(k)][c])) * path.until;
        }
        if (std::fabs(path.c[0][c]) - sum > reach) return true;
    }
    return false;
}

/// Whether two bodies are too far apart along x or y to meet in their current steps.
[[nodiscard]] bool are_apart(const World& world, std::uint32_t i, std::uint32_t j) noexcept
{
    const Body& a = world.bodies[i];
    const Body& b = world.bodies[j];
    const Vector2& from_a = world.bends[i].sweep;
    const Vector2& from_b = world.bends[j].sweep;
    const double reach = a.radius + b.radius;
    for (std::size_t c = 0; c < 2; ++c) {
        const double moved = from_a[c] + from_b[c];
        if (std::fabs(a.p[c] - b.p[c]) > (1 + 1e-9) * (reach + moved)) return true;
    }
    return false;
}

/// A gap from which a flight begins, if it is closed there. The flight then ends at the same gap up
/// to rounding: otherwise each of many short hops would gain the energy of the difference.
struct Departure {
    double gap = 0;
    double rounding = 0;
    /// What is left of a later gap.
    [[nodiscard]] double left_of(double later) const noexcept
    {
        const double left = later - gap;
        return std::fabs(left) <= rounding ? 0 : left;
    }
};
[[nodiscard]] Departure departure(double gap, double rounding) noexcept
{
    return gap <= rounding ? Departure{std::max(gap, -rounding), rounding} : Departure{};
}

}  // namespace

Path World::path(std::uint32_t i, const Instant& t) const
{
    const Body& b = bodies[i];
    const double s = seconds(b.t, t);
    Path path;
    if (!b.quartic) {
        path.c[0] = place(b, s);
        path.c[1] = speed(b, s);
        path.c[2] = 0.5 * b.a;
        path.degree = is_zero(b.a) ? 1 : 2;
        return path;
    }
    if (b.mapped) {
        path.c[0] = islands->position(i, t);
        path.c[1] = islands->velocity(i, t);
        path.degree = 1;
        path.until = std::max(0.0, seconds(t, islands->end(b.island)));
        return path;
    }
    const auto& [c3, c4, sweep] = bends[i];
    const Vector2 c2 = 0.5 * b.a;
    path.degree = 4;
    path.until = std::max(0.0, seconds(t, islands->end(b.island)));
    if (s == 0) {
        path.c = {b.p, b.v, c2, c3, c4};
        return path;
    }
    path.c[0] = b.p + s * (b.v + s * (c2 + s * (c3 + s * c4)));
    path.c[1] = b.v + s * (2 * c2 + s * (3 * c3 + 4 * s * c4));
    path.c[2] = c2 + s * (3 * c3 + 6 * s * c4);
    path.c[3] = c3 + 4 * s * c4;
    path.c[4] = c4;
    return path;
}

Vector2 World::stepped_position(std::uint32_t i, const Instant& t) const
{
    return islands->position(i, t);
}

Vector2 World::stepped_velocity(std::uint32_t i, const Instant& t) const
{
    if (bodies[i].quartic) return islands->velocity(i, t);
    return drifts[i].v + seconds(bodies[i].t, t) * drifts[i].rate;
}

Vector2 World::heading(std::uint32_t i, const Instant& t) const
{
    return bodies[i].contact != none ? bodies[i].v : velocity(i, t);
}

Meeting meet_curved(const World& world, std::uint32_t i, std::uint32_t j)
{
    const Body& a = world.bodies[i];
    const Body& b = world.bodies[j];
    if (a.mapped || b.mapped) return meet_mapped(world, i, j);
    if (a.quartic && b.quartic && are_apart(world, i, j)) return {};
    const Instant from = later(a.t, b.t);
    const Path first = world.path(i, from);
    const Path second = world.path(j, from);
    const Path path = difference(first, second);
    const double reach = a.radius + b.radius;
    const double rounding =
        World::rounding(first.c[0], reach) + World::rounding(second.c[0], reach);
    Squares now = squares(path.c[0], path.c[1], reach, rounding);
    Meeting meeting{.from = from};
    const bool steps = std::isfinite(path.until);
    if (steps && stays_beyond(path, (1 + 1e-9) * reach)) return meeting;
    if (steps && norm(path.c[0]) - reach > reach_of(path)) return meeting;
    if (now.at_once <= now.tolerance) {
        const double slowest = noise(first.c[1], second.c[1]);
        if (std::fabs(now.rate) <= slowest * reach) {
            now.rate = 0;
            const double bend = dot(path.c[1], path.c[1]) + 2 * dot(path.c[0], path.c[2]);
            if (bend < 0) return {.from = from, .after = 0, .presses = true};
        }
    }
    const Polynomial gap = squared(path, now);
    meeting.after = falls_within(gap, 2 * path.degree, path.until, now.tolerance);
    if (steps && meeting.after > 0 && std::isfinite(meeting.after)) {
        const Departure begin = departure(norm(path.c[0]) - reach, rounding);
        meeting.after = on_map(meeting.after, path.until, [&](double s) {
            const Instant t = from.after(s);
            const Vector2 apart = world.position(i, t) - world.position(j, t);
            const double distance = norm(apart);
            return GapAndRate{begin.left_of(distance - reach),
                              dot(apart, world.heading(i, t) - world.heading(j, t)) / distance};
        });
    }
    return meeting;
}

Meeting meet_image(const World& world, std::uint32_t i, std::uint32_t j, const Instant& now)
{
    const Body& a = world.bodies[i];
    const Body& b = world.bodies[j];
    const double reach = a.radius + b.radius;
    if (reach == 0) return {};
    const Vector2 shift = world.image_shift(world.position(i, now) - world.position(j, now));
    const Instant& from = later(a.t, b.t);
    const Path first = world.path(i, from);
    const Path second = world.path(j, from);
    Path path = difference(first, second);
    path.c[0] = (first.c[0] - second.c[0]) - shift;
    const double rounding =
        World::rounding(first.c[0], reach) + World::rounding(second.c[0], reach);
    const Squares at = squares(path.c[0], path.c[1], reach, rounding);
    const double slowest = noise(first.c[1], second.c[1]) * reach;
    if (at.at_once <= at.tolerance && std::fabs(at.rate) <= slowest) {
        const double bend = dot(path.c[1], path.c[1]) + 2 * dot(path.c[0], path.c[2]);
        if (path.degree > 1 && bend < 0) return {.from = from, .after = 0, .presses = true};
        if (path.degree <= 1) return {};
    }
    if (path.degree <= 1) return {.from = from, .after = straight(at, path.c[0], path.c[1], reach)};
    const Polynomial gap = squared(path, at);
    return {.from = from, .after = falls_within(gap, 2 * path.degree, path.until, at.tolerance)};
}

/// [m] Distance beyond its ends up to which a segment is met: that of `World::leads_off` for discs,
/// so that no disc leaves a segment before it is on the next one.
static double slack_of(const Face& face, double radius, const Vector2& p, double flown = 0)
{
    return radius == 0 ? World::end_slack(face, p, flown) : 0.5 * World::rounding(p, 0);
}

/// [m] Rounding of the gap between an arc and a body at p.
static double rounding_at_arc(const Face& face, double radius, const Vector2& p)
{
    return World::rounding(p, radius) + World::rounding(face.at, face.length);
}

/// Whether a body on the circle of an arc, or parallel to it, is beside the arc itself.
static bool lies_on_arc(const Face& face, double radius, const Vector2& p, double flown)
{
    const double slack =
        radius == 0 ? World::end_slack(face, p, flown) : 0.5 * World::rounding(p, 0);
    return face.span.contains(p - face.at, slack / face.length);
}

[[gnu::noinline]] static FaceGap arc_gap(const Face& face, const Body& body, const Vector2& p,
                                         bool outside, double flown)
{
    const Vector2 apart = p - face.at;
    const double distance = norm(apart);
    if (distance == 0 || !lies_on_arc(face, body.radius, p, flown)) return {};
    const Vector2 out{apart[0] / distance, apart[1] / distance};
    if (outside) return {distance - face.length - body.radius, out};
    return {face.length - distance - body.radius, -1.0 * out};
}

FaceGap face_gap(const Face& face, const Body& body, const Vector2& p, bool above, double flown)
{
    const double radius = body.radius;
    if (face.kind == Face::Kind::wall) {
        return {dot(p - face.at, face.normal) - radius, face.normal};
    }
    if (face.kind == Face::Kind::segment) {
        if (!lies_on(face, p, slack_of(face, radius, p, flown))) return {};
        const Vector2 normal = above ? face.normal : -1.0 * face.normal;
        return {dot(p - face.at, normal) - radius, normal};
    }
    if (face.kind == Face::Kind::arc) return arc_gap(face, body, p, above, flown);
    if (radius == 0) return {};
    const Vector2 apart = p - face.at;
    const double distance = norm(apart);
    return {distance - radius, {apart[0] / distance, apart[1] / distance}};
}

bool lies_on(const Face& face, const Vector2& p, double slack)
{
    const double along = -dot(p - face.at, turned(face.normal));
    return along >= -slack && along <= face.length + slack;
}

/// Whether a body that reaches the line of a segment at p meets it between its ends.
static bool lands_on(const World& world, const Body& body, std::uint32_t which, bool above,
                     const Vector2& p, const Vector2& v, double flown)
{
    const Face& face = world.faces[which];
    if (body.radius > 0) return lies_on(face, p, slack_of(face, body.radius, p));
    return world.holds(face, p, flown) && !world.passes_end(body, which, above, p, v, flown);
}

namespace {

/// A body on its way to the line of a wall or of a segment.
struct TowardsLine {
    const World& world;
    std::uint32_t i, which;
    bool segment, above;
    Vector2 normal;          ///< towards the body
    double rounding;         ///< of the gap
    bool on;                 ///< whether it starts beside the wall or the segment itself
    double gap, rate, bend;  ///< of degree 0, 1 and 2, from the start of its record on

    [[nodiscard]] const Body& body() const { return world.bodies[i]; }
    [[nodiscard]] const Face& face() const { return world.faces[which]; }
    /// Beside the end of a segment a disc may reach across its line: it meets the segment after it
    /// has left the line and comes back.
    [[nodiscard]] bool beside() const { return gap < -rounding && !on; }
    /// A body on the line beside a segment reaches its end a little later.
    [[nodiscard]] double closed() const { return on ? rounding : 0; }
    /// Whether it meets the wall or segment after s seconds. On the method's own map, as the line
    /// is met: the polynomial of a step passes both segments of a corner by its error.
    [[nodiscard]] bool lands(double s, bool side) const
    {
        if (!segment || !std::isfinite(s)) return true;
        const Instant t = body().t.after(s);
        return lands_on(world, body(), which, side, world.position(i, t), world.velocity(i, t),
                        rounding_of_flight(body(), s));
    }
    [[nodiscard]] Polynomial polynomial(const Path& path) const
    {
        return {gap, rate, bend, dot(path.c[3], normal), dot(path.c[4], normal)};
    }
    [[nodiscard]] double located(double after, double side, const Path& path) const;
};

/// The time near `after` at which it meets the line, from the given side of it, on its own map.
double TowardsLine::located(double after, double side, const Path& path) const
{
    const Polynomial c = polynomial(path);
    const Body& b = body();
    const Departure from = side > 0 && on ? departure(gap, rounding) : Departure{};
    const auto at = [&](double s) {
        const Instant t = b.t.after(s);
        const Vector2 facing = side * normal;
        return GapAndRate{from.left_of(dot(world.position(i, t) - face().at, facing) - b.radius),
                          dot(world.velocity(i, t), facing)};
    };
    return on_map(after, path.until, at,
                  [&](double s) { return side * (2 * c[2] + s * (6 * c[3] + 12 * s * c[4])); });
}

/// First contact on a straight line or a parabola.
[[gnu::always_inline]] inline Meeting meet_line_in_flight(const TowardsLine& line, const Path& path,
                                                          double rate)
{
    Meeting meeting{.from = line.body().t};
    const double bend = line.bend;
    const bool beside = line.beside();
    meeting.after = beside ? falls_again(line.polynomial(path), path.degree, path.until)
                           : falls_after(line.gap, rate, 2 * bend, line.closed());
    if (!(beside && meeting.after == never) && line.lands(meeting.after, line.above)) {
        return meeting;
    }
    if (bend <= 0 || rate >= 0) return {};
    // The body passes the end of the segment, and comes back from behind.
    const double behind = -(line.gap + 2 * line.body().radius);
    const double square = rate * rate + 4 * bend * behind;
    if (!(square > 0)) return {};
    meeting.after = (std::sqrt(square) - rate) / (2 * bend);
    return line.lands(meeting.after, !line.above) ? meeting : Meeting{};
}

/// First contact in a step that passes an end of the segment at `first`, and may come back, from
/// either side.
Meeting meet_line_again(const TowardsLine& line, const Path& path, double first)
{
    Meeting meeting{.from = line.body().t, .after = never};
    Polynomial front = line.polynomial(path);
    if (!line.beside() && line.gap <= line.closed()) front[0] = 0;
    Polynomial behind{};
    for (std::size_t k = 0; k < 5; ++k) behind[k] = -front[k];
    behind[0] -= 2 * line.body().radius;
    const double past = first < never ? (1 + 1e-9) * first : 0;
    for (const double side : {1.0, -1.0}) {
        for (const double s : falls_in(side > 0 ? front : behind, 4, path.until)) {
            if (!(s < meeting.after)) break;
            if (side > 0 && s <= past) continue;
            const double after = line.located(s, side, path);
            if (!line.lands(after, side > 0 ? line.above : !line.above)) continue;
            meeting.after = after;
            break;
        }
    }
    return meeting.after < never ? meeting : Meeting{};
}

/// First contact in a step of an island.
Meeting meet_line_in_step(const TowardsLine& line, const Path& path)
{
    Meeting meeting{.from = line.body().t};
    if (line.gap > reach_of(path)) return meeting;
    const Polynomial c = line.polynomial(path);
    const bool beside = line.beside();
    const double first =
        beside ? falls_again(c, 4, path.until) : falls_within(c, 4, path.until, line.closed());
    meeting.after = first > 0 && std::isfinite(first) ? line.located(first, 1, path) : first;
    if (!line.segment || (!beside && first == never)) return meeting;
    if (first < never && line.lands(meeting.after, line.above)) return meeting;
    return meet_line_again(line, path, first);
}

}  // namespace

/// First contact with a wall, or with the inside of a segment.
static Meeting meet_line(const World& world, std::uint32_t i, std::uint32_t which)
{
    const Face& face = world.faces[which];
    const Body& b = world.bodies[i];
    const bool segment = face.kind == Face::Kind::segment;
    const Path path = world.path(i, b.t);
    const bool above = !segment || world.begins_above(b, which);
    const Vector2 normal = above ? face.normal : -1.0 * face.normal;
    const double gap = dot(path.c[0] - face.at, normal) - b.radius;
    const double rounding = World::rounding(path.c[0], b.radius) + World::blur(face, b.radius);
    const bool on = !segment || lies_on(face, path.c[0], slack_of(face, b.radius, path.c[0]));
    double rate = dot(path.c[1], normal);
    const double bend = dot(path.c[2], normal);
    const TowardsLine line{world, i, which, segment, above, normal, rounding, on, gap, rate, bend};
    if (on && gap <= rounding && std::fabs(rate) <= noise(path.c[1], {})) {
        const Vector2& heading = is_zero(path.c[1]) ? path.c[2] : path.c[1];
        const bool ahead = dot(heading, turned(face.normal)) < 0;
        const bool free = b.radius > 0 || (ahead ? face.next : face.previous) == none;
        if (free && world.leads_off(face, path.c[0], heading)) return {};
        if (bend < 0 && line.lands(0, above)) return {.from = b.t, .after = 0, .presses = true};
        rate = 0;
    }
    return path.degree <= 2 ? meet_line_in_flight(line, path, rate) : meet_line_in_step(line, path);
}

namespace {

/// Search for the first contact of a body with an arc. The gap to its outside closes where the
/// distance from the centre falls to R + r, the gap to its inside where it rises to R - r.
class ArcSearch {
public:
    ArcSearch(const World& world, std::uint32_t i, std::uint32_t which)
        : world_(world),
          face_(world.faces[which]),
          body_(world.bodies[i]),
          i_(i),
          path_(world.path(i, body_.t)),
          rounding_(rounding_at_arc(face_, body_.radius, path_.c[0])),
          outside_(world.begins_above(body_, which))
    {
        apart_ = path_;
        apart_.c[0] = path_.c[0] - face_.at;
        distance_ = norm(apart_.c[0]);
    }

    [[nodiscard]] Meeting first() const
    {
        if (std::isfinite(path_.until) && is_out_of_reach()) return {};
        Meeting best{.from = body_.t};
        for (const bool outer : {true, false}) {
            if (face_.span.whole && outer != outside_) continue;
            const double reach = face_.length + (outer ? body_.radius : -body_.radius);
            if (!(reach > 0)) continue;
            const Meeting found = from_side(outer, reach);
            if (found.after < best.after) best = found;
        }
        return best;
    }

private:
    [[nodiscard]] bool is_out_of_reach() const
    {
        const double farthest = reach_of(path_);
        return std::fabs(distance_ - face_.length) - body_.radius > farthest;
    }

    /// The first contact from outside, or from inside: at this distance from the centre.
    [[nodiscard]] Meeting from_side(bool outer, double reach) const
    {
        const double sign = outer ? 1 : -1;
        Squares now = squares(apart_.c[0], apart_.c[1], reach, rounding_);
        const double gap = sign * (distance_ - reach);
        const bool closed =
            body_.radius == 0 ? std::fabs(gap) <= rounding_ : gap <= rounding_ && outer == outside_;
        const bool touches = closed && lies_on_arc(face_, body_.radius, path_.c[0], 0);
        if (touches && outer == outside_) {
            const double slowest = noise(path_.c[1], {}) * distance_ + norm(path_.c[1]) * rounding_;
            const double bend = dot(path_.c[1], path_.c[1]) + 2 * dot(apart_.c[0], path_.c[2]);
            if (std::fabs(now.rate) <= slowest) {
                now.rate = 0;
                if (sign * bend < 0) return {.from = body_.t, .after = 0, .presses = true};
            } else if (sign * now.rate < 0) {
                return {.from = body_.t, .after = 0};
            }
        }
        if (touches) now.at_once = 0;
        const Departure begin = touches ? departure(gap, rounding_) : Departure{};
        for (const double s : closings(now, sign, reach)) {
            if (!(s < never)) break;
            const double after = located(s, sign, reach, begin);
            if (lands(after)) return {.from = body_.t, .after = after};
        }
        return {};
    }

    /// Times after the start at which the gap closes, ascending, followed by `never`.
    [[nodiscard]] std::array<double, largest_degree> closings(const Squares& now, double sign,
                                                              double reach) const
    {
        std::array<double, largest_degree> times;
        times.fill(never);
        if (path_.degree <= 1) {
            times[0] = straight_closing(now, sign, reach);
            return times;
        }
        Polynomial gap = squared(apart_, now);
        for (double& c : gap) c *= sign;
        return falls_in(gap, 2 * path_.degree, path_.until);
    }

    /// The same on a straight line, which enters and leaves a circle once.
    [[nodiscard]] double straight_closing(const Squares& now, double sign, double reach) const
    {
        const Vector2& v = path_.c[1];
        const double square = discriminant(apart_.c[0], v, reach);
        if (is_zero(v)) return never;
        const bool leaves_inside = sign < 0 && now.at_once == 0 && now.rate < 0;
        if (!(square >= 0)) return leaves_inside ? -2 * now.rate / dot(v, v) : never;
        if (sign > 0) {
            return now.at_once > 0 && now.rate < 0 ? now.at_once / (std::sqrt(square) - now.rate)
                                                   : never;
        }
        if (now.rate < 0) {  // it has touched, or enters before it leaves
            return (std::sqrt(square) - now.rate) / dot(v, v);
        }
        return now.at_once < 0 ? -now.at_once / (now.rate + std::sqrt(square)) : never;
    }

    /// The time on the method's own map, where the body advances by steps. On a parabola it is
    /// corrected once, since the square of the distance has lost digits of the gap.
    [[nodiscard]] double located(double s, double sign, double reach, const Departure& begin) const
    {
        if (path_.degree < 2) return s;
        return on_map(s, path_.until, [&](double after) {
            const Instant t = body_.t.after(after);
            const Vector2 from_centre = world_.position(i_, t) - face_.at;
            const double distance = norm(from_centre);
            const double rate = dot(from_centre, world_.velocity(i_, t)) / distance;
            return GapAndRate{begin.left_of(sign * (distance - reach)), sign * rate};
        });
    }

    [[nodiscard]] bool lands(double after) const
    {
        if (face_.span.whole) return true;
        const Vector2 p = world_.position(i_, body_.t.after(after));
        return lies_on_arc(face_, body_.radius, p, rounding_of_flight(body_, after));
    }

    const World& world_;
    const Face& face_;
    const Body& body_;
    std::uint32_t i_;
    Path path_, apart_;
    double distance_ = 0;
    double rounding_ = 0;
    bool outside_ = true;
};

}  // namespace

Meeting meet_face(const World& world, std::uint32_t i, std::uint32_t which)
{
    const Face& face = world.faces[which];
    const Body& b = world.bodies[i];
    if (b.held == which) return {};
    if (face.kind == Face::Kind::arc) return ArcSearch(world, i, which).first();
    if (face.kind != Face::Kind::vertex) return meet_line(world, i, which);
    if (b.radius == 0) return {};
    if (b.held != none && world.faces[b.held].kind == Face::Kind::segment) {
        // A body that slides along a segment passes the ends of segments that continue in its line.
        const Face& under = world.faces[b.held];
        const double height = dot(face.at - under.at, under.normal);
        const double rounding = World::rounding(face.at, 0) + World::rounding(under.at, 0);
        if (std::fabs(height) <= rounding) return {};
    }
    const Path path = world.path(i, b.t);
    Path apart = path;
    apart.c[0] = path.c[0] - face.at;
    const double rounding = World::rounding(path.c[0], b.radius) + World::rounding(face.at, 0);
    Squares now = squares(apart.c[0], apart.c[1], b.radius, rounding);
    const bool steps = std::isfinite(path.until);
    Meeting meeting{.from = b.t};
    if (steps && norm(apart.c[0]) - b.radius > reach_of(path)) return meeting;
    // The direction to the vertex has the rounding of the positions of both.
    const double slowest = noise(path.c[1], {}) * b.radius + norm(path.c[1]) * rounding;
    if (now.at_once <= now.tolerance && std::fabs(now.rate) <= slowest) {
        now.rate = 0;
        if (dot(path.c[1], path.c[1]) + 2 * dot(apart.c[0], path.c[2]) < 0) {
            return {.from = b.t, .after = 0, .presses = true};
        }
    }
    meeting.after = path.degree == 1 ? straight(now, apart.c[0], apart.c[1], b.radius)
                                     : falls_within(squared(apart, now), 2 * path.degree,
                                                    path.until, now.tolerance);
    if (steps && meeting.after > 0 && std::isfinite(meeting.after)) {
        const Departure begin = departure(norm(apart.c[0]) - b.radius, rounding);
        meeting.after = on_map(meeting.after, path.until, [&](double s) {
            const Instant t = b.t.after(s);
            const Vector2 from_vertex = world.position(i, t) - face.at;
            const double distance = norm(from_vertex);
            return GapAndRate{begin.left_of(distance - b.radius),
                              dot(from_vertex, world.velocity(i, t)) / distance};
        });
    }
    return meeting;
}

}  // namespace ricochet::detail
