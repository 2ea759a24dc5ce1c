#include "ricochet/scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/require.hpp"
#include "ricochet/scene/detail/any_scene_system.hpp"
#include "scene/arcs.hpp"
#include "scene/materials.hpp"
#include "scene/motion.hpp"
#include "scene/names.hpp"
#include "scene/options.hpp"
#include "scene/vector2.hpp"

namespace ricochet {

using namespace detail;

namespace {

constexpr std::string_view who = "Scene";
constexpr Refuse refuse{who};

void require_vector(const Vector2& given, std::string_view what)
{
    for (const double component : given) require_finite(who, what, component);
}

/// Requires components whose squares, and their sums, are finite.
void require_moderate(const Vector2& given, std::string_view what)
{
    require_vector(given, what);
    for (const double component : given) {
        require(std::fabs(component) <= 1e150, who, what, "lie in [-1e150, 1e150]", component);
    }
}

/// Overlap of touching bodies that the rounding of their coordinates allows.
double rounding_of(const Vector2& at, double radius)
{
    return 8 * std::numeric_limits<double>::epsilon() *
           (std::fabs(at[0]) + std::fabs(at[1]) + radius);
}

/// Refuses bodies that overlap at the start. `places`: of the bodies, if not as described.
void require_apart(const Scene& scene, const std::vector<Vector2>& places)
{
    const auto& bodies = scene.bodies();
    const auto at = [&](std::uint32_t i) { return places.empty() ? bodies[i].at : places[i]; };
    // Along the axis on which the bodies are spread farther, ordered by the lower edge: a body that
    // begins before another one ends may overlap it.
    Vector2 low = bodies.empty() ? Vector2{} : at(0);
    Vector2 high = low;
    for (std::uint32_t i = 0; i < bodies.size(); ++i) {
        for (std::size_t c = 0; c < 2; ++c) {
            low[c] = std::min(low[c], at(i)[c]);
            high[c] = std::max(high[c], at(i)[c]);
        }
    }
    const std::size_t along = high[1] - low[1] > high[0] - low[0] ? 1 : 0;
    std::vector<std::uint32_t> order(bodies.size());
    for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
    const auto lower = [&](std::uint32_t i) { return at(i)[along] - bodies[i].radius; };
    if (!std::ranges::is_sorted(order, {}, lower)) std::ranges::sort(order, {}, lower);
    std::vector<std::uint32_t> open;
    for (const std::uint32_t i : order) {
        const Disc& a = bodies[i];
        std::erase_if(open,
                      [&](std::uint32_t j) { return at(j)[along] + bodies[j].radius < lower(i); });
        for (const std::uint32_t j : open) {
            const Disc& b = bodies[j];
            const double reach = a.radius + b.radius;
            const double across = at(i)[1 - along] - at(j)[1 - along];
            if (reach == 0 || std::fabs(across) > reach) continue;
            const bool of_systems = !scene.systems().empty() && scene.system_of(i) != nullptr;
            if (of_systems && scene.system_of(i) == scene.system_of(j)) continue;
            const double overlap = reach - norm(at(i) - at(j));
            if (overlap > rounding_of(at(i), a.radius) + rounding_of(at(j), b.radius)) {
                const auto [first, second] = std::minmax(i, j);
                throw Misplaced(fmt::format("Scene: {} and {} overlap by {:.3g} at the start",
                                            scene.name_of(BodyId{first}),
                                            scene.name_of(BodyId{second}), overlap),
                                second);
            }
        }
        open.push_back(i);
    }
}

/// Refuses bodies that overlap with an image of another one across the border of the cell.
void require_apart_across(const Scene& scene, double largest)
{
    const Vector2& period = scene.settings().period;
    const auto bodies = scene.bodies();
    const std::size_t along = period[0] > 0 ? 0 : 1;
    struct Image {
        double at = 0;
        std::uint32_t body = 0;
    };
    std::vector<Image> order;
    for (std::uint32_t i = 0; i < bodies.size(); ++i) {
        const double at = bodies[i].at[along];
        order.push_back({at, i});
        if (at <= 2 * largest) order.push_back({at + period[along], i});
    }
    std::ranges::sort(order, {},
                      [](const Image& image) { return std::pair(image.at, image.body); });
    for (std::size_t k = 0; k < order.size(); ++k) {
        for (std::size_t l = k + 1; l < order.size(); ++l) {
            if (order[l].at - order[k].at > 2 * largest) break;
            const auto [first, second] = std::minmax(order[k].body, order[l].body);
            if (first == second) continue;
            Vector2 apart = bodies[first].at - bodies[second].at;
            for (std::size_t c = 0; c < 2; ++c) {
                if (period[c] > 0) apart[c] -= period[c] * std::nearbyint(apart[c] / period[c]);
            }
            const double reach = bodies[first].radius + bodies[second].radius;
            const double overlap = reach - norm(apart);
            if (reach == 0 ||
                overlap <= rounding_of(bodies[first].at, bodies[first].radius) +
                               rounding_of(bodies[second].at, bodies[second].radius)) {
                continue;
            }
            throw Misplaced(
                fmt::format("Scene: {} and {} overlap by {:.3g} at the start, across the "
                            "border of the period",
                            scene.name_of(BodyId{first}), scene.name_of(BodyId{second}), overlap),
                second);
        }
    }
}

}  // namespace

Scene::Scene(const Settings& settings) : settings_(settings)
{
    require_vector(settings.gravity, "gravity");
    require_positive(who, "memory_limit", settings.memory_limit);
    for (const double length : settings.period) require_not_negative(who, "period", length);
    materials_.push_back({.name = "", .restitution = 1, .friction = 0});
}

double Scene::memory() const noexcept
{
    double segments = 0;
    for (const Surface& surface : surfaces_) segments += static_cast<double>(surface.points.size());
    return 512.0 * static_cast<double>(bodies_.size()) + 128 * segments +
           256.0 * static_cast<double>(springs_.size());
}

void Scene::require_room(double bodies) const
{
    const double needed = memory() + 512 * bodies;
    if (needed > settings_.memory_limit) {
        refuse(fmt::format("{:g} bodies need about {:.3g} GB, and memory_limit allows {:.3g} GB",
                           static_cast<double>(bodies_.size()) + bodies, needed * 1e-9,
                           settings_.memory_limit * 1e-9));
    }
}

void Scene::take_name(const std::string& name, std::string_view kind)
{
    if (name.empty()) return;
    const auto kind_of = static_cast<std::uint32_t>(bodies_.size());
    if (!names_.emplace(name, kind == "body" ? kind_of : ~0U).second) {
        refuse(fmt::format("the name \"{}\" is given twice", name));
    }
}

void Scene::require_material(MaterialId material, std::string_view of) const
{
    if (material.index >= materials_.size()) {
        refuse(fmt::format("the material of {} is number {}, and there are {}", of, material.index,
                           materials_.size()));
    }
}

MaterialId Scene::material(const Material& material)
{
    const std::string label = fmt::format("material \"{}\": ", material.name);
    check_coefficients(material.restitution, material.friction, material.by_speed, label);
    take_name(material.name, "material");
    materials_.push_back(material);
    return {static_cast<std::uint32_t>(materials_.size() - 1)};
}

/// The same for both orders of two materials.
static std::uint64_t key_of(std::uint32_t a, std::uint32_t b)
{
    const auto [first, second] = std::minmax(a, b);
    return std::uint64_t{first} << 32 | second;
}

void Scene::pair(const MaterialPair& pair)
{
    for (const MaterialId material : pair.between) require_material(material, "a pair");
    const auto [a, b] = std::pair(pair.between[0].index, pair.between[1].index);
    const std::string label =
        fmt::format("pair of \"{}\" and \"{}\": ", materials_[a].name, materials_[b].name);
    check_coefficients(pair.restitution, pair.friction, pair.by_speed, label);
    const auto number = static_cast<std::uint32_t>(pairs_.size());
    if (!pair_numbers_.emplace(key_of(a, b), number).second) refuse(label + "it is given twice");
    pairs_.push_back(pair);
}

const MaterialPair* Scene::pair_of(std::uint32_t a, std::uint32_t b) const noexcept
{
    const auto found = pair_numbers_.find(key_of(a, b));
    return found == pair_numbers_.end() ? nullptr : &pairs_[found->second];
}

/// Requires a place and a velocity with which a body can start.
void Scene::require_motion(const Disc& body, std::string_view label, bool of_system) const
{
    require_moderate(body.at, fmt::format("{}: position", label));
    require_moderate(body.velocity, fmt::format("{}: velocity", label));
    if (of_system) return;
    for (const Surface& surface : surfaces_) {
        if (!moves(surface.motion)) require_outside(body, surface);
    }
}

void Scene::require_turn(const Disc& body, std::string_view label)
{
    require_finite(who, fmt::format("{}: angle", label), body.angle);
    require_finite(who, fmt::format("{}: spin", label), body.spin);
    if (body.inertia == 0 && body.spin != 0) {
        refuse(fmt::format("{}: has a spin of {:g} rad/s and no inertia", label, body.spin));
    }
}

BodyId Scene::add(const Disc& body, std::string_view kind)
{
    const std::string label =
        body.name.empty() ? fmt::format("{} {}", kind, bodies_.size()) : body.name;
    const std::string prefix = label + ": ";
    require_positive(who, prefix + "mass", body.mass);
    require_not_negative(who, prefix + "drag", body.drag);
    require_not_negative(who, prefix + "inertia", body.inertia);
    require_turn(body, label);
    require_material(body.material, label);
    if (static_cast<double>(bodies_.size()) + 1 > std::numeric_limits<std::uint32_t>::max() / 2.0) {
        refuse("there are more bodies than handles");
    }
    require_room(1);
    require_motion(body, label, kind != "body");
    take_name(body.name, "body");
    bodies_.push_back(body);
    return {static_cast<std::uint32_t>(bodies_.size() - 1)};
}

BodyId Scene::disc(const Disc& disc)
{
    require_positive(who, disc.name.empty() ? "radius" : disc.name + ": radius", disc.radius);
    return add(disc, "body");
}

BodyId Scene::point(const Point& point)
{
    return add({.name = point.name,
                .at = point.at,
                .velocity = point.velocity,
                .radius = 0,
                .mass = point.mass,
                .drag = point.drag,
                .material = point.material},
               "body");
}

void Scene::set_gravity(const Vector2& gravity)
{
    require_vector(gravity, "gravity");
    settings_.gravity = gravity;
}

/// The name of a body whose start can be changed.
std::string Scene::require_movable(BodyId body) const
{
    if (body.index >= bodies_.size()) {
        refuse(fmt::format("found the body {}, and there are {}", body.index, bodies_.size()));
    }
    if (system_of(body.index)) refuse(name_of(body) + " starts where its system does");
    return name_of(body);
}

void Scene::set_turn(BodyId body, double angle, double spin)
{
    const std::string label = require_movable(body);
    Disc turned = bodies_[body.index];
    turned.angle = angle;
    turned.spin = spin;
    require_turn(turned, label);
    bodies_[body.index] = turned;
}

void Scene::set_start(BodyId body, const Vector2& at, const Vector2& velocity)
{
    const std::string label = require_movable(body);
    Disc moved = bodies_[body.index];
    if (const PlateShape* const plate = plate_of(body.index)) {
        const Vector2 way{at[0] - moved.at[0], at[1] - moved.at[1]};
        const auto across = [&](const Vector2& v) {
            return std::fabs(plate->along[0] * v[1] - plate->along[1] * v[0]);
        };
        const double size = std::hypot(at[0], at[1]) + std::hypot(moved.at[0], moved.at[1]);
        if (across(way) > 1e-12 * size ||
            across(velocity) > 1e-12 * std::hypot(velocity[0], velocity[1])) {
            refuse(label + " moves along its line; expected a place and a velocity on it");
        }
    }
    moved.at = at;
    moved.velocity = velocity;
    require_motion(moved, label, false);
    bodies_[body.index] = moved;
}

void Scene::set_coefficients(MaterialId material, double restitution, double friction)
{
    require_material(material, "the coefficients");
    Material& of = materials_[material.index];
    check_coefficients(restitution, friction, of.by_speed,
                       fmt::format("material \"{}\": ", of.name));
    of.restitution = restitution;
    of.friction = friction;
}

BodyId Scene::plate(const Plate& plate)
{
    const std::string label =
        plate.name.empty() ? fmt::format("plate {}", bodies_.size()) : plate.name;
    for (const Vector2& end : plate.ends) require_moderate(end, label + ": end");
    require_moderate(plate.along, label + ": direction");
    require_finite(who, label + ": speed", plate.speed);
    const Vector2 half = 0.5 * (plate.ends[1] - plate.ends[0]);
    if (!(norm(half) > 0)) refuse(fmt::format("{} has no length: its ends are equal", label));
    Vector2 along = is_zero(plate.along) ? turned(half) : plate.along;
    along = (1 / std::hypot(along[0], along[1])) * along;
    add({.name = plate.name,
         .at = plate.ends[0] + half,
         .velocity = plate.speed * along,
         .radius = 0,
         .mass = plate.mass,
         .material = plate.material},
        "plate");
    const auto body = static_cast<std::uint32_t>(bodies_.size() - 1);
    plates_.push_back({body, half, along});
    return {body};
}

const Scene::PlateShape* Scene::plate_of(std::uint32_t body) const noexcept
{
    const auto found = std::ranges::lower_bound(plates_, body, {}, &PlateShape::body);
    return found != plates_.end() && found->body == body ? &*found : nullptr;
}

SurfaceId Scene::wall(const Wall& wall)
{
    require_vector(wall.point, "point of a wall");
    require_vector(wall.normal, "normal of a wall");
    const double length = std::hypot(wall.normal[0], wall.normal[1]);  // squares may overflow
    if (!(length > 0) || !std::isfinite(length)) refuse("the normal of a wall has no length");
    require_material(wall.material, "a wall");
    check_motion(wall.motion, wall.name.empty() ? "a wall" : wall.name);
    require_not_negative(who, "temperature of a wall", wall.temperature);
    take_name(wall.name, "surface");
    surfaces_.push_back({.name = wall.name,
                         .is_wall = true,
                         .points = {wall.point},
                         .normal = {wall.normal[0] / length, wall.normal[1] / length},
                         .material = wall.material,
                         .motion = wall.motion,
                         .temperature = wall.temperature});
    return {static_cast<std::uint32_t>(surfaces_.size() - 1)};
}

SurfaceId Scene::terrain(const Terrain& terrain)
{
    if (terrain.points.size() < 2) {
        refuse(fmt::format("terrain needs at least 2 points, got {}", terrain.points.size()));
    }
    for (const Vector2& point : terrain.points) require_vector(point, "point of terrain");
    require_material(terrain.material, "terrain");
    check_motion(terrain.motion, terrain.name.empty() ? "terrain" : terrain.name);
    require_not_negative(who, "temperature of terrain", terrain.temperature);
    std::vector<Vector2> points = terrain.points;
    if (terrain.closed) points.push_back(points.front());
    for (std::size_t i = 1; i < points.size(); ++i) {
        if (points[i] == points[i - 1]) {
            refuse(fmt::format("segment {} of terrain has no length", i - 1));
        }
    }
    take_name(terrain.name, "surface");
    surfaces_.push_back({.name = terrain.name,
                         .is_wall = false,
                         .points = std::move(points),
                         .material = terrain.material,
                         .motion = terrain.motion,
                         .temperature = terrain.temperature});
    return {static_cast<std::uint32_t>(surfaces_.size() - 1)};
}

SurfaceId Scene::arc(const Arc& arc)
{
    const std::string label = arc.name.empty() ? "an arc" : arc.name;
    require_moderate(arc.centre, "centre of " + label);
    require_not_negative(who, "radius of " + label, arc.radius);
    for (const Vector2& end : arc.ends) require_moderate(end, "end of " + label);
    require_material(arc.material, label);
    require_not_negative(who, "temperature of " + label, arc.temperature);
    const bool whole = arc.radius > 0;
    const bool given = arc.ends[0] != arc.ends[1];
    if (whole == given) {
        refuse(fmt::format("{} needs either a radius, or two ends that differ; found {}", label,
                           whole ? "both" : "neither"));
    }
    Surface surface;
    surface.name = arc.name;
    surface.is_wall = false;
    surface.material = arc.material;
    surface.centre = arc.centre;
    surface.temperature = arc.temperature;
    if (whole) {
        const Vector2 start = arc.centre + Vector2{arc.radius, 0};
        surface.points = {start, start};
        surface.radius = arc.radius;
    } else {
        const double first = norm(arc.ends[0] - arc.centre);
        const double second = norm(arc.ends[1] - arc.centre);
        if (!(first > 0) || !(std::fabs(first - second) <= 1e-9 * first)) {
            refuse(
                fmt::format("the ends of {} are {:.17g} and {:.17g} m from its centre; expected "
                            "equal distances",
                            label, first, second));
        }
        surface.points = {arc.ends[0], arc.ends[1]};
        surface.radius = 0.5 * (first + second);
    }
    take_name(arc.name, "surface");
    surfaces_.push_back(std::move(surface));
    return {static_cast<std::uint32_t>(surfaces_.size() - 1)};
}

void Scene::spring(const Spring& spring)
{
    for (const BodyId end : spring.between) {
        if (end.index >= bodies_.size()) {
            refuse(fmt::format("a spring ends at body {}, and there are {}", end.index,
                               bodies_.size()));
        }
        if (system_of(end.index)) {
            refuse(fmt::format("a spring ends at {}, which is part of a system", name_of(end)));
        }
        if (plate_of(end.index)) {
            refuse(fmt::format("a spring ends at {}, which is a plate", name_of(end)));
        }
    }
    if (spring.between[0] == spring.between[1]) {
        refuse(fmt::format("a spring joins {} to itself", name_of(spring.between[0])));
    }
    require_not_negative(who, "rest of a spring", spring.rest);
    require_not_negative(who, "stiffness of a spring", spring.stiffness);
    require_not_negative(who, "damping of a spring", spring.damping);
    springs_.push_back(spring);
}

SystemId Scene::system(const SystemBody& body)
{
    const std::string label =
        body.name.empty() ? fmt::format("system {}", systems_.size()) : body.name;
    if (!body.motion) refuse(fmt::format("{} has no motion; expected system_body(...)", label));
    const auto count = static_cast<std::uint32_t>(body.motion->shape_count());
    const auto first = static_cast<std::uint32_t>(bodies_.size());
    const std::vector<double> x = body.motion->start();
    for (const double component : x) require_finite(who, label + ": state", component);
    try {
        for (std::uint32_t k = 0; k < count; ++k) {
            const double radius = body.motion->radius(k);
            require_positive(who, label + ": shape_radius", radius);
            const SystemDisc disc = body.motion->shape(k, body.motion->start_mode(), 0, x);
            const std::string name = count == 1 ? label : fmt::format("{} {}", label, k);
            add({.name = name,
                 .at = disc.at,
                 .velocity = disc.velocity,
                 .radius = radius,
                 .material = body.material},
                "system");
        }
    } catch (...) {  // a system that is refused leaves no discs behind
        for (; bodies_.size() > first; bodies_.pop_back()) names_.erase(bodies_.back().name);
        throw;
    }
    systems_.push_back({body.motion, first, count});
    return {static_cast<std::uint32_t>(systems_.size() - 1)};
}

const Scene::System* Scene::system_of(std::uint32_t body) const noexcept
{
    for (const System& system : systems_) {
        if (body >= system.first && body - system.first < system.count) return &system;
    }
    return nullptr;
}

std::string Scene::name_of(BodyId body) const
{
    const std::string& name = bodies_[body.index].name;
    return name.empty() ? fmt::format("body {}", body.index) : name;
}

std::string Scene::name_of(SurfaceId surface) const
{
    const std::string& name = surfaces_[surface.index].name;
    return name.empty() ? fmt::format("surface {}", surface.index) : name;
}

BodyId Scene::body(std::string_view name) const
{
    const auto found = names_.find(std::string(name));
    if (found != names_.end() && found->second != ~0U) return {found->second};
    std::vector<std::string_view> known;
    for (const Disc& body : bodies_) {
        if (!body.name.empty()) known.push_back(body.name);
    }
    refuse(fmt::format("there is no body \"{}\"{}", name, nearest_name(name, known)));
}

void Scene::require_outside(const Disc& body, const Surface& surface) const
{
    const std::string label = body.name.empty() ? "a body" : body.name;
    const double slack = rounding_of(body.at, body.radius);
    if (surface.is_wall) {
        const double gap = dot(body.at - surface.points[0], surface.normal) - body.radius;
        if (gap < -slack - rounding_of(surface.points[0], 0)) {
            refuse(fmt::format("{} at ({}, {}) lies behind {} by {:.3g}", label, body.at[0],
                               body.at[1],
                               surface.name.empty() ? "a wall" : "\"" + surface.name + "\"", -gap));
        }
        return;
    }
    if (surface.is_arc()) return require_outside_arc(body, surface, label);
    for (std::size_t i = 1; i < surface.points.size(); ++i) {
        const Vector2& a = surface.points[i - 1];
        const double gap = norm(body.at - nearest_on(a, surface.points[i], body.at)) - body.radius;
        if (gap < -slack - rounding_of(a, 0)) {
            refuse(fmt::format("{} at ({}, {}) lies across segment {} of {} by {:.3g}", label,
                               body.at[0], body.at[1], i - 1,
                               surface.name.empty() ? "terrain" : "\"" + surface.name + "\"",
                               -gap));
        }
    }
}

void Scene::require_outside_arc(const Disc& body, const Surface& arc, const std::string& label)
{
    const ArcSpan span = ArcSpan::between(arc.centre, arc.points.front(), arc.points.back());
    const double gap =
        norm(body.at - nearest_on_arc(arc.centre, arc.radius, span, body.at)) - body.radius;
    const double slack = rounding_of(body.at, body.radius) + rounding_of(arc.centre, arc.radius);
    if (gap >= -slack) return;
    refuse(fmt::format("{} at ({}, {}) lies across {} by {:.3g}", label, body.at[0], body.at[1],
                       arc.name.empty() ? "an arc" : "\"" + arc.name + "\"", -gap));
}

std::vector<Vector2> Scene::places_at(double t) const
{
    std::vector<Vector2> places;
    places.reserve(bodies_.size());
    for (const Disc& body : bodies_) places.push_back(body.at);
    for (const System& system : systems_) {
        const std::vector<double> x = system.motion->start();
        for (std::uint32_t k = 0; k < system.count; ++k) {
            places[system.first + k] =
                system.motion->shape(k, system.motion->start_mode(), t, x).at;
        }
    }
    return places;
}

/// Requires that everything fits the cell that repeats.
void Scene::check_period() const
{
    const Vector2& period = settings_.period;
    constexpr std::array axes{"x", "y"};
    double largest = 0;
    for (const Disc& body : bodies_) largest = std::max(largest, body.radius);
    const auto refuse_all = [](std::string_view what) {
        refuse(fmt::format("a scene with a period has no {}, and there are some", what));
    };
    const auto slowed = [](const Disc& body) { return body.drag > 0; };
    if (!springs_.empty()) refuse_all("springs");
    if (!systems_.empty()) refuse_all("systems");
    if (!plates_.empty()) refuse_all("plates");
    if (std::ranges::any_of(bodies_, slowed)) refuse_all("bodies with drag");
    for (std::size_t c = 0; c < 2; ++c) {
        if (period[c] == 0) continue;
        const double least = bodies_.size() > 1 ? 8.01 * largest : 2.01 * largest;
        if (period[c] < least) {
            refuse(
                fmt::format("the period along {} is {:g} m, and the largest radius {:g} m; "
                            "expected a period of {:g} m at least",
                            axes[c], period[c], largest, least));
        }
        for (std::uint32_t i = 0; i < bodies_.size(); ++i) {
            const double at = bodies_[i].at[c];
            if (at >= 0 && at < period[c]) continue;
            throw Misplaced(fmt::format("Scene: {} is at {} = {:g} m; expected 0 <= {} < {:g}, the "
                                        "period",
                                        name_of(BodyId{i}), axes[c], at, axes[c], period[c]),
                            i);
        }
        for (std::uint32_t s = 0; s < surfaces_.size(); ++s) {
            const Surface& surface = surfaces_[s];
            if (surface.is_wall) {
                if (surface.normal[c] == 0) continue;
                refuse(
                    fmt::format("{} is a wall across {}, along which the scene has a period; "
                                "expected terrain, or a normal along the other axis",
                                name_of(SurfaceId{s}), axes[c]));
            }
            if (moves(surface.motion)) {
                refuse(fmt::format("{} is terrain that moves, which a scene with a period has not",
                                   name_of(SurfaceId{s})));
            }
            const auto inside = [&](const Vector2& p) { return p[c] >= 0 && p[c] <= period[c]; };
            const bool fits = surface.is_arc() ? inside(surface.centre)
                                               : std::ranges::all_of(surface.points, inside);
            if (fits && surface.radius < period[c] / 2) continue;
            refuse(
                fmt::format("{} does not lie in 0 <= {} <= {:g}, the period; an arc may cross the "
                            "border if its centre lies there and its radius is less than half",
                            name_of(SurfaceId{s}), axes[c], period[c]));
        }
    }
    if (bodies_.size() > 1) require_apart_across(*this, largest);
}

void Scene::check(double t_start) const
{
    for (std::uint32_t s = 0; s < surfaces_.size(); ++s) {
        if (!moves(surfaces_[s].motion)) {
            check_bodies_at(surfaces_[s], s);
            continue;
        }
        Surface surface = surfaces_[s];
        check_motion_at(surface.motion, t_start, name_of(SurfaceId{s}));
        const Vector2 moved = displacement(surface.motion, t_start);
        for (Vector2& point : surface.points) point = point + moved;
        if (!surface.is_wall && !plates_.empty()) {
            refuse(fmt::format("{} is terrain that moves, which a scene with plates has not",
                               name_of(SurfaceId{s})));
        }
        const auto is_point = [](const Disc& body) { return body.radius == 0; };
        if (!surface.is_wall && std::ranges::any_of(bodies_, is_point)) {
            refuse(
                fmt::format("{} is terrain that moves, which discs alone can meet, and "
                            "there is a point",
                            name_of(SurfaceId{s})));
        }
        check_bodies_at(surface, s);
    }
    if (!is_zero(settings_.period)) check_period();
    const std::vector<Vector2> places =
        systems_.empty() ? std::vector<Vector2>{} : places_at(t_start);
    require_apart(*this, places);
    if (!plates_.empty()) check_plates();
}

namespace {

/// [m] Distance of a body from the segment of a plate, minus the radius; of two parallel plates.
double gap_to(const Scene& scene, const Scene::PlateShape& plate, std::uint32_t other)
{
    const Disc& body = scene.bodies()[other];
    const Vector2& middle = scene.bodies()[plate.body].at;
    Vector2 half = plate.half;
    if (const auto* second = scene.plate_of(other)) {
        half = (1 + norm(second->half) / norm(half)) * half;
    }
    return norm(body.at - nearest_on(middle - half, middle + half, body.at)) - body.radius;
}

}  // namespace

/// Requires that plates are parallel, apart from all other bodies, and clear of terrain.
void Scene::check_plates() const
{
    if (!systems_.empty()) refuse("a scene with plates has no systems, and there are some");
    for (const PlateShape& plate : plates_) {
        const double length = norm(plate.half);
        const Vector2& middle = bodies_[plate.body].at;
        const double own = rounding_of(middle, length);
        const auto name = [&] { return name_of(BodyId{plate.body}); };
        for (std::uint32_t i = 0; i < bodies_.size(); ++i) {
            const PlateShape* other = plate_of(i);
            if (other && other->body <= plate.body) continue;
            if (other &&
                std::fabs(cross(plate.half, other->half)) > 1e-12 * length * norm(other->half)) {
                throw Misplaced(fmt::format("Scene: {} and {} are not parallel; expected parallel "
                                            "plates",
                                            name(), name_of(BodyId{i})),
                                i);
            }
            const double gap = gap_to(*this, plate, i);
            const double rounding = own + rounding_of(bodies_[i].at, bodies_[i].radius);
            // The side of a point, or of a plate, on a plate would not be known.
            if (bodies_[i].radius > 0 ? gap >= -rounding : gap > rounding) continue;
            throw Misplaced(
                bodies_[i].radius > 0
                    ? fmt::format("Scene: {} and {} overlap by {:.3g} at the start", name(),
                                  name_of(BodyId{i}), -gap)
                    : fmt::format("Scene: {} lies on {} at the start; expected it on one side",
                                  name_of(BodyId{i}), name()),
                other ? i : plate.body);
        }
        for (const Surface& surface : surfaces_) {
            if (!surface.is_wall) require_clear(plate, surface);
        }
    }
}

/// Requires that no terrain lies where a plate may come to between the walls that stop it.
void Scene::require_clear(const PlateShape& plate, const Surface& surface) const
{
    const Vector2& middle = bodies_[plate.body].at;
    const Vector2 across = turned(plate.along);
    const double width = std::fabs(dot(plate.half, across));
    const double depth = std::fabs(dot(plate.half, plate.along));
    const double slack = rounding_of(middle, norm(plate.half));
    double low = -std::numeric_limits<double>::infinity();
    double high = -low;
    for (const Surface& wall : surfaces_) {
        const double rate = wall.is_wall ? dot(plate.along, wall.normal) : 0;
        if (std::fabs(rate) < 1e-12 || moves(wall.motion)) continue;
        const double gap = dot(middle - wall.points[0], wall.normal);
        (rate > 0 ? low : high) =
            rate > 0 ? std::max(low, -gap / rate) : std::min(high, -gap / rate);
    }
    // Whether a part of the segment from a to b lies in the strip that is this wide.
    const auto meets = [&](const Vector2& a, const Vector2& b, double wide) {
        const double start = dot(a - middle, across);
        const double rate = dot(b - a, across);
        const double inside = wide - slack;
        double from = 0;
        double to = 1;
        if (rate != 0) {
            const auto [enters, leaves] =
                std::minmax({(-inside - start) / rate, (inside - start) / rate});
            from = std::max(from, enters);
            to = std::min(to, leaves);
        } else if (std::fabs(start) >= inside) {
            return false;
        }
        if (from >= to) return false;
        const auto place = [&](double part) {
            return dot(a - middle, plate.along) + part * dot(b - a, plate.along);
        };
        const auto [near, far] = std::minmax({place(from), place(to)});
        return far > low - depth + slack && near < high + depth - slack;
    };
    bool clear = true;
    if (surface.is_arc()) {
        const Vector2 reach = surface.radius * plate.along;
        clear = !meets(surface.centre - reach, surface.centre + reach, width + surface.radius);
    }
    for (std::size_t k = 1; k < surface.points.size() && !surface.is_arc(); ++k) {
        clear = clear && !meets(surface.points[k - 1], surface.points[k], width);
    }
    if (clear) return;
    const auto index = static_cast<std::uint32_t>(&surface - surfaces_.data());
    throw Misplaced(fmt::format("Scene: {} lies in the way of {}; plates meet walls, not terrain",
                                name_of(SurfaceId{index}), name_of(BodyId{plate.body})),
                    plate.body);
}

/// Checks all bodies beside a surface, where it is at the start.
void Scene::check_bodies_at(const Surface& surface, std::uint32_t index) const
{
    double rounding = 0;
    for (const Vector2& point : surface.points) {
        rounding = std::max(rounding, rounding_of(point, 0));
    }
    if (surface.is_arc())
        rounding = std::max(rounding, rounding_of(surface.centre, surface.radius));
    for (std::uint32_t i = 0; i < bodies_.size(); ++i) {
        if (bodies_[i].radius > 0 && bodies_[i].radius < rounding) {
            refuse(fmt::format(
                "{} is so far away that its coordinates are rounded by {:.2g} "
                "m, more than the radius {:g} m of {}",
                name_of(SurfaceId{index}), rounding, bodies_[i].radius, name_of(BodyId{i})));
        }
        if (!systems_.empty() && system_of(i)) continue;
        const PlateShape* plate = plate_of(i);
        if (plate && !surface.is_wall) continue;  // see `check_plates`
        try {
            if (plate) {
                Disc outline = bodies_[i];
                outline.radius = std::fabs(dot(plate->half, surface.normal));
                require_outside(outline, surface);
            } else {
                require_outside(bodies_[i], surface);
            }
        } catch (const std::invalid_argument& error) {
            throw Misplaced(error.what(), i);
        }
    }
}

}  // namespace ricochet
