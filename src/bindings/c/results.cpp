#include "bindings/c/results.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <new>
#include <string>
#include <utility>

#include "bindings/c/structs.hpp"

namespace ricochet::c {

static_assert(static_cast<int>(EventKind::accumulation) == RC_ACCUMULATION &&
              static_cast<int>(EventKind::mode) == RC_MODE &&
              static_cast<int>(EventKind::jump) == RC_JUMP);
static_assert(static_cast<int>(EventKind::stick) == RC_STICK &&
              static_cast<int>(EventKind::slip) == RC_SLIP && no_reaction == RC_NO_REACTION);
static_assert(no_guard == RC_NO_GUARD && time_event_reset == RC_TIME_EVENT_RESET);

void write_event(rc_event* event, const ShownEvent& from)
{
    write_struct(event,
                 {.size = sizeof *event,
                  .t = from.t,
                  .guard = from.guard,
                  .kind = static_cast<std::int32_t>(from.kind),
                  .late = from.late,
                  .mode_before = from.mode_before,
                  .mode_after = from.mode_after,
                  .before = from.before,
                  .after = from.after,
                  .bracket_lo = from.bracket.lo,
                  .bracket_hi = from.bracket.hi,
                  .slope = from.slope,
                  .error = from.error,
                  .reaction = from.reaction},
                 "rc_event");
}

void write_phase(rc_phase* phase, const MotionPhase& from)
{
    write_struct(phase,
                 {.size = sizeof *phase,
                  .from = from.from,
                  .set_valued = from.set_valued,
                  .cause = static_cast<std::int32_t>(from.cause)},
                 "rc_phase");
}

void write_statistics(rc_statistics* statistics, const Counts& counts)
{
    const Statistics& from = counts.statistics;
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
                  .checks_deferred = from.checks_deferred,
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
                  .other_guard = counts.other_guard,
                  .unmet_conditions = from.unmet_conditions,
                  .ineffective_resets = from.ineffective_resets,
                  .declined_guard = from.declined_guard,
                  .either_relays = from.either_relays,
                  .relay_guard = from.relay_guard,
                  .armed_beyond = from.armed_beyond},
                 "rc_statistics");
}

void write_failure(rc_callback_error* error, const CallbackFailed& failed)
{
    write_struct(error,
                 {.size = sizeof *error,
                  .code = failed.code,
                  .reserved = 0,
                  .callback = failed.callback,
                  .guard = failed.guard,
                  .t = failed.t},
                 "rc_callback_error");
}

void write_snapshot(const char* function, std::string_view text, void* bytes, std::size_t* size)
{
    const std::size_t room = std::exchange(*size, text.size());
    if (!bytes) return;
    if (room < text.size()) {
        throw Refusal(RC_INVALID, std::string(function) + ": found room for " +
                                      std::to_string(room) + " bytes; expected " +
                                      std::to_string(text.size()));
    }
    text.copy(static_cast<char*>(bytes), text.size());
}

void require_index(const char* what, std::size_t index, std::size_t count)
{
    if (index < count) return;
    throw Refusal(RC_INVALID, std::string("there is no ") + what + " " + std::to_string(index) +
                                  "; found " + std::to_string(count) + " of them");
}

void require_dimension(const char* what, std::size_t found, std::size_t expected)
{
    if (found == expected) return;
    throw Refusal(RC_INVALID, std::string(what) + ": found n = " + std::to_string(found) +
                                  "; expected " + std::to_string(expected) +
                                  ", the dimension of the system");
}

void require_finite(const char* function, const char* what, const double* x, std::size_t n)
{
    constexpr std::uint64_t exponent = 0x7ff0000000000000;
    bool finite = true;
    for (std::size_t i = 0; i < n; ++i) {
        finite &= (std::bit_cast<std::uint64_t>(x[i]) & exponent) != exponent;
    }
    if (finite) return;
    const auto which = std::find_if(x, x + n, [](double at) { return !std::isfinite(at); }) - x;
    throw Refusal(RC_INVALID, std::string(function) + ": " + what + " must be finite, got " +
                                  std::to_string(x[which]) + " in component " +
                                  std::to_string(which));
}

void require_memory(std::size_t dimension)
{
    constexpr std::size_t arrays = 48;
    constexpr std::size_t large = 1'000'000;
    if (dimension < large) return;
    if (dimension > std::numeric_limits<std::size_t>::max() / (2 * arrays * sizeof(double))) {
        throw std::bad_alloc();
    }
    const std::size_t bytes = dimension * arrays * sizeof(double);
    void* volatile room = ::operator new(bytes, std::nothrow);  // volatile: not optimised away
    if (!room) throw std::bad_alloc();
    ::operator delete(room);
}

}  // namespace ricochet::c
