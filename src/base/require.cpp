#include "require.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace ricochet::detail {

void Refuse::operator()(std::string_view what) const
{
    throw std::invalid_argument(fmt::format("{}: {}", who, what));
}

void Require::operator()(bool holds, std::string_view what, double given) const
{
    if (!holds) Refuse{who}(fmt::format("{}, got {}", what, given));
}

void require(bool holds, std::string_view who, std::string_view parameter,
             std::string_view expected, double given)
{
    if (!holds) Refuse{who}(fmt::format("{} must {}, got {}", parameter, expected, given));
}

void require_positive(std::string_view who, std::string_view parameter, double given)
{
    require(given > 0 && std::isfinite(given), who, parameter, "be positive and finite", given);
}

void require_not_negative(std::string_view who, std::string_view parameter, double given)
{
    require(given >= 0 && std::isfinite(given), who, parameter, "be zero or positive, and finite",
            given);
}

void require_finite(std::string_view who, std::string_view parameter, double given)
{
    require(std::isfinite(given), who, parameter, "be finite", given);
}

void require_above(std::string_view who, std::string_view parameter, double given,
                   std::string_view other, double bound)
{
    if (given > bound && std::isfinite(given)) return;  // before the text is written
    require(false, who, parameter, fmt::format("be finite and above {} {}", other, bound), given);
}

void require_at_least(std::string_view who, std::string_view parameter, double given,
                      std::string_view other, double bound)
{
    if (given >= bound && std::isfinite(given)) return;
    require(false, who, parameter, fmt::format("be finite and at least {} {}", other, bound),
            given);
}

}  // namespace ricochet::detail
