// Internal: the declarations of this header may change without notice.
//
// Derivatives of flow and resets along a direction of state and time by dual numbers, for functions
// that take any scalar (guard.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/dual_rate.hpp"
#include "ricochet/detail/scalar_probe.hpp"
#include "ricochet/detail/scratch.hpp"
#include "ricochet/dual.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::detail {

template <class S>
using VectorOf = std::vector<S>;

/// States like X with components of type S: arrays, or vectors where the size is known at run time.
template <class X, class S>
using WithScalar =
    std::conditional_t<(fixed_size<X>() > 0), std::array<S, fixed_size<X>()>, VectorOf<S>>;

template <class System, class X>
inline constexpr bool flow_takes_duals = [] {
    constexpr std::size_t n = fixed_size<X>();
    if constexpr (n > 0) {
        return FlowOfScalars<System, ArraysOf<n>::template Of>;
    } else {
        return FlowOfScalars<System, VectorOf>;
    }
}();

template <class System, class X, class... Which>
inline constexpr bool reset_takes_duals = [] {
    constexpr std::size_t n = fixed_size<X>();
    if constexpr (n > 0) {
        return ResetOfScalars<System, ArraysOf<n>::template Of, Which...>;
    } else {
        return ResetOfScalars<System, VectorOf, Which...>;
    }
}();

template <class System, class X>
inline constexpr bool time_reset_takes_duals = [] {
    constexpr std::size_t n = fixed_size<X>();
    if constexpr (n > 0) {
        return TimeResetOfScalars<System, ArraysOf<n>::template Of>;
    } else {
        return TimeResetOfScalars<System, VectorOf>;
    }
}();

/// The flow with a scalar S.
template <class System, class S, class X>
[[gnu::always_inline]] inline void flow_of_scalar(const System& system, [[maybe_unused]] Mode mode,
                                                  const S& t, const X& x, X& dxdt)
{
    if constexpr (requires { system.flow(mode, t, x, dxdt); }) {
        system.flow(mode, t, x, dxdt);
    } else {
        system.flow(t, x, dxdt);
    }
}

/// ds = (df/dx) s + (df/dt) dt along a direction.
template <class System, class X>
void flow_by_duals(const System& system, const Along<X>& at, X& ds)
{
    using D = Dual<1>;
    const X &x = at.x, &s = at.s;
    Scratch<WithScalar<X, D>, 2> room(x);
    for_each_component(x, [&](auto i) { room[0][static_cast<std::size_t>(i)] = {x[i], {s[i]}}; });
    flow_of_scalar(system, at.mode, D(at.t, {at.dt}), room[0], room[1]);
    for_each_component(x, [&](auto i) { ds[i] = room[1][static_cast<std::size_t>(i)].slope[0]; });
}

/// The slopes of the flow of dual numbers over any scalar S, at a time whose slope is zero.
template <class System, class S, class Duals, class Xs>
void flow_along_by_duals(const System& system, Mode mode, const S& t, const Duals& state, Xs& ds)
{
    Duals rate = state;
    flow_of_scalar(system, mode, Dual<1, S>(t, {S(0.0)}), state, rate);
    for (std::size_t i = 0; i < state.size(); ++i) ds[i] = rate[i].slope[0];
}

/// The state before a reset, and the derivative of its time in the direction in which the reset is
/// differentiated.
template <class X>
struct BeforeReset {
    Mode mode;
    double t;  ///< [s]
    double dt;
    const X& x;
};

/// The state x as dual numbers whose slopes are s.
template <class S = double, class X>
[[nodiscard]] WithScalar<X, Dual<1, S>> dual_state(const X& x, const X& s)
{
    WithScalar<X, Dual<1, S>> state{};
    if constexpr (fixed_size<X>() == 0) state.resize(static_cast<std::size_t>(x.size()));
    for_each_component(x, [&](auto i) { state[static_cast<std::size_t>(i)] = {x[i], {s[i]}}; });
    return state;
}

/// Writes the slopes of the state into s.
template <class X>
void put_slopes(const WithScalar<X, Dual<1>>& state, X& s)
{
    if constexpr (fixed_size<X>() == 0) s.resize(static_cast<decltype(s.size())>(state.size()));
    for_each_component(s, [&](auto i) { s[i] = state[static_cast<std::size_t>(i)].slope[0]; });
}

/// s becomes (dR/dx) s + (dR/dt) dt, where R is the reset of a guard or of a set of guards.
template <class System, class X, class... Which>
void reset_by_duals(const System& system, const BeforeReset<X>& at, X& s, const Which&... which)
{
    const Dual<1> time(at.t, {at.dt});
    auto state = dual_state(at.x, s);
    if constexpr (requires { system.reset(which..., at.mode, time, state); }) {
        static_cast<void>(system.reset(which..., at.mode, time, state));
    } else {
        system.reset(which..., time, state);
    }
    put_slopes(state, s);
}

/// The same for the reset at a time event.
template <class System, class X>
void time_reset_by_duals(const System& system, const BeforeReset<X>& at, X& s)
{
    const Dual<1> time(at.t, {at.dt});
    auto state = dual_state(at.x, s);
    if constexpr (requires { system.time_reset(at.mode, time, state); }) {
        static_cast<void>(system.time_reset(at.mode, time, state));
    } else {
        system.time_reset(time, state);
    }
    put_slopes(state, s);
}

/// Whether the curvature of the only guard of a system without modes follows from nested duals.
template <class System, class X>
inline constexpr bool curvature_takes_duals = [] {
    if constexpr (fixed_size<X>() > 0 && requires(const System& s, double t, const X& x, X& f) {
                      s.guard(t, x);
                      s.flow(t, x, f);
                  }) {
        return flow_takes_duals<System, X> && GuardOfScalarArrays<System, fixed_size<X>()>;
    } else {
        return false;
    }
}();

/// d2g/dt2 along the flow.
template <class System, class X>
[[nodiscard]] double curvature_by_duals(const System& system, double t, const X& x)
{
    using D = Dual<1, Dual<1>>;
    X f = x;
    X rate = x;
    system.flow(t, x, f);
    flow_by_duals(system, Along{Mode{0}, t, x, f}, rate);
    WithScalar<X, D> state{};
    for_each_component(x, [&](auto i) {
        state[static_cast<std::size_t>(i)] = {{x[i], {f[i]}}, {Dual<1>(f[i], {rate[i]})}};
    });
    return guard_of_scalar(system, 0, 0, D({t, {1}}, {Dual<1>(1, {0})}), state).slope[0].slope[0];
}

}  // namespace ricochet::detail
