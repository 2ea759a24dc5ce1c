#include "ricochet/guard.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace ricochet::guard_test {
namespace {

using detail::counts;
using detail::has_left;
using detail::opposite;

/// Whether a guard that was armed on `side` has an event at the end of a step.
bool triggers(Side side, double g_end, Crossing crossing)
{
    return has_left(side, g_end) && counts(side, crossing);
}

TEST(Guard, AFallingCrossingTriggersOnlyFromAbove)
{
    EXPECT_TRUE(triggers(Side::above, -1, Crossing::falling));
    EXPECT_FALSE(triggers(Side::below, 1, Crossing::falling));
    EXPECT_FALSE(triggers(Side::above, 1, Crossing::falling));
}

TEST(Guard, ARisingCrossingTriggersOnlyFromBelow)
{
    EXPECT_TRUE(triggers(Side::below, 1, Crossing::rising));
    EXPECT_FALSE(triggers(Side::above, -1, Crossing::rising));
}

TEST(Guard, EitherCrossingTriggersFromBothSides)
{
    EXPECT_TRUE(triggers(Side::above, -1, Crossing::either));
    EXPECT_TRUE(triggers(Side::below, 1, Crossing::either));
}

TEST(Guard, AZeroAtTheEndOfAStepBelongsToThatStep)
{
    EXPECT_TRUE(triggers(Side::above, 0, Crossing::falling));
    EXPECT_TRUE(triggers(Side::below, 0, Crossing::rising));
    EXPECT_TRUE(triggers(Side::above, -0.0, Crossing::falling));
}

TEST(Guard, APlateauNeverTriggers)
{
    for (const double g : {-1.0, 0.0, 1.0}) {
        EXPECT_FALSE(triggers(Side::plateau, g, Crossing::either)) << g;
    }
}

TEST(Guard, NaNIsNotACrossing)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(triggers(Side::above, nan, Crossing::either));
    EXPECT_FALSE(triggers(Side::below, nan, Crossing::either));
}

TEST(Guard, OppositeOfAPlateauIsAPlateau)
{
    EXPECT_EQ(opposite(Side::above), Side::below);
    EXPECT_EQ(opposite(Side::below), Side::above);
    EXPECT_EQ(opposite(Side::plateau), Side::plateau);
}

}  // namespace
}  // namespace ricochet::guard_test
