// Time at which a polynomial gap closes.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <span>

namespace ricochet::detail {

inline constexpr double never = std::numeric_limits<double>::infinity();

/// Time from now until g + b s + a s^2/2, positive now, falls to zero. A gap no larger than
/// `tolerance` is closed: if it opens, this is the time until it closes again; if it closes
/// further, it is zero.
[[nodiscard]] inline double falls_after(double g, double b, double a, double tolerance) noexcept
{
    if (g <= tolerance) {
        if (b > 0) return a < 0 ? -2 * b / a : never;
        if (b < 0 || a < 0) return 0;
        return never;
    }
    if (a == 0) return b < 0 ? -g / b : never;
    const double square = b * b - 2 * a * g;
    if (a > 0 && (b >= 0 || square < 0)) return never;
    const double root = std::sqrt(square);
    return b < 0 ? 2 * g / (root - b) : (b + root) / -a;
}

/// The largest degree: the squared distance of two steps of degree 4.
inline constexpr int largest_degree = 8;

/// c[0] + c[1] s + ...
using Polynomial = std::array<double, largest_degree + 1>;

[[nodiscard]] inline double value_of(const Polynomial& c, int degree, double s) noexcept
{
    double sum = c[static_cast<std::size_t>(degree)];
    for (int k = degree - 1; k >= 0; --k) sum = sum * s + c[static_cast<std::size_t>(k)];
    return sum;
}

/// As `falls_after` for a polynomial, within `until`, which may be infinite.
[[nodiscard]] double falls_within(Polynomial c, int degree, double until,
                                  double tolerance) noexcept;

/// Times in (0, until], which may be infinite, at which a polynomial falls through zero, ascending,
/// followed by `never`. A root at zero is not one of them.
[[nodiscard]] std::array<double, largest_degree> falls_in(const Polynomial& c, int degree,
                                                          double until) noexcept;

/// Time from now until a polynomial that is negative now has risen and falls to zero again.
[[nodiscard]] double falls_again(const Polynomial& c, int degree, double until) noexcept;

}  // namespace ricochet::detail
