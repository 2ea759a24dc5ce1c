// Training policies that choose steps: curves of work, scores, resuming, prescribed steps.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <vector>

#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/learn_steps/step_control.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::learn::step_training_test {
namespace {

LearnedStep rule_of(const StepLayout& layout, const std::vector<double>& weights = {})
{
    return {.policy = std::make_shared<const StepPolicy>(step_policy_model(layout, weights))};
}

TEST(WorkCurve, FindsTheWorkAfterWhichTheErrorStaysBelow)
{
    WorkCurve curve;
    // The low error of the second point is accidental: the third is above it.
    for (const auto& [work, error] : {std::pair{0.0, 0.0}, {1.0, -4.0}, {2.0, -2.0}, {3.0, -4.0}}) {
        curve.add(work, error);
    }
    curve.finish();
    EXPECT_DOUBLE_EQ(curve.work_at(-3), 2.5);
    EXPECT_DOUBLE_EQ(curve.work_at(-4), 3);
    // Beyond the ends the curve has order 2: four times less error for twice the work.
    EXPECT_DOUBLE_EQ(curve.work_at(-6), 4);
    EXPECT_DOUBLE_EQ(curve.work_at(2), -1);
}

// Constant steps on the sliding mode, whose solution is known: second order before the switch.
TEST(StepProblem, ErrorsAreTrue)
{
    const StepProblem problem = sliding_mode_problem(SlidingMode{}, 0.15, 0.06);
    const auto error = [&](double step) {
        return problem.run({.controller = ConstantStep{}, .step = step}).error;
    };
    const double order = std::log2(error(1) / error(0.5));
    EXPECT_NEAR(order, 2, 0.1);
    const StepTrial trial = problem.run({.tolerance = 1e-3});
    EXPECT_TRUE(trial.ended);
    EXPECT_EQ(trial.work, static_cast<double>(trial.solves));
}

TEST(StepProblem, PrescribedStepsAreTaken)
{
    const StepProblem problem = sliding_mode_problem(SlidingMode{}, 0.15, 0.06);
    const auto lengths =
        std::make_shared<const std::vector<double>>(std::vector<double>{0.01, 0.02, 0.005, 0.0125});
    const StepTrial trial = problem.run({.controller = PrescribedSteps{.lengths = lengths}});
    EXPECT_TRUE(trial.ended);
    // 0.0475, and a last one for the remainder.
    EXPECT_EQ(trial.steps, 5U);
    const auto none = std::make_shared<const std::vector<double>>(std::vector<double>{0.01, 0});
    EXPECT_THROW((void)problem.run({.controller = PrescribedSteps{.lengths = none}}),
                 std::invalid_argument);
}

TEST(StepProblem, SearchedStepsAreBetterThanEvenOnes)
{
    const StepProblem problem =
        sliding_mode_problem(SlidingMode{}, SlidingMode::start, SlidingMode::t_end);
    const SearchedSteps found = search_steps(problem, 12, 400, 1, 1);
    ASSERT_TRUE(found.trial.ended);
    EXPECT_LE(found.trial.steps, 13U);
    const double even = SlidingMode::t_end / 12 / problem.usual_step;
    EXPECT_LT(found.trial.error,
              0.9 * problem.run({.controller = ConstantStep{}, .step = even}).error);
}

TEST(StepScore, OfTheClassicalRuleIsNearZero)
{
    const StepFamily family = sliding_mode_family(3, 6);
    const StepScore score(family, 1);
    const LearnedStep plain = rule_of(family.layout);
    for (const StepScore::Part& part : score.parts(plain)) {
        // Its own curve is one of the two with which it is compared, at tolerances between those
        // of the curve: it is no better, and as irregular as six problems are.
        EXPECT_LT(part.gain, 0.15);
        EXPECT_EQ(part.off, 0.0);
        EXPECT_EQ(part.failed, 0.0);
    }
    EXPECT_EQ(score(plain), score(plain));
    // A constant factor of e^2 or e^-2 on all steps scores worse.
    for (const double value : {-2.0, 2.0}) {
        std::vector<double> weights(step_policy_weights, 0.0);
        weights.back() = value;
        EXPECT_GT(score(rule_of(family.layout, weights)), score(plain));
    }
}

TEST(StepTraining, ImprovesAndResumesToTheSameBits)
{
    const StepFamily family = sliding_mode_family(5, 2);
    const auto directory =
        std::filesystem::temp_directory_path() / ("step-training-" + std::to_string(getpid()));
    std::filesystem::create_directories(directory);
    const StepTrainingOptions whole{.seed = 7, .evaluations = 101, .threads = 1};
    const TrainedStepPolicy once = train_step_policy(family, whole);
    const StepScore score(family, 1);
    EXPECT_LT(once.search.score, score(rule_of(family.layout)));
    EXPECT_FALSE(once.model.domain.empty());

    StepTrainingOptions parts = whole;
    parts.checkpoint = directory / "half";
    (void)train_step_policy(family, parts,
                            [](const EvolutionProgress& now) { return now.generation < 3; });
    parts.resume = true;
    const TrainedStepPolicy again = train_step_policy(family, parts);
    EXPECT_EQ(again.search.x, once.search.x);
    EXPECT_EQ(again.search.score, once.search.score);
    EXPECT_EQ(again.model.layers.back().weight, once.model.layers.back().weight);
    EXPECT_EQ(again.model.domain.front().lower, once.model.domain.front().lower);
    std::filesystem::remove_all(directory);
}

TEST(StepTraining, StopsInTheMidstOfARunAndResumesToTheSameBits)
{
    // Interrupts in the classical rules that are run first, in the search, and after it.
    const StepFamily family = sliding_mode_family(5, 1);
    const auto directory =
        std::filesystem::temp_directory_path() / ("step-stopping-" + std::to_string(getpid()));
    std::filesystem::create_directories(directory);
    StepTrainingOptions options{.seed = 7, .evaluations = 41, .threads = 1};
    std::size_t asked = 0;
    std::size_t most = std::numeric_limits<std::size_t>::max();
    options.goes_on = [&] { return ++asked <= most; };
    const TrainedStepPolicy once = train_step_policy(family, options);
    const std::size_t all = asked;
    for (const double share : {0.001, 0.5, 0.8, 0.999}) {
        options.checkpoint = directory / std::to_string(share);
        options.resume = false;
        most = static_cast<std::size_t>(share * static_cast<double>(all));
        asked = 0;
        const TrainedStepPolicy part = train_step_policy(family, options);
        EXPECT_EQ(part.search.outcome, EvolutionOutcome::stopped);
        EXPECT_LE(asked, most + 3) << "asked on after it was told to stop";
        options.resume = std::filesystem::exists(options.checkpoint);
        EXPECT_EQ(options.resume, share > 0.01);
        most = std::numeric_limits<std::size_t>::max();
        const TrainedStepPolicy again = train_step_policy(family, options);
        EXPECT_EQ(again.search.x, once.search.x);
        EXPECT_EQ(again.model.domain.front().lower, once.model.domain.front().lower);
    }
    std::filesystem::remove_all(directory);
}

TEST(StepFamily, ProblemsFollowFromTheirSeed)
{
    const FaultFamilyOptions options{.seed = 4, .counts = {2, 1}};
    const StepFamily one = fault_family(options);
    const StepFamily other = fault_family(options);
    ASSERT_EQ(one.problems.size(), 3U);
    EXPECT_EQ(one.problems[2].group, 2);
    for (std::size_t i = 0; i < one.problems.size(); ++i) {
        EXPECT_EQ(one.problems[i].description, other.problems[i].description);
        const StepTrial a = one.problems[i].run({.tolerance = 1e-2});
        const StepTrial b = other.problems[i].run({.tolerance = 1e-2});
        EXPECT_TRUE(a.ended);
        EXPECT_EQ(a.error, b.error);
        // The rule is of third order in the local error: a thousandth of the tolerance, about
        // a hundredth of the error.
        EXPECT_LT(one.problems[i].run({.tolerance = 1e-5}).error, 0.05 * a.error);
    }
}

}  // namespace
}  // namespace ricochet::learn::step_training_test
