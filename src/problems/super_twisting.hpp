// The super-twisting controller: a continuous control with a relay in its integral.
#pragma once

#include <algorithm>
#include <cmath>
#include <string_view>

#include "ricochet/nonsmooth/inclusion.hpp"

namespace ricochet {

/// State w = (sliding variable x1, x2 = integral part + disturbance):
///
///     x1' = -gain_1 sqrt|x1| sgn(x1) + x2
///     x2' = amplitude frequency cos(frequency t) + r,     r in -gain_2 Sgn(x1)
///
/// under the disturbance amplitude sin(frequency t). With gains that are large against
/// the rate of the disturbance both states reach zero in finite time and stay, r balancing
/// the rate: the relay acts on x1 two integrations away (E A^-1 G = 0).
///
/// (A. Levant, Sliding order and sliding accuracy in sliding mode control, International
/// Journal of Control 58, 1993.)
class SuperTwisting {
public:
    struct Parameters {
        double gain_1 = 3;     ///< positive
        double gain_2 = 2.2;   ///< positive
        double amplitude = 1;  ///< of the disturbance, zero or positive
        double frequency = 1;  ///< [rad/s], zero or positive
    };

    SuperTwisting() = default;
    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit SuperTwisting(const Parameters& parameters);

    static constexpr std::string_view name = "super-twisting";
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 1;
    using Vector = Eigen::Vector2d;

    void smooth(double t, const Vector& w, Vector& f) const
    {
        f[0] = -p_.gain_1 * std::copysign(std::sqrt(std::abs(w[0])), w[0]) + w[1];
        f[1] = p_.amplitude * p_.frequency * std::cos(p_.frequency * t);
    }
    void smooth_jacobian(double /*t*/, const Vector& w, Eigen::Matrix2d& j) const
    {
        // The slope is infinite at zero; a finite one only costs iterations of Newton's method.
        const double root = std::sqrt(std::max(std::abs(w[0]), 1e-24));
        j << -p_.gain_1 / (2 * root), 1, 0, 0;
    }
    void act(Eigen::Matrix<double, 2, 1>& g) const { g << 0, 1; }
    [[nodiscard]] sets::IntervalSet reaction_set(double /*t*/, const Vector& /*w*/) const
    {
        return sets::IntervalSet::symmetric(p_.gain_2);
    }

private:
    Parameters p_;
};

}  // namespace ricochet
