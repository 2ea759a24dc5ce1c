#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "bindings/c/handles.hpp"
#include "bindings/c/results.hpp"
#include "bindings/c/run.hpp"
#include "bindings/c/structs.hpp"
#include "bindings/c/system.hpp"

using namespace ricochet::c;

struct rc_simulation : Handle {
    static constexpr Kind kind_of = Kind::simulation;
    rc_simulation() : Handle(Kind::simulation) {}

    std::unique_ptr<AnyRun> run;
    std::size_t dimension = 0;
    std::atomic<bool> cancelled{false};  ///< cancellation was requested
    /// Why the last call that advanced the run did not finish: RC_RUNNING if it did.
    rc_outcome_code interrupted = RC_RUNNING;
    CallbackFailed failed;
    std::string description;  ///< what rc_describe has returned
};

namespace ricochet::c {

namespace {

/// Advances the run by `go`, which says whether it continues.
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

void require_solution(const rc_simulation& at, double t)
{
    if (!at.run->keeps_steps()) {
        throw Refusal(RC_INVALID,
                      "rc_solution: no step has been kept; expected the option record_steps, and "
                      "at least one step");
    }
    if (std::isnan(t)) throw Refusal(RC_INVALID, "rc_solution: t must be a time, got NaN");
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
    return (code >= 0 && code <= RC_STOPPED_BY_CALLBACK) || code == RC_NOT_HANDED_OVER ||
           code == RC_LAW_VIOLATED || code == RC_SEVERAL;
}

static_assert(static_cast<int>(Outcome::reached_end) == RC_REACHED_END &&
              static_cast<int>(Outcome::zeno) == RC_ZENO &&
              static_cast<int>(Outcome::non_finite) == RC_NON_FINITE &&
              static_cast<int>(Outcome::cancelled) == RC_CANCELLED &&
              static_cast<int>(Outcome::stalled) == RC_STALLED &&
              static_cast<int>(Outcome::stopped_by_callback) == RC_STOPPED_BY_CALLBACK &&
              static_cast<int>(Outcome::not_handed_over) == RC_NOT_HANDED_OVER &&
              static_cast<int>(Outcome::law_violated) == RC_LAW_VIOLATED &&
              static_cast<int>(Outcome::several) == RC_SEVERAL);

}  // namespace

std::unique_ptr<AnyRun> make_run(std::shared_ptr<const CallbackSystem> system, const double* x0,
                                 const RunOptions& options)
{
    return system->dimension() <= ricochet::detail::SmallState::room
               ? make_run_of_small(std::move(system), x0, options)
               : make_run_of_any(std::move(system), x0, options);
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
    if (!simulation) return guarded([&] { write_failure(error, last_failed_callback()); });
    return with(simulation, [&](const rc_simulation& at) { write_failure(error, at.failed); });
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

const char* rc_reason(rc_simulation* simulation)
{
    return value_of<const char*>(simulation, "",
                                 [](const rc_simulation& at) { return at.run->reason().c_str(); });
}

const char* rc_describe(rc_simulation* simulation)
{
    return value_of<const char*>(simulation, "", [](rc_simulation& at) {
        at.description = at.run->description();
        if (!at.run->ended()) {
            const std::string unset(ricochet::describe(ricochet::Outcome::reached_end));
            at.description.replace(0, unset.size(), "the run has not ended");
        }
        return at.description.c_str();
    });
}

rc_status rc_get_statistics(rc_simulation* simulation, rc_statistics* statistics)
{
    return with(simulation,
                [&](rc_simulation& at) { write_statistics(statistics, at.run->counts()); });
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
        write_event(event, at.run->event(index));
    });
}

size_t rc_phase_count(rc_simulation* simulation)
{
    return value_of(simulation, std::size_t{0},
                    [](const rc_simulation& at) { return at.run->phases().size(); });
}

rc_status rc_phase_at(rc_simulation* simulation, size_t index, rc_phase* phase)
{
    return with(simulation, [&](const rc_simulation& at) {
        const auto& phases = at.run->phases();
        require_index("phase", index, phases.size());
        write_phase(phase, phases[index]);
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

rc_status rc_reaction(rc_simulation* simulation, const double** r, size_t* m)
{
    return with(simulation, [&](rc_simulation& at) {
        if (!r || !m) throw_null("rc_reaction, r or m");
        try {
            const auto& reaction = at.run->reaction();
            *r = reaction.data();
            *m = reaction.size();
        } catch (const CallbackFailed& failed) {
            at.failed = failed;
            throw;
        }
    });
}

rc_status rc_reaction_at(rc_simulation* simulation, size_t index, const double** r, size_t* m)
{
    return with(simulation, [&](const rc_simulation& at) {
        if (!r || !m) throw_null("rc_reaction_at, r or m");
        require_index("sample", index, at.run->sample_times().size());
        static const std::vector<double> none;
        const auto& rows = at.run->reactions();
        const auto& reaction = rows.empty() ? none : rows[index];
        *r = reaction.data();
        *m = reaction.size();
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
    return with(simulation, [&](rc_simulation& at) {
        if (!size) throw_null("rc_save, size");
        try {
            write_snapshot("rc_save", at.run->save(), bytes, size);
        } catch (const CallbackFailed& failed) {
            at.failed = failed;
            throw;
        }
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

rc_status rc_restart(rc_simulation* simulation, double t, const double* x, size_t n, rc_mode mode)
{
    return with(simulation, [&](rc_simulation& at) {
        if (!x) throw_null("rc_restart, x");
        require_dimension("rc_restart", n, at.dimension);
        try {
            at.run->restart(t, x, mode);
        } catch (const CallbackFailed& failed) {
            at.failed = failed;
            throw;
        }
        at.interrupted = RC_RUNNING;
    });
}

rc_status rc_extend(rc_simulation* simulation, double t_end)
{
    return with(simulation, [&](rc_simulation& at) {
        at.run->extend(t_end);
        at.interrupted = RC_RUNNING;
    });
}
}
