// Outcomes of runs.
#pragma once

#include <string_view>

namespace ricochet {

/// How a run or a motion ended.
enum class Outcome {
    reached_end,
    stopped_by_event,
    zeno,  ///< events accumulate, or a motion presses on its guard, and no rest rule stops it
    outside_mode,          ///< a reset left the state behind a unilateral guard
    endless_cascade,       ///< resets kept triggering each other at one instant
    conflicting_resets,    ///< two resets of one set, or a reset and a time event's, gave one
                           ///< component different values
    unknown_mode,          ///< a reset returned a mode that the system does not have
    step_underflow,        ///< no step above h_min met the tolerance
    step_limit,            ///< `Options::max_steps` steps were taken
    non_finite,            ///< the flow, a guard or a reset returned NaN or infinity
    cancelled,             ///< by `Options::cancelled`, or by `finish()` before the end
    wrong_bound,           ///< a guard broke a bound that the system declares for it
    not_converged,         ///< a set-valued stage could not be solved however short the step
    time_event_not_ahead,  ///< `next_time_event(t)` returned a time that is not after t
    wrong_dimension,       ///< the flow or a reset left a state of another dimension
    stalled,               ///< `Options::stall_steps` steps hardly advanced the time
    stopped_by_callback,   ///< a function of the system reported an error, see `ricochet.h`
    at_rest,               ///< of a fault: nothing moves or will move again; the end is reached
    not_handed_over,       ///< a set-valued phase was due, with `HandOverOptions::events_only`
    released,              ///< no reaction is held any more, with `HandOverOptions::until_released`
    law_violated,          ///< a set-valued step ended with a reaction that contradicts its y
    running,               ///< only of a set-valued motion: it has not ended yet
};

/// The enumerator's name, e.g. "reached_end".
[[nodiscard]] std::string_view name(Outcome outcome) noexcept;

/// One sentence with the remedy, e.g. "step fell below h_min; loosen rtol".
[[nodiscard]] std::string_view describe(Outcome outcome) noexcept;

}  // namespace ricochet
