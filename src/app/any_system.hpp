// Systems of every type behind one, so that the integrator is compiled once for all of
// them.
//
// Every function of the system is a virtual call, and states are vectors: dearer by tens
// of nanoseconds a step, which a command line can bear. A system that is to be fast here
// goes through run_system.hpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "registry.hpp"
#include "ricochet/detect/cover.hpp"
#include "ricochet/hybrid/bounds.hpp"
#include "ricochet/hybrid/guard.hpp"
#include "ricochet/hybrid/system.hpp"

namespace ricochet::app {

/// Any system with guards, resets, modes and time events. Not with rest rules and resets
/// of whole sets, which no system needs here so far.
class AnySystem {
public:
    using State = std::vector<double>;

    /// A copy of `system`.
    template <class System>
    explicit AnySystem(System system) : held_(std::make_unique<Held<System>>(std::move(system)))
    {
    }

    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        held_->flow(mode, t, x, dxdt);
    }
    [[nodiscard]] std::size_t guard_count() const { return held_->guard_count(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const { return held_->guard_info(which); }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        return held_->enabled(which, mode);
    }
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x) const
    {
        return held_->guard(which, mode, t, x);
    }
    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const State& x,
                                    const State& dxdt) const
    {
        return held_->guard_rate(which, mode, t, x, dxdt);
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double t, State& x) const
    {
        return held_->reset(which, mode, t, x);
    }
    [[nodiscard]] std::size_t mode_count() const { return held_->mode_count(); }
    [[nodiscard]] double next_time_event(double t) const { return held_->next_time_event(t); }
    [[nodiscard]] double previous_time_event(double t) const
    {
        return held_->previous_time_event(t);
    }
    [[nodiscard]] Mode time_reset(Mode mode, double t, State& x) const
    {
        return held_->time_reset(mode, t, x);
    }

    /// What it promises of its guards, see `BoundedSystem`.
    [[nodiscard]] bool has_bounds() const { return held_->has_bounds(); }
    /// 0 where there are no bounds.
    [[nodiscard]] GuardBound bound(std::size_t which, Mode mode, double t, const State& x) const
    {
        return held_->bound(which, mode, t, x);
    }
    [[nodiscard]] double lipschitz_of(std::size_t which) const { return held_->lipschitz(which); }

private:
    struct Holder {
        virtual ~Holder() = default;
        virtual void flow(Mode mode, double t, const State& x, State& dxdt) const = 0;
        [[nodiscard]] virtual std::size_t guard_count() const = 0;
        [[nodiscard]] virtual GuardInfo guard_info(std::size_t which) const = 0;
        [[nodiscard]] virtual bool enabled(std::size_t which, Mode mode) const = 0;
        [[nodiscard]] virtual double guard(std::size_t which, Mode mode, double t,
                                           const State& x) const = 0;
        [[nodiscard]] virtual double guard_rate(std::size_t which, Mode mode, double t,
                                                const State& x, const State& dxdt) const = 0;
        [[nodiscard]] virtual Mode reset(std::size_t which, Mode mode, double t,
                                         State& x) const = 0;
        [[nodiscard]] virtual std::size_t mode_count() const = 0;
        [[nodiscard]] virtual double next_time_event(double t) const = 0;
        [[nodiscard]] virtual double previous_time_event(double t) const = 0;
        [[nodiscard]] virtual Mode time_reset(Mode mode, double t, State& x) const = 0;
        [[nodiscard]] virtual bool has_bounds() const = 0;
        [[nodiscard]] virtual GuardBound bound(std::size_t which, Mode mode, double t,
                                               const State& x) const = 0;
        [[nodiscard]] virtual double lipschitz(std::size_t which) const = 0;
    };

    template <class System>
    class Held;

    std::unique_ptr<const Holder> held_;
};

template <class System>
class AnySystem::Held final : public AnySystem::Holder {
    static constexpr bool guarded = Guarded<System, State>;
    static_assert(!guarded || RatedGuard<System, State>,
                  "AnySystem: the guards of the system have no rate in closed form");
    static_assert(!Resting<System, State>, "AnySystem: the system has a rest rule");
    static_assert(!Resetting<System, State> || detail::ResetsAlone<System, State>,
                  "AnySystem: the system resets sets of guards");

public:
    explicit Held(System system) : system_(std::move(system)) {}

    void flow(Mode mode, double t, const State& x, State& dxdt) const override
    {
        detail::call_flow(system_, mode, t, x, dxdt);
    }
    std::size_t guard_count() const override { return guard_count_of<State>(system_); }
    GuardInfo guard_info(std::size_t which) const override
    {
        GuardInfo info = guard_info_of<State>(system_, which);
        info.resets = info.resets && Resetting<System, State>;
        return info;
    }
    bool enabled(std::size_t which, Mode mode) const override
    {
        return detail::call_enabled_in(system_, which, mode);
    }
    double guard(std::size_t which, Mode mode, double t, const State& x) const override
    {
        if constexpr (guarded) return detail::call_guard(system_, which, mode, t, x);
        return std::numeric_limits<double>::quiet_NaN();  // there are none
    }
    double guard_rate(std::size_t which, Mode mode, double t, const State& x,
                      const State& dxdt) const override
    {
        if constexpr (guarded) return detail::call_rate(system_, which, mode, t, x, dxdt);
        return std::numeric_limits<double>::quiet_NaN();
    }
    Mode reset(std::size_t which, Mode mode, double t, State& x) const override
    {
        if constexpr (Resetting<System, State>) {
            return detail::call_reset(system_, which, mode, t, x);
        }
        return mode;
    }
    std::size_t mode_count() const override
    {
        return std::max<std::size_t>(mode_count_of(system_), 1);
    }
    double next_time_event(double t) const override
    {
        if constexpr (Timed<System>) return system_.next_time_event(t);
        return std::numeric_limits<double>::infinity();
    }
    double previous_time_event(double t) const override
    {
        if constexpr (Timed<System>) return system_.previous_time_event(t);
        return -std::numeric_limits<double>::infinity();
    }
    Mode time_reset(Mode mode, double t, State& x) const override
    {
        return detail::call_time_reset(system_, mode, t, x);
    }
    bool has_bounds() const override { return Bounded<System, State>; }
    GuardBound bound(std::size_t which, Mode mode, double t, const State& x) const override
    {
        constexpr double infinity = std::numeric_limits<double>::infinity();
        GuardBound out{.distance = -infinity, .speed = infinity, .acceleration = infinity};
        if constexpr (Bounded<System, State>) {
            out.speed = detail::call_speed_bound(system_, which, mode, t, x);
            out.acceleration = detail::call_acceleration_bound(system_, which, mode, t, x);
            if constexpr (detail::HasLowerBound<System, State>) {
                out.distance = detail::call_lower_bound(system_, which, mode, t, x);
            }
        }
        return out;
    }
    double lipschitz(std::size_t which) const override
    {
        return detail::call_lipschitz(system_, which);
    }

private:
    System system_;
};

/// The same with its bounds where the planner finds them; where there are none, they are infinite,
/// and cover nothing. Of one type, so that a run has the same bits with and without a gate.
class BoundedSystem : public AnySystem {
public:
    explicit BoundedSystem(AnySystem system) : AnySystem(std::move(system)) {}

    [[nodiscard]] double lipschitz(std::size_t which) const { return lipschitz_of(which); }
    [[nodiscard]] double speed_bound(std::size_t which, Mode mode, double t, const State& x) const
    {
        return bound(which, mode, t, x).speed;
    }
    [[nodiscard]] double acceleration_bound(std::size_t which, Mode mode, double t,
                                            const State& x) const
    {
        return bound(which, mode, t, x).acceleration;
    }
    [[nodiscard]] double lower_bound(std::size_t which, Mode mode, double t, const State& x) const
    {
        return bound(which, mode, t, x).distance;
    }
};

/// Runs `system` from x0 `repeats` times and returns the last run. Only the detectors
/// `ends`, `extremum` and `bernstein` are served, and gates.
/// @throws BadInput for a gate that does not fit the system.
[[nodiscard]] TimedRun run_any(AnySystem system, const std::vector<double>& x0,
                               const RunSettings& settings, int repeats);

/// With the gate of the settings: one of the detectors `verified`, `certified`, `calibrated`.
/// @throws BadInput for a gate that does not fit the system, or another stepper than rk4 in fixed
///         steps and dopri5 under error control.
[[nodiscard]] TimedRun run_gated(const BoundedSystem& system, const std::vector<double>& x0,
                                 const RunSettings& settings, int repeats);

/// The guards of a system by their own names, with what happens on their surfaces.
template <class System>
[[nodiscard]] std::vector<GuardLabel> labels(const System& system,
                                             std::initializer_list<std::string_view> events)
{
    std::vector<GuardLabel> out;
    for (const std::string_view event : events) {
        out.push_back({.name = system.guard_info(out.size()).name, .event = event});
    }
    return out;
}

/// The modes of a system by their own names.
template <class System>
[[nodiscard]] std::vector<std::string_view> mode_names()
{
    std::vector<std::string_view> out;
    for (Mode mode = 0; mode < System::mode_count; ++mode) out.push_back(System::mode_name(mode));
    return out;
}

}  // namespace ricochet::app
