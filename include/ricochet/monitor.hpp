// Events of a motion that a host integrates.
//
//     monitor.start(t, x, dxdt, h);
//     while (t < t_end) {
//         host.step_to(std::min(t_end, monitor.must_stop_at()));
//         Verdict verdict = monitor.examine(host.last_step());
//         while (verdict == Verdict::cut) {
//             host.restart(monitor.cut().t, monitor.cut().after);
//             verdict = monitor.resume(host.rate(), host.h());
//         }
//         if (verdict != Verdict::stands) break;
//     }
//
// A host shows every step that it has accepted, in order, each beginning where the last one ended;
// steps that it rejects are never shown. Steps are half-open, (t, t + h]. The monitor does not
// change the host. It finds the events that `Simulation` would find with the same steps: the
// first set of events, its resets, the arming of all guards with the flow after them.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/declarations.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/detail/monitor_core.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

/// A step that a host has accepted, from t0 to t0 + h. The states and the rates at its ends are
/// arrays of n doubles. Offsets s lie in [0, h], and rates are with respect to them: those of the
/// path that `interpolate` follows.
template <class S>
concept HostStep = requires(const S& step, double s, std::span<double> x)
{
    Instant{step.t0()};  // [s]; or an Instant, which also holds the rounding error of the time
    {
        step.h()
        } -> std::convertible_to<double>;  // [s]
    {
        step.x0()
        } -> std::convertible_to<std::span<const double>>;
    {
        step.x1()
        } -> std::convertible_to<std::span<const double>>;
    {
        step.rate0()
        } -> std::convertible_to<std::span<const double>>;
    {
        step.rate1()
        } -> std::convertible_to<std::span<const double>>;
    step.interpolate(s, x);  // x becomes x(t0 + s)
};

/// A host that knows the derivative of its interpolant; otherwise it is a difference over 1e-4 h,
/// and events near tangency are located less precisely.
template <class S>
concept RatedHostStep = HostStep<S> && requires(const S& step, double s, std::span<double> dxdt)
{
    step.interpolate_rate(s, dxdt);
};

/// A host that can take its step again with another length, as exactly as the whole one. Events
/// are then located on this map.
template <class S>
concept RepeatableHostStep = HostStep<S> && requires(const S& step, double s, std::span<double> x)
{
    step.restep(s, x);
};

/// A host that declares, by `static constexpr bool is_cubic = true`, that its path is the cubic
/// through the states and the rates at the ends of the step. A guard of degree 1 is then known
/// inside the step without an evaluation there.
template <class S>
concept CubicHostStep = HostStep<S> && requires
{
    requires S::is_cubic;
};

namespace detail {

/// Refuses optional members of a step that are not called, with a sentence for each.
template <HostStep S>
constexpr bool check_host_step()
{
    static_assert(
        RatedHostStep<S> || !requires { &S::interpolate_rate; },
        "ricochet: found a step with an interpolate_rate that does not fit; expected void "
        "interpolate_rate(double s, std::span<double> dxdt) const");
    static_assert(
        RepeatableHostStep<S> || !requires { &S::restep; },
        "ricochet: found a step with a restep that does not fit; expected void restep(double s, "
        "std::span<double> x) const");
    return true;
}

[[noreturn, gnu::cold, gnu::noinline]] inline void throw_not_finite(const char* what,
                                                                    std::span<const double> x)
{
    std::size_t which = 0;
    while (std::isfinite(x[which])) ++which;
    throw std::invalid_argument(std::string("EventMonitor: ") + what + " must be finite, got " +
                                std::to_string(x[which]) + " in component " +
                                std::to_string(which));
}

/// @throws std::invalid_argument naming a component of `what` that is NaN or infinite.
inline void require_finite(const char* what, std::span<const double> x)
{
    double sum = 0;  // NaN where one of them is not finite
    for (const double at : x) sum += at - at;
    if (!(sum == 0)) [[unlikely]]
        throw_not_finite(what, x);
}

}  // namespace detail

/// The cubic through the values and the rates at the ends of a step, for hosts without an
/// interpolant of their own. Keeps views of its arguments.
class HermiteStep {
public:
    static constexpr bool is_cubic = true;

    /// Takes a step from t0 over h [s] from x0 to x1, with the rates at both ends; arrays of n
    /// doubles each.
    HermiteStep(const Instant& t0, double h, std::span<const double> x0, std::span<const double> x1,
                std::span<const double> rate0, std::span<const double> rate1) noexcept
        : t0_(t0), h_(h), x0_(x0), x1_(x1), rate0_(rate0), rate1_(rate1)
    {
    }

    [[nodiscard]] const Instant& t0() const noexcept { return t0_; }
    [[nodiscard]] double h() const noexcept { return h_; }
    [[nodiscard]] std::span<const double> x0() const noexcept { return x0_; }
    [[nodiscard]] std::span<const double> x1() const noexcept { return x1_; }
    [[nodiscard]] std::span<const double> rate0() const noexcept { return rate0_; }
    [[nodiscard]] std::span<const double> rate1() const noexcept { return rate1_; }

    void interpolate(double s, std::span<double> x) const noexcept
    {
        const double u = s / h_;
        const double bent = u * u * (3 - 2 * u);
        const double turned = s * u * (u - 1);
        for (std::size_t i = 0; i < x.size(); ++i) {
            x[i] = x0_[i] + (s * rate0_[i] + (bent * departure(i) + turned * turn(i)));
        }
    }

    void interpolate_rate(double s, std::span<double> dxdt) const noexcept
    {
        const double u = s / h_;
        const double bent = 6 * u * (1 - u) / h_;
        const double turned = u * (3 * u - 2);
        for (std::size_t i = 0; i < dxdt.size(); ++i) {
            dxdt[i] = rate0_[i] + (bent * departure(i) + turned * turn(i));
        }
    }

private:
    /// Departure from the tangent at the start, exact where the motion is straight.
    [[nodiscard]] double departure(std::size_t i) const noexcept
    {
        return (x1_[i] - x0_[i]) - h_ * rate0_[i];
    }
    [[nodiscard]] double turn(std::size_t i) const noexcept { return rate1_[i] - rate0_[i]; }

    Instant t0_;
    double h_;
    std::span<const double> x0_, x1_, rate0_, rate1_;
};

/// Options of a monitor.
struct MonitorOptions {
    double event_tolerance = 0;  ///< [s] as in `Options`
    double event_rtol = 0;
    double event_window = 0;
    bool check_inside = true;
    bool record_events = true;  ///< keep them, for `events`; off: they are only counted
    bool event_states = true;   ///< keep the states of events that change nothing, too
    bool backward = false;      ///< the host's time runs backward
    /// Every crossing ends its step, whether or not the system has a reset for it: for hosts that
    /// change the state themselves.
    bool cut_at_all = false;
};

/// The events of a hybrid system in the steps of a host.
///
/// A step is the path x(t0 + s), 0 <= s <= h, of the host from (t0, x0) to (t0 + h, x1). `examine`
/// computes
///
///     F, s     = the earliest set of acting guards that leave their side within (0, h], located on
///                `restep` where the host has it and else on `interpolate`, and its offset
///     record the events of all other guards up to there
///     F empty: `stands`; the next step begins at (t0 + h, x1)
///     else:    x⁻ = x(t0 + s),  x⁺, q⁺ = r_F(q, t0 + s, x⁻);  `cut`, with these in `cut()`
///
/// and `resume`, called with the rate at x⁺, arms every guard there: on its sign, or on its surface
/// on the sign of its rate. It returns `stands` if the next step begins at x⁺, and another `cut` at
/// the same instant if x⁺ has carried guards across their surfaces. `rests` says that the state
/// stays as it is up to the next time event, and `ended` that the run is over. Where a rest holds a
/// part of a state that moves, the verdict is `stands`, and `held()` names the components to keep;
/// they go free at a `cut` in which no guard has fired, if no event sets them free before.
///
/// Required of the host: t0 and x0 are the end of the last step, or the instant and the state of
/// the last cut, to the bit; t0 + h does not lie beyond `must_stop_at`; between `cut` and `resume`
/// no step is shown. A call that violates this throws std::logic_error and changes nothing.
///
/// The system is one for `Simulation`; its flow is called if a guard starts on its surface
/// without a rate, and if the host does not give the rate after an event.
///
/// An exception from a function of the system or from a host's interpolant passes through
/// unchanged. The monitor then accepts only `start` or `restore`, because its search in the
/// current step is incomplete.
///
/// After construction nothing is allocated for up to 8 guards and states of fixed size, except for
/// recorded events, and the merged state of a reset of several guards.
template <class System, class X = detail::DeclaredState<System>, class Detector = Extremum,
          class Locator = Newton>
class EventMonitor {
    static_assert(detail::check_system<System, X>());
    static_assert(detail::has_flow_alone<System>());

public:
    /// Type of the states of `cut` and `events`: contiguous doubles.
    using State =
        std::conditional_t<detail::is_small<detail::CoreState<X>>,
                           std::array<double, detail::fixed_size<X>()>, std::vector<double>>;

    /// Keeps a reference to the system, and a temporary one itself.
    /// @param like  a state of the dimension of the motion
    /// @throws std::invalid_argument for declarations that contradict each other, and a system
    /// without events.
    explicit EventMonitor(const System& system, const X& like, const MonitorOptions& options = {},
                          const Detector& detector = {}, const Locator& locator = {})
        : parts_(new Parts(system, like, detector, locator)),
          monitor_(detail::make_monitor<Core>(parts_->setup(), detail::core_state(like),
                                              engine_options(options), options.cut_at_all)),
          room_(detail::core_state(like))
    {
        shown_.cut.fired.reserve(monitor_->cut().fired.capacity());
    }
    explicit EventMonitor(System&& system, const X& like, const MonitorOptions& options = {},
                          const Detector& detector = {}, const Locator& locator = {})
        : EventMonitor(detail::Owner<const System>(new System(std::move(system))), like, options,
                       detector, locator)
    {
    }
    /// {10, 0, 1} for two components, or {10}, where the others would silently be zero.
    template <std::size_t given>
    requires(detail::fixed_size<X>() > 0 && detail::fixed_size<X>() != given) explicit EventMonitor(
        const System&, const double (&)[given], const MonitorOptions& = {}, const Detector& = {},
        const Locator& = {})
        : room_(detail::core_state(X{}))
    {
        static_assert(
            given == detail::fixed_size<X>(),
            "ricochet: found a start with another number of components than System::State");
    }
    template <std::size_t given>
    requires(detail::fixed_size<X>() > 0 && detail::fixed_size<X>() != given) explicit EventMonitor(
        System&& system, const double (&like)[given], const MonitorOptions& options = {},
        const Detector& detector = {}, const Locator& locator = {})
        : EventMonitor(std::as_const(system), like, options, detector, locator)
    {
    }

    /// Arms all guards at a state that no event has produced: at the start, and after the host has
    /// changed the state. May return a cut immediately, for a guard that is about to be crossed.
    /// @param dxdt   the rate at x in offsets, n doubles
    /// @param scale  [s] approximate length of the next step
    /// @throws std::invalid_argument for a time, state, scale or guard that is not finite, an
    /// array of the wrong size, an unknown mode, or a state behind a surface that bounds the
    /// motion.
    Verdict start(const Instant& t, std::span<const double> x, std::span<const double> dxdt,
                  double scale, Mode mode = 0)
    {
        return monitor_->start(t, taken(x), checked(dxdt, x.size()), mode, scale);
    }
    /// The same, with the rate of the system's flow.
    Verdict start(const Instant& t, std::span<const double> x, double scale, Mode mode = 0)
    {
        return monitor_->start(t, taken(x), nullptr, mode, scale);
    }

    /// Looks for events in the next step.
    /// Rates need not be finite: then guards are evaluated in their place.
    /// @throws std::invalid_argument for a length that is not above zero, and for a number of x1
    /// that is not finite; nothing has changed then
    /// @throws std::domain_error where an event is located on states of the host's `restep` or
    /// `interpolate` that are not finite
    /// @throws std::logic_error for a step out of turn: one that does not start where the last one
    /// ended, goes beyond a time event, or comes before `resume`; nothing has changed then.
    template <HostStep S>
    [[nodiscard]] Verdict examine(const S& step)
    {
        static_assert(detail::check_host_step<S>());
        const std::size_t n = dimension();
        const Instant start{step.t0()};
        detail::HostStepTable table{.t = start.value,
                                    .h = step.h(),
                                    .x0 = checked(step.x0(), n),
                                    .x1 = checked(step.x1(), n),
                                    .rate0 = checked(step.rate0(), n),
                                    .rate1 = checked(step.rate1(), n),
                                    .host = &step,
                                    .interpolate = &interpolate<S>,
                                    .t_remainder = start.remainder,
                                    .is_cubic = CubicHostStep<S>};
        if constexpr (RatedHostStep<S>) table.rate = &interpolate_rate<S>;
        if constexpr (RepeatableHostStep<S>) table.restep = &restep<S>;
        detail::require_finite("x1", {table.x1, n});
        return monitor_->examine(table);
    }

    /// Arms all guards after a cut, with the rate at `cut().after`, to which the host must have
    /// gone. May return another cut at the same instant: for guards that a reset has carried across
    /// their surfaces, or for a motion that comes to rest.
    [[nodiscard]] Verdict resume(std::span<const double> dxdt, double scale)
    {
        return monitor_->resume(checked(dxdt, monitor_->x().size()), scale);
    }
    /// The same, with the rate of the system's flow.
    [[nodiscard]] Verdict resume(double scale) { return monitor_->resume(nullptr, scale); }
    /// The same, from a state that the host chooses instead of `cut().after`.
    [[nodiscard]] Verdict resume(std::span<const double> after, Mode mode,
                                 std::span<const double> dxdt, double scale)
    {
        return monitor_->resume(taken(after), mode, checked(dxdt, after.size()), scale);
    }

    /// Tells the monitor that the state has been kept until t [s], at most `must_stop_at`. Returns
    /// a cut at a time event, and earlier, without guards, where the flow lifts the guard of a
    /// rest.
    [[nodiscard]] Verdict hold(double t) { return monitor_->hold(t); }

    /// The set of events at which the last step was cut.
    [[nodiscard]] const Cut<State>& cut() const
    {
        if constexpr (same) {
            return monitor_->cut();
        } else {
            const Cut<Core>& from = monitor_->cut();
            Cut<State>& cut = shown_.cut;
            cut.s = from.s;
            cut.t = from.t;
            cut.before = detail::as_callers(from.before, State{});
            cut.after = detail::as_callers(from.after, State{});
            cut.mode_before = from.mode_before;
            cut.mode_after = from.mode_after;
            cut.fired = from.fired;  // into the memory that it has
            cut.on_time = from.on_time;
            cut.accumulation = from.accumulation;
            cut.state_changed = from.state_changed;
            return cut;
        }
    }

    /// Time [s] at which the next step begins.
    [[nodiscard]] Instant t() const noexcept { return monitor_->t(); }  ///< [s]
    [[nodiscard]] std::span<const double> x() const noexcept { return monitor_->x(); }
    [[nodiscard]] Mode mode() const noexcept { return monitor_->mode(); }

    /// The next time event [s], which no step may pass; infinite if there is none.
    [[nodiscard]] double must_stop_at() const noexcept { return monitor_->must_stop_at(); }

    /// The components that a rest holds, ascending: the host keeps them constant in its next steps,
    /// while the others flow. They change where a set is resumed, and at no other time.
    [[nodiscard]] std::span<const std::size_t> held() const noexcept { return monitor_->held(); }

    /// Time [s] up to which no guard needs a check, by the bounds that the system declares or a
    /// gate (`Planned`, `Certified`, ...): the host may go there in steps that it does not show, by
    /// `skip_to`. Without bounds or a gate it is the current time.
    [[nodiscard]] double quiet_until() const noexcept { return monitor_->quiet_until(); }

    /// Tells the monitor that the host has continued to t, at most `quiet_until` and before the
    /// next time event, in one step or several; x and its rate are those at t.
    /// @throws std::logic_error if t lies beyond that
    void skip_to(const Instant& t, std::span<const double> x, std::span<const double> dxdt)
    {
        monitor_->skip_to(t, taken(x), checked(dxdt, x.size()));
    }

    /// The side of its surface that a guard is on.
    /// @throws std::out_of_range naming the guard asked for and the number of guards.
    [[nodiscard]] Side side(std::size_t guard) const { return monitor_->side(guard); }

    [[nodiscard]] Outcome outcome() const noexcept { return monitor_->run().outcome; }
    /// The guard that ended the run, or `no_guard`.
    [[nodiscard]] std::size_t guard() const noexcept { return monitor_->run().guard; }
    /// Text of the `StopRun` that ended the run.
    [[nodiscard]] const std::string& reason() const noexcept { return monitor_->run().reason; }
    [[nodiscard]] const Statistics& statistics() const noexcept
    {
        return monitor_->run().statistics;
    }
    /// Events since `clear_events`, in the order in which they happened.
    [[nodiscard]] std::span<const Event<State>> events() const
    {
        const auto& events = monitor_->run().events;
        if constexpr (same) {
            return events;
        } else {
            for (std::size_t i = shown_.events.size(); i < events.size(); ++i) {
                shown_.events.push_back(detail::as_callers(events[i], State{}));
            }
            return shown_.events;
        }
    }
    void clear_events() noexcept
    {
        shown_.events.clear();
        monitor_->clear_events();
    }

    /// State of the monitor between two steps, on which its future depends.
    [[nodiscard]] Snapshot save() const { return monitor_->save(); }
    /// @throws std::invalid_argument if the snapshot is of another system, or does not hold a valid
    /// state; then nothing has changed.
    void restore(const Snapshot& snapshot)
    {
        monitor_->restore(snapshot);
        shown_.events.clear();
    }

private:
    EventMonitor(detail::Owner<const System> system, const X& like, const MonitorOptions& options,
                 const Detector& detector, const Locator& locator)
        : EventMonitor(*system, like, options, detector, locator)
    {
        own_ = std::move(system);
    }

    /// Type of the states of the engine.
    using Core = detail::CoreState<X>;
    static constexpr bool same = std::is_same_v<State, Core>;

    /// What `cut` and `events` return where the states of the engine are of another type.
    struct Shown {
        Cut<State> cut;
        std::vector<Event<State>> events;
    };

    class Parts {
    public:
        Parts(const System& system, const X& like, const Detector& detector, const Locator& locator)
            : adapter_(system, like), detector_(detector), locator_(locator)
        {
            detail::check_bound_declarations<System, X>();
        }
        Parts(const Parts&) = delete;
        Parts& operator=(const Parts&) = delete;

        [[nodiscard]] detail::RunBindings<Core> setup() noexcept
        {
            return {.system = &table,
                    .adapter = &adapter_,
                    .detector = detail::DetectorTableOf<Detector, System, X>::make(detector_),
                    .detecting = &detector_,
                    .locator = detail::locator_table<Locator>(),
                    .locating = &locator_};
        }

    private:
        /// Guards see whole states, because a host's interpolant need not be a polynomial.
        [[nodiscard]] static constexpr detail::SystemTable<Core> of_whole_states() noexcept
        {
            detail::SystemTable<Core> table = detail::system_table<System, X>;
            table.guard_on = nullptr;
            table.rate_on = nullptr;
            return table;
        }
        static constexpr detail::SystemTable<Core> table = of_whole_states();

        detail::SystemAdapter<System, X> adapter_;
        Detector detector_;
        Locator locator_;
    };

    [[nodiscard]] static Options engine_options(const MonitorOptions& options)
    {
        constexpr double infinity = std::numeric_limits<double>::infinity();
        Options out{.t_end = options.backward ? -infinity : infinity,
                    .event_tolerance = options.event_tolerance,
                    .event_rtol = options.event_rtol,
                    .event_window = options.event_window,
                    .check_inside = options.check_inside,
                    .record_events = options.record_events,
                    .event_states = options.event_states};
        Options finite = out;
        finite.t_end = options.backward ? -1 : 1;
        validate(finite, false, "EventMonitor");
        return out;
    }

    template <class S>
    static void interpolate(const void* step, double s, double* x, std::size_t n)
    {
        static_cast<const S*>(step)->interpolate(s, std::span<double>(x, n));
    }
    template <class S>
    static void interpolate_rate(const void* step, double s, double* dxdt, std::size_t n)
    {
        static_cast<const S*>(step)->interpolate_rate(s, std::span<double>(dxdt, n));
    }
    template <class S>
    static void restep(const void* step, double s, double* x, std::size_t n)
    {
        static_cast<const S*>(step)->restep(s, std::span<double>(x, n));
    }

    [[nodiscard]] std::size_t dimension() const noexcept
    {
        if constexpr (detail::is_small<Core>) return room_.size();
        return monitor_->x().size();
    }

    [[nodiscard]] static const double* checked(std::span<const double> x, std::size_t n)
    {
        if (x.size() != n) detail::throw_wrong_size(n, x.size());
        return x.data();
    }

    [[nodiscard]] const Core& taken(std::span<const double> x)
    {
        if constexpr (detail::is_small<Core>) (void)checked(x, room_.size());
        detail::copy_state(x, room_);
        return room_;
    }

    detail::Owner<const System> own_;  ///< where it was a temporary
    detail::Owner<Parts> parts_;
    detail::Owner<detail::AnyMonitor<Core>> monitor_;
    Core room_;
    mutable Shown shown_;
};

}  // namespace ricochet
