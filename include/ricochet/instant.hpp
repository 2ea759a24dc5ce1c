// Compensated sums: time and state are carried together with their rounding errors.
//
// A million additions of a step to a time accumulate a million roundings; if the rounding
// error of each addition is kept and added to the next, only one remains. The sum of two
// doubles and its exact rounding error are computed by Knuth's two-sum (The Art of
// Computer Programming 2, section 4.2.2, theorem B), which compilers keep intact
// unless told to reassociate floating point.
#pragma once

namespace ricochet {

/// a + b = value + remainder, exactly.
struct TwoSum {
    double value;
    double remainder;
};

/// The sum of a and b with its rounding error, for finite values in any order.
[[nodiscard]] constexpr TwoSum two_sum(double a, double b) noexcept
{
    const double sum = a + b;
    const double b_part = sum - a;
    return {sum, (a - (sum - b_part)) + (b - b_part)};
}

/// a b = value + remainder, exactly but for underflow; a remainder of 0 above 1e300. By Dekker's
/// product of halves (Numer. Math. 18 (1971) 224-242), since not every processor has fused
/// multiply-add.
[[nodiscard]] constexpr TwoSum two_product(double a, double b) noexcept
{
    constexpr double half = 0x1p27 + 1;
    const double product = a * b;
    const double a1 = half * a - (half * a - a), b1 = half * b - (half * b - b);
    const double a2 = a - a1, b2 = b - b1;
    const double rest = ((a1 * b1 - product) + (a1 * b2 + a2 * b1)) + a2 * b2;
    return {product, rest == rest ? rest : 0};
}

/// A time [s] carried as value + remainder.
struct Instant {
    double value = 0;
    double remainder = 0;

    /// The instant `s` seconds later.
    [[nodiscard]] constexpr Instant after(double s) const noexcept
    {
        const TwoSum sum = two_sum(value, remainder + s);
        return {sum.value, sum.remainder};
    }

    /// The same, rounded to one double.
    [[nodiscard]] constexpr double plus(double s) const noexcept { return value + (remainder + s); }

    /// Seconds from here to the time `t`.
    [[nodiscard]] constexpr double until(double t) const noexcept
    {
        return (t - value) - remainder;
    }
};

}  // namespace ricochet
