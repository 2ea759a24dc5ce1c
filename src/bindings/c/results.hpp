// Results of runs and monitors, in the structs of C.
#pragma once

#include <cstddef>
#include <string_view>

#include "bindings/c/error.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/run.hpp"

namespace ricochet::c {

/// An event with pointers to its states.
struct ShownEvent {
    double t = 0;
    EventKind kind = EventKind::crossing;
    std::size_t guard = 0;
    Mode mode_before = 0, mode_after = 0;
    const double* before = nullptr;  ///< null if the state was not kept
    const double* after = nullptr;
    Bracket bracket;
    double slope = 0, error = 0;
    bool late = false;
    std::size_t reaction = no_reaction;
};

template <class X>
[[nodiscard]] ShownEvent shown(const Event<X>& event) noexcept
{
    return {.t = event.t,
            .kind = event.kind,
            .guard = event.guard,
            .mode_before = event.mode_before,
            .mode_after = event.mode_after,
            .before = event.before.size() > 0 ? event.before.data() : nullptr,
            .after = event.after.size() > 0 ? event.after.data() : nullptr,
            .bracket = event.bracket,
            .slope = event.slope,
            .error = event.error,
            .late = event.late,
            .reaction = event.reaction};
}

struct Counts {
    Statistics statistics;
    std::size_t guard = no_guard, other_guard = no_guard;
};

// All of these throw Refusal if the struct is invalid.
void write_event(rc_event* event, const ShownEvent& from);
void write_phase(rc_phase* phase, const MotionPhase& from);
void write_statistics(rc_statistics* statistics, const Counts& from);
void write_failure(rc_callback_error* error, const CallbackFailed& from);

/// Sets `*size`, and writes the text if `bytes` is not null.
/// @throws Refusal if the buffer is too small.
void write_snapshot(const char* function, std::string_view text, void* bytes, std::size_t* size);

/// @throws Refusal
void require_index(const char* what, std::size_t index, std::size_t count);
/// @throws Refusal
void require_dimension(const char* function, std::size_t found, std::size_t expected);

/// @throws Refusal naming the component of `what` that is NaN or infinite.
void require_finite(const char* function, const char* what, const double* x, std::size_t n);

/// Checks that there is memory for a run: a loop has some forty arrays of the dimension of the
/// state. It is better to fail before the first of them is written to.
/// @throws std::bad_alloc
void require_memory(std::size_t dimension);

}  // namespace ricochet::c
