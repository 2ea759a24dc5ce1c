// Internal: the declarations of this header may change without notice.
//
// Converts a user's system, in whatever form and with whatever type of state, to the table that the
// loop uses (detail/system_table.hpp).
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <type_traits>

#include "ricochet/bounds.hpp"
#include "ricochet/detail/components.hpp"
#include "ricochet/detail/guard_view.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/run.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

/// Whether X is an array, which lies in a vector unchanged.
template <class X>
inline constexpr bool is_array = false;
template <std::size_t n>
inline constexpr bool is_array<std::array<double, n>> = true;

/// to = from, component by component.
template <class To, class From>
void copy_state(const From& from, To& to)
{
    if constexpr (requires { to.resize(0); }) {
        if (static_cast<std::size_t>(to.size()) != static_cast<std::size_t>(from.size())) {
            to.resize(static_cast<decltype(to.size())>(from.size()));
        }
    }
    for (std::size_t i = 0; i < static_cast<std::size_t>(to.size()); ++i) {
        to[own(i, to)] = from[own(i, from)];
    }
}

/// Converts the caller's state to one of the loop's.
template <class X>
[[nodiscard]] CoreState<X> core_state(const X& x)
{
    if constexpr (std::is_same_v<X, CoreState<X>>) {
        return x;
    } else {
        CoreState<X> out(static_cast<std::size_t>(x.size()));
        copy_state(x, out);
        return out;
    }
}

/// Converts a state of the loop into one like `like`, of the caller's type.
template <class X>
[[nodiscard]] X as_callers(const CoreState<X>& x, const X& like)
{
    if constexpr (std::is_same_v<X, CoreState<X>>) {
        return x;
    } else {
        if (x.size() == 0) return X{};  // unknown, or not recorded
        X out = x.size() == static_cast<std::size_t>(like.size()) ? like : X{};
        copy_state(x, out);
        return out;
    }
}

template <class X>
[[nodiscard]] Event<X> as_callers(const Event<CoreState<X>>& event, const X& like)
{
    return {.t = event.t,
            .kind = event.kind,
            .guard = event.guard,
            .mode_before = event.mode_before,
            .mode_after = event.mode_after,
            .before = as_callers(event.before, like),
            .after = as_callers(event.after, like),
            .bracket = event.bracket,
            .slope = event.slope,
            .error = event.error,
            .late = event.late,
            .reaction = event.reaction};
}

/// Argument of the functions of the table: the system, and memory for states of its own type.
template <class System, class UserState>
class SystemAdapter {
public:
    using X = UserState;
    using Core = CoreState<X>;
    static constexpr bool same = std::is_same_v<X, Core>;
    static constexpr bool overlaid = !same && is_array<X>;
    static constexpr bool copied = !same && !overlaid;

    SystemAdapter(const System& system, [[maybe_unused]] const X& like) : system_(&system)
    {
        if constexpr (copied) scratch_.fill(like);
    }

    [[nodiscard]] const System& system() const noexcept { return *system_; }

    /// Direction in which the guard has crossed whose reset comes next.
    [[nodiscard]] Crossing direction() const noexcept { return direction_; }
    void tell_direction(Crossing direction) noexcept { direction_ = direction; }

    /// Converts a state of the loop to one of the system's.
    [[nodiscard]] const X& read(const Core& x, [[maybe_unused]] std::size_t room)
    {
        if constexpr (same) {
            return x;
        } else if constexpr (overlaid) {
            return *reinterpret_cast<const X*>(x.data());
        } else {
            copy_state(x, scratch_[room]);
            return scratch_[room];
        }
    }

    /// Calls `change` with the converted state, which it may change, also in its dimension.
    template <class Change>
    auto edit(Core& x, const Change& change)
    {
        if constexpr (same) {
            return change(x);
        } else if constexpr (overlaid) {
            return change(*reinterpret_cast<X*>(x.data()));
        } else {
            copy_state(x, scratch_[2]);
            try {
                const auto result = change(scratch_[2]);
                copy_state(scratch_[2], x);
                return result;
            } catch (const StopRun&) {  // it has changed the state before
                copy_state(scratch_[2], x);
                throw;
            }
        }
    }

    bool flow(Mode mode, double t, const Core& x, Core& dxdt)
    {
        if constexpr (same) {
            return call_flow(*system_, mode, t, x, dxdt);
        } else if constexpr (overlaid) {
            return call_flow(*system_, mode, t, read(x, 0), *reinterpret_cast<X*>(dxdt.data()));
        } else {
            const X& at = read(x, 0);
            copy_state(dxdt, scratch_[1]);
            const bool fits = call_flow(*system_, mode, t, at, scratch_[1]);
            copy_state(scratch_[1], dxdt);
            return fits;
        }
    }

private:
    struct None {};
    const System* system_;
    Crossing direction_ = Crossing::falling;
    [[no_unique_address]] std::conditional_t<copied, std::array<X, 3>, None> scratch_{};
};

/// The table of `System` for states X.
template <class System, class X>
class TableOf {
    using D = SystemAdapter<System, X>;
    using C = typename D::Core;
    using View = PolynomialView<C, false>;
    using RateView = PolynomialView<C, true>;
    using Guard = GuardView<System, X>;

    [[nodiscard]] static D& at(void* adapter) noexcept { return *static_cast<D*>(adapter); }
    [[nodiscard]] static const System& system(void* adapter) noexcept
    {
        return at(adapter).system();
    }

    // --- guards; evaluations are counted by the loop ---

    static void guards(void* adapter, Mode mode, double t, const C& x, std::span<double> g)
    {
        call_guards(system(adapter), mode, t, at(adapter).read(x, 0), g);
    }
    static double guard(void* adapter, std::size_t which, Mode mode, double t, const C& x)
    {
        std::uint64_t calls = 0;
        return Guard(system(adapter), calls, {which, mode}).value(t, at(adapter).read(x, 0));
    }
    static double guard_on(void* adapter, std::size_t which, Mode mode, double t, const View& x)
    {
        std::uint64_t calls = 0;
        return Guard(system(adapter), calls, {which, mode}).value(t, x);
    }
    static double rate(void* adapter, GuardInMode of, ScaledTime time, const C& x, const C& dxdt)
    {
        std::uint64_t calls = 0;
        return Guard(system(adapter), calls, of)
            .rate(time.t, at(adapter).read(x, 0), at(adapter).read(dxdt, 1), time.scale);
    }
    static GuardPoint point(void* adapter, GuardInMode of, ScaledTime time, const C& x,
                            const C& dxdt)
    {
        std::uint64_t calls = 0;
        const Guard guard(system(adapter), calls, of);
        const X& state = at(adapter).read(x, 0);
        return {guard.value(time.t, state),
                guard.rate(time.t, state, at(adapter).read(dxdt, 1), time.scale)};
    }
    static double rate_on(void* adapter, GuardInMode of, ScaledTime time, const View& x,
                          const RateView& dxdt)
    {
        std::uint64_t calls = 0;
        return Guard(system(adapter), calls, of).rate(time.t, x, dxdt, time.scale);
    }
    static void rates(void* adapter, const Along<C>& motion, std::span<double> rates)
    {
        const X& state = at(adapter).read(motion.x, 0);
        const X& rate = at(adapter).read(motion.s, 1);
        call_rates(system(adapter), Along{motion.mode, motion.t, state, rate}, rates);
    }
    static void each_rate(void* adapter, const Along<C>& motion, std::span<double> rates)
    {
        const System& of = system(adapter);
        const X& state = at(adapter).read(motion.x, 0);
        const X& rate = at(adapter).read(motion.s, 1);
        const Along along{motion.mode, motion.t, state, rate};
        for (std::size_t i = 0; i < rates.size(); ++i) rates[i] = call_rate(of, i, along);
    }

    // --- resets ---

    static Mode reset(void* adapter, std::size_t which, Mode mode, double t, C& x)
    {
        return at(adapter).edit(x, [&](X& state) {
            return call_reset(system(adapter), which, at(adapter).direction(), mode, t, state);
        });
    }
    static Mode reset_set(void* adapter, const FiredGuards& fired, Mode mode, double t, C& x)
    {
        return at(adapter).edit(
            x, [&](X& state) { return call_reset_set(system(adapter), fired, mode, t, state); });
    }
    static Mode after_set(void* adapter, const FiredGuards& fired, Mode mode, double t,
                          const C& before, C& x)
    {
        const X& was = at(adapter).read(before, 0);
        return at(adapter).edit(
            x, [&](X& state) { return system(adapter).after_set(fired, mode, t, was, state); });
    }
    static Mode rest(void* adapter, std::size_t which, Mode mode, double t, C& x)
    {
        return at(adapter).edit(
            x, [&](X& state) { return call_rest(system(adapter), which, mode, t, state); });
    }
    static Mode time_reset(void* adapter, Mode mode, double t, C& x)
    {
        return at(adapter).edit(
            x, [&](X& state) { return call_time_reset(system(adapter), mode, t, state); });
    }

    static constexpr void add_guards(SystemTable<C>& table)
    {
        table.guarded = true;
        table.rated = RatedGuard<System, X>;
        table.guard_alone = GuardAlone<System, X>;
        table.guard_count = [](void* adapter) { return guard_count_of<X>(system(adapter)); };
        table.info = [](void* adapter, std::size_t which) {
            return guard_info_of<X>(system(adapter), which);
        };
        table.guards = &guards;
        if constexpr (!GuardsTogether<System, X> && !RatesTogether<System, X>) {
            table.point = &point;
        }
        table.calls_of_rate = RatedGuard<System, X> ? 0 : 2;
        table.guard = &guard;
        table.rate = &rate;
        if constexpr (Guard::template sees<View>) {
            table.guard_on = &guard_on;
            if constexpr (Guard::template sees_rate<View, RateView>) table.rate_on = &rate_on;
        }
        if constexpr (RatesTogether<System, X>) {
            table.rates = &rates;
        } else if constexpr (RateAlone<System, X>) {
            table.each_rate = &each_rate;
        }
        if constexpr (EnabledIn<System>) {
            table.enabled_in = [](void* adapter, std::size_t which, Mode mode) {
                return call_enabled_in(system(adapter), which, mode);
            };
        }
        if constexpr (EnabledAt<System, X>) {
            table.enabled_at = [](void* adapter, std::size_t which, Mode mode, double t,
                                  const C& x) {
                return call_enabled_at(system(adapter), which, mode, t, at(adapter).read(x, 0));
            };
        }
        if constexpr (ResetsTogether<System, X>) {
            table.reset_set = &reset_set;
        } else if constexpr (Resetting<System, X>) {
            table.reset = &reset;
            if constexpr (DirectedReset<System, X>) {
                table.tell_direction = [](void* adapter, Crossing direction) {
                    at(adapter).tell_direction(direction);
                };
            }
        }
        if constexpr (DecidesAfterSets<System, X>) table.after_set = &after_set;
        if constexpr (Resting<System, X>) table.rest = &rest;
        if constexpr (Resting<System, X> && RestsAtSome<System>) {
            table.rests = [](void* adapter, std::size_t which, std::size_t other) -> bool {
                return system(adapter).rests(which, other);
            };
        }
    }

    static constexpr void add_times(SystemTable<C>& table)
    {
        static_assert(ListsTimes<System> + TimedByFunction<System> + TimedByState<System, X> == 1,
                      "ricochet: found several of Times time_events, next_time_event(t) and "
                      "next_time_event([mode,] t, x); expected one of them");
        if constexpr (ListsTimes<System>) {
            table.next_time_event = [](void* adapter, double t) {
                return times_of(system(adapter)).next(t);
            };
            table.previous_time_event = [](void* adapter, double t) {
                return times_of(system(adapter)).previous(t);
            };
            table.time_event_count = [](void* adapter, double t) {
                return times_of(system(adapter)).count(t);
            };
        } else if constexpr (TimedByState<System, X>) {
            table.next_time_event_at = [](void* adapter, Mode mode, double t,
                                          const C& x) -> double {
                return call_timer(system(adapter), mode, t, at(adapter).read(x, 0));
            };
        } else {
            table.next_time_event = [](void* adapter, double t) -> double {
                return system(adapter).next_time_event(t);
            };
        }
        if constexpr (requires(const System& s, double t) { s.previous_time_event(t); }) {
            table.previous_time_event = [](void* adapter, double t) -> double {
                return system(adapter).previous_time_event(t);
            };
        }
        if constexpr (TimeResetting<System, X>) table.time_reset = &time_reset;
    }

    static constexpr void add_bounds(SystemTable<C>& table)
    {
        table.bounded = true;
        table.lipschitz = [](void* adapter, std::size_t which) {
            return call_lipschitz(system(adapter), which);
        };
        table.speed_bound = [](void* adapter, std::size_t which, Mode mode, double t, const C& x) {
            return call_speed_bound(system(adapter), which, mode, t, at(adapter).read(x, 0));
        };
        table.acceleration_bound = [](void* adapter, std::size_t which, Mode mode, double t,
                                      const C& x) {
            return call_acceleration_bound(system(adapter), which, mode, t, at(adapter).read(x, 0));
        };
        if constexpr (HasLowerBound<System, X>) {
            table.lower_bound = [](void* adapter, std::size_t which, Mode mode, double t,
                                   const C& x) {
                return call_lower_bound(system(adapter), which, mode, t, at(adapter).read(x, 0));
            };
        }
        if constexpr (HasUpperBound<System, X>) {
            table.upper_bound = [](void* adapter, std::size_t which, Mode mode, double t,
                                   const C& x) {
                return call_upper_bound(system(adapter), which, mode, t, at(adapter).read(x, 0));
            };
        }
    }

public:
    [[nodiscard]] static constexpr SystemTable<C> make()
    {
        SystemTable<C> table;
        table.moded = Moded<System, X>;
        table.fixed_dimension = fixed_size<X>() > 0;
        table.changes_dimension = requires
        {
            requires System::changes_dimension;
        };
        table.forward_only = requires
        {
            requires System::forward_only;
        };
        table.flow = [](void* adapter, Mode mode, double t, const C& x, C& dxdt) {
            return at(adapter).flow(mode, t, x, dxdt);
        };
        table.mode_count = [](void* adapter) { return mode_count_of(system(adapter)); };
        table.guard_count = [](void*) { return std::size_t{0}; };
        table.name = [](void* adapter) { return name_of_system(system(adapter)); };
        if constexpr (Guarded<System, X>) add_guards(table);
        if constexpr (Timed<System> || TimedByState<System, X>) add_times(table);
        if constexpr (BoundedGuards<System, X>) add_bounds(table);
        return table;
    }
};

template <class System, class X>
inline constexpr SystemTable<CoreState<X>> system_table = TableOf<System, X>::make();

}  // namespace ricochet::detail
