#include "ricochet/extremum.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "host_step.hpp"

namespace ricochet::extremum_test {
namespace {

using test::HostStep;
using test::look;

TEST(Extremum, WhereTheRateDoesNotTurnOneGuardCallSuffices)
{
    const HostStep fall(
        1.0, [](double s) { return 2 - s; }, [](double) { return -1.0; });
    std::uint64_t calls = 0;
    EXPECT_FALSE(look(Extremum{}, fall, Side::above, Crossing::falling, &calls).hit);
    EXPECT_EQ(calls, 1u);
}

TEST(Extremum, APairOfCrossingsIsFoundWhateverTheSizeOfTheGuard)
{
    // A parabola that dips below its surface by a tenth of its largest value in the middle of
    // the step, times every power of ten that leaves it a normal number: the squares of its
    // rates underflow below 1e-154 and overflow above 1e154.
    for (int power = -300; power <= 300; power += 5) {
        const double size = std::pow(10.0, power);
        const HostStep dip(
            1.0, [=](double s) { return size * ((s - 0.45) * (s - 0.45) - 0.02); },
            [=](double s) { return size * 2 * (s - 0.45); });
        const auto finding = look(Extremum{}, dip, Side::above, Crossing::falling);
        EXPECT_TRUE(finding.hit) << "1e" << power;
        const HostStep misses(
            1.0, [=](double s) { return size * ((s - 0.45) * (s - 0.45) + 0.02); },
            [=](double s) { return size * 2 * (s - 0.45); });
        EXPECT_FALSE(look(Extremum{}, misses, Side::above, Crossing::falling).hit) << "1e" << power;
    }
}

}  // namespace
}  // namespace ricochet::extremum_test
