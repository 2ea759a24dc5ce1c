// Internal: the declarations of this header may change without notice.
//
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

[[nodiscard]] constexpr TwoSum two_sum(double a, double b) noexcept
{
    const double sum = a + b;
    const double b_part = sum - a;
    return {sum, (a - (sum - b_part)) + (b - b_part)};
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
