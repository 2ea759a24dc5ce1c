// Bodies that stay in contact with each other: joined to groups, and released again.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "scene/scene_loop.hpp"

namespace ricochet::detail {

namespace {

/// Steps during which a group has been in several parts before it is divided.
constexpr std::uint32_t patience_to_divide = 3;

/// [radii] Distance of terrain from the centre of a disc up to which its group knows it.
constexpr double ahead = 5;

/// Steps within which a body must arrive to join a crowd before it does.
constexpr double steps_ahead = 10;

}  // namespace

/// Whether the group of a body meets this face or body itself.
bool SceneLoop::known_to_group(std::uint32_t i, bool surface, std::uint32_t other) const
{
    const std::uint32_t group = world_.bodies[i].contact;
    if (group == none) return false;
    if (!surface) return world_.bodies[other].contact == group;
    // In the middle of a segment a point has no normal.
    if (world_.bodies[i].radius == 0 && world_.faces[other].kind != Face::Kind::wall) return false;
    return contacts_.knows(group, other);
}

/// Whether a contact is between a group and something outside it.
bool SceneLoop::across(const Contact& contact) const
{
    const bool first = world_.bodies[contact.a].contact != none;
    const bool second = !contact.surface && world_.bodies[contact.b].contact != none;
    return (first || second) && !known_to_group(contact.a, contact.surface, contact.b);
}

/// Bodies in contact across a group's boundary, on both sides, that approach at more than `least`
/// and less than `most` [m/s].
std::vector<std::uint32_t> SceneLoop::joining(double least, double most) const
{
    std::vector<std::uint32_t> bodies;
    for (const Contact& contact : cluster_.contacts) {
        if (!across(contact)) continue;
        const double approach = -dot(relative_velocity(cluster_.before, contact), contact.normal);
        if (approach <= least || approach >= most) continue;
        bodies.push_back(contact.a);
        if (!contact.surface) bodies.push_back(contact.b);
    }
    return bodies;
}

std::vector<std::uint32_t> SceneLoop::faces_near(const std::vector<std::uint32_t>& members) const
{
    std::vector<std::uint32_t> faces;
    for (std::uint32_t f = 0; f < world_.wall_count; ++f) faces.push_back(f);
    const auto count = static_cast<std::uint32_t>(world_.faces.size());
    for (std::uint32_t f = world_.fixed_count; f < count; ++f) {
        // Faces that are not touched remain with the scene, and keep no group awake.
        const bool touched = std::ranges::any_of(members, [&](std::uint32_t i) {
            const double radius = world_.bodies[i].radius;
            const Vector2 p = world_.position(i, now_);
            const double gap = world_.moving_gap(f, radius, p, now_).gap;
            return gap <= loose_motion(f, radius + norm(p));
        });
        if (touched) faces.push_back(f);
    }
    if (!on_terrain_) return faces;
    // Those that a member will roll onto soon; it joins a new group where it comes to another one.
    for (const std::uint32_t i : members) {
        const Body& body = world_.bodies[i];
        const Vector2 p = world_.position(i, now_);
        const double near = ahead * body.radius + 1e-6 * norm(p);
        grid_.terrain(body).append_within(p, near, faces);
    }
    std::ranges::sort(faces);
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    return faces;
}

/// Handles a body pressed onto another one, or onto a surface; every body that touches it joins it.
void SceneLoop::press(std::uint32_t i, const std::string& sentence)
{
    gather(i, pending_[i]);
    std::vector<std::uint32_t> bodies = cluster_.bodies;
    if (!contacts_.available()) {
        bodies = {i};
        const Pending& pending = pending_[i];
        if (pending.kind == Pending::Kind::presses) bodies.push_back(pending.other);
        std::ranges::sort(bodies);
    }
    hand_over(bodies, sentence);
}

void SceneLoop::hand_over(const std::vector<std::uint32_t>& bodies, const std::string& sentence)
{
    for (const std::uint32_t i : bodies) {
        if (!world_.plate(i)) continue;
        return fail(Outcome::zeno, bodies,
                    fmt::format("{} is in lasting contact, which of plates is followed on walls "
                                "that do not move alone",
                                called(i)));
    }
    if (!contacts_.available()) {
        return fail(Outcome::zeno, bodies,
                    fmt::format("{}: lasting contact is not followed without "
                                "SceneOptions::contacts",
                                sentence));
    }
    if (world_.periodic) {
        return fail(Outcome::zeno, bodies,
                    fmt::format("{}: lasting contact is not followed in a scene with a period",
                                sentence.empty() ? called(bodies.front()) : sentence));
    }
    patience_.resize(world_.bodies.size());
    const bool crowded = meets_crowd(bodies);
    std::vector<std::uint32_t> members = contacts_.closure(bodies);
    if (crowded) members = with_arriving(std::move(members));
    join(std::move(members), bodies, crowded);
}

/// Whether bodies can be in lasting contact near these faces; otherwise the run fails.
bool SceneLoop::can_last(const std::vector<std::uint32_t>& members,
                         const std::vector<std::uint32_t>& faces,
                         const std::vector<std::uint32_t>& bodies)
{
    for (const std::uint32_t i : members) {
        if (!world_.bodies[i].mapped) continue;
        fail(Outcome::zeno, bodies,
             fmt::format("{} is in lasting contact, which of systems is not followed", called(i)));
        return false;
    }
    const bool segments = std::ranges::any_of(
        faces, [&](std::uint32_t f) { return world_.faces[f].kind != Face::Kind::wall; });
    for (const std::uint32_t i : members) {
        if (!segments || world_.bodies[i].radius > 0) continue;
        fail(Outcome::zeno, {i},
             fmt::format("'{}' is a point in lasting contact near terrain; only discs can be in "
                         "lasting contact there",
                         called(i)));
        return false;
    }
    return true;
}

/// Takes bodies that are to be a group out of the calendar. Returns those that were in none.
std::vector<std::uint32_t> SceneLoop::take_out(const std::vector<std::uint32_t>& members)
{
    std::vector<std::uint32_t> joined;
    for (const std::uint32_t i : members) {
        const Body& body = world_.bodies[i];
        if (body.contact != none) {
            calendar_.set(entry_of_group(body.contact), no_instant);
            continue;
        }
        joined.push_back(i);
        Backoff& own = patience_[i];
        own.steps =
            next_patience(own.steps, -seconds(own.released, now_), 0, world_.options.contact_step);
        if (body.island != none) {
            calendar_.set(static_cast<std::uint32_t>(world_.bodies.size()) + body.island,
                          no_instant);
        }
    }
    return joined;
}

/// Makes a group of `members`; `bodies` are those that were found in contact.
void SceneLoop::join(std::vector<std::uint32_t> members, const std::vector<std::uint32_t>& bodies,
                     bool crowded)
{
    std::vector<std::uint32_t> faces = faces_near(members);
    if (!can_last(members, faces, bodies)) return;
    const std::vector<std::uint32_t> joined = take_out(members);
    std::vector<std::uint32_t> patience;
    for (const std::uint32_t i : members) patience.push_back(patience_[i].steps);
    try {
        const std::uint32_t group =
            contacts_.join(std::move(members), std::move(faces), patience, now_, crowded);
        for (const std::uint32_t i : joined) note_group(SceneEvent::Kind::joined, i);
        if (!joined.empty()) ++result_.event_count;
        if (contacts_.crowds(group, now_)) return crowd(group);
        plan_group(group);
    } catch (const std::invalid_argument& error) {
        fail(Outcome::zeno, bodies, error.what());
    }
}

bool SceneLoop::meets_crowd(const std::vector<std::uint32_t>& bodies) const
{
    return std::ranges::any_of(bodies, [&](std::uint32_t i) {
        const std::uint32_t group = world_.bodies[i].contact;
        return group != none && contacts_[group].crowded;
    });
}

/// Makes a group a crowd, with all bodies that will arrive soon.
void SceneLoop::crowd(std::uint32_t number)
{
    std::vector<std::uint32_t> members = contacts_[number].members;
    join(with_arriving(members), members, true);
}

/// Adds bodies that meet one of the members, or one another, within some steps, so that a crowd is
/// not cut by each of them.
std::vector<std::uint32_t> SceneLoop::with_arriving(std::vector<std::uint32_t> members)
{
    const double soon = steps_ahead * world_.options.contact_step;
    const double fall = norm(world_.gravity) * soon * soon;
    std::vector<char> known(world_.bodies.size(), 0);
    for (const std::uint32_t i : members) known[i] = 1;
    for (std::size_t k = 0; k < members.size(); ++k) {
        const std::uint32_t i = members[k];
        const Vector2 p = world_.position(i, now_);
        const Vector2 v = world_.velocity(i, now_);
        grid_.each_near(world_.bodies, i, pending_[i].cell, [&](std::uint32_t j) {
            const Body& other = world_.bodies[j];
            if (known[j] || other.mapped) return;
            const double reach = world_.bodies[i].radius + other.radius;
            if (reach == 0) return;
            const double gap = norm(p - world_.position(j, now_)) - reach;
            if (gap > soon * norm(v - world_.velocity(j, now_)) + fall) return;
            for (const std::uint32_t also : contacts_.closure({j})) {
                if (!std::exchange(known[also], 1)) members.push_back(also);
            }
        });
    }
    std::ranges::sort(members);
    return members;
}

void SceneLoop::note_group(SceneEvent::Kind kind, std::uint32_t i)
{
    if (!world_.options.record_events) return;
    SceneEvent event{.t = now_.value, .number = result_.event_count, .kind = kind, .body = i};
    event.other = {false, i};
    event.before[0] = event.after[0] = world_.velocity(i, now_);
    event.before[1] = event.after[1] = event.after[0];
    result_.events.push_back(event);
}

/// Plans the next step of a group, and predicts the impacts of its bodies during that step.
void SceneLoop::plan_group(std::uint32_t number)
{
    const bool slept = world_.bodies[contacts_[number].members[0]].asleep;
    const IslandOutcome outcome = contacts_.plan(number, now_, t_end_);
    const Contacts::Group& group = contacts_[number];
    switch (outcome) {
        case IslandOutcome::released: return release(number);
        case IslandOutcome::not_converged:
        case IslandOutcome::non_finite:
            return fail(
                outcome == IslandOutcome::non_finite ? Outcome::non_finite : Outcome::not_converged,
                group.members,
                fmt::format("the group of {} in lasting contact could not go on: {}",
                            called(group.members[0]), group.motion->failure()));
        case IslandOutcome::asleep:
            calendar_.set(entry_of_group(number),
                          before(group.end, t_end_) ? group.end : no_instant);
            if (!slept) {
                for (const std::uint32_t i : group.members) {
                    note_group(SceneEvent::Kind::slept, i);
                }
                ++result_.event_count;
            }
            break;
        case IslandOutcome::reached:
        case IslandOutcome::impact:
            calendar_.set(entry_of_group(number),
                          before(group.end, t_end_) ? group.end : no_instant);
            break;
    }
    for (const std::uint32_t i : group.members) {
        move_to_cell(i);
        predict(i);
    }
}

void SceneLoop::step_group(std::uint32_t number)
{
    const bool arrival = contacts_[number].outcome == IslandOutcome::impact;
    contacts_.commit(number, now_);
    if (arrival) return arrive(number);
    if (contacts_.stays_crowded(number) || !divide(number)) plan_group(number);
}

/// Resolves an impact between bodies of one group that meet fast enough to rebound.
void SceneLoop::arrive(std::uint32_t number)
{
    const std::uint32_t first = contacts_[number].motion->arrivals().at(0).first;
    gather(first, Pending{});
    resolve_cluster(first);
    if (result_.failure || !contacts_.exists(number) || contacts_[number].planned) return;
    plan_group(number);
}

/// Continues a group after an impact.
void SceneLoop::restart_group(std::uint32_t number)
{
    contacts_.commit(number, now_);
    for (std::size_t k = 0; k < cluster_.bodies.size(); ++k) {
        const std::uint32_t i = cluster_.bodies[k];
        if (world_.bodies[i].contact != number) continue;
        const bool turned = cluster_.turned(k);
        if (cluster_.after[k] == cluster_.before[k] && !turned) continue;
        contacts_.set_velocity(number, i, cluster_.after[k]);
        if (turned) contacts_.set_spin(number, i, cluster_.turning[k].spin);
        world_.bodies[i].asleep = false;
    }
    for (const std::uint32_t i : contacts_[number].members) world_.bodies[i].asleep = false;
    plan_group(number);
}

/// Whether a body that no other one of its group touches can go on without it: in flight, on a wall
/// or on the inside of a segment that does not move.
bool SceneLoop::may_leave(std::uint32_t number, std::uint32_t i) const
{
    const Body& body = world_.bodies[i];
    if (body.island != none) return false;
    for (const std::uint32_t f : faces_near({i})) {
        if (world_.moves(f)) return false;  // the face carries it
        const Face& face = world_.faces[f];
        if (face.kind != Face::Kind::vertex && face.kind != Face::Kind::arc) continue;
        const double gap = norm(body.p - nearest_on(face, body.p)) - body.radius;
        if (gap > 1e-9 * (body.radius + norm(body.p))) continue;
        return false;
    }
    return contacts_.exists(number);
}

/// Splits a group whose parts have been apart for some steps into several groups.
bool SceneLoop::divide(std::uint32_t number)
{
    Contacts::Group& group = contacts_[number];
    auto parts = group.motion->groups();
    const bool alone = parts.size() == 1 && parts[0].size() == 1;
    if (parts.size() == 1 && !(alone && may_leave(number, parts[0][0]))) {
        group.apart = 0;
        return false;
    }
    std::uint32_t patience = patience_to_divide;
    for (const std::uint32_t i : group.members) {
        patience = std::max(patience, patience_[i].steps);
    }
    if (++group.apart < patience) return false;
    std::vector<std::uint32_t> leaving;
    std::vector<std::vector<std::uint32_t>> staying;
    for (auto& part : parts) {
        if (part.size() == 1 && may_leave(number, part[0])) {
            leaving.push_back(part[0]);
        } else {
            std::ranges::sort(part);
            staying.push_back(std::move(part));
        }
    }
    calendar_.set(entry_of_group(number), no_instant);
    contacts_.dissolve(number, now_);
    for (const auto& part : staying) {
        std::vector<std::uint32_t> steps;
        steps.reserve(part.size());
        for (const std::uint32_t i : part) steps.push_back(patience_[i].steps);
        const std::uint32_t next = contacts_.join(part, faces_near(part), steps, now_);
        plan_group(next);
    }
    set_free(leaving);
    return true;
}

/// Releases a group without contact for as long as its patience requires.
void SceneLoop::release(std::uint32_t number)
{
    const std::vector<std::uint32_t> members = contacts_[number].members;
    calendar_.set(entry_of_group(number), no_instant);
    contacts_.dissolve(number, now_);
    set_free(members);
}

void SceneLoop::set_free(const std::vector<std::uint32_t>& bodies)
{
    std::vector<std::uint32_t> islands;
    for (const std::uint32_t i : bodies) {
        patience_[i].released = now_;
        series_[i] = {};
        note_group(SceneEvent::Kind::released, i);
        const Body& body = world_.bodies[i];
        if (body.island == none) {
            settle(i, none);
        } else if (std::ranges::find(islands, body.island) == islands.end()) {
            islands.push_back(body.island);
        }
    }
    if (!bodies.empty()) ++result_.event_count;
    Islands& own = *world_.islands;
    for (const std::uint32_t island : islands) {
        std::vector<std::array<Vector2, 2>> states;
        for (const std::uint32_t i : own.members(island)) {
            states.push_back({world_.bodies[i].p, world_.bodies[i].v});
        }
        if (!own.resume(island, now_, states)) {
            return fail(Outcome::step_underflow, own.members(island),
                        fmt::format("the step of the island of {} fell below what the time "
                                    "resolves",
                                    called(own.members(island)[0])));
        }
        const Instant& end = own.end(island);
        calendar_.set(static_cast<std::uint32_t>(world_.bodies.size()) + island,
                      before(end, t_end_) ? end : no_instant);
    }
    for (const std::uint32_t i : bodies) {
        move_to_cell(i);
        predict(i);
    }
}

}  // namespace ricochet::detail
