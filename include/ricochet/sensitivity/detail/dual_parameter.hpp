// Internal: the declarations of this header may change without notice.
//
// Derivatives of a system's functions by a parameter, by dual numbers.
#pragma once

#include <concepts>
#include <cstddef>
#include <span>
#include <type_traits>
#include <utility>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/dual_derivatives.hpp"
#include "ricochet/detail/scalar_probe.hpp"
#include "ricochet/dual.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/sensitivity/directions.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

/// The components, as a state of the scalar S that does not depend on the parameter.
template <class X, class S, class Component>
[[nodiscard]] WithScalar<X, S> still_state(const Component* x, std::size_t n)
{
    WithScalar<X, S> state{};
    if constexpr (fixed_size<X>() == 0) state.resize(n);
    for (std::size_t i = 0; i < n; ++i) state[i] = S(x[i], {Component(0.0)});
    return state;
}

template <class System, class T, class Xs>
concept FlowAt = requires(const System& system, const T& t, const Xs& x, Xs& f)
{
    system.flow(t, x, f);
}
|| requires(const System& system, const T& t, const Xs& x, Xs& f)
{
    system.flow(Mode{}, t, x, f);
};

template <class System, class T, class Xs>
concept GuardAt = requires(const System& system, const T& t, const Xs& x)
{
    requires GuardReturns<System, T, Xs, T>;
};

/// Applies the reset of all guards that fired, with a scalar T. False: there is none for T.
template <class System, class T, class Xs>
[[nodiscard]] bool reset_of_scalar([[maybe_unused]] const System& system,
                                   [[maybe_unused]] const FiredGuards& fired,
                                   [[maybe_unused]] Mode mode, [[maybe_unused]] const T& t,
                                   [[maybe_unused]] Xs& x)
{
    if constexpr (requires { system.reset(fired, mode, t, x); }) {
        static_cast<void>(system.reset(fired, mode, t, x));
        return true;
    } else if constexpr (requires { system.reset(fired, t, x); }) {
        system.reset(fired, t, x);
        return true;
    } else {
        if (fired.size() != 1 || fired.time_event()) return false;
        if constexpr (requires { system.reset(fired[0], mode, t, x); }) {
            static_cast<void>(system.reset(fired[0], mode, t, x));
            return true;
        } else if constexpr (CountsGuards<System> && requires { system.reset(fired[0], t, x); }) {
            system.reset(fired[0], t, x);
            return true;
        } else if constexpr (requires { system.reset(mode, t, x); }) {
            static_cast<void>(system.reset(mode, t, x));
            return true;
        } else if constexpr (requires { system.reset(t, x); }) {
            system.reset(t, x);
            return true;
        } else {
            return false;
        }
    }
}

template <class S, class Make>
concept IsComplete = requires
{
    sizeof(S);
};

/// The derivative of the flow as a power series, of scalar R.
template <class X, class R, class Make>
[[nodiscard]] auto series_by_duals(const Make& make, double nominal)
{
    return [make, nominal](Mode mode, const R& t, const R* x, std::size_t n, R* df) {
        using Series = Dual<1, R>;
        const auto system = make(Series(R(nominal), {R(1.0)}));
        const auto state = still_state<X, Series>(x, n);
        auto rate = state;
        flow_of_scalar(system, mode, Series(t, {R(0.0)}), state, rate);
        for (std::size_t i = 0; i < n; ++i) df[i] = rate[i].slope[0];
    };
}

/// @param make  builds the system with a parameter of any scalar
template <class System, class X, class Make>
[[nodiscard]] ParameterDerivatives derivatives_by_duals(const Make& make, double nominal)
{
    using D = Dual<1>;
    using Made = decltype(make(D{}));
    using States = WithScalar<X, D>;
    ParameterDerivatives exact;
    if constexpr (FlowAt<Made, D, States>) {
        exact.flow = [make, nominal](Mode mode, double t, std::span<const double> x,
                                     std::span<double> df) {
            const auto system = make(D(nominal, {1.0}));
            const States state = still_state<X, D>(x.data(), x.size());
            States rate = state;
            flow_of_scalar(system, mode, D(t), state, rate);
            for (std::size_t i = 0; i < x.size(); ++i) df[i] = rate[i].slope[0];
        };
    }
    if constexpr (FlowAt<Made, D, States> && IsComplete<Recorded, Make>) {
        exact.flow_series = series_by_duals<X, Recorded>(make, nominal);
    }
    if constexpr (GuardAt<Made, D, States>) {
        exact.guard = [make, nominal](std::size_t which, Mode mode, double t,
                                      std::span<const double> x) {
            const auto system = make(D(nominal, {1.0}));
            const States state = still_state<X, D>(x.data(), x.size());
            return guard_of_scalar(system, which, mode, D(t), state).slope[0];
        };
    }
    exact.reset = [make, nominal](const FiredGuards& fired, Mode mode, double t,
                                  std::span<const double> x, std::span<double> by) {
        const auto system = make(D(nominal, {1.0}));
        States state = still_state<X, D>(x.data(), x.size());
        if (!reset_of_scalar(system, fired, mode, D(t), state)) return false;
        if (state.size() != by.size()) return false;
        for (std::size_t i = 0; i < by.size(); ++i) by[i] = state[i].slope[0];
        return true;
    };
    return exact;
}

}  // namespace ricochet::detail

namespace ricochet {

/// A parameter of a system that is a template over the parameter's scalar: flow, guards and resets
/// are differentiated by it with dual numbers, without differences, where they are templates over
/// their scalar.
///
///     parameter<Swing<double>>([](auto length) { return Swing<decltype(length)>{length}; }, 1.0)
///
/// With `Taylor` the derivative of the flow is a power series if `ricochet/taylor/taylor.hpp` is
/// included. Differences are taken of functions that are no such templates, of resets of several
/// guards without a common one, of `rest`, and of time events that move with the parameter.
///
/// @tparam System  the system that is run, made with a number
/// @param make     the system with a parameter of any scalar
/// @param nominal  value of the parameter in the system that is run
/// @throws std::invalid_argument, when a run is set up: see `Parameter`
template <class System, class Make>
requires std::convertible_to<std::invoke_result_t<const Make&, double>, System>
[[nodiscard]] Parameter<System> parameter(Make make, double nominal)
{
    static_assert(
        requires { make(Dual<1>{}); },
        "ricochet: found a parameter whose system is made with a number only; expected a "
        "function of any scalar, as [](auto p) { return System<decltype(p)>{p}; }");
    Parameter<System> parameter;
    parameter.nominal = nominal;
    parameter.exact = detail::derivatives_by_duals<System, typename System::State>(make, nominal);
    parameter.with = [make = std::move(make)](double value) -> System { return make(value); };
    return parameter;
}

}  // namespace ricochet
