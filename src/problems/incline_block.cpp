#include "problems/incline_block.hpp"

#include "base/require.hpp"

namespace ricochet {

InclineBlock::InclineBlock(const Parameters& parameters) : p_(parameters)
{
    detail::require(p_.slope >= 0 && p_.slope < 1.5707963267948966, "InclineBlock", "slope",
                    "lie in [0, pi/2)", p_.slope);
    detail::require_not_negative("InclineBlock", "friction", p_.friction);
    detail::require_positive("InclineBlock", "gravity", p_.gravity);
}

double InclineBlock::invariant(const Vector& w) const noexcept
{
    const double angle = std::atan2(w[1], w[0]);
    const double k = p_.friction / std::tan(p_.slope);
    return std::hypot(w[0], w[1]) * std::sin(angle) / std::pow(std::tan(angle / 2), k);
}

}  // namespace ricochet
