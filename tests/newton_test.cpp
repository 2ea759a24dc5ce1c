#include "ricochet/locate/newton.hpp"

#include "locators.hpp"

namespace ricochet::test {
namespace {

INSTANTIATE_TYPED_TEST_SUITE_P(Newton, LocatorSuite, Newton);

TEST(Newton, AParabolaCostsOneStep)
{
    // The first guess is exact on cubics, and what is left is closed along the flow.
    const HostStep step(
        19.0, [](double s) { return s * (2.5 - s); }, [](double s) { return 2.5 - 2 * s; });
    (void)locate<Newton>(step, Side::above);
    EXPECT_EQ(step.resteps, 1);
}

TEST(Newton, ASineCostsAtMostFourSteps)
{
    const HostStep step(
        3.0, [](double s) { return std::cos(s); }, [](double s) { return -std::sin(s); });
    (void)locate<Newton>(step, Side::above);
    EXPECT_LE(step.resteps, 4);
}

TEST(Newton, TheSlopeIsTheRateOfTheGuardAtTheEvent)
{
    const HostStep step(
        3.0, [](double s) { return std::cos(s); }, [](double s) { return -std::sin(s); });
    EXPECT_NEAR(locate<Newton>(step, Side::above).slope, -1, 1e-12);
}

}  // namespace
}  // namespace ricochet::test
