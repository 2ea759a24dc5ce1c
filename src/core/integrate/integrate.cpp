#include "ricochet/integrate.hpp"

#include <fmt/format.h>

#include <array>
#include <stdexcept>
#include <string>
#include <string_view>

#include "ricochet/detail/refusals.hpp"

namespace ricochet::detail {

namespace {

/// "guard 0 (floor)", or "guard 0" if the guard has no name.
std::string guard_called(std::size_t which, std::string_view name)
{
    return name.empty() ? fmt::format("guard {}", which)
                        : fmt::format("guard {} ({})", which, name);
}

}  // namespace

std::string reason_not_finite(std::string_view function, std::size_t which,
                              std::string_view name) noexcept
{
    try {
        if (function.empty()) return guard_called(which, name);
        if (function == "flow") return "the flow";
        if (which == no_guard) return "the time reset";
        return fmt::format("the {} of {}", function, guard_called(which, name));
    } catch (const std::bad_alloc&) {
        return {};
    }
}

void throw_wrong_tolerances(std::size_t components, std::size_t tolerances)
{
    throw std::invalid_argument(
        fmt::format("integrate: component_atol must have one number for each of the {} components "
                    "of the start, got {}",
                    components, tolerances));
}

void throw_start_empty(std::string_view who)
{
    throw StartRefused(fmt::format("{}: the start must have components, got none", who));
}

void throw_no_reset(std::string_view who, std::size_t which, std::string_view name)
{
    throw std::invalid_argument(fmt::format(
        "{}: {} is unilateral and needs a reset: it defines how the motion continues there", who,
        guard_called(which, name)));
}

void throw_unilateral_not_falling(std::string_view who, std::size_t which, std::string_view name)
{
    throw std::invalid_argument(fmt::format(
        "{}: {} is unilateral, so its crossing must be falling: g >= 0 bounds the motion", who,
        guard_called(which, name)));
}

void throw_bad_touch(std::string_view who, std::size_t which, std::string_view name, double touch)
{
    throw std::invalid_argument(
        fmt::format("{}: {} needs a touch that is finite and not negative, got {}", who,
                    guard_called(which, name), touch));
}

void throw_unknown_mode(std::string_view who, std::size_t mode, std::size_t modes)
{
    if (modes == 1) {
        throw StartRefused(
            fmt::format("{}: mode must be 0, the only one of the system, got {}", who, mode));
    }
    throw StartRefused(fmt::format("{}: mode must be below the system's mode_count = {}, got {}",
                                   who, modes, mode));
}

void throw_flow_does_not_fit(std::string_view who, std::size_t components)
{
    throw std::invalid_argument(
        fmt::format("{}: flow resized dxdt at the start; expected the {} components of the "
                    "state, written in place",
                    who, components));
}

void throw_no_error_estimate()
{
    throw std::invalid_argument(
        fmt::format("integrate: found a method without an error estimate under error control; "
                    "expected {}, or FixedStep",
                    spelled_methods(true)));
}

void throw_forward_only()
{
    throw std::invalid_argument(
        "integrate: t_end lies before t_start, and the system runs forward in time only");
}

void throw_no_previous_time_event()
{
    throw std::invalid_argument(
        "integrate: t_end lies before t_start, and the system has next_time_event but no "
        "previous_time_event");
}

void throw_no_condition(std::string_view who, std::size_t which, std::string_view name,
                        std::string_view what, std::string_view but)
{
    throw std::invalid_argument(
        fmt::format("{}: {} has {}, so it must be falling or rising, and not unilateral, got {}",
                    who, guard_called(which, name), what, but));
}

void throw_endless(double t_end)
{
    throw std::invalid_argument(fmt::format(
        "integrate: t_end must be a finite time where nothing else may end the run, got {}; "
        "expected a guard with stop_after, stop_at_event, or max_steps, also beside a reset that "
        "ends the run",
        t_end));
}

void throw_time_event_not_ahead(std::string_view who, bool backward, bool by_state, double t,
                                double found)
{
    if (by_state && !backward) {
        throw StartRefused(
            fmt::format("{}: next_time_event(t, x) must return t or a time after it, or infinity; "
                        "at the start t = {} it returned {}",
                        who, t, found));
    }
    throw StartRefused(fmt::format(
        "{}: {} must return a time {} t, t excluded, or {}infinity; at the start t = {} it "
        "returned {}",
        who, backward ? "previous_time_event(t)" : "next_time_event(t)",
        backward ? "before" : "after", backward ? "-" : "", t, found));
}

void throw_start_not_finite(std::string_view who, std::size_t component, double value)
{
    throw StartRefused(
        fmt::format("{}: the start must be finite, got {} in component {}", who, value, component));
}

void throw_restart_outside(double t, double t_start, double t_end)
{
    throw std::invalid_argument(fmt::format(
        "restart: t must lie in the run, from {} to before {}, got {}", t_start, t_end, t));
}

void throw_restart_does_not_fit(std::size_t components, std::size_t found)
{
    throw std::invalid_argument(
        fmt::format("restart: the state has {} components, got {}", components, found));
}

void throw_end_not_ahead(double t, double t_end)
{
    throw std::invalid_argument(fmt::format(
        "extend: t_end must lie ahead of the run, which is at t = {}, got {}", t, t_end));
}

void throw_run_is_over(std::string_view who)
{
    throw std::invalid_argument(fmt::format(
        "{}: the run is over, since its result has been taken; start another one", who));
}

void throw_start_outside_mode(std::string_view who, std::size_t which, std::string_view name,
                              double t, double guard)
{
    throw StartRefused(
        fmt::format("{}: the start lies behind {}, which bounds the motion: "
                    "expected guard >= 0 at t = {}, got {}",
                    who, guard_called(which, name), t, guard));
}

void throw_start_guard_not_finite(std::string_view who, std::size_t which, std::string_view name,
                                  double t, double guard)
{
    throw StartRefused(fmt::format("{}: {} must be finite at the start, got {} at t = {}", who,
                                   guard_called(which, name), guard, t));
}

template void update(Run<std::array<double, 1>>&, const Run<SmallState>&,
                     const std::array<double, 1>&);
template void add_event<std::array<double, 1>>(void*, const Event<SmallState>&);
template void update(Run<std::array<double, 2>>&, const Run<SmallState>&,
                     const std::array<double, 2>&);
template void add_event<std::array<double, 2>>(void*, const Event<SmallState>&);
template void update(Run<std::array<double, 3>>&, const Run<SmallState>&,
                     const std::array<double, 3>&);
template void add_event<std::array<double, 3>>(void*, const Event<SmallState>&);
template void update(Run<std::array<double, 4>>&, const Run<SmallState>&,
                     const std::array<double, 4>&);
template void add_event<std::array<double, 4>>(void*, const Event<SmallState>&);

}  // namespace ricochet::detail
