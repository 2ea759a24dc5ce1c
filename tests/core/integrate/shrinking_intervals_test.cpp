// The rule by which the events of one guard accumulate, on sequences of which the limit is known:
// intervals that shrink, excursions that are lost in rounding, and a time that stands still.
#include "core/shrinking_intervals.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <type_traits>
#include <vector>

namespace ricochet::shrinking_intervals_test {
namespace {

using detail::ShrinkingIntervals;

[[nodiscard]] Instant at(double t)
{
    return {t, 0};
}

/// Shows `count` events at t(n), n = 0, 1, ..., each located to a unit in the last place. Returns
/// the number of the first after which they accumulate, `count` if none.
template <class Time>
std::size_t first_accumulating(ShrinkingIntervals& intervals, std::size_t count, double tolerance,
                               const Time& t)
{
    for (std::size_t n = 0; n < count; ++n) {
        if (intervals.stalls(at(t(n)), 0.1)) return n;
        intervals.blame(1e-16);
        intervals.depart(1, false);
        if (intervals.accumulate(tolerance)) return n;
    }
    return count;
}

TEST(ShrinkingIntervals, AGeometricSeriesEndsAtItsLimit)
{
    for (const double q : {0.3, 0.5, 0.9}) {
        // t(n) = 1 - q^n
        ShrinkingIntervals intervals;
        const auto t = [q](std::size_t n) { return 1 - std::pow(q, static_cast<double>(n)); };
        const std::size_t last = first_accumulating(intervals, 1000, 1e-6, t);
        ASSERT_LT(last, 1000U) << q;
        // What is left is q^n; it is less than the tolerance for the first time.
        EXPECT_LT(1 - t(last), 1e-6);
        EXPECT_GT(1 - t(last - 1), 1e-6);
        EXPECT_NEAR(intervals.remainder(), 1 - t(last), 1e-9);
        EXPECT_LE(std::fabs(intervals.remainder() - (1 - t(last))), intervals.error());
    }
}

TEST(ShrinkingIntervals, EventsAtEqualIntervalsDoNotAccumulate)
{
    for (const double interval : {1.0, 1e-3, 1e-9}) {
        ShrinkingIntervals intervals;
        const auto t = [interval](std::size_t n) { return interval * static_cast<double>(n); };
        EXPECT_EQ(first_accumulating(intervals, 1000, 0.0, t), 1000U) << interval;
    }
}

TEST(ShrinkingIntervals, IntervalsThatGrowAgainDoNotAccumulate)
{
    // Bursts of four events that shrink, one a second.
    ShrinkingIntervals intervals;
    const auto t = [](std::size_t n) {
        return static_cast<double>(n / 4) + 0.1 * (1 - std::pow(0.25, static_cast<double>(n % 4)));
    };
    EXPECT_EQ(first_accumulating(intervals, 1000, 1e-9, t), 1000U);
}

TEST(ShrinkingIntervals, EventsThatDoNotAdvanceTheTimeStallAfterAHundred)
{
    ShrinkingIntervals intervals;
    EXPECT_EQ(first_accumulating(intervals, 1000, 0.0, [](std::size_t) { return 1.0; }), 101U);
    // A rest forgets the past, but not that the time stands still.
    intervals.come_to_rest();
    EXPECT_TRUE(intervals.stalls(at(1), 0.1));
    EXPECT_FALSE(intervals.outlast_rest());
    for (int n = 0; n < 100; ++n) static_cast<void>(intervals.stalls(at(1), 0.1));
    EXPECT_TRUE(intervals.outlast_rest());
}

TEST(ShrinkingIntervals, ExcursionsLostInRoundingFade)
{
    // A ball that keeps half its speed: its excursions fall to a quarter each time, and are as
    // large as a rounding of 1e-13 after the twentieth.
    ShrinkingIntervals intervals;
    double t = 0, speed = 1;
    int n = 0;
    for (bool fades = false; !fades && n < 100; ++n) {
        ASSERT_FALSE(intervals.stalls(at(t), 0.1));
        const bool low = intervals.is_low_at(speed);
        intervals.depart(speed, low);
        fades = low && intervals.fades(1e-13);
        t += 2 * speed;
        speed /= 2;
    }
    EXPECT_GE(n, 20);
    EXPECT_LE(n, 26);
}

TEST(ShrinkingIntervals, AJumpBackThatFallsBelowRoundingIsLost)
{
    // A reset puts the guard back by halves of the jump before, while it still approaches. From the
    // first jump, 2^10 roundings, to the last that is larger than one there are ten; the next one
    // is no longer seen.
    ShrinkingIntervals intervals;
    double away = 1024;
    for (; away > 1; away /= 2) EXPECT_FALSE(intervals.jump_is_lost(away, 1)) << away;
    EXPECT_TRUE(intervals.jump_is_lost(away, 1));
    EXPECT_FALSE(intervals.jump_is_lost(away, 1));  // it is counted again from there

    // One that began at less than a thousand roundings, has not fallen three times, or has ended
    // beyond the surface is the error of a location.
    for (const std::vector<double>& jumps : std::vector<std::vector<double>>{
             {512, 256, 128, 64, 0.5}, {4096, 2048, 1024, 0.5}, {2048, 1024, 512, 256, -2}}) {
        ShrinkingIntervals other;
        for (const double jump : jumps) EXPECT_FALSE(other.jump_is_lost(jump, 1)) << jump;
    }
}

TEST(ShrinkingIntervals, AGuardIsLowWhereItWillRiseToAThousandthOrLess)
{
    // Two intervals of 1 and 1/2: a guard that leaves at rate v rises by v / 2 * 1/2 / 4.
    ShrinkingIntervals intervals;
    for (const double t : {0.0, 1.0, 1.5}) ASSERT_FALSE(intervals.stalls(at(t), 0.1));
    intervals.depart(1, false);  // 1/16 is the largest excursion
    EXPECT_TRUE(intervals.is_low_at(1e-3));
    EXPECT_FALSE(intervals.is_low_at(1.1e-3));
    EXPECT_EQ(intervals.interval(), 0.5);
}

TEST(ShrinkingIntervals, LateEventsMakeTheLimitUncertain)
{
    // Each event of a geometric series with q = 1/2 is located late by up to d, except the first,
    // before which there is no interval: the limit moves by d (1 + q) / (1 - q) for each.
    const auto error = [](double late) {
        ShrinkingIntervals intervals;
        for (int n = 0; n < 8; ++n) {
            EXPECT_FALSE(intervals.stalls(at(1 - std::pow(0.5, n)), 0.1));
            intervals.blame(late);
        }
        return intervals.error();
    };
    EXPECT_NEAR(error(1e-6) - error(0), 7 * 3 * 1e-6, 1e-9);
}

TEST(ShrinkingIntervals, GoesOnFromItsNumbers)
{
    ShrinkingIntervals intervals;
    for (int n = 0; n < 5; ++n) {
        ASSERT_FALSE(intervals.stalls(at(1 - std::pow(0.5, n)), 0.1));
        intervals.blame(1e-12);
        intervals.depart(std::pow(0.5, n), false);
    }
    std::vector<double> numbers;
    intervals.visit([&](auto& number) { numbers.push_back(static_cast<double>(number)); });
    ShrinkingIntervals copy;
    std::size_t k = 0;
    copy.visit([&](auto& number) {
        number = static_cast<std::remove_reference_t<decltype(number)>>(numbers[k++]);
    });
    EXPECT_EQ(copy.remainder(), intervals.remainder());
    EXPECT_EQ(copy.error(), intervals.error());
    for (ShrinkingIntervals* of : {&intervals, &copy}) {
        EXPECT_FALSE(of->stalls(at(1 - std::pow(0.5, 5)), 0.1));
    }
    EXPECT_EQ(copy.accumulate(1), intervals.accumulate(1));
    EXPECT_TRUE(copy.accumulate(1));
}

}  // namespace
}  // namespace ricochet::shrinking_intervals_test
