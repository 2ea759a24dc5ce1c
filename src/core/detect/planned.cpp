#include "ricochet/planned.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "base/require.hpp"

namespace ricochet::detail {

void validate(const PlannerOptions& options)
{
    constexpr Require require{"Planned"};
    require(options.margin >= 0 && std::isfinite(options.margin),
            "margin must be zero or positive and finite", options.margin);
    require(options.longest_interval > 0, "longest_interval must be at least 1 step", 0);
}

void throw_no_steps_between_checks()
{
    throw std::invalid_argument("EveryK: steps must be at least 1, got 0");
}

void throw_no_steps_in_interval()
{
    throw std::invalid_argument("Enclosed: longest_interval must be at least 1 step, got 0");
}

void throw_bad_slope_skip(double fraction, std::size_t longest)
{
    throw std::invalid_argument(fmt::format(
        "SlopeSkip: fraction must lie in (0, 1] and longest be at least 1, got {} and {}", fraction,
        longest));
}

}  // namespace ricochet::detail
