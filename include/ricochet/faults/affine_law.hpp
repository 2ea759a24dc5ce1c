// The exact potentials of any law that is affine in the slip rate.
//
//     f = A(V) + B(theta),  B' > 0,      theta' = p(theta) - q(theta) V,  q > 0
//
// In the state xi with dxi/dtheta = sqrt(B'/q) the pair is
//
//     D = xi'^2 / 2,   D* = d^2 / 2,   Ddag = integral of A dV + B V + c,   dc/dxi = -p dxi/dtheta,
//
// since -dDdag/dxi = -V B' / (dxi/dtheta) + p dxi/dtheta = dxi/dtheta (p - q V) = xi'. For the
// ageing law xi = sqrt(b D_RS) log(theta) up to a constant, and c = b D_RS / theta.
#pragma once

#include <functional>

#include "ricochet/faults/friction.hpp"

namespace ricochet {

/// Definition of a law that is affine in the slip rate, for theta in [theta_min, theta_max].
struct AffineLaw {
    std::function<double(double)> direct;        ///< A(V); only its integral may diverge
    std::function<double(double)> direct_slope;  ///< dA/dV
    std::function<double(double)> state;         ///< B(theta)
    std::function<double(double)> state_slope;   ///< dB/dtheta, positive
    std::function<double(double)> heal;          ///< p(theta)
    std::function<double(double)> wear;          ///< q(theta), positive
    double theta_min = 0, theta_max = 0;         ///< 0 < theta_min < theta_max
    double v_reference = 0;                      ///< the integral of A begins here
};

/// The pair above, by adaptive Gauss-Kronrod quadrature in log(theta), to 1e-13. Intended for
/// checks and exploration: an evaluation takes microseconds.
class AffineLawPotential {
public:
    static constexpr PotentialKind kind = PotentialKind::quadratic;

    /// @throws std::invalid_argument for a missing function, an empty range of theta, or
    /// where B' or q is found not to be positive.
    explicit AffineLawPotential(AffineLaw law);

    /// xi, zero at theta_min. @throws std::invalid_argument outside the range.
    [[nodiscard]] double xi_of_theta(double theta) const;
    [[nodiscard]] double theta_of_xi(double xi) const;

    /// Ddag(v, xi) and its derivatives. @param v  [m/s]
    [[nodiscard]] RateStateJet rate_potential(double v, double xi) const;
    /// D*(d) and its derivatives.
    [[nodiscard]] ScalarJet dual(double d, double /*xi*/ = 0) const { return {d * d / 2, d, 1}; }
    /// D(xi') and its derivatives. @param rate  xi'
    [[nodiscard]] ScalarJet primal(double rate, double /*xi*/ = 0) const
    {
        return {rate * rate / 2, rate, 1};
    }

private:
    [[nodiscard]] double slope(double theta) const;  ///< dxi/dtheta

    AffineLaw law_;
    double xi_max_ = 0;
};

static_assert(PotentialPair<AffineLawPotential>);

}  // namespace ricochet
