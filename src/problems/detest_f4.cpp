#include "problems/detest_f4.hpp"

#include <cmath>

namespace ricochet {

DetestF4::State DetestF4::solution(double t) noexcept
{
    using Real = long double;  // a reference for runs in double
    if (t > change) return {static_cast<double>(std::exp(-2 * (Real{t} - change)) / 21)};
    const Real s = Real{t} - 5;
    return {static_cast<double>(1 - 2 * Real{t} / 21 + std::pow(1 + 4 * s * s, -15.0L) -
                                std::pow(101.0L, -15.0L))};
}

}  // namespace ricochet
