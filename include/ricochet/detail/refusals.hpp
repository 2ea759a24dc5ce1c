// Internal: the declarations of this header may change without notice.
//
// Set-ups that `integrate` or a monitor rejects, each with a sentence that begins with `who`.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string_view>

namespace ricochet::detail {

/// No run can start in a mode at (t, x). A type of its own, so that a run in several parts knows it
/// from what a function of the system throws.
struct StartRefused : std::invalid_argument {
    using std::invalid_argument::invalid_argument;
};

/// @throws StartRefused: the start has no components.
[[noreturn]] void throw_start_empty(std::string_view who);
/// @throws StartRefused: the start is not finite.
[[noreturn]] void throw_start_not_finite(std::string_view who, std::size_t component, double value);
/// @throws std::invalid_argument: the numbers of absolute tolerances and of components differ.
[[noreturn]] void throw_wrong_tolerances(std::size_t components, std::size_t tolerances);
/// @throws StartRefused: the start is behind a unilateral guard.
[[noreturn]] void throw_start_outside_mode(std::string_view who, std::size_t which,
                                           std::string_view name, double t, double guard);
/// @throws std::invalid_argument: a unilateral guard without a reset.
[[noreturn]] void throw_no_reset(std::string_view who, std::size_t which, std::string_view name);
/// @throws std::invalid_argument: a unilateral guard that does not fall.
[[noreturn]] void throw_unilateral_not_falling(std::string_view who, std::size_t which,
                                               std::string_view name);
/// Which function was not finite, for `Run::reason`: "the flow", or `function` of a guard, empty
/// for the guard itself; empty where there is no memory.
[[nodiscard]] std::string reason_not_finite(std::string_view function, std::size_t which,
                                            std::string_view name) noexcept;

/// @throws std::invalid_argument: an invalid tolerance of touches.
[[noreturn]] void throw_bad_touch(std::string_view who, std::size_t which, std::string_view name,
                                  double touch);
/// @throws StartRefused: a guard is not finite at the start.
[[noreturn]] void throw_start_guard_not_finite(std::string_view who, std::size_t which,
                                               std::string_view name, double t, double guard);
/// @throws std::invalid_argument: the flow gives its rate another dimension at the start.
[[noreturn]] void throw_flow_does_not_fit(std::string_view who, std::size_t components);
/// @throws StartRefused: the system does not have the start mode.
[[noreturn]] void throw_unknown_mode(std::string_view who, std::size_t mode, std::size_t modes);
/// @throws std::invalid_argument: error control by a method without an estimate.
[[noreturn]] void throw_no_error_estimate();
/// @throws std::invalid_argument: a run backward in time of a system that allows only forward runs.
[[noreturn]] void throw_forward_only();
/// @throws std::invalid_argument: no previous_time_event for a run backward in time.
[[noreturn]] void throw_no_previous_time_event();
/// @throws StartRefused: the first time event is not ahead of the start; that of a timer
/// in the state, `by_state`, may be at the start.
[[noreturn]] void throw_time_event_not_ahead(std::string_view who, bool backward, bool by_state,
                                             double t, double found);
/// @throws std::invalid_argument: a guard has `what`, at_start or at_entry, and `but`, which gives
/// it no condition that could hold.
[[noreturn]] void throw_no_condition(std::string_view who, std::size_t which, std::string_view name,
                                     std::string_view what, std::string_view but);
/// @throws std::invalid_argument: an infinite t_end of a run that nothing ends.
[[noreturn]] void throw_endless(double t_end);
/// @throws std::invalid_argument: a restart outside of the run.
[[noreturn]] void throw_restart_outside(double t, double t_start, double t_end);
/// @throws std::invalid_argument: a restart from a state of another dimension.
[[noreturn]] void throw_restart_does_not_fit(std::size_t components, std::size_t found);
/// @throws std::invalid_argument: an end that is not ahead.
[[noreturn]] void throw_end_not_ahead(double t, double t_end);
/// @throws std::invalid_argument: the result has been handed out.
[[noreturn]] void throw_run_is_over(std::string_view who);

}  // namespace ricochet::detail
