// A disc or point alone above the only wall: its impacts have a closed form, and without drag its
// flights, too.
#include <algorithm>

#include "scene/scene_loop.hpp"

namespace ricochet::detail {

/// Whether a body can only fly above the only wall and strike it, with no push along the wall.
bool SceneLoop::flies_above_one_wall(const Body& body) const
{
    if (members_.size() != 1 || world_.faces.size() != 1 || world_.wall_count != 1) return false;
    if (!world_.ordinary) return false;
    if (body.held != none || body.island != none || world_.options.elastic_within > 0) return false;
    const Face& wall = world_.faces[0];
    if (!(dot(world_.gravity, wall.normal) < 0)) return false;
    if (world_.friction(body.material, wall.material) == 0) return true;
    const Vector2 along = turned(wall.normal);
    return dot(body.v, along) == 0 && dot(world_.gravity, along) == 0;
}

/// Takes a body from the start through its first impact and the bounces after it, with the
/// arithmetic of `impact` but without a search for contacts. Returns false, with nothing changed,
/// where anything else may happen.
bool SceneLoop::bounces_from_start()
{
    const std::uint32_t i = members_.front();
    Body& body = world_.bodies[i];
    const SceneOptions& options = world_.options;
    if (!flies_above_one_wall(body) || body.asleep) return false;
    if (!options.sample_times.empty() || options.cancelled || options.max_events == 1) return false;
    const Face& wall = world_.faces[0];
    const double pull = dot(world_.gravity, wall.normal);
    const double gap = dot(body.p - wall.at, wall.normal) - body.radius;
    if (gap <= World::rounding(body.p, body.radius) + World::rounding(wall.at, 0)) return false;
    const Instant t = body.t.after(falls_after(gap, dot(body.v, wall.normal), pull, 0));
    if (before(t_end_, t)) return false;

    const double s = seconds(body.t, t);
    const Vector2 arrives = speed(body, s);
    const auto strike = strike_on_wall(body, arrives, t);
    if (!strike) return false;

    now_ = t;
    body.p = place(body, s);
    body.v = strike->leaves;
    body.t = t;
    ++body.version;
    series_[i] = {.since = t, .last = t, .count = 1};
    ++world_.statistics.predictions;
    record(i, *strike);
    bounce(i);
    return true;
}

/// The impact of a body alone on the only wall, with the arithmetic of `Impacts` but without
/// friction. Nothing where the body may stay on the wall, or `Impacts` corrects what rounding
/// gains.
std::optional<SceneLoop::Strike> SceneLoop::strike_on_wall(const Body& body, const Vector2& arrives,
                                                           const Instant& t) const
{
    const Face& wall = world_.faces[0];
    const double approach = -dot(arrives, wall.normal);
    const double restitution = world_.restitution(body.material, wall.material);
    if (restitution == 1 && is_slanted(wall.normal)) return {};
    Strike strike{.arrives = arrives, .leaves = {}, .impulse = {}};
    const double whole = (1 + restitution) * approach * (1 / body.inverse_mass);
    const double size = whole - whole * excess_of_square(wall.normal);
    strike.impulse = size * wall.normal;
    strike.leaves = arrives + body.inverse_mass * strike.impulse;
    const double least = std::max(resolution(t) * norm(world_.gravity), noise(strike.leaves, {}));
    if (!(approach > noise(arrives, {}) && dot(strike.leaves, wall.normal) > least)) return {};
    if (!is_finite(strike.leaves)) return {};
    return strike;
}

/// Counts and records an impact on the only wall at the present time.
void SceneLoop::record(std::uint32_t i, const Strike& strike)
{
    ++world_.statistics.waves;
    ++world_.statistics.impacts;
    if (world_.options.record_events) {
        SceneEvent event{
            .t = now_.value, .number = result_.event_count, .body = i, .impulse = strike.impulse};
        event.other = {true, world_.faces[0].surface};
        event.normal = world_.faces[0].normal;
        event.at = world_.position(i, now_) - world_.bodies[i].radius * event.normal;
        event.before[0] = strike.arrives;
        event.after[0] = strike.leaves;
        result_.events.push_back(event);
    }
    ++result_.event_count;
}

/// Takes a body with drag, alone with the only wall, through an impact without friction. Returns
/// false, with nothing changed, where anything else may happen.
bool SceneLoop::strikes_alone(std::uint32_t i)
{
    const Body& body = world_.bodies[i];
    if (members_.size() != 1 || world_.faces.size() != 1 || world_.wall_count != 1) return false;
    if (body.island == none || body.mapped || body.contact != none || body.radius == 0)
        return false;
    if (!world_.plain_laws) return false;
    if (world_.options.elastic_within > 0 || series_[i].count >= crowded) return false;
    if (world_.friction(body.material, world_.faces[0].material) > 0) return false;
    const auto strike = strike_on_wall(body, world_.velocity(i, now_), now_);
    if (!strike) return false;
    Series& series = series_[i];
    if (series.count++ == 0) series.since = now_;
    series.last = now_;
    series.low = 0;
    unmoved_ = 0;
    record(i, *strike);
    velocities_.assign(1, {i, strike->leaves});
    continue_island(body.island);
    if (!result_.failure) predict(i);
    return true;
}

/// Whether a body that has just left the only wall strikes it again only after the end of the run.
bool SceneLoop::flies_past_end(std::uint32_t i) const
{
    const Body& body = world_.bodies[i];
    const Vector2& normal = world_.faces[0].normal;
    const double flight = -2 * dot(body.v, normal) / dot(world_.gravity, normal);
    return before({t_end_.value + resolution(t_end_), 0}, body.t.after(flight));
}

/// Bounces a body alone that has just left the only wall: flight after flight, each lasting twice
/// the time to its top. Times are sums of multiples of a unit, which are exact, and of the
/// remainder.
void SceneLoop::bounce(std::uint32_t i)
{
    Body& body = world_.bodies[i];
    if (driven_ || !flies_above_one_wall(body)) return;
    const Face& wall = world_.faces[0];
    const Vector2 along = turned(wall.normal);
    const double pull = dot(world_.gravity, wall.normal);
    const double restitution = world_.restitution(body.material, wall.material);
    double leaves = dot(body.v, wall.normal);
    double slip = dot(body.v, along);
    if (!(leaves > 0)) return;
    const auto& times = world_.options.sample_times;
    const double stop =
        next_sample_ < times.size() ? std::min(times[next_sample_], t_end_.value) : t_end_.value;
    const double unit =
        0x1p51 * 16 * resolution({stop, 0});  // what is added to it is rounded to its ulp
    const double twice = -2 / pull;
    const double shortest = resolution({stop, 0});
    const double side_pull = dot(world_.gravity, along);
    const std::uint64_t most =
        world_.options.max_events - std::min(world_.options.max_events, result_.event_count);
    const bool recorded = world_.options.record_events;
    double whole = body.t.value;
    double rest = body.t.remainder;
    double moved = 0;
    std::uint64_t count = 0;
    for (; count + 1 < most; ++count) {
        if (count % 4096 == 0 && is_cancelled()) break;
        const double flight = leaves * twice;
        const double part = (flight + unit) - unit;
        if (whole + part + rest + (flight - part) > stop || flight <= shortest) break;
        whole += part;
        rest += flight - part;
        const double arrives = slip + side_pull * flight;
        moved += flight * (slip + 0.5 * side_pull * flight);
        slip = arrives;
        if (recorded) {
            SceneEvent event{.t = whole + rest, .number = result_.event_count + count, .body = i};
            event.other = {true, wall.surface};
            event.before[0] = slip * along - leaves * wall.normal;
            event.impulse = ((1 + restitution) * leaves / body.inverse_mass) * wall.normal;
            event.after[0] = slip * along + (restitution * leaves) * wall.normal;
            event.normal = wall.normal;
            event.at = body.p + moved * along - body.radius * wall.normal;
            result_.events.push_back(event);
            if (result_.events.size() % 4096 == 0) show_events();
        }
        leaves *= restitution;
    }
    if (count == 0) return;
    body.p = body.p + moved * along;
    body.v = slip * along + leaves * wall.normal;
    body.t = Instant{whole, 0}.after(rest);
    now_ = body.t;
    ++body.version;
    result_.event_count += count;
    world_.statistics.impacts += count;
    if (leaves == 0) settle(i, none);
}

}  // namespace ricochet::detail
