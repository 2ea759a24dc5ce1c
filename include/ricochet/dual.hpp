// Dual numbers: a value and its derivatives in N directions, computed together.
//
//     Dual<2> x{3.0, {1, 0}}, y{4.0, {0, 1}};
//     const auto r = sqrt(x * x + y * y);    // r.value = 5, r.slope = {0.6, 0.8}
//
// (A. Griewank and A. Walther, Evaluating Derivatives, 2nd edition, SIAM, 2008, chapter 3.) Duals
// of duals, Dual<1, Dual<1>>, have second derivatives.
//
// Functions are found by argument-dependent lookup: `using std::cos; cos(x)`. Comparisons compare
// the values; where a function has a kink, it has the derivative of the branch on which the
// value lies.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

namespace ricochet {

namespace detail {
template <class>
inline constexpr bool is_never_number = false;
}  // namespace detail

/// @tparam T  type of the value and of the derivatives: double, or a dual again
template <std::size_t N, class T = double>
struct Dual {
    T value{};
    std::array<T, N> slope{};

    constexpr Dual() = default;
    template <class U>
    requires std::is_arithmetic_v<U>
    constexpr Dual(const U& constant) noexcept  // NOLINT(google-explicit-constructor)
        : value(static_cast<double>(constant))
    {
    }
    constexpr Dual(const T& value_, const std::array<T, N>& slope_) : value(value_), slope(slope_)
    {
    }

    /// Rejects the conversion of a dual to double: a function was not found for duals, or a
    /// parameter is declared as double.
    template <class U>
    requires std::is_same_v<U, double>
    constexpr operator U() const  // NOLINT(google-explicit-constructor)
    {
        static_assert(detail::is_never_number<U>,
                      "ricochet: found a number wanted of a dual number; expected functions called "
                      "by their bare names (using std::cos; cos(x)) and the time and the state to "
                      "have the type of the function's template parameter");
        return U();
    }

    friend constexpr Dual operator+(const Dual& a) { return a; }
    friend constexpr Dual operator-(const Dual& a)
    {
        return a.to(-a.value, [](const T& d) { return -d; });
    }
    friend constexpr Dual operator+(const Dual& a, const Dual& b)
    {
        return a.with(b, a.value + b.value, [](const T& d, const T& e) { return d + e; });
    }
    friend constexpr Dual operator-(const Dual& a, const Dual& b)
    {
        return a.with(b, a.value - b.value, [](const T& d, const T& e) { return d - e; });
    }
    friend constexpr Dual operator*(const Dual& a, const Dual& b)
    {
        return a.with(b, a.value * b.value,
                      [&](const T& d, const T& e) { return d * b.value + a.value * e; });
    }
    friend constexpr Dual operator/(const Dual& a, const Dual& b)
    {
        const T f = a.value / b.value;
        return a.with(b, f, [&](const T& d, const T& e) { return (d - f * e) / b.value; });
    }

    // Numbers of any type, without a conversion that competes with the one from dual to number.
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual operator+(const Dual& a, const U& b)
    {
        return {a.value + number(b), a.slope};
    }
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual operator+(const U& a, const Dual& b)
    {
        return {number(a) + b.value, b.slope};
    }
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual operator-(const Dual& a, const U& b)
    {
        return {a.value - number(b), a.slope};
    }
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual operator-(const U& a, const Dual& b)
    {
        return b.to(number(a) - b.value, [](const T& d) { return -d; });
    }
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual operator*(const Dual& a, const U& b)
    {
        return a.to(a.value * number(b), [&](const T& d) { return d * number(b); });
    }
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual operator*(const U& a, const Dual& b)
    {
        return b.to(number(a) * b.value, [&](const T& d) { return number(a) * d; });
    }
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual operator/(const Dual& a, const U& b)
    {
        return a.to(a.value / number(b), [&](const T& d) { return d / number(b); });
    }
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual operator/(const U& a, const Dual& b)
    {
        const T f = number(a) / b.value;
        return b.to(f, [&](const T& d) { return -f * d / b.value; });
    }

#define RICOCHET_DUAL_OPERATOR(op)             \
    template <class U>                         \
    constexpr Dual& operator op##=(const U& b) \
    {                                          \
        return *this = *this op b;             \
    }
    RICOCHET_DUAL_OPERATOR(+)
    RICOCHET_DUAL_OPERATOR(-)
    RICOCHET_DUAL_OPERATOR(*)
    RICOCHET_DUAL_OPERATOR(/)
#undef RICOCHET_DUAL_OPERATOR

#define RICOCHET_DUAL_COMPARISON(op)                                \
    friend constexpr bool operator op(const Dual& a, const Dual& b) \
    {                                                               \
        return a.value op b.value;                                  \
    }                                                               \
    template <class U>                                              \
    requires std::is_arithmetic_v<U>                                \
    friend constexpr bool operator op(const Dual& a, const U& b)    \
    {                                                               \
        return a.value op number(b);                                \
    }                                                               \
    template <class U>                                              \
    requires std::is_arithmetic_v<U>                                \
    friend constexpr bool operator op(const U& a, const Dual& b)    \
    {                                                               \
        return number(a) op b.value;                                \
    }
    RICOCHET_DUAL_COMPARISON(<)
    RICOCHET_DUAL_COMPARISON(>)
    RICOCHET_DUAL_COMPARISON(<=)
    RICOCHET_DUAL_COMPARISON(>=)
    RICOCHET_DUAL_COMPARISON(==)
    RICOCHET_DUAL_COMPARISON(!=)
#undef RICOCHET_DUAL_COMPARISON

    // Functions, each with its derivative.
    friend constexpr Dual sqrt(const Dual& a)
    {
        using std::sqrt;
        const T f = sqrt(a.value);
        return a.chain(f, 0.5 / f);
    }
    friend constexpr Dual cbrt(const Dual& a)
    {
        using std::cbrt;
        const T f = cbrt(a.value);
        return a.chain(f, 1.0 / (3.0 * f * f));
    }
    friend constexpr Dual exp(const Dual& a)
    {
        using std::exp;
        const T f = exp(a.value);
        return a.chain(f, f);
    }
    friend constexpr Dual log(const Dual& a)
    {
        using std::log;
        return a.chain(log(a.value), 1.0 / a.value);
    }
    friend constexpr Dual sin(const Dual& a)
    {
        using std::sin, std::cos;
        return a.chain(sin(a.value), cos(a.value));
    }
    friend constexpr Dual cos(const Dual& a)
    {
        using std::sin, std::cos;
        return a.chain(cos(a.value), -sin(a.value));
    }
    friend constexpr Dual tan(const Dual& a)
    {
        using std::tan;
        const T f = tan(a.value);
        return a.chain(f, 1.0 + f * f);
    }
    friend constexpr Dual asin(const Dual& a)
    {
        using std::asin, std::sqrt;
        return a.chain(asin(a.value), 1.0 / sqrt(1.0 - a.value * a.value));
    }
    friend constexpr Dual acos(const Dual& a)
    {
        using std::acos, std::sqrt;
        return a.chain(acos(a.value), -1.0 / sqrt(1.0 - a.value * a.value));
    }
    friend constexpr Dual atan(const Dual& a)
    {
        using std::atan;
        return a.chain(atan(a.value), 1.0 / (1.0 + a.value * a.value));
    }
    friend constexpr Dual sinh(const Dual& a)
    {
        using std::sinh, std::cosh;
        return a.chain(sinh(a.value), cosh(a.value));
    }
    friend constexpr Dual cosh(const Dual& a)
    {
        using std::sinh, std::cosh;
        return a.chain(cosh(a.value), sinh(a.value));
    }
    friend constexpr Dual tanh(const Dual& a)
    {
        using std::tanh;
        const T f = tanh(a.value);
        return a.chain(f, 1.0 - f * f);
    }
    friend constexpr Dual fabs(const Dual& a)
    {
        return a.value < 0 ? -a : a;
    }
    friend constexpr Dual abs(const Dual& a)
    {
        return fabs(a);
    }
    /// Rounds down. The function is piecewise constant: its derivative is 0 wherever it exists.
    friend constexpr Dual floor(const Dual& a)
    {
        using std::floor;
        return a.chain(floor(a.value), T(0.0));
    }
    friend constexpr Dual ceil(const Dual& a)
    {
        using std::ceil;
        return a.chain(ceil(a.value), T(0.0));
    }

    // Functions of two arguments, either of which may be a number.
    friend constexpr Dual atan2(const Dual& y, const Dual& x)
    {
        using std::atan2;
        const T r2 = x.value * x.value + y.value * y.value;
        return y.with(x, atan2(y.value, x.value), [&](const T& dy, const T& dx) {
            return vanishes(dy) && vanishes(dx) ? T(0.0) : (x.value * dy - y.value * dx) / r2;
        });
    }
    friend constexpr Dual hypot(const Dual& a, const Dual& b)
    {
        using std::hypot;
        const T f = hypot(a.value, b.value);
        return a.with(b, f, [&](const T& d, const T& e) {
            return vanishes(d) && vanishes(e) ? T(0.0) : (a.value * d + b.value * e) / f;
        });
    }
#define RICOCHET_DUAL_WITH_NUMBERS(name)                  \
    template <class U>                                    \
    requires std::is_arithmetic_v<U>                      \
    friend constexpr Dual name(const Dual& a, const U& b) \
    {                                                     \
        return name(a, Dual(b));                          \
    }                                                     \
    template <class U>                                    \
    requires std::is_arithmetic_v<U>                      \
    friend constexpr Dual name(const U& a, const Dual& b) \
    {                                                     \
        return name(Dual(a), b);                          \
    }
    RICOCHET_DUAL_WITH_NUMBERS(atan2)
    RICOCHET_DUAL_WITH_NUMBERS(hypot)
    RICOCHET_DUAL_WITH_NUMBERS(fmax)
    RICOCHET_DUAL_WITH_NUMBERS(fmin)
#undef RICOCHET_DUAL_WITH_NUMBERS
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual pow(const Dual& a, const U& exponent)
    {
        using std::pow;
        const double b = number(exponent);
        return a.chain(pow(a.value, b), b == 0 ? T(0.0) : b * pow(a.value, b - 1));
    }
    friend constexpr Dual pow(const Dual& a, const Dual& b)
    {
        using std::pow, std::log;
        const T f = pow(a.value, b.value);
        return a.with(b, f, [&](const T& d, const T& e) {
            const bool by_base = !vanishes(d) && !vanishes(b.value);
            // 0^b = 0 for all b > 0
            const bool by_exponent = !vanishes(e) && !(vanishes(a.value) && is_positive(b.value));
            if (!by_exponent) {
                return by_base ? b.value * pow(a.value, b.value - 1.0) * d : T(0.0);
            }
            if (!by_base) return f * log(a.value) * e;
            return b.value * pow(a.value, b.value - 1.0) * d + f * log(a.value) * e;
        });
    }
    template <class U>
    requires std::is_arithmetic_v<U>
    friend constexpr Dual pow(const U& a, const Dual& b)
    {
        using std::pow, std::log;
        const T f = pow(T(number(a)), b.value);
        if (number(a) == 0 && is_positive(b.value)) return b.chain(f, T(0.0));
        return b.chain(f, f * std::log(number(a)));
    }
    friend constexpr Dual max(const Dual& a, const Dual& b)
    {
        return a.value < b.value ? b : a;
    }
    friend constexpr Dual min(const Dual& a, const Dual& b)
    {
        return b.value < a.value ? b : a;
    }
    friend constexpr Dual fmax(const Dual& a, const Dual& b)
    {
        return max(a, b);
    }
    friend constexpr Dual fmin(const Dual& a, const Dual& b)
    {
        return min(a, b);
    }

    /// Whether the value and all derivatives are 0.
    [[nodiscard]] constexpr bool all_vanish() const noexcept
    {
        for (const T& d : slope) {
            if (!vanishes(d)) return false;
        }
        return vanishes(value);
    }

private:
    template <class U>
    [[nodiscard]] static constexpr double number(const U& constant) noexcept
    {
        return static_cast<double>(constant);
    }
    /// A dual with the value f, and with `of(d)` for every derivative d of this dual.
    template <class Of>
    [[nodiscard]] constexpr Dual to(const T& f, const Of& of) const
    {
        Dual out;
        out.value = f;
        for (std::size_t i = 0; i < N; ++i) out.slope[i] = of(slope[i]);
        return out;
    }
    template <class Of>
    [[nodiscard]] constexpr Dual with(const Dual& b, const T& f, const Of& of) const
    {
        Dual out;
        out.value = f;
        for (std::size_t i = 0; i < N; ++i) out.slope[i] = of(slope[i], b.slope[i]);
        return out;
    }
    /// f of this dual, with f' = `rate`. A derivative of 0 stays 0 even if the rate is
    /// infinite.
    [[nodiscard]] constexpr Dual chain(const T& f, const T& rate) const
    {
        return to(f, [&](const T& d) { return vanishes(d) ? T(0.0) : rate * d; });
    }
    /// Whether a number is 0 with all its derivatives; false where that is not known.
    [[nodiscard]] static constexpr bool vanishes(const T& number) noexcept
    {
        if constexpr (std::is_arithmetic_v<T>) {
            return number == 0;
        } else if constexpr (requires { number.all_vanish(); }) {
            return number.all_vanish();
        } else {
            return false;
        }
    }
    [[nodiscard]] static constexpr bool is_positive(const T& number) noexcept
    {
        if constexpr (std::is_arithmetic_v<T>) {
            return number > 0;
        } else if constexpr (requires { number.all_vanish(); }) {
            return number > 0;
        } else {
            return false;
        }
    }
};

}  // namespace ricochet
