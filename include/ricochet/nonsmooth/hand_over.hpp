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
#include <array>
#include <cmath>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/refused_calls.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/nonsmooth/detail/given_inclusion.hpp"
#include "ricochet/nonsmooth/detail/inclusion_alone.hpp"
#include "ricochet/nonsmooth/detail/inclusion_sizes.hpp"
#include "ricochet/nonsmooth/detail/phased_run.hpp"
#include "ricochet/nonsmooth/estimated_error.hpp"
#include "ricochet/nonsmooth/hand_over_run.hpp"

namespace ricochet {

/// `Stepping` of the event-driven phases: `ErrorControlled<Method>`, or `FixedStep<Method>` with
/// `set_valued.step`.
template <Inclusion System, class Stepping = ErrorControlled<Dopri5>>
class HandOver {
    static_assert(detail::check_inclusion<System>());
    using Motion = detail::RunOfInclusion<System, Stepping>;

public:
    using Vector = StateOf<System>;
    using Reaction = ReactionOf<System>;
    using State = SetValuedState<System>;

    /// @throws std::invalid_argument for invalid options, systems and initial
    /// states.
    HandOver(const System& system, const Vector& w0, const HandOverOptions& options)
        : run_(std::make_shared<Motion>(system, w0, options))
    {
    }

    /// Starts from the end of an earlier run, with its time, whatever `options.t_start` is, and its
    /// reaction.
    /// @throws std::invalid_argument also if the reaction lies outside the set.
    HandOver(const System& system, const Run<Vector>& earlier, const HandOverOptions& options)
        : HandOver(system, State{earlier.t, earlier.x, reaction_of(earlier)}, options)
    {
    }
    HandOver(const System& system, const State& start, const HandOverOptions& options)
        : run_(std::make_shared<Motion>(system, start, options))
    {
    }

    /// Advances to the end and returns the result, whatever the outcome.
    [[nodiscard]] Run<Vector> take() { return run_->take(); }

private:
    [[nodiscard]] static Reaction reaction_of(const Run<Vector>& earlier)
    {
        const std::vector<double>& r = earlier.reaction;
        const int m = reaction_size<System>;
        if (r.empty() || (m != Eigen::Dynamic && r.size() != static_cast<std::size_t>(m))) {
            detail::refuse_inclusion("the start must have as many reactions as the system, not",
                                     static_cast<double>(r.size()));
        }
        return Eigen::Map<const Reaction>(r.data(), static_cast<Eigen::Index>(r.size()));
    }

    std::shared_ptr<Motion> run_;
};

/// Runs a whole inclusion in one call.
template <Inclusion System, class Stepping = ErrorControlled<Dopri5>>
[[nodiscard]] Run<StateOf<System>> hand_over(const System& system, const StateOf<System>& w0,
                                             const HandOverOptions& options,
                                             const Stepping& /*stepping*/ = {})
{
    return HandOver<System, Stepping>(system, w0, options).take();
}

/// The error of a run that `hand_over` has returned for the other arguments, from two more runs
/// with shorter `set_valued.step`: five times the work of that run.
template <Inclusion System, class Stepping = ErrorControlled<Dopri5>>
[[nodiscard]] EstimatedError<StateOf<System>> estimate_error(const Run<StateOf<System>>& run,
                                                             const System& system,
                                                             const StateOf<System>& w0,
                                                             const HandOverOptions& options,
                                                             const Stepping& stepping = {})
{
    return detail::estimated_error(run, [&](double part) {
        const auto finer = detail::with_part_of_steps(options, Branching<System>, part);
        return hand_over(system, w0, finer, stepping);
    });
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

#if !RICOCHET_ALIGNED_AS_LIBRARY
#include "ricochet/nonsmooth/solvers.hpp"
#endif

namespace ricochet {

// Hybrid systems that also declare their motion as an inclusion.
//
// A system with a flow and guards of its own may declare
//
//     set_valued()         an Inclusion (inclusion.hpp) of the same state; or, with modes,
//     set_valued(mode)     one for each mode, or a std::optional that is empty where a mode has
//     none
//
//     start_mode(mode, t, x)       the mode in which its own flow continues from (t, x) after the
//                                  inclusion of `mode`; also start_mode(t, x). By default `mode`,
//                                  which only set_valued(mode) allows
//     change(k, kind, mode, t, x)  the reset of a stick, slip or mode of reaction k: may change x,
//                                  and returns the next mode; without modes
//                                  void change(k, kind, t, x)
//
// `integrate` and `Simulation` then follow the system's own flow while every y is clear of zero,
// farther from it than 1000 (atol + rtol |w|) over the components that y reads, and the inclusion
// elsewhere: at the start, after every set of events, and where a y arrives at zero. All guards,
// resets and time events of the system are watched in both. A guard that vanishes where a y does
// stands for that reaction: its event is then a `stick`, a `mode` or a `touch` of the reaction.
// Where changes of reactions accumulate, chatter or contradict one another, implicit steps are
// taken.
//
// `Run::phases` lists where something is held, or followed by implicit steps. A `stick`, `mode` or
// `touch` has the lowest guard that stands for the reaction among those that fired, or none, a
// `slip` has none, and `Event::reaction` is the reaction.
//
// Boxes of more than four reactions are followed by implicit steps wherever some y is not clear of
// zero, and sets that are no boxes of reactions everywhere; one that is unbounded along some axis
// only from where events accumulate, or a motion presses on its guard.
//
// Inclusions without events of their own are given to `integrate` directly.

template <class System>
concept KnowsInclusion = requires
{
    requires Inclusion<detail::InclusionOf<System>>;
};

namespace detail {

/// The loop of a system with set_valued().
template <class System, class X, class Stepping, class Detector>
requires(KnowsInclusion<System>) class LoopOf<System, X, Stepping, Detector> {
    using C = CoreState<X>;
    using Set = InclusionOf<System>;
    static_assert(check_set_valued<System, X>());
    static_assert(!DetectorTableOf<Detector, System, X>::predicts &&
                      !defers_checks<Detector, System, X>(),
                  "ricochet: found a system with set_valued() and a detector whose predictions or "
                  "bounds are those of its flow alone; expected Extremum, Ends or Bernstein");

public:
    LoopOf() = default;
    template <class Parts>
    LoopOf(const System& system, Parts& parts, const X& x0, const Options& options)
        : run_(make_phased_run<C>(setup(system, parts, options), core_state(x0), options))
    {
    }
    [[nodiscard]] AnyLoop<C>* operator->() const noexcept { return &run_->loop(); }

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
            out.start_mode = [](void* adapter, Mode mode, double t, const C& x) -> Mode {
                auto& of = *static_cast<SystemAdapter<System, X>*>(adapter);
                return of.system().start_mode(mode, t, of.read(x, 0));
            };
        } else if constexpr (StartsMode<System, X>) {
            out.start_mode = [](void* adapter, Mode, double t, const C& x) -> Mode {
                auto& of = *static_cast<SystemAdapter<System, X>*>(adapter);
                return of.system().start_mode(t, of.read(x, 0));
            };
        }
        if constexpr (ChangesMode<System, X> || ChangesState<System, X>) {
            out.change = [](void* adapter, std::size_t reaction, EventKind kind, Mode mode,
                            double t, C& x) -> Mode {
                auto& of = *static_cast<SystemAdapter<System, X>*>(adapter);
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
/// Set-valued steps are a thousandth of the run long; where its end is infinite, `h_max`, or
/// `step`.
///
/// @throws std::invalid_argument as for other systems; also for a backward run, for an infinite end
///         without h_max and step, and for a start from which no reaction follows.
template <class System, class X = typename System::State, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
requires Flowing<System, X> && StateVector<X> && KnowsInclusion<System>
[[nodiscard]] Run<X> integrate(const System& system, const X& x0, const Options& options,
                               const Stepping& stepping = {}, const Detector& detector = {},
                               const Locator& locator = {})
{
    static_assert(detail::nonsmooth_is_linked<System>,
                  "ricochet: found a system with set_valued(), and a target that does not link "
                  "ricochet::nonsmooth; expected it to, or RICOCHET_WITH_NONSMOOTH to be defined");
    detail::RunComponents<System, X, Stepping, Detector, Locator> parts(system, x0, stepping,
                                                                        detector, locator);
    const detail::LoopOf<System, X, Stepping, Detector> loop(system, parts, x0, options);
    return detail::as_callers<X>(loop->take(), x0);
}

/// Runs an inclusion alone: `hand_over`.
///
/// @throws std::invalid_argument as above, and for options that it does not use: `mode`, `step`,
///         `h_min`, `event_rtol`, `event_window`, `check_inside`.
template <class System, class X, class Stepping = ErrorControlled<Dopri5>>
requires NotIntegrable<System, X> && Inclusion<System>
[[nodiscard]] Run<StateOf<System>> integrate(const System& system, const X& w0,
                                             const Options& options, const Stepping& stepping = {})
{
    auto run = hand_over(system, StateOf<System>(w0), detail::inclusion_options(options), stepping);
    if (!options.record_events) run.events.clear();
    return run;
}

}  // namespace ricochet
