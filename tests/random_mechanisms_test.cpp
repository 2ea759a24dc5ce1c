// Random mechanisms with contacts: their laws and the balance of energy in every step.

#include "random_mechanisms.hpp"

#include <gtest/gtest.h>

namespace ricochet {
namespace {

using test::MechanismMaker;
using test::MechanismTally;

TEST(RandomMechanisms, EveryStepOfATippingBlockObeysItsLawsAndBalancesEnergy)
{
    MechanismTally tally;
    for (std::uint64_t seed = 0; seed < 100; ++seed) MechanismMaker(seed).block(tally);
    EXPECT_EQ(tally.fault, "");
    EXPECT_EQ(tally.reported, 0u);
    EXPECT_GT(tally.impacts, 1000u);
}

TEST(RandomMechanisms, EveryStepOfAWoodpeckerObeysItsLawsAndBalancesEnergy)
{
    MechanismTally tally;
    for (std::uint64_t seed = 0; seed < 30; ++seed) MechanismMaker(seed).woodpecker(tally);
    EXPECT_EQ(tally.fault, "");
    EXPECT_EQ(tally.reported, 0u);
    EXPECT_GT(tally.impacts, 1000u);
}

TEST(RandomMechanisms, BallsSlideRollAndRestOnMovingPlates)
{
    std::uint64_t reported = 0;
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
        EXPECT_EQ(test::follow_ball(seed, 10'000, reported), "");
    }
    EXPECT_EQ(reported, 0u);
}

}  // namespace
}  // namespace ricochet
