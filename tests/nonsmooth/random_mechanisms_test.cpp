// Random mechanisms with contacts: their laws and the balance of energy in every step.

#include "random_mechanisms.hpp"

#include <gtest/gtest.h>

namespace ricochet::random_mechanisms_test {
namespace {

using test::MechanismMaker;
using test::MechanismTally;

void expect_lawful(std::uint64_t seeds, void (MechanismMaker::*follow)(MechanismTally&))
{
    MechanismTally tally;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) (MechanismMaker(seed).*follow)(tally);
    EXPECT_EQ(tally.fault, "");
    EXPECT_EQ(tally.reported, 0u);
    EXPECT_GT(tally.impacts, 1000u);
}

TEST(RandomMechanisms, EveryStepOfATippingBlockObeysItsLawsAndBalancesEnergy)
{
    expect_lawful(100, &MechanismMaker::block);
}

TEST(RandomMechanisms, EveryStepOfAWoodpeckerObeysItsLawsAndBalancesEnergy)
{
    expect_lawful(30, &MechanismMaker::woodpecker);
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
}  // namespace ricochet::random_mechanisms_test
