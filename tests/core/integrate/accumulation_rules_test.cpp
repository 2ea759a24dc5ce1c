// The two rules by which events accumulate, on sequences of which the limit is known: intervals of
// one guard that shrink, and rows of events of a cycle whose excursions are lost in rounding.

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "core/lost_row.hpp"
#include "core/shrinking_intervals.hpp"

namespace ricochet::detail {
namespace {

[[nodiscard]] Instant at(double t)
{
    Instant instant;
    instant.value = t;
    return instant;
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

// --- what rounding takes ---

/// Time that flights under a weight of 2 lose where each event takes `taken` of the energy, as a
/// part of the loss that is expected from their roundings.
double part_of_expected_loss(double restitution, double taken)
{
    LossByRounding loss;
    double t = 0, speed = 1;
    for (;;) {
        // A flight of length v rises by v^2 / 4; with rounding its energy v^2 falls by 4 taken.
        const double interval = speed;
        t += interval;
        loss.see(t, interval, speed * interval / 4, 16 * taken);
        const double energy = speed * speed - 4 * taken;
        if (!(energy > 0)) break;
        speed = restitution * std::sqrt(energy);
    }
    const double limit = 1 / (1 - restitution);
    return (limit - t) / loss.time(t);
}

TEST(LossByRounding, BoundsTheTimeThatFlightsLose)
{
    for (double restitution = 0.3; restitution < 0.96; restitution += 0.05) {
        for (double taken = 1e-16; taken < 1e-12; taken *= 1.3) {
            const double part = part_of_expected_loss(restitution, taken);
            EXPECT_GT(part, 0.2) << restitution << ' ' << taken;
            EXPECT_LT(part, 1) << restitution << ' ' << taken;
        }
    }
}

TEST(LossByRounding, TakesNothingFromALevelWhoseRateDoesNotFall)
{
    LossByRounding loss;
    double t = 0, size = 1;
    for (; size > 1e-17; size /= 2) loss.see(t += size, size, size, 1e-16);
    EXPECT_EQ(loss.time(t + 1), 0);
}

// --- cycles of several guards ---

/// Events of two guards in turn, whose excursions shrink by `decay` from one round to the next and
/// whose rounding is `rounding`. Returns the number of rounds until the row ends, 0 if it does not.
int rounds_until_lost(double decay, double rounding)
{
    LostRow row;
    Excursions guards[2];
    double t = 0, size = 1;
    for (int round = 1; round < 400; ++round, size *= decay) {
        for (Excursions& guard : guards) {
            t += std::sqrt(size);
            const bool soon = row.follows_soon(at(t));
            if (!soon) {
                static_cast<void>(guard.pass(size));
                row.clear();
                continue;
            }
            guard.set_rounding(rounding);
            const bool falls = guard.fall(size);
            guard.end(t, 1);
            if (!falls) {
                row.clear();
                continue;
            }
            row.add(guard);
            if (row.ends_with(guard)) return round;
        }
    }
    return 0;
}

TEST(LostRow, ACycleEndsWhereItsExcursionsAreLostInRounding)
{
    // 0.5^n < 1e-12 for n > 40; three rounds show it.
    const int rounds = rounds_until_lost(0.5, 1e-12);
    EXPECT_GT(rounds, 40 - 6);  // up to 32 roundings, where they decay less than half as fast
    EXPECT_LE(rounds, 44);
}

TEST(LostRow, ACycleThatKeepsItsSizeDoesNotEnd)
{
    EXPECT_EQ(rounds_until_lost(1, 1e-12), 0);
    // One that has fallen far, but stays larger than its rounding, does not, either.
    EXPECT_EQ(rounds_until_lost(0.999, 1e-12), 0);
}

TEST(LostRow, AnEventAfterALongTimeClearsTheRow)
{
    LostRow row;
    EXPECT_FALSE(row.follows_soon(at(0)));
    EXPECT_FALSE(row.follows_soon(at(1)));
    for (int k = 1; k <= 3; ++k) EXPECT_EQ(row.follows_soon(at(1 + 1e-3 * k)), k == 3);
    Excursions guard;
    row.add(guard);
    EXPECT_FALSE(row.is_empty());
    row.clear();
    EXPECT_TRUE(row.is_empty());
    EXPECT_FALSE(row.follows_soon(at(3)));
}

}  // namespace
}  // namespace ricochet::detail
