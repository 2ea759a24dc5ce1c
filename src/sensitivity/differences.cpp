#include "ricochet/sensitivity/differences.hpp"

#include <fmt/format.h>

#include "base/require.hpp"

namespace ricochet {

void validate(const Differences& differences, std::size_t components)
{
    constexpr std::string_view who = "Differences";
    detail::require_positive(who, "step", differences.step);
    detail::require_positive(who, "time_scale [s]", differences.time_scale);
    for (const double scale : differences.scale) {
        detail::require_positive(who, "every scale", scale);
    }
    const std::size_t given = differences.scale.size();
    if (given != 0 && given != components) {
        detail::Refuse{who}(fmt::format(
            "expected no scales or one for each of {} components, got {}", components, given));
    }
}

}  // namespace ricochet
