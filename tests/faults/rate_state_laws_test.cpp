// Rate-and-state friction: laws, exact potentials, the Wright omega function.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

#include "rate_state_identities.hpp"
#include "refusal.hpp"
#include "ricochet/faults/affine_law.hpp"
#include "ricochet/faults/detail/wright_omega.hpp"

namespace ricochet::rate_state_laws_test {
namespace {

using test::Quad;

void expect_says(const std::string& sentence, const std::string& piece)
{
    EXPECT_NE(sentence.find(piece), std::string::npos) << "no '" << piece << "' in: " << sentence;
}

TEST(RateStatePotentials, AgeingPairIsConvexWhereVThetaOverLIsBelowAOverB)
{
    const AgeingPotential<DirectEffect::log> pair;
    const RateStateParameters& p = pair.law().parameters();
    for (const double xi : {-3.0, 0.0, 4.0}) {
        for (const double share : {0.999, 1.001}) {
            const double v = share * p.a / p.b * p.v_star * std::exp(-xi);
            const RateStateJet j = pair.rate_potential(v, xi);
            EXPECT_EQ(j.vv * j.xixi > j.vxi * j.vxi, share < 1);
        }
    }
}

TEST(RateStatePotentials, AnyAffineLawHasAPairByQuadrature)
{
    // The ageing law again, whose xi is sqrt(b D_RS) log(theta / theta_min): the potentials
    // must agree in everything but that scale. The second xi-derivative is a difference of
    // step 1e-5 in log(theta), with an error of 1e-11 / 1e-5.
    const RateStateParameters p;
    const double l = p.d_rs;
    AffineLaw law{.direct = [&](double v) { return p.f_star + p.a * std::log(v / p.v_star); },
                  .direct_slope = [&](double v) { return p.a / v; },
                  .state = [&](double t) { return p.b * std::log(p.v_star * t / l); },
                  .state_slope = [&](double t) { return p.b / t; },
                  .heal = [](double) { return 1.0; },
                  .wear = [&](double t) { return t / l; },
                  .theta_min = 1e-5,
                  .theta_max = 1e3,
                  .v_reference = 1e-6};
    const AffineLawPotential general(law);
    const AgeingPotential<DirectEffect::log> exact(p);
    const double scale = std::sqrt(p.b * l);
    for (const double theta : {1e-4, 1e-2, 0.3, 50.0}) {
        for (const double v : {1e-7, 1e-4, 1e-3}) {
            const double xi = general.xi_of_theta(theta);
            EXPECT_NEAR(xi, scale * std::log(theta / law.theta_min), 1e-12 * scale);
            EXPECT_NEAR(general.theta_of_xi(xi) / theta, 1, 1e-12);
            const double eta = exact.law().xi_of_theta(theta);
            const RateStateJet expected = exact.rate_potential(v, eta);
            const RateStateJet found = general.rate_potential(v, xi);
            EXPECT_NEAR(found.v / expected.v, 1, 1e-12);
            const double terms = p.b * (v + p.v_star * std::exp(-eta));
            EXPECT_NEAR(found.xi * scale, expected.xi, 1e-12 * terms);
            EXPECT_NEAR(found.vv / expected.vv, 1, 1e-12);
            EXPECT_NEAR(found.vxi * scale / expected.vxi, 1, 1e-12);
            EXPECT_NEAR(found.xixi * scale * scale, expected.xixi, 1e-5 * terms);
            // xi' from the pair, in the units of log(theta), is the ageing law.
            EXPECT_NEAR(evaluate(general, v, xi).rate / scale, exact.law().state_rate(v, eta),
                        1e-12 * terms / (p.b * l));
        }
    }
    law.wear = [](double) { return -1.0; };
    expect_says(refusal([&] { AffineLawPotential bad(law); }), "q must be positive, found -1");
}

TEST(RateStateLaws, FormsOfTheDirectEffectAgreeAboveW)
{
    const AgeingLaw<DirectEffect::log> log;
    const AgeingLaw<DirectEffect::asinh> asinh;
    for (const double v : {1e-12, 1e-8, 1e-4, 1.0}) {
        for (const double xi : {-5.0, 0.0, 10.0}) {
            // w / V is below 1e-8, and s and |V| differ by w.
            EXPECT_NEAR(asinh.friction(v, xi), log.friction(v, xi), 1e-15);
            EXPECT_NEAR(asinh.friction(-v, xi), -log.friction(v, xi), 1e-15);
            const double sides = (v + 1e-4 * std::exp(-xi)) / 1e-6;
            EXPECT_NEAR(asinh.state_rate(v, xi), log.state_rate(v, xi), 1e-8 * sides);
        }
    }
    EXPECT_EQ(asinh.friction(0, 2), 0);
    EXPECT_EQ(asinh.state_rate(0, 2), 1e-4 * std::exp(-2.0) / 1e-6);
}

TEST(RateStateLaws, GradientsAgreeWithSecondOrderJets)
{
    const RateStateParameters weak{.a = 0.03, .f_star = 0.05};
    const auto compare = [](const auto& law) {
        for (const double v : {-1e-3, 1e-6, 1e-4}) {
            for (const double xi : {-2.0, 1.0}) {
                const FrictionAndRateGradient g = law.gradient(v, xi);
                const RateStateJet f = law.friction_jet(v, xi);
                const RateStateJet r = law.state_rate_jet(v, xi);
                EXPECT_EQ(g.friction, f.value);
                EXPECT_DOUBLE_EQ(g.friction_v, f.v);
                EXPECT_DOUBLE_EQ(g.friction_xi, f.xi);
                EXPECT_DOUBLE_EQ(g.rate, r.value);
                EXPECT_DOUBLE_EQ(g.rate_v, r.v);
                EXPECT_DOUBLE_EQ(g.rate_xi, r.xi);
                // The jet of the rate by central differences: truncation of the order of
                // 1e-8 of the value, rounding 1e-16 / 1e-8.
                const double h = 1e-4;
                const double dv = h * std::abs(v);
                const auto rate = [&](double i, double j) {
                    return law.state_rate(v + i * dv, xi + j * h);
                };
                const double size = std::abs(rate(0, 0)) + 1;
                EXPECT_NEAR(r.vv * dv * dv, rate(1, 0) - 2 * rate(0, 0) + rate(-1, 0),
                            1e-5 * h * h * size * 100);
                EXPECT_NEAR(r.xixi * h * h, rate(0, 1) - 2 * rate(0, 0) + rate(0, -1),
                            1e-5 * h * h * size * 100);
                EXPECT_NEAR(4 * r.vxi * h * dv,
                            rate(1, 1) - rate(1, -1) - rate(-1, 1) + rate(-1, -1),
                            1e-5 * h * h * size * 100);
            }
        }
    };
    compare(AgeingLaw<>(weak));
    compare(SlipLaw<>(weak));
    compare(PrzLaw<>(weak));
}

TEST(RateStateLaws, SteadySlidingHasNoRate)
{
    const auto check = [](const auto& law) {
        for (const double v : {1e-7, 1e-4, 1e-2}) {
            const double xi = law.steady_state(v);
            // Relative to the sides that cancel, which are v / D_RS.
            EXPECT_NEAR(law.state_rate(v, xi) / (v / 1e-6), 0, 1e-14);
        }
    };
    check(AgeingLaw<>());
    check(SlipLaw<>());
    check(PrzLaw<>());
    EXPECT_NEAR(AgeingLaw<>().steady_friction(1e-3), 0.5109 - 0.005 * std::log(10.0), 1e-15);
}

TEST(RateStateLaws, ThetaAndItsLogarithm)
{
    const AgeingLaw<> law;
    EXPECT_NEAR(law.xi_of_theta(0.01), 0, 1e-15);  // theta = D_RS / V*
    EXPECT_NEAR(law.theta_of_xi(law.xi_of_theta(3.7)), 3.7, 1e-14);
}

TEST(RateStateLaws, SayWhichPotentialExists)
{
    EXPECT_EQ(AgeingLaw<>::potential, PotentialKind::quadratic);
    EXPECT_EQ(PrzLaw<>::potential, PotentialKind::state_dependent_convex);
    EXPECT_EQ(SlipLaw<>::potential, PotentialKind::state_dependent);
}

TEST(RateStateLaws, RefuseWhatMakesNoSense)
{
    const auto with = [](const RateStateParameters& p) {
        return refusal([&] { AgeingLaw<> law(p); });
    };
    expect_says(with({.v_star = 0}), "V* must be positive and finite, got 0");
    expect_says(with({.d_rs = -1e-6}), "D_RS must be positive and finite, got -1e-06");
    expect_says(with({.a = -0.01}), "a must be positive and finite, got -0.01");
    expect_says(with({.b = 0}), "b must be positive and finite, got 0");
    expect_says(with({.f_star = std::nan("")}), "f* must be positive");
    const AgeingLaw<DirectEffect::log> law;
    expect_says(refusal([&] { (void)law.friction(0, 0); }), "got V = 0 m/s; the asinh form");
    expect_says(refusal([&] { (void)law.evaluate(-1e-4, 0); }), "got V = -0.0001 m/s; the asinh");
    expect_says(refusal([&] { (void)law.xi_of_theta(0); }), "theta must be positive, got 0 s");
    expect_says(refusal([&] { (void)law.xi_of_theta(-2); }), "theta must be positive, got -2 s");
    expect_says(refusal([&] { (void)SlipPotential<>().dual(1, 0); }), "never positive, got 1");
    expect_says(refusal([] { validate(SpringBlock{.mass = 0}); }), "mass must be positive");
}

TEST(IncrementalPotential, IsConvexUpToTheBoundAndNotBeyond)
{
    const RateStateParameters p;
    const SpringBlock block{.mass = 1, .stiffness = 1e4, .normal_force = 9.81};
    const double bound = largest_convex_step(p, block);
    EXPECT_NEAR(bound, std::sqrt(1 / (9.81 * 0.016 / 1e-6 - 1e4)), 1e-12 * bound);
    const AgeingPotential<DirectEffect::log> pair(p);
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> log_v(-20, 12);
    std::uniform_real_distribution<double> state(-10, 30);
    for (int i = 0; i < 2000; ++i) {
        const double v = p.v_star * std::exp(log_v(random));
        const double xi = state(random);
        const double h = 0.999 * bound;
        const auto j = incremental_potential(pair, block, {.xi = xi, .h = h}, v * h, xi);
        EXPECT_GT(convexity_margin(j), 0);
        // The closed form of the margin, against the Hessian; both cancel at small V.
        EXPECT_NEAR(convexity_margin(j), ageing_convexity_margin(p, block, h, v, xi), 1e-12);
    }
    // The bound is sharp: fast sliding of an old contact fails one part in a hundred above it.
    const double h = 1.01 * bound;
    const auto j = incremental_potential(pair, block, {.xi = 30, .h = h}, 1e3 * h, 30);
    EXPECT_LT(convexity_margin(j), 0);
    EXPECT_EQ(largest_convex_step(p, {.stiffness = 2e5}), std::numeric_limits<double>::infinity());
}

TEST(WrightOmega, IsWithinTwoUlpEverywhere)
{
    std::mt19937_64 random(1);
    const auto worst = [&](double from, double to) {
        std::uniform_real_distribution<double> uniform(from, to);
        double most = 0;
        for (int i = 0; i < 4000; ++i) {
            const double z = uniform(random);
            const double found = wright_omega(z);
            Quad u = found;
            for (int k = 0; k < 3; ++k) {  // Newton on u + log(u) = z, quadratic from 1e-16
                u -= (u + log(u) - Quad(z)) * u / (1 + u);
            }
            const double ulp = std::nextafter(found, 1e308) - found;
            most = std::max(most, static_cast<double>(abs(Quad(found) - u) / Quad(ulp)));
        }
        return most;
    };
    EXPECT_LE(worst(-700, -1.5), 2);
    EXPECT_LE(worst(-3, 0.5), 2);
    EXPECT_LE(worst(0.5, 3.5), 2);
    EXPECT_LE(worst(3.5, 11), 2);
    EXPECT_LE(worst(11, 2000), 2);
    EXPECT_LE(worst(2000, 1e9), 2);
    EXPECT_EQ(wright_omega(1), 1);
    EXPECT_EQ(wright_omega(-800), 0);
    EXPECT_TRUE(std::isnan(wright_omega(std::nan(""))));
}

}  // namespace
}  // namespace ricochet::rate_state_laws_test
