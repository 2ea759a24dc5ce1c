#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "ricochet/run.hpp"

namespace ricochet {

void detail::throw_no_solution(bool no_steps)
{
    throw std::invalid_argument(
        no_steps
            ? "Solution: no step has been kept; expected Options::record_steps, and a run of at "
              "least one step"
            : "Solution: expected a time, got NaN");
}

std::string_view name(Outcome outcome) noexcept
{
    switch (outcome) {
        case Outcome::reached_end: return "reached_end";
        case Outcome::stopped_by_event: return "stopped_by_event";
        case Outcome::zeno: return "zeno";
        case Outcome::outside_mode: return "outside_mode";
        case Outcome::endless_cascade: return "endless_cascade";
        case Outcome::conflicting_resets: return "conflicting_resets";
        case Outcome::unknown_mode: return "unknown_mode";
        case Outcome::step_underflow: return "step_underflow";
        case Outcome::step_limit: return "step_limit";
        case Outcome::non_finite: return "non_finite";
        case Outcome::cancelled: return "cancelled";
        case Outcome::wrong_bound: return "wrong_bound";
        case Outcome::not_converged: return "not_converged";
        case Outcome::time_event_not_ahead: return "time_event_not_ahead";
        case Outcome::wrong_dimension: return "wrong_dimension";
        case Outcome::stalled: return "stalled";
        case Outcome::stopped_by_callback: return "stopped_by_callback";
        case Outcome::at_rest: return "at_rest";
        case Outcome::not_handed_over: return "not_handed_over";
        case Outcome::released: return "released";
        case Outcome::law_violated: return "law_violated";
        case Outcome::several: return "several";
        case Outcome::running: return "running";
    }
    return "unknown";
}

// Long: a list with one sentence for each outcome.
std::string_view describe(Outcome outcome) noexcept
{
    switch (outcome) {
        case Outcome::reached_end: return "the end time was reached";
        case Outcome::stopped_by_event: return "an event ended the run, as asked";
        case Outcome::zeno:
            return "the motion presses on its guard, or its events accumulate there, and nothing "
                   "stops it; let it come to rest there (a system by its rest, or, where its "
                   "surface "
                   "moves or `rest` mixes components, by a mode of its own; a scene by its "
                   "contacts), or end the run earlier";
        case Outcome::outside_mode:
            return "a reset left the state behind a guard that bounds the motion; "
                   "let the reset put it on the surface or in front of it";
        case Outcome::endless_cascade:
            return "resets trigger each other at one instant without an end; let each leave the "
                   "surfaces of the others, let modes overlap by a small hysteresis, or give the "
                   "system a sliding mode (Filippov, set_valued())";
        case Outcome::conflicting_resets:
            return "two guards, or a guard and a time event, fired together, and the order of "
                   "their resets matters to one component, or to the mode; declare "
                   "reset(fired, t, x) to say what happens then";
        case Outcome::unknown_mode: return "a reset returned a mode that is not below mode_count";
        case Outcome::step_underflow:
            return "the step fell below h_min without meeting the tolerance; "
                   "loosen rtol and atol, or lower h_min";
        case Outcome::step_limit: return "all allowed steps were taken: allow more, or end earlier";
        case Outcome::non_finite:
            return "the flow, the guard or the reset returned NaN or infinity; "
                   "the last finite state is kept";
        case Outcome::cancelled: return "the run was cancelled; it can be continued";
        case Outcome::wrong_bound:
            return "a guard changed faster than its declared bounds allow, or lies beyond its "
                   "lower or upper bound; correct speed_bound, acceleration_bound, lipschitz, "
                   "lower_bound or upper_bound";
        case Outcome::not_converged:
            return "a set-valued stage has no solution that the solver could find; try another "
                   "stage method or a looser tolerance";
        case Outcome::time_event_not_ahead:
            return "asked for the time event after the one that has just happened, the system "
                   "returned a time that is not ahead; let next_time_event(t) exclude t, also "
                   "where t is rounded, let time_reset change the state that next_time_event(t, x) "
                   "answers for, and return infinity where there is none";
        case Outcome::wrong_dimension:
            return "the flow resized dxdt, or a reset, rest or time_reset shortened the state and "
                   "left the mode as it was; write into the components that are there, or declare "
                   "`static constexpr bool changes_dimension = true`";
        case Outcome::stalled:
            return "stall_steps steps hardly advanced the time, or nothing ended a run without an "
                   "end; end the run earlier, let events that accumulate come to rest, or raise "
                   "max_steps or stall_steps";
        case Outcome::stopped_by_callback:
            return "a function of the system reported an error; all that was computed before is "
                   "kept, and the next call continues from the last completed step";
        case Outcome::at_rest: return "every element came to rest for good";
        case Outcome::not_handed_over:
            return "events alone cannot continue the motion, and implicit steps are excluded or "
                   "would "
                   "not know its static bounds; see run.reason";
        case Outcome::released: return "every reaction is at a bound, as was asked for";
        case Outcome::law_violated:
            return "a step ended with a reaction that contradicts its law; check reaction_set, "
                   "or take shorter steps";
        case Outcome::several:
            return "several motions satisfy the law of the reactions here, and nothing says which "
                   "one follows; start beside it, or check the signs of observe and act";
        case Outcome::running: return "the run has not ended";
    }
    return "unknown outcome";
}

std::string describe(const Statistics& statistics, std::span<const std::string> guard_names)
{
    const auto named = [&](std::size_t guard) {
        const bool has_name = guard < guard_names.size() && !guard_names[guard].empty();
        return has_name ? guard_names[guard] : fmt::format("guard {}", guard);
    };
    std::string out;
    if (statistics.declined_guard != no_guard) {
        out = fmt::format(
            "{} resets changed nothing, the last that of {}, which left the state and the mode "
            "also beyond the surface; let it act where the condition of its event holds",
            statistics.ineffective_resets, named(statistics.declined_guard));
    }
    if (statistics.either_relays > 0) {
        out += fmt::format(
            "{}from {} events of guards with Crossing::either another mode turned the motion back, "
            "the last time at {}; give the guard a direction, let modes overlap by a small "
            "hysteresis, or give the system a sliding mode (Filippov, set_valued())",
            out.empty() ? "" : "; ", statistics.either_relays, named(statistics.relay_guard));
    }
    return out;
}

std::string detail::describe_reason(Outcome outcome, const std::string& reason)
{
    if (outcome == Outcome::stopped_by_event) return "a reset ended the run: " + reason;
    if (outcome != Outcome::non_finite) return std::string(describe(outcome)) + ": " + reason;
    return reason +
           " returned NaN or infinity, or led to a state that is not finite; the last finite state "
           "is kept";
}

std::string detail::describe_run(Outcome outcome, const std::string& reason,
                                 const std::vector<std::size_t>& armed_beyond,
                                 const std::vector<std::size_t>& armed_on_surface)
{
    std::string out(describe(outcome));
    if (!reason.empty()) out = describe_reason(outcome, reason);
    std::vector<std::size_t> beyond;
    std::set_difference(armed_beyond.begin(), armed_beyond.end(), armed_on_surface.begin(),
                        armed_on_surface.end(), std::back_inserter(beyond));
    const auto say = [&](const std::vector<std::size_t>& guards, std::string_view what) {
        if (guards.empty()) return;
        out += fmt::format("; guard{} {} {}", guards.size() == 1 ? "" : "s",
                           fmt::join(guards, ", "), what);
    };
    say(beyond,
        "began beyond its surface, and waited until it had returned (at_start and at_entry let it "
        "fire there)");
    say(armed_on_surface,
        "began on its surface and moved on beyond it, which is no event (unilateral and at_start "
        "give it one; a start from what a run has left at rest is held again by `continues`)");
    return out;
}

}  // namespace ricochet
