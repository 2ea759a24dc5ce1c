// As random_flows_test.cpp, with twenty thousand systems of each family and another seed.
#include <gtest/gtest.h>

#include "taylor/random_flows.hpp"

namespace ricochet::random_flows_full_test {
namespace {

template <class System>
class TaylorOnRandomFlowsInFull : public testing::Test {
};
using Families =
    testing::Types<test::Recorded2<test::PolynomialFlow>, test::Recorded2<test::TrigonometricFlow>,
                   test::Recorded2<test::RationalFlow>, test::MovingWall, test::RoundWall>;
TYPED_TEST_SUITE(TaylorOnRandomFlowsInFull, Families);

TYPED_TEST(TaylorOnRandomFlowsInFull, FindsTheEventsOfTheMotionInLongDouble)
{
    test::Draw draw(2026);
    test::RandomRuns runs;
    for (int k = 0; k < 20'000; ++k) test::compare_random_run<TypeParam>(draw, runs);
    EXPECT_EQ(runs.missed, 0U) << runs.first;
    EXPECT_EQ(runs.spurious, 0U) << runs.first;
    EXPECT_EQ(runs.misplaced, 0U) << runs.first << ", " << runs.worst;
}

}  // namespace
}  // namespace ricochet::random_flows_full_test
