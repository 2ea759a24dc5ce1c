// Plates of a scene: they lie in no cell, and are tested against every body and wall.
#include <algorithm>
#include <cmath>

#include "scene/moving.hpp"
#include "scene/plates.hpp"
#include "scene/scene_loop.hpp"

namespace ricochet::detail {

/// Considers plates for another body. A sleeper has no entry in the calendar, but a plate has.
void SceneLoop::consider_plates(std::uint32_t i)
{
    const bool asleep = world_.bodies[i].asleep;
    for (const World::Plate& plate : world_.plates) {
        const Meeting meeting = meet_plate(world_, plate, i, t_end_);
        if (!asleep) {
            consider(i, meeting, false, plate.body);
            continue;
        }
        consider(plate.body, meeting, false, i);
        put_in_calendar(plate.body);
    }
}

void SceneLoop::predict_plate(std::uint32_t i)
{
    Pending& pending = pending_[i];
    pending.t = pending.crossing = no_instant;
    pending.kind = Pending::Kind::nothing;
    const World::Plate& plate = *world_.plate(i);
    const bool asleep = world_.bodies[i].asleep;
    for (std::uint32_t f = 0; f < world_.wall_count && !asleep; ++f) {
        consider(i, meet_wall(world_, plate, f), true, f);
    }
    const auto count = static_cast<std::uint32_t>(world_.faces.size());
    for (std::uint32_t f = world_.fixed_count; f < count; ++f) {
        if (!plate.yields(world_.faces[f].normal)) continue;
        consider(i, meet_moving(world_, i, f, t_end_), true, f);
    }
    for (const std::uint32_t j : members_) {
        if (j == i || (asleep && world_.bodies[j].asleep)) continue;
        consider(i, meet_plate(world_, plate, j, t_end_), false, j);
    }
    put_in_calendar(i);
}

/// Gathers what touches a plate of the cluster; what the seed names counts as touching.
void SceneLoop::gather_plate(std::uint32_t slot, const Pending* seed)
{
    const World::Plate& plate = *world_.plate(cluster_.bodies[slot]);
    const bool by_face =
        seed && (seed->kind == Pending::Kind::face || seed->kind == Pending::Kind::presses_face);
    const std::uint32_t other = seed && !by_face ? seed->other : none;
    cluster_.sides.emplace_back();
    gather_stops(slot, by_face ? seed->other : none);
    const Vector2 middle = world_.position(plate.body, now_);
    const double size = plate.length + std::fabs(middle[0]) + std::fabs(middle[1]);
    for (const std::uint32_t j : members_) {
        if (j == plate.body) continue;
        const double up = dot(world_.position(j, now_) - middle, plate.normal);
        const double near = world_.bodies[j].radius * (1 + 1e-9) + 1e-9 * size;
        if (j == other || std::fabs(up) <= near) try_plate(slot, plate, j, j == other);
    }
}

/// Gathers walls that stop a plate of the cluster; `sure` counts as touched. A wall has no
/// temperature for a plate.
void SceneLoop::gather_stops(std::uint32_t slot, std::uint32_t sure)
{
    const World::Plate& plate = *world_.plate(cluster_.bodies[slot]);
    const Vector2 p = world_.position(plate.body, now_);
    const Vector2 v = cluster_.before[slot];
    const std::uint32_t material = world_.bodies[plate.body].material;
    const auto touch = [&](std::uint32_t f, double gap, const Vector2& w) {
        const Face& wall = world_.faces[f];
        const double tolerance = World::rounding(p, plate.length) + World::rounding(wall.at, 0) +
                                 2 * resolution(now_) * std::fabs(dot(v - w, wall.normal));
        if (f != sure && !(gap <= tolerance && gap >= -1e3 * tolerance)) return;
        Contact contact{.a = plate.body, .b = f, .surface = true, .slot_a = slot};
        contact.normal = wall.normal;
        contact.at = p - plate.reach(wall.normal) * wall.normal;
        contact.restitution = world_.restitution(material, wall.material);
        contact.friction = world_.friction(material, wall.material);
        contact.by_speed = !world_.plain_laws && world_.depends_on_speed(material, wall.material);
        contact.moving = world_.moves(f);
        contact.surface_velocity = w;
        cluster_.contacts.push_back(contact);
    };
    for (std::uint32_t f = 0; f < world_.wall_count; ++f) {
        const Face& wall = world_.faces[f];
        if (plate.yields(wall.normal)) touch(f, wall_gap(wall, plate, p), {});
    }
    const auto count = static_cast<std::uint32_t>(world_.faces.size());
    for (std::uint32_t f = world_.fixed_count; f < count; ++f) {
        const Face& wall = world_.faces[f];
        if (!plate.yields(wall.normal)) continue;
        const double gap = world_.moving_gap(f, plate.reach(wall.normal), p, now_).gap;
        touch(f, gap, world_.surface_velocity(f, now_));
    }
}

/// Gathers plates that a body of the cluster touches.
void SceneLoop::gather_plates(std::uint32_t slot, std::uint32_t sure)
{
    for (const World::Plate& plate : world_.plates) {
        try_plate(slot, plate, cluster_.bodies[slot], plate.body == sure);
    }
}

/// Adds the contact of a body with a plate, one of which is in `slot`, if they touch.
void SceneLoop::try_plate(std::uint32_t slot, const World::Plate& plate, std::uint32_t i, bool sure)
{
    const std::uint32_t other = cluster_.bodies[slot] == i ? plate.body : i;
    if (slots_[other] != none && slots_[other] < slot) return;  // gathered from there
    const Body& body = world_.bodies[i];
    const Vector2 p = world_.position(i, now_);
    const Vector2 v = world_.velocity(i, now_) - world_.velocity(plate.body, now_);
    const FaceGap at = plate_gap(world_, plate, i, now_);
    const double rounding = World::rounding(p, body.radius) +
                            World::rounding(world_.position(plate.body, now_), plate.length);
    double tolerance = rounding + 2 * resolution(now_) * std::fabs(dot(v, at.normal));
    if (body.contact != none) tolerance += loose * (body.radius + norm(p));
    if (!sure && !(at.gap <= tolerance)) return;
    Contact contact{.a = i, .b = plate.body, .surface = false};
    contact.slot_a = slot_of(i);
    contact.slot_b = slot_of(plate.body);
    contact.normal = at.normal;
    contact.at = p - body.radius * at.normal;
    const bool at_end = std::fabs(dot(at.normal, turned(plate.normal))) > 8 * epsilon;
    contact.blur = at_end ? rounding / body.radius : 0;
    const Body& own = world_.bodies[plate.body];
    contact.restitution = world_.restitution(body.material, own.material);
    contact.friction = world_.friction(body.material, own.material);
    if (!world_.plain_laws) set_laws(contact, body.material, own.material);
    cluster_.contacts.push_back(contact);
}

/// Computes how pushes move the plates of the cluster.
void SceneLoop::couple_plates()
{
    for (std::uint32_t slot = 0; slot < cluster_.bodies.size(); ++slot) {
        const World::Plate* plate = world_.plate(cluster_.bodies[slot]);
        if (!plate) continue;
        const Vector2 change = plate->mobility * plate->along;
        cluster_.couplings.push_back(
            {slot, slot, {plate->along[0] * change, plate->along[1] * change}});
    }
    if (!cluster_.couplings.empty()) cluster_.impulses.assign(cluster_.bodies.size(), {});
}

/// Keeps the sides on which points and plates of the cluster have touched plates.
void SceneLoop::touch_sides()
{
    for (const Contact& contact : cluster_.contacts) {
        if (contact.surface || !world_.plate(contact.b)) continue;
        touch_side(world_, world_.plates[world_.plate_numbers[contact.b]], contact.a,
                   contact.normal, now_);
    }
}

/// Lets a plate rest on the wall on which gravity presses it.
void SceneLoop::rest_on_stop(std::uint32_t i)
{
    const std::uint32_t wall = pending_[i].other;
    const Vector2 velocity = world_.velocity(i, now_);
    begin_record(i, {}, {});
    Body& body = world_.bodies[i];
    body.a = {};
    body.asleep = true;
    body.held = wall;
    note(SceneEvent::Kind::held, i, wall, velocity);
    count_held();
    predict(i);
}

}  // namespace ricochet::detail
