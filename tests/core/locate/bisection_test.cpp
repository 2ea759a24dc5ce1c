#include "ricochet/locators.hpp"

#include "locators.hpp"

namespace ricochet::test::bisection_test {
namespace {

INSTANTIATE_TYPED_TEST_SUITE_P(Bisection, LocatorSuite, Bisection);

TEST(Bisection, HalvesOncePerBitOfTheTolerance)
{
    const HostStep step(
        1.0, [](double s) { return 0.3 - s; }, [](double) { return -1.0; });
    (void)locate<Bisection>(step, Side::above, 0x1p-20);
    EXPECT_EQ(step.resteps, 20);
}

}  // namespace
}  // namespace ricochet::test::bisection_test
