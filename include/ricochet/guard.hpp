// Guards, scalar functions whose sign change marks an event, and events.
//
// A guard g(t, x) is positive inside a mode and zero on its event surface. Which
// side it is on is remembered as the side on which it was *armed*, not as its
// value at the start of a step: a ball that leaves the floor and is below it at
// the end of the step has bounced, although the guard was zero at the start.
//
// Guards are edge-triggered: one that lies beyond its surface already, at the start or
// when a mode begins, does not fire before it has returned. Only a `unilateral` guard,
// which bounds the motion, restricts where the state may be.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>
#include <type_traits>
#include <utility>

#include "ricochet/detail/arithmetic.hpp"

namespace ricochet {

/// The discrete state of a hybrid system, counted from 0. Systems name their modes
/// with an unscoped enumeration.
using Mode = std::uint32_t;

/// A guard of a system in one mode. Rates are with respect to the offset inside a step: in a run
/// backward in time they are the negative of dg/dt.
struct GuardInMode {
    std::size_t which = 0;
    Mode mode = 0;
    bool backward = false;
};

/// The sign change that counts as an event.
enum class Crossing {
    falling,  ///< positive, then zero or negative: leaving the mode
    rising,   ///< negative, then zero or positive
    either,
};

/// Side on which a guard was armed: its sign, or on its surface the sign of its first nonzero
/// derivative along the flow. On a plateau all of these vanish, and the side is still open.
enum class Side { below, plateau, above };

/// `Event::reaction` of an event that changes no reaction.
inline constexpr std::size_t no_reaction = static_cast<std::size_t>(-1);

/// Properties of a guard that a system declares.
struct GuardInfo {
    std::string_view name{};
    Crossing crossing = Crossing::falling;
    bool resets = true;            ///< false: events are only recorded
    std::uint32_t stop_after = 0;  ///< the run ends with this many events; 0: never
    bool unilateral = false;       ///< g >= 0 bounds the motion
    bool boolean = false;          ///< only the sign has a meaning: no rates, bisection
    int degree = 0;                ///< a polynomial of this degree in (t, x) together; 0: unknown
    double touch = 0;              ///< |g| up to which a zero of the rate is a touch; at least
                                   ///< 64 units in the last place of the guard's size
    /// It fires at the start of a run, and where its mode begins by a change of mode, if it is
    /// beyond its surface there, or on it and does not move inside. Not for `Crossing::either`.
    bool at_start = false;
    bool at_entry = false;
    /// Of a system with set_valued(): the reaction that is asked where events of this guard
    /// accumulate, press or contradict one another, or leave it on its surface with y at rest. Its
    /// y is the guard, or the guard's rate; found where it is the guard and none is named.
    std::size_t reaction = no_reaction;
};

namespace detail {

/// The side that a value lies on; plateau for zero.
[[nodiscard]] constexpr Side side_of(double value) noexcept
{
    return value > 0 ? Side::above : value < 0 ? Side::below : Side::plateau;
}

/// The other side of the surface; plateau for plateau.
[[nodiscard]] constexpr Side opposite(Side side) noexcept
{
    return side == Side::above ? Side::below : side == Side::below ? Side::above : Side::plateau;
}

/// Whether a guard armed on `side`, with the value `g`, has left that side: crossed its
/// surface or arrived on it. False for NaN and plateaus.
[[nodiscard]] constexpr bool has_left(Side side, double g) noexcept
{
    return (side == Side::above && g <= 0) || (side == Side::below && g >= 0);
}

/// Whether leaving `side` is the sign change that counts.
[[nodiscard]] constexpr bool counts(Side side, Crossing crossing) noexcept
{
    switch (crossing) {
        case Crossing::falling: return side == Side::above;
        case Crossing::rising: return side == Side::below;
        case Crossing::either: return side != Side::plateau;
    }
    return false;
}

}  // namespace detail

// An event: when a guard crossed its surface, and the states around it.

/// Kind of an event.
enum class EventKind : std::uint8_t {
    crossing,      ///< the guard changed sign
    touch,         ///< the guard reached its surface and turned back
    time,          ///< a time event
    accumulation,  ///< the limit of infinitely many events
    mode,          ///< a reaction went from one of its bounds to the other; of a guard: what its
                   ///< rest held has gone free
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
    /// The reaction of a stick, a slip or a mode of a system with set_valued(), else `no_reaction`.
    std::size_t reaction = no_reaction;
};

// The scalar of a system's functions as a template parameter.
//
// One template of a flow, a guard or a reset serves numbers, dual numbers (dual.hpp) and power
// series (taylor.hpp), if the time and the state have one scalar type, whatever it is. On arrays:
//
//     template <class S>
//     constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
//
// On states of any type, and on views of them:
//
//     template <class X>
//     constexpr void flow(const ScalarOf<X>& t, const X& x, X& dxdt) const
//     template <class X>
//     constexpr ScalarOf<X> guard(const ScalarOf<X>& t, const X& x) const
//     template <class X>
//     void reset(const ScalarOf<X>& t, X& x) const
//
// Functions are called by their bare names, `using std::cos; cos(x[0])`.

/// Type of the components of X.
template <class X>
using ScalarOf = std::remove_cvref_t<decltype(std::declval<const X&>()[0])>;

/// The guard at one time inside a step. The rate is NaN where it was not computed.
struct GuardSample {
    double s = 0;      ///< [s] offset from the start of the step
    double value = 0;  ///< g
    double rate = std::numeric_limits<double>::quiet_NaN();  ///< dg/ds along the flow
};

}  // namespace ricochet
