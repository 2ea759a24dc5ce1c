// A mass on a spring that rubs on a belt, as a differential inclusion.
#pragma once

#include <algorithm>
#include <cmath>
#include <string_view>

#include "ricochet/nonsmooth/linear_cases.hpp"
#include "ricochet/systems/friction_oscillator.hpp"

namespace ricochet {

/// How kinetic friction falls with the sliding speed s.
enum class FrictionLaw {
    constant,     ///< friction
    hyperbolic,   ///< friction / (1 + weakening s)
    exponential,  ///< residual + (friction - residual) exp(-weakening s)
    humped,       ///< friction (1 - weakening s + weakening^2 s^2 / 3), at least residual
};

/// The set-valued description of `FrictionOscillator`, `CoulombOscillator`, `StickSlip`.
///
/// State w = (u [m], v [m/s]); y = v - belt_speed:
///
///     u' = v
///     mass v' = -stiffness u + r,     r in [-F(|y|), F(|y|)] against y
///
/// Sticking friction is at most F(0): there is no larger static friction.
class FrictionInclusion {
public:
    struct Parameters {
        double mass = 1;        ///< [kg], positive
        double stiffness = 1;   ///< [N/m], zero or positive
        double belt_speed = 0;  ///< [m/s]
        double friction = 0.3;  ///< F(0) [N], zero or positive
        double weakening = 0;   ///< [s/m], zero or positive
        double residual = 0;    ///< [N], in [0, friction]
        FrictionLaw law = FrictionLaw::hyperbolic;
    };

    FrictionInclusion() = default;
    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit FrictionInclusion(const Parameters& parameters);
    /// The inclusion that describes a `FrictionOscillator` with these parameters.
    /// @throws std::invalid_argument also if the static friction differs from the kinetic.
    [[nodiscard]] static FrictionInclusion of(const FrictionOscillator::Parameters& parameters);

    static constexpr std::string_view name = "friction-inclusion";
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 1;
    static constexpr bool affine = true;
    using Vector = Eigen::Vector2d;
    using Scalar = Eigen::Matrix<double, 1, 1>;

    [[nodiscard]] const Parameters& parameters() const noexcept { return p_; }

    void smooth(double /*t*/, const Vector& w, Vector& f) const
    {
        f[0] = w[1];
        f[1] = -p_.stiffness * w[0];
    }
    void smooth_jacobian(double /*t*/, const Vector& /*w*/, Eigen::Matrix2d& j) const
    {
        j << 0, 1, -p_.stiffness, 0;
    }
    void mass(Eigen::Matrix2d& a) const { a << 1, 0, 0, p_.mass; }
    void observe(Eigen::Matrix<double, 1, 2>& e) const { e << 0, 1; }
    void offset(double /*t*/, Scalar& s) const { s[0] = p_.belt_speed; }
    [[nodiscard]] sets::IntervalSet reaction_set(double /*t*/, const Vector& w) const
    {
        return sets::IntervalSet::symmetric(friction(std::abs(w[1] - p_.belt_speed)));
    }
    /// F on one side of y = 0, smooth beyond it.
    [[nodiscard]] double branch_bound(double /*t*/, const Vector& w, int /*which*/,
                                      Branch branch) const
    {
        const double y = w[1] - p_.belt_speed;
        return branch == Branch::upper ? friction(-y) : -friction(y);
    }
    /// dF/dw.
    void bound_gradient(double t, const Vector& w, int which, Vector& gradient) const;

    /// F(s) [N] at the sliding speed s >= 0 [m/s], continued smoothly a little below zero.
    [[nodiscard]] double friction(double speed) const noexcept
    {
        const double x = p_.weakening * speed;
        switch (p_.law) {
            case FrictionLaw::constant: return p_.friction;
            case FrictionLaw::hyperbolic: return p_.friction / std::max(1 + x, 0.5);
            case FrictionLaw::exponential:
                return p_.residual + (p_.friction - p_.residual) * std::exp(-x);
            case FrictionLaw::humped: break;
        }
        return std::max(p_.residual, p_.friction * (1 - x + x * x / 3));
    }

    /// stiffness u^2 / 2 + mass v^2 / 2 [J].
    [[nodiscard]] double energy(const Vector& w) const noexcept
    {
        return 0.5 * (p_.stiffness * w[0] * w[0] + p_.mass * w[1] * w[1]);
    }

private:
    Parameters p_;
};

}  // namespace ricochet
