#include "ricochet/scene/simulate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <compare>
#include <numeric>
#include <optional>
#include <utility>

#include "base/require.hpp"
#include "scene/groups.hpp"
#include "scene/large_pages.hpp"
#include "scene/options.hpp"
#include "scene/scene_loop.hpp"

namespace ricochet {

using namespace detail;

namespace detail {

void validate(const SceneOptions& o)
{
    constexpr std::string_view who = "simulate";
    require_finite(who, "t_start", o.t_start);
    require_above(who, "t_end", o.t_end, "t_start", o.t_start);
    require_positive(who, "rtol", o.rtol);
    require_positive(who, "atol", o.atol);
    require_not_negative(who, "elastic_within", o.elastic_within);
    require_positive(who, "contact_step", o.contact_step);
    require(o.max_events > 0, who, "max_events", "be positive", 0);
    double last = o.t_start;
    for (const double t : o.sample_times) {
        require_at_least(who, "a sample time", t, "the one before it,", last);
        require(t <= o.t_end, who, "a sample time", "not lie after t_end", t);
        last = t;
    }
}

}  // namespace detail

namespace {

/// Room for the events of all groups, where the first `number` groups have had `known` events: as
/// if the others were alike, with a quarter to spare, but not much more than is known.
std::size_t room_for(std::size_t known, std::size_t number, std::size_t groups)
{
    const double each = static_cast<double>(known) / static_cast<double>(number);
    const auto alike = static_cast<std::size_t>(1.25 * each * static_cast<double>(groups));
    return std::clamp(alike, 2 * known, 64 * known);
}

/// Runs all groups until `t_end`; returns the earliest failure.
std::optional<Failure> run_groups(World& world, double t_end, SceneRun& run)
{
    std::optional<Failure> failure;
    const auto groups = groups_of(world);
    run.samples.resize(world.options.sample_times.size());
    for (auto& row : run.samples) row.resize(world.bodies.size());
    if (!world.turns.empty()) {
        run.sample_turns.assign(run.samples.size(), std::vector<BodyTurn>(world.bodies.size()));
    }
    Samples samples{run.samples, run.sample_turns};
    if (world.options.record_events) run.events.reserve(16);
    SceneLoop runner(world, t_end);
    for (std::size_t number = 0; number < groups.size(); ++number) {
        const auto group = groups[number];
        const std::size_t known = run.events.size();
        if (number > 0 && known + known / 8 > run.events.capacity()) {
            reserve_large(run.events, room_for(known, number, groups.size()));
        }
        GroupResult result = runner.run(group, std::move(run.events), samples);
        run.events = std::move(result.events);
        world.statistics.groups += group.size() > 1;
        world.statistics.alone += group.size() == 1;
        for (std::size_t k = known; k < run.events.size(); ++k) {
            run.events[k].number += world.statistics.events;
        }
        world.statistics.events += result.event_count;
        if (result.failure && (!failure || before(result.failure->t, failure->t))) {
            failure = std::move(result.failure);
        }
    }
    return failure;
}

}  // namespace

namespace {

/// States of everything at t, and the counts until then.
void show_states(const World& world, const Instant& t, SceneRun& run)
{
    run.t = t.value;
    reserve_large(run.bodies, world.bodies.size());
    for (std::uint32_t i = 0; i < world.bodies.size(); ++i) run.bodies.push_back(world.state(i, t));
    for (std::uint32_t i = 0; i < world.turns.size(); ++i) run.turns.push_back(world.turn(i, t));
    for (std::uint32_t k = 0; k < world.islands->count(); ++k) {
        if (world.islands->is_system(k)) run.systems.push_back(world.islands->state(k, t));
    }
    run.statistics = world.statistics;
}

/// One pass over all groups; a failure of one group ends the others at that time, in another
/// pass.
SceneRun run_until(const Scene& scene, const SceneOptions& options, const SceneTuning& tuning,
                   bool keeps_events, double t_end, Failure* first)
{
    SceneRun run;
    World world(scene, options);
    world.tuning = tuning;
    world.keeps_events = keeps_events;
    const auto failure = run_groups(world, t_end, run);
    if (failure && failure->t.value < t_end &&
        world.statistics.groups + world.statistics.alone > 1 &&
        failure->outcome != Outcome::cancelled) {
        *first = *failure;
        return run_until(scene, options, tuning, keeps_events, failure->t.value, first);
    }
    if (failure) *first = *failure;
    const Instant end = failure ? failure->t : Instant{t_end, 0};
    show_states(world, end, run);
    return run;
}

struct Key {
    double t;
    std::size_t index;
    friend auto operator<=>(const Key&, const Key&) = default;  // NOLINT(modernize-use-nullptr)
};

/// Sorts events by time and, at one time, in their present order: first into intervals of the run
/// with some 8 events each, as if their times were evenly spread, and then within each.
std::vector<Key> keys_in_order(const std::vector<SceneEvent>& events)
{
    const auto [earliest, latest] = std::ranges::minmax_element(events, {}, &SceneEvent::t);
    const double first = earliest->t;
    const double last = latest->t;
    const std::size_t count = events.size() / 8 + 1;
    const double scale = last > first ? static_cast<double>(count - 1) / (last - first) : 0;
    const auto bin_of = [&](double t) { return static_cast<std::size_t>((t - first) * scale); };
    std::vector<std::size_t> ends(count + 1, 0);
    for (const SceneEvent& event : events) ++ends[bin_of(event.t) + 1];
    std::partial_sum(ends.begin(), ends.end(), ends.begin());
    std::vector<Key> keys;
    reserve_large(keys, events.size());
    keys.resize(events.size());
    for (std::size_t k = 0; k < events.size(); ++k) {
        const double t = events[k].t;
        keys[ends[bin_of(t)]++] = {t, k};
    }
    std::size_t begin = 0;
    for (std::size_t bin = 0; bin < count; ++bin) {
        const auto at = keys.begin();
        std::sort(at + static_cast<std::ptrdiff_t>(begin),
                  at + static_cast<std::ptrdiff_t>(ends[bin]));
        begin = ends[bin];
    }
    return keys;
}

/// Events whose records are fetched while those before them are copied.
constexpr std::size_t ahead = 16;

/// Sorts the events of all groups by time; events of one group at one time keep their order.
void sort_events(SceneRun& run)
{
    std::uint64_t last = ~0ULL;
    std::uint64_t number = ~0ULL;
    const auto count = [&](SceneEvent& event) {
        number += event.number != last;
        last = std::exchange(event.number, number);
    };
    if (std::ranges::is_sorted(run.events, {}, &SceneEvent::t)) {
        std::ranges::for_each(run.events, count);
        return;
    }
    const std::vector<Key> keys = keys_in_order(run.events);
    std::vector<SceneEvent> sorted;
    reserve_large(sorted, run.events.size());
    for (std::size_t k = 0; k < keys.size(); ++k) {
        if (k + ahead < keys.size()) fetch_record(run.events[keys[k + ahead].index]);
        sorted.push_back(run.events[keys[k].index]);
        count(sorted.back());
    }
    run.events = std::move(sorted);
}

/// Refuses an oscillation whose phase the time does not resolve to 1e-4 of a period; the number of
/// its periods would keep the search for an impact from ending, too.
void require_resolved(const Scene& scene, const SceneOptions& options)
{
    const double t = std::max(std::fabs(options.t_start), std::fabs(options.t_end));
    for (std::uint32_t k = 0; k < scene.surfaces().size(); ++k) {
        const auto* of = std::get_if<Oscillation>(&scene.surfaces()[k].motion);
        if (!of || of->frequency * t <= 1e12) continue;
        Refuse{"simulate"}(
            fmt::format("motion of {}: at most 1e12 periods from time 0 to {:g} s can be resolved, "
                        "and a frequency of {:g} Hz gives {:g}",
                        scene.name_of(SurfaceId{k}), t, of->frequency, of->frequency * t));
    }
}

}  // namespace

// --- driven from outside ---

struct SceneSimulation::Parts {
    Parts(const Scene& of, const SceneOptions& with)
        : scene(of), options(with), world(scene, options), loop(world, options.t_end)
    {
        std::vector<std::uint32_t> all(world.bodies.size());
        std::iota(all.begin(), all.end(), 0U);
        world.statistics.groups = 1;
        if (!all.empty()) loop.start(all);
        t = loop.now();
        hold_failure();
    }

    /// A run that cannot go on is at the time of that.
    void hold_failure()
    {
        if (loop.result().failure) t = loop.result().failure->t;
    }

    Scene scene;
    SceneOptions options;
    World world;
    SceneLoop loop;
    Instant t;
};

namespace {

SceneOptions require_drivable(const Scene& scene, const SceneOptions& options)
{
    validate(options);
    require(options.sample_times.empty(), "SceneSimulation", "sample_times", "be empty",
            static_cast<double>(options.sample_times.size()));
    scene.check(options.t_start);
    require_resolved(scene, options);
    scene.require_room(0);
    SceneOptions out = options;
    out.record_events = true;
    return out;
}

}  // namespace

SceneSimulation::SceneSimulation(const Scene& scene, const SceneOptions& options)
    : parts_(std::make_unique<Parts>(scene, require_drivable(scene, options)))
{
}
SceneSimulation::~SceneSimulation() = default;
SceneSimulation::SceneSimulation(SceneSimulation&&) noexcept = default;
SceneSimulation& SceneSimulation::operator=(SceneSimulation&&) noexcept = default;

bool SceneSimulation::advance(double to)
{
    Parts& parts = *parts_;
    if (parts.loop.result().failure) return false;
    const Instant wanted{std::min(to, parts.options.t_end), 0};
    const Instant until = before(wanted, parts.t) ? parts.t : wanted;
    if (!parts.world.bodies.empty()) parts.loop.advance(until);
    const bool event = !events().empty();
    parts.t = event ? parts.loop.now() : until;
    parts.hold_failure();
    return event;
}

double SceneSimulation::t() const noexcept
{
    return parts_->t.value;
}

bool SceneSimulation::ended() const noexcept
{
    // Where there was an event at the end, another one may follow at that time.
    return parts_->loop.result().failure ||
           (parts_->t.value >= parts_->options.t_end && events().empty());
}

std::span<const SceneEvent> SceneSimulation::events() const noexcept
{
    return parts_->loop.result().events;
}

SceneRun SceneSimulation::run() const
{
    SceneRun run;
    show_states(parts_->world, parts_->t, run);
    run.statistics.events = parts_->loop.result().event_count;
    if (const auto& failure = parts_->loop.result().failure) {
        run.outcome = failure->outcome;
        run.message = failure->message;
        run.involved = failure->bodies;
    }
    return run;
}

SceneRun simulate(const Scene& scene, const SceneOptions& options)
{
    return detail::simulate(scene, options, {});
}

SceneRun detail::simulate(const Scene& scene, const SceneOptions& wanted, const SceneTuning& tuning)
{
    validate(wanted);
    SceneOptions options = wanted;
    // The times of events determine the last one.
    const bool limited = wanted.max_events != SceneOptions{}.max_events && !wanted.observe;
    options.record_events |= limited || wanted.observe;
    const bool keeps_events = wanted.record_events || !wanted.observe;
    scene.check(options.t_start);
    require_resolved(scene, options);
    scene.require_room(0);
    Failure failure;
    SceneRun run = run_until(scene, options, tuning, keeps_events, options.t_end, &failure);
    if (run.statistics.events > options.max_events && keeps_events) {
        // Each group has counted by itself: the time of the last event wanted ends all.
        std::vector<double> times;
        std::uint64_t last = ~0ULL;
        for (const SceneEvent& event : run.events) {
            if (event.number != last) times.push_back(event.t);
            last = event.number;
        }
        const std::size_t wanted_count = std::min<std::size_t>(options.max_events, times.size());
        const auto nth = static_cast<std::ptrdiff_t>(wanted_count - 1);
        std::ranges::nth_element(times, times.begin() + nth);
        const double end = times[static_cast<std::size_t>(nth)];
        failure = {Outcome::step_limit,
                   {end, 0},
                   {},
                   fmt::format("max_events = {} events have happened", options.max_events)};
        Failure later;
        run = run_until(scene, options, tuning, keeps_events, end, &later);
    }
    run.outcome = failure.outcome;
    run.message = failure.message;
    run.involved = failure.bodies;
    if (!wanted.record_events) run.events.clear();
    sort_events(run);
    std::size_t rows = 0;
    for (const double t : options.sample_times) rows += t <= run.t;
    run.samples.resize(rows);
    if (!run.turns.empty()) run.sample_turns.resize(rows);
    run.sample_times.assign(options.sample_times.begin(),
                            options.sample_times.begin() + static_cast<std::ptrdiff_t>(rows));
    return run;
}

double energy(const Scene& scene, const std::vector<BodyState>& bodies)
{
    if (bodies.size() != scene.bodies().size()) {
        Refuse{"energy"}(
            fmt::format("{} states are given for {} bodies", bodies.size(), scene.bodies().size()));
    }
    double sum = 0;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (scene.system_of(static_cast<std::uint32_t>(i))) continue;
        const double mass = scene.bodies()[i].mass;
        const Vector2& period = scene.settings().period;
        const Vector2 gone{bodies[i].winding[0] * period[0], bodies[i].winding[1] * period[1]};
        sum += mass * (0.5 * dot(bodies[i].velocity, bodies[i].velocity) -
                       dot(scene.settings().gravity, bodies[i].at + gone));
    }
    for (const Spring& spring : scene.springs()) {
        const double length =
            norm(bodies[spring.between[0].index].at - bodies[spring.between[1].index].at);
        sum += 0.5 * spring.stiffness * (length - spring.rest) * (length - spring.rest);
    }
    return sum;
}

double energy(const Scene& scene, const std::vector<BodyState>& bodies,
              const std::vector<BodyTurn>& turns)
{
    if (!turns.empty() && turns.size() != bodies.size()) {
        Refuse{"energy"}(
            fmt::format("{} angles are given for {} bodies", turns.size(), bodies.size()));
    }
    double sum = energy(scene, bodies);
    for (std::size_t i = 0; i < turns.size(); ++i) {
        sum += 0.5 * scene.bodies()[i].inertia * turns[i].spin * turns[i].spin;
    }
    return sum;
}

}  // namespace ricochet
