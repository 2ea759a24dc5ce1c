// The loop of a scene: the next body to act, what it meets, what it crosses.
#include "scene/runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "scene/large_pages.hpp"
#include "scene/moving.hpp"

namespace ricochet::detail {

namespace {

/// With no more than these there are no cells.
constexpr std::size_t few_bodies = 16;
constexpr std::size_t few_faces = 64;

/// Acts in a row at one time, and 64 for each body: by trial, far more than any collapse takes.
constexpr std::uint64_t most_idle = 100'000;

}  // namespace

Runner::Runner(World& world, double t_end)
    : world_(world),
      t_end_{t_end, 0},
      calendar_(world.bodies.size() + world.islands->count() +
                (world.options.contacts ? world.bodies.size() : 0)),
      slots_(world.bodies.size(), none),
      impacts_(world),
      contacts_(world)
{
    reserve_large(pending_, world.bodies.size());
    pending_.resize(world.bodies.size());
    reserve_large(series_, world.bodies.size());
    series_.resize(world.bodies.size());
}

void Runner::begin(std::span<const std::uint32_t> bodies, std::vector<SceneEvent> events)
{
    members_.assign(bodies.begin(), bodies.end());
    islands_.clear();
    for (const std::uint32_t i : members_) {
        if (world_.bodies[i].island != none) islands_.push_back(world_.bodies[i].island);
    }
    std::ranges::sort(islands_);
    const auto repeated = std::ranges::unique(islands_);
    islands_.erase(repeated.begin(), repeated.end());
    if (members_.size() == 1 && world_.faces.empty()) {
        for (const std::uint32_t island : islands_) world_.islands->set_unseen(island);
    }
    calendar_.clear();
    now_ = {world_.options.t_start, 0};
    fruitless_ = 0;
    idle_ = 0;
    next_sample_ = 0;
    result_ = {};
    result_.events = std::move(events);
}

/// Cells as large as two of the largest discs, or as leave some 0.4 bodies in each: by trial, 1.2
/// times as fast at a fraction of 0.3 as one body in each.
void Runner::place_all()
{
    celled_ = members_.size() > 1 || world_.fixed_count > world_.wall_count;
    if (!celled_) return;
    Vector2 low{never, never};
    Vector2 high{-never, -never};
    double radius = 0;
    for (const std::uint32_t i : members_) {
        const Body& body = world_.bodies[i];
        for (std::size_t c = 0; c < 2; ++c) {
            low[c] = std::min(low[c], body.p[c]);
            high[c] = std::max(high[c], body.p[c]);
        }
        radius = std::max(radius, body.radius);
    }
    const auto count = static_cast<double>(members_.size());
    const double width = high[0] - low[0] + 2 * radius;
    const double height = high[1] - low[1] + 2 * radius;
    // Steps are asked where they are only now and then, and may lie a tenth outside their cell.
    const double slack = islands_.empty() ? 1.0001 : 1.3;
    double side = std::max(2 * radius * slack, 0.65 * std::sqrt(width * height / count));
    if (!(side > 0)) side = std::max({width, height, 1.0});
    if (members_.size() <= few_bodies && world_.fixed_count - world_.wall_count <= few_faces) {
        side = 0x1p200;  // so few are all asked, and none pays for the cells that it crosses
    }
    const auto buckets = [&](double extent) {
        const double wanted = std::clamp(extent / side, 4.0, 4 * std::sqrt(count) + 1e3);
        return std::bit_ceil(static_cast<std::uint32_t>(wanted));
    };
    cells_.size(side, buckets(width), buckets(height));
    place_faces();
    for (const std::uint32_t i : members_) {
        Pending& pending = pending_[i];
        pending.cell = cells_.cell_of(world_.bodies[i].p);
        cells_.insert(world_.bodies, i, pending.cell);
    }
}

/// A face lies in every bucket from which a body can touch it.
void Runner::place_faces()
{
    double radius = 0;
    for (const std::uint32_t i : members_) radius = std::max(radius, world_.bodies[i].radius);
    const double reach = 1.001 * radius + 0.15 * cells_.side();
    for (std::uint32_t f = world_.wall_count; f < world_.fixed_count; ++f) {
        const Face& face = world_.faces[f];
        const Vector2 end = face.at - face.length * turned(face.normal);
        const auto from = cells_.cell_of(
            {std::min(face.at[0], end[0]) - reach, std::min(face.at[1], end[1]) - reach});
        const auto to = cells_.cell_of(
            {std::max(face.at[0], end[0]) + reach, std::max(face.at[1], end[1]) + reach});
        for (std::int64_t x = from.x; x <= to.x; ++x) {
            for (std::int64_t y = from.y; y <= to.y; ++y) {
                const Vector2 middle{(static_cast<double>(x) + 0.5) * cells_.side(),
                                     (static_cast<double>(y) + 0.5) * cells_.side()};
                const double apart = norm(middle - nearest_on(face.at, end, middle));
                if (apart <= reach + 0.7072 * cells_.side()) {
                    cells_.add_face(cells_.bucket_of(x, y), f);
                }
            }
        }
    }
}

GroupResult Runner::run(std::span<const std::uint32_t> bodies_of_group,
                        std::vector<SceneEvent> events, Samples& samples)
{
    begin(bodies_of_group, std::move(events));
    place_all();
    settle_at_start();
    for (const std::uint32_t island : islands_) step_island(island);
    for (const std::uint32_t i : members_) predict(i);
    fail_where_broken();
    const auto bodies = static_cast<std::uint32_t>(world_.bodies.size());
    const SceneOptions& options = world_.options;
    while (!result_.failure && !calendar_.empty()) {
        const Instant t = calendar_.first_time();
        if (before(t_end_, t)) break;
        if (next_sample_ < options.sample_times.size()) sample_until(t, false, samples);
        if (before(now_, t)) {
            now_ = t;
            idle_ = 0;
        } else if (++idle_ > most_idle + 64 * members_.size()) {
            fail(Outcome::endless_cascade, {}, "the time does not advance any more");
            break;
        }
        const std::uint32_t who = calendar_.first();
        if (who >= bodies) {
            const auto groups = entry_of_group(0);
            who < groups ? step_island(who - bodies) : step_group(who - groups);
        } else if (before(pending_[who].crossing, pending_[who].t)) {
            cross(who);
        } else {
            happen(who);
        }
        if (world_.broken) fail_where_broken();
        if (options.cancelled && options.cancelled->load(std::memory_order_relaxed)) {
            fail(Outcome::cancelled, {}, "the run was cancelled");
        }
    }
    const Instant end = result_.failure ? result_.failure->t : t_end_;
    sample_until(end, true, samples);
    return std::move(result_);
}

void Runner::fail(Outcome outcome, std::vector<std::uint32_t> bodies, std::string message)
{
    if (result_.failure) return;
    result_.failure = Failure{outcome, now_, std::move(bodies), std::move(message)};
}

/// Samples before t, and at t if `inclusive`: one at the time of an event shows the state after it.
void Runner::sample_until(const Instant& t, bool inclusive, Samples& samples)
{
    const auto& times = world_.options.sample_times;
    for (; next_sample_ < times.size(); ++next_sample_) {
        const Instant at{times[next_sample_], 0};
        if (inclusive ? before(t, at) : !before(at, t)) return;
        auto& row = samples[next_sample_];
        for (const std::uint32_t i : members_) {
            row[i] = {world_.position(i, at), world_.velocity(i, at), world_.bodies[i].asleep};
        }
    }
}

void Runner::fail_island(std::uint32_t island)
{
    const Islands& islands = *world_.islands;
    const std::string first = called(islands.members(island)[0]);
    if (const auto& trouble = islands.trouble()) {
        return fail(trouble->outcome, islands.members(island),
                    fmt::format("{} {}", first, trouble->what));
    }
    fail(Outcome::step_underflow, islands.members(island),
         fmt::format("the step of the island of {} fell below what the time resolves", first));
}

void Runner::step_island(std::uint32_t island)
{
    Islands& islands = *world_.islands;
    const auto id = static_cast<std::uint32_t>(world_.bodies.size()) + island;
    if (!islands.advance(island)) return fail_island(island);
    if (islands.stalls(island)) {
        return fail(Outcome::stalled, islands.members(island),
                    fmt::format("the steps of the island of {} are shorter than 1e-8 of the run: "
                                "its drag or a spring is too stiff for the method",
                                called(islands.members(island)[0])));
    }
    const Instant& end = islands.end(island);
    calendar_.set(id, before(end, t_end_) ? end : no_instant);
    for (const std::uint32_t i : islands.members(island)) predict(i);
}

void Runner::consider(std::uint32_t i, const Meeting& meeting, bool surface, std::uint32_t other)
{
    ++world_.statistics.predictions;
    if (!(meeting.after < never)) return;
    const Instant t = meeting.from.after(meeting.after);
    Pending& pending = pending_[i];
    using Kind = Pending::Kind;
    const bool pressing = pending.kind == Kind::presses || pending.kind == Kind::presses_face;
    // Where a body presses on one and approaches another, it is the impact that comes first.
    if (before(pending.t, t)) return;
    if (!before(t, pending.t) && (!pressing || meeting.presses)) return;
    pending.t = t;
    pending.other = other;
    pending.other_version = surface ? 0 : world_.bodies[other].version;
    if (surface) {
        pending.kind = meeting.presses ? Kind::presses_face : Kind::face;
    } else {
        pending.kind = meeting.presses ? Kind::presses : Kind::pair;
    }
}

void Runner::consider_walls(std::uint32_t i)
{
    const Body& body = world_.bodies[i];
    if (body.contact != none) return;  // its group meets them
    for (std::uint32_t f = 0; f < world_.wall_count; ++f) {
        const Face& wall = world_.faces[f];
        const double rate = dot(body.v, wall.normal);
        const double bend = dot(body.a, wall.normal);
        if (!body.quartic && rate >= 0 && bend >= 0) continue;
        const double gap = dot(body.p - wall.at, wall.normal) - body.radius;
        const double rounding = World::rounding(body.p, body.radius) + World::rounding(wall.at, 0);
        if (body.quartic || gap <= rounding) {
            consider(i, meet_face(world_, i, f), true, f);
            continue;
        }
        consider(i, {.from = body.t, .after = falls_after(gap, rate, bend, 0)}, true, f);
    }
}

/// Surfaces that move, which wake sleepers, too.
void Runner::consider_moving(std::uint32_t i)
{
    const auto count = static_cast<std::uint32_t>(world_.faces.size());
    for (std::uint32_t f = world_.fixed_count; f < count; ++f) {
        if (known_to_group(i, true, f)) continue;
        consider(i, meet_moving(world_, i, f, t_end_), true, f);
    }
}

void Runner::fail_where_broken()
{
    if (!world_.broken) return;
    const BrokenBound& broken = *world_.broken;
    fail(broken.non_finite ? Outcome::non_finite : Outcome::wrong_bound, {}, broken.sentence);
}

void Runner::consider_bucket(std::uint32_t i, std::uint32_t bucket)
{
    for (std::uint32_t j = cells_.head(bucket); j != none; j = world_.bodies[j].next) {
        if (j == i) continue;
        const std::uint32_t group = world_.bodies[i].contact;
        if (group != none && group == world_.bodies[j].contact) continue;
        consider(i, meet(world_, i, j), false, j);
    }
}

void Runner::consider_faces(std::uint32_t i)
{
    if (!cells_.any_faces()) return;
    for (const std::uint32_t f : cells_.faces(world_.bodies[i].bucket)) {
        if (known_to_group(i, true, f)) continue;
        consider(i, meet_face(world_, i, f), true, f);
    }
}

void Runner::predict(std::uint32_t i)
{
    Pending& pending = pending_[i];
    pending.t = pending.crossing = no_instant;
    pending.kind = Pending::Kind::nothing;
    const Body& body = world_.bodies[i];
    if (!world_.motions.empty() && !body.mapped) consider_moving(i);
    if (body.asleep) {
        if (celled_) offer(i);
    } else {
        if (!body.mapped) {
            consider_own(i);
            consider_walls(i);
        }
        if (celled_) {
            if (body.quartic) move_to_cell(i);
            if (!body.mapped) consider_faces(i);
            const auto& cell = pending.cell;
            for (int x = -1; x <= 1; ++x) {
                for (int y = -1; y <= 1; ++y) {
                    consider_bucket(i, cells_.bucket_of(cell.x + x, cell.y + y));
                }
            }
            predict_crossing(i);
        }
    }
    put_in_calendar(i);
}

/// A sleeper has no entry in the calendar: those that are awake around it may meet it now.
void Runner::offer(std::uint32_t i)
{
    const auto& cell = pending_[i].cell;
    for (int x = -1; x <= 1; ++x) {
        for (int y = -1; y <= 1; ++y) {
            std::uint32_t j = cells_.head(cells_.bucket_of(cell.x + x, cell.y + y));
            for (; j != none; j = world_.bodies[j].next) {
                if (j == i || world_.bodies[j].asleep) continue;
                consider(j, meet(world_, j, i), false, i);
                put_in_calendar(j);
            }
        }
    }
}

void Runner::put_in_calendar(std::uint32_t i)
{
    const Pending& pending = pending_[i];
    calendar_.set(i, before(pending.crossing, pending.t) ? pending.crossing : pending.t);
}

void Runner::predict_crossing(std::uint32_t i)
{
    Pending& pending = pending_[i];
    const Body& body = world_.bodies[i];
    const double side = cells_.side();
    const double corner[2] = {static_cast<double>(pending.cell.x) * side,
                              static_cast<double>(pending.cell.y) * side};
    pending.across_x = pending.across_y = 0;
    pending.crossing = no_instant;
    if (body.mapped) return predict_crossing_mapped(i);
    if (body.quartic) {
        const Path path = world_.path(i, now_);
        // A tenth of a cell outside of it.
        double first = path.until;
        for (std::size_t c = 0; c < 2; ++c) {
            const double into = path.c[0][c] - corner[c];
            Polynomial gap{};
            for (std::size_t k = 1; k < 5; ++k) gap[k] = path.c[k][c];
            for (const double way : {into, side - into}) {
                gap[0] = std::max(way, 0.0) + 0.1 * side;
                first = std::min(first, falls_within(gap, 4, first, 0));
                for (std::size_t k = 1; k < 5; ++k) gap[k] = -gap[k];
            }
        }
        if (first < path.until) pending.crossing = now_.after(first);
        return;
    }
    double first = never;
    const double since = seconds(body.t, now_);
    const Vector2 p = place(body, since);
    const Vector2 velocity = speed(body, since);
    for (std::size_t c = 0; c < 2; ++c) {
        const double into = p[c] - corner[c];
        const double v = velocity[c];
        const double a = body.a[c];
        if (v == 0 && a == 0) continue;
        const double down = v > 0 && a >= 0 ? never : falls_after(into, v, a, 0);
        const double up = v < 0 && a <= 0 ? never : falls_after(side - into, -v, -a, 0);
        const double s = std::min(down, up);
        if (s < first) {
            first = s;
            pending.across_x = pending.across_y = 0;
            (c == 0 ? pending.across_x : pending.across_y) =
                static_cast<std::int8_t>(down <= up ? -1 : 1);
        }
    }
    if (first < never) pending.crossing = now_.after(first);
}

/// A tenth of a cell outside of it, as the bound proves.
void Runner::predict_crossing_mapped(std::uint32_t i)
{
    Pending& pending = pending_[i];
    const double side = cells_.side();
    const double most = world_.accelerations[i];
    const Path path = world_.path(i, now_);
    double first = path.until;
    for (std::size_t c = 0; c < 2; ++c) {
        const double cell = static_cast<double>(c == 0 ? pending.cell.x : pending.cell.y);
        const double into = path.c[0][c] - cell * side;
        const double v = path.c[1][c];
        first = std::min(first, falls_after(std::max(into, 0.0) + 0.1 * side, v, -most, 0));
        first = std::min(first, falls_after(std::max(side - into, 0.0) + 0.1 * side, -v, -most, 0));
    }
    if (first < path.until) pending.crossing = now_.after(first);
}

/// Into the cell where a step has led it.
void Runner::move_to_cell(std::uint32_t i)
{
    const Instant& t = world_.bodies[i].t;
    const auto there = cells_.cell_of(world_.path(i, before(now_, t) ? t : now_).c[0]);
    Cells::Cell& cell = pending_[i].cell;
    if (there == cell) return;
    cells_.remove(world_.bodies, i);
    cell = there;
    cells_.insert(world_.bodies, i, cell);
}

void Runner::cross(std::uint32_t i)
{
    ++world_.statistics.crossings;
    Pending& pending = pending_[i];
    const Body& body = world_.bodies[i];
    Cells::Cell& cell = pending.cell;
    if (body.quartic) return predict(i);
    cells_.remove(world_.bodies, i);
    cell.x += pending.across_x;
    cell.y += pending.across_y;
    cells_.insert(world_.bodies, i, cell);
    consider_faces(i);
    for (int k = -1; k <= 1; ++k) {
        const std::int64_t x = pending.across_x != 0 ? cell.x + pending.across_x : cell.x + k;
        const std::int64_t y = pending.across_y != 0 ? cell.y + pending.across_y : cell.y + k;
        consider_bucket(i, cells_.bucket_of(x, y));
    }
    predict_crossing(i);
    put_in_calendar(i);
}

std::string Runner::presses_on(std::uint32_t i, const Face& face) const
{
    return fmt::format("{} presses on {}{}", called(i),
                       face.kind == Face::Kind::vertex ? "a corner or an end of " : "",
                       world_.scene.name_of(SurfaceId{face.surface}));
}

void Runner::happen(std::uint32_t i)
{
    const Pending& pending = pending_[i];
    using Kind = Pending::Kind;
    switch (pending.kind) {
        case Kind::nothing: return predict(i);
        case Kind::stop: return halt(i);
        case Kind::edge: return leave_edge(i);
        case Kind::face: return impact(i);
        case Kind::presses_face:
            if (!world_.moves(pending.other) && rests_on_face(i)) return predict(i);
            return press(i, presses_on(i, world_.faces[pending.other]));
        case Kind::pair:
        case Kind::presses: break;
    }
    if (world_.bodies[pending.other].version != pending.other_version) {
        ++world_.statistics.stale;
        return predict(i);
    }
    if (pending.kind == Kind::pair) return impact(i);
    const auto [first, second] = std::minmax(i, pending.other);
    press(i, fmt::format("{} and {} press on each other", called(first), called(second)));
}

}  // namespace ricochet::detail
