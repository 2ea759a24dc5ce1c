// The first rise of a function above zero: of straight lines, bumps, waves and noise.
#include "core/first_rise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace ricochet::first_rise_test {
namespace {

TEST(FirstRise, IsTheRootFromBelow)
{
    for (const double root : {0.1, 0.5, 0.999}) {
        const auto line = [=](double s) { return s - root; };
        const detail::Rise rise = detail::first_rise(line, 1, 1e-12);
        EXPECT_GT(rise.at, root);
        EXPECT_NEAR(rise.at, root, 1e-12);
        EXPECT_NEAR(rise.bend, 0, 1e-15);
    }
    EXPECT_EQ(detail::first_rise([](double) { return -1.0; }, 1, 1e-12).at,
              std::numeric_limits<double>::infinity());
    EXPECT_EQ(detail::first_rise([](double s) { return s - 1; }, 1, 1e-12).at,
              std::numeric_limits<double>::infinity());  // zero is not above zero
}

TEST(FirstRise, ABumpBetweenNegativeEndsIsFound)
{
    // 0.01 - (s - 0.6)², above zero from 0.5 to 0.7.
    const auto bump = [](double s) { return 0.01 - (s - 0.6) * (s - 0.6); };
    EXPECT_NEAR(detail::first_rise(bump, 1, 1e-12).at, 0.5, 1e-11);
}

TEST(FirstRise, TheFirstOfSeveralIsFound)
{
    // sin(4.5 pi s) - 1/2 rises at 1/27, falls, and rises twice more up to the end, where it is
    // 1/2.
    const auto wave = [](double s) { return std::sin(4.5 * 3.141592653589793 * s) - 0.5; };
    EXPECT_NEAR(detail::first_rise(wave, 1, 1e-12).at, 1.0 / 27, 1e-11);
}

TEST(FirstRise, AFunctionOfNoiseTakesABoundedNumberOfValues)
{
    int calls = 0;
    const auto noise = [&](double) { return ++calls % 2 == 0 ? -1e-3 : -1.0; };
    static_cast<void>(detail::first_rise(noise, 1, 0));
    // 256 divisions, then each of the parts that are left is closed by one more value.
    EXPECT_LE(calls, 3 * 256);
}

}  // namespace
}  // namespace ricochet::first_rise_test
