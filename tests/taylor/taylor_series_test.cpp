#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "ricochet/taylor/detail/lazy_tape.hpp"
#include "ricochet/taylor/detail/taylor_series.hpp"
#include "taylor/series_reference.hpp"

namespace ricochet::taylor_series_test {
namespace {

using detail::read_constants;
using detail::TapeMatch;
using detail::taylor_tape;
using detail::TaylorSeries;
using Two = std::array<double, 2>;

constexpr int order = 20;

/// Coefficients from the tape, [k][i].
template <bool unrolled, class System, std::size_t n>
[[nodiscard]] std::array<std::array<double, n>, order + 1> series_of(const System& system, double t,
                                                                     const std::array<double, n>& x)
{
    static constexpr const auto& tape = taylor_tape<System, n, 0>;
    std::array<double, tape.ops.size()> constants{};
    const TapeMatch match = read_constants<System, n, 0>(system, constants);
    EXPECT_EQ(match, TapeMatch::fits);
    std::array<std::array<double, n>, order + 1> out{};
    TaylorSeries<tape, order, unrolled>::compute(constants.data(), t, x.data(),
                                                 {order, out[0].data(), nullptr});
    return out;
}

/// The same from operations that are recorded at run time, of which there may be so many.
template <class System, std::size_t n>
[[nodiscard]] std::array<std::array<double, n>, order + 1> lazy_series_of(
    const System& system, double t, const std::array<double, n>& x,
    std::size_t most = std::numeric_limits<std::size_t>::max())
{
    detail::Recording recording;
    std::vector<int> outputs(n);
    record_into(system, 0, recording, std::array<detail::Recorded, n>{}, outputs);
    detail::LazyTape tape(n, recording, outputs);
    EXPECT_LE(tape.operations(), most);
    std::array<std::array<double, n>, order + 1> out{};
    EXPECT_EQ(tape.compute(t, x.data(), {order, out[0].data(), nullptr}), order);
    return out;
}

/// Each coefficient is a sum of some k products of earlier ones, so that errors may grow a little
/// with k; 2e-14 of the largest coefficient of its order, or of its value for a unit radius of
/// convergence, is 100 roundings.
template <class System, std::size_t n>
void expect_reference_series(const System& system, double t, const std::array<double, n>& x)
{
    const auto expected = reference_series<order>(system, t, x);
    const auto unrolled = series_of<true>(system, t, x);
    const auto looped = series_of<false>(system, t, x);
    const auto lazy = lazy_series_of(system, t, x, taylor_tape<System, n, 0>.ops.size() - n - 1);
    for (int k = 0; k <= order; ++k) {
        const auto row = static_cast<std::size_t>(k);
        double largest = 0;
        for (std::size_t i = 0; i < n; ++i) {
            largest = std::max(largest, std::fabs(static_cast<double>(expected[i][k])));
        }
        for (std::size_t i = 0; i < n; ++i) {
            const auto c = static_cast<double>(expected[i][k]);
            EXPECT_NEAR(unrolled[row][i], c, 2e-14 * largest) << "k = " << k << ", i = " << i;
            EXPECT_NEAR(looped[row][i], c, 2e-14 * largest) << "k = " << k << ", i = " << i;
            EXPECT_NEAR(lazy[row][i], c, 2e-14 * largest) << "k = " << k << ", i = " << i;
        }
    }
}

struct Trigonometric {
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cos, std::sin, std::tan;
        dxdt[0] = sin(x[0] * t) + cos(x[1]);
        dxdt[1] = tan(0.3 * x[1]) - cos(0.8 * t) * x[0];
    }
};

struct Exponential {
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::exp, std::log, std::sinh, std::cosh, std::tanh;
        dxdt[0] = exp(-x[1] * x[1]) + sinh(0.5 * x[0]) - cosh(0.4 * x[1]);
        dxdt[1] = log(3.0 + x[0] * x[0]) + tanh(x[1]) / (1.0 + t * t);
    }
};

struct Algebraic {
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cbrt, std::hypot, std::pow, std::sqrt;
        dxdt[0] = sqrt(1.5 + x[1] * x[1]) - cbrt(2.0 + x[0]) + pow(1.2 + x[0] * x[0], 1.7);
        dxdt[1] = 1.0 / (2.0 + x[1] * x[1]) - x[0] / hypot(x[0], 1.0 + x[1]) + pow(x[1], 3) / 7 -
                  pow(2 + x[0], -2) + pow(3.0 + x[1], 0.5) - (x[0] - 0.25);
    }
};

struct Inverse {
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::acos, std::asin, std::atan;
        dxdt[0] = asin(0.3 * x[0]) - acos(0.2 * x[1]);
        dxdt[1] = atan(x[0]) * x[1];
    }
};

/// Angles in all quadrants, of two series, of a series and a number.
struct Angles {
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::atan2, std::sin;
        dxdt[0] = atan2(x[1], x[0]) - 0.5 * atan2(sin(t), -1.5);
        dxdt[1] = x[0] - 0.3 * atan2(2.0, x[1]) + atan2(1.0 + x[0] * x[0], t);
    }
};

TEST(TaylorSeries, AnglesAgreeInEveryQuadrant)
{
    expect_reference_series(Angles{}, 0.7, Two{0.4, -1.1});
    expect_reference_series(Angles{}, 0.7, Two{-0.4, -1.1});
    expect_reference_series(Angles{}, -0.7, Two{-1.4, 0.3});
    expect_reference_series(Angles{}, 0.7, Two{1.2, 0.9});
    expect_reference_series(Angles{}, 0.2, Two{0, 1.5});  // no quotient there
}

TEST(TaylorSeries, CoefficientsOfEveryFunctionAgreeWithComposedSeriesInLongDouble)
{
    expect_reference_series(Trigonometric{}, 0.7, Two{0.4, -1.1});
    expect_reference_series(Exponential{}, 0.3, Two{0.6, 0.2});
    expect_reference_series(Algebraic{}, 0, Two{0.5, 0.8});
    expect_reference_series(Inverse{}, 0, Two{0.5, 1.3});
}

/// The same flow for each pair of components.
template <class Flow, std::size_t pairs>
struct Repeated {
    template <class S>
    void flow(const S& t, const std::array<S, 2 * pairs>& x, std::array<S, 2 * pairs>& dxdt) const
    {
        for (std::size_t p = 0; p < pairs; ++p) {
            const std::array<S, 2> own{x[2 * p], x[2 * p + 1]};
            std::array<S, 2> rate{};
            Flow{}.flow(t, own, rate);
            dxdt[2 * p] = rate[0];
            dxdt[2 * p + 1] = rate[1];
        }
    }
};

template <class Flow, std::size_t pairs>
void expect_bits_side_by_side()
{
    std::array<double, 2 * pairs> x{};
    for (std::size_t p = 0; p < pairs; ++p) {
        x[2 * p] = 0.4 + 0.05 * static_cast<double>(p);
        x[2 * p + 1] = 1.3 - 0.07 * static_cast<double>(p);
    }
    const auto together = lazy_series_of(Repeated<Flow, pairs>{}, 0.3, x);
    for (std::size_t p = 0; p < pairs; ++p) {
        const auto alone = lazy_series_of(Repeated<Flow, 1>{}, 0.3, Two{x[2 * p], x[2 * p + 1]});
        for (std::size_t k = 0; k <= order; ++k) {
            EXPECT_EQ(together[k][2 * p], alone[k][0]) << pairs << " pairs, " << p << ", k = " << k;
            EXPECT_EQ(together[k][2 * p + 1], alone[k][1]) << pairs << ", " << p << ", k = " << k;
        }
    }
}

template <class Flow>
void expect_bits_in_any_number()
{
    expect_bits_side_by_side<Flow, 2>();
    expect_bits_side_by_side<Flow, 3>();
    expect_bits_side_by_side<Flow, 5>();
    expect_bits_side_by_side<Flow, 8>();
    expect_bits_side_by_side<Flow, 13>();
}

TEST(TaylorSeries, RecordedOperationsHaveTheSameBitsSideBySide)
{
    expect_bits_in_any_number<Trigonometric>();
    expect_bits_in_any_number<Exponential>();
    expect_bits_in_any_number<Algebraic>();
    expect_bits_in_any_number<Inverse>();
    expect_bits_in_any_number<Angles>();
}

/// Sums of sums, of multiples and of opposites, some of which are used twice. With further
/// components, whose rates they are, all of them are.
template <std::size_t n>
struct Combined {
    template <class S>
    constexpr void flow(const S& t, const std::array<S, n>& x, std::array<S, n>& dxdt) const
    {
        const S product = x[0] * x[1];
        const S shared = 0.3 * product;
        const S inner = x[1] + (product - 0.1 * x[0]);
        const S part = 2.5 * product;
        const S first = 0.0 * x[1] - part;
        const S second = first + shared;
        const S opposite = -(0.7 * x[1]);
        const S third = inner / 3.0 + opposite;
        const S square = x[0] * x[0] + x[1];
        const S fourth = inner - square;
        const S fifth = fourth - (-x[1]);
        const S many = shared - 0.2 * (x[0] - x[1]) + (1.0 - shared) + 1.1 * t - 0.4 * product - t;
        dxdt[0] = second + third;
        dxdt[1] = fifth + many;
        const std::array<S, 9> parts{part,  first,  second, opposite, third,
                                     inner, square, fourth, fifth};
        for (std::size_t i = 2; i < n; ++i) dxdt[i] = parts[i - 2];
    }
};

TEST(TaylorSeries, RecordedSumsHaveTheBitsOfTheirOperationsOneByOne)
{
    std::array<double, 11> x{0.4, -1.3};
    const auto one_by_one = lazy_series_of(Combined<11>{}, 0.3, x);
    const auto combined = lazy_series_of(Combined<2>{}, 0.3, Two{x[0], x[1]});
    for (std::size_t k = 0; k <= order; ++k) {
        EXPECT_EQ(combined[k][0], one_by_one[k][0]) << k;
        EXPECT_EQ(combined[k][1], one_by_one[k][1]) << k;
    }
    expect_bits_in_any_number<Combined<2>>();
    expect_reference_series(Combined<2>{}, 0.3, Two{x[0], x[1]});
}

struct Oscillator {
    double stiffness = 1;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -stiffness * x[0];
    }
};

TEST(TaylorSeries, CoefficientsOfAnOscillatorAreThoseOfCosine)
{
    // x = cos(2 t): coefficient 2 m is (-4)^m / (2 m)!, each rounded some k times.
    const auto c = series_of<true>(Oscillator{4}, 0, Two{1, 0});
    double expected = 1;
    for (std::size_t m = 0; 2 * m <= order; ++m) {
        EXPECT_NEAR(c[2 * m][0], expected, 1e-14 * std::fabs(expected));
        if (2 * m < order) {
            EXPECT_EQ(c[2 * m + 1][0], 0);
        }
        expected *= -4 / ((2.0 * static_cast<double>(m) + 1) * (2.0 * static_cast<double>(m) + 2));
    }
}

struct Falling {
    double gravity = 9.81;
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1] + 0.5 * t * t;
        dxdt[1] = -gravity;
    }
};

TEST(TaylorSeries, DegreesInTimeAreFoundWhereTheMotionIsAPolynomial)
{
    // The velocity is linear, the height the integral of that and of t^2.
    constexpr const auto& falling = taylor_tape<Falling, 2, 0>;
    EXPECT_EQ(falling.degree[0], 3);
    EXPECT_EQ(falling.degree[1], 1);
    constexpr const auto& other = taylor_tape<Oscillator, 2, 0>;
    EXPECT_EQ(other.degree[0], detail::no_degree);
}

/// The same constant twice, equal constants in two members, and the same operations twice.
struct Constants {
    double a = 1, b = 1;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = a * x[0] + a * x[0] * x[1];
        dxdt[1] = b * x[0] - x[1] * x[0] * 2;
    }
};

TEST(TaylorSeries, MembersThatAreEqualByDefaultKeepTheirOwnValues)
{
    const auto c = series_of<true>(Constants{3, 5}, 0, Two{2, 0.5});
    EXPECT_EQ(c[1][0], 3 * 2.0 + 3 * 2 * 0.5);
    EXPECT_EQ(c[1][1], 5 * 2.0 - 0.5 * 2 * 2);
    // a x0 is computed once, b x0 is another product.
    constexpr const auto& tape = taylor_tape<Constants, 2, 0>;
    int products_with_constants = 0;
    for (const detail::TapeOp& op : tape.ops) {
        products_with_constants += op.op == detail::TaylorOp::times_constant;
    }
    EXPECT_EQ(products_with_constants, 3);
}

struct Branching {
    double damping = 0;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
        if (damping != 0) dxdt[1] -= damping * x[1];
    }
};
struct Powered {
    double exponent = 1.5;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::pow;
        dxdt[0] = pow(x[1], exponent);
        dxdt[1] = x[0] / 2;
    }
};

TEST(TaylorSeries, OperationsThatDependOnAParameterAreSeenWhenTheObjectIsRead)
{
    std::array<double, 32> constants{};
    EXPECT_EQ((read_constants<Branching, 2, 0>(Branching{}, constants)), TapeMatch::fits);
    EXPECT_EQ((read_constants<Branching, 2, 0>(Branching{0.1}, constants)), TapeMatch::differs);
    EXPECT_EQ((read_constants<Powered, 2, 0>(Powered{1.5}, constants)), TapeMatch::fits);
    EXPECT_EQ((read_constants<Powered, 2, 0>(Powered{2.5}, constants)), TapeMatch::differs);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ((read_constants<Oscillator, 2, 0>(Oscillator{nan}, constants)),
              TapeMatch::not_finite);
}

}  // namespace
}  // namespace ricochet::taylor_series_test
