#include "ricochet/systems/friction_oscillator.hpp"

#include <cmath>

#include "base/require.hpp"

namespace ricochet {

FrictionOscillator::FrictionOscillator(const Parameters& parameters, std::string_view self)
    : p_(parameters)
{
    detail::require_positive(self, "mass", p_.mass);
    detail::require_positive(self, "stiffness", p_.stiffness);
    detail::require_finite(self, "belt_speed", p_.belt_speed);
    detail::require_not_negative(self, "friction", p_.friction);
    detail::require_at_least(self, "static_friction", p_.static_friction, "friction", p_.friction);
    detail::require_not_negative(self, "weakening", p_.weakening);
}

Mode FrictionOscillator::mode_at(double u, double v) const noexcept
{
    if (v != p_.belt_speed) return v < p_.belt_speed ? slip_left : slip_right;
    const double force = spring(u);
    const double excess = std::fabs(force) - p_.static_friction;
    // Exactly at the limit it depends on the direction in which the belt carries the mass.
    const double growth = force * spring(p_.belt_speed);
    if (excess < 0 || (excess == 0 && growth <= 0)) return stick;
    return force > 0 ? slip_right : slip_left;
}

}  // namespace ricochet
