#include "scene/contacts.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "scene/islands.hpp"

namespace ricochet::detail {

namespace {

/// A crowd ends after so many steps in a row without a rebound.
constexpr std::uint32_t calm_steps = 100;
/// It begins with so many cuts within one step.
constexpr std::uint32_t crowded_cuts = 32;

/// Overlap, as a fraction of the coordinates, that crowds may leave to the groups after them.
constexpr double overlap_of_crowds = 1e-4;

}  // namespace

std::vector<std::uint32_t> Contacts::closure(const std::vector<std::uint32_t>& bodies) const
{
    std::vector<std::uint32_t> all;
    const auto add = [&](const std::vector<std::uint32_t>& some) {
        all.insert(all.end(), some.begin(), some.end());
    };
    for (const std::uint32_t i : bodies) {
        const Body& body = world_.bodies[i];
        // Bodies joined by springs are in one group.
        if (body.contact != none) {
            add(groups_[body.contact]->members);
        } else if (body.island != none) {
            add(world_.islands->members(body.island));
        } else {
            all.push_back(i);
        }
    }
    std::ranges::sort(all);
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
}

/// The set-up of bodies at the present places of their records.
IslandSetup Contacts::setup_of(const std::vector<std::uint32_t>& members,
                               const std::vector<std::uint32_t>& faces) const
{
    IslandSetup setup{.gravity = world_.gravity};
    std::vector<std::uint32_t> islands;
    for (const std::uint32_t i : members) {
        const Body& body = world_.bodies[i];
        const Disc& disc = world_.scene.bodies()[i];
        setup.bodies.push_back({.id = i,
                                .at = body.p,
                                .velocity = world_.drifts[i].v,
                                .mass = disc.mass,
                                .radius = disc.radius,
                                .drag = disc.drag,
                                .material = body.material});
        if (world_.turning(i)) {
            setup.bodies.back().inertia = disc.inertia;
            setup.bodies.back().spin = world_.turns[i].spin;
        }
        if (body.island != none) islands.push_back(body.island);
    }
    std::ranges::sort(islands);
    islands.erase(std::unique(islands.begin(), islands.end()), islands.end());
    for (const std::uint32_t island : islands) {
        for (const auto& [a, b, rest, stiffness, damping] : world_.islands->springs(island)) {
            setup.springs.push_back({a, b, rest, stiffness, damping});
        }
    }
    for (const std::uint32_t f : faces) {
        const Face& face = world_.faces[f];
        if (face.kind == Face::Kind::vertex) continue;  // segments include their ends
        IslandWall wall{.id = f, .point = face.at, .normal = face.normal};
        wall.material = face.material;
        if (face.kind == Face::Kind::arc) {
            wall.radius = face.length;
            wall.span = face.span;
        } else if (face.kind == Face::Kind::segment) {
            wall.is_segment = true;
            wall.end = face.at - face.length * turned(face.normal);
        }
        setup.walls.push_back(wall);
    }
    setup.coefficients = [this](std::uint32_t a, std::uint32_t b) {
        return ContactCoefficients{world_.restitution(a, b), world_.friction(a, b)};
    };
    return setup;
}

/// Sets the motions of walls by the clock of a group, which starts now.
void Contacts::set_motions(IslandSetup& setup, Group& group, const Instant& now) const
{
    for (IslandWall& wall : setup.walls) {
        if (!world_.moves(wall.id)) continue;
        const SurfaceMotion* motion = world_.moving(wall.id).motion;
        auto own = std::make_unique<WallMotion>();
        own->displacement = [=](double s) { return displacement(*motion, now.plus(s)); };
        own->still_until = [=](double s) {
            const double t = now.plus(s);
            const double until = ricochet::detail::still_until(*motion, t);
            return until > t ? now.until(until) : s;
        };
        own->next_break = [=](double s) { return now.until(next_break(*motion, now.plus(s))); };
        wall.motion = own.get();
        group.motions.push_back(std::move(own));
    }
}

/// Largest overlap relative to the coordinates: rounding, what crowds leave and, where walls move,
/// their deviation from the straight lines of a step.
double Contacts::largest_overlap(const Group& group) const
{
    const bool crowds = world_.statistics.crowded_steps > 0;
    double most = crowds ? overlap_of_crowds : IslandOptions{}.largest_overlap;
    const double h = world_.options.contact_step;
    for (const std::uint32_t f : group.faces) {
        if (!world_.moves(f)) continue;
        const double bend = world_.moving(f).bounds.acceleration * h * h;
        for (const std::uint32_t i : group.members) {
            const Body& body = world_.bodies[i];
            const double size = body.radius + std::fabs(body.p[0]) + std::fabs(body.p[1]);
            most = std::max(most, size > 0 ? bend / size : never);
        }
    }
    return most;
}

std::uint32_t Contacts::join(std::vector<std::uint32_t> members, std::vector<std::uint32_t> faces,
                             const std::vector<std::uint32_t>& patience, const Instant& now,
                             bool crowded)
{
    world_.drifts.resize(world_.bodies.size());
    std::vector<std::array<Vector2, 2>> states;
    auto group = std::make_unique<Group>();
    group->crowded = crowded;
    for (const std::uint32_t i : members) {
        const std::uint32_t part = world_.bodies[i].contact;
        if (part != none) {
            commit(part, now);
            const Group& own = *groups_[part];
            if (own.cuts > group->cuts) {
                group->cuts = own.cuts;
                group->counted = own.counted;
            }
        }
        states.push_back({world_.position(i, now), world_.velocity(i, now)});
    }
    for (std::size_t k = 0; k < members.size(); ++k) {
        const std::uint32_t i = members[k];
        Body& body = world_.bodies[i];
        if (body.contact != none) groups_[std::exchange(body.contact, none)].reset();
        if (body.quartic) world_.islands->suspend(body.island);
        body.p = states[k][0];
        body.v = body.a = {};
        body.t = now;
        body.held = none;
        body.asleep = false;
        ++body.version;
        world_.drifts[i] = {states[k][1], {}};
        if (world_.turning(i)) world_.set_spin(i, now, world_.spin(i, now));
    }
    IslandSetup setup = setup_of(members, faces);
    for (std::size_t k = 0; k < members.size(); ++k) setup.bodies[k].patience = patience[k];
    set_motions(setup, *group, now);
    group->members = std::move(members);
    group->faces = std::move(faces);
    group->motion =
        world_.options.contacts->make(std::move(setup), {.step = world_.options.contact_step,
                                                         .largest_overlap = largest_overlap(*group),
                                                         .crowded = crowded});
    group->start = group->end = now;
    const auto free = std::ranges::find_if(groups_, [](const auto& g) { return !g; });
    const auto number = static_cast<std::uint32_t>(free - groups_.begin());
    for (const std::uint32_t i : group->members) world_.bodies[i].contact = number;
    if (free == groups_.end()) {
        groups_.push_back(std::move(group));
    } else {
        *free = std::move(group);
    }
    ++world_.statistics.joins;
    return number;
}

IslandOutcome Contacts::plan(std::uint32_t which, const Instant& now, const Instant& t_end)
{
    Group& group = *groups_[which];
    const double left = seconds(now, t_end);
    const auto [outcome, planned, step, defect, wakes, rebounds] =
        group.motion->plan(std::min(world_.options.contact_step, left));
    const bool asleep = outcome == IslandOutcome::asleep;
    const double length = asleep && wakes < never ? wakes : planned;
    group.outcome = outcome;
    group.rebounds = rebounds;
    double& largest = world_.statistics.contact_defect;
    if (step > 0) largest = std::max(largest, defect);
    group.length = length;
    group.planned = true;
    group.start = now;
    group.end = now.after(length);
    // A remainder of rounding at the end of the run is not a step.
    const bool over = seconds(group.end, t_end) <= resolution(t_end);
    if (length == left || (over && outcome != IslandOutcome::impact)) group.end = t_end;
    if (asleep && !(wakes < never)) group.end = t_end;
    if (asleep && group.crowded) leave_crowd(group);
    const bool moves =
        step > 0 && (outcome == IslandOutcome::reached || outcome == IslandOutcome::impact);
    for (const std::uint32_t i : group.members) {
        const IslandBody state = group.motion->body(i);
        Body& body = world_.bodies[i];
        body.p = state.at;
        body.v = moves ? group.motion->chord(i) : Vector2{};
        body.a = {};
        body.t = now;
        body.asleep = asleep;
        ++body.version;
        const Vector2 v = state.velocity;
        world_.drifts[i] = {v, moves ? (1 / step) * (body.v - v) : Vector2{}};
        if (world_.turning(i)) plan_turn(i, group, moves ? step : 0);
    }
    return outcome;
}

/// Sets the record of the angle of a disc in a planned step of this length, 0 where it does not
/// move.
void Contacts::plan_turn(std::uint32_t i, const Group& group, double step)
{
    const double spin = group.motion->body(i).spin;
    const double chord = step > 0 ? group.motion->chord_spin(i) : spin;
    world_.set_spin(i, group.start, spin, step > 0 ? (chord - spin) / step : 0);
    world_.turns[i].chord = chord;
}

void Contacts::commit(std::uint32_t which, const Instant& now)
{
    Group& group = *groups_[which];
    if (!std::exchange(group.planned, false)) return;
    const bool asleep = group.outcome == IslandOutcome::asleep;
    const bool whole = group.end.value == now.value && group.end.remainder == now.remainder;
    const double s = whole ? group.length : seconds(group.start, now);
    if (!asleep || !group.motions.empty()) group.motion->commit(s);
    world_.statistics.contact_steps += !asleep && s > 0;
    world_.statistics.crowded_steps += group.crowded && !asleep && s > 0;
    if (whole && !asleep) world_.statistics.crowded_rebounds += group.rebounds;
    group.start = group.end = now;
    for (const std::uint32_t i : group.members) {
        const IslandBody state = group.motion->body(i);
        Body& body = world_.bodies[i];
        body.p = state.at;
        body.v = {};
        body.t = now;
        world_.drifts[i] = {state.velocity, {}};
        if (world_.turning(i)) world_.set_spin(i, now, state.spin);
    }
}

bool Contacts::crowds(std::uint32_t which, const Instant& now)
{
    Group& group = *groups_[which];
    const std::uint64_t least = world_.options.crowded_from;
    if (group.crowded || least == 0 || group.members.size() < least) return false;
    if (seconds(group.counted, now) > world_.options.contact_step) {
        group.counted = now;
        group.cuts = 0;
    }
    return ++group.cuts >= crowded_cuts;
}

void Contacts::leave_crowd(Group& group)
{
    group.crowded = false;
    group.cuts = group.calm = 0;
    group.motion->set_crowded(false);
}

bool Contacts::stays_crowded(std::uint32_t which)
{
    Group& group = *groups_[which];
    if (!group.crowded) return false;
    group.calm = group.rebounds > 0 ? 0 : group.calm + 1;
    if (group.calm >= calm_steps) leave_crowd(group);
    return group.crowded;
}

void Contacts::dissolve(std::uint32_t which, const Instant& now)
{
    commit(which, now);
    for (const std::uint32_t i : groups_[which]->members) {
        Body& body = world_.bodies[i];
        body.v = world_.drifts[i].v;
        body.a = world_.gravity;
        body.asleep = false;
        body.contact = none;
        ++body.version;
    }
    groups_[which].reset();
}

bool Contacts::knows(std::uint32_t group, std::uint32_t face) const
{
    return std::ranges::binary_search(groups_[group]->faces, face);
}

}  // namespace ricochet::detail
