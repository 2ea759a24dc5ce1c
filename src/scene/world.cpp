#include "scene/world.hpp"

#include <algorithm>
#include <memory>
#include <set>
#include <tuple>

#include "scene/islands.hpp"
#include "scene/large_pages.hpp"
#include "scene/materials.hpp"
#include "scene/moving.hpp"

namespace ricochet::detail {

namespace {

void add_faces(const Scene::Surface& surface, std::uint32_t index, std::vector<Face>& faces)
{
    if (surface.is_wall) {
        faces.push_back({.kind = Face::Kind::wall,
                         .at = surface.points[0],
                         .normal = surface.normal,
                         .surface = index,
                         .material = surface.material.index});
        return;
    }
    const auto& points = surface.points;
    const bool closed = points.front() == points.back();
    const auto first = static_cast<std::uint32_t>(faces.size());
    const auto count = static_cast<std::uint32_t>(points.size() - 1);
    const auto segment = [&](std::uint32_t k) { return first + 2 * (k % count); };
    for (std::size_t k = 0; k < points.size(); ++k) {
        if (k + 1 < points.size()) {
            const Vector2 along = points[k + 1] - points[k];
            const double length = norm(along);
            faces.push_back({.kind = Face::Kind::segment,
                             .at = points[k],
                             .normal = turned((1 / length) * along),
                             .length = length,
                             .surface = index,
                             .material = surface.material.index});
            const auto at = static_cast<std::uint32_t>(k);
            if (k > 0 || closed) faces.back().previous = segment(at + count - 1);
            if (k + 1 < count || closed) faces.back().next = segment(at + 1);
        }
        if (k + 1 < points.size() || !closed) {
            faces.push_back({.kind = Face::Kind::vertex,
                             .at = points[k],
                             .surface = index,
                             .material = surface.material.index});
        }
    }
}

}  // namespace

World::World(const Scene& from, const SceneOptions& with)
    : scene(from), options(with), gravity(from.settings().gravity), period(from.settings().period)
{
    periodic = !is_zero(period);
    const Instant start{with.t_start, 0};
    reserve_large(bodies, from.bodies().size());
    for (const Disc& disc : from.bodies()) {
        Body body;
        body.p = disc.at;
        body.v = disc.velocity;
        body.a = gravity;
        body.t = start;
        body.radius = disc.radius;
        body.inverse_mass = 1 / disc.mass;
        body.material = disc.material.index;
        bodies.push_back(body);
        any_drag = any_drag || disc.drag > 0;
    }
    const auto turns_itself = [](const Disc& disc) { return disc.inertia > 0; };
    if (std::ranges::any_of(from.bodies(), turns_itself)) {
        for (const Disc& disc : from.bodies()) {
            const double inverse = disc.inertia > 0 ? 1 / disc.inertia : 0;
            turns.push_back({start, disc.angle, disc.spin, 0, inverse, {}});
        }
    }
    for (const bool walls : {true, false}) {
        std::uint32_t index = 0;
        for (const Scene::Surface& surface : from.surfaces()) {
            const bool fixed = !detail::moves(surface.motion);
            if (fixed && surface.is_wall == walls && !surface.is_arc()) {
                add_faces(surface, index, faces);
            }
            ++index;
        }
        if (walls) wall_count = static_cast<std::uint32_t>(faces.size());
    }
    add_plates();
    join_chains(from, wall_count, faces);
    blur_segments();
    add_arcs();
    if (periodic) add_images();
    fixed_count = static_cast<std::uint32_t>(faces.size());
    add_moving_faces();
    find_laws();
    islands = std::make_unique<Islands>(*this);
    if (islands->count() > 0) bends.resize(bodies.size());
    put_to_sleep();
}

World::~World() = default;

void World::add_plates()
{
    if (scene.plates().empty()) return;
    plate_numbers.assign(bodies.size(), none);
    for (const Scene::PlateShape& shape : scene.plates()) {
        const double length = norm(shape.half);
        const double square = dot(shape.along, shape.along);  // 1 to rounding
        Body& body = bodies[shape.body];
        Plate plate{.body = shape.body, .along = shape.along, .length = length};
        plate.normal = turned((1 / length) * shape.half);
        plate.pull = (dot(gravity, shape.along) / square) * shape.along;
        plate.mobility = body.inverse_mass / square;
        plate.sides.assign(bodies.size(), 0);
        body.a = plate.pull;
        plate_numbers[shape.body] = static_cast<std::uint32_t>(plates.size());
        plates.push_back(std::move(plate));
    }
}

void World::find_laws()
{
    const auto by_speed = [](const auto& law) { return detail::depends_on_speed(law.by_speed); };
    plain_laws = std::ranges::none_of(scene.materials(), by_speed) &&
                 std::ranges::none_of(scene.pairs(), by_speed);
    any_thermal = std::ranges::any_of(
        scene.surfaces(), [](const Scene::Surface& surface) { return surface.temperature > 0; });
    plain_laws = plain_laws && !any_thermal;
    any_pairs = !scene.pairs().empty();
    any_turning = !turns.empty();
    ordinary = plain_laws && !periodic && !any_turning && plates.empty();
}

double World::restitution(std::uint32_t a, std::uint32_t b, double speed) const
{
    if (const MaterialPair* pair = scene.pair_of(a, b)) {
        return restitution_at(pair->by_speed, pair->restitution, speed);
    }
    const auto of = [&](std::uint32_t material) {
        const Material& one = scene.materials()[material];
        return restitution_at(one.by_speed, one.restitution, speed);
    };
    return std::min(of(a), of(b));
}

bool World::depends_on_speed(std::uint32_t a, std::uint32_t b) const noexcept
{
    if (const MaterialPair* pair = scene.pair_of(a, b)) {
        return detail::depends_on_speed(pair->by_speed);
    }
    return detail::depends_on_speed(scene.materials()[a].by_speed) ||
           detail::depends_on_speed(scene.materials()[b].by_speed);
}

void World::blur_segments()
{
    const auto own = [](const Face& face) {
        const Vector2 end = face.at - face.length * turned(face.normal);
        return std::max(rounding(face.at, 0), rounding(end, 0));
    };
    for (Face& face : faces) {
        if (face.kind != Face::Kind::segment) continue;
        face.blur = own(face);
        for (const std::uint32_t other : {face.previous, face.next}) {
            if (other != none) face.blur = std::max(face.blur, own(faces[other]));
        }
    }
}

/// Adds arcs after the segments, with their ends where terrain or another arc does not end there.
void World::add_arcs()
{
    const auto is_arc = [](const Scene::Surface& surface) { return surface.is_arc(); };
    if (std::ranges::none_of(scene.surfaces(), is_arc)) return;
    std::set<Vector2> corners;
    for (const Face& face : faces) {
        if (face.kind == Face::Kind::vertex) corners.insert(face.at);
    }
    std::uint32_t index = 0;
    for (const Scene::Surface& surface : scene.surfaces()) {
        const std::uint32_t own = index++;
        if (!surface.is_arc()) continue;
        const Vector2& start = surface.points.front();
        const Vector2& end = surface.points.back();
        faces.push_back({.kind = Face::Kind::arc,
                         .at = surface.centre,
                         .length = surface.radius,
                         .surface = own,
                         .material = surface.material.index,
                         .span = ArcSpan::between(surface.centre, start, end)});
        if (start == end) continue;
        for (const Vector2& corner : {start, end}) {
            if (!corners.insert(corner).second) continue;
            faces.push_back({.kind = Face::Kind::vertex,
                             .at = corner,
                             .surface = own,
                             .material = surface.material.index});
        }
    }
}

Square box_of(const Face& face) noexcept
{
    if (face.kind == Face::Kind::arc) {
        const Vector2 reach{face.length, face.length};
        return {face.at - reach, face.at + reach};
    }
    const Vector2 end = face.at - face.length * turned(face.normal);
    Square box;
    for (std::size_t c = 0; c < 2; ++c) {
        std::tie(box.low[c], box.high[c]) = std::minmax(face.at[c], end[c]);
    }
    return box;
}

/// Whether a body of radius `reach` with its centre in the cell that repeats can touch a box.
static bool reaches_cell(const Square& box, const Vector2& period, double reach)
{
    for (std::size_t c = 0; c < 2; ++c) {
        if (period[c] == 0) continue;
        const double most = reach + 1e-9 * period[c];
        if (box.high[c] < -most || box.low[c] > period[c] + most) return false;
    }
    return true;
}

/// Adds the images of terrain in the neighbouring cells that a body in the cell can touch.
void World::add_images()
{
    windings.resize(bodies.size());
    double reach = 0;
    for (const Body& body : bodies) reach = std::max(reach, body.radius);
    reach *= 1.001;
    const auto count = static_cast<std::uint32_t>(faces.size());
    const std::array<int, 3> steps{-1, 0, 1};
    for (const int x : steps) {
        for (const int y : steps) {
            if ((x == 0 && y == 0) || (x != 0 && period[0] == 0) || (y != 0 && period[1] == 0)) {
                continue;
            }
            const Vector2 shift{x * period[0], y * period[1]};
            std::vector<std::uint32_t> image(count, none);
            for (std::uint32_t f = wall_count; f < count; ++f) {
                Face face = faces[f];
                face.at = face.at + shift;
                if (!reaches_cell(box_of(face), period, reach)) continue;
                image[f] = static_cast<std::uint32_t>(faces.size());
                faces.push_back(face);
            }
            for (std::uint32_t f = wall_count; f < count; ++f) {
                if (image[f] == none) continue;
                Face& face = faces[image[f]];
                if (face.previous != none) face.previous = image[face.previous];
                if (face.next != none) face.next = image[face.next];
            }
        }
    }
}

Vector2 nearest_on(const Face& face, const Vector2& p) noexcept
{
    if (face.kind == Face::Kind::arc) return nearest_on_arc(face.at, face.length, face.span, p);
    return nearest_on(face.at, face.at - face.length * turned(face.normal), p);
}

/// Adds segments with their ends, which need no faces of their own where no point meets them.
void World::add_moving_faces()
{
    std::uint32_t index = 0;
    for (const Scene::Surface& surface : scene.surfaces()) {
        const std::size_t first = faces.size();
        if (detail::moves(surface.motion)) add_faces(surface, index, faces);
        ++index;
        const auto from = faces.begin() + static_cast<std::ptrdiff_t>(first);
        faces.erase(
            std::remove_if(from, faces.end(),
                           [](const Face& face) { return face.kind == Face::Kind::vertex; }),
            faces.end());
        for (std::size_t f = first; f < faces.size(); ++f) {
            faces[f].previous = faces[f].next = none;
            motions.push_back({.motion = &surface.motion,
                               .bounds = bounds_of(surface.motion),
                               .given = std::holds_alternative<GivenMotion>(surface.motion)});
        }
    }
}

Vector2 World::surface_velocity(std::uint32_t face, const Instant& t) const
{
    return moves(face) ? ricochet::velocity(*moving(face).motion, t.plus(0)) : Vector2{};
}

FaceGap World::moving_gap(std::uint32_t face, double radius, const Vector2& p,
                          const Instant& t) const
{
    const Vector2 moved = displacement(*moving(face).motion, t.plus(0));
    return displaced_gap(faces[face], moved, radius, p);
}

Vector2 World::push_of(const Body& body, std::uint32_t face) const
{
    const Face& on = faces[face];
    if (on.kind == Face::Kind::wall) return on.normal;
    return begins_above(body, face) ? on.normal : -1.0 * on.normal;
}

bool World::leads_off(const Face& face, const Vector2& p, const Vector2& heading) const
{
    if (face.kind != Face::Kind::segment) return false;
    const Vector2 along = -1.0 * turned(face.normal);
    const double place_on = dot(p - face.at, along);
    const double slack = 0.5 * rounding(p, 0);  // so near, it touches the adjacent segment too
    const double ahead = dot(heading, along);
    return ahead > 0 ? place_on >= face.length - slack : ahead < 0 && place_on <= slack;
}

/// Makes a body on a face move along it: pulled by gravity, slowed by friction.
void World::slide(std::uint32_t i, std::uint32_t face)
{
    Body& body = bodies[i];
    const Vector2 n = push_of(body, face);
    const Vector2 along = turned(n);
    const double pull = dot(gravity, along);
    const double grip = friction(body.material, faces[face].material) * -dot(gravity, n);
    if (turning(i) && grip > 0) return roll(i, face);
    const double speed = dot(body.v, along);
    const double rounding = 4 * epsilon * norm(gravity);
    body.held = face;
    body.v = speed * along;
    if (speed == 0 && std::fabs(pull) <= std::max(grip, rounding)) {
        body.a = body.v = {};
        body.asleep = true;
        return;
    }
    body.asleep = false;
    const double against = speed != 0 ? speed : pull;
    double rate = std::fabs(pull) <= rounding ? 0 : pull;
    if (grip > 0) rate -= std::copysign(grip, against);
    body.a = rate * along;
}

double World::slip_on(std::uint32_t i, std::uint32_t face) const
{
    const Body& body = bodies[i];
    return dot(body.v, turned(push_of(body, face))) - body.radius * spin(i, body.t);
}

/// Friction turns a disc while it slips: a + r^2 m f / I is the rate of the slip, with the friction
/// f for each kg. Once it does not slip, it rolls with the friction that keeps it so, if it is no
/// more than Coulomb's.
void World::roll(std::uint32_t i, std::uint32_t face)
{
    Body& body = bodies[i];
    const Vector2 n = push_of(body, face);
    const Vector2 along = turned(n);
    const double pull = dot(gravity, along);
    const double grip = friction(body.material, faces[face].material) * -dot(gravity, n);
    const double speed = dot(body.v, along);
    const double mass = 1 / body.inverse_mass;
    const double lever = body.radius * mass * turns[i].inverse_inertia;
    const double ratio = 1 + body.radius * lever;  // of the rates of slip and velocity
    const double rounding = 4 * epsilon * norm(gravity);
    double slip = slip_on(i, face);
    if (std::fabs(slip) <= 8 * epsilon * (std::fabs(speed) + std::fabs(speed - slip))) slip = 0;
    body.held = face;
    body.v = speed * along;
    double force = -std::copysign(grip, slip != 0 ? slip : pull);
    if (slip == 0 && std::fabs(pull) <= grip * ratio) force = -pull / ratio;
    const double rate = std::fabs(pull) <= rounding && slip == 0 ? 0 : pull + force;
    const double spin = slip == 0 ? speed / body.radius : this->spin(i, body.t);
    set_spin(i, body.t, spin, rate == 0 ? 0 : -lever * force);
    body.asleep = speed == 0 && rate == 0;
    body.a = rate * along;
}

/// Puts bodies to sleep that do not move and are not pulled, or lie on a wall that holds them.
void World::put_to_sleep()
{
    for (std::uint32_t i = 0; i < bodies.size(); ++i) {
        Body& body = bodies[i];
        if (body.island != none || !is_zero(body.v) || plate(i)) continue;
        if (is_zero(gravity)) body.asleep = true;
        for (std::uint32_t f = 0; f < wall_count && !body.asleep; ++f) {
            const Face& wall = faces[f];
            const double gap = dot(body.p - wall.at, wall.normal) - body.radius;
            if (gap > rounding(body.p, body.radius) + rounding(wall.at, 0)) continue;
            if (!(dot(gravity, wall.normal) < 0)) continue;
            slide(i, f);
            if (body.asleep) break;
            body.held = none;
            body.a = gravity;
            if (turning(i)) set_spin(i, body.t, spin(i, body.t));
        }
    }
}

}  // namespace ricochet::detail
