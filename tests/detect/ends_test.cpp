#include "ricochet/detect/ends.hpp"

#include <gtest/gtest.h>

#include "host_step.hpp"

namespace ricochet {
namespace {

using test::HostStep;
using test::look;

HostStep line(double from, double to)
{
    return {1.0, [=](double s) { return from + s * (to - from); },
            [=](double) { return to - from; }};
}

TEST(Ends, AStepThatEndsAcrossTheSurfaceIsAHit)
{
    const Finding finding = look(Ends{}, line(1, -1), Side::above, Crossing::falling);
    ASSERT_TRUE(finding.hit);
    EXPECT_EQ(finding.lo.s, 0);
    EXPECT_EQ(finding.hi.s, 1);
    EXPECT_EQ(finding.hi.value, -1);
}

TEST(Ends, OneGuardCallAStepIsAllItCosts)
{
    std::uint64_t calls = 0;
    (void)look(Ends{}, line(1, 0.5), Side::above, Crossing::falling, &calls);
    EXPECT_EQ(calls, 1u);
}

TEST(Ends, TheOppositeCrossingIsNotAHit)
{
    EXPECT_FALSE(look(Ends{}, line(-1, 1), Side::below, Crossing::falling).hit);
}

TEST(Ends, AStartOnTheSurfaceIsJudgedByTheArmedSide)
{
    EXPECT_TRUE(look(Ends{}, line(0, -1), Side::above, Crossing::falling).hit);
    EXPECT_FALSE(look(Ends{}, line(0, 1), Side::above, Crossing::falling).hit);
}

TEST(Ends, TwoCrossingsInOneStepAreMissedAndTheEvidenceSaysSo)
{
    const HostStep dip(
        1.0, [](double s) { return (s - 0.4) * (s - 0.6); }, [](double s) { return 2 * s - 1; });
    const Finding finding = look(Ends{}, dip, Side::above, Crossing::falling);
    EXPECT_FALSE(finding.hit);
    EXPECT_EQ(finding.evidence, Evidence::assumed);
}

}  // namespace
}  // namespace ricochet
