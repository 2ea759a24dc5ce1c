// An event: when a guard crossed its surface, and the states around it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "ricochet/hybrid/guard.hpp"

namespace ricochet {

/// Kind of an event.
enum class EventKind : std::uint8_t {
    crossing,      ///< the guard changed sign
    touch,         ///< the guard reached its surface and turned back
    time,          ///< a time event
    accumulation,  ///< the limit of infinitely many events
    mode,          ///< a reaction went from one of its bounds to the other
    stick,         ///< a reaction at a bound began to hold
    slip,          ///< a reaction that held met a bound
    jump,          ///< the guard changed sign without a zero: it jumped, or has a pole there
};

/// The enumerator's name, e.g. "crossing".
[[nodiscard]] std::string_view name(EventKind kind) noexcept;

/// Whether a guard is on its other side after an event of this kind.
[[nodiscard]] constexpr bool changes_sign(EventKind kind) noexcept
{
    return kind == EventKind::crossing || kind == EventKind::jump;
}

/// `Event::guard` of an event without a guard.
inline constexpr std::size_t no_guard = static_cast<std::size_t>(-1);

/// `Run::other_guard` where the reset of a time event contradicts that of a guard.
inline constexpr std::size_t time_event_reset = static_cast<std::size_t>(-2);

/// Two times [s] between which the guard leaves its armed side: still on it at `lo`,
/// across the surface or on it at `hi`. They are located as offsets from the start
/// of a step, which resolve more than a time does: rounded to doubles the two are
/// often equal.
struct Bracket {
    double lo = 0;
    double hi = 0;
};

/// One event. `t` lies in `bracket`, at the best estimate of the guard's root, and `before` is
/// the state there: on its surface up to rounding, on either side. The events of a set have one
/// common time, that of the latest root or of a time event: for the others `t` may lie beyond
/// their own `bracket`, by no more than the window, and `before` as far beyond their surface as
/// the guard moves in that time.
template <class State>
struct Event {
    double t = 0;  ///< [s]
    EventKind kind = EventKind::crossing;
    std::size_t guard = 0;  ///< index of the guard, or `no_guard`
    Mode mode_before = 0;
    Mode mode_after = 0;
    State before{};     ///< x⁻
    State after{};      ///< x⁺, equal to x⁻ where there is no reset
    Bracket bracket;    ///< [s]
    double slope = 0;   ///< rate of the guard at the event, per second; NaN if not computed
    double error = 0;   ///< [s] error of location within the step, not of the solution
    bool late = false;  ///< found at a step after the one that held it
};

}  // namespace ricochet
