// Rate-and-state friction on all test histories and sliders: identities, learning, stability.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/numeric/odeint/algebra/vector_space_algebra.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "rate_state_identities.hpp"
#include "ricochet/faults/spring_slider.hpp"
#include "ricochet/learn_steps/train_friction.hpp"
#include "studies/along_history.hpp"
#include "studies/baselines.hpp"
#include "studies/friction_study.hpp"
#include "studies/identify_friction.hpp"
#include "theta_reference.hpp"

namespace ricochet::friction_full_test {
namespace {

using Histories = std::vector<FrictionHistory>;
using learn::LearnedFriction;

constexpr double f_star = 0.5109;
constexpr std::size_t training_size = 48;

const FrictionData& data()
{
    static const FrictionData made = make_friction_data(1);
    return made;
}

Histories first(const Histories& all, std::size_t n, std::size_t from = 0)
{
    const auto begin = all.begin() + static_cast<long>(from);
    return {begin, begin + static_cast<long>(n)};
}

TEST(FrictionInFull, IdentitiesOfThePotentialsHoldToRounding)
{
    // V/V* in [1e-12, 1e4], xi in [-10, 30].
    const RateStateParameters p;
    const auto worst = [&](const auto& pair, StateEvolution e, DirectEffect d) {
        return test::check_identities(pair, test::QuadLaw{p, e, d}, 10'000, 1).worst();
    };
    EXPECT_LE(
        worst(AgeingPotential<DirectEffect::log>(p), StateEvolution::ageing, DirectEffect::log),
        1e-13);
    EXPECT_LE(worst(AgeingPotential<>(p), StateEvolution::ageing, DirectEffect::asinh), 1e-13);
    EXPECT_LE(worst(SlipPotential<>(p), StateEvolution::slip, DirectEffect::asinh), 1e-13);
    EXPECT_LE(worst(PrzPotential<>(p), StateEvolution::prz, DirectEffect::asinh), 1e-13);
}

/// Integrates `flow(x, rate, v)` along a history; `at(x, v)` is the friction.
template <class Real, class Flow, class Friction>
std::vector<double> integrated(const FrictionHistory& h, Real x, const Flow& flow,
                               const Friction& at)
{
    boost::numeric::odeint::runge_kutta_fehlberg78<Real, Real, Real, Real,
                                                   boost::numeric::odeint::vector_space_algebra>
        stepper;
    constexpr int steps = 400;
    std::vector<double> out;
    for (std::size_t n = 0; n < h.t.size(); ++n) {
        if (n > 0) {
            const Real from = h.v[n - 1];
            const Real to = h.between == FrictionHistory::Between::linear ? h.v[n] : h.v[n - 1];
            const Real length = Real(h.t[n]) - Real(h.t[n - 1]);
            for (int i = 0; i < steps; ++i) {
                stepper.do_step(
                    [&](const Real& state, Real& rate, Real t) {
                        rate = flow(state, from + (to - from) * (t / length));
                    },
                    x, length * i / steps, length / steps);
            }
        }
        out.push_back(static_cast<double>(at(x, Real(h.v[n]))));
    }
    return out;
}

TEST(FrictionInFull, TheExactPairHasTheFrictionOfTheLaw)
{
    // The pair's own flow (9), by Fehlberg's method in double, and its closed form.
    const RateStateParameters p;
    const AgeingPotential<DirectEffect::log> pair(p);
    for (const FrictionHistory& h : data().test) {
        const std::vector<double> reference = test::theta_friction(p, h);
        EXPECT_LE(relative_error(h.friction, reference), 1e-12);
        const auto found = integrated(
            h, 0.0, [&](double xi, double v) { return evaluate(pair, v, xi).rate; },
            [&](double xi, double v) { return evaluate(pair, v, xi).friction; });
        EXPECT_LE(relative_error(found, reference), 1e-12);
    }
}

TEST(FrictionInFull, TheSlipLawHasAPairThatDependsOnTheState)
{
    // xi' = -(V / D_RS) (log(V / V*) + xi), as theta' = -(V theta / D_RS) log(V theta / D_RS).
    using Real = long double;
    const RateStateParameters p;
    const SlipPotential<DirectEffect::log> pair(p);
    for (const FrictionHistory& h : first(data().test, 40)) {
        const auto reference = integrated(
            h, Real(p.d_rs) / p.v_star,
            [&](Real theta, Real v) {
                const Real omega = v * theta / p.d_rs;
                return -omega * std::log(omega);
            },
            [&](Real theta, Real v) {
                return p.f_star + p.a * std::log(v / p.v_star) +
                       p.b * std::log(p.v_star * theta / p.d_rs);
            });
        const auto found = integrated(
            h, 0.0, [&](double xi, double v) { return evaluate(pair, v, xi).rate; },
            [&](double xi, double v) { return evaluate(pair, v, xi).friction; });
        EXPECT_LE(relative_error(found, reference), 1e-9);
    }
}

TEST(FrictionInFull, ParametersAreIdentifiedFromTwentyFourHistories)
{
    const RateStateParameters p;
    const auto clean = learn::identify_ageing_law(first(data().training, 24)).parameters;
    EXPECT_NEAR(clean.a / p.a, 1, 1e-8);
    EXPECT_NEAR(clean.b / p.b, 1, 1e-8);
    EXPECT_NEAR(clean.f_star / p.f_star, 1, 1e-8);
    EXPECT_NEAR(clean.d_rs / p.d_rs, 1, 1e-8);
    constexpr int draws = 20;
    double mean = 0;
    for (std::uint64_t seed = 101; seed <= 100 + draws; ++seed) {
        Histories noisy = first(data().training, 24);
        add_noise(noisy, 5e-3, seed);
        const auto fit = learn::identify_ageing_law(noisy);
        for (const FrictionHistory& h : data().test) {
            const auto friction = ageing_friction(fit.parameters, h, fit.xi_start);
            mean += relative_error(friction, h.friction) / (160.0 * draws);
        }
    }
    EXPECT_LE(mean, 5e-4);
}

// --- learning ---

/// The pair of 71 parameters trained on the nth 48 training histories.
const LearnedFriction& trained(std::size_t n)
{
    static std::vector<LearnedFriction> fits;
    while (fits.size() <= n) {
        const std::size_t k = fits.size();
        fits.push_back(learn::train_friction(first(data().training, training_size, 60 * k),
                                             {.seed = k + 1, .iterations = 200, .seconds = 25}));
    }
    return fits[n];
}

std::vector<double> internal_of(const LearnedFriction& fit)
{
    std::vector<double> out;
    for (const FrictionHistory& h : data().test) {
        const auto xi = fit.internal(h)[0];
        out.insert(out.end(), xi.begin(), xi.end());
    }
    return out;
}

double correlation(const std::vector<double>& a, const std::vector<double>& b)
{
    const auto mean = [](const std::vector<double>& x) {
        long double sum = 0;
        for (const double value : x) sum += value;
        return sum / static_cast<long double>(x.size());
    };
    const long double ma = mean(a), mb = mean(b);
    long double ab = 0, aa = 0, bb = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        ab += (a[i] - ma) * (b[i] - mb);
        aa += (a[i] - ma) * (a[i] - ma);
        bb += (b[i] - mb) * (b[i] - mb);
    }
    return static_cast<double>(ab / std::sqrt(aa * bb));
}

TEST(FrictionInFull, APairOf71ParametersLearnsTheLawAndItsState)
{
    const LearnedFriction& fit = trained(0);
    EXPECT_EQ(fit.parameters(), 71U);
    const learn::FrictionErrors e = learn::assess(fit, data().test, f_star);
    EXPECT_LE(e.mean, 5e-6);
    EXPECT_LE(e.most, 5e-5);
    EXPECT_LE(e.mean_beyond, 3e-4);
    const RateStateParameters p;
    std::vector<double> log_theta;
    for (const FrictionHistory& h : data().test) {
        for (std::size_t i = 0; i < h.t.size(); ++i) {
            const double direct = p.f_star + p.a * std::log(h.v[i] / p.v_star);
            log_theta.push_back((h.friction[i] - direct) / p.b);
        }
    }
    EXPECT_LE(1 - correlation(internal_of(fit), log_theta), 1e-7);
}

TEST(FrictionInFull, FitsToOtherHistoriesFindTheSameInternalVariable)
{
    std::vector<std::vector<double>> xi;
    for (std::size_t k = 0; k < 3; ++k) xi.push_back(internal_of(trained(k)));
    EXPECT_GE(correlation(xi[0], xi[1]), 0.98);
    EXPECT_GE(correlation(xi[0], xi[2]), 0.98);
    EXPECT_GE(correlation(xi[1], xi[2]), 0.98);
}

TEST(FrictionInFull, TheLearnedPairMovesSlidersAsTheLawDoes)
{
    const learn::Transfer t = learn::transfer_to_sliders(trained(0), 5, 20);
    for (const learn::SliderErrors& e : {t.as_trained, t.further_trained}) {
        EXPECT_LE(e.x, 1.9e-5);
        EXPECT_LE(e.v, 2.7e-4);
        EXPECT_LE(e.friction, 1e-5);
    }
}

TEST(FrictionInFull, AGeneralNetworkThatIsConvexInTheStateLearnsTheLaw)
{
    const LearnedFriction fit = learn::train_friction(
        first(data().training, training_size),
        {.network = learn::FrictionNetwork::general, .iterations = 200, .seconds = 40});
    EXPECT_LE(learn::assess(fit, data().test, f_star).mean, 5e-4);
}

TEST(FrictionInFull, NoneOneAndTwoInternalVariablesAreTried)
{
    // Table 1 of the paper: 0.18, 5e-4 and 7e-4.
    const auto error = [](int internal) {
        return learn::try_internal_variables(data(), internal, training_size, 25).test.mean;
    };
    const double none = error(0);
    EXPECT_LE(error(1), 5e-4);
    EXPECT_LE(error(2), 7e-4);
    EXPECT_GT(none, 1e-2);
}

// --- sliders ---

/// Velocities at a fixed step, every `keep`-th of them.
struct FixedRun {
    std::vector<double> velocity{};
    bool stable = true;
    long unsolved = 0, not_convex = 0;
    int most = 0;  ///< iterations of a stage
    double residual = 0;
};

FixedRun run_fixed(const SliderCase& c, int order, double h, long keep = 0)
{
    const VariationalStep<AgeingLaw<>> step(AgeingLaw<>(c.slider.friction), c.slider.block, order);
    SliderState s = slider_case_start();
    FixedRun out;
    const long steps = std::max(1L, std::lround(2 / h));
    for (long n = 1; n <= steps; ++n) {
        const StepReport r = step.take(s, h, c.slider.load);
        out.unsolved += r.unsolved;
        out.not_convex += r.not_convex;
        out.most = std::max(out.most, r.most_iterations);
        out.residual = std::max(out.residual, r.residual);
        if (keep > 0 && n % keep == 0) out.velocity.push_back(s.v);
        if (!std::isfinite(s.v) || std::abs(s.v) > 100) {
            out.stable = false;
            break;
        }
    }
    return out;
}

TEST(SlidersInFull, NoRunIsUnstable)
{
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
        for (const SliderCase& c : slider_cases(seed)) {
            for (const int order : {1, 2, 4}) {
                for (const double e : {-13.5, -13.0, -12.5, -12.0, -11.5, -11.0, -9.0, -7.0, -5.0,
                                       -3.0, -2.0, -1.0, 1.0}) {
                    const FixedRun r = run_fixed(c, order, std::exp2(e));
                    EXPECT_TRUE(r.stable);
                    EXPECT_EQ(r.unsolved, 0);
                    EXPECT_LE(r.residual, 1e-10);
                    EXPECT_LE(r.most, 60);
                    if (e <= -9) {
                        EXPECT_EQ(r.not_convex, 0);
                    }
                }
            }
        }
    }
}

TEST(SlidersInFull, ThetaAndPotentialFormAreUnstableAlikeByRk4)
{
    int same = 0;
    int runs = 0;
    for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
        for (const SliderCase& c : slider_cases(seed)) {
            for (const double e : {-13.5, -13.0, -12.5, -12.0, -11.5, -11.0}) {
                BaselineOptions o{.step = std::exp2(e)};
                const bool theta = run_baseline(c.slider, slider_case_start(), o).stable;
                o.form = StateForm::potential;
                same += theta == run_baseline(c.slider, slider_case_start(), o).stable;
                ++runs;
            }
        }
    }
    EXPECT_GE(same, 0.995 * runs);
}

TEST(SlidersInFull, AnySingleStepIsSolved)
{
    std::mt19937_64 random(12);
    std::uniform_real_distribution<double> unit(0, 1);
    const auto log_uniform = [&](double a, double b) {
        return a * std::exp(std::log(b / a) * unit(random));
    };
    const AgeingLaw<> law;
    for (int i = 0; i < 100'000; ++i) {
        const SpringBlock block{.mass = log_uniform(1e-6, 1e3), .stiffness = log_uniform(1, 1e7)};
        const double h = log_uniform(1e-6, 1e4);
        SliderState s{.v = (unit(random) < 0.3 ? -1 : 1) * log_uniform(1e-20, 10),
                      .xi = -10 + 40 * unit(random)};
        const double load = (unit(random) - 0.3) * log_uniform(1e-9, 1);
        const int order = i % 3 == 0 ? 1 : i % 3 == 1 ? 2 : 4;
        const VariationalStep<AgeingLaw<>> step(law, block, order);
        const StepReport r = step.take(s, h, [&](double) { return load; });
        EXPECT_TRUE(r.solved() && r.residual <= 1e-10 && std::isfinite(s.v + s.x + s.xi)) << i;
    }
}

TEST(SlidersInFull, TheIncrementalPotentialIsConvexUpToTheBound)
{
    const RateStateParameters p;
    const AgeingPotential<DirectEffect::log> pair(p);
    std::mt19937_64 random(2);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int i = 0; i < 100'000; ++i) {
        const SpringBlock block{.mass = 1, .stiffness = 1e5 * unit(random)};
        const double h = largest_convex_step(p, block) * (1 - 1e-9) * unit(random);
        const double v = p.v_star * std::exp(40 * unit(random) - 28);
        const double xi = -10 + 40 * unit(random);
        const auto j = incremental_potential(pair, block, {.xi = xi, .h = h}, v * h, xi);
        EXPECT_GT(convexity_margin(j), 0) << i;
    }
}

TEST(SlidersInFull, MedianErrorsOfTheVelocityAreSmall)
{
    // At 2^-11 s, at times 2^-7 s apart, against order 4 at 2^-16 s, extrapolated.
    constexpr long per_second = 2048;
    constexpr std::size_t stride = 16;
    const auto thin = [](const std::vector<double>& all) {
        std::vector<double> some;
        for (std::size_t i = stride - 1; i < all.size(); i += stride) some.push_back(all[i]);
        return some;
    };
    std::vector<double> errors[2][2];  // by k < k_crit; order 2, 4
    for (const SliderCase& c : slider_cases(1)) {
        const FixedRun coarse = run_fixed(c, 4, std::exp2(-15), (1L << 15) / per_second);
        FixedRun fine = run_fixed(c, 4, std::exp2(-16), (1L << 16) / per_second);
        for (std::size_t i = 0; i < fine.velocity.size(); ++i) {
            fine.velocity[i] += (fine.velocity[i] - coarse.velocity[i]) / 15;
        }
        for (const int order : {2, 4}) {
            const FixedRun r = run_fixed(c, order, std::exp2(-11), 1);
            EXPECT_EQ(r.unsolved, 0);
            errors[c.stiffness_ratio < 1][order / 4].push_back(
                relative_error(thin(r.velocity), thin(fine.velocity)));
        }
    }
    const auto median = [](std::vector<double>& x) {
        std::nth_element(x.begin(), x.begin() + static_cast<long>(x.size() / 2), x.end());
        return x[x.size() / 2];
    };
    EXPECT_LE(median(errors[0][0]), 1.5e-5);
    EXPECT_LE(median(errors[0][1]), 1e-8);
    EXPECT_LE(median(errors[1][1]), 1e-4);
}

}  // namespace
}  // namespace ricochet::friction_full_test
