// Bounds that a system may declare on how fast its guards change.
//
//     speed_bound(which, t, x)         upper bound of the path per second at (t, x), now
//     acceleration_bound(which, t, x)  bound on the change of that speed per second, optional
//     lipschitz(which)                 change of the guard per unit of path, default 1
//     lower_bound(which, t, x)         guard >= lower_bound, cheap and proved, optional
//     upper_bound(which, t, x)         guard <= upper_bound, correspondingly for a guard that is
//                                      armed below its surface, optional
//
// `path` is any measure of the motion that the system chooses: the path length of a ball's
// centre, the largest path length of any point of a body. A guard that depends on time explicitly
// counts that change as path, too. A system with modes takes the mode before t. A system without
// `guard_count` may leave out `which`; one with it may leave out both, where its guards
// share a bound.
//
// `acceleration_bound` holds from here on, for the flow as it is integrated, until the
// next event of any guard or of time, and in both directions: the speed neither grows nor
// falls faster. Where a guard is examined over several steps the flow is followed
// without a reset, so that it should also hold a little beyond an event surface. Without
// it, `speed_bound` holds for the whole motion until the next event.
//
// `Planned` relies on bounds being true. A bound that is NaN, negative or infinite
// covers nothing.
#pragma once

#include <concepts>
#include <cstddef>

#include "ricochet/detail/declarations.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

namespace detail {

/// Calls `function` in whichever form the system has: with guard and mode, one of them, or none.
template <class System, class Function, class... Arguments>
[[nodiscard]] constexpr double call_bound(const Function& function, [[maybe_unused]] std::size_t which,
                                          [[maybe_unused]] Mode mode, const Arguments&... arguments)
{
    if constexpr (requires { function(which, mode, arguments...); }) {
        return function(which, mode, arguments...);
    } else if constexpr (CountsGuards<System> && requires { function(which, arguments...); }) {
        return function(which, arguments...);
    } else if constexpr (!CountsGuards<System> && requires { function(mode, arguments...); }) {
        return function(mode, arguments...);
    } else {
        return function(arguments...);
    }
}

template <class System, class X>
concept HasSpeedBound = requires(const System& s, double t, const X& x) { { s.speed_bound(t, x) } -> std::convertible_to<double>; } ||
    requires(const System& s, std::size_t which, double t, const X& x) { { s.speed_bound(which, t, x) } -> std::convertible_to<double>; } ||
    requires(const System& s, std::size_t which, Mode mode, double t, const X& x) { { s.speed_bound(which, mode, t, x) } -> std::convertible_to<double>; };

template <class System, class X>
concept HasAccelerationBound = requires(const System& s, double t, const X& x) { { s.acceleration_bound(t, x) } -> std::convertible_to<double>; } ||
    requires(const System& s, std::size_t which, double t, const X& x) { { s.acceleration_bound(which, t, x) } -> std::convertible_to<double>; } ||
    requires(const System& s, std::size_t which, Mode mode, double t, const X& x) { { s.acceleration_bound(which, mode, t, x) } -> std::convertible_to<double>; };

template <class System, class X>
concept HasLowerBound = requires(const System& s, double t, const X& x) { { s.lower_bound(t, x) } -> std::convertible_to<double>; } ||
    requires(const System& s, std::size_t which, double t, const X& x) { { s.lower_bound(which, t, x) } -> std::convertible_to<double>; } ||
    requires(const System& s, std::size_t which, Mode mode, double t, const X& x) { { s.lower_bound(which, mode, t, x) } -> std::convertible_to<double>; };

template <class System, class X>
concept HasUpperBound = requires(const System& s, double t, const X& x) { { s.upper_bound(t, x) } -> std::convertible_to<double>; } ||
    requires(const System& s, std::size_t which, double t, const X& x) { { s.upper_bound(which, t, x) } -> std::convertible_to<double>; } ||
    requires(const System& s, std::size_t which, Mode mode, double t, const X& x) { { s.upper_bound(which, mode, t, x) } -> std::convertible_to<double>; };

}  // namespace detail

/// A system that bounds how fast its guards change.
template <class System, class X>
concept BoundedGuards = Guarded<System, X> && detail::HasSpeedBound<System, X>;

namespace detail {

template <class System>
[[nodiscard]] constexpr double call_lipschitz(const System& system, [[maybe_unused]] std::size_t which)
{
    if constexpr (requires { { system.lipschitz(which) } -> std::convertible_to<double>; }) {
        return system.lipschitz(which);
    } else if constexpr (requires { { system.lipschitz() } -> std::convertible_to<double>; }) {
        return system.lipschitz();
    } else {
        return 1;
    }
}

template <class System, class X>
[[nodiscard]] double call_speed_bound(const System& system, std::size_t which, Mode mode, double t, const X& x)
{
    const auto call = [&](const auto&... at) -> double requires requires { system.speed_bound(at...); } { return system.speed_bound(at...); };
    return call_bound<System>(call, which, mode, t, x);
}

/// The acceleration bound; 0 if the speed bound holds for the whole motion.
template <class System, class X>
[[nodiscard]] double call_acceleration_bound(const System& system, std::size_t which, Mode mode, double t, const X& x)
{
    if constexpr (HasAccelerationBound<System, X>) {
        const auto call = [&](const auto&... at) -> double requires requires { system.acceleration_bound(at...); } { return system.acceleration_bound(at...); };
        return call_bound<System>(call, which, mode, t, x);
    } else {
        return 0;
    }
}

template <class System, class X>
[[nodiscard]] double call_lower_bound(const System& system, std::size_t which, Mode mode, double t, const X& x)
{
    const auto call = [&](const auto&... at) -> double requires requires { system.lower_bound(at...); } { return system.lower_bound(at...); };
    return call_bound<System>(call, which, mode, t, x);
}

template <class System, class X>
[[nodiscard]] double call_upper_bound(const System& system, std::size_t which, Mode mode, double t, const X& x)
{
    const auto call = [&](const auto&... at) -> double requires requires { system.upper_bound(at...); } { return system.upper_bound(at...); };
    return call_bound<System>(call, which, mode, t, x);
}

/// Rejects bounds that are declared but do not fit, like `check_declarations`.
template <class System, class X>
constexpr void check_bound_declarations()
{
#define RICOCHET_IN_ORDER(name)                                                                      \
    static_assert(!CountsGuards<System> ||                                                           \
                      requires(const System& s, Only<std::size_t> which, Only<Mode> mode, double t, const X& x) { s.name(which, mode, t, x); } || \
                      !requires(const System& s, Only<std::size_t> which, Only<Mode> mode, double t, const X& x) { s.name(mode, which, t, x); }, \
                  "ricochet: found a " #name " that takes the Mode before the number of the guard; "   \
                  "expected double " #name "([which,] [Mode,] double t, const State& x) const");
    RICOCHET_IN_ORDER(speed_bound)
    RICOCHET_IN_ORDER(acceleration_bound)
    RICOCHET_IN_ORDER(lower_bound)
    RICOCHET_IN_ORDER(upper_bound)
#undef RICOCHET_IN_ORDER
    if constexpr (requires { &System::speed_bound; }) {
        static_assert(BoundedGuards<System, X>, "ricochet: speed_bound must be callable as speed_bound([which,] [mode,] double t, const State& x) on a const system and return a number, and needs a guard");
    }
    if constexpr (requires { &System::acceleration_bound; }) {
        static_assert(HasAccelerationBound<System, X> && BoundedGuards<System, X>, "ricochet: acceleration_bound must be callable as acceleration_bound([which,] [mode,] double t, const State& x) on a const system, and needs a speed_bound");
    }
    if constexpr (requires { &System::lower_bound; }) {
        static_assert(HasLowerBound<System, X> && BoundedGuards<System, X>, "ricochet: lower_bound must be callable as lower_bound([which,] [mode,] double t, const State& x) on a const system, and needs a speed_bound");
    }
    if constexpr (requires { &System::upper_bound; }) {
        static_assert(HasUpperBound<System, X> && BoundedGuards<System, X>, "ricochet: upper_bound must be callable as upper_bound([which,] [mode,] double t, const State& x) on a const system, and needs a speed_bound");
    }
}

}  // namespace detail

}  // namespace ricochet
