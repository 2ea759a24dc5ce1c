#include "ricochet/detect/extremum.hpp"

#include <gtest/gtest.h>

#include "host_step.hpp"

namespace ricochet {
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

}  // namespace
}  // namespace ricochet
