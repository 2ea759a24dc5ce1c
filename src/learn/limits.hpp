// Infinity and NaN, by short names.
#pragma once

#include <limits>

namespace ricochet::learn {

inline constexpr double infinity = std::numeric_limits<double>::infinity();
inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();

}  // namespace ricochet::learn
