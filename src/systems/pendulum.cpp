#include "ricochet/systems/pendulum.hpp"

#include <limits>
#include <numbers>

#include "base/require.hpp"

namespace ricochet {

Pendulum::Pendulum(const Parameters& parameters)
    : stiffness_(parameters.gravity / parameters.length)
{
    detail::require_positive("Pendulum", "gravity", parameters.gravity);
    detail::require_positive("Pendulum", "length", parameters.length);
}

double Pendulum::half_period(double amplitude) const noexcept
{
    // In long double, so that the result is a reference for runs in double.
    long double a = 1;
    long double b = std::cos(static_cast<long double>(amplitude) / 2);
    while (std::fabs(a - b) > 4 * std::numeric_limits<long double>::epsilon() * a) {
        const long double mean = (a + b) / 2;
        b = std::sqrt(a * b);
        a = mean;
    }
    const long double w = std::sqrt(static_cast<long double>(stiffness_));
    return static_cast<double>(std::numbers::pi_v<long double> / (w * a));
}

}  // namespace ricochet
