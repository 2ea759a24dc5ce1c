// Internal: the declarations of this header may change without notice.
//
// The numbers of guards and modes that a system declares, and the guards watched in a mode.
#pragma once

#include <concepts>
#include <cstddef>
#include <type_traits>

#include "ricochet/guard.hpp"

namespace ricochet {

/// The number of modes where the system declares it, else 0.
template <class System>
[[nodiscard]] constexpr std::size_t mode_count_of(const System& system)
{
    if constexpr (requires {
                      {
                          system.mode_count()
                          } -> std::convertible_to<std::size_t>;
                  }) {
        return static_cast<std::size_t>(system.mode_count());
    } else if constexpr (requires {
                             {
                                 system.mode_count
                                 } -> std::convertible_to<std::size_t>;
                         }) {
        return static_cast<std::size_t>(system.mode_count);
    } else {
        return 0;
    }
}

namespace detail {

template <class System>
concept CountsGuardsFixed = requires
{
    requires std::is_same_v<decltype(&System::guard_count), const std::size_t*>;
};

template <class System>
concept CountsGuardsByMember = !CountsGuardsFixed<System> && requires(const System& system)
{
    {
        system.guard_count
        } -> std::convertible_to<std::size_t>;
};

template <class System>
concept CountsGuardsByCall = !CountsGuardsFixed<System> && requires(const System& system)
{
    {
        system.guard_count()
        } -> std::convertible_to<std::size_t>;
};

template <class System>
concept CountsGuards =
    CountsGuardsFixed<System> || CountsGuardsByMember<System> || CountsGuardsByCall<System>;

/// Whether a guard is evaluated in a mode.
template <class System>
[[nodiscard]] constexpr bool call_enabled_in(const System& system,
                                             [[maybe_unused]] std::size_t which, Mode mode)
{
    if constexpr (CountsGuards<System> && requires {
                      {
                          system.enabled(which, mode)
                          } -> std::convertible_to<bool>;
                  }) {
        return system.enabled(which, mode);
    } else if constexpr (!CountsGuards<System> && requires {
                             {
                                 system.enabled(mode)
                                 } -> std::convertible_to<bool>;
                         }) {
        return system.enabled(mode);
    } else {
        return true;
    }
}

}  // namespace detail

}  // namespace ricochet
