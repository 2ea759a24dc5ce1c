#include "problems/detest_f1.hpp"

#include <numbers>

namespace ricochet {

DetestF1::State DetestF1::solution(double t) noexcept
{
    using Real = long double;  // a reference for runs in double
    constexpr Real pi = std::numbers::pi_v<Real>;
    constexpr Real growth = 0.1L;
    const Real equilibrium = 1 / (pi * pi + growth * growth);
    const Real second = std::exp(growth);

    Real y = 0;
    Real v = 0;
    Real centre = equilibrium;
    for (Real whole = 0; whole + 1 <= t; ++whole) {
        y = centre - second * (y - centre);
        v = -second * v;
        centre = -centre;
    }
    // y - centre = exp(0.1 s) (p cos pi s + q sin pi s) within the second.
    const Real s = t - std::floor(static_cast<Real>(t));
    const Real p = y - centre;
    const Real q = (v - growth * p) / pi;
    const Real size = std::exp(growth * s);
    const Real cosine = std::cos(pi * s);
    const Real sine = std::sin(pi * s);
    const Real moved = size * (p * cosine + q * sine);
    const Real rate = growth * moved + size * pi * (q * cosine - p * sine);
    return {static_cast<double>(centre + moved), static_cast<double>(rate)};
}

}  // namespace ricochet
