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

#include <type_traits>

#include "ricochet/detail/any_hand_over.hpp"
#include "ricochet/detail/hand_over_run.hpp"
#include "ricochet/detail/inclusion_sizes.hpp"
#include "ricochet/detail/refused_calls.hpp"

namespace ricochet {

/// `Stepping` of the event-driven phases: `ErrorControlled<Method>`, or `FixedStep<Method>` with
/// `set_valued.step`.
template <Inclusion System, class Stepping = ErrorControlled<Dopri5>>
class HandOver {
    static_assert(detail::check_inclusion<System>());
    static constexpr int N = state_size<System>;
    static constexpr int M = reaction_size<System>;

public:
    using Vector = StateOf<System>;
    using Reaction = ReactionOf<System>;
    using State = SetValuedState<System>;

    /// @throws std::invalid_argument for invalid options, systems and initial
    /// states.
    HandOver(const System& system, const Vector& w0, const HandOverOptions& options)
        : by_(detail::TypedInclusion<System>(system), w0, options, stepping())
    {
    }

    /// Starts from the state of an earlier run, with its reaction.
    /// @throws std::invalid_argument also if the reaction lies outside the set.
    HandOver(const System& system, const State& start, const HandOverOptions& options)
        : by_(detail::TypedInclusion<System>(system), start, options, stepping())
    {
    }

    /// Advances to the end and returns the result, whatever the outcome.
    [[nodiscard]] HandOverRun<System> take() { return {by_.take()}; }

private:
    [[nodiscard]] static detail::EventStepping<N, M> stepping()
    {
        if constexpr (Branching<System>) {
            return {&detail::make_event_loop<N, M, Stepping>,
                    std::is_same_v<Stepping, ErrorControlled<typename Stepping::method>>};
        } else {
            return {};
        }
    }

    detail::AnyHandOver<N, M> by_;
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
RICOCHET_COMPILED_SIZES(RICOCHET_HAND_OVER_OF, extern)
RICOCHET_COMPILED_SIZES(RICOCHET_MODES_OF, extern)
RICOCHET_COMPILED_SIZES(RICOCHET_EVENTS_OF, Dopri5, extern)
RICOCHET_EVENTS_OF(1, 1, Fehlberg78, extern)
RICOCHET_EVENTS_OF(3, 1, Fehlberg78, extern)
#endif
