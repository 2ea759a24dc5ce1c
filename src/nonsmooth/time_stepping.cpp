#include "ricochet/nonsmooth/time_stepping.hpp"

#include <fmt/format.h>

namespace ricochet {

void validate(const TimeSteppingOptions& options)
{
    if (!(options.step > 0) || !std::isfinite(options.step)) {
        throw std::invalid_argument(fmt::format(
            "TimeSteppingOptions: step must be positive and finite, got {}", options.step));
    }
    if (!std::isfinite(options.t_start) || !(options.t_end > options.t_start) ||
        !std::isfinite(options.t_end)) {
        throw std::invalid_argument(fmt::format(
            "TimeSteppingOptions: t_end must be finite and later than t_start {}, got {}",
            options.t_start, options.t_end));
    }
}

}  // namespace ricochet
