// Enclosures along an interval of a motion: affine arithmetic in one symbol of time.
//
//     Enclosure x{centre, slope, radius};      // x(tau) in centre + slope tau +- radius, -1 <= tau
//     <= 1 const auto g = sqrt(x * x + y * y) - 1; if (g.lower() > 0) ...               // no root
//     of g anywhere on the interval
//
// The symbol tau is the time on the interval, from its start at -1 to its end at 1. What moves with
// the time in two quantities is subtracted from one another, as an interval could not: x - x is 0
// but for its radius. (Affine arithmetic with one symbol kept and all others collected in an
// interval: L. H. de Figueiredo and J. Stolfi, Affine arithmetic: concepts and applications,
// Numerical Algorithms 37, 2004.)
//
// Each operation adds what its own rounding may take to the radius: the enclosure holds for the
// exact value of the expression, and for the one that double arithmetic computes from the same
// operations. Functions of the mathematical library are trusted to 8 units in the last place. What
// is not defined on the whole range, such as a square root across 0, has an infinite radius.
//
// Functions are found by argument-dependent lookup: `using std::cos; cos(x)`.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace ricochet {

namespace detail {
template <class>
inline constexpr bool is_never_enclosure = false;

/// Set where a comparison of enclosures was not decided: what the function returned that compared
/// encloses nothing.
inline thread_local bool is_undecided = false;
}  // namespace detail

/// A quantity along an interval: centre + slope tau + radius epsilon, with tau and epsilon in [-1,
/// 1].
class Enclosure {
public:
    double centre = 0;
    double slope = 0;   ///< change over half of the interval
    double radius = 0;  ///< at least 0; infinite where nothing is known

    constexpr Enclosure() = default;
    /// A number.
    template <class U>
    requires std::is_arithmetic_v<U>
    constexpr Enclosure(const U& constant) noexcept  // NOLINT(google-explicit-constructor)
        : centre(static_cast<double>(constant))
    {
    }
    /// centre + slope tau +- radius. @param radius_  at least 0
    constexpr Enclosure(double centre_, double slope_, double radius_) noexcept
        : centre(centre_), slope(slope_), radius(radius_)
    {
    }

    /// Rejects the conversion to a number: a function was not found for enclosures, or a parameter
    /// is declared as double.
    template <class U>
    requires std::is_same_v<U, double>
    constexpr operator U() const  // NOLINT(google-explicit-constructor)
    {
        static_assert(detail::is_never_enclosure<U>,
                      "ricochet: found a number wanted of an enclosure; expected functions called "
                      "by their bare names (using std::cos; cos(x)) and the time and the state to "
                      "have the type of the function's template parameter");
        return U();
    }

    /// A quantity of which nothing is known.
    [[nodiscard]] static constexpr Enclosure unknown() noexcept { return {0, 0, infinite}; }

    /// Bounds of the quantity on the whole interval, rounded outward.
    [[nodiscard]] double lower() const noexcept { return centre - reach(); }
    [[nodiscard]] double upper() const noexcept { return centre + reach(); }

    friend Enclosure operator+(const Enclosure& a) noexcept { return a; }
    friend Enclosure operator-(const Enclosure& a) noexcept
    {
        return {-a.centre, -a.slope, a.radius};
    }
    friend Enclosure operator+(const Enclosure& a, const Enclosure& b) noexcept
    {
        return rounded({a.centre + b.centre, a.slope + b.slope, a.radius + b.radius});
    }
    friend Enclosure operator-(const Enclosure& a, const Enclosure& b) noexcept
    {
        return rounded({a.centre - b.centre, a.slope - b.slope, a.radius + b.radius});
    }
    friend Enclosure operator*(const Enclosure& a, const Enclosure& b) noexcept
    {
        // tau^2 lies in [0, 1].
        const double square = 0.5 * a.slope * b.slope;
        const double size_a = std::fabs(a.centre) + std::fabs(a.slope);
        const double size_b = std::fabs(b.centre) + std::fabs(b.slope);
        const double radius =
            size_a * b.radius + size_b * a.radius + a.radius * b.radius + std::fabs(square);
        const Enclosure product{a.centre * b.centre + square,
                                a.centre * b.slope + a.slope * b.centre, radius};
        return product.enlarged(4 * unit * (size_a + a.radius) * (size_b + b.radius) + least);
    }
    friend Enclosure operator/(const Enclosure& a, const Enclosure& b) noexcept
    {
        return a * reciprocal(b);
    }

    template <class U>
    Enclosure& operator+=(const U& b) noexcept
    {
        return *this = *this + b;
    }
    template <class U>
    Enclosure& operator-=(const U& b) noexcept
    {
        return *this = *this - b;
    }
    template <class U>
    Enclosure& operator*=(const U& b) noexcept
    {
        return *this = *this * b;
    }
    template <class U>
    Enclosure& operator/=(const U& b) noexcept
    {
        return *this = *this / b;
    }

    // Numbers of any type, without a conversion that competes with the one to a number.
#define RICOCHET_ENCLOSURE_WITH_NUMBERS(result, name)           \
    template <class U>                                          \
    requires std::is_arithmetic_v<U>                            \
    friend result name(const Enclosure& a, const U& b) noexcept \
    {                                                           \
        return name(a, Enclosure(b));                           \
    }                                                           \
    template <class U>                                          \
    requires std::is_arithmetic_v<U>                            \
    friend result name(const U& a, const Enclosure& b) noexcept \
    {                                                           \
        return name(Enclosure(a), b);                           \
    }
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, operator+)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, operator-)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, operator*)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, operator/)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(bool, operator<)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(bool, operator>)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(bool, operator<=)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(bool, operator>=)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(bool, operator==)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(bool, operator!=)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, max)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, min)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, fmax)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, fmin)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, hypot)
    RICOCHET_ENCLOSURE_WITH_NUMBERS(Enclosure, atan2)
#undef RICOCHET_ENCLOSURE_WITH_NUMBERS

    // Comparisons hold for the whole interval. Where they do on a part of it only, they are not
    // decided, and no value that depends on them encloses anything.
    friend bool operator<(const Enclosure& a, const Enclosure& b) noexcept
    {
        const Enclosure gap = a - b;
        return decide(gap.upper() < 0, gap.lower() >= 0, gap);
    }
    friend bool operator<=(const Enclosure& a, const Enclosure& b) noexcept
    {
        const Enclosure gap = a - b;
        return decide(gap.upper() <= 0, gap.lower() > 0, gap);
    }
    friend bool operator>(const Enclosure& a, const Enclosure& b) noexcept
    {
        return b < a;
    }
    friend bool operator>=(const Enclosure& a, const Enclosure& b) noexcept
    {
        return b <= a;
    }
    friend bool operator==(const Enclosure& a, const Enclosure& b) noexcept
    {
        if (a.is_number() && b.is_number()) return a.centre == b.centre;
        const Enclosure gap = a - b;
        if (!(gap.lower() > 0 || gap.upper() < 0)) detail::is_undecided = true;
        return false;
    }
    friend bool operator!=(const Enclosure& a, const Enclosure& b) noexcept
    {
        return !(a == b);
    }

    friend Enclosure abs(const Enclosure& a) noexcept
    {
        const double lo = a.lower();
        const double hi = a.upper();
        if (lo >= 0) return a;
        if (hi <= 0) return -a;
        if (!a.is_finite()) return unknown();
        Line line((hi + lo) / (hi - lo));
        line.include(lo, -lo);
        line.include(hi, hi);
        line.include(0, 0);
        return line.of(a);
    }
    friend Enclosure fabs(const Enclosure& a) noexcept
    {
        return abs(a);
    }
    friend Enclosure max(const Enclosure& a, const Enclosure& b) noexcept
    {
        return b + positive_part(a - b);
    }
    friend Enclosure min(const Enclosure& a, const Enclosure& b) noexcept
    {
        return b - positive_part(b - a);
    }
    friend Enclosure fmax(const Enclosure& a, const Enclosure& b) noexcept
    {
        return max(a, b);
    }
    friend Enclosure fmin(const Enclosure& a, const Enclosure& b) noexcept
    {
        return min(a, b);
    }

    /// 1/a; unknown where the range includes 0.
    friend Enclosure reciprocal(const Enclosure& a) noexcept
    {
        const double lo = a.lower();
        const double hi = a.upper();
        if (hi < 0) return -reciprocal(-a);
        if (!(lo > 0) || !a.is_finite()) return unknown();
        // Convex: greatest above the secant at the ends, least where the slope is the secant's.
        Line line(-1 / lo / hi);
        line.include(lo, 1 / lo);
        line.include(hi, 1 / hi);
        line.include_difference(2 * std::sqrt(-line.slope), 0);
        return line.of(a);
    }
    /// Unknown where the range has numbers below 0.
    friend Enclosure sqrt(const Enclosure& a) noexcept
    {
        const double lo = a.lower();
        const double hi = a.upper();
        if (!(lo >= 0) || !a.is_finite()) return unknown();
        const double root_lo = std::sqrt(lo), root_hi = std::sqrt(hi);
        if (!(root_lo + root_hi > 0)) return {};
        Line line(1 / (root_lo + root_hi));
        line.include(lo, root_lo);
        line.include(hi, root_hi);
        line.include_difference(0.25 / line.slope, 0);
        return line.of(a);
    }
    friend Enclosure exp(const Enclosure& a) noexcept
    {
        const double lo = a.lower();
        const double hi = a.upper();
        if (!a.is_finite()) return unknown();
        const double at_lo = std::exp(lo), at_hi = std::exp(hi);
        Line line(hi - lo > 1e-3 ? (at_hi - at_lo) / (hi - lo) : std::exp(a.centre));
        if (!(line.slope > 0) || !std::isfinite(at_hi)) return hull(0, at_hi);
        const double log_slope = std::log(line.slope);
        line.include(lo, at_lo);
        line.include(hi, at_hi);
        line.include_difference(line.slope * (1 - log_slope), line.slope * std::fabs(log_slope));
        return line.of(a);
    }
    /// Unknown where the range has numbers that are not positive.
    friend Enclosure log(const Enclosure& a) noexcept
    {
        const double lo = a.lower();
        const double hi = a.upper();
        if (!(lo > 0) || !a.is_finite()) return unknown();
        Line line(hi - lo > 1e-3 * hi ? std::log(hi / lo) / (hi - lo) : 1 / a.centre);
        const double log_slope = std::log(line.slope);
        line.include(lo, std::log(lo));
        line.include(hi, std::log(hi));
        line.include_difference(-log_slope - 1, std::fabs(log_slope));
        return line.of(a);
    }
    friend Enclosure sin(const Enclosure& a) noexcept
    {
        if (!a.is_finite()) return hull(-1, 1);
        const double f = std::sin(a.centre);
        return by_curvature(a, {f, std::cos(a.centre), -f, 1}, {-1, 1});
    }
    friend Enclosure cos(const Enclosure& a) noexcept
    {
        if (!a.is_finite()) return hull(-1, 1);
        const double f = std::cos(a.centre);
        return by_curvature(a, {f, -std::sin(a.centre), -f, 1}, {-1, 1});
    }
    friend Enclosure tanh(const Enclosure& a) noexcept
    {
        if (!a.is_finite()) return hull(-1, 1);
        const double f = std::tanh(a.centre);
        const double rate = 1 - f * f;
        return by_curvature(a, {f, rate, -2 * f * rate, 2},
                            {std::tanh(a.lower()), std::tanh(a.upper())});
    }
    friend Enclosure atan(const Enclosure& a) noexcept
    {
        constexpr double quarter = 1.5707963267948968;  // at least pi / 2
        if (!a.is_finite()) return hull(-quarter, quarter);
        const double rate = 1 / (1 + a.centre * a.centre);
        return by_curvature(a, {std::atan(a.centre), rate, -2 * a.centre * rate * rate, 2},
                            {std::atan(a.lower()), std::atan(a.upper())});
    }
    friend Enclosure tan(const Enclosure& a) noexcept
    {
        return sin(a) / cos(a);
    }
    friend Enclosure sinh(const Enclosure& a) noexcept
    {
        return 0.5 * (exp(a) - exp(-a));
    }
    friend Enclosure cosh(const Enclosure& a) noexcept
    {
        return 0.5 * (exp(a) + exp(-a));
    }
    /// Unknown where the range is not inside (-1, 1).
    friend Enclosure asin(const Enclosure& a) noexcept
    {
        const double lo = a.lower();
        const double hi = a.upper();
        if (!(lo > -1 && hi < 1)) return unknown();
        const double rate_lo = 1 / std::sqrt((1 - lo) * (1 + lo));
        const double rate_hi = 1 / std::sqrt((1 - hi) * (1 + hi));
        const double least_rate = lo < 0 && hi > 0 ? 1 : std::fmin(rate_lo, rate_hi);
        return by_rates(a, std::asin(a.centre), least_rate, std::fmax(rate_lo, rate_hi));
    }
    friend Enclosure acos(const Enclosure& a) noexcept
    {
        return 1.5707963267948966 - asin(a);
    }
    friend Enclosure cbrt(const Enclosure& a) noexcept
    {
        const double lo = a.lower();
        const double hi = a.upper();
        if (hi < 0) return -cbrt(-a);
        if (!a.is_finite()) return unknown();
        if (!(lo > 0)) return hull(std::cbrt(lo), std::cbrt(hi));
        const double root_lo = std::cbrt(lo), root_hi = std::cbrt(hi);
        return by_rates(a, std::cbrt(a.centre), 1 / (3 * root_hi * root_hi),
                        1 / (3 * root_lo * root_lo));
    }
    /// Piecewise constant: a number where the whole range has the same.
    friend Enclosure floor(const Enclosure& a) noexcept
    {
        return hull(std::floor(a.lower()), std::floor(a.upper()));
    }
    friend Enclosure ceil(const Enclosure& a) noexcept
    {
        return hull(std::ceil(a.lower()), std::ceil(a.upper()));
    }
    friend Enclosure hypot(const Enclosure& a, const Enclosure& b) noexcept
    {
        return sqrt(a * a + b * b);
    }
    /// Unknown where the range reaches the negative half of the x axis, on which it jumps.
    friend Enclosure atan2(const Enclosure& y, const Enclosure& x) noexcept
    {
        constexpr double quarter = 1.5707963267948966;
        if (x.lower() > 0) return atan(y / x);
        if (y.lower() > 0) return quarter - atan(x / y);
        if (y.upper() < 0) return -quarter - atan(x / y);
        return unknown();
    }
    /// Whole powers by products, others by the logarithm of a positive range.
    template <class U>
    requires std::is_arithmetic_v<U>
    friend Enclosure pow(const Enclosure& a, const U& exponent) noexcept
    {
        const auto b = static_cast<double>(exponent);
        const double size = std::fabs(b);
        if (b == 0.5) return sqrt(a);
        if (size <= 64 && size == std::floor(size)) {
            const Enclosure power = whole_power(a, static_cast<int>(size));
            return b < 0 ? reciprocal(power) : power;
        }
        return exp(b * log(a));
    }
    friend Enclosure pow(const Enclosure& a, const Enclosure& b) noexcept
    {
        if (b.is_number()) return pow(a, b.centre);
        return exp(b * log(a));
    }
    /// @param a  positive
    template <class U>
    requires std::is_arithmetic_v<U>
    friend Enclosure pow(const U& a, const Enclosure& b) noexcept
    {
        return exp(b * log(Enclosure(a)));
    }

    /// Whether the number is the same on the whole interval, and known exactly.
    [[nodiscard]] bool is_number() const noexcept
    {
        return slope == 0 && radius == 0;
    }
    [[nodiscard]] bool is_finite() const noexcept
    {
        return std::isfinite(centre) && std::isfinite(slope) && std::isfinite(radius);
    }
    /// The same with a larger radius.
    [[nodiscard]] Enclosure enlarged(double by) const noexcept
    {
        return {centre, slope, (radius + by) * (1 + 4 * unit)};
    }
    /// Everything between two numbers.
    [[nodiscard]] static Enclosure hull(double lo, double hi) noexcept
    {
        if (lo == hi) return lo;
        const double centre = 0.5 * lo + 0.5 * hi;
        const double size = std::fabs(lo) + std::fabs(hi);
        return Enclosure{centre, 0, 0.5 * hi - 0.5 * lo}.enlarged(16 * unit * size + least);
    }

private:
    static constexpr double infinite = std::numeric_limits<double>::infinity();
    static constexpr double unit = std::numeric_limits<double>::epsilon();
    /// Above what may underflow in an operation.
    static constexpr double least = std::numeric_limits<double>::min();

    /// Bound of the quantity's distance from its centre, with that of the roundings of a sum.
    [[nodiscard]] double reach() const noexcept
    {
        const double sum = std::fabs(slope) + radius;
        return sum + 4 * unit * (std::fabs(centre) + sum);
    }

    /// A sum whose parts have been rounded once each.
    [[nodiscard]] static Enclosure rounded(const Enclosure& sum) noexcept
    {
        if (sum.is_number() && sum.centre == 0) return sum;
        return sum.enlarged(2 * unit * (std::fabs(sum.centre) + std::fabs(sum.slope) + sum.radius));
    }

    [[nodiscard]] static bool decide(bool is_true, bool is_false, const Enclosure& gap) noexcept
    {
        if (!is_true && !is_false) detail::is_undecided = true;
        return is_true || (!is_false && gap.centre < 0);
    }

    [[nodiscard]] static Enclosure positive_part(const Enclosure& a) noexcept
    {
        const double lo = a.lower();
        const double hi = a.upper();
        if (lo >= 0) return a;
        if (hi <= 0) return 0;
        if (!a.is_finite()) return unknown();
        Line line(hi / (hi - lo));
        line.include(lo, 0);
        line.include(hi, hi);
        line.include(0, 0);
        return line.of(a);
    }

    [[nodiscard]] static Enclosure whole_power(Enclosure a, int n) noexcept
    {
        Enclosure power = 1;
        for (; n > 0; n /= 2) {
            if (n % 2 == 1) power = power.is_number() && power.centre == 1 ? a : power * a;
            if (n > 1) a = a * a;
        }
        return power;
    }

    /// A function between two lines of the same slope, from its differences to slope x.
    struct Line {
        double slope;
        double low = infinite;
        double high = -infinite;
        double size = 0;  ///< of the terms of the differences

        explicit Line(double slope_) noexcept : slope(slope_) {}

        void include(double x, double f) noexcept
        {
            include_difference(f - slope * x, std::fabs(f) + std::fabs(slope * x));
        }
        void include_difference(double d, double of_terms) noexcept
        {
            low = std::fmin(low, d);
            high = std::fmax(high, d);
            size = std::fmax(size, of_terms + std::fabs(d));
        }
        [[nodiscard]] Enclosure of(const Enclosure& a) const noexcept
        {
            const Enclosure f{slope * a.centre + (0.5 * low + 0.5 * high), slope * a.slope,
                              std::fabs(slope) * a.radius + (0.5 * high - 0.5 * low)};
            const double terms = std::fabs(slope) * (std::fabs(a.centre) + std::fabs(a.slope));
            return f.enlarged(16 * unit * (size + terms) + least);
        }
    };

    /// A function at the centre with its first two derivatives, and a bound of the third.
    struct Expansion {
        double f, first, second, third;
    };
    struct Interval {
        double lo, hi;
    };

    /// Taylor's expansion with its remainder, or all values of the function where these are fewer.
    [[nodiscard]] static Enclosure by_curvature(const Enclosure& a, const Expansion& at,
                                                const Interval& values) noexcept
    {
        const double reach = a.reach();
        const double bend = 0.25 * at.second * reach * reach;  // f'' (x - centre)^2 / 2, halved
        const double rest = std::fabs(bend) + at.third * reach * reach * reach / 6;
        const Enclosure f{at.f + bend, at.first * a.slope, std::fabs(at.first) * a.radius + rest};
        if (!(f.radius + std::fabs(f.slope) < values.hi - values.lo)) {
            return hull(values.lo, values.hi);
        }
        // A centre is known exactly, but its sine only to 8 units.
        return f.enlarged(16 * unit * (std::fabs(at.f) + std::fabs(at.first) * reach + rest) +
                          least);
    }

    /// A function with its value at the centre and bounds of its derivative.
    [[nodiscard]] static Enclosure by_rates(const Enclosure& a, double f, double least_rate,
                                            double largest_rate) noexcept
    {
        const double reach = a.reach();
        const double rate = 0.5 * (least_rate + largest_rate);
        const double spread = 0.5 * (largest_rate - least_rate) * reach;
        const Enclosure line{f, rate * a.slope, rate * a.radius + spread};
        return line.enlarged(16 * unit * (std::fabs(f) + 2 * rate * reach) + least);
    }
};

}  // namespace ricochet
