// As property_test.cpp, with a hundred thousand systems of another seed.

#include <gtest/gtest.h>

#include "property_check.hpp"

namespace ricochet::property_full_test {
namespace {

TEST(RandomSystems, AHundredThousandOfThemLoseAndInventNothing)
{
    const test::PropertyReport report = test::check_random_systems(2, 100'000);
    EXPECT_EQ(report.unfinished, 0u) << report.first_wrong;
    EXPECT_EQ(report.missed, 0u) << report.first_wrong;
    EXPECT_EQ(report.spurious, 0u) << report.first_wrong;
    EXPECT_EQ(report.misplaced, 0u) << report.first_wrong;
    EXPECT_EQ(report.astray, 0u) << report.first_wrong;
    EXPECT_EQ(report.order_dependent, 0u) << report.first_wrong;
}

}  // namespace
}  // namespace ricochet::property_full_test
