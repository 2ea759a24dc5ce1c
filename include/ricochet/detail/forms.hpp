// Internal: the declarations of this header may change without notice.
//
// The forms in which a system may write a function, and the call in the form that it has: with the
// number of the guard or without it, with the mode or without it. What comes behind these is stated
// once for each function, in a type whose `fits` tells what the function may take first.
#pragma once

#include <concepts>
#include <cstddef>
#include <limits>
#include <span>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/counts.hpp"
#include "ricochet/detail/dual_rate.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/times.hpp"

namespace ricochet {

class FiredGuards;

namespace detail {

/// What a function takes first.
enum class Form {
    absent,            ///< the system has no such function
    of_guard_in_mode,  ///< the number of the guard, then the mode
    of_guard,
    in_mode,
    plain,
};

[[nodiscard]] constexpr bool takes_mode(Form form) noexcept
{
    return form == Form::of_guard_in_mode || form == Form::in_mode;
}

/// The form of a function of the whole system. `Function::fits<...>` tells whether it takes these
/// first; `middle` are those that it takes in any form.
template <class Function, class... Middle>
[[nodiscard]] constexpr Form form_of_system() noexcept
{
    if constexpr (Function::template fits<Middle..., Mode>) {
        return Form::in_mode;
    } else if constexpr (Function::template fits<Middle...>) {
        return Form::plain;
    } else {
        return Form::absent;
    }
}

/// The form of a function of one guard, which has a number where the system counts its guards.
template <class Function, class System, class... Middle>
[[nodiscard]] constexpr Form form_of_guard() noexcept
{
    if constexpr (!CountsGuards<System>) {
        return form_of_system<Function, Middle...>();
    } else if constexpr (Function::template fits<std::size_t, Middle..., Mode>) {
        return Form::of_guard_in_mode;
    } else if constexpr (Function::template fits<std::size_t, Middle...>) {
        return Form::of_guard;
    } else {
        return Form::absent;
    }
}

/// Calls a function in its form.
template <Form form, class Call, class... Middle>
[[gnu::always_inline]] inline decltype(auto) call_in([[maybe_unused]] std::size_t which,
                                                     [[maybe_unused]] Mode mode, const Call& call,
                                                     const Middle&... middle)
{
    if constexpr (form == Form::of_guard_in_mode) {
        return call(which, middle..., mode);
    } else if constexpr (form == Form::of_guard) {
        return call(which, middle...);
    } else if constexpr (form == Form::in_mode) {
        return call(middle..., mode);
    } else {
        return call(middle...);
    }
}

/// Calls a function that returns the mode after it where it takes the one before it.
template <Form form, class Call, class... Middle>
[[nodiscard, gnu::always_inline]] inline Mode mode_after(std::size_t which, Mode mode,
                                                         const Call& call, const Middle&... middle)
{
    if constexpr (takes_mode(form)) {
        return call_in<form>(which, mode, call, middle...);
    } else {
        call_in<form>(which, mode, call, middle...);
        return mode;
    }
}

/// The result of a function that returns the next mode where it takes the mode.
template <class Result, class... First>
concept FollowsMode = !(std::same_as<First, Mode> || ...) || std::convertible_to<Result, Mode>;

// --- flow ---

template <class System, class X>
struct FlowFunction {
    template <class... First>
    static constexpr bool fits =
        requires(const System& system, double t, const X& x, X& dxdt, First... first) {
            system.flow(first..., t, x, dxdt);
        };
};
template <class System, class X>
inline constexpr Form flow_form = form_of_system<FlowFunction<System, X>>();

// --- guards; x may be any view of a state ---

template <class System, class X>
struct GuardFunction {
    template <class... First>
    static constexpr bool fits = requires(const System& system, double t, const X& x, First... first) {
        { system.guard(first..., t, x) } -> std::convertible_to<double>;
    };
};
template <class System, class X>
inline constexpr Form guard_form = form_of_guard<GuardFunction<System, X>, System>();

template <class System, class X>
struct GuardsFunction {
    template <class... First>
    static constexpr bool fits = CountsGuards<System> &&
        requires(const System& system, double t, const X& x, std::span<double> g, First... first) {
            system.guards(first..., t, x, g);
        };
};
template <class System, class X>
inline constexpr Form guards_form = form_of_system<GuardsFunction<System, X>>();

/// The system can evaluate one guard without the others.
template <class System, class X>
concept GuardAlone = guard_form<System, X> != Form::absent;

/// The system evaluates all guards in one call.
template <class System, class X>
concept GuardsTogether = guards_form<System, X> != Form::absent;

/// The guards of the system are bool: only their signs have a meaning.
template <class System, class X>
concept BooleanGuard = GuardAlone<System, X> &&
    (requires(const System& system, Mode mode, double t, const X& x) { { system.guard(std::size_t{}, mode, t, x) } -> std::same_as<bool>; } ||
     requires(const System& system, Mode mode, double t, const X& x) { { system.guard(mode, t, x) } -> std::same_as<bool>; } ||
     requires(const System& system, double t, const X& x) { { system.guard(t, x) } -> std::same_as<bool>; });

// --- rates ---

template <class System, class X, class D>
struct RateFunction {
    template <class... First>
    static constexpr bool fits = requires(const System& system, double t, const X& x, const D& dxdt, First... first) {
        { system.guard_rate(first..., t, x, dxdt) } -> std::convertible_to<double>;
    };
};
template <class System, class X, class D = X>
inline constexpr Form rate_form = form_of_guard<RateFunction<System, X, D>, System>();

template <class System, class X>
struct RatesFunction {
    template <class... First>
    static constexpr bool fits = CountsGuards<System> &&
        requires(const System& system, double t, const X& x, std::span<double> rates, First... first) {
            system.guard_rates(first..., t, x, x, rates);
        };
};
template <class System, class X>
inline constexpr Form rates_form = form_of_system<RatesFunction<System, X>>();

/// The system computes the rate of one guard.
template <class System, class X, class D = X>
concept RateWritten = rate_form<System, X, D> != Form::absent;

/// The system computes the rate of one guard, or dual numbers derive it from the guard.
template <class System, class X, class D = X>
concept RateAlone = RateWritten<System, X, D> || RateByDuals<System, X>;

template <class System, class X>
concept RatesTogether = rates_form<System, X> != Form::absent;

// --- resets ---

/// `reset` of one guard, of one with the direction of its crossing, and of all that fired.
template <class System, class X>
struct ResetFunction {
    template <class... First>
    static constexpr bool fits = requires(const System& system, double t, X& x, First... first) {
        { system.reset(first..., t, x) } -> FollowsMode<First...>;
    };
};
template <class System, class X>
inline constexpr Form reset_form = form_of_guard<ResetFunction<System, X>, System>();
template <class System, class X>
inline constexpr Form directed_reset_form = form_of_guard<ResetFunction<System, X>, System, Crossing>();
template <class System, class X>
[[nodiscard]] constexpr Form find_set_reset_form() noexcept
{
    constexpr Form form = form_of_system<ResetFunction<System, X>, const FiredGuards&>();
    return form == Form::plain && !CountsGuards<System> ? Form::absent : form;
}
template <class System, class X>
inline constexpr Form set_reset_form = find_set_reset_form<System, X>();

/// The reset asks in which direction the guard has crossed.
template <class System, class X>
concept DirectedReset = directed_reset_form<System, X> != Form::absent;

template <class System, class X>
concept ResetsAlone = DirectedReset<System, X> || reset_form<System, X> != Form::absent;

template <class System, class X>
concept ResetsTogether = set_reset_form<System, X> != Form::absent;

/// A system that decides its mode again after the resets of every set, of guards or a time event:
/// `fired` led from the mode and the state `before` to x, and may still move x. For systems of the
/// library.
template <class System, class X>
concept DecidesAfterSets = requires(const System& system, const FiredGuards& fired, Mode mode, double t, const X& before, X& x) {
    { system.after_set(fired, mode, t, before, x) } -> std::convertible_to<Mode>;
};

// --- rest ---

template <class System, class X>
struct RestFunction {
    template <class... First>
    static constexpr bool fits = requires(const System& system, double t, X& x, First... first) {
        { system.rest(first..., t, x) } -> FollowsMode<First...>;
    };
};
template <class System, class X>
inline constexpr Form rest_form = form_of_guard<RestFunction<System, X>, System>();

/// A system whose `rest` has an answer only for guards for which `rests(which, other)` holds, where
/// their events accumulate together with those of another one, or of `no_guard`. For systems of the
/// library.
template <class System>
concept RestsAtSome = requires(const System& system, std::size_t which) {
    { system.rests(which, which) } -> std::same_as<bool>;
};

// --- properties of guards ---

template <class System>
concept InfoOf = requires(const System& system, std::size_t which) {
    { system.guard_info(which) } -> std::convertible_to<GuardInfo>;
};

template <class System>
concept SingleInfo = !CountsGuards<System> && requires(const System& system) {
    { system.guard_info() } -> std::convertible_to<GuardInfo>;
};

/// Whether a guard is examined depends on the mode.
template <class System>
concept EnabledIn =
    (CountsGuards<System> && requires(const System& system, std::size_t which, Mode mode) { { system.enabled(which, mode) } -> std::convertible_to<bool>; }) ||
    (!CountsGuards<System> && requires(const System& system, Mode mode) { { system.enabled(mode) } -> std::convertible_to<bool>; });

template <class System, class X>
struct EnabledFunction {
    template <class... First>
    static constexpr bool fits = requires(const System& system, double t, const X& x, First... first) {
        { system.enabled(first..., t, x) } -> std::convertible_to<bool>;
    };
};
template <class System, class X>
inline constexpr Form enabled_form = form_of_guard<EnabledFunction<System, X>, System>();

/// Whether a crossing is an event depends on the state there.
template <class System, class X>
concept EnabledAt = enabled_form<System, X> != Form::absent;

// --- time events ---

template <class System>
concept TimedBackward = requires(const System& system, double t) {
    { system.previous_time_event(t) } -> std::convertible_to<double>;
};

template <class System>
concept TimedByFunction = requires(const System& system, double t) {
    { system.next_time_event(t) } -> std::convertible_to<double>;
};

template <class System>
concept ListsTimesAsMember = requires(const System& system) {
    { system.time_events } -> std::same_as<const Times&>;
};

template <class System>
concept ListsTimesByCall = requires(const System& system) {
    { system.time_events() } -> std::same_as<const Times&>;
};

/// A system whose time events are `Times`.
template <class System>
concept ListsTimes = ListsTimesAsMember<System> || ListsTimesByCall<System>;

template <class System, class X>
struct TimerFunction {
    template <class... First>
    static constexpr bool fits = requires(const System& system, double t, const X& x, First... first) {
        { system.next_time_event(first..., t, x) } -> std::convertible_to<double>;
    };
};
template <class System, class X>
inline constexpr Form timer_form = form_of_system<TimerFunction<System, X>>();

template <class System, class X>
struct TimeResetFunction {
    template <class... First>
    static constexpr bool fits = requires(const System& system, double t, X& x, First... first) {
        { system.time_reset(first..., t, x) } -> FollowsMode<First...>;
    };
};
template <class System, class X>
inline constexpr Form time_reset_form = form_of_system<TimeResetFunction<System, X>>();

template <class System, class X>
concept TimeResetting = time_reset_form<System, X> != Form::absent;

// --- calls in whichever form a system has ---

/// Computes x' into `dxdt`. A flow that changes the dimension of `dxdt` is in error: then `dxdt` is
/// filled with NaN in the dimension of x, so that nothing is read beyond its end, and the
/// result is false.
template <class System, class X>
[[gnu::always_inline]] inline bool call_flow(const System& system, [[maybe_unused]] Mode mode, double t, const X& x, X& dxdt)
{
    if constexpr (flow_form<System, X> == Form::in_mode) {
        system.flow(mode, t, x, dxdt);
    } else {
        system.flow(t, x, dxdt);
    }
    if constexpr (fixed_size<X>() == 0) {
        if (dxdt.size() != x.size()) [[unlikely]] {
            dxdt = x;
            for_each_component(x, [&](auto i) { dxdt[i] = std::numeric_limits<double>::quiet_NaN(); });
            return false;
        }
    }
    return true;
}

/// Whether a reset may produce `after` from the state `before`.
template <class System, class X>
[[nodiscard]] constexpr bool fits_dimension(const X& before, const X& after, bool same_mode) noexcept
{
    if constexpr (fixed_size<X>() > 0 || requires { requires System::changes_dimension; }) {
        return true;
    } else {
        return after.size() >= before.size() || !same_mode;
    }
}

[[nodiscard]] constexpr double as_guard_value(bool inside) noexcept { return inside ? 1 : -1; }
[[nodiscard]] constexpr double as_guard_value(double g) noexcept { return g; }
template <std::integral Number>
[[nodiscard]] constexpr double as_guard_value(Number g) noexcept { return static_cast<double>(g); }

/// Value of one guard. X may be a view.
template <class System, class X>
[[gnu::always_inline]] [[nodiscard]] inline double call_guard(const System& system, [[maybe_unused]] std::size_t which, [[maybe_unused]] Mode mode, double t, const X& x)
{
    constexpr Form form = guard_form<System, X>;
    if constexpr (form == Form::of_guard_in_mode) {
        return as_guard_value(system.guard(which, mode, t, x));
    } else if constexpr (form == Form::of_guard) {
        return as_guard_value(system.guard(which, t, x));
    } else if constexpr (form == Form::in_mode) {
        return as_guard_value(system.guard(mode, t, x));
    } else {
        return as_guard_value(system.guard(t, x));
    }
}

/// Values of all guards, into `g`.
template <class System, class X>
[[gnu::always_inline]] inline void call_guards(const System& system, [[maybe_unused]] Mode mode, double t, const X& x, std::span<double> g)
{
    if constexpr (guards_form<System, X> == Form::in_mode) {
        system.guards(mode, t, x, g);
    } else if constexpr (guards_form<System, X> == Form::plain) {
        system.guards(t, x, g);
    } else {
        for (std::size_t which = 0; which < g.size(); ++which) {
            g[which] = call_guard(system, which, mode, t, x);
        }
    }
}

/// The rate of one guard along a motion.
template <class System, class X, class D>
[[gnu::always_inline]] [[nodiscard]] inline double call_rate(const System& system, [[maybe_unused]] std::size_t which, const Along<X, D>& at)
{
    constexpr Form form = rate_form<System, X, D>;
    if constexpr (form == Form::absent) {
        return rate_by_duals(system, which, at);
    } else if constexpr (form == Form::of_guard_in_mode) {
        return system.guard_rate(which, at.mode, at.t, at.x, at.s);
    } else if constexpr (form == Form::of_guard) {
        return system.guard_rate(which, at.t, at.x, at.s);
    } else if constexpr (form == Form::in_mode) {
        return system.guard_rate(at.mode, at.t, at.x, at.s);
    } else {
        return system.guard_rate(at.t, at.x, at.s);
    }
}

template <class System, class X>
inline void call_rates(const System& system, const Along<X>& at, std::span<double> rates)
{
    if constexpr (rates_form<System, X> == Form::in_mode) {
        system.guard_rates(at.mode, at.t, at.x, at.s, rates);
    } else {
        system.guard_rates(at.t, at.x, at.s, rates);
    }
}

/// Applies the reset of one guard, which has crossed in a direction; returns the mode after it.
template <class System, class X>
[[nodiscard]] Mode call_reset(const System& system, std::size_t which, [[maybe_unused]] Crossing direction, Mode mode, double t, X& x)
{
    const auto reset = [&](auto... first) { return system.reset(first..., t, x); };
    if constexpr (DirectedReset<System, X>) {
        return mode_after<directed_reset_form<System, X>>(which, mode, reset, direction);
    } else {
        return mode_after<reset_form<System, X>>(which, mode, reset);
    }
}

/// The same where the direction is not known.
template <class System, class X>
[[nodiscard]] Mode call_reset(const System& system, std::size_t which, Mode mode, double t, X& x)
{
    static_assert(!DirectedReset<System, X>,
                  "ricochet: found a reset that takes the direction of a crossing, where it is not known; expected a reset without it");
    return call_reset(system, which, Crossing::falling, mode, t, x);
}

/// Applies the reset of all guards that fired; returns the mode after it.
template <class System, class X>
[[nodiscard]] Mode call_reset_set(const System& system, const FiredGuards& fired, Mode mode, double t, X& x)
{
    const auto reset = [&](auto... in_mode) { return system.reset(fired, in_mode..., t, x); };
    return mode_after<set_reset_form<System, X>>(0, mode, reset);
}

template <class System, class X>
[[nodiscard]] Mode call_rest(const System& system, std::size_t which, Mode mode, double t, X& x)
{
    const auto rest = [&](auto... first) { return system.rest(first..., t, x); };
    return mode_after<rest_form<System, X>>(which, mode, rest);
}

template <class System>
[[nodiscard]] const Times& times_of(const System& system)
{
    if constexpr (ListsTimesAsMember<System>) {
        return system.time_events;
    } else {
        return system.time_events();
    }
}

/// The first time event after t, whichever way the system declares it.
template <class System>
[[nodiscard]] double call_next_time_event(const System& system, double t)
{
    if constexpr (ListsTimes<System>) {
        return times_of(system).next(t);
    } else {
        return system.next_time_event(t);
    }
}

template <class System, class X>
[[nodiscard]] double call_timer(const System& system, Mode mode, double t, const X& x)
{
    return call_in<timer_form<System, X>>(
        0, mode, [&](auto... in_mode) { return system.next_time_event(in_mode..., t, x); });
}

template <class System, class X>
[[nodiscard]] Mode call_time_reset(const System& system, Mode mode, double t, X& x)
{
    if constexpr (TimeResetting<System, X>) {
        return mode_after<time_reset_form<System, X>>(
            0, mode, [&](auto... in_mode) { return system.time_reset(in_mode..., t, x); });
    } else {
        return mode;
    }
}

/// Whether a crossing at (t, x) is an event.
template <class System, class X>
[[nodiscard]] bool call_enabled_at(const System& system, [[maybe_unused]] std::size_t which, [[maybe_unused]] Mode mode, double t, const X& x)
{
    if constexpr (EnabledAt<System, X>) {
        return call_in<enabled_form<System, X>>(
            which, mode, [&](auto... first) { return system.enabled(first..., t, x); });
    } else {
        return true;
    }
}

}  // namespace detail

}  // namespace ricochet
