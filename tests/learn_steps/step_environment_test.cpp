// Runs as environments: their steps, rewards and ends.
#include "ricochet/learn_steps/step_environment.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <span>
#include <stdexcept>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::learn::step_environment_test {
namespace {

struct Episode {
    double undiscounted = 0;
    std::uint64_t attempts = 0;
    bool terminal = false;
    StepTrial trial;
    std::array<double, 9> observation{};  // the last
};

/// An episode with a rule for actions.
template <class Action>
Episode act(const StepEnvironment& runs, const Action& action)
{
    Episode out;
    EXPECT_EQ(runs.environment.observations, out.observation.size());
    runs.environment.reset(1, out.observation);
    for (;;) {
        const double a = action();
        const Reaction reaction = runs.environment.step({&a, 1}, out.observation);
        for (const double o : out.observation) EXPECT_LE(std::abs(o), 5);
        out.undiscounted += reaction.reward;
        ++out.attempts;
        if (!reaction.terminal && !reaction.truncated) continue;
        out.terminal = reaction.terminal;
        out.trial = runs.trial();
        return out;
    }
}

Episode constant(const StepEnvironment& runs, double length)
{
    return act(runs, [a = runs.action_of(length)] { return a; });
}

TEST(StepEnvironment, ActionsSpanTheSteps)
{
    for (const StepScale scale : {StepScale::linear, StepScale::logarithmic}) {
        const StepEnvironment runs = step_environment(
            SlidingMode{}, 0.15, 0.1, {.scale = scale, .h_min = 1e-4, .h_max = 1e-2});
        EXPECT_NEAR(runs.length_of(-1), 1e-4, 1e-18);
        EXPECT_NEAR(runs.length_of(1), 1e-2, 1e-16);
        const double middle = scale == StepScale::linear ? 5.05e-3 : 1e-3;
        EXPECT_NEAR(runs.length_of(0), middle, 1e-16);
        EXPECT_NEAR(runs.action_of(runs.length_of(0.3)), 0.3, 1e-14);
    }
}

// The episode is the run, to the bit, for any estimate and scheme.
TEST(StepEnvironment, AConstantActionIsAConstantStepOfAFault)
{
    const StrikeSlipFault fault({.elements = 2});
    for (const bool published : {false, true}) {
        StepEnvironmentOptions options =
            published ? published_step_environment() : StepEnvironmentOptions{};
        options.until_rest = true;
        const StepEnvironment runs = step_environment(fault, 20, options);
        const double h = runs.length_of(runs.action_of(0.2));
        const Episode episode = constant(runs, 0.2);
        const Rupture run = simulate(fault, {.t_end = 20, .step = h},
                                     {.first_stage = options.first_stage,
                                      .estimate = options.estimate,
                                      .norm = published ? FaultNorm::components : FaultNorm::fields,
                                      .rtol = 1e-3,
                                      .atol = 1e-6,
                                      .h_max = 20});
        EXPECT_EQ(run.outcome, Outcome::at_rest);
        EXPECT_TRUE(episode.terminal);
        EXPECT_EQ(episode.trial.steps, run.statistics.steps);
        EXPECT_EQ(episode.trial.solves, run.statistics.solves);
        EXPECT_EQ(episode.trial.iterations, run.statistics.iterations);
        // The error is a function of the final slip, which is the same double.
        const Rupture other = simulate(fault, {.t_end = 20,
                                               .step = 0.01 * fault.time_unit(),
                                               .rtol = std::numeric_limits<double>::infinity()});
        EXPECT_EQ(episode.trial.final_error, std::abs(run.mean_slip / other.mean_slip - 1));
    }
}

TEST(StepEnvironment, AConstantActionIsAConstantStepOfAnInclusion)
{
    // The problem's rule for changes of branch.
    const StepEnvironment runs = step_environment(DiodeCircuit{}, DiodeCircuit::start(), 5,
                                                  {.first_stage = FirstStage::switch_aware});
    const StepProblem problem = diode_circuit_problem(DiodeCircuit{}, DiodeCircuit::start(), 5);
    const double h = runs.length_of(runs.action_of(0.02));
    const Episode episode = constant(runs, 0.02);
    const StepTrial run =
        problem.run({.controller = ConstantStep{}, .step = h / problem.usual_step});
    EXPECT_EQ(episode.trial.steps, run.steps);
    // h / usual_step * usual_step is h up to a rounding, by which the errors then differ.
    EXPECT_NEAR(episode.trial.error, run.error, 1e-12);
    EXPECT_NEAR(episode.trial.final_error, run.final_error, 1e-12);
}

// Without a discount equation 7 rewards the time covered, independently of the number of steps: the
// sum of (h - h_min) / (h_max - h_min) is (T - n h_min) / (h_max - h_min).
TEST(StepEnvironment, ThePublishedReturnTelescopes)
{
    const double t_end = 0.5;
    const StepEnvironmentOptions options{
        .alpha = 0, .scale = StepScale::linear, .h_min = 1e-4, .h_max = 1e-2};
    const StepEnvironment runs = step_environment(SlidingMode{}, 0.15, t_end, options);
    const auto expected = [&](const Episode& episode) {
        return (t_end - static_cast<double>(episode.attempts) * options.h_min) /
               (options.h_max - options.h_min);
    };
    Random random(3);
    const Episode wild = act(runs, [&] { return random.uniform(-1, 1); });
    const Episode large = act(runs, [] { return 1.0; });
    const Episode small = act(runs, [] { return -0.9; });
    // Each term is off by roundings of times of order 1 over a range of 1e-2.
    for (const Episode& episode : {wild, large, small}) {
        EXPECT_TRUE(episode.terminal);
        EXPECT_NEAR(episode.undiscounted, expected(episode),
                    1e-14 * static_cast<double>(episode.attempts));
    }
    EXPECT_EQ(large.attempts, 50U);
    EXPECT_GT(small.attempts, 700U);
}

// So the error alone decides: among constant steps the smallest have the largest return.
TEST(StepEnvironment, ThePublishedReturnIsLargestForTheSmallestSteps)
{
    StepEnvironmentOptions options = published_step_environment();
    options.expensive = 1e9;  // solves cost nothing
    const StepEnvironment runs = step_environment(StrikeSlipFault({.elements = 1}), 30, options);
    const double coarse = constant(runs, 0.3).undiscounted;
    const double fine = constant(runs, 0.003).undiscounted;
    EXPECT_GT(fine, coarse + 1);
    EXPECT_LT(fine, 5);
}

template <class World>
void sums_to_cost(const World& make, double t)
{
    StepEnvironmentOptions options{
        .reward = StepReward::additive, .lambda = 70, .work_unit = 3, .h_min = 1e-3 * t};
    options.h_max = 0.03 * t;
    const StepEnvironment runs = make(options);
    Random random(5);
    const Episode episode = act(runs, [&] { return random.uniform(-1, 1); });
    EXPECT_TRUE(episode.trial.ended);
    const double error = episode.trial.error;
    const double cost = episode.trial.work / 3 + 70 * error * error;
    EXPECT_GT(error, 0);
    // Sums of some hundred terms.
    EXPECT_NEAR(episode.undiscounted, -cost, 1e-11 * cost);
}

TEST(StepEnvironment, AdditiveRewardsAreMinusTheCostOfTheRun)
{
    sums_to_cost([](const auto& o) { return step_environment(SlidingMode{}, 0.15, 0.5, o); }, 0.5);
    sums_to_cost(
        [](const auto& o) {
            return step_environment(DiodeCircuit{}, DiodeCircuit::start(), 20, o);
        },
        20);
    for (const bool until_rest : {false, true}) {
        sums_to_cost(
            [&](StepEnvironmentOptions o) {
                o.until_rest = until_rest;
                return step_environment(StrikeSlipFault({.elements = 1}), 30, o);
            },
            30);
    }
}

// Steps of a fault that are too long have no solution: nothing moves, and finally the episode ends.
TEST(StepEnvironment, StepsWithoutASolutionArePunished)
{
    const StepEnvironmentOptions options{.scale = StepScale::linear, .h_min = 0.01};
    const StepEnvironment runs = step_environment(StrikeSlipFault({.elements = 1}), 30, options);
    const Episode episode = act(runs, [] { return 1.0; });
    EXPECT_TRUE(episode.terminal);
    EXPECT_EQ(episode.attempts, static_cast<std::uint64_t>(step_environment_failures));
    EXPECT_DOUBLE_EQ(episode.undiscounted, -step_environment_failures);
    EXPECT_FALSE(episode.trial.ended);
    EXPECT_EQ(episode.trial.steps, 0U);
}

// Sums of a state of 1e308 overflow: infinity minus infinity.
TEST(StepEnvironment, ANotANumberEndsTheEpisode)
{
    for (const ErrorEstimate estimate : {ErrorEstimate::none, ErrorEstimate::embedded}) {
        const StepEnvironment runs = step_environment(
            SlidingMode{}, 1e308, 0.005, {.h_min = 1e-3, .h_max = 2e-3, .estimate = estimate});
        const Episode episode = constant(runs, 2e-3);
        EXPECT_TRUE(episode.terminal);
        EXPECT_EQ(episode.attempts, 1U);
        EXPECT_TRUE(std::isfinite(episode.undiscounted));
        EXPECT_LT(episode.undiscounted, 0);
        EXPECT_FALSE(episode.trial.ended);
    }
}

TEST(StepEnvironment, AttemptsAreLimited)
{
    const StepEnvironment runs = step_environment(SlidingMode{}, 0.15, 0.5, {.max_attempts = 7});
    const Episode episode = act(runs, [] { return 0.0; });
    EXPECT_FALSE(episode.terminal);
    EXPECT_EQ(episode.attempts, 7U);
}

// A policy with a constant output.
TEST(StepEnvironment, PoliciesAreFollowed)
{
    const StepEnvironment runs = step_environment(SlidingMode{}, 0.15, 0.5, {.h_min = 1e-4});
    Model policy;
    policy.layers.push_back(
        {.inputs = 9, .outputs = 1, .weight = std::vector<double>(9, 0), .bias = {0.5}});
    const StepTrial trial = follow(runs, policy);
    const Episode episode = act(runs, [] { return std::tanh(0.5); });
    EXPECT_TRUE(trial.ended);
    EXPECT_EQ(trial.steps, episode.trial.steps);
    EXPECT_EQ(trial.error, episode.trial.error);
    policy.layers[0].inputs = 8;
    policy.layers[0].weight.pop_back();
    EXPECT_THROW((void)follow(runs, policy), std::invalid_argument);
}

TEST(StepEnvironment, RefusesOptionsThatCannotBe)
{
    const double nan = std::nan("");
    const auto refused = [](const StepEnvironmentOptions& options) {
        EXPECT_THROW((void)step_environment(SlidingMode{}, 0.15, 0.5, options),
                     std::invalid_argument);
    };
    for (const double bad : {-1.0, nan}) {
        refused({.alpha = bad});
        refused({.expensive = bad});
        refused({.lambda = bad});
        refused({.work_unit = bad});
        refused({.h_min = bad});
        refused({.h_max = bad});
        refused({.tolerance = bad});
    }
    refused({.h_min = 0.1, .h_max = 0.05});
    refused({.max_attempts = 0});
    // The free estimate does not apply to the source's first stage.
    refused({.first_stage = FirstStage::at_end});
}

}  // namespace
}  // namespace ricochet::learn::step_environment_test
