// The rule by which the events of a cycle accumulate, on sequences of which the limit is known:
// rows of events whose excursions are lost in rounding. That of one guard is in
// shrinking_intervals_test.cpp.

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "core/lost_row.hpp"

namespace ricochet::lost_row_test {
namespace {

using namespace detail;

[[nodiscard]] Instant at(double t)
{
    return {t, 0};
}

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
}  // namespace ricochet::lost_row_test
