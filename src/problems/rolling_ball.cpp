#include "problems/rolling_ball.hpp"

#include "base/require.hpp"

namespace ricochet {

RollingBall::RollingBall(const Parameters& parameters) : p_(parameters)
{
    constexpr std::string_view self = "RollingBall";
    detail::require_positive(self, "mass", p_.mass);
    detail::require_positive(self, "radius", p_.radius);
    detail::require_not_negative(self, "friction", p_.friction);
    detail::require_not_negative(self, "resistance", p_.resistance);
    detail::require_finite(self, "plate_speed", p_.plate_speed);
    detail::require_not_negative(self, "plate_frequency", p_.plate_frequency);
    detail::require_positive(self, "gravity", p_.gravity);
}

}  // namespace ricochet
