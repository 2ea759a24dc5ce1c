// Impacts: the cluster that is struck at one instant, and the motion of its bodies afterwards.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "scene/scene_loop.hpp"

namespace ricochet::detail {

namespace {

/// Hops are low below this many roundings of the place; this many consecutive low hops are the
/// last.
constexpr double low = 1024;
constexpr std::uint32_t most_low = 1024;

/// Consecutive predicted impacts that change nothing.
constexpr std::uint32_t most_unmoved = 1000;
/// The same, before the cluster is joined to a group in lasting contact.
constexpr std::uint32_t unmoved_to_join = 8;

}  // namespace

std::uint32_t SceneLoop::slot_of(std::uint32_t body)
{
    std::uint32_t& slot = slots_[body];
    if (slot == none) {
        slot = static_cast<std::uint32_t>(cluster_.bodies.size());
        cluster_.bodies.push_back(body);
        cluster_.before.push_back(world_.velocity(body, now_));
    }
    return slot;
}

void SceneLoop::gather(std::uint32_t i, const Pending& seed)
{
    cluster_.clear();
    slot_of(i);
    for (std::uint32_t slot = 0; slot < cluster_.bodies.size(); ++slot) {
        const Body& body = world_.bodies[cluster_.bodies[slot]];
        if (body.mapped) {
            for (const std::uint32_t other : world_.islands->members(body.island)) slot_of(other);
        }
        const bool first = slot == 0;
        if (world_.plate(cluster_.bodies[slot])) {
            gather_plate(slot, first ? &seed : nullptr);
            continue;
        }
        const bool pair = seed.kind == Pending::Kind::pair || seed.kind == Pending::Kind::presses;
        gather_faces(slot, first && !pair ? seed.other : none);
        if (celled_) gather_pairs(slot, first && pair ? seed.other : none);
        if (!world_.plates.empty()) gather_plates(slot, first && pair ? seed.other : none);
    }
    cluster_.after = cluster_.before;
    if (!world_.accelerations.empty()) add_couplings();
    if (!world_.plates.empty()) couple_plates();
    if (world_.any_turning) {
        for (const std::uint32_t body : cluster_.bodies) {
            const double spin = world_.spin(body, now_);
            cluster_.turning.push_back(
                {spin, world_.turns[body].inverse_inertia, world_.bodies[body].radius, spin});
        }
    }
    for (const std::uint32_t body : cluster_.bodies) slots_[body] = none;
}

/// Computes how pushes move the discs of systems. A cluster contains all discs of a system, or
/// none.
void SceneLoop::add_couplings()
{
    for (std::uint32_t by = 0; by < cluster_.bodies.size(); ++by) {
        const Body& pushed = world_.bodies[cluster_.bodies[by]];
        if (!pushed.mapped) continue;
        for (std::uint32_t of = 0; of < cluster_.bodies.size(); ++of) {
            const Body& moved = world_.bodies[cluster_.bodies[of]];
            if (!moved.mapped || moved.island != pushed.island) continue;
            const auto changes =
                world_.islands->mobility(cluster_.bodies[of], cluster_.bodies[by], now_);
            cluster_.couplings.push_back({of, by, changes});
            if (of != by) continue;
            const auto& [x, y] = changes;
            const double size = std::fabs(x[0]) + std::fabs(y[1]);
            const bool positive = x[0] >= 0 && y[1] >= 0 &&
                                  x[0] * y[1] - x[1] * y[0] >= -1e-9 * size * size &&
                                  std::fabs(x[1] - y[0]) <= 1e-6 * size;
            if (positive) continue;
            throw std::invalid_argument(fmt::format(
                "simulate: push of {} changes its velocity by ({}, {}) and ({}, {}) for impulses "
                "of "
                "1 N s along x and y; expected a symmetric inverse mass that is not negative",
                called(cluster_.bodies[by]), x[0], x[1], y[0], y[1]));
        }
    }
    if (!cluster_.couplings.empty()) cluster_.impulses.assign(cluster_.bodies.size(), {});
}

/// [m/s] Speed at which the gap between a point and a face changes.
static double closing_speed(const Face& face, const Vector2& p, const Vector2& v)
{
    if (face.kind != Face::Kind::arc) return std::fabs(dot(v, face.normal));
    return std::fabs(dot(v, p - face.at)) / norm(p - face.at);
}

/// Segments and arcs that a point touches now, and its side of each, from the record that has led
/// there; the segment `sure` is the first of them, at any distance.
std::vector<Side> SceneLoop::sides_of(std::uint32_t i, std::uint32_t sure) const
{
    std::vector<Side> sides;
    const Body& body = world_.bodies[i];
    if (body.radius > 0 || !on_terrain_) return sides;
    const Vector2 p = world_.position(i, now_);
    const Vector2 v = world_.velocity(i, now_);
    const double flown = rounding_of_flight(body, seconds(body.t, now_));
    for (const std::uint32_t f : faces_of(i)) {
        const Face& face = world_.faces[f];
        if (!has_two_sides(face.kind)) continue;
        const bool above = world_.arrives_above(body, f, p, v);
        if (f != sure) {
            const double gap = face_gap(face, body, p, above, flown).gap;
            const double tolerance = World::rounding(p, 0) + World::blur(face, 0) + flown +
                                     2 * resolution(now_) * closing_speed(face, p, v);
            // Four times, since the point is moved onto the line of another segment before it goes
            // on.
            if (std::fabs(gap) > 4 * tolerance) continue;
        }
        sides.push_back({f, above});
        if (f == sure) std::swap(sides.front(), sides.back());
    }
    world_.make_one(sides);
    return sides;
}

/// [rad] Rounding of the normal at the end of a segment, or at an arc.
[[gnu::noinline]] static double blur_of_normal(const Face& face, double radius, const Vector2& p)
{
    if (face.kind == Face::Kind::arc) {
        return World::rounding(p, face.length) / norm(p - face.at);
    }
    return radius > 0 ? World::rounding(p, radius) / radius : 0;
}

/// Adds a contact of a body of the cluster, at p, with a face.
[[gnu::always_inline]] inline void SceneLoop::touch_face(std::uint32_t slot, const Vector2& p,
                                                         std::uint32_t f, const Vector2& normal)
{
    const std::uint32_t i = cluster_.bodies[slot];
    const Body& body = world_.bodies[i];
    Contact contact{.a = i, .b = f, .surface = true, .slot_a = slot};
    contact.normal = normal;
    contact.at = p - body.radius * normal;
    if (is_round(world_.faces[f].kind)) {
        contact.blur = blur_of_normal(world_.faces[f], body.radius, p);
    }
    contact.restitution = world_.restitution(body.material, world_.faces[f].material);
    contact.friction = world_.friction(body.material, world_.faces[f].material);
    if (!world_.plain_laws) set_laws(contact, body.material, world_.faces[f].material);
    cluster_.contacts.push_back(contact);
}

/// Gathers contacts of a body of the cluster with faces; `sure` counts as touched at any gap.
void SceneLoop::gather_faces(std::uint32_t slot, std::uint32_t sure)
{
    const std::uint32_t i = cluster_.bodies[slot];
    const Body& body = world_.bodies[i];
    const Vector2 p = world_.position(i, now_);
    const Vector2 v = cluster_.before[slot];
    if (body.mapped) return cluster_.sides.emplace_back(), void();  // has its own guards
    const double near = body.radius + 1e-6 * (body.radius + norm(p));
    const auto look = [&](std::uint32_t f) {
        const Face& face = world_.faces[f];
        if (face.kind == Face::Kind::wall && f != sure && dot(p - face.at, face.normal) > near) {
            return;
        }
        const bool above = has_two_sides(face.kind) && world_.arrives_above(body, f, p, v);
        const FaceGap at = face_gap(face, body, p, above);
        double tolerance = World::rounding(p, body.radius) + World::blur(face, body.radius) +
                           2 * resolution(now_) * std::fabs(dot(v, at.normal));
        if (known_to_group(i, true, f)) tolerance += loose * (body.radius + norm(p));
        if (f != sure && !(at.gap <= tolerance && at.gap >= -1e3 * tolerance)) return;
        touch_face(slot, p, f, at.normal);
    };
    if (!is_away_from_walls(i)) {
        for (std::uint32_t f = 0; f < world_.wall_count; ++f) look(f);
    }
    cluster_.sides.push_back(sides_of(i, sure));
    const double flown = rounding_of_flight(body, seconds(body.t, now_));
    for (const Side& side : cluster_.sides.back()) {
        const Face& face = world_.faces[side.face];
        const bool arc = face.kind == Face::Kind::arc;
        if (!arc && side.face != sure &&
            world_.passes_end(body, side.face, side.above, p, v, flown)) {
            continue;
        }
        touch_face(slot, p, side.face,
                   arc          ? face_gap(face, body, p, side.above, flown).normal
                   : side.above ? face.normal
                                : -1.0 * face.normal);
    }
    if (body.radius > 0 && on_terrain_) {
        for (const std::uint32_t f : faces_of(i)) look(f);
    }
    if (!world_.motions.empty()) gather_moving(slot, sure);
}

/// Gathers contacts of a body of the cluster with faces that move.
void SceneLoop::gather_moving(std::uint32_t slot, std::uint32_t sure)
{
    const std::uint32_t i = cluster_.bodies[slot];
    const Body& body = world_.bodies[i];
    const Vector2 p = world_.position(i, now_);
    const Vector2 v = cluster_.before[slot];
    const auto count = static_cast<std::uint32_t>(world_.faces.size());
    for (std::uint32_t f = world_.fixed_count; f < count; ++f) {
        const FaceGap at = world_.moving_gap(f, body.radius, p, now_);
        const Vector2 w = world_.surface_velocity(f, now_);
        const double rounding =
            World::rounding(p, body.radius) + World::rounding(world_.faces[f].at, 0);
        double tolerance = rounding + 2 * resolution(now_) * std::fabs(dot(v - w, at.normal));
        if (known_to_group(i, true, f)) tolerance += loose_motion(f, body.radius + norm(p));
        if (f != sure && !(at.gap <= tolerance && at.gap >= -1e3 * tolerance)) continue;
        // Where two segments meet, both have the corner, each by a rounding of its own.
        const Vector2 foot = p - body.radius * at.normal;
        const bool again = std::ranges::any_of(cluster_.contacts, [&](const Contact& c) {
            return c.a == i && c.moving && norm(c.at - foot) <= rounding &&
                   world_.faces[c.b].surface == world_.faces[f].surface;
        });
        if (again) continue;
        touch_face(slot, p, f, at.normal);
        cluster_.contacts.back().moving = true;
        cluster_.contacts.back().surface_velocity = w;
    }
}

/// [m] Gap left by a group in lasting contact: in one of its steps, surfaces move on straight
/// lines.
double SceneLoop::loose_motion(std::uint32_t face, double size) const
{
    const double h = world_.options.contact_step;
    return loose * size + 0.125 * world_.moving(face).bounds.acceleration * h * h;
}

/// Notes laws of a contact that are not constants.
void SceneLoop::set_laws(Contact& contact, std::uint32_t a, std::uint32_t b) const
{
    contact.by_speed = world_.depends_on_speed(a, b);
    if (!contact.surface) return;
    contact.thermal = world_.scene.surfaces()[world_.faces[contact.b].surface].temperature > 0;
}

void SceneLoop::gather_pairs(std::uint32_t slot, std::uint32_t sure)
{
    const std::uint32_t i = cluster_.bodies[slot];
    const Body& a = world_.bodies[i];
    const Vector2 p = world_.position(i, now_);
    const double slack = 1e-9 * (a.radius + std::fabs(p[0]) + std::fabs(p[1]));
    const bool periodic = world_.periodic;
    grid_.each_near(world_.bodies, i, pending_[i].cell, [&](std::uint32_t j) {
        if (j == i) return;
        const Body& b = world_.bodies[j];
        if (j != sure && !b.quartic) {
            Vector2 near = p - place(b, seconds(b.t, now_));
            if (periodic) near = near - world_.image_shift(near);
            const double limit = a.radius + b.radius + slack;
            if (dot(near, near) > limit * limit) return;
        }
        try_pair(slot, j, j == sure);
    });
}

void SceneLoop::try_pair(std::uint32_t slot, std::uint32_t j, bool sure)
{
    if (slots_[j] != none && slots_[j] < slot) return;  // gathered from there
    const std::uint32_t i = cluster_.bodies[slot];
    const Body& a = world_.bodies[i];
    const Body& b = world_.bodies[j];
    const double reach = a.radius + b.radius;
    if (reach == 0 || (a.mapped && b.mapped && a.island == b.island)) return;
    if (!sure && (a.quartic || b.quartic)) {
        // The polynomials are tested first: the maps are expensive.
        const Vector2 near = world_.path(i, now_).c[0] - world_.path(j, now_).c[0];
        if (norm(near) > 1.001 * reach) return;
    }
    const Vector2 pa = world_.position(i, now_);
    const Vector2 pb = world_.position(j, now_);
    Vector2 apart = pa - pb;
    if (world_.periodic) apart = apart - world_.image_shift(apart);
    const double distance = norm(apart);
    const Vector2 normal{apart[0] / distance, apart[1] / distance};
    const Vector2 va = cluster_.before[slot];
    const Vector2 vb = world_.velocity(j, now_);
    double tolerance = World::rounding(pa, reach) + World::rounding(pb, reach) +
                       2 * resolution(now_) * std::fabs(dot(va - vb, normal));
    if (known_to_group(i, false, j)) tolerance += loose * (reach + norm(pa));
    if (!sure && !(distance - reach <= tolerance)) return;
    Contact contact{.a = i, .b = j, .surface = false, .slot_a = slot};
    contact.slot_b = slot_of(j);
    contact.normal = normal;
    contact.at = world_.periodic ? world_.between_images(pa, pb) : 0.5 * (pa + pb);
    contact.blur = (World::rounding(pa, reach) + World::rounding(pb, reach)) / reach;
    contact.restitution = world_.restitution(a.material, b.material);
    contact.friction = world_.friction(a.material, b.material);
    if (!world_.plain_laws) set_laws(contact, a.material, b.material);
    cluster_.contacts.push_back(contact);
}

/// Whether impacts of a body follow each other more closely than the time resolves or, where groups
/// in lasting contact can take over, than its place resolves.
bool SceneLoop::collapses(std::uint32_t slot)
{
    const std::uint32_t i = cluster_.bodies[slot];
    Series& series = series_[i];
    if (series.count++ == 0) series.since = now_;
    if (series.count <= crowded) return false;
    series.count = 0;
    const double s = seconds(series.since, now_);
    if (s <= crowded * resolution(now_)) return true;
    if (!contacts_.available()) return false;
    double fastest = 0;
    bool meets_body = false;
    for (const Contact& contact : cluster_.contacts) {
        if (contact.a != i && (contact.surface || contact.b != i)) continue;
        meets_body = meets_body || !contact.surface;
        const Vector2 v = relative_velocity(cluster_.before, contact);
        fastest = std::max(fastest, std::fabs(dot(v, contact.normal)));
    }
    return meets_body &&
           s * fastest <= World::rounding(world_.position(i, now_), world_.bodies[i].radius);
}

/// Whether an elastic body with friction hops on surfaces, again and again, without enough energy
/// to rise above the rounding of its place. Friction leads into such hops, for instance between the
/// two sides of a corner, both of which the body strikes at a right angle; there it dissipates no
/// more energy.
bool SceneLoop::hops_below_rounding(std::uint32_t slot)
{
    const std::uint32_t i = cluster_.bodies[slot];
    const Body& body = world_.bodies[i];
    Series& series = series_[i];
    const bool may_last = std::ranges::any_of(cluster_.contacts, [&](const Contact& c) {
        return c.a == i && c.surface && !c.moving && c.friction > 0 && c.restitution == 1;
    });
    const double height = low * World::rounding(world_.position(i, now_), body.radius);
    const Vector2& v = cluster_.before[slot];
    if (!may_last || !(dot(v, v) <= 2 * norm(world_.gravity) * height)) {
        series.low = 0;
        return false;
    }
    if (++series.low < most_low) return false;
    series.low = 0;
    return true;
}

/// Takes systems of the cluster through their own events of this instant, before an impact: a push
/// starts a new search for events, which finds later ones only. Returns whether there were any.
bool SceneLoop::let_events_happen()
{
    bool any = false;
    for (const std::uint32_t i : cluster_.bodies) {
        const Body& body = world_.bodies[i];
        if (!body.mapped || !world_.islands->is_cut_at(body.island, now_)) continue;
        const Instant& end = world_.islands->end(body.island);
        if (before(now_, end)) now_ = end;
        step_island(body.island);
        any = true;
    }
    return any;
}

void SceneLoop::impact(std::uint32_t i)
{
    if (strikes_alone(i)) return;
    gather(i, pending_[i]);
    if (let_events_happen()) return predict(i);
    resolve_cluster(i);
}

/// Resolves the impacts of the cluster that was gathered around i.
void SceneLoop::resolve_cluster(std::uint32_t i)
{
    const double within = world_.options.elastic_within;
    if (within > 0) {
        for (Contact& contact : cluster_.contacts) {
            const auto recent = [&](std::uint32_t body) {
                return series_[body].last.value > -never &&
                       seconds(series_[body].last, now_) < within;
            };
            if (recent(contact.a) || (!contact.surface && recent(contact.b))) {
                contact.restitution = 1;
                contact.by_speed = false;
            }
        }
    }
    // A body whose flight back and forth would be shorter than a step of the group that it meets
    // joins that group.
    const double slow = 0.5 * norm(world_.gravity) * world_.options.contact_step;
    const double most = meets_crowd(cluster_.bodies) ? never : slow;
    if (const auto bodies = joining(0, most); !bodies.empty()) return hand_over(bodies, "");
    bool spend = false;
    if (within == 0) {
        for (std::uint32_t slot = 0; slot < cluster_.bodies.size(); ++slot) {
            spend = collapses(slot) || spend;
            spend = hops_below_rounding(slot) || spend;
        }
    }
    std::vector<SceneEvent>* events = world_.options.record_events ? &result_.events : nullptr;
    const std::size_t known = result_.events.size();
    const std::uint64_t struck = world_.statistics.impacts;
    cluster_.lasting = std::ranges::any_of(
        cluster_.bodies, [&](std::uint32_t body) { return world_.bodies[body].contact != none; });
    const bool left = impacts_.resolve(cluster_, now_.value, spend, events);
    for (std::size_t k = known; k < result_.events.size(); ++k) {
        result_.events[k].number = result_.event_count;
    }
    apply(world_.statistics.impacts > struck);
    // Bodies whose restitution was set to 0 stay together: otherwise only the rounding of their
    // velocities separates them, and they would meet again and again.
    const bool together =
        spend && contacts_.available() &&
        std::ranges::any_of(cluster_.contacts, [](const Contact& c) { return !c.surface; });
    if ((left || together) && !result_.failure) {
        world_.statistics.collapses += left;
        return hand_over(std::vector(cluster_.bodies), "");
    }
    if (changed_.empty()) {
        ++world_.statistics.stale;
        if (const auto bodies = joining(-never, never); !bodies.empty()) {
            return hand_over(bodies, "");
        }
        if (++unmoved_ > (contacts_.available() ? unmoved_to_join : most_unmoved)) {
            unmoved_ = 0;
            return hand_over(std::vector(cluster_.bodies),
                             fmt::format("impacts of {} repeat without effect", called(i)));
        }
        return predict(i);
    }
    unmoved_ = 0;
}

/// Starts a flight of a body in closed form. Returns the face that held it before.
std::uint32_t SceneLoop::begin_record(std::uint32_t i, const Vector2& velocity,
                                      const std::vector<Side>& sides)
{
    Body& body = world_.bodies[i];
    const double s = seconds(body.t, now_);
    const double flown = rounding_of_flight(body, s);
    body.p = place(body, s);
    // A velocity whose square underflows is set to 0: in a corner it would be halved forever.
    body.v = norm(velocity) < 1e-150 ? Vector2{} : velocity;
    body.a = world_.fall(i);
    body.t = now_;
    ++body.version;
    body.asleep = false;
    if (world_.turning(i)) world_.set_spin(i, now_, world_.spin(i, now_));
    if (body.radius == 0) world_.remember(body, sides, flown);
    return std::exchange(body.held, none);
}

/// Lets discs turn with the spins that impacts have given them; `restart_group` does it in groups.
void SceneLoop::set_spins()
{
    for (std::size_t k = 0; k < cluster_.turning.size(); ++k) {
        const std::uint32_t i = cluster_.bodies[k];
        const bool own = world_.bodies[i].contact == none;
        if (own && cluster_.turned(k)) world_.set_spin(i, now_, cluster_.turning[k].spin);
    }
}

/// Writes new records of bodies whose velocity has changed, and predicts their meetings. Counts the
/// event if there were impacts, before groups and bounces add events of their own.
void SceneLoop::apply(bool struck)
{
    changed_.clear();
    std::vector<std::uint32_t>& islands = slots_of_islands_;
    islands.clear();
    groups_struck_.clear();
    set_spins();
    for (std::size_t k = 0; k < cluster_.bodies.size(); ++k) {
        const std::uint32_t i = cluster_.bodies[k];
        const bool turned = world_.bodies[i].contact != none && cluster_.turned(k);
        if (cluster_.after[k] == cluster_.before[k] && !turned) continue;
        changed_.push_back(i);
        Body& body = world_.bodies[i];
        series_[i].last = now_;
        if (body.radius == 0 && body.island != none) {
            if (body.contact == none) body.p = world_.position(i, now_);
            world_.remember(body, cluster_.sides[k],
                            rounding_of_flight(body, seconds(body.t, now_)));
        }
        if (!is_finite(cluster_.after[k])) {
            return fail(Outcome::non_finite, {i},
                        fmt::format("the velocity of {} is not finite", called(i)));
        }
        if (body.contact != none) {
            if (std::ranges::find(groups_struck_, body.contact) == groups_struck_.end()) {
                groups_struck_.push_back(body.contact);
            }
            continue;
        }
        if (body.island != none) {
            if (std::ranges::find(islands, body.island) == islands.end()) {
                islands.push_back(body.island);
            }
            continue;
        }
        const std::uint32_t held = begin_record(i, cluster_.after[k], cluster_.sides[k]);
        if (world_.plate(i)) continue;
        const bool on_surface = std::ranges::any_of(
            cluster_.contacts, [&](const Contact& c) { return c.a == i && c.surface; });
        if (on_surface) settle(i, held);
    }
    if (!world_.plates.empty()) touch_sides();
    result_.event_count += struck;
    for (const std::uint32_t island : islands) restart_island(island);
    for (const std::uint32_t group : groups_struck_) restart_group(group);
    for (const std::uint32_t group : groups_struck_) {
        if (!contacts_.exists(group) || result_.failure) continue;
        if (contacts_.crowds(group, now_)) crowd(group);
    }
    if (result_.failure) return;
    for (const std::uint32_t i : changed_) {
        if (world_.bodies[i].island != none || world_.bodies[i].contact != none) continue;
        bounce(i);
        predict(i);
    }
    for (const std::uint32_t island : islands) {
        for (const std::uint32_t i : world_.islands->members(island)) predict(i);
    }
}

/// Continues a system from the state to which its discs have been pushed.
bool SceneLoop::push_system(std::uint32_t island)
{
    velocities_.clear();
    for (std::size_t k = 0; k < cluster_.bodies.size(); ++k) {
        const std::uint32_t i = cluster_.bodies[k];
        if (world_.bodies[i].island == island) velocities_.emplace_back(i, cluster_.impulses[k]);
    }
    if (!world_.islands->push(island, now_, velocities_)) return false;
    for (std::size_t k = 0; k < cluster_.bodies.size(); ++k) {
        const std::uint32_t i = cluster_.bodies[k];
        if (world_.bodies[i].island != island) continue;
        const Vector2 expected = cluster_.after[k];
        const Vector2 found = world_.bodies[i].v;
        const double size = norm(expected) + norm(found) + norm(cluster_.before[k]);
        const bool same_time =
            !before(world_.bodies[i].t, now_) && !before(now_, world_.bodies[i].t);
        if (!same_time || norm(found - expected) <= 1e-6 * size) continue;
        throw std::invalid_argument(fmt::format(
            "simulate: push of {} gives it the velocity ({}, {}), and unit impulses have told "
            "({}, {}); expected a push that is linear in the impulse",
            called(i), found[0], found[1], expected[0], expected[1]));
    }
    return true;
}

void SceneLoop::restart_island(std::uint32_t island)
{
    if (world_.islands->is_system(island)) {
        if (!push_system(island)) return fail_island(island);
        return schedule(island);
    }
    velocities_.clear();
    for (std::size_t k = 0; k < cluster_.bodies.size(); ++k) {
        const std::uint32_t i = cluster_.bodies[k];
        const Body& body = world_.bodies[i];
        if (body.island == island && body.contact == none &&
            cluster_.after[k] != cluster_.before[k]) {
            velocities_.emplace_back(i, cluster_.after[k]);
        }
    }
    continue_island(island);
}

/// Continues an island from the present time with the changed `velocities_`.
void SceneLoop::continue_island(std::uint32_t island)
{
    Islands& islands = *world_.islands;
    const bool taken = islands.restart(island, now_, velocities_);
    if (!taken) {
        return fail(Outcome::step_underflow, islands.members(island),
                    fmt::format("the step of the island of {} fell below what the time resolves",
                                called(islands.members(island)[0])));
    }
    schedule(island);
}

}  // namespace ricochet::detail
