#include "problems/three_body.hpp"

#include "base/require.hpp"

namespace ricochet {

ThreeBody::ThreeBody(const Parameters& parameters) : mass_ratio_(parameters.mass_ratio)
{
    detail::require(mass_ratio_ > 0 && mass_ratio_ <= 0.5, "ThreeBody", "mass_ratio",
                    "lie in (0, 1/2]", mass_ratio_);
}

}  // namespace ricochet
