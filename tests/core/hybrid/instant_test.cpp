#include "ricochet/instant.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace ricochet::instant_test {
namespace {

TEST(Instant, TwoSumKeepsWhatTheAdditionRoundsOff)
{
    const TwoSum sum = two_sum(1.0, 0x1p-60);
    EXPECT_EQ(sum.value, 1.0);
    EXPECT_EQ(sum.remainder, 0x1p-60);
}

TEST(Instant, TwoSumIsExactInEitherOrder)
{
    const TwoSum sum = two_sum(0x1p-60, 1.0);
    EXPECT_EQ(sum.value, 1.0);
    EXPECT_EQ(sum.remainder, 0x1p-60);
}

TEST(Instant, AMillionStepsEndWhereTheirProductEnds)
{
    // 0.1 is not a double; the sum of n of its roundings is n fl(0.1), and fma
    // rounds that product once. The error of the carried time is at most one more rounding of
    // the remainder, far below an ulp of the time, where t += h is off by 1e-6.
    const double h = 0.1;
    const int n = 1'000'000;
    Instant t;
    for (int i = 0; i < n; ++i) {
        t = t.after(h);
    }
    const double product = n * h;
    const double rounded_off = std::fma(n, h, -product);
    EXPECT_NEAR((t.value - product) + (t.remainder - rounded_off), 0, 1e-16 * product);
}

TEST(Instant, TimeUntilCountsTheRemainder)
{
    const Instant t = Instant{1.0, 0}.after(0x1p-60);
    EXPECT_EQ(t.until(1.0), -0x1p-60);
}

}  // namespace
}  // namespace ricochet::instant_test
