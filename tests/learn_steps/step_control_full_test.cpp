// Steps chosen by trained networks against classical rules, at equal true error, on faults and
// inclusions that were not in the training.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/learn_steps/policies.hpp"
#include "ricochet/learn_steps/step_control.hpp"
#include "ricochet/learn_steps/step_environment.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::step_control_full_test {
namespace {

using learn::StepEnvironmentOptions;
using learn::StepProblem;
using learn::StepRule;
using learn::StepTrial;
using learn::WorkCurve;

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr int seeds = 5;

/// The policies of five seeds of training.
Model policy(const std::string& system, int seed)
{
    return load_model(std::string(RICOCHET_TEST_FIXTURES) + "/step_policies/" + system + "-step-" +
                      std::to_string(seed) + ".safetensors");
}

LearnedStep learned(const std::string& system, int seed)
{
    return {.policy = std::make_shared<const StepPolicy>(policy(system, seed))};
}

double median(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

/// Rules from coarse to fine about an error of 1e-2: tolerances from 0.01 to 4e-4.
template <class Make>
std::vector<StepRule> ladder(const Make& make)
{
    std::vector<StepRule> out;
    for (int i = 0; i <= 8; ++i) out.push_back(make(0.01 * std::pow(10.0, -i / 6.0)));
    return out;
}

std::vector<StepRule> constant()
{
    std::vector<StepRule> out;
    for (int i = 0; i <= 9; ++i) {
        out.push_back({.controller = ConstantStep{}, .step = 4 * std::pow(10.0, -i / 10.0)});
    }
    return out;
}

std::vector<StepRule> embedded(const StepController& controller)
{
    return ladder([&](double tolerance) {
        return StepRule{.controller = controller, .tolerance = tolerance};
    });
}

/// Iterations with which a ladder of rules solves a problem, by its error; errors are averaged over
/// 15 % of work.
struct Needs {
    WorkCurve of_velocity, of_final;

    [[nodiscard]] double at(double error) const
    {
        return std::exp(of_velocity.work_at(std::log(error)));
    }
    [[nodiscard]] double at_final(double error) const
    {
        return std::exp(of_final.work_at(std::log(error)));
    }
};

Needs needs(const StepProblem& problem, const std::vector<StepRule>& rules)
{
    std::vector<StepTrial> trials(rules.size());
    std::thread other([&] {
        for (std::size_t i = 1; i < rules.size(); i += 2) trials[i] = problem.run(rules[i]);
    });
    for (std::size_t i = 0; i < rules.size(); i += 2) trials[i] = problem.run(rules[i]);
    other.join();
    Needs out;
    for (const StepTrial& t : trials) {
        if (!t.ended) continue;
        const double work = std::log(static_cast<double>(std::max(t.iterations, 1ul)));
        out.of_velocity.add(work, std::log(t.error));
        out.of_final.add(work, std::log(std::max(t.final_error, 1e-12)));
    }
    out.of_velocity.finish(0.15);
    out.of_final.finish(0.15);
    return out;
}

struct Mesh {
    int elements;
    double side;   ///< [m]
    double t_end;  ///< [s]
};

class LearnedSteps : public testing::TestWithParam<Mesh> {};

TEST_P(LearnedSteps, TakeFewerIterationsThanRulesAndConstantSteps)
{
    // The median of five seeds, at an error of 1e-2 of the velocity.
    const auto& [elements, side, t_end] = GetParam();
    const double target = 1e-2;
    const StepProblem problem =
        learn::fault_problem(StrikeSlipFault({.elements = elements, .side = side}), t_end);
    double classical = inf;  // the best rule that examines errors
    const auto add_rule = [&](const StepController& controller) {
        classical = std::min(classical, needs(problem, embedded(controller)).at(target));
    };
    add_rule(ErrorStep{.order = 3, .reject_above = 100});
    add_rule(ErrorStep{.order = 3, .reject_above = inf});
    if (elements == 10) {  // far behind on the others
        FilteredStep filter = FilteredStep::h211b(4);
        filter.order = 2;
        add_rule(filter);
        add_rule(ErrorStep{.order = 3, .reject_above = 1});
    }
    const double heuristic = needs(problem, ladder([](double tolerance) {
                                       return StepRule{.controller = HeuristicStep{},
                                                       .tolerance = tolerance,
                                                       .estimate = ErrorEstimate::doubling};
                                   }))
                                 .at(target);
    std::vector<double> iterations, slips;
    for (int seed = 1; seed <= seeds; ++seed) {
        const Needs of_policy = needs(problem, embedded(learned("fault", seed)));
        iterations.push_back(of_policy.at(target));
        slips.push_back(of_policy.at_final(1e-3));
    }
    const double mine = median(iterations);
    EXPECT_GE(classical / mine, 1.3);
    EXPECT_GE(heuristic / mine, 2);
    EXPECT_GE(needs(problem, constant()).at(target) / mine, side < 4000 ? 1.5 : 2);
    RecordProperty("iterations_for_a_final_slip_to_a_thousandth", std::to_string(median(slips)));
}

INSTANTIATE_TEST_SUITE_P(Meshes, LearnedSteps,
                         testing::Values(Mesh{10, 3000, 30}, Mesh{25, 3000, 30}, Mesh{50, 3000, 30},
                                         Mesh{10, 5000, 50}, Mesh{25, 5000, 50},
                                         Mesh{50, 5000, 50}));

/// The median over the seeds of the mean gain on a family held out, by tolerance.
double gain_on(const learn::StepFamily& family, const std::string& system, int count)
{
    const learn::StepScore score(family, 2);
    std::vector<double> gains;
    for (int seed = 1; seed <= count; ++seed) {
        const auto parts = score.parts(learned(system, seed));
        double sum = 0;
        for (const auto& part : parts) sum += part.gain;
        gains.push_back(std::exp(sum / static_cast<double>(parts.size())));
    }
    return median(gains);
}

TEST(LearnedStepsInFull, AreNoWorseOnProblemsHeldOut)
{
    EXPECT_GE(gain_on(learn::fault_family({.seed = 1'000'099}), "fault", seeds), 1);
    EXPECT_GE(gain_on(learn::sliding_mode_family(1'000'099, 64), "sliding-mode", seeds), 1.25);
    EXPECT_GE(gain_on(learn::diode_circuit_family(1'000'099, 64), "diode-circuit", 1), 0.95);
}

TEST(StepTrainingInFull, GivesTheStoredWeightsWithinThreeMinutesOfTwoCores)
{
    const std::clock_t start = std::clock();
    const auto trained = learn::train_step_policy(learn::fault_family(), {});
    EXPECT_LE(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC / 2, 180);
    EXPECT_EQ(policy("fault", 1).layers.front().weight, trained.model.layers.front().weight);
}

TEST(LearnedStepsInFull, ReachAnErrorOfAHundredthWhereTheyWereNotTrained)
{
    const auto policy =
        std::make_shared<const StepPolicy>(load_model(RICOCHET_MODELS "/fault-step.safetensors"));
    constexpr ErrorStep plain{.order = 3, .reject_above = 100};
    for (StrikeSlipFault::Parameters p : std::vector<StrikeSlipFault::Parameters>{
             {}, {.damping = 0.05}, {.damping = 0.8}, {.side = 12000}, {.overload = 1e-2}}) {
        p.elements = 5;
        const StrikeSlipFault fault(p);
        const StepProblem problem =
            learn::fault_problem(fault, 30 / 0.8660254037844386 * fault.time_unit());
        // From some setting on, the error stays below.
        const auto stays_below = [&](const auto& rule) {
            int below = 0;
            for (int i = 0; i < 40 && below <= 4; ++i) {
                const StepTrial trial = problem.run(rule(std::pow(10.0, -i / 6.0)));
                below = trial.ended && trial.error <= 1e-2 ? below + 1 : 0;
            }
            return below > 4;
        };
        EXPECT_TRUE(stays_below([](double finer) {
            return StepRule{.controller = ConstantStep{}, .step = 8 * finer};
        }));
        EXPECT_TRUE(stays_below(
            [&](double finer) { return StepRule{.controller = plain, .tolerance = 0.1 * finer}; }));
        EXPECT_TRUE(stays_below([&](double finer) {
            return StepRule{.controller = LearnedStep{.policy = policy, .plain = plain},
                            .tolerance = 0.1 * finer};
        }));
    }
}

TEST(StepWatch, IsCalledEveryFewSecondsOfALongComparison)
{
    using Clock = std::chrono::steady_clock;
    Clock::time_point last = Clock::now();
    double longest = 0;
    const learn::StepWatch watch = [&](double) {
        const Clock::time_point now = Clock::now();
        longest = std::max(longest, std::chrono::duration<double>(now - last).count());
        last = now;
        return true;
    };
    const StrikeSlipFault fault({.elements = 7, .residual_friction = 0.3, .friction_drop = 0.4});
    const StepProblem problem = learn::fault_problem(fault, 30, 0, watch);
    for (const double tolerance : {1e-1, 1e-2, 4.6e-3, 1e-3}) {
        (void)problem.run({.controller = FilteredStep::pi3333(),
                           .tolerance = tolerance,
                           .estimate = ErrorEstimate::doubling,
                           .watch = watch});
    }
    (void)learn::search_steps(problem, 70, 100, 1, 2, watch);
    EXPECT_LE(longest, 2);
}

TEST(StepEnvironmentInFull, TheAdditiveRewardLearnsStepsThatAreLessWrong)
{
    const auto trial = [](StepEnvironmentOptions options, double discount) {
        const StrikeSlipFault fault;
        const learn::TrainedPolicy trained =
            learn::train_tqc(learn::step_environment(fault, 30, options).environment,
                             {.training = {.steps = 10'000, .discount = discount}});
        options.until_rest = true;
        options.max_attempts = 5000;
        return learn::follow(learn::step_environment(fault, 30, options), trained.policy);
    };
    const StepTrial published = trial(learn::published_step_environment(2), 0.99);
    const StepTrial additive = trial({.reward = learn::StepReward::additive,
                                      .lambda = 1000,
                                      .h_min = 0.03,
                                      .h_max = 1.5,
                                      .until_rest = true},
                                     1);
    EXPECT_TRUE(published.ended);
    EXPECT_TRUE(additive.ended);
    EXPECT_LT(additive.error, published.error);
}

}  // namespace
}  // namespace ricochet::step_control_full_test
