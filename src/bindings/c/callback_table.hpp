// The table of a system of callbacks, with what it has.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "bindings/c/callback_system.hpp"
#include "ricochet/detail/system_adapter.hpp"
#include "ricochet/detail/system_table.hpp"

namespace ricochet::c {

/// Argument of the functions of the table.
template <class X>
class CallbackAdapter : public detail::SystemAdapter<CallbackSystem, X> {
public:
    CallbackAdapter(const CallbackSystem& system, const X& like)
        : detail::SystemAdapter<CallbackSystem, X>(system, like),
          all(system.guard_count()),
          moved(like),
          turned(like)
    {
    }

    std::vector<double> all;  ///< values or rates of all guards
    X moved, turned;
};

template <class X>
class CallbackTable {
    using Table = detail::SystemTable<X>;
    using D = CallbackAdapter<X>;

    [[nodiscard]] static D& at(void* adapter) noexcept
    {
        return *static_cast<D*>(static_cast<detail::SystemAdapter<CallbackSystem, X>*>(adapter));
    }
    [[nodiscard]] static const CallbackSystem& of(void* adapter) noexcept
    {
        return at(adapter).system();
    }

    static double guard(void* adapter, std::size_t which, Mode mode, double t, const X& x)
    {
        const CallbackSystem& system = of(adapter);
        if (system.callbacks().guard) return system.guard(which, mode, t, x);
        system.guards(mode, t, x, at(adapter).all);
        return at(adapter).all[which];
    }

    /// The guard a time `s` later along a straight line.
    static double guard_at(void* adapter, std::size_t which, Mode mode, double t, const X& x,
                           const X& dxdt, double s)
    {
        X& moved = at(adapter).moved;
        if (moved.size() != x.size()) moved = x;
        detail::move(moved, x, s, dxdt);
        return guard(adapter, which, mode, t, moved);
    }

    /// The rate of the guard by a central difference, as `detail::GuardView::difference`.
    static double difference(void* adapter, GuardInMode of, detail::ScaledTime time, const X& x,
                             const X& dxdt)
    {
        const auto [which, mode, backward] = of;
        const double t = time.t;
        const double delta = 1e-5 * time.scale;
        const double later = backward ? -delta : delta;
        const double ahead = guard_at(adapter, which, mode, t + later, x, dxdt, delta);
        const double behind = guard_at(adapter, which, mode, t - later, x, dxdt, -delta);
        const double central = (ahead - behind) / (2 * delta);
        if (std::isfinite(central)) return central;
        return detail::one_sided(guard(adapter, which, mode, t, x), ahead, behind, delta);
    }

    static double rate(void* adapter, GuardInMode guard, detail::ScaledTime time, const X& x,
                       const X& dxdt)
    {
        const CallbackSystem& system = of(adapter);
        const rc_callbacks& has = system.callbacks();
        if (!has.guard_rate && !has.guard_rates) return difference(adapter, guard, time, x, dxdt);
        const X* forward = &dxdt;
        if (guard.backward) {
            X& turned = at(adapter).turned;
            turned = dxdt;
            detail::for_each_component(turned, [&](auto i) { turned[i] = -turned[i]; });
            forward = &turned;
        }
        double rate = 0;
        if (has.guard_rate) {
            rate = system.guard_rate(guard.which, guard.mode, time.t, x, *forward);
        } else {
            system.guard_rates(guard.mode, time.t, x, *forward, at(adapter).all);
            rate = at(adapter).all[guard.which];
        }
        if (!std::isfinite(rate)) return difference(adapter, guard, time, x, dxdt);
        return guard.backward ? -rate : rate;
    }

    static detail::GuardPoint point(void* adapter, GuardInMode guard, detail::ScaledTime time,
                                    const X& x, const X& dxdt)
    {
        return {of(adapter).guard(guard.which, guard.mode, time.t, x),
                rate(adapter, guard, time, x, dxdt)};
    }

    static void each_rate(void* adapter, const detail::Along<X>& motion, std::span<double> rates)
    {
        for (std::size_t i = 0; i < rates.size(); ++i) {
            rates[i] = of(adapter).guard_rate(i, motion.mode, motion.t, motion.x, motion.s);
        }
    }

    static void add_guards(Table& table, const rc_callbacks& has)
    {
        table.guarded = true;
        table.rated = has.guard_rate || has.guard_rates;
        table.guard_alone = has.guard != nullptr;
        table.calls_of_rate = table.rated ? 0 : 2;
        table.info = [](void* adapter, std::size_t which) { return of(adapter).guard_info(which); };
        table.guards = [](void* adapter, Mode mode, double t, const X& x, std::span<double> g) {
            of(adapter).guards(mode, t, x, g);
        };
        table.guard = &guard;
        table.rate = &rate;
        if (has.guard && !has.guard_rates) table.point = &point;
        if (has.guard_rates) {
            table.rates = [](void* adapter, const detail::Along<X>& motion,
                             std::span<double> rates) {
                of(adapter).guard_rates(motion.mode, motion.t, motion.x, motion.s, rates);
            };
        } else if (has.guard_rate) {
            table.each_rate = &each_rate;
        }
        if (has.enabled_in) {
            table.enabled_in = [](void* adapter, std::size_t which, Mode mode) {
                return of(adapter).enabled_in(which, mode);
            };
        }
        if (has.enabled) {
            table.enabled_at = [](void* adapter, std::size_t which, Mode mode, double t,
                                  const X& x) { return of(adapter).enabled_at(which, mode, t, x); };
        }
        if (has.reset_set) {
            table.reset_set = [](void* adapter, const FiredGuards& fired, Mode mode, double t,
                                 X& x) { return of(adapter).reset_set(fired, mode, t, x); };
        } else if (has.reset) {
            table.reset = [](void* adapter, std::size_t which, Mode mode, double t, X& x) {
                return of(adapter).reset(which, mode, t, x);
            };
        }
        if (has.rest) {
            table.rest = [](void* adapter, std::size_t which, Mode mode, double t, X& x) {
                return of(adapter).rest(which, mode, t, x);
            };
        }
    }

    static void add_times(Table& table, const rc_callbacks& has)
    {
        if (has.next_time_event_at) {
            table.next_time_event_at = [](void* adapter, Mode mode, double t, const X& x) {
                return of(adapter).next_time_event_at(mode, t, x);
            };
        } else if (has.next_time_event) {
            table.next_time_event = [](void* adapter, double t) {
                return of(adapter).next_time_event(t);
            };
        } else {
            table.next_time_event = [](void* adapter, double t) {
                return of(adapter).times.next(t);
            };
            table.previous_time_event = [](void* adapter, double t) {
                return of(adapter).times.previous(t);
            };
            table.time_event_count = [](void* adapter, double t) {
                return of(adapter).times.count(t);
            };
        }
        if (has.previous_time_event) {
            table.previous_time_event = [](void* adapter, double t) {
                return of(adapter).previous_time_event(t);
            };
        }
        if (has.time_reset) {
            table.time_reset = [](void* adapter, Mode mode, double t, X& x) {
                return of(adapter).time_reset(mode, t, x);
            };
        }
    }

    static void add_bounds(Table& table, const rc_callbacks& has)
    {
        table.bounded = true;
        table.lipschitz = [](void* adapter, std::size_t which) {
            return of(adapter).lipschitz(which);
        };
        table.speed_bound = [](void* adapter, std::size_t which, Mode mode, double t, const X& x) {
            return of(adapter).speed_bound(which, mode, t, x);
        };
        table.acceleration_bound = [](void* adapter, std::size_t which, Mode mode, double t,
                                      const X& x) {
            return of(adapter).acceleration_bound(which, mode, t, x);
        };
        if (has.lower_bound) {
            table.lower_bound = [](void* adapter, std::size_t which, Mode mode, double t,
                                   const X& x) {
                return of(adapter).lower_bound(which, mode, t, x);
            };
        }
        if (has.upper_bound) {
            table.upper_bound = [](void* adapter, std::size_t which, Mode mode, double t,
                                   const X& x) {
                return of(adapter).upper_bound(which, mode, t, x);
            };
        }
    }

public:
    [[nodiscard]] static Table make(const CallbackSystem& system)
    {
        const rc_callbacks& has = system.callbacks();
        Table table;
        table.moded = has.mode_count > 0;
        table.fixed_dimension = detail::fixed_size<X>() > 0;
        table.flow = [](void* adapter, Mode mode, double t, const X& x, X& dxdt) {
            of(adapter).flow(mode, t, x, dxdt);
            return true;
        };
        table.mode_count = [](void* adapter) { return of(adapter).mode_count(); };
        table.guard_count = [](void* adapter) { return of(adapter).guard_count(); };
        table.name = [](void* adapter) { return of(adapter).name; };
        if (has.guard_count > 0) add_guards(table, has);
        if (system.has_time_events()) add_times(table, has);
        if (has.speed_bound) add_bounds(table, has);
        return table;
    }
};

}  // namespace ricochet::c
