#include "ricochet/nonsmooth/time_stepping.hpp"

#include <fmt/format.h>

#include "../checks/require.hpp"

namespace ricochet {

void validate(const TimeSteppingOptions& options)
{
    constexpr std::string_view who = "TimeSteppingOptions";
    detail::require_positive(who, "step", options.step);
    if (!std::isfinite(options.t_start) || !(options.t_end >= options.t_start) ||
        !std::isfinite(options.t_end)) {
        detail::Refuse{who}(fmt::format("t_end must be finite and not before t_start {}, got {}",
                                        options.t_start, options.t_end));
    }
}

namespace detail {

void check_contact(int contact, double restitution, double friction, double gap, double room)
{
    const std::string who = fmt::format("contact {}", contact);
    const Require require{who};
    require(restitution >= 0 && restitution <= 1, "restitution must lie in [0, 1]", restitution);
    require(friction >= 0 && std::isfinite(friction), "friction must be finite, zero or positive",
            friction);
    if (std::isnan(gap)) Refuse{who}("the gap of the initial state is not a number");
    if (!(gap >= -room)) {
        throw std::invalid_argument(fmt::format(
            "the initial state is inside an obstacle: the gap of contact {} is {}", contact, gap));
    }
}

}  // namespace detail

}  // namespace ricochet
