// A block on an inclined plane, sliding in two directions.
#pragma once

#include <cmath>
#include <string_view>

#include "ricochet/nonsmooth/inclusion.hpp"

namespace ricochet {

/// Isotropic friction of a known bound in the plane: a disk of reactions.
///
/// State w = (vx, vy, x, y), x down the slope [m, m/s]:
///
///     vx' = g sin(slope) + rx,   vy' = ry,   |r| <= friction g cos(slope), against v
///
/// Known solution: with k = friction / tan(slope) and the angle a of v from the x axis,
/// |v| sin(a) / tan(a / 2)^k is constant; straight down the slope the acceleration is
/// g (sin(slope) - friction cos(slope)).
class InclineBlock {
public:
    struct Parameters {
        double slope = 0.3;     ///< [rad], in [0, pi/2)
        double friction = 0.5;  ///< coefficient, zero or positive
        double gravity = 9.81;  ///< [m/s^2], positive
    };

    InclineBlock() = default;
    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit InclineBlock(const Parameters& parameters);

    static constexpr std::string_view name = "incline-block";
    static constexpr int state_size = 4;
    static constexpr int reaction_size = 2;
    static constexpr bool affine = true;
    using Vector = Eigen::Vector4d;

    void smooth(double /*t*/, const Vector& w, Vector& f) const
    {
        f << p_.gravity * std::sin(p_.slope), 0, w[0], w[1];
    }
    void smooth_jacobian(double /*t*/, const Vector& /*w*/, Eigen::Matrix4d& j) const
    {
        j.setZero();
        j(2, 0) = j(3, 1) = 1;
    }
    [[nodiscard]] sets::Ball<2> reaction_set(double /*t*/, const Vector& /*w*/) const
    {
        return sets::Ball<2>(p_.friction * p_.gravity * std::cos(p_.slope));
    }

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }
    /// The constant of the motion above, for vy > 0.
    [[nodiscard]] double invariant(const Vector& w) const noexcept;

private:
    Parameters p_;
};

}  // namespace ricochet
