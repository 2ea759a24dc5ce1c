#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <utility>

#include "bindings/c/handles.hpp"
#include "bindings/c/run.hpp"
#include "bindings/c/structs.hpp"
#include "bindings/c/system.hpp"

using namespace ricochet::c;

struct rc_simulation : Handle {
    rc_simulation() : Handle(Kind::simulation) {}

    std::unique_ptr<AnyRun> run;
    std::size_t dimension = 0;
    std::atomic<bool> cancelled{false};  ///< asked for
    /// Why the last call that advanced the run did not finish: RC_RUNNING if it did.
    rc_outcome_code interrupted = RC_RUNNING;
    CallbackFailed failed;
};

namespace ricochet::c {

namespace {

/// A loop has some forty arrays of the dimension of the state. Where there is no memory for
/// them it is better known before the first is written to.
void require_memory(std::size_t dimension)
{
    constexpr std::size_t arrays = 48;
    constexpr std::size_t large = 1'000'000;
    if (dimension < large) return;
    if (dimension > std::numeric_limits<std::size_t>::max() / (2 * arrays * sizeof(double))) {
        throw std::bad_alloc();
    }
    const std::size_t bytes = dimension * arrays * sizeof(double);
    void* volatile room = ::operator new(bytes, std::nothrow);  // volatile: not left out
    if (!room) throw std::bad_alloc();
    ::operator delete(room);
}

/// Calls `body(simulation)` while no other call may.
template <class Body>
[[nodiscard]] rc_status with(rc_simulation* simulation, const Body& body) noexcept
{
    return guarded([&] {
        const InUse in_use(simulation, Kind::simulation);
        body(*simulation);
    });
}

template <class T, class Body>
[[nodiscard]] T value_of(rc_simulation* simulation, T failed, const Body& body) noexcept
{
    return guarded_value(failed, [&] {
        const InUse in_use(simulation, Kind::simulation);
        return static_cast<T>(body(*simulation));
    });
}

/// Advances the run by `go`, which says whether it goes on.
template <class Go>
[[nodiscard]] rc_status advance_by(rc_simulation* simulation, int* goes_on, const Go& go) noexcept
{
    return with(simulation, [&](rc_simulation& at) {
        at.interrupted = RC_RUNNING;
        bool more = false;
        try {
            more = go(*at.run);
        } catch (const CallbackFailed& failed) {
            at.interrupted = RC_STOPPED_BY_CALLBACK;
            at.failed = failed;
            throw;
        }
        if (at.run->continue_cancelled()) {
            at.cancelled.store(false, std::memory_order_relaxed);
            at.interrupted = RC_CANCELLED;
            more = false;
        }
        if (goes_on) *goes_on = more;
    });
}

void require_index(const char* what, std::size_t index, std::size_t count)
{
    if (index < count) return;
    throw Refusal(RC_INVALID, std::string("there is no ") + what + " " + std::to_string(index) +
                                  "; found " + std::to_string(count) + " of them");
}

void require_solution(const rc_simulation& at, double t)
{
    if (!at.run->keeps_steps()) {
        throw Refusal(RC_INVALID,
                      "rc_solution: no step has been kept; expected the option record_steps, and "
                      "at least one step");
    }
    if (std::isnan(t)) throw Refusal(RC_INVALID, "rc_solution: t must be a time, got NaN");
}

void require_dimension(const char* what, std::size_t found, std::size_t expected)
{
    if (found == expected) return;
    throw Refusal(RC_INVALID, std::string(what) + ": found n = " + std::to_string(found) +
                                  "; expected " + std::to_string(expected) +
                                  ", the dimension of the system");
}

[[nodiscard]] rc_status evaluate(rc_simulation* simulation, double t, bool before, double* x,
                                 std::size_t n) noexcept
{
    return with(simulation, [&](const rc_simulation& at) {
        if (!x) throw_null("rc_solution, x");
        require_dimension("rc_solution", n, at.dimension);
        require_solution(at, t);
        at.run->solution(t, before, x);
    });
}

/// The texts of the library, which are string literals, end with a zero.
[[nodiscard]] const char* as_c(std::string_view literal) noexcept
{
    return literal.data();
}

[[nodiscard]] bool is_outcome(int code) noexcept
{
    return code >= 0 && code <= RC_STOPPED_BY_CALLBACK;
}

static_assert(static_cast<int>(Outcome::reached_end) == RC_REACHED_END &&
              static_cast<int>(Outcome::zeno) == RC_ZENO &&
              static_cast<int>(Outcome::non_finite) == RC_NON_FINITE &&
              static_cast<int>(Outcome::cancelled) == RC_CANCELLED &&
              static_cast<int>(Outcome::stalled) == RC_STALLED &&
              static_cast<int>(Outcome::stopped_by_callback) == RC_STOPPED_BY_CALLBACK);
static_assert(static_cast<int>(EventKind::accumulation) == RC_ACCUMULATION &&
              static_cast<int>(EventKind::jump) == RC_JUMP);
static_assert(no_guard == RC_NO_GUARD && time_event_reset == RC_TIME_EVENT_RESET);

}  // namespace

std::unique_ptr<AnyRun> make_run(std::shared_ptr<const CallbackSystem> system, const double* x0,
                                 const RunOptions& options)
{
    switch (system->dimension()) {
        case 1: return make_run_of_1(std::move(system), x0, options);
        case 2: return make_run_of_2(std::move(system), x0, options);
        case 3: return make_run_of_3(std::move(system), x0, options);
        case 4: return make_run_of_4(std::move(system), x0, options);
        default: return make_run_of_any(std::move(system), x0, options);
    }
}

}  // namespace ricochet::c

extern "C" {

rc_status rc_simulation_new(const rc_system* system, const double* x0, size_t n,
                            const rc_options* options, rc_simulation** simulation)
{
    return guarded([&] {
        if (!simulation) throw_null("rc_simulation_new, simulation");
        *simulation = nullptr;
        check_handle(system, Kind::system);
        if (!x0) throw_null("rc_simulation_new, x0");
        const std::shared_ptr<const CallbackSystem> of = system->system;
        require_dimension("rc_simulation_new", n, of->dimension());
        RunOptions read = read_options(options);
        require_memory(n);
        auto made = std::make_unique<rc_simulation>();
        made->dimension = n;
        read.options.cancelled = &made->cancelled;
        made->run = make_run(of, x0, read);
        *simulation = made.release();
    });
}

rc_status rc_simulation_free(rc_simulation* simulation)
{
    if (!simulation) return RC_OK;
    return guarded([&] {
        {
            const InUse in_use(simulation, Kind::simulation);
            simulation->run.reset();
        }
        retire(simulation, [](Handle* handle) { delete static_cast<rc_simulation*>(handle); });
    });
}

rc_status rc_step(rc_simulation* simulation, int* goes_on)
{
    return advance_by(simulation, goes_on, [](AnyRun& run) { return run.step(); });
}

rc_status rc_advance(rc_simulation* simulation, int* goes_on)
{
    return advance_by(simulation, goes_on, [](AnyRun& run) { return run.advance(); });
}

rc_status rc_run(rc_simulation* simulation)
{
    return advance_by(simulation, nullptr, [](AnyRun& run) {
        run.run_to_end();
        return false;
    });
}

rc_status rc_cancel(rc_simulation* simulation)
{
    return guarded([&] {
        check_handle(simulation, Kind::simulation);
        simulation->cancelled.store(true, std::memory_order_relaxed);
    });
}

rc_status rc_callback_failure(rc_simulation* simulation, rc_callback_error* error)
{
    const auto show = [&](const CallbackFailed& failed) {
        write_struct(error,
                     {.size = sizeof *error,
                      .code = failed.code,
                      .reserved = 0,
                      .callback = failed.callback,
                      .guard = failed.guard,
                      .t = failed.t},
                     "rc_callback_error");
    };
    if (!simulation) return guarded([&] { show(last_failed_callback()); });
    return with(simulation, [&](const rc_simulation& at) { show(at.failed); });
}

double rc_time(rc_simulation* simulation)
{
    return value_of(simulation, std::numeric_limits<double>::quiet_NaN(),
                    [](const rc_simulation& at) { return at.run->t(); });
}

const double* rc_state(rc_simulation* simulation)
{
    return value_of<const double*>(simulation, nullptr,
                                   [](const rc_simulation& at) { return at.run->x(); });
}

rc_mode rc_mode_now(rc_simulation* simulation)
{
    return value_of(simulation, std::numeric_limits<rc_mode>::max(),
                    [](const rc_simulation& at) { return at.run->mode(); });
}

rc_outcome_code rc_outcome(rc_simulation* simulation)
{
    return value_of(simulation, RC_RUNNING, [](const rc_simulation& at) {
        if (at.interrupted != RC_RUNNING) return at.interrupted;
        if (!at.run->ended()) return RC_RUNNING;
        return static_cast<rc_outcome_code>(at.run->outcome());
    });
}

const char* rc_outcome_name(rc_outcome_code outcome)
{
    if (outcome == RC_RUNNING) return "running";
    if (!is_outcome(outcome)) return "unknown";
    return as_c(ricochet::name(static_cast<ricochet::Outcome>(outcome)));
}

const char* rc_outcome_text(rc_outcome_code outcome)
{
    if (outcome == RC_RUNNING) return "the run has not ended";
    if (!is_outcome(outcome)) return "there is no such outcome";
    return as_c(ricochet::describe(static_cast<ricochet::Outcome>(outcome)));
}

rc_status rc_get_statistics(rc_simulation* simulation, rc_statistics* statistics)
{
    return with(simulation, [&](rc_simulation& at) {
        const AnyRun::Counts counts = at.run->counts();
        const ricochet::Statistics& from = counts.statistics;
        write_struct(statistics,
                     {.size = sizeof *statistics,
                      .steps = from.steps,
                      .rejected = from.rejected,
                      .refined_steps = from.refined_steps,
                      .unresolved_steps = from.unresolved_steps,
                      .resteps = from.resteps,
                      .flow_calls = from.flow_calls,
                      .guard_calls = from.guard_calls,
                      .network_calls = from.network_calls,
                      .late_events = from.late_events,
                      .checks_put_off = from.checks_put_off,
                      .outside_domain = from.outside_domain,
                      .bound_calls = from.bound_calls,
                      .rollbacks = from.rollbacks,
                      .repeated_steps = from.repeated_steps,
                      .events = from.events,
                      .suppressed = from.suppressed,
                      .disabled = from.disabled,
                      .proved = from.evidence.proved,
                      .checked = from.evidence.checked,
                      .gated = from.evidence.gated,
                      .assumed = from.evidence.assumed,
                      .guard = counts.guard,
                      .other_guard = counts.other_guard},
                     "rc_statistics");
    });
}

size_t rc_event_count(rc_simulation* simulation)
{
    return value_of(simulation, std::size_t{0},
                    [](const rc_simulation& at) { return at.run->events(); });
}

rc_status rc_event_at(rc_simulation* simulation, size_t index, rc_event* event)
{
    return with(simulation, [&](const rc_simulation& at) {
        require_index("event", index, at.run->events());
        const ShownEvent shown = at.run->event(index);
        write_struct(event,
                     {.size = sizeof *event,
                      .t = shown.t,
                      .guard = shown.guard,
                      .kind = static_cast<std::int32_t>(shown.kind),
                      .late = shown.late,
                      .mode_before = shown.mode_before,
                      .mode_after = shown.mode_after,
                      .before = shown.before,
                      .after = shown.after,
                      .bracket_lo = shown.bracket.lo,
                      .bracket_hi = shown.bracket.hi,
                      .slope = shown.slope,
                      .error = shown.error},
                     "rc_event");
    });
}

size_t rc_sample_count(rc_simulation* simulation)
{
    return value_of(simulation, std::size_t{0},
                    [](const rc_simulation& at) { return at.run->sample_times().size(); });
}

rc_status rc_sample_at(rc_simulation* simulation, size_t index, double* t, const double** x)
{
    return with(simulation, [&](const rc_simulation& at) {
        const auto& times = at.run->sample_times();
        require_index("sample", index, times.size());
        if (t) *t = times[index];
        if (x) *x = at.run->sample(index);
    });
}

rc_status rc_solution(rc_simulation* simulation, double t, double* x, size_t n)
{
    return evaluate(simulation, t, false, x, n);
}

rc_status rc_solution_before(rc_simulation* simulation, double t, double* x, size_t n)
{
    return evaluate(simulation, t, true, x, n);
}

rc_status rc_solution_mode(rc_simulation* simulation, double t, rc_mode* mode)
{
    return with(simulation, [&](const rc_simulation& at) {
        if (!mode) throw_null("rc_solution_mode, mode");
        require_solution(at, t);
        *mode = at.run->solution_mode(t);
    });
}

rc_status rc_save(rc_simulation* simulation, void* bytes, size_t* size)
{
    return with(simulation, [&](const rc_simulation& at) {
        if (!size) throw_null("rc_save, size");
        const std::string text = at.run->save();
        const std::size_t room = std::exchange(*size, text.size());
        if (!bytes) return;
        if (room < text.size()) {
            throw Refusal(RC_INVALID, "rc_save: found room for " + std::to_string(room) +
                                          " bytes; expected " + std::to_string(text.size()));
        }
        text.copy(static_cast<char*>(bytes), text.size());
    });
}

rc_status rc_restore(rc_simulation* simulation, const void* bytes, size_t size)
{
    return with(simulation, [&](rc_simulation& at) {
        if (!bytes) throw_null("rc_restore, bytes");
        at.run->restore({static_cast<const char*>(bytes), size});
        at.interrupted = RC_RUNNING;
    });
}
}
