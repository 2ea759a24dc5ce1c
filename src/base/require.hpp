// Validation of arguments. Each check throws std::invalid_argument with one sentence that begins
// with the name of a type or a function, such as
//
//     Pendulum: length must be positive and finite, got -1
#pragma once

#include <string_view>

namespace ricochet::detail {

/// Throws with a message that begins with `who`:
///
///     constexpr Refuse refuse{"snapshot"};
///     if (text.empty()) refuse("the text is empty");   // snapshot: the text is empty
struct Refuse {
    std::string_view who;

    [[noreturn]] void operator()(std::string_view what) const;
};

/// The same with a condition, and the number that does not meet it:
///
///     constexpr Require require{"certify"};
///     require(o.limit > 0, "limit must be positive", o.limit);
///     // certify: limit must be positive, got -1
struct Require {
    std::string_view who;

    void operator()(bool holds, std::string_view what, double given) const;
};

/// "who: parameter must expected, got given" unless it holds; `expected` is such as "lie in [0,
/// 1]".
void require(bool holds, std::string_view who, std::string_view parameter,
             std::string_view expected, double given);

void require_positive(std::string_view who, std::string_view parameter, double given);
void require_not_negative(std::string_view who, std::string_view parameter, double given);
void require_finite(std::string_view who, std::string_view parameter, double given);

/// Finite, and above `bound`, the value of another parameter.
void require_above(std::string_view who, std::string_view parameter, double given,
                   std::string_view other, double bound);

/// Requires a finite value of at least `bound`, the value of another parameter.
void require_at_least(std::string_view who, std::string_view parameter, double given,
                      std::string_view other, double bound);

}  // namespace ricochet::detail
