// Random systems against motions in long double; random_flows_full_test.cpp runs many more.
#include "taylor/random_flows.hpp"

#include <gtest/gtest.h>

namespace ricochet::random_flows_test {
namespace {

template <class System>
class TaylorOnRandomFlows : public testing::Test {
};
using Families =
    testing::Types<test::Recorded2<test::PolynomialFlow>, test::Recorded2<test::TrigonometricFlow>,
                   test::Recorded2<test::RationalFlow>, test::MovingWall, test::RoundWall>;
TYPED_TEST_SUITE(TaylorOnRandomFlows, Families);

TYPED_TEST(TaylorOnRandomFlows, FindsTheEventsOfTheMotionInLongDouble)
{
    test::Draw draw(7);
    test::RandomRuns runs;
    for (int k = 0; k < 60; ++k) test::compare_random_run<TypeParam>(draw, runs);
    EXPECT_EQ(runs.missed, 0U) << runs.first;
    EXPECT_EQ(runs.spurious, 0U) << runs.first;
    EXPECT_EQ(runs.misplaced, 0U) << runs.first << ", " << runs.worst;
    EXPECT_GT(runs.events, 60U);
    EXPECT_LT(runs.doubtful, 20U);
}

}  // namespace
}  // namespace ricochet::random_flows_test
