// The life of a guard: whether it has an event where it is armed.
//
// A guard is armed at the start of a run and after every set of events, on the side of its surface
// on which it lies or to which it heads. What brought it there, what it declares and what is seen
// of it decide whether that is an event, by the first row of `rows` that fits; every row is a
// promise. The engine only finds out what is seen: the rounding of values, rates and times.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet::detail::life {

/// Why a guard is armed.
enum class Cause : std::uint8_t {
    start,    ///< a run starts
    stood,    ///< others have had their events
    fired,    ///< it has had its own
    enabled,  ///< a mode begins that enables it
    opened,   ///< a veto of its event has ended
};
inline constexpr std::size_t causes = 5;

/// What is known of a guard where it is armed, each as one bit.
enum Fact : unsigned {
    is_unilateral = 1,  ///< it bounds the motion
    has_reset = 2,
    on_surface = 4,   ///< within its error
    is_below = 8,     ///< it lies below, or heads there
    crosses = 16,     ///< it is now on the other side, and to leave the side where it was counts
    arrives = 32,     ///< it heads away from a side that it leaves by an event
    is_set_off = 64,  ///< the set has changed the flow, which did not carry it across before
    asks = 128,       ///< it is beyond its surface, and is asked to fire by that condition here
};
inline constexpr unsigned facts = 256;

/// What follows.
enum class Arming : std::uint8_t {
    waits,         ///< it is armed where it is
    fires,         ///< its event is at this instant
    by_condition,  ///< the same, though it has not crossed
    outside,       ///< the motion is where it must not be
};

/// A row of the table: it fits if the cause is one of `causes`, all facts of `needs` hold, and none
/// of `forbids`.
struct Row {
    unsigned causes;
    unsigned needs, forbids;
    Arming arming;
    std::string_view promise;
};

[[nodiscard]] constexpr unsigned by(Cause cause) noexcept
{
    return 1u << static_cast<unsigned>(cause);
}
inline constexpr unsigned again = by(Cause::fired) | by(Cause::enabled);
inline constexpr unsigned whenever = (1u << causes) - 1;

inline constexpr std::array rows{
    Row{whenever, is_set_off, 0, Arming::fires,
        "a flow that a set has changed, and that now presses across the surface, fires it"},
    Row{whenever, asks, 0, Arming::by_condition,
        "beyond its surface it fires where at_start or at_entry asks for it"},
    // guards that bound the motion
    Row{by(Cause::start) | again, is_unilateral | is_below, on_surface, Arming::outside,
        "no start, no reset and no mode leaves the motion behind a surface that bounds it"},
    Row{by(Cause::start) | again | by(Cause::opened), is_unilateral | is_below | on_surface, 0,
        Arming::fires, "a motion that presses on a surface that bounds it fires again"},
    // the others fire where they are crossed
    Row{by(Cause::stood), crosses, 0, Arming::fires,
        "a reset that carries it across in its direction fires it at the same instant"},
    Row{by(Cause::fired), crosses, has_reset | on_surface, Arming::fires,
        "carried back across by the reset of another, it fires again"},
    Row{by(Cause::enabled) | by(Cause::opened), arrives | on_surface, 0, Arming::fires,
        "where its mode begins, or a veto ends, on its surface while it crosses, it fires"},
    Row{whenever, 0, 0, Arming::waits,
        "else it waits for its next crossing, beyond its surface for its return"},
};

/// Number of the first row that fits.
[[nodiscard]] constexpr std::size_t row_of(Cause cause, unsigned known) noexcept
{
    std::size_t row = 0;
    for (; row + 1 < rows.size(); ++row) {
        const Row& fits = rows[row];
        const bool all = (known & fits.needs) == fits.needs && (known & fits.forbids) == 0;
        if (all && (fits.causes & by(cause)) != 0) break;
    }
    return row;
}

/// All of them, so that none is searched for in a run.
inline constexpr auto armings = [] {
    std::array<std::array<Arming, facts>, causes> all{};
    for (std::size_t cause = 0; cause < causes; ++cause) {
        for (unsigned known = 0; known < facts; ++known) {
            all[cause][known] = rows[row_of(static_cast<Cause>(cause), known)].arming;
        }
    }
    return all;
}();

[[nodiscard]] constexpr Arming arming_of(Cause cause, unsigned known) noexcept
{
    return armings[static_cast<std::size_t>(cause)][known];
}

/// What a guard declares.
[[nodiscard]] constexpr unsigned declared_of(const GuardInfo& info, bool resets)
{
    return (info.unilateral ? is_unilateral : 0u) | (resets ? has_reset : 0u);
}

/// What is seen of a guard that was `from` on one side, or came from there to its plateau, and now
/// lies on `to` or heads there.
[[nodiscard]] constexpr unsigned seen_of(Side from, Side to, bool on, Crossing crossing)
{
    const bool crossed = to != Side::plateau && to == opposite(from) && counts(from, crossing);
    return (on ? on_surface : 0u) | (to == Side::below ? is_below : 0u) | (crossed ? crosses : 0u) |
           (counts(opposite(to), crossing) ? arrives : 0u);
}

/// The side whose departure is the event of a guard that stands on its surface.
[[nodiscard]] constexpr Side awaited_side(Cause cause, const GuardInfo& info, Side from) noexcept
{
    if (info.unilateral) return Side::above;
    if (cause == Cause::start || cause == Cause::fired) return Side::plateau;
    if (cause != Cause::enabled || info.crossing == Crossing::either) return from;
    return info.crossing == Crossing::falling ? Side::above : Side::below;
}

}  // namespace ricochet::detail::life
