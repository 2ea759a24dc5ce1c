// Hybrid systems: values that declare only the functions that they have.
//
//     flow(t, x, dxdt)          x' = f(t, x)                       always
//     guard(t, x)               g, positive inside the mode        for events
//     guard_rate(t, x, dxdt)    dg/dt along the flow               optional; not needed where
//                                                                  the guard takes any scalar
//                                                                  (guard.hpp)
//     guard_curvature(t, x)     d2g/dt2 along the flow             for networks that use it
//     reset(t, x)               x⁻ becomes x⁺, in place            optional
//     rest(t, x)                where infinitely many events end   optional
//     crossing                  which sign change counts           default: falling
//     unilateral                g >= 0 bounds the motion           default: false
//     guard_info()              both and more, as a GuardInfo      instead of these two
//     name, parameter(name)     identification                     for networks
//     State                     state type when none is given      optional
//
// A system with many guards declares `guard_count`, a constant or a member, and each
// function of a guard first takes the index of the guard:
//
//     guard(which, t, x)        or guards(t, x, g), all of them together into a
//                               std::span<double>, or both
//     guard_rate(which, t, x, dxdt)    or guard_rates(t, x, dxdt, rates)
//     reset(which, t, x)        or reset(fired, t, x) for all that fired together
//                               (any reset of one guard may take the direction of the crossing
//                               before t or the mode: Crossing::falling or Crossing::rising)
//     rest(which, t, x)
//     guard_info(which)         GuardInfo: name, crossing, whether it resets, ...
//     enabled(which, t, x)      whether a crossing here and now is an event
//
// A system with modes takes the mode in any of these functions, before t, and its
// reset and rest return the next mode:
//
//     flow(mode, t, x, dxdt), guard(which, mode, t, x), Mode reset(which, mode, t, x), ...
//     enabled(which, mode)      whether the guard is examined in that mode
//     mode_count, mode_name(mode)
//
// A reset may also change the dimension of a state that is sized at run time: longer at any
// time, shorter together with the mode, or, in a system that declares it, at any time, too:
//
//     static constexpr bool changes_dimension = true
//
// Events at known times:
//
//     Times time_events         a list, or a clock: times.hpp
//     next_time_event(t)        or: the first after t (not t itself), or infinity
//     previous_time_event(t)    the last before t, for runs backward in time
//     next_time_event(t, x)     or: of timers in the state; t or later, or infinity. Asked at the
//                               start and after every set of events
//     time_reset(t, x)          or Mode time_reset(mode, t, x); optional
//
// A reset or time_reset may end the run: throw ricochet::StopRun("why"), see stop.hpp.
//
// Bounds on how fast its guards can change, which let a detector skip most evaluations:
// speed_bound and others, see bounds.hpp.
//
// All functions are const and free of side effects; t is in seconds. A function that has one of
// these names but none of the forms, or a name that is nearly one of these, is rejected by the
// compiler, see detail/declarations.hpp. Guards written for any x that has `x[i]` are located
// without computing the rest of the state. A system without a guard is integrated as a plain
// ordinary differential equation, without the machinery of events.
#pragma once

#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <type_traits>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/degree.hpp"
#include "ricochet/detail/dual_rate.hpp"
#include "ricochet/detail/counts.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/stop.hpp"
#include "ricochet/times.hpp"

namespace ricochet {

/// States are vectors of double: `std::array`, `std::vector`, and fixed or
/// dynamic Eigen vectors.
template <class X>
concept StateVector = std::copyable<X> && requires(X& x, const X& y, std::size_t i) {
    { x[i] } -> std::convertible_to<double&>;
    { y[i] } -> std::convertible_to<double>;
    { y.size() } -> std::convertible_to<std::size_t>;
};

/// Set of the guards that fired together, in ascending order.
class FiredGuards {
public:
    /// Keeps a view of `guards`, which must be ascending.
    explicit FiredGuards(std::span<const std::size_t> guards, bool time_event = false) noexcept
        : guards_(guards), time_event_(time_event)
    {
    }

    [[nodiscard]] std::span<const std::size_t> guards() const noexcept { return guards_; }
    [[nodiscard]] auto begin() const noexcept { return guards_.begin(); }
    [[nodiscard]] auto end() const noexcept { return guards_.end(); }
    [[nodiscard]] std::size_t size() const noexcept { return guards_.size(); }
    [[nodiscard]] std::size_t operator[](std::size_t i) const noexcept { return guards_[i]; }
    /// Whether guard `which` belongs to the set.
    [[nodiscard]] bool contains(std::size_t which) const noexcept
    {
        for (const std::size_t guard : guards_) {
            if (guard == which) return true;
        }
        return false;
    }
    /// Whether a time event belongs to the set.
    [[nodiscard]] bool time_event() const noexcept { return time_event_; }

private:
    std::span<const std::size_t> guards_;
    bool time_event_;
};

namespace detail {

// --- flow ---

template <class System, class X>
concept ModedFlow = requires(const System& system, Mode mode, double t, const X& x, X& dxdt) {
    system.flow(mode, t, x, dxdt);
};

template <class System, class X>
concept PlainFlow = requires(const System& system, double t, const X& x, X& dxdt) {
    system.flow(t, x, dxdt);
};

// --- one of many guards, and a single guard; x may be any view of a state ---

template <class System, class X>
concept ModedGuardOf = CountsGuards<System> && requires(const System& system, std::size_t which, Mode mode, double t, const X& x) {
    { system.guard(which, mode, t, x) } -> std::convertible_to<double>;
};

template <class System, class X>
concept PlainGuardOf = CountsGuards<System> && requires(const System& system, std::size_t which, double t, const X& x) {
    { system.guard(which, t, x) } -> std::convertible_to<double>;
};

template <class System, class X>
concept ModedGuards = CountsGuards<System> && requires(const System& system, Mode mode, double t, const X& x, std::span<double> g) {
    system.guards(mode, t, x, g);
};

template <class System, class X>
concept PlainGuards = CountsGuards<System> && requires(const System& system, double t, const X& x, std::span<double> g) {
    system.guards(t, x, g);
};

template <class System, class X>
concept ModedSingleGuard = !CountsGuards<System> && requires(const System& system, Mode mode, double t, const X& x) {
    { system.guard(mode, t, x) } -> std::convertible_to<double>;
};

template <class System, class X>
concept PlainSingleGuard = !CountsGuards<System> && requires(const System& system, double t, const X& x) {
    { system.guard(t, x) } -> std::convertible_to<double>;
};

/// The system can evaluate one guard without the others.
template <class System, class X>
concept GuardAlone = ModedGuardOf<System, X> || PlainGuardOf<System, X> || ModedSingleGuard<System, X> || PlainSingleGuard<System, X>;

/// The guards of the system are bool: only their signs have a meaning.
template <class System, class X>
concept BooleanGuard = GuardAlone<System, X> &&
    (requires(const System& system, Mode mode, double t, const X& x) { { system.guard(std::size_t{}, mode, t, x) } -> std::same_as<bool>; } ||
     requires(const System& system, Mode mode, double t, const X& x) { { system.guard(mode, t, x) } -> std::same_as<bool>; } ||
     requires(const System& system, double t, const X& x) { { system.guard(t, x) } -> std::same_as<bool>; });

/// The system evaluates all guards in one call.
template <class System, class X>
concept GuardsTogether = ModedGuards<System, X> || PlainGuards<System, X>;

// --- rates ---

template <class System, class X, class D>
concept ModedRateOf = CountsGuards<System> && requires(const System& system, std::size_t which, Mode mode, double t, const X& x, const D& dxdt) {
    { system.guard_rate(which, mode, t, x, dxdt) } -> std::convertible_to<double>;
};

template <class System, class X, class D>
concept PlainRateOf = CountsGuards<System> && requires(const System& system, std::size_t which, double t, const X& x, const D& dxdt) {
    { system.guard_rate(which, t, x, dxdt) } -> std::convertible_to<double>;
};

template <class System, class X, class D>
concept ModedSingleRate = !CountsGuards<System> && requires(const System& system, Mode mode, double t, const X& x, const D& dxdt) {
    { system.guard_rate(mode, t, x, dxdt) } -> std::convertible_to<double>;
};

template <class System, class X, class D>
concept PlainSingleRate = !CountsGuards<System> && requires(const System& system, double t, const X& x, const D& dxdt) {
    { system.guard_rate(t, x, dxdt) } -> std::convertible_to<double>;
};

/// The system computes the rate of one guard.
template <class System, class X, class D = X>
concept RateWritten = ModedRateOf<System, X, D> || PlainRateOf<System, X, D> || ModedSingleRate<System, X, D> || PlainSingleRate<System, X, D>;
/// The system computes the rate of one guard, or dual numbers derive it from the guard.
template <class System, class X, class D = X>
concept RateAlone = RateWritten<System, X, D> || RateByDuals<System, X>;

template <class System, class X>
concept ModedRates = CountsGuards<System> && requires(const System& system, Mode mode, double t, const X& x, std::span<double> rates) {
    system.guard_rates(mode, t, x, x, rates);
};

template <class System, class X>
concept PlainRates = CountsGuards<System> && requires(const System& system, double t, const X& x, std::span<double> rates) {
    system.guard_rates(t, x, x, rates);
};

template <class System, class X>
concept RatesTogether = ModedRates<System, X> || PlainRates<System, X>;

// --- resets ---

template <class System, class X>
concept ModedSetReset = requires(const System& system, const FiredGuards& fired, Mode mode, double t, X& x) {
    { system.reset(fired, mode, t, x) } -> std::convertible_to<Mode>;
};

template <class System, class X>
concept PlainSetReset = CountsGuards<System> && requires(const System& system, const FiredGuards& fired, double t, X& x) {
    system.reset(fired, t, x);
};

template <class System, class X>
concept ModedResetOf = CountsGuards<System> && requires(const System& system, std::size_t which, Mode mode, double t, X& x) {
    { system.reset(which, mode, t, x) } -> std::convertible_to<Mode>;
};

template <class System, class X>
concept PlainResetOf = CountsGuards<System> && requires(const System& system, std::size_t which, double t, X& x) {
    system.reset(which, t, x);
};

template <class System, class X>
concept ModedSingleReset = !CountsGuards<System> && requires(const System& system, Mode mode, double t, X& x) {
    { system.reset(mode, t, x) } -> std::convertible_to<Mode>;
};

template <class System, class X>
concept PlainSingleReset = !CountsGuards<System> && requires(const System& system, double t, X& x) {
    system.reset(t, x);
};

template <class System, class X>
concept ModedDirectedResetOf = CountsGuards<System> && requires(const System& system, std::size_t which, Crossing direction, Mode mode, double t, X& x) {
    { system.reset(which, direction, mode, t, x) } -> std::convertible_to<Mode>;
};

template <class System, class X>
concept PlainDirectedResetOf = CountsGuards<System> && requires(const System& system, std::size_t which, Crossing direction, double t, X& x) {
    system.reset(which, direction, t, x);
};

template <class System, class X>
concept ModedDirectedReset = !CountsGuards<System> && requires(const System& system, Crossing direction, Mode mode, double t, X& x) {
    { system.reset(direction, mode, t, x) } -> std::convertible_to<Mode>;
};

template <class System, class X>
concept PlainDirectedReset = !CountsGuards<System> && requires(const System& system, Crossing direction, double t, X& x) {
    system.reset(direction, t, x);
};

/// The reset asks in which direction the guard has crossed.
template <class System, class X>
concept DirectedReset = ModedDirectedResetOf<System, X> || PlainDirectedResetOf<System, X> || ModedDirectedReset<System, X> || PlainDirectedReset<System, X>;

template <class System, class X>
concept ResetsAlone = DirectedReset<System, X> || ModedResetOf<System, X> || PlainResetOf<System, X> || ModedSingleReset<System, X> || PlainSingleReset<System, X>;

template <class System, class X>
concept ResetsTogether = ModedSetReset<System, X> || PlainSetReset<System, X>;

/// A system that decides its mode again after the resets of every set, of guards or a time event:
/// `fired` led from the mode and the state `before` to x, and may still move x. For systems of the
/// library.
template <class System, class X>
concept DecidesAfterSets = requires(const System& system, const FiredGuards& fired, Mode mode, double t, const X& before, X& x) {
    { system.after_set(fired, mode, t, before, x) } -> std::convertible_to<Mode>;
};

// --- rest ---

template <class System, class X>
concept ModedRestOf = CountsGuards<System> && requires(const System& system, std::size_t which, Mode mode, double t, X& x) {
    { system.rest(which, mode, t, x) } -> std::convertible_to<Mode>;
};

template <class System, class X>
concept PlainRestOf = CountsGuards<System> && requires(const System& system, std::size_t which, double t, X& x) {
    system.rest(which, t, x);
};

template <class System, class X>
concept ModedSingleRest = !CountsGuards<System> && requires(const System& system, Mode mode, double t, X& x) {
    { system.rest(mode, t, x) } -> std::convertible_to<Mode>;
};

template <class System, class X>
concept PlainSingleRest = !CountsGuards<System> && requires(const System& system, double t, X& x) {
    system.rest(t, x);
};

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

/// Whether a crossing is an event depends on the state there.
template <class System, class X>
concept EnabledAt =
    (CountsGuards<System> && (requires(const System& system, std::size_t which, Mode mode, double t, const X& x) { { system.enabled(which, mode, t, x) } -> std::convertible_to<bool>; } ||
                              requires(const System& system, std::size_t which, double t, const X& x) { { system.enabled(which, t, x) } -> std::convertible_to<bool>; })) ||
    (!CountsGuards<System> && (requires(const System& system, Mode mode, double t, const X& x) { { system.enabled(mode, t, x) } -> std::convertible_to<bool>; } ||
                               requires(const System& system, double t, const X& x) { { system.enabled(t, x) } -> std::convertible_to<bool>; }));

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
concept ModedTimer = requires(const System& system, Mode mode, double t, const X& x) {
    { system.next_time_event(mode, t, x) } -> std::convertible_to<double>;
};

template <class System, class X>
concept PlainTimer = requires(const System& system, double t, const X& x) {
    { system.next_time_event(t, x) } -> std::convertible_to<double>;
};

template <class System, class X>
concept TimeResetting = requires(const System& system, Mode mode, double t, X& x) { { system.time_reset(mode, t, x) } -> std::convertible_to<Mode>; } ||
    requires(const System& system, double t, X& x) { system.time_reset(t, x); };

}  // namespace detail

/// x' = f(t, x): `flow` writes every component of `dxdt`.
template <class System, class X>
concept Flowing = detail::ModedFlow<System, X> || detail::PlainFlow<System, X>;

/// At least one guard, a scalar function of time and state.
template <class System, class X>
concept Guarded = Flowing<System, X> && (detail::GuardAlone<System, X> || detail::GuardsTogether<System, X>);

/// The guard's rate dg/dt + (dg/dx) x' is available in closed form.
template <class System, class X>
concept RatedGuard = Guarded<System, X> && (detail::RateAlone<System, X> || detail::RatesTogether<System, X>);

/// A system whose events change the state: `reset` replaces x⁻ by x⁺.
template <class System, class X>
concept Resetting = Guarded<System, X> && (detail::ResetsAlone<System, X> || detail::ResetsTogether<System, X>);

/// A system with `rest`, which continues the motion beyond an accumulation of its events.
template <class System, class X>
concept Resting = Guarded<System, X> && (detail::ModedRestOf<System, X> || detail::PlainRestOf<System, X> || detail::ModedSingleRest<System, X> || detail::PlainSingleRest<System, X>);

/// A system with time events that are known beforehand.
template <class System>
concept Timed = detail::TimedByFunction<System> || detail::ListsTimes<System>;

/// A system whose next time event depends on its state.
template <class System, class X>
concept TimedByState = detail::ModedTimer<System, X> || detail::PlainTimer<System, X>;

/// A system with modes: at least one of its functions takes a mode.
template <class System, class X>
concept Moded = detail::ModedFlow<System, X> || requires(const System& system) { system.mode_count; } || requires(const System& system) { system.mode_count(); };

/// A system whose `guard_count` is not a constant.
inline constexpr std::size_t counted_at_run_time = static_cast<std::size_t>(-1);

/// Number of guards if the type fixes it, else `counted_at_run_time`.
template <class System, class X>
[[nodiscard]] constexpr std::size_t fixed_guard_count() noexcept
{
    if constexpr (detail::CountsGuardsFixed<System>) {
        return System::guard_count;
    } else if constexpr (detail::CountsGuards<System>) {
        return counted_at_run_time;
    } else {
        return Guarded<System, X> ? 1 : 0;
    }
}

/// Number of guards.
template <class X, class System>
[[nodiscard]] constexpr std::size_t guard_count_of(const System& system)
{
    if constexpr (detail::CountsGuardsByMember<System>) {
        return static_cast<std::size_t>(system.guard_count);
    } else if constexpr (detail::CountsGuardsByCall<System>) {
        return static_cast<std::size_t>(system.guard_count());
    } else {
        return fixed_guard_count<System, X>();
    }
}

/// Properties of a guard: those that the system declares, else the defaults.
template <class X, class System>
[[nodiscard]] constexpr GuardInfo guard_info_of(const System& system, std::size_t which)
{
    GuardInfo info;
    if constexpr (detail::InfoOf<System>) {
        info = system.guard_info(which);
    } else if constexpr (detail::SingleInfo<System>) {
        info = system.guard_info();
    } else {
        if constexpr (requires { { system.crossing } -> std::convertible_to<Crossing>; }) {
            info.crossing = system.crossing;
        }
        if constexpr (requires { { system.unilateral } -> std::convertible_to<bool>; }) {
            info.unilateral = system.unilateral;
        }
    }
    if constexpr (detail::BooleanGuard<System, X>) info.boolean = true;
    if constexpr (detail::DegreeKnown<System, X>) {
        if (info.degree == 0 && !info.boolean) info.degree = detail::inferred_degree<X>(system, which);
    }
    return info;
}

namespace detail {

// --- calls in whichever form a system has ---

/// Computes x' into `dxdt`. A flow that changes the dimension of `dxdt` is in error: then `dxdt` is
/// filled with NaN in the dimension of x, so that nothing is read beyond its end, and the
/// result is false.
template <class System, class X>
[[gnu::always_inline]] inline bool call_flow(const System& system, [[maybe_unused]] Mode mode, double t, const X& x, X& dxdt)
{
    if constexpr (ModedFlow<System, X>) {
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
    if constexpr (ModedGuardOf<System, X>) {
        return as_guard_value(system.guard(which, mode, t, x));
    } else if constexpr (PlainGuardOf<System, X>) {
        return as_guard_value(system.guard(which, t, x));
    } else if constexpr (ModedSingleGuard<System, X>) {
        return as_guard_value(system.guard(mode, t, x));
    } else {
        return as_guard_value(system.guard(t, x));
    }
}

/// Values of all guards, into `g`.
template <class System, class X>
[[gnu::always_inline]] inline void call_guards(const System& system, [[maybe_unused]] Mode mode, double t, const X& x, std::span<double> g)
{
    if constexpr (ModedGuards<System, X>) {
        system.guards(mode, t, x, g);
    } else if constexpr (PlainGuards<System, X>) {
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
    if constexpr (!RateWritten<System, X, D>) {
        return rate_by_duals(system, which, at);
    } else if constexpr (ModedRateOf<System, X, D>) {
        return system.guard_rate(which, at.mode, at.t, at.x, at.s);
    } else if constexpr (PlainRateOf<System, X, D>) {
        return system.guard_rate(which, at.t, at.x, at.s);
    } else if constexpr (ModedSingleRate<System, X, D>) {
        return system.guard_rate(at.mode, at.t, at.x, at.s);
    } else {
        return system.guard_rate(at.t, at.x, at.s);
    }
}

template <class System, class X>
inline void call_rates(const System& system, const Along<X>& at, std::span<double> rates)
{
    if constexpr (ModedRates<System, X>) {
        system.guard_rates(at.mode, at.t, at.x, at.s, rates);
    } else {
        system.guard_rates(at.t, at.x, at.s, rates);
    }
}

/// Applies the reset of one guard, which has crossed in a direction; returns the mode after it.
template <class System, class X>
[[nodiscard]] Mode call_reset(const System& system, [[maybe_unused]] std::size_t which, [[maybe_unused]] Crossing direction, [[maybe_unused]] Mode mode, double t, X& x)
{
    if constexpr (ModedDirectedResetOf<System, X>) {
        return system.reset(which, direction, mode, t, x);
    } else if constexpr (PlainDirectedResetOf<System, X>) {
        system.reset(which, direction, t, x);
        return mode;
    } else if constexpr (ModedDirectedReset<System, X>) {
        return system.reset(direction, mode, t, x);
    } else if constexpr (PlainDirectedReset<System, X>) {
        system.reset(direction, t, x);
        return mode;
    } else if constexpr (ModedResetOf<System, X>) {
        return system.reset(which, mode, t, x);
    } else if constexpr (PlainResetOf<System, X>) {
        system.reset(which, t, x);
        return mode;
    } else if constexpr (ModedSingleReset<System, X>) {
        return system.reset(mode, t, x);
    } else {
        system.reset(t, x);
        return mode;
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
[[nodiscard]] Mode call_reset_set(const System& system, const FiredGuards& fired, [[maybe_unused]] Mode mode, double t, X& x)
{
    if constexpr (ModedSetReset<System, X>) {
        return system.reset(fired, mode, t, x);
    } else {
        system.reset(fired, t, x);
        return mode;
    }
}

template <class System, class X>
[[nodiscard]] Mode call_rest(const System& system, [[maybe_unused]] std::size_t which, [[maybe_unused]] Mode mode, double t, X& x)
{
    if constexpr (ModedRestOf<System, X>) {
        return system.rest(which, mode, t, x);
    } else if constexpr (PlainRestOf<System, X>) {
        system.rest(which, t, x);
        return mode;
    } else if constexpr (ModedSingleRest<System, X>) {
        return system.rest(mode, t, x);
    } else {
        system.rest(t, x);
        return mode;
    }
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
[[nodiscard]] double call_timer(const System& system, [[maybe_unused]] Mode mode, double t, const X& x)
{
    if constexpr (ModedTimer<System, X>) {
        return system.next_time_event(mode, t, x);
    } else {
        return system.next_time_event(t, x);
    }
}

template <class System, class X>
[[nodiscard]] Mode call_time_reset(const System& system, Mode mode, double t, X& x)
{
    if constexpr (requires { { system.time_reset(mode, t, x) } -> std::convertible_to<Mode>; }) {
        return system.time_reset(mode, t, x);
    } else if constexpr (requires { system.time_reset(t, x); }) {
        system.time_reset(t, x);
        return mode;
    } else {
        return mode;
    }
}

/// Whether a crossing at (t, x) is an event.
template <class System, class X>
[[nodiscard]] bool call_enabled_at(const System& system, [[maybe_unused]] std::size_t which, [[maybe_unused]] Mode mode, double t, const X& x)
{
    if constexpr (CountsGuards<System> && requires { { system.enabled(which, mode, t, x) } -> std::convertible_to<bool>; }) {
        return system.enabled(which, mode, t, x);
    } else if constexpr (CountsGuards<System> && requires { { system.enabled(which, t, x) } -> std::convertible_to<bool>; }) {
        return system.enabled(which, t, x);
    } else if constexpr (!CountsGuards<System> && requires { { system.enabled(mode, t, x) } -> std::convertible_to<bool>; }) {
        return system.enabled(mode, t, x);
    } else if constexpr (!CountsGuards<System> && requires { { system.enabled(t, x) } -> std::convertible_to<bool>; }) {
        return system.enabled(t, x);
    } else {
        return true;
    }
}

}  // namespace detail

}  // namespace ricochet
