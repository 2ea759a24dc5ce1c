#include "ricochet/detail/differences.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace ricochet {

namespace {

void require_positive(double given, const char* what)
{
    if (!(given > 0 && std::isfinite(given))) {
        throw std::invalid_argument(
            fmt::format("Differences: {} must be positive and finite, got {}", what, given));
    }
}

}  // namespace

void validate(const Differences& differences, std::size_t components)
{
    require_positive(differences.step, "step");
    require_positive(differences.time_scale, "time_scale [s]");
    for (const double scale : differences.scale) {
        require_positive(scale, "every scale");
    }
    const std::size_t given = differences.scale.size();
    if (given != 0 && given != components) {
        throw std::invalid_argument(
            fmt::format("Differences: expected no scales or one for each of {} components, got {}",
                        components, given));
    }
}

}  // namespace ricochet
