// What a hybrid system is: a value that declares only what it has.
//
//     flow(t, x, dxdt)          x' = f(t, x)                       always
//     guard(t, x)               g, positive inside the mode        for events
//     guard_rate(t, x, dxdt)    dg/dt along the flow               optional
//     guard_curvature(t, x)     d2g/dt2 along the flow             for some networks
//     reset(t, x)               x⁻ becomes x⁺, in place            optional
//     crossing                  which sign change counts           default: falling
//     unilateral                g >= 0 bounds the motion           default: false
//     name, parameter(name)     what it is                         for networks
//     State                     state type when none is given      optional
//
// All functions are const and free of side effects; t is in seconds. A system
// without a guard is integrated as a plain ordinary differential equation: none
// of the machinery of events is compiled in.
#pragma once

#include <concepts>
#include <cstddef>

#include "ricochet/hybrid/guard.hpp"

namespace ricochet {

/// States are vectors of double: `std::array`, `std::vector`, and fixed or
/// dynamic Eigen vectors.
template <class X>
concept StateVector = std::copyable<X> && requires(X& x, const X& y, std::size_t i) {
    { x[i] } -> std::convertible_to<double&>;
    { y[i] } -> std::convertible_to<double>;
    { y.size() } -> std::convertible_to<std::size_t>;
};

/// x' = f(t, x): `flow` writes every component of `dxdt`.
template <class System, class X>
concept Flowing = requires(const System& system, double t, const X& x, X& dxdt) {
    system.flow(t, x, dxdt);
};

/// One guard, a scalar function of time and state.
template <class System, class X>
concept Guarded = Flowing<System, X> && requires(const System& system, double t, const X& x) {
    { system.guard(t, x) } -> std::convertible_to<double>;
};

/// The guard's rate dg/dt + (dg/dx) x' is known in closed form.
template <class System, class X>
concept RatedGuard = Guarded<System, X> && requires(const System& system, double t, const X& x) {
    { system.guard_rate(t, x, x) } -> std::convertible_to<double>;
};

/// Something happens at an event: `reset` replaces x⁻ by x⁺.
template <class System, class X>
concept Resetting = Guarded<System, X> && requires(const System& system, double t, X& x) {
    system.reset(t, x);
};

namespace detail {

/// A member that is there but does not fit would be passed over in silence: a guard
/// that is not const, a reset that takes its state by value. These say so instead.
/// (Members that are templates have no address and are not looked at.)
template <class System, class X>
constexpr void check_declarations()
{
    if constexpr (requires { &System::guard; }) {
        static_assert(Guarded<System, X>,
                      "ricochet: guard must be callable as guard(double t, const State& x) on a "
                      "const system and return a number");
    }
    if constexpr (requires { &System::guard_rate; }) {
        static_assert(RatedGuard<System, X>,
                      "ricochet: guard_rate must be callable as guard_rate(double t, const State& "
                      "x, const State& dxdt) on a const system and return a number");
    }
    if constexpr (requires { &System::reset; }) {
        static_assert(Resetting<System, X>,
                      "ricochet: reset must be callable as reset(double t, State& x) on a const "
                      "system, and needs a guard");
    }
    if constexpr (Resetting<System, X>) {
        static_assert(!requires(const System& system, double t) { system.reset(t, X{}); },
                      "ricochet: reset changes the state in place, so it must take it by reference");
    }
}

}  // namespace detail

/// The sign change of the guard that counts.
template <class System>
[[nodiscard]] constexpr Crossing crossing_of(const System& system) noexcept
{
    if constexpr (requires { { system.crossing } -> std::convertible_to<Crossing>; }) {
        return system.crossing;
    } else {
        return Crossing::falling;
    }
}

/// Whether the guard is a constraint that no trajectory may violate, as a rigid
/// floor is: a run may not start below it, and motion that is on the surface and
/// heads below meets its event at once.
template <class System>
[[nodiscard]] constexpr bool is_unilateral(const System& system) noexcept
{
    if constexpr (requires { { system.unilateral } -> std::convertible_to<bool>; }) {
        return system.unilateral;
    } else {
        return false;
    }
}

}  // namespace ricochet
