// One run of an inclusion by two integrators, each for the phases that suit it.
//
//     event-driven   while every reaction is at a bound or held: an ordinary differential
//                    equation (branch_modes.hpp), any explicit stepper, changes located to the
//                    step map
//     set-valued     where that is impossible: simultaneous changes, reactions that y' = 0 does
//                    not determine, accumulating switches, and sets without such branches.
//                    Bathe's steps, until the active set is determined again
//
// The reaction with which a phase starts is the minimal selection. Systems that declare no
// inclusion include none of these headers.
#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <stdexcept>
#include <type_traits>

#include "ricochet/detail/event_loop.hpp"
#include "ricochet/detail/given_inclusion.hpp"
#include "ricochet/detail/hand_over_run.hpp"
#include "ricochet/detail/hand_over_watches.hpp"
#include "ricochet/detail/inclusion_sizes.hpp"
#include "ricochet/detail/padded_run.hpp"
#include "ricochet/detail/phased_run.hpp"
#include "ricochet/detail/refusals.hpp"
#include "ricochet/detail/refused_calls.hpp"
#include "ricochet/integrate/integrate.hpp"

namespace ricochet {

/// `Stepping` of the event-driven phases: `ErrorControlled<Method>`, or `FixedStep<Method>` with
/// `set_valued.step`.
template <Inclusion System, class Stepping = ErrorControlled<Dopri5>>
class HandOver {
    static_assert(detail::check_inclusion<System>());
    // Of the solvers.
    static constexpr int N = detail::solver_components<state_size<System>, reaction_size<System>>;
    static constexpr int M = detail::solver_reactions<state_size<System>, reaction_size<System>>;

public:
    using Vector = StateOf<System>;
    using Reaction = ReactionOf<System>;
    using State = SetValuedState<System>;

    /// @throws std::invalid_argument for invalid options, systems and initial
    /// states.
    HandOver(const System& system, const Vector& w0, const HandOverOptions& options)
        : by_(detail::make_hand_over<N, M>(detail::solver_inclusion(system), detail::resized<N>(w0),
                                           options, stepping()))
    {
    }

    /// Starts from the state of an earlier run, with its reaction.
    /// @throws std::invalid_argument also if the reaction lies outside the set.
    HandOver(const System& system, const State& start, const HandOverOptions& options)
        : by_(detail::make_hand_over<N, M>(detail::solver_inclusion(system),
                                           detail::resized<N, M>(start), options, stepping()))
    {
    }

    /// Advances to the end and returns the result, whatever the outcome.
    [[nodiscard]] HandOverRun<System> take()
    {
        return {detail::resized_run<state_size<System>, reaction_size<System>>(
            detail::take_run<N, M>(*by_))};
    }

private:
    [[nodiscard]] static detail::EventStepping<N, M> stepping()
    {
        if constexpr (Branching<System>) {
            constexpr bool controlled =
                std::is_same_v<Stepping, ErrorControlled<typename Stepping::method>>;
            if constexpr (std::is_same_v<Stepping, ErrorControlled<Dopri5>>) {
                return {&detail::make_dopri5_loop<N, M>, controlled};
            } else {
                return {&detail::make_event_loop<N, M, Stepping>, controlled};
            }
        } else {
            return {};
        }
    }

    std::shared_ptr<detail::AnyHandOver<N, M>> by_;
};

/// Runs a whole inclusion in one call.
template <Inclusion System, class Stepping = ErrorControlled<Dopri5>>
[[nodiscard]] HandOverRun<System> hand_over(const System& system, const StateOf<System>& w0,
                                            const HandOverOptions& options,
                                            const Stepping& /*stepping*/ = {})
{
    return HandOver<System, Stepping>(system, w0, options).take();
}

/// Rejects, with a sentence at compile time, a system that is not an inclusion; never called.
template <class System, class... Stepping>
requires(!Inclusion<System>)  //
    auto hand_over(const System& /*system*/, const detail::AnyStartGiven& /*w0*/,
                   const HandOverOptions& /*options*/, const Stepping&... /*stepping*/)
{
    return detail::refuse_no_inclusion<System>();
}

}  // namespace ricochet

#if RICOCHET_ALIGNED_AS_LIBRARY
RICOCHET_EVENTS_OF(1, 1, Fehlberg78, extern)
RICOCHET_EVENTS_OF(3, 1, Fehlberg78, extern)
#else
#include "ricochet/nonsmooth/solvers.hpp"
#endif

namespace ricochet {

// Hybrid systems that also declare their motion as an inclusion.
//
// A system with a flow and guards of its own may declare
//
//     set_valued()         an Inclusion (inclusion.hpp) of the same state; or, with modes,
//     set_valued(mode)     one for each mode, or a std::optional that is empty where a mode has
//     none start_mode(mode, t, x)  the mode in which its own flow continues from (t, x) after the
//                          inclusion of `mode`; also start_mode(t, x). By default `mode`, which
//                          only set_valued(mode) allows
//     change(k, kind, mode, t, x)  the reset of a stick, slip or mode of reaction k: may change x,
//                          and returns the next mode; without modes void change(k, kind, t, x)
//
// The loop then follows the system's own flow while every y is clear of zero, farther from it than
// 1000 (atol + rtol |w|) over the components that y reads, and the inclusion elsewhere: at the
// start, after every set of events, and where a y arrives at zero. All guards, resets and time
// events of the system are watched in both. A guard that vanishes where a y does stands for that
// reaction: its event is then a `stick`, a `mode` or a `touch` of the reaction. Where changes of
// reactions accumulate, chatter or contradict one another, implicit steps are taken.
//
// `integrate` and `Simulation` follow boxes of at most four reactions beside a state of a fixed
// size in this way, by the methods of the library with error control. Other systems are followed by
// `integrate` alone, in runs by events and by the inclusion, one after the other: the inclusion
// takes over where switchings accumulate or chatter, where a motion presses on its guard, or where
// resets contradict one another. Meanwhile guards are not evaluated, and the guard where the motion
// may come to rest must be `unilateral`, or of `either` direction and without modes.
//
// Inclusions without events of their own are given to `integrate` directly.

template <class System>
concept KnowsInclusion = requires
{
    requires Inclusion<detail::InclusionOf<System>>;
};

/// Result of a run. A `stick`, `mode` or `touch` has the lowest guard that stands for the reaction
/// among those that fired, or none, a `slip` has none, and `Event::reaction` is the reaction. Of a
/// run in parts (see above) `Event::guard` is the index of the reaction.
template <class X>
struct MixedRun {
    Outcome outcome = Outcome::reached_end;
    double t = 0;
    X x{};
    Mode mode = 0;
    /// As in `Run`: the guard that ended the run, and the other one of two that conflict.
    std::size_t guard = no_guard, other_guard = no_guard;
    std::string reason;  ///< text of the `StopRun` that ended the run
    std::vector<Event<X>> events;
    std::vector<Phase> phases;
    Trajectory<X> trajectory;  ///< at the sample times
    Solution<X> solution;      ///< with `Options::record_steps`
    HandOverStatistics statistics;
    StageReport failure;  ///< set with `not_converged`
};

namespace detail {

template <class To, class From>
[[nodiscard]] To converted_state(const From& from, To like)
{
    for (std::size_t i = 0; i < static_cast<std::size_t>(from.size()); ++i) {
        like[static_cast<decltype(like.size())>(i)] = from[static_cast<decltype(from.size())>(i)];
    }
    return like;
}

/// Whether a guard without a reset of the state switches within the resolution of the steps: 200
/// crossings in a row between which the guard moves, on average, at most a thousand times the
/// error of a step. Error control then determines the number of switches, not the motion.
class SwitchingWatch {
public:
    /// Reviews the events recorded so far; `error` is the error of a step.
    template <class X, class Error>
    [[nodiscard]] bool operator()(const std::vector<Event<X>>& events, const Error& error)
    {
        for (; seen_ < events.size(); ++seen_) {
            const Event<X>& event = events[seen_];
            const bool switches =
                event.kind == EventKind::crossing && same_state(event.after, event.before);
            // The excursion of a parabola between two zeros.
            if (switches && count_ > 0) excursions_ += std::abs(event.slope * (event.t - t_)) / 4;
            t_ = event.t;
            if (!switches) count_ = 0;
            if (switches) ++count_;
            if (count_ > most_events) {
                if (excursions_ <= most_events * 1000 * error()) return true;
                count_ = 1;
            }
            if (count_ <= 1) excursions_ = 0;
        }
        return false;
    }

private:
    static constexpr int most_events = 200;
    std::size_t seen_ = 0;
    int count_ = 0;
    double t_ = 0;
    double excursions_ = 0;
};

}  // namespace detail

template <KnowsInclusion System, class X, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
class EventHandOver {
public:
    using Set = detail::InclusionOf<System>;
    using Vector = StateOf<Set>;
    static_assert(detail::check_set_valued<System, X>());
    static_assert(!detail::has_inclusion_by_mode<System>,
                  "ricochet: found set_valued(mode) in a system that the loop cannot follow; "
                  "expected sets that are boxes of at most four reactions, a state of fixed size, "
                  "ErrorControlled<Method> with a method of the library, and Extremum, Ends or "
                  "Bernstein");

    EventHandOver(const System& system, const X& x0, const Options& options,
                  const Stepping& stepping, const Detector& detector, const Locator& locator)
        : system_(system),
          set_(system.set_valued()),
          options_(options),
          hand_over_(detail::completed(hand_over_options(options), false)),
          parts_(system, x0, stepping, detector, locator)
    {
        static_assert(!TimedByState<System, X>,
                      "ricochet: found next_time_event([mode,] t, x) and set_valued(); expected "
                      "next_time_event(t), Times time_events, or a guard");
        for (std::size_t i = 0; i < guard_count_of<X>(system); ++i) {
            if (guard_info_of<X>(system, i).stop_after > 1) {
                throw std::invalid_argument(
                    "integrate: a run that may be handed over counts the events of a guard in "
                    "each phase by itself, and has no stop_after above 1");
            }
        }
        run_.t = options.t_start;
        run_.x = x0;
        run_.mode = options.mode;
        hand_over_.until_released = true;
    }

    /// Advances to the end and returns the result, whatever the outcome.
    [[nodiscard]] MixedRun<X> take()
    {
        bool ended = false;
        PhaseCause cause = PhaseCause::start;
        while (!ended) {
            run_.phases.push_back({.from = run_.t, .set_valued = false, .cause = cause});
            if (const auto end = follow_events()) {
                ended = follow_inclusion(*end);
                cause = PhaseCause::released;
                if (!ended) ++run_.statistics.to_events;
            } else {
                ended = true;
            }
        }
        return std::move(run_);
    }

private:
    /// Reason for which the inclusion is to continue; empty if the run is over.
    [[nodiscard]] std::optional<PhaseCause> follow_events()
    {
        if (steps_taken() >= options_.max_steps) {
            run_.outcome = Outcome::step_limit;
            return std::nullopt;
        }
        Options options = options_;
        options.t_start = run_.t;
        options.mode = run_.mode;
        options.continues = options_.continues || run_.phases.size() > 1;
        options.sample_times = remaining_samples();
        options.max_steps = options_.max_steps - steps_taken();
        options.record_events = true;  // the watches below review them
        detail::Owner<detail::AnyLoop<detail::CoreState<X>>> loop;
        try {
            loop = detail::make_loop(parts_.setup(), detail::core_state(run_.x), options);
        } catch (const detail::StartRefused&) {
            if (run_.phases.size() == 1) throw;  // the start of the caller
            return PhaseCause::stuck;
        }
        detail::ChatterWatch watch(run_.t, hand_over_.set_valued.step / 100);
        detail::SwitchingWatch switches;
        bool chatters = false;
        while (!chatters && loop->step()) {
            chatters = watch(loop->t(), loop->run().statistics.events) ||
                       switches(loop->run().events, [&] { return error_of(loop->x()); });
        }
        Run<X> done = detail::as_callers<X>(loop->finish(), run_.x);
        run_.t = done.t;
        run_.x = done.x;
        run_.mode = done.mode;
        run_.reason = done.reason;
        if (options_.record_events) {
            std::move(done.events.begin(), done.events.end(), std::back_inserter(run_.events));
        }
        append(done.trajectory);
        detail::add(run_.statistics.event_driven, done.statistics);
        if (chatters) return PhaseCause::chattering;
        const auto cause = detail::cause_after(done.outcome);
        if (cause && is_near_surface()) return cause;
        run_.outcome = done.outcome;
        run_.guard = done.guard;
        run_.other_guard = done.other_guard;
        return std::nullopt;
    }

    /// Whether some reaction may hold its y here. Where all y are farther from zero than the error
    /// of a thousand steps, what ends the events has nothing to do with the inclusion.
    [[nodiscard]] bool is_near_surface() const
    {
        constexpr int N = detail::solver_components<state_size<Set>, reaction_size<Set>>;
        constexpr int M = detail::solver_reactions<state_size<Set>, reaction_size<Set>>;
        const detail::AnyMatrices<N, M> matrices(detail::solver_inclusion(set_));
        if (!matrices.traits().of_reactions()) return true;
        Vector w(static_cast<Eigen::Index>(run_.x.size()));
        typename detail::AnyMatrices<N, M>::Reaction y;
        matrices.observed(run_.t, detail::resized<N>(detail::converted_state(run_.x, w)), y);
        return y.head(matrices.own_reactions()).cwiseAbs().minCoeff() <= 1e3 * error_of(run_.x);
    }

    /// Whether the run is over.
    bool follow_inclusion(PhaseCause cause)
    {
        const double from = run_.t;
        run_.phases.push_back({.from = from, .set_valued = true, .cause = cause});
        ++run_.statistics.to_set_valued;
        double due = next_time_event();
        while (follow_inclusion_until(due)) {
            bool changes = false;
            for (std::size_t entries = time_events_at(due); entries > 0; --entries) {
                if (!apply_time_event(due, changes)) return true;
            }
            if (changes) return false;
            due = next_time_event();
        }
        if (run_.outcome != Outcome::released) return true;
        if (!(run_.t > from)) {
            // The inclusion holds no reaction, and the event-driven run cannot continue from this
            // state.
            run_.outcome = Outcome::not_handed_over;
            return true;
        }
        run_.mode = start_mode();
        return false;
    }

    /// Follows the inclusion, at most until the time event that is due next; whether it was
    /// reached.
    bool follow_inclusion_until(double due)
    {
        if (!(due > run_.t)) {
            run_.outcome = Outcome::time_event_not_ahead;
            return false;
        }
        const bool stops = due <= options_.t_end;
        HandOverOptions options = hand_over_;
        options.t_start = run_.t;
        options.sample_times = remaining_samples();
        if (stops) {
            options.t_end = due;
            // A sample at the time of an event shows the state after it.
            std::erase_if(options.sample_times, [&](double t) { return t >= due; });
        }
        options.max_steps -= std::min(options.max_steps, steps_taken());
        Vector w(static_cast<Eigen::Index>(run_.x.size()));
        w = detail::converted_state(run_.x, w);
        HandOver<Set> inclusion(set_, w, options);
        HandOverRun<Set> done = inclusion.take();
        if (options_.record_events) {
            for (const auto& event : done.events) run_.events.push_back(converted(event));
        }
        for (std::size_t i = 0; i < done.trajectory.t.size(); ++i) {
            run_.trajectory.t.push_back(done.trajectory.t[i]);
            run_.trajectory.x.push_back(detail::converted_state(done.trajectory.x[i], run_.x));
        }
        detail::add(run_.statistics.event_driven, done.statistics.event_driven);
        detail::add(run_.statistics.set_valued, done.statistics.set_valued);
        run_.statistics.set_valued_time += done.state.t - run_.t;
        run_.t = done.state.t;
        run_.x = detail::converted_state(done.state.w, run_.x);
        run_.failure = done.failure;
        run_.outcome = done.outcome;
        // The last step may also release every reaction.
        const bool goes_on =
            done.outcome == Outcome::reached_end || done.outcome == Outcome::released;
        return stops && goes_on && run_.t == due;
    }

    /// The mode in which the system continues from here.
    [[nodiscard]] Mode start_mode() const
    {
        if constexpr (detail::StartsInMode<System, X>) {
            return system_.start_mode(run_.mode, run_.t, run_.x);
        } else if constexpr (detail::StartsMode<System, X>) {
            return system_.start_mode(run_.t, run_.x);
        } else {
            return run_.mode;
        }
    }

    // --- time events while the inclusion is followed ---

    /// The next time event; infinite if there is none.
    [[nodiscard]] double next_time_event() const
    {
        if constexpr (Timed<System>) {
            return detail::call_next_time_event(system_, run_.t);
        } else {
            return std::numeric_limits<double>::infinity();
        }
    }

    /// How many time events follow each other at a time that is one.
    [[nodiscard]] std::size_t time_events_at([[maybe_unused]] double t) const
    {
        if constexpr (detail::ListsTimes<System>) return detail::times_of(system_).count(t);
        return 1;
    }

    /// Records a time event and applies its reset. Events resume where that changes the state or
    /// the mode. False if the run ends.
    bool apply_time_event(double t, bool& changes)
    {
        Event<X> event;
        event.t = t;
        event.kind = EventKind::time;
        event.guard = no_guard;
        event.before = event.after = run_.x;
        event.bracket = {t, t};
        const Mode mode = start_mode();
        event.mode_before = mode;
        bool stops = false;
        try {
            event.mode_after = detail::call_time_reset(system_, mode, t, event.after);
        } catch (const StopRun& stop) {
            stops = true;
            event.mode_after = stop.mode().value_or(mode);
            run_.reason = stop.why();
        }
        changes = changes || event.mode_after != mode ||
                  event.after.size() != event.before.size() ||
                  !detail::same_state(event.after, event.before);
        if (changes) {
            run_.x = event.after;
            run_.mode = event.mode_after;
        }
        ++run_.statistics.event_driven.events;
        if (options_.record_events) run_.events.push_back(event);
        if (event.after.size() != event.before.size()) {
            run_.outcome = Outcome::wrong_dimension;
            return false;
        }
        if (!detail::all_finite(event.after)) {
            run_.outcome = Outcome::non_finite;
            return false;
        }
        if (stops) run_.outcome = Outcome::stopped_by_event;
        return !stops;
    }

    /// Error of a step that ends at state x.
    template <class State>
    [[nodiscard]] double error_of(const State& x) const
    {
        double largest = 0;
        for (const double component : x) largest = std::max(largest, std::abs(component));
        return options_.atol + options_.rtol * largest;
    }

    /// Number of steps of both kinds, including attempts.
    [[nodiscard]] std::uint64_t steps_taken() const noexcept
    {
        return run_.statistics.event_driven.steps + run_.statistics.set_valued.attempted;
    }

    [[nodiscard]] Event<X> converted(const Event<Vector>& from) const
    {
        Event<X> event;
        event.t = from.t;
        event.kind = from.kind;
        event.guard = from.guard;
        event.mode_before = event.mode_after = run_.mode;
        event.before = detail::converted_state(from.before, run_.x);
        event.after = detail::converted_state(from.after, run_.x);
        event.bracket = from.bracket;
        event.slope = from.slope;
        event.error = from.error;
        return event;
    }

    [[nodiscard]] std::vector<double> remaining_samples() const
    {
        const auto done = static_cast<std::ptrdiff_t>(run_.trajectory.t.size());
        return {options_.sample_times.begin() + done, options_.sample_times.end()};
    }
    void append(const Trajectory<X>& more)
    {
        run_.trajectory.t.insert(run_.trajectory.t.end(), more.t.begin(), more.t.end());
        run_.trajectory.x.insert(run_.trajectory.x.end(), more.x.begin(), more.x.end());
    }

    const System& system_;
    Set set_;
    Options options_;
    HandOverOptions hand_over_;
    detail::PartsOfRun<System, X, Stepping, Detector, Locator> parts_;
    MixedRun<X> run_;
};

namespace detail {

/// Whether the loop follows the inclusion of a system: a box of at most four reactions beside a
/// state of a fixed size, by one of the library's methods with error control, and a detector that
/// checks every step.
template <class System, class X, class Stepping, class Detector>
[[nodiscard]] consteval bool runs_in_phases()
{
    if constexpr (KnowsInclusion<System>) {
        using Set = InclusionOf<System>;
        using Method = typename Stepping::method;
        if constexpr (Branching<Set> && std::is_same_v<Stepping, ErrorControlled<Method>>) {
            return static_cast<int>(fixed_size<X>()) == state_size<Set> &&
                   (NameOf<Method>::known ||
                    std::is_same_v<Method, MethodByName>)&&!DetectorTableOf<Detector, System,
                                                                            X>::predicts &&
                   !defers_checks<Detector, System, X>();
        }
    }
    return false;
}

/// The loop of a system with set_valued().
template <class System, class X, class Stepping, class Detector>
requires(KnowsInclusion<System>) class LoopOf<System, X, Stepping, Detector> {
    using C = CoreState<X>;
    using Set = InclusionOf<System>;
    static_assert(check_set_valued<System, X>());
    static_assert(runs_in_phases<System, X, Stepping, Detector>(),
                  "ricochet: found a Simulation of a system with set_valued() that the loop cannot "
                  "follow; expected sets that are boxes of at most four reactions, a state of "
                  "fixed size, ErrorControlled<Method> with a method of the library, and Extremum, "
                  "Ends or Bernstein; or integrate");

public:
    LoopOf() = default;
    template <class Parts>
    LoopOf(const System& system, Parts& parts, const X& x0, const Options& options)
        : run_(make_phased_run<C>(setup(system, parts, options), core_state(x0), options))
    {
    }
    [[nodiscard]] AnyLoop<C>* operator->() const noexcept { return &run_->loop(); }
    [[nodiscard]] const PhasedRun<C>& phased() const noexcept { return *run_; }

private:
    template <class Parts>
    [[nodiscard]] static PhasedSetup<C> setup(const System& system, Parts& parts,
                                              const Options& options)
    {
        constexpr int N = solver_components<state_size<Set>, reaction_size<Set>>;
        constexpr int M = solver_reactions<state_size<Set>, reaction_size<Set>>;
        PhasedSetup<C> out;
        out.user = parts.setup();
        const BranchPhasesOptions solving = branch_options(options);
        out.by_mode = has_inclusion_by_mode<System>;
        for_each_inclusion(system, modes_with_inclusions(system), [&](const Set* set) {
            Owner<BranchPhases> phases;
            if (set) phases = make_branch_phases<N, M>(solver_inclusion(Set(*set)), solving);
            out.inclusions.push_back(std::move(phases));
        });
        out.method = parts.method_name();
        set_modes(out);
        return out;
    }
    [[nodiscard]] static std::size_t modes_with_inclusions(const System& system)
    {
        if constexpr (!has_inclusion_by_mode<System>) return 1;
        const std::size_t modes = mode_count_of(system);
        if (modes == 0 || modes > most_inclusions) {
            refuse_inclusion("set_valued(mode) goes with a mode_count of 1 to 4096, not",
                             static_cast<double>(modes));
        }
        return modes;
    }
    static void set_modes(PhasedSetup<C>& out)
    {
        if constexpr (StartsInMode<System, X>) {
            out.start_mode = [](void* door, Mode mode, double t, const C& x) -> Mode {
                auto& of = *static_cast<Door<System, X>*>(door);
                return of.system().start_mode(mode, t, of.read(x, 0));
            };
        } else if constexpr (StartsMode<System, X>) {
            out.start_mode = [](void* door, Mode, double t, const C& x) -> Mode {
                auto& of = *static_cast<Door<System, X>*>(door);
                return of.system().start_mode(t, of.read(x, 0));
            };
        }
        if constexpr (ChangesMode<System, X> || ChangesState<System, X>) {
            out.change = [](void* door, std::size_t reaction, EventKind kind, Mode mode, double t,
                            C& x) -> Mode {
                auto& of = *static_cast<Door<System, X>*>(door);
                return of.edit(x, [&](X& state) -> Mode {
                    if constexpr (ChangesMode<System, X>) {
                        return of.system().change(reaction, kind, mode, t, state);
                    } else {
                        of.system().change(reaction, kind, t, state);
                        return mode;
                    }
                });
            };
        }
    }

    Owner<PhasedRun<C>> run_;
};

/// A whole run in phases.
template <class System, class X, class Stepping, class Detector, class Locator>
[[nodiscard]] MixedRun<X> run_in_phases(const System& system, const X& x0, const Options& options,
                                        const Stepping& stepping, const Detector& detector,
                                        const Locator& locator)
{
    PartsOfRun<System, X, Stepping, Detector, Locator> parts(system, x0, stepping, detector,
                                                             locator);
    const LoopOf<System, X, Stepping, Detector> loop(system, parts, x0, options);
    Run<CoreState<X>> done = loop->take();
    MixedRun<X> out;
    out.phases = loop.phased().phases();
    out.statistics = loop.phased().statistics(done);
    if (done.outcome == Outcome::not_converged) out.failure = loop.phased().failure();
    Run<X> run = as_callers<X>(std::move(done), x0);
    out.outcome = run.outcome;
    out.t = run.t;
    out.x = run.x;
    out.mode = run.mode;
    out.guard = run.guard;
    out.other_guard = run.other_guard;
    out.reason = std::move(run.reason);
    out.events = std::move(run.events);
    out.trajectory = std::move(run.trajectory);
    out.solution = std::move(run.solution);
    return out;
}

/// Whether the library of inclusions is linked: its target defines RICOCHET_WITH_NONSMOOTH.
template <class>
inline constexpr bool nonsmooth_is_linked =
#ifdef RICOCHET_WITH_NONSMOOTH
    true;
#else
    false;
#endif

}  // namespace detail

/// Integrates a system with its inclusion.
///
/// @throws std::invalid_argument as for other systems; also for a backward run and an infinite end,
///         and for a start from which no reaction follows. In a run in parts (see above) also for
///         `stop_at_event`, `record_steps` and a `stop_after` above 1.
template <class System, class X = typename System::State, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
requires Flowing<System, X> && StateVector<X> && KnowsInclusion<System>
[[nodiscard]] MixedRun<X> integrate(const System& system, const X& x0, const Options& options,
                                    const Stepping& stepping = {}, const Detector& detector = {},
                                    const Locator& locator = {})
{
    static_assert(detail::nonsmooth_is_linked<System>,
                  "ricochet: found a system with set_valued(), and a target that does not link "
                  "ricochet::nonsmooth; expected it to, or RICOCHET_WITH_NONSMOOTH to be defined");
    if constexpr (detail::runs_in_phases<System, X, Stepping, Detector>()) {
        return detail::run_in_phases(system, x0, options, stepping, detector, locator);
    } else {
        return EventHandOver<System, X, Stepping, Detector, Locator>(system, x0, options, stepping,
                                                                     detector, locator)
            .take();
    }
}

/// Runs an inclusion alone: `hand_over`.
///
/// @throws std::invalid_argument as above, and for options that it does not use: `mode`, `step`,
///         `h_min`, `event_rtol`, `event_window`, `check_inside`.
template <class System, class X, class Stepping = ErrorControlled<Dopri5>>
requires NotIntegrable<System, X> && Inclusion<System>
[[nodiscard]] HandOverRun<System> integrate(const System& system, const X& w0,
                                            const Options& options, const Stepping& stepping = {})
{
    auto run = hand_over(system, StateOf<System>(w0), detail::inclusion_options(options), stepping);
    if (!options.record_events) run.events.clear();
    return run;
}

}  // namespace ricochet
