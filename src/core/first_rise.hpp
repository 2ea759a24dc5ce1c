// Where a function of the time rises above zero first, for functions that cost several flow calls.
#pragma once

#include <algorithm>
#include <boost/container/small_vector.hpp>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

namespace ricochet::detail {

/// Where a function rises above zero first.
struct Rise {
    double at = std::numeric_limits<double>::infinity();  ///< [s]; infinity: nowhere
    double bend = 0;  ///< its deviation from a straight line over the whole, as a part of its size
};

/// The end of the bracket [lo, hi] of a root, narrowed to `finest` [s], at which the function is
/// positive.
template <class Value>
[[nodiscard]] double narrow_rise(const Value& value, double lo, double hi, double finest)
{
    while (hi - lo > std::max(finest, std::numeric_limits<double>::epsilon() * hi)) {
        const double middle = lo + (hi - lo) / 2;
        if (middle == lo || middle == hi) break;
        (value(middle) > 0 ? hi : lo) = middle;
    }
    return hi;
}

/// Divides [0, length] until a straight line through the ends of a part says where a function, not
/// positive at 0, is negative: to a 4096th of the length, and in at most 256 parts.
/// @param finest  [s] rounding of the times
template <class Value>
[[nodiscard]] Rise first_rise(const Value& value, double length, double finest)
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
