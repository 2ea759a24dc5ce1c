// Internal: the declarations of this header may change without notice.
//
// A root of a function of one variable.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace ricochet::detail {

/// Finds a root of `function` between low and high, whose values have opposite signs, by the
/// Illinois variant of false position, halved if it stagnates. Zero if none exists, or if a value
/// is not a number.
template <class Function>
[[nodiscard]] double false_position(double low, double at_low, double high, double at_high,
                                    double tolerance, const Function& function)
{
    if (!(at_low * at_high <= 0)) return 0;
    const double floor = std::max(tolerance, 4 * std::numeric_limits<double>::epsilon() * high);
    for (int i = 0; i < 200 && high - low > floor && at_high != 0; ++i) {
        double middle = (low * at_high - high * at_low) / (at_high - at_low);
        if (i % 3 == 2 || !(middle > low && middle < high)) middle = low + (high - low) / 2;
        if (!(middle > low && middle < high)) break;
        const double value = function(middle);
        if (std::isnan(value)) return 0;
        if ((value < 0) == (at_high < 0)) {
            high = middle;
            at_high = value;
            at_low /= 2;
        } else {
            low = middle;
            at_low = value;
            at_high /= 2;
        }
    }
    return high;
}

}  // namespace ricochet::detail
