// Applies the common suite to every pair of potentials.
#include "conformance/potentials.hpp"

#include <vector>

#include "additive_pairs.hpp"
#include "rate_state_identities.hpp"
#include "ricochet/faults/affine_law.hpp"
#include "ricochet/faults/friction.hpp"

namespace ricochet::test::potentials_conformance_test {
namespace {

/// Parameters with w of the order of V, so that every term of the asinh form matters.
const RateStateParameters weak{.a = 0.03, .f_star = 0.05};

RateStateParameters scaled(RateStateParameters p, double unit)
{
    p.v_star *= unit;
    p.d_rs *= unit;
    return p;
}

/// An exact pair and its law.
template <class Pair>
PairCase exact(const std::string& name, const RateStateParameters& p)
{
    const Pair pair(p);
    const auto law = pair.law();
    using Law = std::decay_t<decltype(law)>;
    PairCase out{.name = name,
                 .make = [=](double unit) { return any_pair(Pair(scaled(p, unit))); },
                 .law = [=](double v, double xi) { return law.evaluate(v, xi); },
                 .gradient = [=](double v, double xi) { return law.gradient(v, xi); },
                 .effect = Law::effect,
                 .worst_identity =
                     [=] {
                         return check_identities(pair, QuadLaw{p, Law::evolution, Law::effect}, 300,
                                                 17)
                             .worst();
                     },
                 // Every term of the formulas is a few roundings of 1.1e-16 from its value; the
                 // exponent (f* + b xi) / a of w, up to 90, multiplies its rounding by as much,
                 // squared in the tilt of the friction: 1e-13 leaves a factor of two.
                 .identity_tolerance = 1e-13};
    if (Law::evolution == StateEvolution::slip) {
        // Convex above V theta / D_RS = 1/e, with s = -d/b for V.
        out.convex = [=](double d, double xi) { return std::log(-d / (p.b * p.v_star)) + xi > -1; };
    }
    return out;
}

PairCase additive(const std::string& name, const AdditivePair::Parameters& p)
{
    const AdditivePair pair(p);
    return {.name = name,
            .make =
                [=](double unit) {
                    AdditivePair::Parameters other = p;
                    other.v_star *= unit;
                    return any_pair(AdditivePair(other));
                },
            .law = [=](double v, double xi) { return pair.evaluate(v, xi); },
            .gradient = [=](double v, double xi) { return pair.gradient(v, xi); },
            .v_least = 1e-7,
            .v_most = 1e-3,
            .xi_least = -2,
            .xi_most = 6,
            // Differences over a hundredth of the width of a unit.
            .tolerance = 5e-8,
            .second_tolerance = 5e-8,
            .dual_rounding = 1e-16 * 100 * p.beta * p.v_star};
}

/// The ageing law by quadrature; its state is sqrt(b D_RS) log(theta / theta_min).
PairCase affine()
{
    const RateStateParameters p;
    const double least = 1e-5;
    const AffineLaw given{
        .direct = [=](double v) { return p.f_star + p.a * std::log(v / p.v_star); },
        .direct_slope = [=](double v) { return p.a / v; },
        .state = [=](double t) { return p.b * std::log(p.v_star * t / p.d_rs); },
        .state_slope = [=](double t) { return p.b / t; },
        .heal = [](double) { return 1.0; },
        .wear = [=](double t) { return t / p.d_rs; },
        .theta_min = least,
        .theta_max = 1e3,
        .v_reference = 1e-6};
    const double unit = std::sqrt(p.b * p.d_rs);
    const AgeingLaw<DirectEffect::log> law(p);
    return {.name = "Affine",
            .make = [=](double) { return any_pair(AffineLawPotential(given)); },
            .law =
                [=](double v, double xi) {
                    const double eta = law.xi_of_theta(least) + xi / unit;
                    return FrictionAndRate{law.friction(v, eta), unit * law.state_rate(v, eta)};
                },
            .v_least = 1e-7,
            .v_most = 1e-3,
            .xi_least = 2 * unit,
            .xi_most = 16 * unit,
            .xi_unit = unit,
            .scales = false,
            // Its second derivative by xi is a difference over 1e-5, of quadratures to 1e-11.
            .second_tolerance = 1e-5,
            .refuses_rest = false};
}

std::vector<PairCase> all()
{
    using enum DirectEffect;
    return {exact<AgeingPotential<log>>("AgeingLog", {}),
            exact<AgeingPotential<asinh>>("Ageing", {}),
            exact<AgeingPotential<asinh>>("AgeingWeak", weak),
            exact<SlipPotential<log>>("SlipLog", {}),
            exact<SlipPotential<asinh>>("Slip", {}),
            exact<SlipPotential<asinh>>("SlipWeak", weak),
            exact<PrzPotential<log>>("PrzLog", {}),
            exact<PrzPotential<asinh>>("Prz", {}),
            exact<PrzPotential<asinh>>("PrzWeak", weak),
            additive("AdditiveOfLinearNets", linear_nets()),
            additive("Additive", crooked_nets()),
            affine()};
}

INSTANTIATE_TEST_SUITE_P(All, PotentialSuite, testing::ValuesIn(all()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace ricochet::test::potentials_conformance_test
