#include "ricochet/sensitivity/directions.hpp"

#include <fmt/format.h>

#include "base/require.hpp"

namespace ricochet::detail {

void validate_parameter(std::size_t index, bool callable, double nominal, double scale,
                        const std::vector<double>& start, std::size_t components)
{
    const std::string who = fmt::format("Parameter {}", index);
    const Require require{who};
    if (!callable) Refuse{who}("`with` is empty; it must make a system with a given value");
    require(std::isfinite(nominal), "nominal must be finite", nominal);
    require(std::isfinite(scale) && scale >= 0, "scale must be positive, or zero for its default",
            scale);
    require(start.empty() || start.size() == components,
            "start must be empty or have the size of the state", static_cast<double>(start.size()));
    for (const double derivative : start) {
        require(std::isfinite(derivative), "every component of start must be finite", derivative);
    }
}

}  // namespace ricochet::detail
