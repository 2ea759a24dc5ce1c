#include "ricochet/locate/toms748.hpp"

#include <boost/math/tools/toms748_solve.hpp>
#include <cstdint>

namespace ricochet::detail {

void toms748(const ValueSearch& search, double a, double b, double value_a, double value_b)
{
    std::uintmax_t iterations = 200;
    boost::math::tools::toms748_solve(
        [&](double s) { return search.value(search.caller, s); }, a, b, value_a, value_b,
        [&](double lo, double hi) { return search.narrow_enough(search.caller, lo, hi); },
        iterations);
}

}  // namespace ricochet::detail
