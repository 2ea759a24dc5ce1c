#include "scene/groups.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "scene/islands.hpp"
#include "scene/large_pages.hpp"

namespace ricochet::detail {

namespace {

struct Interval {
    double low = 0, high = 0;
};

/// Range of x + v s + a s^2/2 for s in [0, until].
Interval swept(double x, double v, double a, double until)
{
    if (a == 0 && v == 0) return {x, x};
    const double end = x + until * (v + 0.5 * a * until);
    Interval out{std::min(x, end), std::max(x, end)};
    const double turn = a != 0 ? -v / a : never;
    if (turn > 0 && turn < until) {
        const double at = x + 0.5 * v * turn;
        out.low = std::min(out.low, at);
        out.high = std::max(out.high, at);
    }
    return out;
}

constexpr double infinite = never;

/// Range of a body across walls, of normals `normal` and -`normal`.
Interval between_walls(const World& world, const Body& body, const Vector2& normal, double pull,
                       double until)
{
    const bool slowed = body.island != none;
    const double height = dot(body.p, normal);
    const double rise = dot(body.v, normal);
    Interval across = swept(height, rise, pull, until);
    if (pull != 0) {
        // The body rises against gravity no higher than its energy allows, and may fall along it.
        const double top = height - rise * rise / (2 * pull);
        (pull < 0 ? across.high : across.low) =
            pull < 0 ? std::max(across.high, top) : std::min(across.low, top);
        // Drag may turn a body back earlier, so that it comes to places out of reach without it.
        const double fallen = height + (slowed ? 0.5 * pull * until * until : 0);
        across = {std::min(across.low, fallen), std::max(across.high, fallen)};
    } else if (rise != 0) {
        across = {-infinite, infinite};
    }
    // A wall against which a body moves against gravity sends it back earlier, and thus farther.
    const auto is_low = [&](const Face& wall) { return dot(wall.normal, normal) > 0; };
    const Interval free = across;
    const double slack = body.radius + 1e-9 * (std::fabs(free.low) + std::fabs(free.high));
    for (std::uint32_t f = 0; f < world.wall_count; ++f) {
        const Face& wall = world.faces[f];
        const double at = dot(wall.at, normal);
        if (is_low(wall)) {
            if (pull > 0 && free.low - slack <= at) across.high = infinite;
        } else {
            if (pull < 0 && free.high + slack >= at) across.low = -infinite;
        }
    }
    for (std::uint32_t f = 0; f < world.wall_count; ++f) {
        const Face& wall = world.faces[f];
        const double at = dot(wall.at, normal);
        if (is_low(wall)) {
            across.low = std::max(across.low, at);
        } else {
            across.high = std::min(across.high, at);
        }
    }
    return across;
}

/// Where gravity is perpendicular to the walls that a body can meet, their impacts do not change
/// its motion along them, so both motions are known.
bool along_walls(const World& world, const Body& body, double until, Reach& reach)
{
    const Vector2 normal = world.wall_count > 0 ? world.faces[0].normal : Vector2{0, 1};
    const Vector2 along = turned(normal);
    if (normal[0] * normal[1] != 0) return false;  // boxes follow the axes
    for (std::uint32_t f = 0; f < world.wall_count; ++f) {
        const Face& wall = world.faces[f];
        if (std::fabs(dot(wall.normal, along)) > 0) return false;
        if (world.friction(body.material, wall.material) > 0 && dot(body.v, along) != 0) {
            return false;
        }
    }
    const double pull = dot(world.gravity, normal);
    if (body.island != none && dot(world.gravity, along) != 0) return false;
    const Interval across = between_walls(world, body, normal, pull, until);
    const Interval sideways =
        swept(dot(body.p, along), dot(body.v, along), dot(world.gravity, along), until);
    for (std::size_t c = 0; c < 2; ++c) {
        const bool across_axis = normal[c] != 0;
        const double first = across_axis ? across.low * normal[c] : sideways.low * along[c];
        const double second = across_axis ? across.high * normal[c] : sideways.high * along[c];
        const double slack = body.radius + 1e-9 * (std::fabs(first) + std::fabs(second));
        reach.low[c] = std::min(first, second) - slack;
        reach.high[c] = std::max(first, second) + slack;
    }
    return true;
}

/// The box around the start that the largest speed reaches, behind no wall.
void by_speed(const World& world, const Body& body, double fastest, Reach& reach)
{
    const double far = fastest * (world.options.t_end - world.options.t_start) * (1 + 1e-9);
    for (std::size_t c = 0; c < 2; ++c) {
        reach.low[c] = body.p[c] - far - body.radius;
        reach.high[c] = body.p[c] + far + body.radius;
    }
    for (std::uint32_t f = 0; f < world.wall_count; ++f) {
        const Face& wall = world.faces[f];
        for (std::size_t c = 0; c < 2; ++c) {
            if (wall.normal[c] == 1) reach.low[c] = std::max(reach.low[c], wall.at[c]);
            if (wall.normal[c] == -1) reach.high[c] = std::min(reach.high[c], wall.at[c]);
        }
    }
}

/// Bodies that meet exchange speeds. With V^2 the sum of m v^2, impacts do not increase V, and
/// gravity increases it by |g| sqrt(total mass) a second at most; no speed exceeds V / sqrt(m).
void by_energy(const World& world, std::span<const std::uint32_t> group, std::vector<Reach>& boxes)
{
    const double until = world.options.t_end - world.options.t_start;
    double square = 0;
    double mass = 0;
    for (const std::uint32_t i : group) {
        const Body& body = world.bodies[i];
        square += dot(body.v, body.v) / body.inverse_mass;
        mass += 1 / body.inverse_mass;
    }
    // Gravity does not move a group that sleeps.
    const bool asleep =
        std::ranges::all_of(group, [&](std::uint32_t i) { return world.bodies[i].asleep; });
    if (asleep) return;
    const double v = std::sqrt(square) + norm(world.gravity) * std::sqrt(mass) * until;
    for (const std::uint32_t i : group) {
        const Body& body = world.bodies[i];
        const bool driven = body.island != none && world.islands->members(body.island).size() > 1;
        if (!driven) by_speed(world, body, v * std::sqrt(body.inverse_mass), boxes[i]);
    }
}

/// Joins all boxes that overlap along one axis; true if the set was divided.
class Divider {
public:
    Divider(const World& world, const std::vector<Reach>& reaches,
            std::vector<std::uint32_t>& order)
        : world_(world), reaches_(reaches), order_(order)
    {
        reserve_large(ends, order.size());
    }

    /// Separates [begin, end) into parts along an axis, and divides these along the other one.
    void divide(std::size_t begin, std::size_t end, std::size_t axis, bool tried)
    {
        if (end - begin <= 1) return close(begin, end);
        const auto first = order_.begin() + static_cast<std::ptrdiff_t>(begin);
        const auto last = order_.begin() + static_cast<std::ptrdiff_t>(end);
        const auto precedes = [&](std::uint32_t a, std::uint32_t b) {
            return reaches_[a].low[axis] < reaches_[b].low[axis];
        };
        if (!std::is_sorted(first, last, precedes)) std::sort(first, last, precedes);
        std::size_t from = begin;
        double top = reaches_[order_[begin]].high[axis];
        for (std::size_t k = begin + 1; k < end; ++k) {
            const Reach& reach = reaches_[order_[k]];
            const double below = top;
            top = std::max(top, reach.high[axis]);
            if (reach.low[axis] <= below) continue;
            divide(from, k, 1 - axis, false);
            from = k;
        }
        const bool whole = from == begin;
        if (whole && tried) return close(begin, end);
        divide(from, end, 1 - axis, whole);
    }

    std::vector<std::size_t> ends;  ///< of parts, ascending

private:
    void close(std::size_t begin, std::size_t end)
    {
        const auto first = order_.begin() + static_cast<std::ptrdiff_t>(begin);
        const auto last = order_.begin() + static_cast<std::ptrdiff_t>(end);
        std::sort(first, last);
        // Points do not meet each other.
        if (end - begin > 1 && std::all_of(first, last, [&](auto i) { return is_free_point(i); })) {
            for (std::size_t k = begin + 1; k < end; ++k) ends.push_back(k);
        }
        ends.push_back(end);
    }
    [[nodiscard]] bool is_free_point(std::uint32_t i) const
    {
        const Body& body = world_.bodies[i];
        const bool tied = body.island != none && world_.islands->members(body.island).size() > 1;
        return body.radius == 0 && !tied;
    }

    const World& world_;
    const std::vector<Reach>& reaches_;
    std::vector<std::uint32_t>& order_;
};

/// Boxes that bodies do not leave if they meet no other one: from closed forms where all walls are
/// parallel, else from the largest speed.
std::vector<Reach> reaches(const World& world)
{
    const double until = world.options.t_end - world.options.t_start;
    std::vector<Reach> out;
    reserve_large(out, world.bodies.size());
    out.resize(world.bodies.size());
    const bool terrain = world.fixed_count > world.wall_count;
    for (std::size_t i = 0; i < out.size(); ++i) {
        const Body& body = world.bodies[i];
        // Springs may move their bodies anywhere; drag alone only slows them.
        if (body.island != none && world.islands->members(body.island).size() > 1) {
            out[i] = {{-infinite, -infinite}, {infinite, infinite}};
        } else if (body.asleep) {
            by_speed(world, body, 0, out[i]);
        } else if (terrain || !along_walls(world, body, until, out[i])) {
            by_speed(world, body, norm(body.v) + norm(world.gravity) * until, out[i]);
        }
    }
    return out;
}

}  // namespace

Groups groups_of(const World& world)
{
    Groups groups;
    if (world.bodies.empty()) return groups;
    groups.order_.resize(world.bodies.size());
    std::iota(groups.order_.begin(), groups.order_.end(), 0U);
    const bool terrain = world.faces.size() > world.wall_count;
    const bool driven =
        world.periodic || world.any_thermal || !world.turns.empty() || !world.plates.empty();
    if (terrain || driven || !world.scene.systems().empty() || world.options.observe) {
        // Terrain lies in the squares of a group, moving surfaces, thermal ones and systems may
        // drive bodies anywhere, and images are everywhere: all bodies are one group. An observer
        // sees the events of all in their order.
        groups.ends_ = {world.bodies.size()};
        return groups;
    }
    std::vector<Reach> boxes = reaches(world);
    for (;;) {
        Divider divider(world, boxes, groups.order_);
        divider.divide(0, groups.order_.size(), 0, false);
        const bool all_apart = divider.ends.size() == groups.order_.size();
        const bool as_before = divider.ends.size() == groups.size();
        groups.ends_ = std::move(divider.ends);
        if (all_apart || as_before) return groups;
        for (std::size_t k = 0; k < groups.size(); ++k) {
            if (groups[k].size() > 1) by_energy(world, groups[k], boxes);
        }
    }
}

}  // namespace ricochet::detail
