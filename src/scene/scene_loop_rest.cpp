// Sliding and rest of a body on surfaces.
#include <algorithm>
#include <cmath>

#include "scene/scene_loop.hpp"

namespace ricochet::detail {

const std::vector<std::uint32_t>& SceneLoop::touching_faces(std::uint32_t i)
{
    const Body& body = world_.bodies[i];
    touched_.clear();
    const auto look = [&](std::uint32_t f) {
        const Face& face = world_.faces[f];
        if (is_round(face.kind)) return;
        const bool above = face.kind == Face::Kind::segment && world_.begins_above(body, f);
        const double gap = face_gap(face, body, body.p, above).gap;
        const double rounding =
            World::rounding(body.p, body.radius) + World::blur(face, body.radius);
        const bool known =
            std::ranges::any_of(body.sides, [&](std::uint32_t side) { return side / 2 == f; });
        if (known || gap <= rounding) {
            touched_.push_back(f);
        }
    };
    for (std::uint32_t f = 0; f < world_.wall_count; ++f) look(f);
    if (on_terrain_) {
        for (const std::uint32_t f : faces_of(i)) look(f);
    }
    return touched_;
}

/// The faces of `faces` that hold a body against gravity, where a speed of `gained` [m/s] is below
/// what the time resolves.
[[gnu::always_inline]] inline SceneLoop::Pressed SceneLoop::pressed_faces(
    const Body& body, const std::vector<std::uint32_t>& faces, double gained) const
{
    Pressed pressed;
    const double still = std::max(8 * epsilon * norm(body.v), 0.5 * gained);
    for (const std::uint32_t f : faces) {
        const Vector2 n = world_.push_of(body, f);
        const double pull = dot(world_.gravity, n);
        const double leaves = dot(body.v, n);
        if (leaves < -still) continue;
        if (leaves <= still) pressed.blocking.push_back(n);
        if (pull >= 0) continue;
        if (2 * leaves <= resolution(body.t) * -pull || leaves <= 8 * epsilon * norm(body.v)) {
            pressed.holding.push_back(f);
        }
    }
    return pressed;
}

/// Lets a body slide on the first of the faces that hold it which carries it by itself.
[[gnu::always_inline]] inline SceneLoop::Carrier SceneLoop::slide_on_one(std::uint32_t i,
                                                                         const Pressed& pressed)
{
    Body& body = world_.bodies[i];
    const double rounding = 8 * epsilon * norm(world_.gravity);
    Carrier carrier;
    const Vector2 flight = body.v;
    for (const std::uint32_t f : pressed.holding) {
        body.v = flight;
        world_.slide(i, f);
        const bool stays = std::ranges::all_of(
            pressed.blocking, [&](const Vector2& n) { return dot(body.a, n) >= -rounding; });
        if (!stays) continue;
        const Vector2& heading = is_zero(body.v) ? body.a : body.v;
        if (!world_.leads_off(world_.faces[f], body.p, heading)) {
            carrier.face = f;
            return carrier;
        }
        carrier.leaves = true;
    }
    if (carrier.leaves) body.v = flight;
    return carrier;
}

/// Keeps a body whose bounces are shorter than the time resolves on its surfaces: at rest, or
/// sliding on one of them. `was` is the face on which it slid before.
void SceneLoop::settle(std::uint32_t i, std::uint32_t was)
{
    Body& body = world_.bodies[i];
    const Vector2 velocity = body.v;
    const std::vector<std::uint32_t>& faces = touching_faces(i);
    // In a corner, a body that would rise by less than the rounding of its place does not move.
    const double pull_of_all = norm(world_.gravity);
    const double rise = faces.size() > 1 ? 4 * World::rounding(body.p, body.radius) : 0;
    const double gained =
        std::max(resolution(body.t) * pull_of_all, std::sqrt(2 * pull_of_all * rise));
    if (norm(body.v) <= gained) body.v = {};
    const Pressed pressed = pressed_faces(body, faces, gained);
    if (pressed.holding.empty()) {
        body.v = velocity;
        return;
    }
    for (const std::uint32_t f : pressed.holding) {
        const Vector2 n = world_.push_of(body, f);
        body.v = body.v - dot(body.v, n) * n;
    }
    Carrier carrier = slide_on_one(i, pressed);
    if (carrier.face == none && carrier.leaves) {
        body.a = world_.gravity;
        body.held = none;
        body.asleep = false;
        if (world_.turning(i)) world_.set_spin(i, body.t, world_.spin(i, body.t));
        return;
    }
    if (carrier.face == none) {
        // No single face carries the body, so it lies in the corner of two faces.
        body.v = body.a = {};
        body.asleep = true;
        body.held = carrier.face = pressed.holding[0];
        if (world_.turning(i)) stop_turning(i, pressed.holding);
    }
    if (carrier.face != was) note(SceneEvent::Kind::held, i, carrier.face, velocity);
}

/// In a corner friction stops a disc from turning.
void SceneLoop::stop_turning(std::uint32_t i, const std::vector<std::uint32_t>& faces)
{
    const Body& body = world_.bodies[i];
    const bool rubs = std::ranges::any_of(faces, [&](std::uint32_t f) {
        return world_.friction(body.material, world_.faces[f].material) > 0;
    });
    world_.set_spin(i, body.t, rubs ? 0 : world_.spin(i, body.t));
}

/// Whether surfaces alone hold, from now on, a body that presses on one of them.
bool SceneLoop::rests_on_face(std::uint32_t i)
{
    Body& body = world_.bodies[i];
    if (body.island != none || body.contact != none) return false;
    const std::uint32_t pressed = pending_[i].other;
    const std::size_t known = result_.events.size();
    begin_record(i, speed(body, seconds(body.t, now_)), sides_of(i, none));
    settle(i, none);
    if (body.held == none) return false;
    if (!body.asleep && meet_face(world_, i, pressed).presses) {
        // It slides against an end of terrain, which holds no body by itself.
        result_.events.resize(known);
        return false;
    }
    count_held();
    return true;
}

/// [s] Time until a disc that turns does not slip any more on the face that holds it.
double SceneLoop::slips_for(std::uint32_t i) const
{
    const Body& body = world_.bodies[i];
    const World::Turn& turn = world_.turns[i];
    if (!(world_.friction(body.material, world_.faces[body.held].material) > 0)) return never;
    const double slip = world_.slip_on(i, body.held);
    const Vector2 along = turned(world_.push_of(body, body.held));
    const double rate = dot(body.a, along) - body.radius * turn.rate;
    const double least = 8 * epsilon * (norm(body.v) + body.radius * std::fabs(turn.spin));
    return std::fabs(slip) > least && slip * rate < 0 ? -slip / rate : never;
}

/// Predicts the times when friction stops a sliding body, or when its face ends.
void SceneLoop::consider_own(std::uint32_t i)
{
    const Body& body = world_.bodies[i];
    if (body.held == none) return;
    const Face& face = world_.faces[body.held];
    Pending& pending = pending_[i];
    const auto add = [&](double after, Pending::Kind kind) {
        if (!(after < never)) return;
        const Instant t = body.t.after(after);
        if (!before(t, pending.t)) return;
        pending.t = t;
        pending.kind = kind;
        pending.other = body.held;
    };
    if (world_.turning(i)) add(slips_for(i), Pending::Kind::stop);
    const double slowing = dot(body.v, body.a);
    if (!world_.turning(i) && slowing < 0 && world_.friction(body.material, face.material) > 0) {
        add(-dot(body.v, body.v) / slowing, Pending::Kind::stop);
    }
    if (face.kind == Face::Kind::segment) {
        const Vector2 along = -1.0 * turned(face.normal);
        const double s = dot(body.p - face.at, along);
        const double v = dot(body.v, along);
        const double a = dot(body.a, along);
        add(falls_after(s, v, a, 0), Pending::Kind::edge);
        add(falls_after(face.length - s, -v, -a, 0), Pending::Kind::edge);
    }
}

void SceneLoop::halt(std::uint32_t i)
{
    Body& body = world_.bodies[i];
    const Vector2 velocity = speed(body, seconds(body.t, now_));
    const Vector2 left = world_.turning(i) ? velocity : Vector2{};  // a disc that turns rolls on
    const std::uint32_t face = begin_record(i, left, sides_of(i, body.held));
    if (world_.turning(i)) {
        const Vector2 along = turned(world_.push_of(body, face));
        world_.set_spin(i, now_, dot(velocity, along) / body.radius);
    }
    world_.slide(i, face);
    if (body.asleep) {
        note(SceneEvent::Kind::stopped, i, face, velocity);
        ++result_.event_count;
    }
    predict(i);
}

void SceneLoop::leave_edge(std::uint32_t i)
{
    Body& body = world_.bodies[i];
    const Vector2 velocity = speed(body, seconds(body.t, now_));
    begin_record(i, velocity, sides_of(i, body.held));
    if (is_zero(velocity)) {
        settle(i, none);
        if (body.held != none) count_held();
        return predict(i);
    }
    for (const std::uint32_t f : touching_faces(i)) {
        const Face& face = world_.faces[f];
        if (face.kind != Face::Kind::segment) continue;
        // The face that continues from here, in the direction of the motion.
        const Vector2 n = world_.push_of(body, f);
        if (!world_.leads_off(face, body.p, velocity) &&
            std::fabs(dot(body.v, n)) <= 8 * epsilon * norm(body.v) && dot(world_.gravity, n) < 0) {
            world_.slide(i, f);
            break;
        }
    }
    predict(i);
}

void SceneLoop::settle_at_start()
{
    for (const std::uint32_t i : placed_) {
        Body& body = world_.bodies[i];
        const bool fixed = body.island != none || body.asleep || is_zero(world_.gravity);
        if (fixed && body.radius > 0) continue;
        const std::vector<std::uint32_t>& faces = touching_faces(i);
        if (body.radius == 0) {
            std::vector<Side> sides;
            for (const std::uint32_t f : faces) {
                if (world_.faces[f].kind != Face::Kind::segment) continue;
                sides.push_back({f, world_.begins_above(body, f)});
            }
            world_.make_one(sides);
            world_.remember(body, sides, 0);
        }
        if (!fixed && !faces.empty()) settle(i, faces.size() == 1 ? faces[0] : none);
    }
}

/// Counts a hold that no impact has led to. What holds at the start is no event.
void SceneLoop::count_held()
{
    if (before(Instant{world_.options.t_start, 0}, now_)) ++result_.event_count;
}

void SceneLoop::note(SceneEvent::Kind kind, std::uint32_t i, std::uint32_t face,
                     const Vector2& velocity)
{
    if (before(Instant{world_.options.t_start, 0}, now_) && world_.options.record_events) {
        SceneEvent event{.t = now_.value, .number = result_.event_count, .kind = kind, .body = i};
        event.other = {true, world_.faces[face].surface};
        event.before[0] = velocity;
        event.after[0] = world_.bodies[i].v;
        result_.events.push_back(event);
    }
}

}  // namespace ricochet::detail
