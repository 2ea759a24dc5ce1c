// Hybrid systems as bodies of a scene, such as a pendulum or an arm: a flow, optional guards and
// resets (system.hpp), and discs that other bodies can hit. Besides its flow it declares
//
//     shape_count                       number of its discs, a constant or a member
//     shape_radius(k)                   [m] of disc k
//     shape(k, t, x)                    SystemDisc: centre [m] and its velocity [m/s]
//     shape_acceleration(k, t, x)       [m/s^2] upper bound of the acceleration of its centre
//                                       from (t, x) until the next event or push
//     push(k, t, x, impulse)            applies an impulse [N s] at the centre of disc k, which
//                                       changes x in place, linearly in the impulse
//
// In a system with modes, the last three may take the mode as an argument before t.
//
// Between impacts the system is integrated as in a run of its own, by steps of dopri5, with events
// found by an `EventMonitor`. First contacts of its discs are located on the method's own map, and
// the bounds on accelerations prove that none is lost. A bound that is found to be violated ends
// the run as `Outcome::wrong_bound`.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/monitor.hpp"
#include "ricochet/scene/detail/any_scene_system.hpp"

namespace ricochet {

namespace detail {

template <class System, class X>
class EventsOf final : public SystemEvents {
public:
    EventsOf(const System& system, const X& like) : monitor_(system, like, {.record_events = false})
    {
    }
    StepVerdict start(const Instant& t, std::span<const double> x, double scale, Mode mode) override
    {
        return verdict(monitor_.start(t, x, scale, mode));
    }
    StepVerdict examine(const SceneStep& step) override { return verdict(monitor_.examine(step)); }
    StepVerdict resume(double scale) override { return verdict(monitor_.resume(scale)); }
    Instant cut_at() const override { return monitor_.cut().t; }
    std::span<const double> after() const override { return monitor_.cut().after; }
    Mode mode_after() const override { return monitor_.cut().mode_after; }
    double must_stop_at() const override { return monitor_.must_stop_at(); }

private:
    [[nodiscard]] StepVerdict verdict(Verdict given) const noexcept
    {
        switch (given) {
            case Verdict::stands:
                return monitor_.held().empty() ? StepVerdict::stands : StepVerdict::rests;
            case Verdict::cut: return StepVerdict::cut;
            case Verdict::rests: return StepVerdict::rests;
            case Verdict::ended: break;
        }
        return StepVerdict::ended;
    }

    EventMonitor<System, X> monitor_;
};

template <class System, class X>
class SceneSystemOf final : public SceneSystem {
public:
    SceneSystemOf(const System& system, const X& x0, Mode mode)
        : system_(system), x0_(x0), mode_(mode)
    {
    }
    State start() const override
    {
        State x(x0_.size());
        for (std::size_t i = 0; i < x.size(); ++i) x[i] = x0_[i];
        return x;
    }
    Mode start_mode() const override { return mode_; }
    std::size_t shape_count() const override { return system_.shape_count; }
    double radius(std::size_t k) const override { return system_.shape_radius(k); }
    void flow(Mode mode, double t, const State& x, State& dxdt) const override
    {
        X rate = x0_;
        call_flow(system_, mode, t, own(x), rate);
        for (std::size_t i = 0; i < x.size(); ++i) dxdt[i] = rate[i];
    }
    SystemDisc shape(std::size_t k, Mode mode, double t, const State& x) const override
    {
        if constexpr (requires(const X& y) { system_.shape(k, mode, t, y); }) {
            return system_.shape(k, mode, t, own(x));
        } else {
            return system_.shape(k, t, own(x));
        }
    }
    double acceleration(std::size_t k, Mode mode, double t, const State& x) const override
    {
        if constexpr (requires(const X& y) { system_.shape_acceleration(k, mode, t, y); }) {
            return system_.shape_acceleration(k, mode, t, own(x));
        } else {
            return system_.shape_acceleration(k, t, own(x));
        }
    }
    void push(std::size_t k, Mode mode, double t, State& x, const Vector2& impulse) const override
    {
        X after = own(x);
        if constexpr (requires { system_.push(k, mode, t, after, impulse); }) {
            system_.push(k, mode, t, after, impulse);
        } else {
            system_.push(k, t, after, impulse);
        }
        for (std::size_t i = 0; i < x.size(); ++i) x[i] = after[i];
    }
    std::unique_ptr<SystemEvents> events() const override
    {
        if constexpr (Guarded<System, X> || requires { system_.next_time_event(0.0); }) {
            return std::make_unique<EventsOf<System, X>>(system_, x0_);
        } else {
            return nullptr;
        }
    }

private:
    [[nodiscard]] X own(const State& x) const
    {
        X out = x0_;
        for (std::size_t i = 0; i < x.size(); ++i) out[i] = x[i];
        return out;
    }

    System system_;
    X x0_;
    Mode mode_;
};

}  // namespace detail

/// Returns copies of a system and its initial state in the form that `SystemBody::motion` takes.
template <class System, class X>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] std::shared_ptr<const detail::SceneSystem> system_body(const System& system,
                                                                     const X& x0, Mode mode = 0)
{
    return std::make_shared<detail::SceneSystemOf<System, X>>(system, x0, mode);
}

}  // namespace ricochet
