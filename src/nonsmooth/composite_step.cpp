#include "ricochet/detail/composite_step.hpp"

#include <fmt/format.h>

namespace ricochet {

void validate(const SchemeOptions& options)
{
    if (!(options.theta > 0 && options.theta <= 1)) {
        throw std::invalid_argument(
            fmt::format("SchemeOptions: theta must lie in (0, 1], got {}", options.theta));
    }
    if (!(options.stage.tolerance > 0)) {
        throw std::invalid_argument(fmt::format("StageOptions: tolerance must be positive, got {}",
                                                options.stage.tolerance));
    }
    if (options.stage.max_iterations < 1) {
        throw std::invalid_argument(
            fmt::format("StageOptions: max_iterations must be at least 1, got {}",
                        options.stage.max_iterations));
    }
}

}  // namespace ricochet
