#include "ricochet/integrate/integrate.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace ricochet::detail {

void throw_start_empty()
{
    throw std::invalid_argument("integrate: the start must have components, got none");
}

void throw_no_reset(std::size_t which)
{
    throw std::invalid_argument(fmt::format(
        "integrate: guard {} is unilateral and needs a reset: nothing says how the motion goes on "
        "there",
        which));
}

void throw_unilateral_not_falling(std::size_t which)
{
    throw std::invalid_argument(fmt::format(
        "integrate: guard {} is unilateral, so its crossing must be falling: g >= 0 bounds the "
        "motion",
        which));
}

void throw_unknown_mode(std::size_t mode, std::size_t modes)
{
    throw std::invalid_argument(fmt::format(
        "integrate: mode must be below the system's mode_count = {}, got {}", modes, mode));
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

void throw_start_not_finite(std::size_t component, double value)
{
    throw std::invalid_argument(fmt::format(
        "integrate: the start must be finite, got {} in component {}", value, component));
}

void throw_start_outside_mode(std::size_t which, double t, double guard)
{
    throw std::invalid_argument(
        fmt::format("integrate: the start lies behind guard {}, which bounds the motion: "
                    "expected guard >= 0 at t = {}, got {}",
                    which, t, guard));
}

void throw_start_guard_not_finite(std::size_t which, double t, double guard)
{
    throw std::invalid_argument(fmt::format(
        "integrate: guard {} must be finite at the start, got {} at t = {}", which, guard, t));
}

}  // namespace ricochet::detail
