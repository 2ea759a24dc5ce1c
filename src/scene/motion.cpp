#include "scene/motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/require.hpp"

namespace ricochet {

using namespace detail;

namespace {

constexpr std::string_view scene_name = "Scene";

double turns(const Oscillation& o, double t)
{
    return 2 * std::numbers::pi * o.frequency * t + o.phase;
}

/// The first time of a path after t.
std::size_t piece_after(const PiecewiseLinear& path, double t)
{
    return static_cast<std::size_t>(std::ranges::upper_bound(path.times, t) - path.times.begin());
}

Vector2 slope_before(const PiecewiseLinear& path, std::size_t k)
{
    if (k == 0 || k == path.times.size()) return {};
    const double length = path.times[k] - path.times[k - 1];
    return (1 / length) * (path.displacements[k] - path.displacements[k - 1]);
}

struct Displacement {
    double t;
    Vector2 operator()(const Fixed&) const { return {}; }
    Vector2 operator()(const Oscillation& o) const { return std::sin(turns(o, t)) * o.amplitude; }
    Vector2 operator()(const ConstantVelocity& c) const { return (t - c.since) * c.velocity; }
    Vector2 operator()(const PiecewiseLinear& path) const
    {
        const std::size_t k = piece_after(path, t);
        if (k == 0) return path.displacements.front();
        if (k == path.times.size()) return path.displacements.back();
        return path.displacements[k - 1] + (t - path.times[k - 1]) * slope_before(path, k);
    }
    Vector2 operator()(const GivenMotion& given) const { return given.displacement(t); }
};

struct Velocity {
    double t;
    Vector2 operator()(const Fixed&) const { return {}; }
    Vector2 operator()(const Oscillation& o) const
    {
        return 2 * std::numbers::pi * o.frequency * std::cos(turns(o, t)) * o.amplitude;
    }
    Vector2 operator()(const ConstantVelocity& c) const { return c.velocity; }
    Vector2 operator()(const PiecewiseLinear& path) const
    {
        return slope_before(path, piece_after(path, t));
    }
    Vector2 operator()(const GivenMotion& given) const { return given.velocity(t); }
};

}  // namespace

Vector2 displacement(const SurfaceMotion& motion, double t)
{
    return std::visit(Displacement{t}, motion);
}

Vector2 velocity(const SurfaceMotion& motion, double t)
{
    return std::visit(Velocity{t}, motion);
}

namespace detail {

MotionBounds bounds_of(const SurfaceMotion& motion)
{
    constexpr double infinite = std::numeric_limits<double>::infinity();
    if (const auto* o = std::get_if<Oscillation>(&motion)) {
        const double rate = 2 * std::numbers::pi * o->frequency;
        const double reach = norm(o->amplitude);
        return {rate * rate * reach, rate * reach, reach};
    }
    if (const auto* c = std::get_if<ConstantVelocity>(&motion)) {
        return {0, norm(c->velocity), infinite};
    }
    if (const auto* path = std::get_if<PiecewiseLinear>(&motion)) {
        MotionBounds bounds;
        for (std::size_t k = 0; k < path->times.size(); ++k) {
            bounds.speed = std::max(bounds.speed, norm(slope_before(*path, k)));
            bounds.reach = std::max(bounds.reach, norm(path->displacements[k]));
        }
        return bounds;
    }
    if (const auto* given = std::get_if<GivenMotion>(&motion)) {
        return {given->acceleration_bound, given->speed_bound, given->reach};
    }
    return {};
}

double next_break(const SurfaceMotion& motion, double t)
{
    const auto* path = std::get_if<PiecewiseLinear>(&motion);
    const std::size_t k = path ? piece_after(*path, t) : 0;
    return path && k < path->times.size() ? path->times[k]
                                          : std::numeric_limits<double>::infinity();
}

double still_until(const SurfaceMotion& motion, double t)
{
    if (!moves(motion)) return std::numeric_limits<double>::infinity();
    const auto* path = std::get_if<PiecewiseLinear>(&motion);
    if (!path) return t;
    double until = t;
    while (until < std::numeric_limits<double>::infinity() && is_zero(velocity(motion, until))) {
        until = next_break(motion, until);
    }
    return until;
}

void check_motion(const SurfaceMotion& motion, const std::string& whose)
{
    const std::string of = fmt::format("motion of {}: ", whose);
    const auto finite = [&](const Vector2& v, std::string_view what) {
        for (const double x : v) require_finite(scene_name, of + std::string(what), x);
    };
    if (const auto* o = std::get_if<Oscillation>(&motion)) {
        finite(o->amplitude, "amplitude");
        require_positive(scene_name, of + "frequency", o->frequency);
        require_finite(scene_name, of + "phase", o->phase);
    } else if (const auto* c = std::get_if<ConstantVelocity>(&motion)) {
        finite(c->velocity, "velocity");
        require_finite(scene_name, of + "since", c->since);
    } else if (const auto* path = std::get_if<PiecewiseLinear>(&motion)) {
        if (path->times.empty() || path->times.size() != path->displacements.size()) {
            Refuse{scene_name}(fmt::format(
                "{}expected as many displacements as times, and one at least, got {} and {}", of,
                path->displacements.size(), path->times.size()));
        }
        for (std::size_t k = 0; k < path->times.size(); ++k) {
            require_finite(scene_name, of + "time", path->times[k]);
            finite(path->displacements[k], "displacement");
            if (k == 0) continue;
            require_above(scene_name, of + "a time", path->times[k], "the one before it,",
                          path->times[k - 1]);
        }
    } else if (const auto* given = std::get_if<GivenMotion>(&motion)) {
        if (!given->displacement || !given->velocity) {
            Refuse{scene_name}(of + "a displacement and a velocity are expected");
        }
        require_not_negative(scene_name, of + "acceleration_bound", given->acceleration_bound);
        require(given->speed_bound >= 0, scene_name, of + "speed_bound", "not be negative",
                given->speed_bound);
        require(given->reach >= 0, scene_name, of + "reach", "not be negative", given->reach);
    }
}

void check_motion_at(const SurfaceMotion& motion, double t, const std::string& whose)
{
    for (const Vector2& v : {displacement(motion, t), velocity(motion, t)}) {
        if (is_finite(v)) continue;
        Refuse{scene_name}(fmt::format(
            "the motion of {} is ({}, {}) at t = {}, which is not finite", whose, v[0], v[1], t));
    }
}

}  // namespace detail

}  // namespace ricochet
