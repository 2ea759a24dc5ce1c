// Where a function of the time rises above zero first, for functions that cost several flow calls.
#pragma once

#include <limits>

#include "core/function_ref.hpp"

namespace ricochet::detail {

/// Where a function rises above zero first.
struct Rise {
    double at = std::numeric_limits<double>::infinity();  ///< [s]; infinity: nowhere
    double bend = 0;  ///< its deviation from a straight line over the whole, as a part of its size
};

/// Divides [0, length] until a straight line through the ends of a part says where a function, not
/// positive at 0, is negative: to a 4096th of the length, and in at most 256 parts.
/// @param finest  [s] rounding of the times
[[nodiscard]] Rise first_rise(FunctionRef<double(double)> value, double length, double finest);

}  // namespace ricochet::detail
