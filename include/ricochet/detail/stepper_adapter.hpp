// Internal: the declarations of this header may change without notice.
//
// Data of a run with a user-defined stepper, in addition to the system.
#pragma once

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/system_adapter.hpp"
#include "ricochet/methods.hpp"

namespace ricochet::detail {

/// @throws std::invalid_argument: a stepper would compute states of `made` components.
[[noreturn]] inline void throw_state_not_resizable(std::size_t components, std::size_t made)
{
    throw std::invalid_argument(
        "integrate: a user-defined stepper makes states by default and resizes them; found a state "
        "without resize(), of " +
        std::to_string(components) + " components, and " + std::to_string(made) + " by default");
}

/// @throws std::invalid_argument: a stepper is not a method for departures from the tangent.
[[noreturn]] inline void throw_not_for_departures()
{
    throw std::invalid_argument(
        "integrate: a user-defined stepper is given departures from the tangent of the motion "
        "(ricochet/odeint.hpp), and this one does not take the same step with them; it must pass "
        "to the flow the time of every stage, and treat all states alike");
}

/// The state after a step of a user-defined stepper in any of odeint's forms.
template <class Stepper, class X, class Flow>
[[nodiscard]] X end_of_step(Stepper& stepper, const Flow& flow, const X& x, double t, double h)
{
    X out = x;
    X rate = x;
    flow(x, rate, t);
    if constexpr (is_fsal<Stepper>) {
        X rate_there = x;
        stepper.do_step(flow, x, rate, t, out, rate_there, h);
    } else if constexpr (requires { stepper.do_step(flow, x, rate, t, out, h); }) {
        stepper.do_step(flow, x, rate, t, out, h);
    } else if constexpr (requires { stepper.do_step(flow, x, t, out, h); }) {
        stepper.do_step(flow, x, t, out, h);
    } else {
        stepper.do_step(flow, out, t, h);
    }
    return out;
}

/// Checks that a step of the state and a step of its departure from the tangent are the same, as
/// they are for Runge-Kutta methods, and that nothing is left of the step before, for some motion
/// of states like this one.
/// @throws std::invalid_argument
template <class Stepper, class X>
void check_departures(const X& like)
{
    constexpr double t = 0.7, h = 0.2;  // [s] a step in which all terms of a method count
    constexpr double tolerance = 1e-5;  // above the error of implicit stages, below any term
    const auto flow = [](const X& x, X& dxdt, double at) {
        const std::size_t n = static_cast<std::size_t>(x.size());
        for_each_component(x, [&](auto i) {
            const auto next = (static_cast<std::size_t>(i) + 1) % n;
            dxdt[i] = std::cos(x[i] + 0.5 * x[static_cast<decltype(i)>(next)] + at);
        });
    };
    Stepper departing{};
    X x = like;
    X tangent = like;
    X room = like;
    for (const double start : {0.3, -0.6}) {
        for_each_component(
            x, [&](auto i) { x[i] = start + 0.1 * static_cast<double>(i % decltype(i){7}); });
        flow(x, tangent, t);
        const auto departure = [&](const X& w, X& rate, double s) {
            for_each_component(x, [&](auto i) { room[i] = x[i] + (s * tangent[i] + w[i]); });
            flow(room, rate, t + s);
            for_each_component(x, [&](auto i) { rate[i] -= tangent[i]; });
        };
        X zero = x;
        for_each_component(zero, [&](auto i) { zero[i] = 0; });
        const X w = end_of_step(departing, departure, zero, 0, h);
        Stepper whole{};
        const X end = end_of_step(whole, flow, x, t, h);
        for_each_component(x, [&](auto i) {
            const double difference = end[i] - (x[i] + (h * tangent[i] + w[i]));
            if (!(std::fabs(difference) <= tolerance)) throw_not_for_departures();
        });
    }
}

/// A adapter with the data of a user-defined stepper.
template <class System, class X, class Method>
struct StepperAdapter : SystemAdapter<System, X> {
    using Stepper = typename Method::template Stepper<X>;

    /// @throws std::invalid_argument if states can be neither made nor resized to the size of
    /// `like`, or the stepper does not take steps of departures
    StepperAdapter(const System& system, const X& like) : SystemAdapter<System, X>(system, like)
    {
        if constexpr (fixed_size<X>() == 0 && !requires(X & x) { x.resize(0); }) {
            const auto made = static_cast<std::size_t>(X{}.size());
            const auto components = static_cast<std::size_t>(like.size());
            if (made != components) throw_state_not_resizable(components, made);
        }
        check_departures<Stepper>(like);
    }

    Stepper advancing{};
    Stepper probing{};
};
template <class System, class X, class Method>
requires(NameOf<Method>::known ||
         std::is_same_v<Method, MethodByName>) struct StepperAdapter<System, X, Method>
    : SystemAdapter<System, X> {
    using SystemAdapter<System, X>::SystemAdapter;
};

}  // namespace ricochet::detail
