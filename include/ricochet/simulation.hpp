// A run in progress: smooth steps, events, resets, until the end or a reason to stop.
//
//     step from (t, x)              the method, as a departure from the tangent
//     guards at its end             screened together
//     search                        the first set of events in the step
//     resets                        x⁻ becomes x⁺, the mode may change
//     arming                        every guard again; guards that a reset carried across fire
//
// Steps are half-open, (t, t + h]. Between the first step and the last nothing is allocated for
// states of fixed size, unless something is recorded.
//
// The loop itself is compiled in the library (detail/core.hpp); this header makes its tables
// of a system, a method, a detector and a locator.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/base/detail/owner.hpp"
#include "ricochet/bounds.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/declarations.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/options.hpp"
#include "ricochet/run.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

namespace detail {

/// Parts of a run besides its start and its options, at addresses that do not change.
template <class System, class X, class Stepping, class Detector, class Locator>
class RunComponents {
    static_assert(
        requires { typename Stepping::method; },
        "ricochet: found no stepping behind the options; expected ErrorControlled<Method> or "
        "FixedStep<Method>, such as ErrorControlled<Fehlberg78>{}");
    using Method = typename Stepping::method;
    using C = CoreState<X>;
    static constexpr bool error_controlled = std::is_same_v<Stepping, ErrorControlled<Method>>;
    static constexpr bool by_name = std::is_same_v<Method, MethodByName>;

    static_assert(by_name || ricochet::Method<Method>,
                  "ricochet: found stepping by a type that is no method; expected one with "
                  "template <class State> using Stepper, such as ThisStepper<S>");

    static_assert([] {
        // A system without a flow has been refused already.
        if constexpr (Flowing<System, X> && StateVector<X>) return check_declarations<System, X>();
        return true;
    }());

    [[nodiscard]] static constexpr bool estimates_error() noexcept
    {
        if constexpr (by_name) return true;
        if constexpr (!by_name) return has_error_estimate<typename Method::template Stepper<X>>;
    }
    static_assert(!error_controlled || estimates_error(),
                  "ricochet: error control needs a method with an error estimate, such as Dopri5");
    static_assert(!DetectorTableOf<Detector, System, X>::predicts ||
                      fixed_guard_count<System, X>() == 1,
                  "ricochet: a network predicts the events of one guard");

    /// Whether the method uses power series.
    static constexpr bool by_series = [] {
        if constexpr (NameOf<Method>::known || by_name) return false;
        if constexpr (!NameOf<Method>::known && !by_name) {
            return requires
            {
                KernelOf<System, X, Method>::on_series;
            };
        }
    }();

    [[nodiscard]] static constexpr QuietKernel<C> quiet() noexcept
    {
#if RICOCHET_INLINES_FLOWS
        using D = DetectorTableOf<Detector, System, X>;
        constexpr detail::Screening screening = detail::screening_of<Detector>;
        if constexpr (NameOf<Method>::known && fits_registers<X>) {
            using Kernel = KernelOf<System, X, Method>;
            if constexpr (!Guarded<System, X>) {
                return Kernel::template quiet<error_controlled, void>();
            } else if constexpr (fixed_guard_count<System, X>() == 1 && GuardAlone<System, X> &&
                                 !GuardsTogether<System, X> && !RatesTogether<System, X> &&
                                 !D::predicts && !defers_checks<Detector, System, X>()) {
                if constexpr (screening == detail::Screening::extremum) {
                    return Kernel::template quiet<error_controlled, Extremum>();
                } else if constexpr (screening == detail::Screening::ends) {
                    return Kernel::template quiet<error_controlled, Ends>();
                }
            }
        } else if constexpr (by_series) {
            // Guards without a power series are sampled by the loop.
            constexpr bool proves =
                screening == detail::Screening::extremum || screening == detail::Screening::every;
            constexpr bool one = fixed_guard_count<System, X>() == 1 && !D::predicts &&
                                 !defers_checks<Detector, System, X>();
            if constexpr (!Guarded<System, X> ||
                          (proves && one && KernelOf<System, X, Method>::on_series)) {
                return KernelOf<System, X, Method>::template quiet<error_controlled>();
            }
        }
#endif
        return nullptr;
    }

    /// The order that was chosen for the method.
    [[nodiscard]] int order() const noexcept
    {
        if constexpr (requires { adapter_.given_order; }) return adapter_.given_order;
        return 0;
    }

public:
    RunComponents(const System& system, const X& x0, const Stepping& stepping,
                  const Detector& detector, const Locator& locator)
        : adapter_(system, x0), stepping_(stepping), detector_(detector), locator_(locator)
    {
        check_bound_declarations<System, X>();
        if constexpr (requires { adapter_.prepare(stepping_.value); })
            adapter_.prepare(stepping_.value);
    }
    RunComponents(const RunComponents&) = delete;
    RunComponents& operator=(const RunComponents&) = delete;

    [[nodiscard]] SystemAdapter<System, X>& adapter() noexcept
    {
        return adapter_;
    }
    /// The method's name; Dormand and Prince's for one without a name.
    [[nodiscard]] MethodName method_name() const noexcept
    {
        if constexpr (by_name) return stepping_.value.name;
        if constexpr (NameOf<Method>::known) return NameOf<Method>::name;
        return MethodName::dopri5;
    }
    [[nodiscard]] RunBindings<C> setup() noexcept
    {
        return {.system = &system_table<System, X>,
                .adapter = static_cast<SystemAdapter<System, X>*>(&adapter_),
                .kernel = &kernel_for<System, X>(stepping_.value),
                .quiet = quiet(),
                .quiet_on_series = by_series,
                .error_controlled = error_controlled,
                .method_by_name = by_name,
                .order = order(),
                .stepping = written_type<Stepping>(),
                .detector = DetectorTableOf<Detector, System, X>::make(detector_),
                .detecting = &detector_,
                .locator = locator_table<Locator>(),
                .locating = &locator_};
    }

private:
    StepperAdapter<System, X, Method> adapter_;
    Stepping stepping_;
    Detector detector_;
    Locator locator_;
};

/// Drops records that are no longer in `run`: an exception, a restart or a snapshot has undone
/// them.
template <class X, class C>
void drop_undone(Run<X>& to, const Run<C>& run)
{
    const auto shorten = [](auto& records, std::size_t size) {
        if (records.size() <= size) return;
        records.erase(records.begin() + static_cast<std::ptrdiff_t>(size), records.end());
    };
    shorten(to.events, run.events.size());
    shorten(to.trajectory.t, run.trajectory.t.size());
    shorten(to.trajectory.x, run.trajectory.x.size());
    shorten(to.phases, run.phases.size());
    shorten(to.reactions, run.reactions.size());
    if (to.solution.size() > run.solution.size()) to.solution.shrink(run.solution.size());
}

/// Adds what is new in a run with phases.
template <class X, class C>
void update_phases(Run<X>& to, const Run<C>& run)
{
    const auto add = [](auto& records, const auto& all) {
        records.insert(records.end(), all.begin() + static_cast<std::ptrdiff_t>(records.size()),
                       all.end());
    };
    add(to.phases, run.phases);
    add(to.reactions, run.reactions);
    to.set_valued = run.set_valued;
    to.failure = run.failure;
    to.reaction = run.reaction;
}

/// Brings `to` up to date with `run`, converting only the records that are new.
template <class X>
void update(Run<X>& to, const Run<CoreState<X>>& run, const X& like)
{
    const auto convert = [&](const CoreState<X>& x) { return as_callers(x, like); };
    to.outcome = run.outcome;
    to.t = run.t;
    to.x = convert(run.x);
    to.mode = run.mode;
    to.guard = run.guard;
    to.other_guard = run.other_guard;
    to.reason = run.reason;
    to.armed_beyond = run.armed_beyond;
    to.armed_on_surface = run.armed_on_surface;
    to.statistics = run.statistics;
    if (!run.phases.empty()) update_phases(to, run);
    if (to.events.empty()) to.events.reserve(run.events.size());
    for (std::size_t i = to.events.size(); i < run.events.size(); ++i) {
        to.events.push_back(as_callers(run.events[i], like));
    }
    for (std::size_t i = to.trajectory.x.size(); i < run.trajectory.x.size(); ++i) {
        to.trajectory.t.push_back(run.trajectory.t[i]);
        to.trajectory.x.push_back(convert(run.trajectory.x[i]));
    }
    to.solution.add_from(run.solution, convert);
    if (run.wrong_bound) {
        const auto& wrong = *run.wrong_bound;
        to.wrong_bound = {.guard = wrong.guard,
                          .lower_bound = wrong.lower_bound,
                          .upper_bound = wrong.upper_bound,
                          .t = wrong.t,
                          .x = convert(wrong.x),
                          .value = wrong.value,
                          .since = wrong.since,
                          .value_then = wrong.value_then,
                          .allowed = wrong.allowed};
    }
}

template <class X>
void add_event(void* events, const Event<CoreState<X>>& event);

// Compiled in the library.
extern template void update(Run<std::array<double, 1>>&, const Run<SmallState>&,
                            const std::array<double, 1>&);
extern template void add_event<std::array<double, 1>>(void*, const Event<SmallState>&);
extern template void update(Run<std::array<double, 2>>&, const Run<SmallState>&,
                            const std::array<double, 2>&);
extern template void add_event<std::array<double, 2>>(void*, const Event<SmallState>&);
extern template void update(Run<std::array<double, 3>>&, const Run<SmallState>&,
                            const std::array<double, 3>&);
extern template void add_event<std::array<double, 3>>(void*, const Event<SmallState>&);
extern template void update(Run<std::array<double, 4>>&, const Run<SmallState>&,
                            const std::array<double, 4>&);
extern template void add_event<std::array<double, 4>>(void*, const Event<SmallState>&);

/// A run with states of the caller's type.
template <class X>
[[nodiscard]] Run<X> as_callers(Run<CoreState<X>>&& run, const X& like)
{
    if constexpr (std::is_same_v<X, CoreState<X>>) {
        return std::move(run);
    } else {
        Run<X> out;
        update(out, run, like);
        return out;
    }
}

/// Adds an event to a vector of those of the caller's type, an array.
template <class X>
void add_event(void* events, const Event<CoreState<X>>& event)
{
    auto& all = *static_cast<std::vector<Event<X>>*>(events);
    struct Converted {
        const Event<CoreState<X>>& event;
        operator Event<X>() const { return as_callers(event, X{}); }
    };
    make_room(all);
    all.emplace_back(Converted{event});  // in its place, without a copy
}

/// The whole run of a set-up.
template <class X>
[[nodiscard]] Run<X> run_for_caller(RunBindings<CoreState<X>> setup, const X& x0,
                                    const Options& options)
{
    if constexpr (std::is_same_v<CoreState<X>, SmallState> && is_array<X>) {
        std::vector<Event<X>> events;
        setup.add_event = &add_event<X>;
        setup.events = &events;
        Run<X> out;
        const auto take = [](void* to, const Run<SmallState>& run) {
            update(*static_cast<Run<X>*>(to), run, X{});
        };
        run_whole<SmallState>(setup, core_state(x0), options, take, &out);
        out.events = std::move(events);
        return out;
    } else {
        return as_callers<X>(run_whole(setup, core_state(x0), options), x0);
    }
}

/// The loop of a simulation. A system with set_valued() has another one (nonsmooth/hand_over.hpp).
template <class System, class X, class Stepping, class Detector>
class LoopOf {
    static_assert(has_flow_alone<System>());

public:
    LoopOf() = default;
    template <class Parts>
    LoopOf(const System& /*system*/, Parts& parts, const X& x0, const Options& options)
        : loop_(make_loop(parts.setup(), core_state(x0), options))
    {
    }
    [[nodiscard]] AnyLoop<CoreState<X>>* operator->() const noexcept { return &*loop_; }

private:
    Owner<AnyLoop<CoreState<X>>> loop_;
};

}  // namespace detail

/// A run that the caller drives, from (t_start, x0) to t_end.
///
/// With the mode q, the method's map Phi(h; q, t, x), guards g_i, each armed on a side, and
/// resets r_i, one `step` is
///
///     h        = the length that error control or `Options::step` asks for, at most up to t_end
///                and to the next time event; shorter until the error of Phi(h; q, t, x) is
///                accepted
///     F, s     = the earliest set of acting guards that leave their side within (0, h], and its
///                offset; nothing and h if there is none
///     record the events of all other guards within (0, s], located on the step's polynomial
///     t, x⁻    = t + s, Phi(s; q, t, x), moved along the flow by the rounding that keeps a guard
///                of F on its side
///     while F is not empty:
///         x⁺, q⁺   = r_F(q, t, x⁻); resets of F that change a common component follow each other
///         x⁺, q⁺   = rest(t, x⁺) where the events of a guard of F accumulate at t
///         record (t, F, q, x⁻, q⁺, x⁺)
///         arm every guard at (q⁺, t, x⁺): on its sign, or on its surface on the sign of its rate
///         F        = the guards that x⁺ has carried across their surfaces in their direction, and
///                    those on their surfaces that the flow of q⁺ carries across and that of q did
///                    not
///         x⁻, q    = x⁺, q⁺
///     x        = x⁻
///
/// (after a rest in the same mode, if the flow presses on the guard: the components of x that
/// `rest` sets without regard to x stand still until the flow lifts the guard, or an event changes
/// one of them or the mode)
///
/// (the run ends where F, q and x⁻ repeat, or a guard fires for the thousandth time at t)
///
/// so that steps are half-open, (t, t + h]: a zero at the end of a step belongs to it, a zero at
/// its start to the step before. A guard acts if it has a reset or may end the run. The set F does
/// not depend on the order in which guards are declared. Events are those of one call of
/// `integrate`, however the caller drives the run.
///
/// Exceptions from the functions of the system pass through unchanged. The simulation is then at
/// the end of its last complete step with its events (in `take`: or at the start of the steps
/// without events that led there), and the next call continues with the bits of a run in which
/// nothing was thrown.
template <class System, class X = detail::DeclaredState<System>,
          class Stepping = ErrorControlled<Dopri5>, class Detector = Extremum,
          class Locator = Newton>
class Simulation {
    static_assert(detail::check_system<System, X>());
    using Parts = detail::RunComponents<System, X, Stepping, Detector, Locator>;
    using C = detail::CoreState<X>;
    static constexpr bool same = std::is_same_v<X, C>;

public:
    /// Prepares a run with the arguments and errors of `integrate`. Keeps a reference to `system`,
    /// and a temporary one itself.
    Simulation(const System& system, const X& x0, const Options& options,
               const Stepping& stepping = {}, const Detector& detector = {},
               const Locator& locator = {})
        : parts_(new Parts(system, x0, stepping, detector, locator)),
          loop_(system, *parts_, x0, options),
          shown_(x0)
    {
    }
    Simulation(System&& system, const X& x0, const Options& options, const Stepping& stepping = {},
               const Detector& detector = {}, const Locator& locator = {})
        : Simulation(detail::Owner<const System>(new System(std::move(system))), x0, options,
                     stepping, detector, locator)
    {
    }
    /// {10, 0, 1} for two components, or {10}, where the others would silently be zero.
    template <std::size_t given>
    requires(detail::fixed_size<X>() > 0 && detail::fixed_size<X>() != given)
        Simulation(const System&, const double (&)[given], const Options&, const Stepping& = {},
                   const Detector& = {}, const Locator& = {})
        : shown_(X{})
    {
        static_assert(
            given == detail::fixed_size<X>(),
            "ricochet: found a start with another number of components than System::State");
    }
    template <std::size_t given>
    requires(detail::fixed_size<X>() > 0 && detail::fixed_size<X>() != given)
        Simulation(System&& system, const double (&x0)[given], const Options& options,
                   const Stepping& stepping = {}, const Detector& detector = {},
                   const Locator& locator = {})
        : Simulation(std::as_const(system), x0, options, stepping, detector, locator)
    {
    }

    [[nodiscard]] double t() const noexcept { return loop_->t(); }  ///< [s]
    [[nodiscard]] const X& x() const noexcept
    {
        if constexpr (same) {
            return loop_->x();
        } else {
            shown_.asked = true;
            detail::copy_state(loop_->x(), shown_.x);
            return shown_.x;
        }
    }
    [[nodiscard]] Mode mode() const noexcept { return loop_->mode(); }
    /// The reactions of a system with set_valued() at `t`, after the events there; empty where the
    /// mode has no inclusion, NaN where none follows.
    [[nodiscard]] std::vector<double> reaction() const { return loop_->reaction(); }
    [[nodiscard]] bool ended() const noexcept { return loop_->ended(); }
    /// Result so far; `finish` brings its time and state up to date.
    [[nodiscard]] const Run<X>& run() const
    {
        if constexpr (same) {
            return loop_->run();
        } else {
            shown_.asked_run = true;
            update_run();
            return shown_.run;
        }
    }

    /// Cost and savings of the network of a `Metered` detector so far.
    [[nodiscard]] MeterReading meter() const requires detail::Metering<Detector>
    {
        return loop_->meter();
    }

    /// Takes one step, with any events that it holds. False: the run has ended. A detector
    /// that defers checks does not look ahead here, since every step is final.
    bool step()
    {
        const bool goes_on = loop_->step();
        refresh();
        return goes_on;
    }

    /// Advances to the next sample time or event, recorded events included. What happens at one
    /// instant is shown once; `t`, `x` and `mode` are those there, after the events, and `run` may
    /// already hold what comes after them in the same step. Events whose states are not recorded
    /// (`Options::event_states`) are shown at the end of their step. False: the run has ended, and
    /// everything that happened in it has been shown.
    bool advance()
    {
        const bool goes_on = loop_->advance();
        refresh();
        return goes_on;
    }

    /// Advances to the end. Calls `observe(event)` for every recorded event that `advance` has not
    /// shown, those at the start and in the last `step` included, and `observe(simulation)` after
    /// every step, each if `observe` accepts it. Both see only final results: with the second, no
    /// detector looks ahead.
    template <class Observer>
    void run_to_end(Observer&& observe)
    {
        constexpr bool watches_steps = requires
        {
            observe(std::as_const(*this));
        };
        const auto& events = loop_->run().events;
        std::size_t seen = loop_->shown_events();
        loop_->show_all();
        const auto show_new = [&] {
            if constexpr (requires(const Event<X>& event) { observe(event); }) {
                if (seen < events.size()) loop_->show_all();
                while (seen < events.size()) show(events[seen++], observe);
            }
        };
        show_new();
        while (!ended()) {
            loop_->advance_once(!watches_steps);
            refresh();
            show_new();
            if constexpr (watches_steps) observe(std::as_const(*this));
        }
        loop_->show_all();
    }

    /// Advances to the end and returns the result.
    [[nodiscard]] Run<X> take() { return detail::as_callers<X>(loop_->take(), shown_.x); }

    /// Ends the simulation and returns the result so far; before the end its outcome is
    /// `cancelled`.
    [[nodiscard]] Run<X> finish() { return detail::as_callers<X>(loop_->finish(), shown_.x); }

    /// State on which the future of the run depends. A simulation of the same system with the same
    /// options, stepping, detector and locator that restores it continues with the same
    /// bits; only its end, its sample times and what it records may differ. Recorded
    /// results are not part of it.
    [[nodiscard]] Snapshot save() { return loop_->save(); }

    /// @throws std::invalid_argument naming what does not agree if the snapshot is of another
    /// run, or does not hold a valid state; then nothing has changed.
    void restore(const Snapshot& snapshot)
    {
        loop_->restore(snapshot);
        refresh();
    }

    /// Goes on from (t, x) in a mode, as from a start: guards are armed and the first step is
    /// estimated again, and `advance` shows first what happens there. An event of `Times` or
    /// `next_time_event(t)` at t belongs to the past; a timer of `next_time_event(t, x)` that is
    /// due there has its event. For interventions and co-simulation: t may be any time from t_start
    /// to before t_end, also one that `advance` has stopped at inside a step; what was recorded
    /// after it is dropped. A run that has ended goes on, unless its result was taken.
    ///
    /// @throws std::invalid_argument if t lies outside of the run, or `integrate` would refuse such
    /// a start; then nothing has changed.
    void restart(double t, const X& x, Mode mode)
    {
        loop_->restart(t, detail::core_state(x), mode);
        if constexpr (!same) shown_.run = {};
        refresh();
    }
    void restart(double t, const X& x) { restart(t, x, mode()); }

    /// Moves the end of the run to `t_end`, which must lie ahead of the last step. A run that has
    /// reached its end goes on, unless its result was taken.
    ///
    /// @throws std::invalid_argument if it does not; then nothing has changed.
    void extend(double t_end)
    {
        loop_->extend(t_end);
        refresh();
    }

private:
    Simulation(detail::Owner<const System> system, const X& x0, const Options& options,
               const Stepping& stepping, const Detector& detector, const Locator& locator)
        : Simulation(*system, x0, options, stepping, detector, locator)
    {
        own_ = std::move(system);
    }

    /// Result of a run with states of another type than the loop's.
    struct Shown {
        explicit Shown(const X& like) : x(like) {}
        X x;
        Run<X> run;
        bool asked = false, asked_run = false;  ///< references to them are kept up to date
    };

    void refresh()
    {
        if constexpr (!same) {
            if (shown_.asked) detail::copy_state(loop_->x(), shown_.x);
            if (shown_.asked_run) update_run();
        }
    }
    void update_run() const
    {
        detail::drop_undone(shown_.run, loop_->run());
        detail::update(shown_.run, loop_->run(), shown_.x);
    }

    template <class Observer>
    void show(const Event<C>& event, Observer& observe) const
    {
        if constexpr (same) {
            observe(event);
        } else {
            const Event<X> shown = detail::as_callers<X>(event, shown_.x);
            observe(shown);
        }
    }

    detail::Owner<const System> own_;  ///< where it was a temporary
    detail::Owner<Parts> parts_;

protected:
    detail::LoopOf<System, X, Stepping, Detector> loop_;

private:
    mutable Shown shown_;
};

}  // namespace ricochet
