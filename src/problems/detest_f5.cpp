#include "problems/detest_f5.hpp"

namespace ricochet {

DetestF5::State DetestF5::solution(double t) noexcept
{
    using Real = long double;  // a reference for runs in double
    Real here = 0;
    Real at_start = 0;
    for (int i = 1; i <= last; ++i) {
        const Real root = std::cbrt(std::fabs(Real{t} - i));
        here += root * root * root * root;
        at_start += i * std::cbrt(Real(i));
    }
    return {static_cast<double>(std::exp((here - at_start) / at_start))};
}

}  // namespace ricochet
