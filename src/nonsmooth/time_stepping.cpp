#include "ricochet/nonsmooth/time_stepping.hpp"

#include <fmt/format.h>

namespace ricochet {

void validate(const TimeSteppingOptions& options)
{
    if (!(options.step > 0) || !std::isfinite(options.step)) {
        throw std::invalid_argument(fmt::format(
            "TimeSteppingOptions: step must be positive and finite, got {}", options.step));
    }
    if (!std::isfinite(options.t_start) || !(options.t_end >= options.t_start) ||
        !std::isfinite(options.t_end)) {
        throw std::invalid_argument(fmt::format(
            "TimeSteppingOptions: t_end must be finite and not before t_start {}, got {}",
            options.t_start, options.t_end));
    }
}

namespace detail {

void check_contact(int contact, double restitution, double friction, double gap, double room)
{
    if (!(restitution >= 0 && restitution <= 1)) {
        throw std::invalid_argument(fmt::format(
            "contact {}: restitution must lie in [0, 1], got {}", contact, restitution));
    }
    if (!(friction >= 0) || !std::isfinite(friction)) {
        throw std::invalid_argument(fmt::format(
            "contact {}: friction must be finite, zero or positive, got {}", contact, friction));
    }
    if (std::isnan(gap)) {
        throw std::invalid_argument(
            fmt::format("contact {}: the gap of the initial state is not a number", contact));
    }
    if (!(gap >= -room)) {
        throw std::invalid_argument(fmt::format(
            "the initial state is inside an obstacle: the gap of contact {} is {}", contact, gap));
    }
}

}  // namespace detail

}  // namespace ricochet
