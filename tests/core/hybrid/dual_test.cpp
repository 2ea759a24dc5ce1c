// Dual numbers, functions that take them, and their uses: rates and degrees of guards.
#include "ricochet/dual.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "problems/grow_decay.hpp"
#include "problems/henon_heiles.hpp"
#include "problems/hidden_pair.hpp"
#include "problems/near_tangent.hpp"
#include "problems/three_body.hpp"
#include "ricochet/detail/dual_derivatives.hpp"
#include "ricochet/detail/features.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/system.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/pendulum.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"

namespace ricochet::dual_test {

namespace {

using X = std::array<double, 2>;

/// Every function of duals, each once.
template <class S>
std::vector<S> functions_of(const S& x, const S& y)
{
    using std::acos, std::asin, std::atan, std::atan2, std::cbrt, std::cos, std::cosh, std::exp,
        std::fabs, std::hypot, std::log, std::max, std::min, std::pow, std::sin, std::sinh,
        std::sqrt, std::tan, std::tanh;
    S sum = x;
    sum += 2;
    sum *= y;
    sum -= x;
    sum /= y;
    return {sum,         x + y,     x - y,       x * y,       x / y,     1 - x,       2 / x,
            x / 2,       -x,        sqrt(x),     cbrt(x),     exp(x),    log(x),      sin(x),
            cos(x),      tan(x),    asin(x),     acos(x),     atan(x),   sinh(x),     cosh(x),
            tanh(x),     fabs(-x),  atan2(x, y), hypot(x, y), pow(x, 3), pow(x, 0.7), pow(x, y),
            pow(2.0, x), max(x, y), min(x, y)};
}

TEST(Dual, PowersWhoseExponentIsADualHaveTheirDerivativesAtZeroAndBelow)
{
    using D = Dual<2>;
    const auto by = [](const D& d) { return d.slope; };
    // The exponent is a number that happens to be a dual, as a parameter of another direction.
    EXPECT_EQ(by(pow(D(0.0, {1, 0}), D(1.5))), (X{0, 0}));
    EXPECT_EQ(by(pow(D(-2.0, {1, 0}), D(2.0))), (X{-4, 0}));
    EXPECT_EQ(by(pow(D(-2.0, {1, 0}), D(0.0)))[1], 0);
    // 0^b = 0 for every b > 0
    EXPECT_EQ(by(pow(D(0.0, {1, 0}), D(2.0, {0, 1}))), (X{0, 0}));
    EXPECT_EQ(by(pow(D(0.0), D(0.5, {0, 1}))), (X{0, 0}));
    EXPECT_EQ(by(pow(0.0, D(2.0, {0, 1}))), (X{0, 0}));
    EXPECT_TRUE(std::isnan(by(pow(D(-2.0, {1, 0}), D(2.0, {0, 1})))[1]));
}

TEST(Dual, WhatDoesNotDependOnADirectionHasNoDerivativeByItEvenAtABranchPoint)
{
    using D = Dual<1>;
    EXPECT_EQ(hypot(D(0.0), D(0.0)).slope[0], 0);
    EXPECT_EQ(atan2(D(0.0), D(0.0)).slope[0], 0);
    EXPECT_EQ(hypot(D(3.0, {1}), 4).slope[0], 0.6);
    EXPECT_EQ(atan2(1.0, D(1.0, {1})).slope[0], -0.5);
    using Nested = Dual<1, D>;
    const Nested zero(D(0.0), {D(0.0)});
    EXPECT_EQ(sqrt(zero).slope[0].slope[0], 0);
    EXPECT_EQ(pow(zero, 0.5).slope[0].slope[0], 0);
}

// The central difference over h = 1e-6 in long double has an error of h^2 / 6 times the third
// derivative, at most 500 here, and of rounding, 1e-19 / 1e-6: together 1e-10.
TEST(Dual, DerivativesAreThoseOfDifferences)
{
    const double x = 0.4, y = 1.3;
    const auto dual = functions_of(Dual<2>(x, {1, 0}), Dual<2>(y, {0, 1}));
    const long double h = 1e-6L;
    const auto at = [&](long double dx, long double dy) {
        return functions_of<long double>(x + dx, y + dy);
    };
    const auto value = at(0, 0);
    const auto ahead = at(h, 0), behind = at(-h, 0), above = at(0, h), below = at(0, -h);
    for (std::size_t k = 0; k < dual.size(); ++k) {
        EXPECT_NEAR(dual[k].value, static_cast<double>(value[k]), 1e-15) << k;
        EXPECT_NEAR(dual[k].slope[0], static_cast<double>((ahead[k] - behind[k]) / (2 * h)), 1e-10)
            << k;
        EXPECT_NEAR(dual[k].slope[1], static_cast<double>((above[k] - below[k]) / (2 * h)), 1e-10)
            << k;
    }
}

// A constant has no derivative, even where the function has none.
TEST(Dual, ARootAtZeroStandsStill)
{
    EXPECT_EQ(sqrt(Dual<1>(0)).slope[0], 0);
    EXPECT_EQ(pow(Dual<1>(0), 2).slope[0], 0);
    EXPECT_EQ(sqrt(Dual<1>(0, {1})).slope[0], std::numeric_limits<double>::infinity());
}

// d2/dx2 of x^3 + sin x.
TEST(Dual, DualsOfDualsHaveSecondDerivatives)
{
    const Dual<1, Dual<1>> x({0.7, {1}}, {Dual<1>(1)});
    const auto y = x * x * x + sin(x);
    EXPECT_NEAR(y.slope[0].slope[0], 6 * 0.7 - std::sin(0.7), 1e-15);
}

// --- which functions take any scalar ---

struct Plain {
    using State = X;
    static constexpr bool resets = false;
    template <class V>
    void flow(double, const V& x, V& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.8 * std::sin(x[0]);
    }
    template <class V>
    [[nodiscard]] double guard(double, const V& x) const
    {
        return x[1];
    }
    template <class V, class D>
    [[nodiscard]] double guard_rate(double, const V&, const D& dxdt) const
    {
        return dxdt[1];
    }
    [[nodiscard]] static constexpr GuardInfo guard_info() { return {.crossing = Crossing::either}; }
};

/// Takes any argument, but is no template over one scalar: it calls functions of doubles.
struct Careless {
    using State = X;
    static constexpr bool resets = false;
    void flow(auto, const auto& x, auto& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.8 * std::sin(x[0]);
    }
    auto guard(auto, const auto& x) const { return std::abs(x[1]) - 0.01; }
    [[nodiscard]] static constexpr GuardInfo guard_info() { return {.crossing = Crossing::either}; }
};

struct OnArrays {
    using State = X;
    template <class S>
    constexpr void flow(const S&, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -9.8 * sin(x[0]);
    }
    template <class S>
    [[nodiscard]] constexpr auto guard(const S& t, const std::array<S, 2>& x) const
    {
        using std::sin;
        return x[1] + 0.0 * sin(t);
    }
    template <class S>
    constexpr void reset(const S& t, std::array<S, 2>& x) const
    {
        x[1] *= -0.9 * t;
    }
    [[nodiscard]] static constexpr GuardInfo guard_info()
    {
        return {.crossing = Crossing::either, .resets = false};
    }
};

/// The same, written for doubles with its rate.
struct PlainOnArrays {
    using State = X;
    OnArrays text;
    void flow(double t, const X& x, X& dxdt) const { text.flow(t, x, dxdt); }
    [[nodiscard]] double guard(double t, const X& x) const { return text.guard(t, x); }
    [[nodiscard]] double guard_rate(double, const X&, const X& dxdt) const { return dxdt[1]; }
    void reset(double t, X& x) const { text.reset(t, x); }
    [[nodiscard]] static constexpr GuardInfo guard_info()
    {
        return {.crossing = Crossing::either, .resets = false};
    }
};

static_assert(!detail::RateByDuals<Plain, X> && !detail::flow_takes_duals<Plain, X>);
static_assert(!detail::RateByDuals<Careless, X> && !detail::flow_takes_duals<Careless, X>);
static_assert(detail::RateByDuals<OnArrays, X> && detail::flow_takes_duals<OnArrays, X>);
static_assert(detail::reset_takes_duals<OnArrays, X>);
static_assert(!detail::RateByDuals<OnArrays, std::vector<double>>);
static_assert(detail::RateByDuals<Pendulum, std::vector<double>>);
static_assert(detail::flow_takes_duals<Pendulum, std::vector<double>>);
static_assert(detail::reset_takes_duals<Thermostat, std::array<double, 1>, std::size_t>);

template <class A, class B>
void expect_same_runs(const A& a, const B& b)
{
    for (const double t_end : {10.0, -10.0}) {
        const Options options{.t_end = t_end};
        const auto one = integrate(a, X{-0.05, 0}, options);
        const auto other = integrate(b, X{-0.05, 0}, options);
        ASSERT_EQ(one.events.size(), other.events.size());
        for (std::size_t k = 0; k < one.events.size(); ++k) {
            EXPECT_EQ(one.events[k].t, other.events[k].t);
            EXPECT_EQ(one.events[k].slope, other.events[k].slope);
        }
        EXPECT_EQ(one.x, other.x);
        EXPECT_EQ(one.statistics.guard_calls, other.statistics.guard_calls);
    }
}

// A guard that returns a component has the rate of the component, to the last bit, and no
// call of the guard is spent on it.
TEST(DualRates, RunsHaveTheBitsOfThoseWithAWrittenRate)
{
    expect_same_runs(Pendulum(), Plain{});
    expect_same_runs(OnArrays{}, PlainOnArrays{});
}

TEST(DualRates, WhatTakesAnythingGoesOnAsItIs)
{
    const auto run = integrate(Careless{}, X{-0.05, 0}, {.t_end = 10});
    EXPECT_GE(run.events.size(), 8u);
}

/// The rate of the guard as written by hand before duals.
template <class System>
double rate_of(const System& system, std::size_t which, Mode mode, const typename System::State& x,
               const typename System::State& dxdt)
{
    return detail::call_rate(system, which, detail::Along{mode, 0.3, x, dxdt});
}

TEST(DualRates, AreThoseOfTheReadySystems)
{
    const X x{0.3, -0.7}, f{-0.7, 1.9};
    EXPECT_EQ(rate_of(BouncingBall(), 0, 0, x, f), f[0]);
    EXPECT_EQ(rate_of(Pendulum(), 0, 0, x, f), f[1]);
    EXPECT_EQ(rate_of(ImpactOscillator(), 0, 0, x, f), -f[0]);
    EXPECT_EQ(rate_of(NearTangent(), 0, 0, x, f), f[0]);
    using Coulomb = CoulombOscillator;
    const Coulomb coulomb({.mass = 1, .stiffness = 3, .friction = 0.3, .static_friction = 0.3});
    EXPECT_EQ(rate_of(coulomb, Coulomb::stop, Coulomb::slip_left, x, f), -f[1]);
    EXPECT_EQ(rate_of(coulomb, Coulomb::stop, Coulomb::slip_right, x, f), f[1]);
    EXPECT_EQ(rate_of(coulomb, Coulomb::pulled_left, Coulomb::stick, x, f), -3 * f[0]);
    EXPECT_EQ(rate_of(coulomb, Coulomb::pulled_right, Coulomb::stick, x, f), 3 * f[0]);
    EXPECT_EQ(rate_of(Thermostat(), Thermostat::too_cold, 0, {20}, {-1.5}), -1.5);
    EXPECT_EQ(rate_of(Thermostat(), Thermostat::too_warm, 1, {20}, {-1.5}), 1.5);
    EXPECT_EQ(rate_of(GrowDecay(), GrowDecay::full, 0, {1.5}, {1.5}), -1.5);
    EXPECT_EQ(rate_of(HenonHeiles(), 0, 0, {1, 2, 3, 4}, {5, 6, 7, 8}), 7);
}

// The rates of three bodies are written; a product is differentiated in another order.
TEST(DualRates, AgreeWithOneThatIsWritten)
{
    const std::array<double, 4> x{1.1, 0.2, -0.3, -1}, f{-0.3, -1, 0.4, 0.6};
    const ThreeBody system;
    EXPECT_NEAR(detail::rate_by_duals(system, 0, detail::Along{Mode{0}, 0.0, x, f}),
                system.guard_rate(0.0, x, f), 1e-15);
}

TEST(DualRates, TheCurvatureOfABallIsItsWeight)
{
    EXPECT_EQ(detail::curvature_of(BouncingBall(), 0.0, X{3, -1}), -9.81);
    // w'' = -(g / l) cos(a) w
    EXPECT_EQ(detail::curvature_of(Pendulum(), 0.0, X{0.3, 0.7}), -9.8 * (std::cos(0.3) * 0.7));
}

// --- degrees ---

template <class System>
int degree_of_guard(const System& system, std::size_t which)
{
    return guard_info_of<typename System::State>(system, which).degree;
}

// Where a system used to declare the degree of its guard, it equals the one found from the code.
TEST(Degree, OfTheReadySystems)
{
    EXPECT_EQ(degree_of_guard(BouncingBall(), 0), 1);
    EXPECT_EQ(degree_of_guard(Pendulum(), 0), 1);
    EXPECT_EQ(degree_of_guard(ImpactOscillator(), 0), 1);
    EXPECT_EQ(degree_of_guard(NearTangent(), 0), 1);
    EXPECT_EQ(degree_of_guard(HenonHeiles(), 0), 1);
    EXPECT_EQ(degree_of_guard(HiddenPair(), 0), 1);
    EXPECT_EQ(degree_of_guard(ThreeBody(), 0), 2);
    for (const std::size_t which : {0u, 1u, 2u}) EXPECT_EQ(degree_of_guard(StickSlip(), which), 1);
    for (const std::size_t which : {0u, 1u}) {
        EXPECT_EQ(degree_of_guard(Thermostat(), which), 1);
        EXPECT_EQ(degree_of_guard(GrowDecay(), which), 1);
    }
}

/// Guard number `which` is a polynomial of degree `degrees[which]`, or none for 0.
struct Polynomials {
    using State = X;
    static constexpr bool resets = false;
    static constexpr std::size_t guard_count = 10;
    static constexpr std::array<int, guard_count> degrees{3, 4, 2, 1, 0, 0, 0, 0, 0, 5};
    template <class S>
    void flow(const S&, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt = x;
    }
    template <class S>
    [[nodiscard]] S guard(std::size_t which, const S& t, const std::array<S, 2>& x) const
    {
        using std::abs, std::pow, std::sin;
        switch (which) {
            case 0: return t * x[0] * x[1] - 1;
            case 1: return pow(x[0], 4) + 2 * t;
            case 2: return (x[0] - 1) * (1 - x[1]) / 3 + sin(0.1);
            case 3: return -x[0];
            case 4: return 1 / x[0];
            case 5: return abs(x[0]);
            case 6: return x[0] > 0 ? x[0] : 2 * x[0];
            case 7: return pow(x[0], 0.5);
            case 8: return sin(t);
            default: return pow(x[0] * x[1], 2) * t;
        }
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.degree = declared ? which == 2 ? 7 : 0 : 0};
    }
    bool declared = false;
};

TEST(Degree, OfPolynomialsAndOthers)
{
    for (std::size_t k = 0; k < Polynomials::guard_count; ++k) {
        EXPECT_EQ(degree_of_guard(Polynomials{}, k), Polynomials::degrees[k]) << k;
    }
}

TEST(Degree, OneThatIsDeclaredHolds)
{
    EXPECT_EQ(degree_of_guard(Polynomials{.declared = true}, 2), 7);
}

}  // namespace

}  // namespace ricochet::dual_test
