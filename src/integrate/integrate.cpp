#include "ricochet/integrate/integrate.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <string_view>

namespace ricochet::detail {

namespace {

/// "guard 0 (floor)", or "guard 0" if the guard has no name.
std::string guard_called(std::size_t which, std::string_view name)
{
    return name.empty() ? fmt::format("guard {}", which)
                        : fmt::format("guard {} ({})", which, name);
}

}  // namespace

void throw_wrong_tolerances(std::size_t components, std::size_t tolerances)
{
    throw std::invalid_argument(
        fmt::format("integrate: component_atol must have one number for each of the {} components "
                    "of the start, got {}",
                    components, tolerances));
}

void throw_start_empty()
{
    throw std::invalid_argument("integrate: the start must have components, got none");
}

void throw_no_reset(std::size_t which, std::string_view name)
{
    throw std::invalid_argument(fmt::format(
        "integrate: {} is unilateral and needs a reset: it defines how the motion continues there",
        guard_called(which, name)));
}

void throw_unilateral_not_falling(std::size_t which, std::string_view name)
{
    throw std::invalid_argument(fmt::format(
        "integrate: {} is unilateral, so its crossing must be falling: g >= 0 bounds the motion",
        guard_called(which, name)));
}

void throw_bad_touch(std::size_t which, std::string_view name, double touch)
{
    throw std::invalid_argument(
        fmt::format("integrate: {} needs a touch that is finite and not negative, got {}",
                    guard_called(which, name), touch));
}

void throw_unknown_mode(std::size_t mode, std::size_t modes)
{
    throw std::invalid_argument(fmt::format(
        "integrate: mode must be below the system's mode_count = {}, got {}", modes, mode));
}

void throw_flow_does_not_fit(std::size_t components)
{
    throw std::invalid_argument(
        fmt::format("integrate: flow resized dxdt at the start; expected the {} components of the "
                    "state, written in place",
                    components));
}

void throw_no_error_estimate()
{
    throw std::invalid_argument(
        "integrate: error control needs a method with an error estimate: cash_karp54, dopri5 or "
        "fehlberg78, got euler or rk4");
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

void throw_time_event_not_ahead(bool backward, double t, double found)
{
    throw std::invalid_argument(fmt::format(
        "integrate: {} must return a time {} t, t excluded, or {}infinity; at the start t = {} it "
        "returned {}",
        backward ? "previous_time_event(t)" : "next_time_event(t)", backward ? "before" : "after",
        backward ? "-" : "", t, found));
}

void throw_start_not_finite(std::size_t component, double value)
{
    throw std::invalid_argument(fmt::format(
        "integrate: the start must be finite, got {} in component {}", value, component));
}

void throw_start_outside_mode(std::size_t which, std::string_view name, double t, double guard)
{
    throw std::invalid_argument(
        fmt::format("integrate: the start lies behind {}, which bounds the motion: "
                    "expected guard >= 0 at t = {}, got {}",
                    guard_called(which, name), t, guard));
}

void throw_start_guard_not_finite(std::size_t which, std::string_view name, double t, double guard)
{
    throw std::invalid_argument(
        fmt::format("integrate: {} must be finite at the start, got {} at t = {}",
                    guard_called(which, name), guard, t));
}

}  // namespace ricochet::detail
