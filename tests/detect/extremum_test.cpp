#include "ricochet/detect/extremum.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_step.hpp"

namespace ricochet {
namespace {

using test::HostStep;
using test::look;

/// (s - 1/2)^2 - depth over [0, 1]: two crossings where depth > 0.
HostStep dip(double depth)
{
    return {1.0, [=](double s) { return (s - 0.5) * (s - 0.5) - depth; },
            [](double s) { return 2 * s - 1; }};
}

TEST(Extremum, TwoCrossingsInOneStepAreFoundAndTheFirstIsBracketed)
{
    const Finding finding = look(Extremum{}, dip(0.01), Side::above, Crossing::falling);
    ASSERT_TRUE(finding.hit);
    EXPECT_EQ(finding.lo.s, 0);
    EXPECT_GT(finding.hi.s, 0.4);  // the roots are 0.4 and 0.6
    EXPECT_LT(finding.hi.s, 0.6);
    EXPECT_LE(finding.hi.value, 0);
}

TEST(Extremum, ADipOfOnePartIn1e12IsFound)
{
    EXPECT_TRUE(look(Extremum{}, dip(1e-12), Side::above, Crossing::falling).hit);
}

TEST(Extremum, ANearMissIsClearAndChecked)
{
    const Finding finding = look(Extremum{}, dip(-1e-12), Side::above, Crossing::falling);
    EXPECT_FALSE(finding.hit);
    EXPECT_EQ(finding.evidence, Evidence::checked);
}

TEST(Extremum, OfAnExcursionOnlyTheCrossingThatCountsIsBracketed)
{
    // Armed above, rising crossings count: the guard dips at 0.4, which does not
    // count, and rises again at 0.6, which does.
    const Finding finding = look(Extremum{}, dip(0.01), Side::above, Crossing::rising);
    ASSERT_TRUE(finding.hit);
    EXPECT_EQ(finding.side, Side::below);
    EXPECT_GT(finding.lo.s, 0.4);
    EXPECT_LT(finding.lo.s, 0.6);
    EXPECT_EQ(finding.hi.s, 1);
}

TEST(Extremum, AnExcursionSeenFromBelowIsFoundToo)
{
    const HostStep bump(
        1.0, [](double s) { return 0.01 - (s - 0.5) * (s - 0.5); },
        [](double s) { return 1 - 2 * s; });
    EXPECT_TRUE(look(Extremum{}, bump, Side::below, Crossing::rising).hit);
}

TEST(Extremum, WhereTheRateDoesNotTurnOneGuardCallSuffices)
{
    const HostStep fall(
        1.0, [](double s) { return 2 - s; }, [](double) { return -1.0; });
    std::uint64_t calls = 0;
    EXPECT_FALSE(look(Extremum{}, fall, Side::above, Crossing::falling, &calls).hit);
    EXPECT_EQ(calls, 1u);
}

TEST(Extremum, TheSearchOnAFlatBottomIsBounded)
{
    // A quartic dip: its rate is a cubic, on which superlinear methods are slow.
    const HostStep quartic(
        1.0, [](double s) { return std::pow(s - 0.3, 4) + 1e-9; },
        [](double s) { return 4 * std::pow(s - 0.3, 3); });
    std::uint64_t calls = 0;
    EXPECT_FALSE(look(Extremum{}, quartic, Side::above, Crossing::falling, &calls).hit);
    EXPECT_LE(calls, 61u);  // the search is bounded
}

}  // namespace
}  // namespace ricochet
