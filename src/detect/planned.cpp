#include "ricochet/detect/planned.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace ricochet::detail {

void validate(const PlannerOptions& options)
{
    if (!(options.margin >= 0 && std::isfinite(options.margin))) {
        throw std::invalid_argument(fmt::format(
            "Planned: margin must be zero or positive and finite, got {}", options.margin));
    }
    if (options.longest_stretch == 0) {
        throw std::invalid_argument("Planned: longest_stretch must be at least 1 step, got 0");
    }
}

void throw_no_steps_between_looks()
{
    throw std::invalid_argument("EveryK: steps must be at least 1, got 0");
}

void throw_bad_slope_skip(double fraction, std::size_t longest)
{
    throw std::invalid_argument(fmt::format(
        "SlopeSkip: fraction must lie in (0, 1] and longest be at least 1, got {} and {}", fraction,
        longest));
}

}  // namespace ricochet::detail
