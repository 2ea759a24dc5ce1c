// The loop of a scene: the next body to act, and its meetings and crossings.
#include "scene/scene_loop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "scene/moving.hpp"

namespace ricochet::detail {

namespace {

/// Consecutive acts at one time, and 64 per body: by trial, far more than any collapse takes.
constexpr std::uint64_t most_idle = 100'000;

/// The grid is laid again where tests and crossings an event have grown by this factor, looked at
/// after this number of acts a body, and at least so many: it costs as much as an event of each.
constexpr double grown = 1.5;
constexpr std::uint64_t acts_each = 4;
constexpr std::uint64_t least_acts = 2048;

}  // namespace

SceneLoop::SceneLoop(World& world, double t_end)
    : world_(world),
      t_end_{t_end, 0},
      pause_{t_end, 0},
      calendar_(world.bodies.size() + world.islands->count() +
                (world.options.contacts ? world.bodies.size() : 0)),
      slots_(world.bodies.size(), none),
      impacts_(world),
      contacts_(world)
{
}

void SceneLoop::begin(std::span<const std::uint32_t> bodies, std::vector<SceneEvent> events)
{
    members_.assign(bodies.begin(), bodies.end());
    placed_ = members_;
    std::erase_if(placed_, [&](std::uint32_t i) { return world_.plate(i) != nullptr; });
    pending_.begin(bodies);
    series_.begin(bodies);
    islands_.clear();
    for (const std::uint32_t i : members_) {
        if (world_.bodies[i].island != none) islands_.push_back(world_.bodies[i].island);
    }
    std::ranges::sort(islands_);
    islands_.erase(std::unique(islands_.begin(), islands_.end()), islands_.end());
    if (members_.size() == 1 && world_.faces.empty()) {
        for (const std::uint32_t island : islands_) world_.islands->set_unseen(island);
    }
    calendar_.clear(members_.size() >= world_.tuning.ring_from);
    now_ = {world_.options.t_start, 0};
    unmoved_ = 0;
    idle_ = 0;
    next_sample_ = 0;
    work_ = {};
    result_.failure.reset();
    result_.event_count = 0;
    result_.events = std::move(events);
    shown_ = result_.events.size();
}

void SceneLoop::place_all()
{
    const bool disc =
        std::ranges::any_of(placed_, [&](std::uint32_t i) { return world_.bodies[i].radius > 0; });
    celled_ = placed_.size() > 1 && disc;
    on_terrain_ = world_.fixed_count > world_.wall_count;
    places_.clear();
    for (const std::uint32_t i : placed_) places_.push_back(world_.bodies[i].p);
    if (celled_) fill_cells();
    if (!on_terrain_) return;
    grid_.lay_terrain(world_, placed_);
    terrain_.begin(members_);
    for (const std::uint32_t i : placed_) {
        const Body& body = world_.bodies[i];
        terrain_[i].square = grid_.terrain(body).at(body.p);
    }
}

/// Makes cells for the bodies at `places_`.
void SceneLoop::fill_cells()
{
    grid_.size(world_, placed_, places_, !islands_.empty());
    for (std::size_t k = 0; k < placed_.size(); ++k) {
        const std::uint32_t i = placed_[k];
        pending_[i].cell = grid_.insert(world_.bodies, i, places_[k]);
    }
    const SceneStatistics& s = world_.statistics;
    const std::uint64_t forced = world_.tuning.lay_after;
    if (work_.interval == 0) {
        work_.interval = std::max<std::uint64_t>(acts_each * placed_.size(), least_acts);
        if (placed_.size() <= few_bodies)
            work_.interval = std::numeric_limits<std::uint64_t>::max();
    }
    work_ = {.tests = s.predictions,
             .crossings = s.crossings,
             .events = result_.event_count,
             .left = forced > 0 ? forced : work_.interval,
             .interval = work_.interval};
}

/// Where a body is now, as far as its cell is concerned.
Vector2 SceneLoop::place_now(std::uint32_t i) const
{
    const Body& body = world_.bodies[i];
    const bool later = body.mapped || before(body.t, now_);
    return later ? world_.path(i, before(now_, body.t) ? body.t : now_).c[0] : body.p;
}

/// Lays the cells for the present places. All meetings are predicted again, since cells that were
/// neighbours are not any more; the predictions are those of before where both were made.
void SceneLoop::lay_cells_again()
{
    places_.clear();
    for (const std::uint32_t i : placed_) places_.push_back(place_now(i));
    const std::vector<char> were_big = [&] {
        std::vector<char> out;
        for (const std::uint32_t i : placed_) out.push_back(world_.bodies[i].big ? 1 : 0);
        return out;
    }();
    fill_cells();
    ++world_.statistics.layings;
    bool changed = false;
    for (std::size_t k = 0; k < placed_.size(); ++k) {
        changed = changed || world_.bodies[placed_[k]].big != (were_big[k] != 0);
    }
    if (changed && on_terrain_) {
        grid_.lay_terrain(world_, placed_);
        for (std::size_t k = 0; k < placed_.size(); ++k) {
            const std::uint32_t i = placed_[k];
            terrain_[i].square = grid_.terrain(world_.bodies[i]).at(places_[k]);
        }
    }
    for (const std::uint32_t i : members_) predict(i);
}

/// Lays the cells again where tests and crossings an event have grown since they were laid. Where
/// that changes little, the next look is later.
void SceneLoop::watch_work()
{
    const SceneStatistics& s = world_.statistics;
    if (world_.tuning.lay_after > 0) return lay_cells_again();
    work_.left = work_.interval;
    const auto since = [](std::uint64_t now, std::uint64_t then) {
        return static_cast<double>(now - then);
    };
    const double work =
        since(s.predictions, work_.tests) + crossing_cost * since(s.crossings, work_.crossings);
    const double each = work / std::max(since(result_.event_count, work_.events), 1.0);
    work_.tests = s.predictions;
    work_.crossings = s.crossings;
    work_.events = result_.event_count;
    if (work_.least == 0 || each < work_.least) work_.least = each;
    if (each <= grown * work_.least) return;
    const double before = grid_.side();
    lay_cells_again();
    if (std::fabs(grid_.side() / before - 1) < 0.1) work_.interval *= 2;
}

/// Predicts the first acts of all members.
void SceneLoop::predict_all()
{
    for (const std::uint32_t island : islands_) step_island(island);
    for (const std::uint32_t i : members_) predict(i);
    fail_where_broken();
}

/// Lets the first act of the calendar, at t, happen.
void SceneLoop::act(const Instant& t)
{
    if (before(now_, t)) {
        now_ = t;
        idle_ = 0;
    } else if (++idle_ > most_idle + 64 * members_.size()) {
        return fail(Outcome::endless_cascade, {}, "the time does not advance any more");
    }
    const auto bodies = static_cast<std::uint32_t>(world_.bodies.size());
    const std::uint32_t who = calendar_.first();
    if (who >= bodies) {
        const auto groups = entry_of_group(0);
        who < groups ? step_island(who - bodies) : step_group(who - groups);
    } else if (leaves_first(who)) {
        leave_square(who);
    } else if (before(pending_[who].crossing, pending_[who].t)) {
        cross(who);
    } else {
        happen(who);
    }
    if (world_.broken) fail_where_broken();
    show_events();
    if (result_.event_count >= world_.options.max_events) {
        fail(Outcome::step_limit, {},
             fmt::format("max_events = {} events have happened", world_.options.max_events));
    }
    if (is_cancelled()) fail(Outcome::cancelled, {}, "the run was cancelled");
    if (celled_ && --work_.left == 0 && !result_.failure) watch_work();
}

GroupResult SceneLoop::run(std::span<const std::uint32_t> bodies_of_group,
                           std::vector<SceneEvent> events, Samples& samples)
{
    begin(bodies_of_group, std::move(events));
    const bool bounces = bounces_from_start();
    show_events();
    if (bounces && flies_past_end(members_.front())) return std::move(result_);
    place_all();
    if (!bounces) settle_at_start();
    predict_all();
    const auto bodies = static_cast<std::uint32_t>(world_.bodies.size());
    const auto fetch = [&](std::uint32_t who) {
        if (who >= bodies) return;
        fetch_record(world_.bodies[who]);
        fetch_record(pending_[who]);
        fetch_record(series_[who]);
        fetch_record(slots_[who]);
    };
    while (!result_.failure && !calendar_.empty(fetch)) {
        const Instant t = calendar_.first_time();
        if (before(t_end_, t)) break;
        if (next_sample_ < world_.options.sample_times.size()) sample_until(t, false, samples);
        act(t);
    }
    const Instant end = result_.failure ? result_.failure->t : t_end_;
    sample_until(end, true, samples);
    return std::move(result_);
}

void SceneLoop::start(std::span<const std::uint32_t> bodies)
{
    begin(bodies, {});
    driven_ = true;
    pause_ = now_;
    place_all();
    settle_at_start();
    predict_all();
}

void SceneLoop::advance(const Instant& to)
{
    result_.events.clear();
    shown_ = 0;
    pause_ = to;
    while (!result_.failure && result_.events.empty() && !calendar_.empty()) {
        const Instant t = calendar_.first_time();
        if (before(to, t)) break;
        act(t);
    }
}

void SceneLoop::show_new_events()
{
    for (; shown_ < result_.events.size(); ++shown_) {
        world_.options.observe(result_.events[shown_]);
    }
    if (world_.keeps_events) return;
    result_.events.clear();
    shown_ = 0;
}

void SceneLoop::fail(Outcome outcome, std::vector<std::uint32_t> bodies, std::string message)
{
    if (result_.failure) return;
    result_.failure = Failure{outcome, now_, std::move(bodies), std::move(message)};
}

/// Writes samples before t, and at t if `inclusive`: a sample at an event's time shows the state
/// after.
void SceneLoop::sample_until(const Instant& t, bool inclusive, Samples& samples)
{
    const auto& times = world_.options.sample_times;
    for (; next_sample_ < times.size(); ++next_sample_) {
        const Instant at{times[next_sample_], 0};
        if (inclusive ? before(t, at) : !before(at, t)) return;
        auto& row = samples.states[next_sample_];
        for (const std::uint32_t i : members_) {
            row[i] = world_.state(i, at);
        }
        if (world_.turns.empty()) continue;
        for (const std::uint32_t i : members_) {
            samples.turns[next_sample_][i] = world_.turn(i, at);
        }
    }
}

void SceneLoop::fail_island(std::uint32_t island)
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

/// Whether nothing but a body's steps happens up to t: no sample, no pause, no cancelling.
bool SceneLoop::nothing_before(const Instant& t) const
{
    const auto& times = world_.options.sample_times;
    if (next_sample_ < times.size() && !before(t, {times[next_sample_], 0})) return false;
    return !is_cancelled() && before(t, pause_);
}

void SceneLoop::step_island(std::uint32_t island)
{
    Islands& islands = *world_.islands;
    const Instant& end = islands.end(island);
    for (;;) {
        if (!islands.advance(island)) return fail_island(island);
        // Driven from outside a run has no length to which a step is too short.
        if (!driven_ && islands.stalls(island)) {
            return fail(Outcome::stalled, islands.members(island),
                        fmt::format("the steps of the island of {} are shorter than 1e-8 of the "
                                    "run: its drag or a spring is too stiff for the method",
                                    called(islands.members(island)[0])));
        }
        if (!islands.unseen(island) || !nothing_before(end)) break;
        now_ = end;
    }
    schedule(island);
    for (const std::uint32_t i : islands.members(island)) predict(i);
}

/// Puts the end of an island's step into the calendar. At the end of the run only events of a
/// system remain to be done.
void SceneLoop::schedule(std::uint32_t island)
{
    const Islands& islands = *world_.islands;
    const Instant& end = islands.end(island);
    const bool goes_on = before(end, t_end_) || islands.is_cut_at(island, t_end_);
    calendar_.set(static_cast<std::uint32_t>(world_.bodies.size()) + island,
                  goes_on ? end : no_instant);
}

void SceneLoop::keep_if_first(std::uint32_t i, const Meeting& meeting, bool surface,
                              std::uint32_t other)
{
    const Instant t = meeting.from.after(meeting.after);
    Pending& pending = pending_[i];
    using Kind = Pending::Kind;
    const bool pressing = pending.kind == Kind::presses || pending.kind == Kind::presses_face;
    // Where a body presses on one body and approaches another, the impact comes first.
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

void SceneLoop::consider_walls(std::uint32_t i)
{
    const Body& body = world_.bodies[i];
    if (body.contact != none) return;  // its group meets them
    if (is_away_from_walls(i)) return;
    const double rounding = World::rounding(body.p, body.radius);
    for (std::uint32_t f = 0; f < world_.wall_count; ++f) {
        const Face& wall = world_.faces[f];
        const double rate = dot(body.v, wall.normal);
        const double bend = dot(body.a, wall.normal);
        if (!body.quartic && rate >= 0 && bend >= 0) continue;
        const double gap = dot(body.p - wall.at, wall.normal) - body.radius;
        if (body.quartic && gap > world_.reach_of_step(i, wall.normal)) continue;
        if (body.quartic || gap <= rounding + World::rounding(wall.at, 0)) {
            consider(i, meet_face(world_, i, f), true, f);
            continue;
        }
        consider(i, {.from = body.t, .after = falls_after(gap, rate, bend, 0)}, true, f);
    }
}

/// Considers moving surfaces, which wake sleepers too.
void SceneLoop::consider_moving(std::uint32_t i)
{
    const auto count = static_cast<std::uint32_t>(world_.faces.size());
    for (std::uint32_t f = world_.fixed_count; f < count; ++f) {
        if (known_to_group(i, true, f)) continue;
        consider(i, meet_moving(world_, i, f, t_end_), true, f);
    }
}

void SceneLoop::fail_where_broken()
{
    if (!world_.broken) return;
    const BrokenBound& broken = *world_.broken;
    fail(broken.non_finite ? Outcome::non_finite : Outcome::wrong_bound, {}, broken.sentence);
}

void SceneLoop::consider_body(std::uint32_t i, std::uint32_t j)
{
    if (j == i) return;
    const std::uint32_t group = world_.bodies[i].contact;
    if (group != none && group == world_.bodies[j].contact) return;
    consider(i, meet(world_, i, j), false, j);
}

/// The same where the cell repeats.
void SceneLoop::consider_image(std::uint32_t i, std::uint32_t j)
{
    if (j != i) consider(i, meet_image(world_, i, j, now_), false, j);
}

void SceneLoop::consider_faces(std::uint32_t i)
{
    for (const std::uint32_t f : faces_of(i)) {
        if (known_to_group(i, true, f)) continue;
        consider(i, meet_face(world_, i, f), true, f);
    }
}

void SceneLoop::predict(std::uint32_t i)
{
    if (world_.plate(i)) return predict_plate(i);
    Pending& pending = pending_[i];
    pending.t = pending.crossing = no_instant;
    pending.kind = Pending::Kind::nothing;
    if (on_terrain_) terrain_[i].exit = {};
    const Body& body = world_.bodies[i];
    if (!world_.motions.empty() && !body.mapped) consider_moving(i);
    if (!world_.plates.empty()) consider_plates(i);
    if (body.asleep) {
        if (celled_) offer(i);
    } else {
        if (!body.mapped) {
            if (world_.periodic) consider_border(i);
            consider_own(i);
            consider_walls(i);
        }
        if (body.quartic) move_to_cell(i);
        if (on_terrain_ && !body.mapped) {
            consider_faces(i);
            predict_leaving(i);
        }
        if (celled_) {
            if (world_.periodic) {
                grid_.each_near(world_.bodies, i, pending.cell,
                                [&](std::uint32_t j) { consider_image(i, j); });
            } else {
                grid_.each_near(world_.bodies, i, pending.cell,
                                [&](std::uint32_t j) { consider_body(i, j); });
            }
            predict_crossing(i);
        }
    }
    put_in_calendar(i);
}

/// A sleeper has no entry in the calendar: the awake bodies around it may meet it now.
void SceneLoop::offer(std::uint32_t i)
{
    grid_.each_near(world_.bodies, i, pending_[i].cell, [&](std::uint32_t j) {
        if (j == i || world_.bodies[j].asleep) return;
        consider(j, meeting(j, i), false, i);
        put_in_calendar(j);
    });
}

void SceneLoop::put_in_calendar(std::uint32_t i)
{
    const Pending& pending = pending_[i];
    const Instant& first = before(pending.crossing, pending.t) ? pending.crossing : pending.t;
    calendar_.set(i, leaves_first(i) ? terrain_[i].exit.t : first);
}

/// Whether the bound of its current step keeps a body in a square and the margin around it.
static bool stays_in(const Square& square, double outside, const Vector2& p, const Vector2& sweep)
{
    for (std::size_t c = 0; c < 2; ++c) {
        const double inside = std::min(p[c] - square.low[c], square.high[c] - p[c]);
        if (sweep[c] >= std::max(inside, 0.0) + outside) return false;
    }
    return true;
}

/// The exit of a body that advances by a step with a polynomial: out of the margin.
SceneLoop::Exit SceneLoop::exit_by_step(std::uint32_t i, const Square& square, double outside) const
{
    if (stays_in(square, outside, world_.bodies[i].p, world_.bends[i].sweep)) return {};
    const Path path = world_.path(i, now_);
    double first = path.until;
    for (std::size_t c = 0; c < 2; ++c) {
        Polynomial gap{};
        double reach = 0;
        for (std::size_t k = 4; k > 0; --k) {
            gap[k] = path.c[k][c];
            reach = (reach + std::fabs(gap[k])) * path.until;
        }
        for (const double way : {path.c[0][c] - square.low[c], square.high[c] - path.c[0][c]}) {
            gap[0] = std::max(way, 0.0) + outside;
            if (reach >= gap[0]) first = std::min(first, falls_within(gap, 4, first, 0));
            for (std::size_t k = 1; k < 5; ++k) gap[k] = -gap[k];
        }
    }
    return {first < path.until ? now_.after(first) : no_instant};
}

/// The exit of a body of a system out of the margin, as proved by the bound.
SceneLoop::Exit SceneLoop::exit_by_bound(std::uint32_t i, const Square& square,
                                         double outside) const
{
    const double most = world_.accelerations[i];
    const Path path = world_.path(i, now_);
    double first = path.until;
    for (std::size_t c = 0; c < 2; ++c) {
        const double v = path.c[1][c];
        const double down = std::max(path.c[0][c] - square.low[c], 0.0) + outside;
        const double up = std::max(square.high[c] - path.c[0][c], 0.0) + outside;
        first = std::min(first, falls_after(down, v, -most, 0));
        first = std::min(first, falls_after(up, -v, -most, 0));
    }
    return {first < path.until ? now_.after(first) : no_instant};
}

/// Where a body leaves a square; it may already be a rounding outside.
SceneLoop::Exit SceneLoop::exit_of(std::uint32_t i, const Square& square, double outside) const
{
    const Body& body = world_.bodies[i];
    if (body.mapped) return exit_by_bound(i, square, outside);
    if (body.quartic) return exit_by_step(i, square, outside);
    const double since = seconds(body.t, now_);
    const Vector2 p = place(body, since);
    const Vector2 velocity = speed(body, since);
    Vector2 after{never, never};
    std::array<std::int8_t, 2> way{};
    for (std::size_t c = 0; c < 2; ++c) {
        const double v = velocity[c];
        const double a = body.a[c];
        const double below = p[c] - square.low[c];
        const double above = square.high[c] - p[c];
        if (a == 0) {  // as below, by values: the sign of the velocity cannot be predicted
            way[c] = v < 0 ? -1 : 1;
            const double gap = std::max(v < 0 ? below : above, 0.0);
            after[c] = v != 0 ? gap / std::fabs(v) : never;
            continue;
        }
        const bool falls = below < never && !(v > 0 && a >= 0);
        const bool rises = above < never && !(v < 0 && a <= 0);
        const double down = falls ? falls_after(below, v, a, 0) : never;
        const double up = rises ? falls_after(above, -v, -a, 0) : never;
        after[c] = std::min(down, up);
        way[c] = down <= up ? -1 : 1;
    }
    const bool vertical = after[1] < after[0];
    const double first = vertical ? after[1] : after[0];
    if (!(first < never)) return {};
    return {now_.after(first), vertical ? std::int8_t{0} : way[0],
            vertical ? way[1] : std::int8_t{0}};
}

void SceneLoop::predict_crossing(std::uint32_t i)
{
    Pending& pending = pending_[i];
    const Square square = grid_.square_of(world_.bodies[i], i, pending.cell);
    const Exit exit = exit_of(i, square, grid_.outside());
    pending.crossing = exit.t;
    pending.across_x = exit.x;
    pending.across_y = exit.y;
}

void SceneLoop::predict_leaving(std::uint32_t i)
{
    OnTerrain& place = terrain_[i];
    const FaceTree& terrain = grid_.terrain(world_.bodies[i]);
    place.exit = exit_of(i, terrain.square(place.square), terrain.outside());
}

/// Moves a body into the cell and the square of terrain to which a step has led it.
void SceneLoop::move_to_cell(std::uint32_t i)
{
    const Body& body = world_.bodies[i];
    if (!celled_ && !on_terrain_) return;
    const Vector2 p = place_now(i);
    if (celled_) grid_.move(world_.bodies, i, pending_[i].cell, p);
    if (on_terrain_) terrain_[i].square = grid_.terrain(body).at(p);
}

void SceneLoop::cross(std::uint32_t i)
{
    ++world_.statistics.crossings;
    Pending& pending = pending_[i];
    const Body& body = world_.bodies[i];
    if (body.quartic) return predict(i);
    if (body.big) {
        grid_.lay_again(world_.bodies, i, pending.cell, place(body, seconds(body.t, now_)));
        return predict(i);
    }
    const auto x = static_cast<int>(pending.across_x);
    const auto y = static_cast<int>(pending.across_y);
    const bool was_away = is_away_from_walls(i);
    grid_.step(world_.bodies, i, pending.cell, x, y);
    if (was_away) consider_walls(i);
    if (world_.periodic) {
        grid_.each_ahead(world_.bodies, i, pending.cell, x, y,
                         [&](std::uint32_t j) { consider_image(i, j); });
    } else {
        grid_.each_ahead(world_.bodies, i, pending.cell, x, y,
                         [&](std::uint32_t j) { consider_body(i, j); });
    }
    predict_crossing(i);
    put_in_calendar(i);
}

/// Moves a body into the next square of terrain, and considers the faces that it could not touch
/// before.
void SceneLoop::leave_square(std::uint32_t i)
{
    ++world_.statistics.crossings;
    OnTerrain& own = terrain_[i];
    const Body& body = world_.bodies[i];
    if (body.quartic) return predict(i);
    FaceTree& terrain = grid_.terrain(body);
    const std::uint32_t before = own.square;
    const Vector2 p = place(body, seconds(body.t, now_));
    own.square = terrain.beyond(before, p, own.exit.x != 0 ? 0 : 1, own.exit.x + own.exit.y > 0);
    const std::vector<std::uint32_t>& known = terrain.faces(before);
    auto next = known.begin();
    for (const std::uint32_t f : terrain.faces(own.square)) {
        next = std::lower_bound(next, known.end(), f);
        if (next != known.end() && *next == f) continue;
        if (known_to_group(i, true, f)) continue;
        consider(i, meet_face(world_, i, f), true, f);
    }
    predict_leaving(i);
    put_in_calendar(i);
}

/// Predicts when a body leaves the cell that repeats: from its record alone.
void SceneLoop::consider_border(std::uint32_t i)
{
    const Body& body = world_.bodies[i];
    Pending& pending = pending_[i];
    for (std::uint32_t c = 0; c < 2; ++c) {
        const double period = world_.period[c];
        if (period == 0) continue;
        for (const bool up : {false, true}) {
            const double sign = up ? -1 : 1;
            const double gap = up ? period - body.p[c] : body.p[c];
            const double after = falls_after(gap, sign * body.v[c], sign * body.a[c], 0);
            if (!(after < never)) continue;
            const Instant t = body.t.after(after);
            if (!before(t, pending.t)) continue;
            pending.t = t;
            pending.kind = Pending::Kind::border;
            pending.other = 2 * c + (up ? 1 : 0);
        }
    }
}

/// Takes a body that has left the cell to its image on the other side, and counts the period.
void SceneLoop::cross_border(std::uint32_t i)
{
    ++world_.statistics.crossings;
    Body& body = world_.bodies[i];
    const std::uint32_t c = pending_[i].other / 2;
    const bool up = pending_[i].other % 2 != 0;
    const double s = seconds(body.t, now_);
    body.p = place(body, s);
    body.v = speed(body, s);
    body.t = now_;
    body.p[c] += up ? -world_.period[c] : world_.period[c];
    world_.windings[i][c] += up ? 1 : -1;
    ++body.version;
    body.sides.fill(none);
    if (body.held != none && world_.faces[body.held].kind != Face::Kind::wall) {
        body.held = none;  // an image of the face holds it now, once it presses on it
        body.a = world_.gravity;
    }
    move_to_cell(i);
    predict(i);
}

std::string SceneLoop::presses_on(std::uint32_t i, const Face& face) const
{
    return fmt::format("{} presses on {}{}", called(i),
                       face.kind == Face::Kind::vertex ? "a corner or an end of " : "",
                       world_.scene.name_of(SurfaceId{face.surface}));
}

void SceneLoop::happen(std::uint32_t i)
{
    const Pending& pending = pending_[i];
    using Kind = Pending::Kind;
    switch (pending.kind) {
        case Kind::nothing: return predict(i);
        case Kind::stop: return halt(i);
        case Kind::edge: return leave_edge(i);
        case Kind::border: return cross_border(i);
        case Kind::face: return impact(i);
        case Kind::presses_face:
            if (world_.plate(i) && !world_.moves(pending.other)) return rest_on_stop(i);
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
