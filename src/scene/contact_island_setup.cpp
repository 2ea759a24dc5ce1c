// The members of an island, and the places where they touch.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <tuple>

#include "base/require.hpp"
#include "scene/contact_island.hpp"

namespace ricochet::detail {

namespace {

constexpr Refuse refuse{"ContactIsland"};
constexpr Require expect{"ContactIsland"};

bool finite(const std::array<double, 2>& x)
{
    return std::isfinite(x[0]) && std::isfinite(x[1]);
}

auto key(const IslandBody& b)
{
    return std::tuple(b.at[0], b.at[1], b.velocity[0], b.velocity[1], b.mass, b.radius, b.drag,
                      b.inertia, b.spin);
}
auto key(const IslandWall& w)
{
    return std::tuple(w.is_segment, w.point[0], w.point[1], w.normal[0], w.normal[1], w.end[0],
                      w.end[1], w.radius, w.span.from, w.span.to);
}

void check_body(const IslandBody& b)
{
    if (!finite(b.at) || !finite(b.velocity)) {
        refuse(fmt::format("position and velocity of body {} must be finite", b.id));
    }
    expect(b.mass > 0 && std::isfinite(b.mass), "mass must be positive and finite", b.mass);
    expect(b.radius >= 0 && std::isfinite(b.radius), "radius must be finite, zero or positive",
           b.radius);
    expect(b.drag >= 0 && std::isfinite(b.drag), "drag must be finite, zero or positive", b.drag);
    expect(b.inertia >= 0 && std::isfinite(b.inertia), "inertia must be finite, zero or positive",
           b.inertia);
    const double edge = b.radius * b.radius / b.inertia;  // [1/kg]
    if (b.inertia > 0 && !(edge > 0 && std::isfinite(edge) && std::isfinite(1 / edge))) {
        refuse(
            fmt::format("the edge of body {} must have a finite inertia I / r^2 above 0, got I "
                        "= {:g} kg m^2 and r = {:g} m",
                        b.id, b.inertia, b.radius));
    }
    if (!std::isfinite(b.radius * b.spin)) {
        refuse(fmt::format("spin of body {} must be finite, got {:g} rad/s", b.id, b.spin));
    }
}

}  // namespace

void ContactIsland::check(const IslandSetup& setup) const
{
    expect(options_.step > 0 && std::isfinite(options_.step), "step must be positive and finite",
           options_.step);
    expect(options_.tolerance > 0, "tolerance must be positive", options_.tolerance);
    expect(options_.sleep_speed >= 0, "sleep_speed must not be negative", options_.sleep_speed);
    if (!finite(setup.gravity)) refuse("gravity must be finite");
    if (!setup.coefficients) refuse("coefficients of restitution and friction are not given");
    for (const IslandBody& b : setup.bodies) check_body(b);
    for (const IslandWall& w : setup.walls) {
        const bool unit = std::abs(std::hypot(w.normal[0], w.normal[1]) - 1) < 1e-9;
        const bool directed = w.is_segment ? finite(w.end) : w.radius > 0 || unit;
        if (!finite(w.point) || !directed) {
            refuse(
                fmt::format("wall {} needs finite points, and a line a normal of length 1", w.id));
        }
    }
    for (const IslandSpring& s : setup.springs) {
        expect(s.rest >= 0 && std::isfinite(s.rest), "rest length must not be negative", s.rest);
        expect(s.stiffness >= 0 && std::isfinite(s.stiffness), "stiffness must not be negative",
               s.stiffness);
        expect(s.damping >= 0 && std::isfinite(s.damping), "damping must not be negative",
               s.damping);
    }
}

/// Sorts members by place: sums and pivots then do not depend on ids.
void ContactIsland::sort_members(IslandSetup setup)
{
    bodies_ = std::move(setup.bodies);
    walls_ = std::move(setup.walls);
    std::ranges::stable_sort(bodies_, {}, [](const IslandBody& b) { return key(b); });
    std::ranges::stable_sort(walls_, {}, [](const IslandWall& w) { return key(w); });
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        places_.emplace(bodies_[i].id, static_cast<int>(i));
    }
    for (const IslandSpring& s : setup.springs) {
        const auto [first, second] = std::minmax({place_of(s.first), place_of(s.second)});
        if (first == second) refuse(fmt::format("a spring joins body {} to itself", s.first));
        links_.push_back({first, second, s.rest, s.stiffness, s.damping});
    }
    std::ranges::sort(links_, {}, [](const Link& k) {
        return std::tuple(k.first, k.second, k.rest, k.stiffness, k.damping);
    });
    const auto n = static_cast<Eigen::Index>(bodies_.size());
    q_.resize(2 * n);
    v_.resize(2 * n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const IslandBody& b = bodies_[static_cast<std::size_t>(i)];
        q_.segment<2>(2 * i) << b.at[0], b.at[1];
        v_.segment<2>(2 * i) << b.velocity[0], b.velocity[1];
    }
    set_turning();
    v_next_ = v_;
}

/// Adds the speeds of edges to the coordinates where a disc turns.
void ContactIsland::set_turning()
{
    const auto turns = [](const IslandBody& b) { return b.inertia > 0; };
    if (std::ranges::none_of(bodies_, turns)) return;
    v_.conservativeResize(3 * static_cast<Eigen::Index>(bodies_.size()));
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
        const IslandBody& b = bodies_[i];
        problem_.turning.push_back(turns(b) ? b.radius * b.radius / b.inertia : 0);
        v_[static_cast<Eigen::Index>(2 * bodies_.size() + i)] = turns(b) ? b.radius * b.spin : 0;
    }
    impacts_.turning = problem_.turning;
}

ContactIsland::ContactIsland(IslandSetup setup, const IslandOptions& options, double t)
    : options_(options),
      gravity_(setup.gravity),
      coefficients_(setup.coefficients),
      t_(t),
      law_(options.tolerance)
{
    check(setup);
    sort_members(std::move(setup));
    if (!options_.crowded) project(options_.largest_overlap);
}

int ContactIsland::place_of(std::uint32_t id) const
{
    const auto found = places_.find(id);
    if (found == places_.end()) refuse(fmt::format("there is no body {}", id));
    return found->second;
}

/// The place of the speed of its edge, -1 for a body that does not turn.
int ContactIsland::edge_of(int body) const
{
    const auto i = static_cast<std::size_t>(body);
    if (problem_.turning.empty() || problem_.turning[i] == 0) return -1;
    return static_cast<int>(2 * bodies_.size() + i);
}

void ContactIsland::set_spin(std::uint32_t id, double spin)
{
    const int i = place_of(id);
    if (edge_of(i) < 0) refuse(fmt::format("body {} does not turn", id));
    v_[edge_of(i)] = bodies_[static_cast<std::size_t>(i)].radius * spin;
    wake();
}

/// Size of the coordinates, in proportion to which rounding grows [m].
double ContactIsland::size_of(int body) const
{
    return bodies_[static_cast<std::size_t>(body)].radius + std::abs(q_[2 * body]) +
           std::abs(q_[2 * body + 1]);
}

std::string ContactIsland::name_of(const Touch& touch) const
{
    const std::uint32_t first = bodies_[static_cast<std::size_t>(touch.body)].id;
    const auto other = static_cast<std::size_t>(touch.other);
    return touch.wall ? fmt::format("body {} and wall {}", first, walls_[other].id)
                      : fmt::format("bodies {} and {}", first, bodies_[other].id);
}

/// Moves bodies onto their surfaces by the shortest way, weighted by mass. This amounts to a
/// minimal change of the time for which gravity acts: velocities are unchanged. Overlaps of more
/// than `most`, as a fraction of the coordinates, are refused.
void ContactIsland::project(double most)
{
    const std::vector<double> close(bodies_.size(), 0.0);
    problem_.inertia.clear();
    problem_.couplings.clear();
    for (const IslandBody& b : bodies_) problem_.inertia.push_back(b.mass);
    const Eigen::VectorXd start = q_;
    for (int round = 0; round < 8; ++round) {
        find_touches(close);
        double deepest = 0;
        problem_.contacts.clear();
        problem_.momentum.setZero(v_.size());
        for (const Touch& touch : touches_) {
            const double size = size_of(touch.body);
            if (!(touch.gap >= -most * size)) {
                refuse(fmt::format("{} overlap by {} m", name_of(touch), -touch.gap));
            }
            deepest = std::max(deepest, -touch.gap / size);
            LawContact contact = law_contact(touch, 1);
            contact.offset = {touch.gap, 0};
            contact.friction = 0;
            problem_.contacts.push_back(contact);
        }
        if (deepest <= 4e-16) break;
        impulses_.resize(0);
        Eigen::VectorXd way;
        law_.solve(problem_, impulses_, way);
        q_ += way.head(q_.size());
    }
    statistics_.projected = (q_ - start).lpNorm<Eigen::Infinity>();
}

std::array<double, 2> ContactIsland::wall_displacement(int wall, double from, double to) const
{
    const WallMotion* motion = walls_[static_cast<std::size_t>(wall)].motion;
    if (!motion || motion->still_until(from) >= to) return {0, 0};
    const auto a = motion->displacement(from);
    const auto b = motion->displacement(to);
    return {b[0] - a[0], b[1] - a[1]};
}

double ContactIsland::wake_time() const
{
    double first = std::numeric_limits<double>::infinity();
    for (const IslandWall& w : walls_) {
        if (w.motion) first = std::min(first, w.motion->still_until(t_));
    }
    return first;
}

/// Gap and normal of a body at `at` from a wall displaced by `moved`; false in the middle of a
/// segment, where there is no normal.
bool ContactIsland::wall_touch(const Point& at, const Point& moved, Touch& touch) const
{
    const int body = touch.body;
    const int wall = touch.other;
    const IslandWall& w = walls_[static_cast<std::size_t>(wall)];
    const double radius = bodies_[static_cast<std::size_t>(body)].radius;
    const double x = at[0] - moved[0] - w.point[0];
    const double y = at[1] - moved[1] - w.point[1];
    if (w.radius > 0) return arc_touch(w, {at[0] - moved[0], at[1] - moved[1]}, touch);
    if (!w.is_segment) {
        touch.normal = w.normal;
        touch.gap = x * w.normal[0] + y * w.normal[1] - radius;
        return true;
    }
    const double along_x = w.end[0] - w.point[0];
    const double along_y = w.end[1] - w.point[1];
    const double square = along_x * along_x + along_y * along_y;
    const double part = square > 0 ? std::clamp((x * along_x + y * along_y) / square, 0.0, 1.0) : 0;
    const double dx = part < 1 ? x - part * along_x : at[0] - moved[0] - w.end[0];
    const double dy = part < 1 ? y - part * along_y : at[1] - moved[1] - w.end[1];
    const double distance = std::hypot(dx, dy);
    if (!(distance > 0)) return false;
    touch.normal = {dx / distance, dy / distance};
    touch.gap = distance - radius;
    touch.at_end = part <= 0 || part >= 1;
    if (touch.at_end) touch.end = part <= 0 ? w.point : w.end;
    return true;
}

/// The same for an arc, from the side on which the body is, or for the end of the arc beside it.
bool ContactIsland::arc_touch(const IslandWall& arc, const Point& at, Touch& touch) const
{
    const double radius = bodies_[static_cast<std::size_t>(touch.body)].radius;
    const Vector2 nearest = nearest_on_arc(arc.point, arc.radius, arc.span, at);
    const Vector2 apart = at - arc.point;
    touch.at_end = !arc.span.contains(apart, 0);
    touch.end = nearest;
    const Vector2 away = touch.at_end ? at - nearest : apart;
    const double distance = norm(away);
    if (!(distance > 0)) return false;
    const bool inside = !touch.at_end && distance < arc.radius;
    const double sign = inside ? -1 : 1;
    touch.normal = {sign * away[0] / distance, sign * away[1] / distance};
    touch.gap = sign * (touch.at_end ? distance : distance - arc.radius) - radius;
    return true;
}

void ContactIsland::pair_touches(const std::vector<double>& reach)
{
    std::vector<int> order(bodies_.size());
    std::iota(order.begin(), order.end(), 0);
    const auto left = [&](int i) {
        return q_[2 * i] - bodies_[static_cast<std::size_t>(i)].radius -
               reach[static_cast<std::size_t>(i)];
    };
    std::ranges::sort(order, {}, [&](int i) { return std::tuple(left(i), i); });
    for (std::size_t a = 0; a < order.size(); ++a) {
        const int i = order[a];
        const auto bi = static_cast<std::size_t>(i);
        const double right = q_[2 * i] + bodies_[bi].radius + reach[bi];
        for (std::size_t b = a + 1; b < order.size() && left(order[b]) <= right; ++b) {
            const auto bj = static_cast<std::size_t>(order[b]);
            const auto [first, second] = std::minmax({i, order[b]});
            const double x = q_[2 * first] - q_[2 * second];
            const double y = q_[2 * first + 1] - q_[2 * second + 1];
            const double distance = std::hypot(x, y);
            const double radii = bodies_[bi].radius + bodies_[bj].radius;
            // Points never meet.
            if (!(distance - radii <= reach[bi] + reach[bj]) || radii == 0 || distance == 0)
                continue;
            touches_.push_back({.body = first,
                                .other = second,
                                .normal = {x / distance, y / distance},
                                .gap = distance - radii});
        }
    }
}

void ContactIsland::wall_touches(int body, double reach)
{
    const std::size_t own = touches_.size();
    for (int w = 0; w < static_cast<int>(walls_.size()); ++w) {
        const IslandWall& wall = walls_[static_cast<std::size_t>(w)];
        Point moved{};
        double way = 0;
        if (wall.motion) {
            moved = wall.motion->displacement(t_);
            const Point step = wall_displacement(w, t_, t_ + options_.step);
            way = std::hypot(step[0], step[1]);
        }
        Touch touch{.body = body, .other = w, .wall = true};
        if (!wall_touch({q_[2 * body], q_[2 * body + 1]}, moved, touch)) continue;
        if (!(touch.gap <= reach + way)) continue;
        // Where two segments end at one point, both have that contact.
        const bool again = (wall.is_segment || wall.radius > 0) && !wall.motion &&
                           std::any_of(touches_.begin() + static_cast<std::ptrdiff_t>(own),
                                       touches_.end(), [&](const Touch& c) {
                                           return c.at_end && touch.at_end && c.end == touch.end;
                                       });
        if (!again) touches_.push_back(touch);
    }
}

/// Finds all contacts that could close if no body moves farther than its reach [m].
void ContactIsland::find_touches(const std::vector<double>& reach)
{
    touches_.clear();
    pair_touches(reach);
    for (std::size_t i = 0; i < bodies_.size(); ++i) wall_touches(static_cast<int>(i), reach[i]);
    std::ranges::sort(touches_, {},
                      [](const Touch& c) { return std::tuple(c.wall, c.body, c.other); });
    for (Touch& c : touches_) {
        const auto other = static_cast<std::size_t>(c.other);
        c.law = coefficients_(bodies_[static_cast<std::size_t>(c.body)].material,
                              c.wall ? walls_[other].material : bodies_[other].material);
    }
}

}  // namespace ricochet::detail
