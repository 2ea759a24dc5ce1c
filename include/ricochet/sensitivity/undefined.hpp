// Reasons why a derivative through an event does not exist.
#pragma once

#include <cstdint>
#include <string_view>

namespace ricochet {

/// Reason for which a derivative does not exist.
enum class Undefined : std::uint8_t {
    no,                ///< it exists
    grazing,           ///< the guard's rate vanishes: neighbouring motions miss the surface
    simultaneous,      ///< events at one time whose order matters: one derivative per order
    off_surface,       ///< the event was found away from its surface
    boolean_guard,     ///< the guard has only a sign
    time_event_jumps,  ///< a time event that cannot be followed when the parameter changes
    non_finite,        ///< a derivative of the system is NaN or infinite
};

/// The enumerator's name, e.g. "grazing".
[[nodiscard]] std::string_view name(Undefined reason) noexcept;

/// One sentence, with the remedy where there is one.
[[nodiscard]] std::string_view describe(Undefined reason) noexcept;

}  // namespace ricochet
