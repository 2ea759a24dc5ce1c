#include "ricochet/integrate/integrate.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace ricochet::detail {

void throw_start_empty()
{
    throw std::invalid_argument("integrate: the start must have components, got none");
}

void throw_no_reset()
{
    throw std::invalid_argument(
        "integrate: a unilateral guard needs a reset: nothing says how the motion goes on there");
}

void throw_start_not_finite(std::size_t component, double value)
{
    throw std::invalid_argument(fmt::format(
        "integrate: the start must be finite, got {} in component {}", value, component));
}

void throw_start_outside_mode(double t, double guard)
{
    throw std::invalid_argument(
        fmt::format("integrate: the start lies behind a guard that bounds the motion: "
                    "expected guard >= 0 at t = {}, got {}",
                    t, guard));
}

void throw_start_guard_not_finite(double t, double guard)
{
    throw std::invalid_argument(fmt::format(
        "integrate: the guard must be finite at the start, got {} at t = {}", guard, t));
}

}  // namespace ricochet::detail
