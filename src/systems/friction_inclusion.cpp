#include "ricochet/systems/friction_inclusion.hpp"

#include "base/require.hpp"

namespace ricochet {

FrictionInclusion::FrictionInclusion(const Parameters& parameters) : p_(parameters)
{
    constexpr std::string_view self = "FrictionInclusion";
    detail::require_positive(self, "mass", p_.mass);
    detail::require_not_negative(self, "stiffness", p_.stiffness);
    detail::require_finite(self, "belt_speed", p_.belt_speed);
    detail::require_not_negative(self, "friction", p_.friction);
    detail::require_not_negative(self, "weakening", p_.weakening);
    detail::require(p_.residual >= 0 && p_.residual <= p_.friction, self, "residual",
                    "lie in [0, friction]", p_.residual);
}

FrictionInclusion FrictionInclusion::of(const FrictionOscillator::Parameters& parameters)
{
    detail::require(parameters.static_friction == parameters.friction, "FrictionInclusion",
                    "static_friction", "equal friction", parameters.static_friction);
    return FrictionInclusion({.mass = parameters.mass,
                              .stiffness = parameters.stiffness,
                              .belt_speed = parameters.belt_speed,
                              .friction = parameters.friction,
                              .weakening = parameters.weakening});
}

void FrictionInclusion::bound_gradient(double /*t*/, const Vector& w, int /*which*/,
                                       Vector& gradient) const
{
    const double sliding = w[1] - p_.belt_speed;
    const double x = p_.weakening * std::abs(sliding);
    double slope = 0;  // dF/ds
    switch (p_.law) {
        case FrictionLaw::constant: break;
        case FrictionLaw::hyperbolic:
            slope = -p_.friction * p_.weakening / ((1 + x) * (1 + x));
            break;
        case FrictionLaw::exponential:
            slope = -p_.weakening * (p_.friction - p_.residual) * std::exp(-x);
            break;
        case FrictionLaw::humped:
            if (p_.friction * (1 - x + x * x / 3) > p_.residual) {
                slope = p_.friction * p_.weakening * (-1 + 2 * x / 3);
            }
            break;
    }
    gradient[0] = 0;
    gradient[1] = sliding > 0 ? slope : sliding < 0 ? -slope : 0;
}

}  // namespace ricochet
