// Internal: the declarations of this header may change without notice.
//
// Modes of runs in phases: a mode of the system and, in the bits above it, the kind of phase.
#pragma once

#include "ricochet/guard.hpp"

namespace ricochet::detail {

/// Modes of the system lie below this.
inline constexpr Mode own_modes = Mode{1} << 24;

/// The mode of the system, without the kind of phase.
[[nodiscard]] constexpr Mode own_mode(Mode mode) noexcept
{
    return mode & (own_modes - 1);
}

/// The kind of phase. Kind 0 is the system's own flow.
[[nodiscard]] constexpr Mode kind_of_phase(Mode mode) noexcept
{
    return mode / own_modes;
}

}  // namespace ricochet::detail
