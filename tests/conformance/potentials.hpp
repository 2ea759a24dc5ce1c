// Conformance suite of pairs of potentials of friction.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>

#include "ricochet/faults/friction.hpp"

namespace ricochet::test {

/// A pair behind functions.
struct AnyPair {
    std::function<RateStateJet(double v, double xi)> rate_potential{};
    std::function<ScalarJet(double d, double xi)> dual{}, primal{};
    std::function<FrictionAndRate(double v, double xi)> evaluate{};  ///< by (5) and (9)
    PotentialKind kind = PotentialKind::quadratic;
};

template <PotentialPair Pair>
[[nodiscard]] AnyPair any_pair(const Pair& pair)
{
    return {.rate_potential = [=](double v, double xi) { return pair.rate_potential(v, xi); },
            .dual = [=](double d, double xi) { return pair.dual(d, xi); },
            .primal = [=](double rate, double xi) { return pair.primal(rate, xi); },
            .evaluate = [=](double v, double xi) { return ricochet::evaluate(pair, v, xi); },
            .kind = Pair::kind};
}

/// A pair with the law that it represents, the domain of the tests, and its promises.
struct PairCase {
    std::string name;
    /// With lengths multiplied by a power of two; without another unit if it has quadratures.
    std::function<AnyPair(double unit)> make;
    std::function<FrictionAndRate(double v, double xi)> law;
    std::function<FrictionAndRateGradient(double v, double xi)> gradient{};  ///< its gradient; may
                                                                             ///< be absent
    DirectEffect effect = DirectEffect::log;
    double v_least = 1e-10, v_most = 1e-2;  ///< [m/s]
    double xi_least = -4, xi_most = 12;
    double xi_unit = 1;  ///< over which the state matters
    bool scales = true;
    /// Whether the dual is convex in d there.
    std::function<bool(double d, double xi)> convex = [](double, double) { return true; };
    /// Largest relative error of all identities against formulas in 113 bits; may be absent.
    std::function<double()> worst_identity{};
    double identity_tolerance = 0;
    double tolerance = 1e-9;         ///< of first derivatives against differences
    double second_tolerance = 1e-9;  ///< of second ones
    double dual_rounding = 0;        ///< of the terms of D* that cancel near d = 0
    bool refuses_rest = true;        ///< without the asinh form: V <= 0
};

inline void PrintTo(const PairCase& pair, std::ostream* out)
{
    *out << pair.name;
}

class PotentialSuite : public testing::TestWithParam<PairCase> {
protected:
    /// Calls check(v, xi), with both signs of v where the law has them.
    template <class Check>
    void for_points(Check&& check, int points = 300)
    {
        for (int i = 0; i < points && !HasFailure(); ++i) {
            SCOPED_TRACE("point " + std::to_string(i));
            const double v = slip_rate();
            check(odd() && i % 3 == 0 ? -v : v, state());
        }
    }

    [[nodiscard]] bool odd() const { return GetParam().effect == DirectEffect::asinh; }

    /// A slip rate from half the least to twice the largest, uniform in the logarithm.
    [[nodiscard]] double slip_rate()
    {
        std::uniform_real_distribution log_v(std::log(GetParam().v_least),
                                             std::log(GetParam().v_most));
        return std::exp(log_v(random_));
    }

    [[nodiscard]] double state()
    {
        return std::uniform_real_distribution(GetParam().xi_least, GetParam().xi_most)(random_);
    }

    /// -dDdag/dxi at a slip rate.
    [[nodiscard]] double drive(double v, double xi) const
    {
        return -pair_.rate_potential(v, xi).xi;
    }

    /// Five-point difference of f at x; with steps of 1/1000 of the scale of f its error is 1e-12.
    template <class Function>
    [[nodiscard]] static double difference(const Function& f, double x, double h)
    {
        return (f(x - 2 * h) - 8 * f(x - h) + 8 * f(x + h) - f(x + 2 * h)) / (12 * h);
    }

    const AnyPair pair_ = GetParam().make(1);

private:
    std::mt19937_64 random_{9};
};

TEST_P(PotentialSuite, ThePairGivesTheLaw)
{
    for_points([&](double v, double xi) {
        const FrictionAndRate found = pair_.evaluate(v, xi);
        const FrictionAndRate law = GetParam().law(v, xi);
        EXPECT_NEAR(found.friction, law.friction, 1e-13 * (1 + std::abs(law.friction)));
        // Relative to healing and wear, which cancel near steady sliding: the rates of a contact
        // at rest and of one that slides twice as fast.
        const double size = std::abs(GetParam().law(GetParam().v_least, xi).rate) +
                            std::abs(GetParam().law(2 * v, xi).rate) + std::abs(law.rate);
        EXPECT_NEAR(found.rate, law.rate, 1e-11 * size) << v << ' ' << xi;
    });
}

TEST_P(PotentialSuite, TheIdentitiesHoldToRounding)
{
    if (!GetParam().worst_identity) return;  // no formulas of its own
    EXPECT_LE(GetParam().worst_identity(), GetParam().identity_tolerance);
}

TEST_P(PotentialSuite, TheDerivativesOfDdagAreThoseOfDifferences)
{
    const double e = GetParam().tolerance;
    const double e2 = GetParam().second_tolerance;
    for_points([&](double v, double xi) {
        const double unit = GetParam().xi_unit;
        const double dv = 1e-3 * v, dxi = 1e-3 * unit;
        const RateStateJet j = pair_.rate_potential(v, xi);
        const auto at = [&](double a, double b) { return pair_.rate_potential(a, b); };
        const double size = std::max({std::abs(j.value), std::abs(j.v * v), std::abs(j.xi) * unit});
        EXPECT_NEAR(difference([&](double x) { return at(x, xi).value; }, v, dv) * v, j.v * v,
                    e * size);
        EXPECT_NEAR(difference([&](double x) { return at(v, x).value; }, xi, dxi) * unit,
                    j.xi * unit, e * size);
        const double of_v = std::max(std::abs(j.v), std::abs(j.vv * v));
        EXPECT_NEAR(difference([&](double x) { return at(x, xi).v; }, v, dv) * v, j.vv * v,
                    e2 * of_v);
        EXPECT_NEAR(difference([&](double x) { return at(v, x).v; }, xi, dxi) * unit, j.vxi * unit,
                    e2 * std::max(of_v, std::abs(j.vxi) * unit));
        const double of_xi =
            std::max({std::abs(j.xi), std::abs(j.xixi) * unit, std::abs(j.vxi * v)});
        EXPECT_NEAR(difference([&](double x) { return at(x, xi).xi; }, v, dv) * v, j.vxi * v,
                    e2 * of_xi);
        EXPECT_NEAR(difference([&](double x) { return at(v, x).xi; }, xi, dxi) * unit,
                    j.xixi * unit, e2 * of_xi);
    });
}

TEST_P(PotentialSuite, TheDerivativesOfTheDualAreThoseOfDifferences)
{
    const double e = GetParam().tolerance;
    for_points([&](double v, double xi) {
        const double d = drive(v, xi);
        const double h = 1e-3 * std::abs(d);
        const ScalarJet j = pair_.dual(d, xi);
        const auto at = [&](double x) { return pair_.dual(x, xi); };
        EXPECT_NEAR(
            difference([&](double x) { return at(x).value; }, d, h) * d, j.first * d,
            e * std::max(std::abs(j.value), std::abs(j.first * d)) + GetParam().dual_rounding);
        EXPECT_NEAR(difference([&](double x) { return at(x).first; }, d, h) * d, j.second * d,
                    e * std::max(std::abs(j.first), std::abs(j.second * d)));
    });
}

TEST_P(PotentialSuite, TheGradientOfTheLawIsThatOfDifferences)
{
    if (!GetParam().gradient) return;  // a law without one
    for_points([&](double v, double xi) {
        const double unit = GetParam().xi_unit;
        const double dv = 1e-3 * v, dxi = 1e-3 * unit;
        const FrictionAndRateGradient g = GetParam().gradient(v, xi);
        const FrictionAndRate here = GetParam().law(v, xi);
        const auto law = GetParam().law;
        EXPECT_NEAR(g.friction, here.friction, 1e-14 * (1 + std::abs(here.friction)));
        EXPECT_NEAR(g.rate, here.rate,
                    1e-12 * std::max(std::abs(here.rate), std::abs(g.rate_v * v)));
        const double f = std::abs(g.friction) + std::abs(g.friction_v * v);
        EXPECT_NEAR(difference([&](double x) { return law(x, xi).friction; }, v, dv) * v,
                    g.friction_v * v, 1e-9 * f);
        EXPECT_NEAR(difference([&](double x) { return law(v, x).friction; }, xi, dxi),
                    g.friction_xi, 1e-9 * (f + std::abs(g.friction_xi)));
        const double r = std::abs(g.rate) + std::abs(g.rate_v * v) + std::abs(g.rate_xi) * unit;
        EXPECT_NEAR(difference([&](double x) { return law(x, xi).rate; }, v, dv) * v, g.rate_v * v,
                    1e-9 * r);
        EXPECT_NEAR(difference([&](double x) { return law(v, x).rate; }, xi, dxi) * unit,
                    g.rate_xi * unit, 1e-9 * r);
    });
}

TEST_P(PotentialSuite, DdagIsConvexInTheSlipRateAndInTheState)
{
    for_points([&](double v, double xi) {
        const RateStateJet j = pair_.rate_potential(v, xi);
        EXPECT_GT(j.vv, 0);
        EXPECT_GE(j.xixi, 0);
        // The same is checked by values alone.
        const auto value = [&](double a, double b) { return pair_.rate_potential(a, b).value; };
        const double other_v = odd() ? -2 * v : 3 * v;
        const double other_xi = state();
        const double by_v = (value(v, xi) + value(other_v, xi)) / 2;
        const double by_xi = (value(v, xi) + value(v, other_xi)) / 2;
        const double size =
            std::abs(value(v, xi)) + std::abs(value(other_v, xi)) + std::abs(value(v, other_xi));
        EXPECT_LE(value((v + other_v) / 2, xi), by_v + 1e-12 * size);
        EXPECT_LE(value(v, (xi + other_xi) / 2), by_xi + 1e-12 * size);
    });
}

TEST_P(PotentialSuite, TheDualIsConvexWhereItIsPromisedAndNowhereElse)
{
    for_points(
        [&](double v, double xi) {
            const double d = drive(v, xi);
            EXPECT_EQ(pair_.dual(d, xi).second > 0, GetParam().convex(d, xi)) << d << ' ' << xi;
        },
        2000);
}

TEST_P(PotentialSuite, FenchelYoungHoldsWithEqualityAlongTheLaw)
{
    // D(r) + D*(d) >= r d for every rate r and force d, with equality where r = D*'(d).
    int compared = 0;
    for_points([&](double v, double xi) {
        const double d = drive(v, xi);
        const ScalarJet dual = pair_.dual(d, xi);
        // Where D* is nearly flat, a rounding of the rate moves d by much more.
        if (!(dual.second * std::abs(d) > 0.1 * std::abs(dual.first))) return;
        ++compared;
        const double rate = dual.first;
        const ScalarJet primal = pair_.primal(rate, xi);
        const auto rounding = [](double a, double b, double c) {
            return 1e-12 * (std::abs(a) + std::abs(b) + std::abs(c)) + GetParam().dual_rounding;
        };
        EXPECT_NEAR(primal.value + dual.value, rate * d,
                    rounding(primal.value, dual.value, rate * d));
        EXPECT_NEAR(primal.first, d, 1e-11 * std::abs(d));
        EXPECT_NEAR(primal.second * dual.second, 1, 1e-9);
        for (int k = 0; k < 5; ++k) {
            const double other = drive(slip_rate(), xi);
            const ScalarJet there = pair_.dual(other, xi);
            if (!(there.second > 0)) continue;  // D is the transform of the convex range alone
            EXPECT_GE(primal.value + there.value,
                      rate * other - rounding(primal.value, there.value, rate * other))
                << d << ' ' << other;
        }
    });
    EXPECT_GT(compared, 50);
}

TEST_P(PotentialSuite, ThePrimalBalancesDdag)
{
    // (6): D'(xi') + dDdag/dxi = 0 at the rate of the law.
    for_points([&](double v, double xi) {
        const RateStateJet j = pair_.rate_potential(v, xi);
        const ScalarJet dual = pair_.dual(-j.xi, xi);
        if (!(dual.second * std::abs(j.xi) > 0.1 * std::abs(dual.first))) return;
        const double rate = GetParam().law(v, xi).rate;
        const double slope = pair_.primal(rate, xi).first;
        const double sides = std::abs(j.xi) + std::abs(j.xixi) * GetParam().xi_unit;
        EXPECT_NEAR(slope + j.xi, 0, 1e-10 * sides);
    });
}

TEST_P(PotentialSuite, SlidingAndAgeingDissipate)
{
    for_points([&](double v, double xi) {
        if (odd()) {
            EXPECT_GE(v * pair_.rate_potential(v, xi).v, 0);
        }
        // Potentials of the state's rate alone rest at zero, and d xi' = D + D*.
        if (pair_.kind != PotentialKind::quadratic) return;
        EXPECT_EQ(pair_.dual(0, xi).value, 0);
        EXPECT_EQ(pair_.dual(0, xi).first, 0);
        const double d = drive(v, xi);
        const ScalarJet dual = pair_.dual(d, xi);
        EXPECT_GE(dual.value, -GetParam().dual_rounding);
        EXPECT_GE(d * dual.first, 0);
        EXPECT_GE(pair_.primal(dual.first, xi).value, -GetParam().dual_rounding);
    });
}

TEST_P(PotentialSuite, WithTheAsinhFormFrictionIsOddInTheSlipRate)
{
    if (!odd()) return;
    for_points([&](double v, double xi) {
        const RateStateJet there = pair_.rate_potential(v, xi);
        const RateStateJet back = pair_.rate_potential(-v, xi);
        EXPECT_EQ(back.value, there.value);
        EXPECT_EQ(back.v, -there.v);
        EXPECT_EQ(back.xi, there.xi);
        EXPECT_EQ(back.vv, there.vv);
        EXPECT_EQ(back.vxi, -there.vxi);
        EXPECT_EQ(back.xixi, there.xixi);
        EXPECT_EQ(pair_.rate_potential(0, xi).v, 0);
    });
}

TEST_P(PotentialSuite, AnotherUnitOfLengthChangesNoBit)
{
    if (!GetParam().scales) return;
    for (const double unit : {0x1p-20, 0x1p20}) {
        const AnyPair other = GetParam().make(unit);
        for_points([&](double v, double xi) {
            const RateStateJet here = pair_.rate_potential(v, xi);
            const RateStateJet there = other.rate_potential(v * unit, xi);
            EXPECT_EQ(there.value, here.value * unit);
            EXPECT_EQ(there.v, here.v);
            EXPECT_EQ(there.xi, here.xi * unit);
            EXPECT_EQ(there.vv, here.vv / unit);
            EXPECT_EQ(there.vxi, here.vxi);
            EXPECT_EQ(there.xixi, here.xixi * unit);
            EXPECT_EQ(other.dual(-there.xi, xi).first, pair_.dual(-here.xi, xi).first);
        });
    }
}

/// Whether a call is refused, or returns NaN.
template <class Call>
[[nodiscard]] bool refuses(const Call& call)
{
    try {
        return std::isnan(call());
    } catch (const std::invalid_argument&) {
        return true;
    }
}

TEST_P(PotentialSuite, WhatIsNoNumberOrHasNoFrictionIsRefused)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double xi = (GetParam().xi_least + GetParam().xi_most) / 2;
    const double v = GetParam().v_most / 2;
    EXPECT_TRUE(refuses([&] { return pair_.rate_potential(nan, xi).v; }));
    EXPECT_TRUE(refuses([&] { return pair_.rate_potential(v, nan).v; }));
    EXPECT_TRUE(refuses([&] { return pair_.rate_potential(v, nan).value; }));
    EXPECT_TRUE(refuses([&] { return pair_.dual(nan, xi).first; }));
    EXPECT_TRUE(refuses([&] { return pair_.primal(nan, xi).first; }));
    if (!odd() && GetParam().refuses_rest) {
        EXPECT_THROW((void)pair_.rate_potential(0, xi), std::invalid_argument);
        EXPECT_THROW((void)pair_.rate_potential(-v, xi), std::invalid_argument);
    }
    if (pair_.kind != PotentialKind::quadratic) {
        // No slip rate gives this sign of the force, and none heals the state this fast.
        EXPECT_THROW((void)pair_.dual(1, xi), std::invalid_argument);
        EXPECT_THROW((void)pair_.primal(1e300, xi), std::invalid_argument);
    }
}

}  // namespace ricochet::test
