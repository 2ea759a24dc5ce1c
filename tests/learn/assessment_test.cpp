#include "ricochet/learn/assessment.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace ricochet::learn::assessment_test {
namespace {

/// logit = x.
Model identity(double threshold)
{
    Model model;
    model.offset = {0};
    model.scale = {1};
    model.threshold = threshold;
    model.layers = {{.inputs = 1, .outputs = 1, .weight = {1}, .bias = {0}}};
    return model;
}

DataSet states(const std::vector<double>& x, const std::vector<double>& margins)
{
    DataSet data{.columns = {{"x", "1"}}};
    for (std::size_t i = 0; i < x.size(); ++i) {
        data.append({&x[i], 1}, margins[i] <= 0, margins[i]);
    }
    return data;
}

TEST(Assessment, CountsEachAnswerOnce)
{
    // Events at 2, 1 (on the threshold: an alarm) and 0; clear states at 3 and -1,
    // and at -2 inside the band.
    const Assessment a =
        assess(identity(1), states({2, 1, 0, 3, -1, -2}, {-0.5, -0.1, 0, 0.2, 0.3, 0.05}));
    EXPECT_EQ(a.confusion.detected, 2U);
    EXPECT_EQ(a.confusion.missed, 1U);
    EXPECT_EQ(a.confusion.false_alarms, 1U);
    EXPECT_EQ(a.confusion.cleared, 2U);
    EXPECT_DOUBLE_EQ(a.false_alarm_rate, 1.0 / 3);
    EXPECT_EQ(a.well_clear, 2U);
    EXPECT_DOUBLE_EQ(a.cleared_share, 0.5);
    EXPECT_EQ(a.lowest_event, 0);
}

TEST(Assessment, NotANumberIsAnAlarm)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const Assessment a = assess(identity(0), states({nan, nan}, {-1, 1}));
    EXPECT_EQ(a.confusion.detected, 1U);
    EXPECT_EQ(a.confusion.false_alarms, 1U);
}

TEST(Assessment, RefusesDataOfAnotherWidth)
{
    DataSet data = states({1}, {1});
    data.columns.push_back({"y", "1"});
    EXPECT_THROW((void)assess(identity(0), data), std::invalid_argument);
}

TEST(Assessment, MissBoundIsThreeOverNWithoutMissesAndClopperPearsonWith)
{
    EXPECT_EQ(miss_bound(0, 30'000), 1e-4);
    EXPECT_EQ(miss_bound(0, 0), 1);
    EXPECT_EQ(miss_bound(0, 2), 1);
    EXPECT_EQ(miss_bound(5, 5), 1);
    // By definition, so few misses have probability 0.05 at the bound.
    const double p = miss_bound(1, 100);
    EXPECT_NEAR(std::pow(1 - p, 100) + 100 * p * std::pow(1 - p, 99), 0.05, 1e-12);
}

}  // namespace
}  // namespace ricochet::learn::assessment_test
