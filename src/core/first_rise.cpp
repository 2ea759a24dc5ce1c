#include "core/first_rise.hpp"

#include <algorithm>
#include <boost/container/small_vector.hpp>
#include <cassert>
#include <cmath>
#include <utility>

namespace ricochet::detail {

namespace {

/// The end of the bracket [lo, hi] of a root, narrowed to `finest` [s], at which the function is
/// positive.
double narrow_rise(FunctionRef<double(double)> value, double lo, double hi, double finest)
{
    while (hi - lo > std::max(finest, std::numeric_limits<double>::epsilon() * hi)) {
        const double middle = lo + (hi - lo) / 2;
        if (middle == lo || middle == hi) break;
        (value(middle) > 0 ? hi : lo) = middle;
    }
    return hi;
}

}  // namespace

Rise first_rise(FunctionRef<double(double)> value, double length, double finest)
{
    assert(length >= 0 && finest >= 0);
    constexpr int most = 256;
    constexpr double golden = 0.381966;
    boost::container::small_vector<std::pair<double, double>, 16> ends;  // still to be passed
    double a = 0, low = value(0.0);
    ends.emplace_back(length, value(length));
    Rise rise;
    for (int count = 0; !ends.empty();) {
        const auto [b, high] = ends.back();
        const double m = a + golden * (b - a), inner = value(m);
        const double bend = std::fabs(inner - (low + golden * (high - low)));
        const double size = std::max({std::fabs(low), std::fabs(inner), std::fabs(high)});
        if (count++ == 0 && size > 0) rise.bend = bend / size;
        const bool resolved = b - a <= length / 4096 || count >= most;
        if (high > 0 && (resolved || (low < 0 && bend <= (high - low) / 4))) {
            rise.at =
                inner > 0 ? narrow_rise(value, a, m, finest) : narrow_rise(value, m, b, finest);
            return rise;
        }
        if (high <= 0 && inner <= 0 && (resolved || std::max({low, inner, high}) + 4 * bend < 0)) {
            a = b;
            low = high;
            ends.pop_back();
        } else {
            ends.emplace_back(m, inner);
        }
    }
    return rise;
}

}  // namespace ricochet::detail
