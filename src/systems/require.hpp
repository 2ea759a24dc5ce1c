// Checks that the constructors of the ready systems share. Each throws
// std::invalid_argument with a sentence such as
//
//     Pendulum: length must be positive and finite, got -1
#pragma once

#include <string_view>

namespace ricochet::detail {

/// `expected` is what the parameter must do: "lie in [0, 1]".
void require(bool holds, std::string_view system, std::string_view parameter,
             std::string_view expected, double given);

void require_positive(std::string_view system, std::string_view parameter, double given);
void require_not_negative(std::string_view system, std::string_view parameter, double given);
void require_finite(std::string_view system, std::string_view parameter, double given);

/// Finite, and above `bound`, the value of another parameter.
void require_above(std::string_view system, std::string_view parameter, double given,
                   std::string_view other, double bound);

/// Finite, and no less than `bound`, the value of another parameter.
void require_at_least(std::string_view system, std::string_view parameter, double given,
                      std::string_view other, double bound);

}  // namespace ricochet::detail
