#include "ricochet/systems/bouncing_ball.hpp"

#include <cmath>

#include "base/require.hpp"

namespace ricochet {

BouncingBall::BouncingBall(const Parameters& parameters)
    : gravity_(parameters.gravity), restitution_(parameters.restitution)
{
    constexpr detail::Require require{"BouncingBall"};
    require(gravity_ > 0 && std::isfinite(gravity_), "gravity must be positive and finite [m/s2]",
            gravity_);
    require(restitution_ >= 0 && restitution_ <= 1, "restitution must lie in [0, 1]", restitution_);
}

double BouncingBall::first_impact(double height, double velocity) const noexcept
{
    const double speed = std::sqrt(velocity * velocity + 2 * gravity_ * height);
    // Of the two forms of the root, the one without cancellation.
    return velocity >= 0 ? (velocity + speed) / gravity_ : 2 * height / (speed - velocity);
}

double BouncingBall::impact_time(int n, double height, double velocity) const noexcept
{
    // In long double, so that the sum is a reference for runs in double.
    const long double g = gravity_;
    const long double v = velocity;
    const long double speed = std::sqrt(v * v + 2 * g * height);
    long double flight = 2 * speed / g;
    long double t = velocity >= 0 ? (v + speed) / g : 2 * height / (speed - v);
    for (int i = 0; i < n; ++i) {
        flight *= restitution_;
        t += flight;
    }
    return static_cast<double>(t);
}

double BouncingBall::zeno_time(double height, double velocity) const noexcept
{
    const double speed = std::sqrt(velocity * velocity + 2 * gravity_ * height);
    return first_impact(height, velocity) +
           2 * speed / gravity_ * restitution_ / (1 - restitution_);
}

}  // namespace ricochet
