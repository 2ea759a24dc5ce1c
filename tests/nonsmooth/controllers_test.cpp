// Step controllers: their formulas. Their common properties are in conformance/controllers.hpp.

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>
#include <stdexcept>
#include <vector>

#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet::controllers_test {
namespace {

TEST(StepControllers, TheHeuristicGrowsByErrorToTheMinusQAtMostTwice)
{
    HeuristicStep rule;  // order 1: q = 1/2
    EXPECT_TRUE(rule.judge(0.5, 1).accepted);
    EXPECT_DOUBLE_EQ(rule.judge(0.5, 1).factor, std::sqrt(2.0));
    EXPECT_DOUBLE_EQ(rule.judge(1e-4, 1).factor, 2);
    EXPECT_EQ(rule.judge(0, 1).factor, 2);
    EXPECT_FALSE(rule.judge(4, 1).accepted);
    EXPECT_DOUBLE_EQ(rule.judge(4, 1).factor, 0.5);
    EXPECT_EQ(rule.failed(), 0.6);
}

TEST(StepControllers, TheClassicRuleRemembersTheErrorBefore)
{
    ClassicStep rule;
    EXPECT_DOUBLE_EQ(rule.judge(0.5, 1).factor, 0.9 * std::pow(0.5, -0.5));
    EXPECT_DOUBLE_EQ(rule.judge(0.8, 1).factor, 0.9 * std::pow(0.8, -0.35) * std::pow(0.5, -0.2));
    EXPECT_FALSE(rule.judge(1.1, 1).accepted);
    EXPECT_EQ(rule.judge(1.1, 1).factor, 0.6);
    rule.reset();
    EXPECT_DOUBLE_EQ(rule.judge(0.5, 1).factor, 0.9 * std::pow(0.5, -0.5));
}

TEST(StepControllers, TheFilterIsH211bAndForgetsAfterThreeRejections)
{
    FilteredStep rule = FilteredStep::h211b(4);  // k = 2: exponents 1/8, 1/8, 1/4
    const double first = std::pow(0.6, -0.125);
    EXPECT_DOUBLE_EQ(rule.judge(0.6, 1).factor, first);
    EXPECT_DOUBLE_EQ(rule.judge(0.9, 1).factor,
                     std::pow(0.9, -0.125) * std::pow(0.6, -0.125) * std::pow(first, -0.25));
    EXPECT_EQ(rule.judge(1e-9, 1).factor, 1.2);
    // Errors somewhat above 1 are accepted, as the factor stays above 0.8.
    EXPECT_TRUE(FilteredStep::h211b(4).judge(2, 1).accepted);
    FilteredStep harsh = FilteredStep::h211b(4);
    for (int i = 0; i < 3; ++i) {
        EXPECT_FALSE(harsh.judge(1e3, 1).accepted);
        EXPECT_EQ(harsh.judge(1e3, 1).factor, 0.8);
        harsh.reset();
    }
    (void)rule.judge(0.5, 1);
    (void)rule.judge(1e6, 1), (void)rule.judge(1e6, 1), (void)rule.judge(1e6, 1);
    EXPECT_DOUBLE_EQ(rule.judge(0.6, 1).factor, first);
}

TEST(StepControllers, ThePrintedPiRuleDoesNotControlTheError)
{
    // Its factor depends on the ratio of two errors alone: errors a million times larger
    // give the same steps.
    PrintedPiStep small;
    PrintedPiStep large;
    (void)small.judge(1e-9, 1), (void)large.judge(1e-3, 1);
    for (const double ratio : {0.5, 0.7, 0.9}) {
        const StepVerdict a = small.judge(1e-9 * ratio, 1);
        const StepVerdict b = large.judge(1e-3 * ratio, 1);
        EXPECT_EQ(a.accepted, b.accepted);
        EXPECT_NEAR(a.factor, b.factor, 1e-12);
    }
    // A constant error, however small, is rejected forever: 1 < c1 = 1.8.
    PrintedPiStep rule;
    EXPECT_TRUE(rule.judge(0.1, 1).accepted);
    EXPECT_FALSE(rule.judge(0.1, 1).accepted);
    EXPECT_FALSE(rule.judge(0.1, 1).accepted);
}

TEST(StepControllers, ThatCanNeitherShrinkNorGrowAStepAreRefused)
{
    const double nan = std::nan("");
    const double infinity = std::numeric_limits<double>::infinity();
    const std::vector<StepController> refused{
        PrintedPiStep{.gamma1 = nan},
        PrintedPiStep{.gamma2 = nan},
        PrintedPiStep{.kappa = nan},
        PrintedPiStep{.kappa = infinity},
        PrintedPiStep{.c1 = nan},
        PrintedPiStep{.c1 = infinity},
        PrintedPiStep{.c2 = nan},
        PrintedPiStep{.c2 = 0.5},
        ClassicStep{.safety = nan},
        ClassicStep{.safety = -1},
        ErrorStep{.rule = {.safety = nan}},
        ErrorStep{.rule = {.smallest = 0}},
        ErrorStep{.rule = {.smallest = 1}},
        ErrorStep{.rule = {.largest = 1}},
        ErrorStep{.rule = {.largest = nan}},
    };
    for (std::size_t k = 0; k < refused.size(); ++k) {
        EXPECT_THROW(validate(refused[k]), std::invalid_argument) << k;
    }
    for (const StepController& accepted :
         std::initializer_list<StepController>{PrintedPiStep{}, ClassicStep{}, ErrorStep{}}) {
        EXPECT_NO_THROW(validate(accepted));
    }
}

}  // namespace
}  // namespace ricochet::controllers_test
