// Variational steps of a slider with rate-and-state friction, beside ordinary solvers.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "ricochet/faults/incremental.hpp"
#include "ricochet/faults/spring_slider.hpp"
#include "studies/baselines.hpp"

namespace ricochet::rate_state_step_test {
namespace {

constexpr double normal_force = 9.81;

SliderCase a_case(double ratio, double velocity = 1.5e-4)
{
    SliderCase c;
    const RateStateParameters p;
    c.stiffness_ratio = ratio;
    c.slider.block.stiffness = ratio * critical_stiffness(p, 1, normal_force, velocity);
    c.slider.load = SliderLoad(normal_force * p.f_star / c.slider.block.stiffness, velocity);
    return c;
}

/// Runs with fixed steps and returns the state.
SliderState fixed(const SpringSlider& slider, int order, double h, double t_end)
{
    const SliderRun run =
        run_slider(slider, slider_case_start(), {.t_end = t_end, .order = order, .step = h});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.unsolved, 0U);
    return run.state;
}

TEST(VariationalStep, IsAMinimumOfTheIncrementalPotential)
{
    const AgeingLaw<> law;
    const AgeingPotential<> pair;
    const SpringBlock block{.mass = 1, .stiffness = 2e4, .normal_force = normal_force};
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int i = 0; i < 500; ++i) {
        const double h = 1e-5 * std::exp(5 * unit(random));  // below the bound of 2.7e-3
        const double v0 = 1e-4 * std::exp(14 * unit(random) - 9);
        SliderState s{.x = 0, .v = v0, .xi = 12 * unit(random) - 2};
        const double load = 3e-4 * unit(random);
        const IncrementalStart start{.x = 0, .x_before = -v0 * h, .xi = s.xi, .load = load, .h = h};
        const VariationalStep<AgeingLaw<>> step(law, block, 1);
        const StepReport report = step.take(s, h, [&](double) { return load; });
        ASSERT_TRUE(report.solved());
        EXPECT_EQ(report.not_convex, 0);
        const IncrementalJet j = incremental_potential(pair, block, start, s.x, s.xi);
        // The search stops at 1e-13 in log V, the potential is evaluated at x / h.
        EXPECT_NEAR(j.x, 0, 1e-11 * (block.mass * v0 / h + normal_force));
        const double sides = normal_force * h * 0.016 * (std::abs(s.v) + 1e-4 * std::exp(-s.xi));
        EXPECT_NEAR(j.xi, 0, 1e-11 * sides + 1e-13 * normal_force * 0.016 * 1e-6);
        EXPECT_GT(convexity_margin(j), 0);
    }
}

TEST(VariationalStep, ClosedFormOfTheStateIsTheImplicitOne)
{
    const AgeingLaw<> law;
    for (const double h : {1e-6, 1e-3, 1.0}) {
        const StateElimination<AgeingLaw<>> closed(law, h);
        for (const double y : {-20.0, -3.0, 0.0, 4.0, 9.0}) {
            for (const double before : {-5.0, 0.0, 12.0}) {
                const double v = 1e-4 * std::exp(y);
                const StageResponse a = closed(y, v, before);
                const StageResponse b = detail::implicit_response(law, h, v, before, a.xi);
                // xi is found to 1e-15 of its size and of log(h V / D_RS).
                EXPECT_NEAR(a.xi, b.xi, 1e-13);
                EXPECT_NEAR(a.friction, b.friction, 1e-14);
                EXPECT_NEAR(a.friction_y, b.friction_y, 1e-13);
                EXPECT_NEAR(a.xi_y, b.xi_y, 1e-12 * (1 + std::abs(b.xi_y)));
            }
        }
    }
}

TEST(VariationalStep, OrdersAreOneTwoAndFour)
{
    // Root mean square of the error in V at ten times, which are ends of steps.
    const SliderCase c = a_case(2.0);
    const auto velocities = [&](int order, double h) {
        return run_slider(c.slider, slider_case_start(),
                          {.t_end = 0.04, .order = order, .step = h, .samples = 11})
            .samples;
    };
    const auto reference = velocities(4, 2e-5);
    const auto error = [&](int order, double h) {
        double square = 0;
        const auto run = velocities(order, h);
        for (std::size_t i = 0; i < run.size(); ++i) {
            square += std::pow(run[i].v - reference[i].v, 2);
        }
        return std::sqrt(square);
    };
    for (const int order : {1, 2, 4}) {
        const double h = order == 4 ? 1e-3 : 1e-4;
        EXPECT_NEAR(std::log2(error(order, h) / error(order, h / 2)), order, 0.3) << order;
    }
}

TEST(VariationalStep, EveryEvolutionLawHasItsOrder)
{
    for (const StateEvolution evolution : {StateEvolution::slip, StateEvolution::prz}) {
        SliderCase c = a_case(3.0);
        c.slider.evolution = evolution;
        const SliderState reference = fixed(c.slider, 4, 1e-5, 0.02);
        const auto error = [&](double h) {
            return std::abs(fixed(c.slider, 2, h, 0.02).v - reference.v);
        };
        EXPECT_NEAR(std::log2(error(1e-4) / error(5e-5)), 2, 0.2);
    }
}

TEST(VariationalStep, StageWithoutARepresentableSlipRateIsNotSolved)
{
    // f* + a log(V / V*) + b xi = 0.1 requires V = V* e^-5000 with a = 1e-4: the log form has no
    // such double, and every stage reports so.
    RateStateParameters p;
    p.a = 1e-4;
    const RateStateLaw<StateEvolution::slip, DirectEffect::log> slip(p);
    const RateStateLaw<StateEvolution::prz, DirectEffect::log> prz(p);
    const StageEquation e{.c = 1, .normal_force = 1, .force = p.f_star - 0.5};
    EXPECT_FALSE(solve_stage(StateElimination(slip, 1e-3), e, 1e-6).report.solved);
    EXPECT_FALSE(solve_stage(StateElimination(prz, 1e-3), e, 1e-6).report.solved);
}

TEST(VariationalStep, SolvesAdversarialSteps)
{
    // Any history, even of the wrong sign, and any step from microseconds to hours.
    std::mt19937_64 random(8);
    std::uniform_real_distribution<double> unit(0, 1);
    const auto log_uniform = [&](double a, double b) {
        return a * std::exp(std::log(b / a) * unit(random));
    };
    const AgeingLaw<> law;
    const SlipLaw<> slip;
    const PrzLaw<> prz;
    int not_convex = 0;
    for (int i = 0; i < 5000; ++i) {
        const SpringBlock block{.mass = log_uniform(1e-6, 1e3),
                                .stiffness = log_uniform(1, 1e7),
                                .normal_force = normal_force};
        const double h = log_uniform(1e-6, 1e4);
        const double sign = unit(random) < 0.3 ? -1 : 1;
        const SliderState start{.v = sign * log_uniform(1e-20, 10), .xi = -10 + 40 * unit(random)};
        const double load = (unit(random) - 0.3) * log_uniform(1e-9, 1);
        const auto held = [&](double) { return load; };
        for (const int order : {1, 2, 4}) {
            const auto check = [&](const auto& of) {
                SliderState s = start;
                using Law = std::decay_t<decltype(of)>;
                const StepReport report = VariationalStep<Law>(of, block, order).take(s, h, held);
                EXPECT_EQ(report.unsolved, 0) << i << " order " << order;
                EXPECT_LE(report.residual, 1e-10);
                EXPECT_LE(report.most_iterations, 100);
                EXPECT_TRUE(std::isfinite(s.v + s.x + s.xi));
                if (std::is_same_v<Law, AgeingLaw<>>) not_convex += report.not_convex;
            };
            check(law);
            if (i % 10 == 0) check(slip), check(prz);
        }
    }
    EXPECT_EQ(not_convex, 0);  // the search ends where the residual rises
}

TEST(VariationalStep, StaysStableWhereOrdinarySolversFail)
{
    const SliderCase c = a_case(0.4);
    for (const double h : {std::exp2(-11), std::exp2(-5), 2.0}) {
        for (const int order : {1, 2, 4}) {
            const SliderRun run =
                run_slider(c.slider, slider_case_start(), {.t_end = 2, .order = order, .step = h});
            EXPECT_EQ(run.outcome, Outcome::reached_end);
            EXPECT_LE(std::abs(run.state.v), 100);
            EXPECT_EQ(run.unsolved, 0U);
        }
    }
    BaselineOptions options{.step = std::exp2(-11)};
    const auto stable = [&](Baseline method, StateForm form) {
        options.method = method;
        options.form = form;
        return run_baseline(c.slider, slider_case_start(), options).stable;
    };
    EXPECT_FALSE(stable(Baseline::rk4, StateForm::theta));
    EXPECT_FALSE(stable(Baseline::rk4, StateForm::potential));  // the form alone does not help
    EXPECT_FALSE(stable(Baseline::adams, StateForm::theta));
}

TEST(Baselines, AgreeWithVariationalStepsWhereTheyWork)
{
    // RK4 has an error of (h k)^4 T of the order of 1e-8 in V here, the others less.
    const SliderCase c = a_case(1.5);
    const SliderState reference = fixed(c.slider, 4, 2e-5, 0.1);
    for (const StateForm form : {StateForm::theta, StateForm::potential}) {
        for (const auto& [method, h, tolerance] :
             {std::tuple{Baseline::rk4, 1e-4, 1e-7}, std::tuple{Baseline::adams, 2e-5, 1e-5},
              std::tuple{Baseline::backward_euler, 1e-5, 2e-3}}) {
            const BaselineRun run = run_baseline(
                c.slider, slider_case_start(),
                {.method = method, .form = form, .step = h, .t_end = 0.1, .adams_order = 6});
            ASSERT_TRUE(run.stable);
            EXPECT_NEAR(run.velocity.back() / reference.v, 1, tolerance);
        }
    }
}

TEST(SpringSlider, SlidesSteadilyAboveTheCriticalStiffness)
{
    const auto swing = [](double ratio) {
        SliderCase c = a_case(ratio, 1e-4);
        SliderState start = slider_case_start();
        start.v *= 1.01;
        double most = 0;
        const SliderRun run = run_slider(c.slider, start, {.t_end = 2, .samples = 4001});
        for (const SliderState& s : run.samples) {
            if (s.t > 1.8) most = std::max(most, std::abs(s.v / 1e-4 - 1));
        }
        return most;
    };
    EXPECT_LT(swing(1.1), 0.003);  // decays
    EXPECT_GT(swing(0.9), 0.03);   // grows
}

TEST(SpringSlider, LocatesOnsetAndArrest)
{
    const SliderCase c = a_case(0.5);
    const SliderOptions options{.t_end = 0.6, .threshold = 5e-4};
    const SliderRun run = run_slider(c.slider, slider_case_start(), options);
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_GE(run.events.size(), 4U);
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_EQ(run.events[i].kind,
                  i % 2 == 0 ? SliderEventKind::onset : SliderEventKind::arrest);
        EXPECT_NEAR(run.events[i].at.v / 5e-4, 1, 1e-11);  // V changes by 1e5 of itself per s
    }
    // The times are those of another order with fixed steps, up to its error.
    const SliderRun other = run_slider(c.slider, slider_case_start(),
                                       {.t_end = 0.6, .order = 4, .step = 5e-6, .threshold = 5e-4});
    ASSERT_EQ(other.events.size(), run.events.size());
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_NEAR(other.events[i].at.t, run.events[i].at.t, 1e-7);
    }
}

TEST(SpringSlider, SamplesAreInBalanceWhileTheBlockSticks)
{
    // The slip rate of the block falls to 1e-25 m/s, far below what its acceleration resolves, and
    // friction is then the pull of the spring.
    const double velocity = 1e-5;
    SpringSlider slider{
        .friction = {.a = 0.006, .b = 0.02, .f_star = 0.6, .v_star = velocity, .d_rs = 1e-4},
        .block = {.mass = 0.01, .stiffness = 420, .normal_force = 10}};
    const SpringBlock& block = slider.block;
    slider.load = SliderLoad(10 * slider.friction.f_star / block.stiffness, 2 * velocity);
    const SliderRun run = run_slider(slider, {0, 0, velocity, 0}, {.t_end = 300, .samples = 101});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_TRUE(run.events.empty());
    int stuck = 0;
    for (const SliderState& s : run.samples) {
        EXPECT_GT(s.v, 0) << s.t;
        if (s.v > 1e-3 * velocity) continue;
        ++stuck;
        const double pull = block.stiffness * (slider.load(s.t) - s.x) / block.normal_force;
        EXPECT_NEAR(slider_friction(slider, s), pull, 1e-9) << s.t;
    }
    EXPECT_GT(stuck, 50);
}

TEST(SpringSlider, FollowsALoadThatReverses)
{
    SliderCase c = a_case(2.0);
    const double start = c.slider.load(0);
    c.slider.load = SliderLoad(start, {{0, 1e-4}, {0.2, -1e-3}, {0.8, 1e-3}});
    for (const double h : {0.0, 1e-3, 1.0 / 32}) {
        const SliderRun run =
            run_slider(c.slider, slider_case_start(), {.t_end = 1.4, .step = h, .samples = 141});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << h;
        EXPECT_LE(run.residual, 1e-10);
        ASSERT_EQ(run.samples.size(), 141U);
        EXPECT_GT(run.samples[19].v, 0);
        EXPECT_LT(run.samples[79].v, 0);
        EXPECT_GT(run.samples[140].v, 0);
        EXPECT_GE(run.events.size(), 2U);
        EXPECT_EQ(run.events.front().kind, SliderEventKind::reversal);
    }
}

TEST(SpringSlider, CasesAreTheSameForASeed)
{
    const auto cases = slider_cases(3);
    ASSERT_EQ(cases.size(), 77U);
    int soft = 0;
    for (const SliderCase& c : cases) soft += c.stiffness_ratio < 1;
    EXPECT_EQ(soft, 35);
    EXPECT_EQ(slider_cases(3)[5].stiffness_ratio, cases[5].stiffness_ratio);
    EXPECT_NE(slider_cases(4)[5].stiffness_ratio, cases[5].stiffness_ratio);
}

TEST(SpringSlider, RefusesWhatMakesNoSense)
{
    const SliderCase c = a_case(2.0);
    const SliderState start = slider_case_start();
    EXPECT_THROW((void)run_slider(c.slider, start, {.order = 3}), std::invalid_argument);
    EXPECT_THROW((void)run_slider(c.slider, start, {.t_end = 0}), std::invalid_argument);
    EXPECT_THROW((void)run_slider(c.slider, start, {.step = -1e-3}), std::invalid_argument);
    for (double SliderState::*const component :
         {&SliderState::t, &SliderState::x, &SliderState::v, &SliderState::xi}) {
        SliderState broken = start;
        broken.*component = std::nan("");
        EXPECT_THROW((void)run_slider(c.slider, broken, {}), std::invalid_argument);
    }
    SliderState s = start;
    const VariationalStep<AgeingLaw<>> step(AgeingLaw<>(), c.slider.block, 1);
    EXPECT_THROW((void)step.take(s, 0, c.slider.load), std::invalid_argument);
    EXPECT_THROW((void)step.take(s, -1e-3, c.slider.load), std::invalid_argument);
    EXPECT_THROW(SliderLoad(0, std::vector<SliderLoad::Piece>{}), std::invalid_argument);
    EXPECT_THROW(SliderLoad(0, {{1, 1e-4}, {1, 2e-4}}), std::invalid_argument);
    EXPECT_THROW((void)run_baseline(c.slider, start, {.step = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::rate_state_step_test
