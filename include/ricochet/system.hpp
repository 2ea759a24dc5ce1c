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
#include "ricochet/detail/counts.hpp"
#include "ricochet/detail/degree.hpp"
#include "ricochet/detail/forms.hpp"
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

/// x' = f(t, x): `flow` writes every component of `dxdt`.
template <class System, class X>
concept Flowing = detail::flow_form<System, X> != detail::Form::absent;

/// At least one guard, a scalar function of time and state.
template <class System, class X>
concept Guarded = Flowing<System, X> &&
    (detail::GuardAlone<System, X> || detail::GuardsTogether<System, X>);

/// The guard's rate dg/dt + (dg/dx) x' is available in closed form.
template <class System, class X>
concept RatedGuard = Guarded<System, X> &&
    (detail::RateAlone<System, X> || detail::RatesTogether<System, X>);

/// A system whose events change the state: `reset` replaces x⁻ by x⁺.
template <class System, class X>
concept Resetting = Guarded<System, X> &&
    (detail::ResetsAlone<System, X> || detail::ResetsTogether<System, X>);

/// A system with `rest`, which continues the motion beyond an accumulation of its events.
template <class System, class X>
concept Resting = Guarded<System, X> && detail::rest_form<System, X> != detail::Form::absent;

/// A system with time events that are known beforehand.
template <class System>
concept Timed = detail::TimedByFunction<System> || detail::ListsTimes<System>;

/// A system whose next time event depends on its state.
template <class System, class X>
concept TimedByState = detail::timer_form<System, X> != detail::Form::absent;

/// A system with modes: at least one of its functions takes a mode.
template <class System, class X>
concept Moded = detail::flow_form<System, X> == detail::Form::in_mode ||
    requires(const System& system) { system.mode_count; } ||
    requires(const System& system) { system.mode_count(); };

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

}  // namespace ricochet
