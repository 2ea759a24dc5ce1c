#include "require.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace ricochet::detail {

void require(bool holds, std::string_view system, std::string_view parameter,
             std::string_view expected, double given)
{
    if (!holds) {
        throw std::invalid_argument(
            fmt::format("{}: {} must {}, got {}", system, parameter, expected, given));
    }
}

void require_positive(std::string_view system, std::string_view parameter, double given)
{
    require(given > 0 && std::isfinite(given), system, parameter, "be positive and finite", given);
}

void require_not_negative(std::string_view system, std::string_view parameter, double given)
{
    require(given >= 0 && std::isfinite(given), system, parameter,
            "be zero or positive, and finite", given);
}

void require_finite(std::string_view system, std::string_view parameter, double given)
{
    require(std::isfinite(given), system, parameter, "be finite", given);
}

void require_above(std::string_view system, std::string_view parameter, double given,
                   std::string_view other, double bound)
{
    require(given > bound && std::isfinite(given), system, parameter,
            fmt::format("be finite and above {} {}", other, bound), given);
}

void require_at_least(std::string_view system, std::string_view parameter, double given,
                      std::string_view other, double bound)
{
    require(given >= bound && std::isfinite(given), system, parameter,
            fmt::format("be finite and at least {} {}", other, bound), given);
}

}  // namespace ricochet::detail
