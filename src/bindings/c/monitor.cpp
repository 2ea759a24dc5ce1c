// Events in the steps of a C program's own integrator.
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "bindings/c/callback_setup.hpp"
#include "bindings/c/handles.hpp"
#include "bindings/c/results.hpp"
#include "bindings/c/shown_step.hpp"
#include "bindings/c/structs.hpp"
#include "bindings/c/system.hpp"

using namespace ricochet::c;

using State = std::vector<double>;

struct rc_monitor : Handle {
    static constexpr Kind kind_of = Kind::monitor;

    rc_monitor(std::shared_ptr<const CallbackSystem> system,
               const ricochet::c::MonitorOptions& options)
        : Handle(kind_of),
          dimension(system->dimension()),
          guards(system->guard_count()),
          backward(options.backward),
          room(dimension),
          callbacks(std::make_unique<CallbackSetup<State>>(system, room, options.finders)),
          engine(ricochet::detail::make_monitor(callbacks->setup(), room, options.options,
                                                options.cut_at_all))
    {
    }

    /// Copies the caller's state into `room`.
    /// @param dxdt  null: the rate will come from the flow
    /// @throws Refusal
    [[nodiscard]] const State& taken(const char* function, const double* x, const double* dxdt,
                                     std::size_t n)
    {
        if (!x) throw Refusal(RC_INVALID, std::string(function) + ": found null for x");
        require_dimension(function, n, dimension);
        require_rate(function, dxdt, n);
        room.assign(x, x + n);
        return room;
    }
    /// @throws Refusal
    void require_rate(const char* function, const double* dxdt, std::size_t n) const
    {
        if (!dxdt) return;
        require_dimension(function, n, dimension);
        require_finite(function, "dxdt", dxdt, n);
    }

    std::size_t dimension, guards;
    bool backward;
    bool started = false;  ///< whether `start` or `restore` has succeeded
    bool has_cut = false;
    rc_outcome_code outcome = RC_RUNNING;
    State room;
    std::unique_ptr<CallbackSetup<State>> callbacks;
    ricochet::detail::Owner<ricochet::detail::AnyMonitor<State>> engine;
    CallbackFailed failed;
};

namespace ricochet::c {

namespace {

static_assert(static_cast<int>(Verdict::stands) == RC_STANDS &&
              static_cast<int>(Verdict::cut) == RC_CUT &&
              static_cast<int>(Verdict::rests) == RC_RESTS &&
              static_cast<int>(Verdict::ended) == RC_ENDED);
static_assert(static_cast<int>(Side::below) - 1 == RC_BELOW &&
              static_cast<int>(Side::plateau) - 1 == RC_PLATEAU &&
              static_cast<int>(Side::above) - 1 == RC_ABOVE);

/// Calls `body(monitor)`, whose verdict goes to the caller.
template <class Body>
[[nodiscard]] rc_status judge(rc_monitor* monitor, rc_verdict* verdict, const Body& body) noexcept
{
    if (verdict) *verdict = RC_NO_VERDICT;
    return with(monitor, [&](rc_monitor& at) {
        if (!verdict) throw_null("rc_monitor, verdict");
        try {
            const Verdict found = body(at);
            at.has_cut = at.has_cut || found == Verdict::cut;
            at.outcome = found == Verdict::ended
                             ? static_cast<rc_outcome_code>(at.engine->run().outcome)
                             : RC_RUNNING;
            *verdict = static_cast<rc_verdict>(found);
        } catch (const CallbackFailed& failed) {
            at.failed = failed;
            at.outcome = RC_STOPPED_BY_CALLBACK;
            throw;
        }
    });
}

/// `body(engine)`, or `failed` before the start.
template <class T, class Body>
[[nodiscard]] T place_of(rc_monitor* monitor, T failed, const Body& body) noexcept
{
    return value_of(monitor, failed, [&](const rc_monitor& at) -> T {
        return at.started ? static_cast<T>(body(*at.engine)) : failed;
    });
}

constexpr double not_a_time = std::numeric_limits<double>::quiet_NaN();

}  // namespace

}  // namespace ricochet::c

extern "C" {

rc_status rc_monitor_new(const rc_system* system, const rc_monitor_options* options,
                         rc_monitor** monitor)
{
    return guarded([&] {
        if (!monitor) throw_null("rc_monitor_new, monitor");
        *monitor = nullptr;
        check_handle(system, Kind::system);
        if (system->system->inclusion()) {
            throw Refusal(RC_INVALID,
                          "rc_monitor_new: found a system with set_valued; a monitor cannot "
                          "follow it, expected rc_simulation_new");
        }
        const auto read = read_options(options);
        require_memory(system->system->dimension());
        *monitor = new rc_monitor(system->system, read);
    });
}

rc_status rc_monitor_free(rc_monitor* monitor)
{
    if (!monitor) return RC_OK;
    const rc_status status = with(monitor, [](rc_monitor& at) {
        at.engine = {};
        at.callbacks.reset();
    });
    if (status == RC_OK) {
        retire(monitor, [](Handle* handle) { delete static_cast<rc_monitor*>(handle); });
    }
    return status;
}

rc_status rc_monitor_start(rc_monitor* monitor, double t, const double* x, const double* dxdt,
                           size_t n, rc_mode mode, double scale, rc_verdict* verdict)
{
    return judge(monitor, verdict, [&](rc_monitor& at) {
        const State& start = at.taken("rc_monitor_start", x, dxdt, n);
        const auto found = at.engine->start({t, 0}, start, dxdt, mode, scale);
        at.started = true;
        at.has_cut = false;
        return found;
    });
}

rc_status rc_monitor_examine(rc_monitor* monitor, const rc_host_step* step, rc_verdict* verdict)
{
    return judge(monitor, verdict, [&](const rc_monitor& at) {
        const ShownStep shown(read_struct<rc_host_step>(step, "rc_host_step"), at.dimension,
                              at.backward);
        return at.engine->examine(shown.table());
    });
}

rc_status rc_monitor_resume(rc_monitor* monitor, const double* dxdt, size_t n, double scale,
                            rc_verdict* verdict)
{
    return judge(monitor, verdict, [&](const rc_monitor& at) {
        at.require_rate("rc_monitor_resume", dxdt, n);
        return at.engine->resume(dxdt, scale);
    });
}

rc_status rc_monitor_resume_at(rc_monitor* monitor, const double* x, const double* dxdt, size_t n,
                               rc_mode mode, double scale, rc_verdict* verdict)
{
    return judge(monitor, verdict, [&](rc_monitor& at) {
        return at.engine->resume(at.taken("rc_monitor_resume_at", x, dxdt, n), mode, dxdt, scale);
    });
}

rc_status rc_monitor_hold(rc_monitor* monitor, double t, rc_verdict* verdict)
{
    return judge(monitor, verdict, [&](const rc_monitor& at) { return at.engine->hold(t); });
}

rc_status rc_monitor_cut(rc_monitor* monitor, rc_cut* cut)
{
    return with(monitor, [&](const rc_monitor& at) {
        if (!at.has_cut) {
            throw Refusal(RC_OUT_OF_TURN,
                          "rc_monitor_cut: found no set of events since the start; expected a "
                          "verdict RC_CUT before it");
        }
        const ricochet::Cut<State>& from = at.engine->cut();
        write_struct(cut,
                     {.size = sizeof *cut,
                      .s = from.s,
                      .t = from.t.value,
                      .t_remainder = from.t.remainder,
                      .before = from.before.data(),
                      .after = from.after.data(),
                      .fired = from.fired.data(),
                      .fired_count = from.fired.size(),
                      .mode_before = from.mode_before,
                      .mode_after = from.mode_after,
                      .on_time = from.on_time,
                      .accumulation = from.accumulation,
                      .state_changed = from.state_changed,
                      .reserved = 0},
                     "rc_cut");
    });
}

double rc_monitor_time(rc_monitor* monitor, double* remainder)
{
    return place_of(monitor, not_a_time, [&](const auto& engine) {
        const ricochet::Instant t = engine.t();
        if (remainder) *remainder = t.remainder;
        return t.value;
    });
}

const double* rc_monitor_state(rc_monitor* monitor)
{
    return place_of<const double*>(monitor, nullptr,
                                   [](const auto& engine) { return engine.x().data(); });
}

rc_mode rc_monitor_mode(rc_monitor* monitor)
{
    return place_of(monitor, std::numeric_limits<rc_mode>::max(),
                    [](const auto& engine) { return engine.mode(); });
}

const size_t* rc_monitor_held(rc_monitor* monitor, size_t* count)
{
    if (count) *count = 0;
    return place_of<const size_t*>(monitor, nullptr, [&](const auto& engine) -> const size_t* {
        const auto held = engine.held();
        if (count) *count = held.size();
        return held.empty() ? nullptr : held.data();
    });
}

double rc_monitor_must_stop_at(rc_monitor* monitor)
{
    return place_of(monitor, not_a_time, [](const auto& engine) { return engine.must_stop_at(); });
}

double rc_monitor_quiet_until(rc_monitor* monitor)
{
    return place_of(monitor, not_a_time, [](const auto& engine) { return engine.quiet_until(); });
}

rc_status rc_monitor_skip_to(rc_monitor* monitor, double t, const double* x, const double* dxdt,
                             size_t n)
{
    return with(monitor, [&](rc_monitor& at) {
        if (!dxdt) throw_null("rc_monitor_skip_to, dxdt");
        at.engine->skip_to({t, 0}, at.taken("rc_monitor_skip_to", x, dxdt, n), dxdt);
    });
}

rc_status rc_monitor_side(rc_monitor* monitor, size_t which, rc_side* side)
{
    return with(monitor, [&](const rc_monitor& at) {
        if (!side) throw_null("rc_monitor_side, side");
        require_index("guard", which, at.guards);
        if (!at.started) {
            throw Refusal(RC_OUT_OF_TURN, "rc_monitor_side: expected rc_monitor_start before it");
        }
        *side = static_cast<rc_side>(static_cast<int>(at.engine->side(which)) - 1);
    });
}

rc_outcome_code rc_monitor_outcome(rc_monitor* monitor)
{
    return value_of(monitor, RC_RUNNING, [](const rc_monitor& at) { return at.outcome; });
}

size_t rc_monitor_guard(rc_monitor* monitor)
{
    return value_of(monitor, RC_NO_GUARD,
                    [](const rc_monitor& at) { return at.engine->run().guard; });
}

const char* rc_monitor_reason(rc_monitor* monitor)
{
    return value_of<const char*>(
        monitor, "", [](const rc_monitor& at) { return at.engine->run().reason.c_str(); });
}

rc_status rc_monitor_callback_failure(rc_monitor* monitor, rc_callback_error* error)
{
    if (!monitor) return guarded([&] { write_failure(error, last_failed_callback()); });
    return with(monitor, [&](const rc_monitor& at) { write_failure(error, at.failed); });
}

rc_status rc_monitor_statistics(rc_monitor* monitor, rc_statistics* statistics)
{
    return with(monitor, [&](const rc_monitor& at) {
        const ricochet::Run<State>& run = at.engine->run();
        write_statistics(statistics, {run.statistics, run.guard, run.other_guard});
    });
}

size_t rc_monitor_event_count(rc_monitor* monitor)
{
    return value_of(monitor, std::size_t{0},
                    [](const rc_monitor& at) { return at.engine->run().events.size(); });
}

rc_status rc_monitor_event_at(rc_monitor* monitor, size_t index, rc_event* event)
{
    return with(monitor, [&](const rc_monitor& at) {
        const auto& events = at.engine->run().events;
        require_index("event", index, events.size());
        write_event(event, shown(events[index]));
    });
}

rc_status rc_monitor_clear_events(rc_monitor* monitor)
{
    return with(monitor, [](const rc_monitor& at) { at.engine->clear_events(); });
}

rc_status rc_monitor_save(rc_monitor* monitor, void* bytes, size_t* size)
{
    return with(monitor, [&](const rc_monitor& at) {
        if (!size) throw_null("rc_monitor_save, size");
        write_snapshot("rc_monitor_save", to_text(at.engine->save()), bytes, size);
    });
}

rc_status rc_monitor_restore(rc_monitor* monitor, const void* bytes, size_t size)
{
    return with(monitor, [&](rc_monitor& at) {
        if (!bytes) throw_null("rc_monitor_restore, bytes");
        at.engine->restore(ricochet::snapshot_from_text({static_cast<const char*>(bytes), size}));
        at.started = true;
        at.has_cut = false;
        at.outcome = RC_RUNNING;
    });
}
}
