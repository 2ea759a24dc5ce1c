#include "ricochet/planned.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace ricochet::cover_test {
namespace {

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(Cover, OneValueCoversUntilTheFastestMotionArrives)
{
    // v tau + A tau^2 / 2 = d: 3 tau + 2 tau^2 = 5 at tau = 1; without acceleration d / v.
    EXPECT_DOUBLE_EQ(time_covered({.distance = 5, .speed = 3, .acceleration = 4}), 1);
    EXPECT_DOUBLE_EQ(time_covered({.distance = 5, .speed = 2, .acceleration = 0}), 2.5);
    // From rest sqrt(2 d / A).
    EXPECT_DOUBLE_EQ(time_covered({.distance = 8, .speed = 0, .acceleration = 1}), 4);
    EXPECT_EQ(time_covered({.distance = 1, .speed = 0, .acceleration = 0}), inf);
}

TEST(Cover, ADoubtCoversNothing)
{
    for (const double bad : {nan, -inf, -1.0}) {
        EXPECT_EQ(time_covered({.distance = bad, .speed = 1, .acceleration = 1}), 0);
        EXPECT_EQ(time_to_check({.distance = bad, .speed = 1, .acceleration = 1}, 0), 0);
    }
    EXPECT_EQ(time_covered({.distance = 0, .speed = 0, .acceleration = 0}), 0);
    for (const double bad : {nan, inf, -inf, -1.0}) {
        EXPECT_EQ(time_covered({.distance = 1, .speed = bad, .acceleration = 1}), 0);
        EXPECT_EQ(time_covered({.distance = 1, .speed = 1, .acceleration = bad}), 0);
        EXPECT_EQ(time_to_check({.distance = 1, .speed = 1, .acceleration = bad}, 0), 0);
    }
    const GuardBound good{.distance = 1, .speed = 0.1, .acceleration = 0.1};
    ASSERT_TRUE(stays_clear(good, good, 1, 0.01, 1e-12));
    for (const double bad : {nan, inf, -inf, -1.0}) {
        for (double GuardBound::*member : {&GuardBound::speed, &GuardBound::acceleration}) {
            GuardBound doubtful = good;
            doubtful.*member = bad;
            EXPECT_FALSE(stays_clear(doubtful, good, 1, 0.01, 1e-12)) << bad;
            EXPECT_FALSE(stays_clear(good, doubtful, 1, 0.01, 1e-12)) << bad;
        }
    }
    for (const double bad : {nan, -inf, -1.0, 0.0}) {
        const GuardBound gone{.distance = bad, .speed = 0.1, .acceleration = 0.1};
        EXPECT_FALSE(stays_clear(gone, good, 1, 0.01, 1e-12)) << bad;
        EXPECT_FALSE(stays_clear(good, gone, 1, 0.01, 1e-12)) << bad;
    }
    EXPECT_FALSE(stays_clear(good, good, nan, 0.01, 1e-12));
    EXPECT_FALSE(stays_clear(good, good, -1, 0.01, 1e-12));
}

TEST(Cover, TwoSpeedsBoundThePathBetweenThem)
{
    // From 1 up to a peak and down to 3, with slopes of 2, in 3 s: the lines 1 + 2 s and
    // 3 + 2 (3 - s) meet at s = 2, at 5. Area (1 + 5) / 2 * 2 + (5 + 3) / 2 * 1 = 10.
    EXPECT_DOUBLE_EQ(largest_change({.speed = 1, .acceleration = 2}, {.speed = 3}, 3), 10);
    // An end that is too fast to be reached bounds nothing: 1 * 1 + 2 / 2.
    EXPECT_DOUBLE_EQ(largest_change({.speed = 1, .acceleration = 2}, {.speed = 100}, 1), 2);
    EXPECT_DOUBLE_EQ(largest_change({.speed = 100, .acceleration = 2}, {.speed = 1}, 1), 2);
    // Without an acceleration the first speed holds throughout.
    EXPECT_DOUBLE_EQ(largest_change({.speed = 2}, {.speed = 7}, 3), 6);
}

TEST(Cover, NoMotionWithinTheBoundsEscapesThem)
{
    // Motions on a line with accelerations drawn again for every piece, within A: integrated
    // exactly, so that only the rounding of sums is left, for which the margin is 1e-9.
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> uniform(-1, 1);
    int closed = 0;
    for (int motion = 0; motion < 20000; ++motion) {
        const double a = std::exp(3 * uniform(random));
        double v = std::exp(2 * uniform(random)) * (uniform(random) < 0 ? -1 : 1);
        double d = std::exp(2 * uniform(random));
        const GuardBound from{.distance = d, .speed = std::fabs(v), .acceleration = a};
        const double covered = time_covered(from);
        const double tau = 2 * covered * (1 + uniform(random)) + 1e-9;
        double lowest = d;
        double lowest_covered = d;
        double t = 0;
        // Some motions drive to the surface and back as hard as they can.
        const bool hard = motion % 2 == 0;
        const double turn = tau * 0.5 * (1 + uniform(random));
        while (t < tau) {
            const double piece = std::min(tau * 0.02, tau - t);
            const double accelerated = hard ? (t < turn ? -a : a) : a * uniform(random);
            v += accelerated * piece;
            d += v * piece - 0.5 * accelerated * piece * piece;
            t += piece;
            lowest = std::min(lowest, d);
            if (t <= covered) lowest_covered = std::min(lowest_covered, d);
            if (piece <= 0) break;
        }
        EXPECT_GT(lowest_covered, -1e-9) << motion;
        const GuardBound to{.distance = d, .speed = std::fabs(v), .acceleration = a};
        if (stays_clear(from, to, tau, 1e-9, 0)) {
            ++closed;
            EXPECT_GT(lowest, 0) << motion;
        }
        EXPECT_LE(std::fabs(d - from.distance), (1 + 1e-9) * largest_change(from, to, tau) + 1e-12);
    }
    EXPECT_GT(closed, 2000);  // the property was put to the test
}

TEST(Cover, TheForecastIsWhereTwoValuesJustCloseTheStretch)
{
    // A guard that continues with its slope and bends by A, at constant speed: closed at the
    // forecast up to rounding, not beyond it.
    for (const double slope : {-0.9, -0.5, 0.0, 0.5}) {
        const double a = 0.25;
        const GuardBound at{.distance = 2, .speed = 1, .acceleration = a};
        const double tau = time_to_check(at, slope);
        const auto closes = [&](double time) {
            const double distance = 2 + slope * time - 0.5 * a * time * time;
            // The path between equal speeds, v tau + A tau^2 / 4; a distance need not be
            // positive for the forecast.
            return 2 + distance > time + 0.25 * a * time * time;
        };
        EXPECT_TRUE(closes(tau * (1 - 1e-9))) << slope;
        EXPECT_FALSE(closes(tau * (1 + 1e-9))) << slope;
    }
    // Moving away as fast as the bound: the interval is infinite.
    EXPECT_EQ(time_to_check({.distance = 1, .speed = 1, .acceleration = 0}, 1), inf);
    EXPECT_GT(time_to_check({.distance = 1, .speed = 1, .acceleration = 0}, nan), 0);
}

}  // namespace
}  // namespace ricochet::cover_test
