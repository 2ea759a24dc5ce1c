#include "ricochet/learn/data_set.hpp"

#include <algorithm>
#include <limits>
#include <set>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace ricochet::learn::data_set_test {
namespace {

/// Each state is its own number; every third is an event.
DataSet numbered(std::size_t n)
{
    DataSet data{.columns = {{"number", "1"}}};
    for (std::size_t i = 0; i < n; ++i) {
        const std::vector<double> row{static_cast<double>(i)};
        data.append(row, i % 3 == 0, i % 3 == 0 ? -1 : 1);
    }
    return data;
}

TEST(DataSet, SplitIsDisjointCompleteAndKeepsTheBalance)
{
    const DataSet data = numbered(3000);
    const Split parts = split(data, 0.1, 7);

    EXPECT_EQ(parts.held_out.size(), 300U);
    EXPECT_EQ(parts.held_out.events(), 100U);
    EXPECT_EQ(parts.kept.events(), 900U);
    const std::set<double> kept(parts.kept.features.begin(), parts.kept.features.end());
    const std::set<double> held_out(parts.held_out.features.begin(), parts.held_out.features.end());
    std::vector<double> common;
    std::set_intersection(kept.begin(), kept.end(), held_out.begin(), held_out.end(),
                          std::back_inserter(common));
    EXPECT_TRUE(common.empty());
    EXPECT_EQ(kept.size() + held_out.size(), data.size());
}

TEST(DataSet, SplitDependsOnTheSeedAlone)
{
    const DataSet data = numbered(300);
    EXPECT_EQ(split(data, 0.1, 7).held_out.features, split(data, 0.1, 7).held_out.features);
    EXPECT_NE(split(data, 0.1, 7).held_out.features, split(data, 0.1, 8).held_out.features);
}

TEST(DataSet, SplitRefusesAShareThatIsNone)
{
    EXPECT_THROW((void)split(numbered(9), -0.1, 1), std::invalid_argument);
    EXPECT_THROW((void)split(numbered(9), 1.1, 1), std::invalid_argument);
    EXPECT_THROW((void)split(numbered(9), std::numeric_limits<double>::quiet_NaN(), 1),
                 std::invalid_argument);
}

TEST(DataSet, CheckNamesTheStateAndColumnThatAreNotFinite)
{
    DataSet data = numbered(5);
    EXPECT_NO_THROW(check(data));
    data.features[3] = std::numeric_limits<double>::infinity();
    try {
        check(data);
        FAIL() << "an infinite feature was accepted";
    } catch (const std::invalid_argument& error) {
        EXPECT_NE(std::string(error.what()).find("state 3, column 'number'"), std::string::npos);
    }
}

TEST(DataSet, CheckRefusesPartsThatDoNotFit)
{
    DataSet data = numbered(5);
    data.features.pop_back();
    EXPECT_THROW(check(data), std::invalid_argument);
    data = numbered(5);
    data.margins.pop_back();
    EXPECT_THROW(check(data), std::invalid_argument);
    data = numbered(5);
    data.labels[0] = 2;
    EXPECT_THROW(check(data), std::invalid_argument);
}

TEST(DataSet, JoinKeepsEveryState)
{
    const DataSet both = join(numbered(5), numbered(4));
    EXPECT_EQ(both.size(), 9U);
    EXPECT_EQ(both.features[5], 0);
    DataSet wide = numbered(0);
    wide.columns.push_back({"other", "1"});
    EXPECT_THROW((void)join(wide, both), std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::learn::data_set_test
