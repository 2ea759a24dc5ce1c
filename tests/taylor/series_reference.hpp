// Truncated power series in long double, by formulas different from those under test.
//
// Functions are composed: with a = a0 + d, where d has no constant term, f(a) is the finite sum of
// f^(j)(a0) d^j / j!. Inverse functions are integrals of their derivatives.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

namespace ricochet {

template <int order>
class SeriesReference {
    using Number = long double;

public:
    SeriesReference() = default;
    template <class T>
    requires std::is_arithmetic_v<T> SeriesReference(T value)  // NOLINT
    {
        c_[0] = value;
    }

    [[nodiscard]] Number& operator[](int k) { return c_[static_cast<std::size_t>(k)]; }
    [[nodiscard]] Number operator[](int k) const { return c_[static_cast<std::size_t>(k)]; }

    friend SeriesReference operator+(SeriesReference a, const SeriesReference& b)
    {
        for (int k = 0; k <= order; ++k) a[k] += b[k];
        return a;
    }
    friend SeriesReference operator-(SeriesReference a, const SeriesReference& b)
    {
        for (int k = 0; k <= order; ++k) a[k] -= b[k];
        return a;
    }
    friend SeriesReference operator-(const SeriesReference& a) { return SeriesReference(0) - a; }
    friend SeriesReference operator*(const SeriesReference& a, const SeriesReference& b)
    {
        SeriesReference out;
        for (int i = 0; i <= order; ++i) {
            for (int j = 0; i + j <= order; ++j) out[i + j] += a[i] * b[j];
        }
        return out;
    }
    friend SeriesReference operator/(const SeriesReference& a, const SeriesReference& b)
    {
        return a * b.power(-1);
    }

    friend SeriesReference pow(const SeriesReference& a, double b) { return a.power(b); }
    friend SeriesReference sqrt(const SeriesReference& a) { return a.power(0.5L); }
    friend SeriesReference cbrt(const SeriesReference& a) { return a.power(1.0L / 3); }
    friend SeriesReference exp(const SeriesReference& a)
    {
        const Number e = std::exp(a[0]);
        return a.composed([&](int) { return e; });
    }
    friend SeriesReference log(const SeriesReference& a)
    {
        return a.integral(std::log(a[0]), 1 / a);
    }
    friend SeriesReference sin(const SeriesReference& a)
    {
        const std::array<Number, 2> of{std::sin(a[0]), std::cos(a[0])};
        return a.composed([&](int j) { return (j % 4 < 2 ? 1 : -1) * of[j % 2 == 0 ? 0 : 1]; });
    }
    friend SeriesReference cos(const SeriesReference& a)
    {
        const std::array<Number, 2> of{std::cos(a[0]), std::sin(a[0])};
        return a.composed(
            [&](int j) { return (j % 4 == 0 || j % 4 == 3 ? 1 : -1) * of[j % 2 == 0 ? 0 : 1]; });
    }
    friend SeriesReference tan(const SeriesReference& a) { return sin(a) / cos(a); }
    friend SeriesReference sinh(const SeriesReference& a) { return (exp(a) - exp(-a)) / 2; }
    friend SeriesReference cosh(const SeriesReference& a) { return (exp(a) + exp(-a)) / 2; }
    friend SeriesReference tanh(const SeriesReference& a) { return sinh(a) / cosh(a); }
    friend SeriesReference asin(const SeriesReference& a)
    {
        return a.integral(std::asin(a[0]), (1 - a * a).power(-0.5L));
    }
    friend SeriesReference acos(const SeriesReference& a)
    {
        return a.integral(std::acos(a[0]), -(1 - a * a).power(-0.5L));
    }
    friend SeriesReference atan(const SeriesReference& a)
    {
        return a.integral(std::atan(a[0]), 1 / (1 + a * a));
    }
    friend SeriesReference atan2(const SeriesReference& y, const SeriesReference& x)
    {
        // Turned to where the angle is small: the series of the quotient there, plus the turn.
        const Number angle = std::atan2(y[0], x[0]), c = std::cos(angle), s = std::sin(angle);
        SeriesReference out = atan((SeriesReference(c) * y - SeriesReference(s) * x) /
                                   (SeriesReference(c) * x + SeriesReference(s) * y));
        out[0] = angle;
        return out;
    }
    friend SeriesReference hypot(const SeriesReference& a, const SeriesReference& b)
    {
        return sqrt(a * a + b * b);
    }

private:
    /// sum of derivative(j) d^j / j!
    template <class Derivative>
    [[nodiscard]] SeriesReference composed(const Derivative& derivative) const
    {
        SeriesReference d = *this, term = 1, out;
        d[0] = 0;
        for (int j = 0; j <= order; ++j) {
            out = out + SeriesReference(derivative(j)) * term;
            term = term * d * SeriesReference(Number{1} / (j + 1));
        }
        return out;
    }
    [[nodiscard]] SeriesReference power(Number exponent) const
    {
        return composed([&](int j) {
            Number derivative = std::pow(c_[0], exponent);
            for (int i = 0; i < j; ++i) derivative *= (exponent - i) / c_[0];
            return derivative;
        });
    }
    /// The integral of `slope` a', from `start`.
    [[nodiscard]] SeriesReference integral(Number start, const SeriesReference& slope) const
    {
        SeriesReference derivative, out;
        for (int k = 1; k <= order; ++k) derivative[k - 1] = k * (*this)[k];
        derivative = slope * derivative;
        out[0] = start;
        for (int k = 1; k <= order; ++k) out[k] = derivative[k - 1] / k;
        return out;
    }

    std::array<Number, order + 1> c_{};
};

/// The coefficients of the motion from (t, x).
template <int order, class System, std::size_t n>
[[nodiscard]] std::array<SeriesReference<order>, n> reference_series(const System& system, double t,
                                                                     const std::array<double, n>& x)
{
    using Series = SeriesReference<order>;
    std::array<Series, n> out, rate;
    for (std::size_t i = 0; i < n; ++i) out[i] = x[i];
    Series time = t;
    time[1] = 1;
    for (int k = 0; k < order; ++k) {
        system.flow(time, out, rate);
        for (std::size_t i = 0; i < n; ++i) out[i][k + 1] = rate[i][k] / (k + 1);
    }
    return out;
}

}  // namespace ricochet
