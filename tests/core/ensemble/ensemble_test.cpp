#include "ricochet/ensemble.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <map>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "ricochet/base/detail/splitmix.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::ensemble_test {
namespace {

struct Drop {
    double height;       // [m]
    double restitution;  // in [0.7, 0.9]
};

std::vector<Drop> drops(std::size_t count)
{
    std::vector<Drop> out;
    for (std::size_t i = 0; i < count; ++i) {
        detail::SplitMix random(row_seed(1, i));
        out.push_back({random.uniform(1, 10), random.uniform(0.7, 0.9)});
    }
    return out;
}

BouncingBall::State fall(const Drop& row)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = row.restitution});
    return integrate(ball, {row.height, 0}, {.t_end = 3}).x;
}

std::size_t number_of(const EnsembleRow& row)
{
    return row.index;
}

std::vector<std::uint64_t> bits(const Ensemble<BouncingBall::State>& all)
{
    std::vector<std::uint64_t> out;
    for (const auto& row : all.rows) {
        for (const double x : row.value()) out.push_back(std::bit_cast<std::uint64_t>(x));
    }
    return out;
}

TEST(Ensemble, HasTheBitsOfSingleRunsForAnyNumberOfThreads)
{
    const std::vector<Drop> table = drops(300);
    std::vector<std::uint64_t> expected;
    for (const Drop& row : table) {
        for (const double x : fall(row)) expected.push_back(std::bit_cast<std::uint64_t>(x));
    }
    for (const unsigned threads : {0U, 1U, 2U, 4U}) {
        const auto all = ensemble(table, fall, {.threads = threads});
        EXPECT_TRUE(all.complete);
        EXPECT_TRUE(all.failures.empty());
        EXPECT_EQ(bits(all), expected) << threads << " threads";
    }
}

TEST(Ensemble, RowsRunAtTheSameTime)
{
    // Each of two threads waits in its first row until the other has begun one, too.
    std::atomic<unsigned> begun = 0;
    std::mutex guard;
    std::set<std::thread::id> seen;
    const auto all = ensemble(1000,
                              [&](const EnsembleRow&) {
                                  bool first = false;
                                  {
                                      const std::lock_guard lock(guard);
                                      first = seen.insert(std::this_thread::get_id()).second;
                                  }
                                  if (!first) return true;
                                  ++begun;
                                  const auto until =
                                      std::chrono::steady_clock::now() + std::chrono::seconds(20);
                                  while (begun < 2 && std::chrono::steady_clock::now() < until)
                                      std::this_thread::yield();
                                  return begun >= 2;
                              },
                              {.threads = 2});
    for (const auto& row : all.rows) EXPECT_TRUE(row.value());
    EXPECT_EQ(seen.size(), 2u);
}

TEST(Ensemble, ExpensiveRowsNextToEachOtherAreDividedAmongThreads)
{
    // Forty rows that wait 2 ms each, in chunks that one thread would otherwise run. Each thread
    // begins when the other is there. One may hold a row more than its half for as long as a row
    // takes, and on a busy machine be late by a few.
    for (const std::size_t place : {0U, 30U, 1000U, 1960U}) {
        std::atomic<unsigned> begun = 0;
        std::mutex guard;
        std::map<std::thread::id, int> waited;
        const auto run = [&](const EnsembleRow& row) {
            const bool slow = row.index >= place && row.index < place + 40;
            bool first = false;
            {
                const std::lock_guard lock(guard);
                first = waited.try_emplace(std::this_thread::get_id(), 0).second;
                if (slow) ++waited[std::this_thread::get_id()];
            }
            if (first) {
                ++begun;
                const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(20);
                while (begun < 2 && std::chrono::steady_clock::now() < until) {
                    std::this_thread::yield();
                }
            }
            if (slow) std::this_thread::sleep_for(std::chrono::milliseconds(2));
            return row.index;
        };
        const auto all = ensemble(2000, run, {.threads = 2});
        EXPECT_TRUE(all.complete);
        ASSERT_EQ(waited.size(), 2U);
        for (const auto& [thread, count] : waited) EXPECT_GE(count, 14) << "rows from " << place;
        for (std::size_t i = 0; i < 2000; ++i) EXPECT_EQ(all.rows[i].value(), i);
    }
}

TEST(Ensemble, TwoThreadsTakeLittleMoreProcessorTimeThanOne)
{
    // What threads would take from each other by sharing memory that both write; the least of
    // several, and half as much again for what else the machine does.
    const std::vector<Drop> table = drops(4000);
    double least[2] = {1e9, 1e9};
    for (int turn = 0; turn < 5; ++turn) {
        for (const unsigned threads : {1U, 2U}) {
            const std::clock_t start = std::clock();
            (void)ensemble(table, fall, {.threads = threads});
            const double taken = static_cast<double>(std::clock() - start);
            least[threads - 1] = std::min(least[threads - 1], taken);
        }
    }
    EXPECT_LE(least[1], 1.5 * least[0]);
}

TEST(Ensemble, SeedsFollowFromTheSeedAndTheIndex)
{
    const auto seeds = [](std::uint64_t seed, unsigned threads) {
        const auto all = ensemble(1000, [](const EnsembleRow& row) { return row.seed; },
                                  {.threads = threads, .seed = seed});
        std::vector<std::uint64_t> out;
        for (const auto& row : all.rows) out.push_back(row.value());
        return out;
    };
    const auto first = seeds(1, 1);
    EXPECT_EQ(seeds(1, 3), first);
    EXPECT_EQ(first[17], row_seed(1, 17));
    EXPECT_NE(seeds(2, 1), first);
    EXPECT_EQ(std::set(first.begin(), first.end()).size(), 1000U);
    // The seeds of neighbouring ensembles do not overlap.
    const auto second = seeds(2, 1);
    std::set<std::uint64_t> both(first.begin(), first.end());
    both.insert(second.begin(), second.end());
    EXPECT_EQ(both.size(), 2000U);
}

TEST(Ensemble, KeepsWhatARowThrowsAndRunsTheOthers)
{
    for (const unsigned threads : {1U, 3U}) {
        const auto all = ensemble(200,
                                  [](const EnsembleRow& row) -> int {
                                      const int i = static_cast<int>(row.index);
                                      if (i == 150) throw 150;
                                      if (i % 100 == 7)
                                          throw std::domain_error("row " + std::to_string(i));
                                      return 2 * i;
                                  },
                                  {.threads = threads});
        EXPECT_TRUE(all.complete);
        ASSERT_EQ(all.failures.size(), 3U);
        EXPECT_EQ(all.failures[0].row, 7U);
        EXPECT_EQ(all.failures[0].message, "row 7");
        EXPECT_THROW(std::rethrow_exception(all.failures[1].exception), std::domain_error);
        EXPECT_EQ(all.failures[2].row, 150U);
        EXPECT_EQ(all.failures[2].message, "an exception that is no std::exception");
        for (int i = 0; i < 200; ++i) {
            const auto& row = all.rows[static_cast<std::size_t>(i)];
            EXPECT_EQ(row.has_value(), i % 100 != 7 && i != 150) << i;
            EXPECT_EQ(row.value_or(2 * i), 2 * i);
        }
    }
}

TEST(Ensemble, ReportsEveryChunkOnce)
{
    for (const unsigned threads : {1U, 4U}) {
        std::vector<int> seen(200, 0);
        std::size_t last = 0;
        const auto look = [&](const EnsembleProgress& now) {
            EXPECT_EQ(now.rows, 200U);
            EXPECT_EQ(now.first % ensemble_chunk, 0U);
            EXPECT_EQ(now.done, last + now.count);
            last = now.done;
            for (std::size_t i = now.first; i < now.first + now.count; ++i) ++seen[i];
            return true;
        };
        const auto all = ensemble(200, number_of, {.threads = threads, .progress = look});
        EXPECT_EQ(last, 200U);
        EXPECT_EQ(seen, std::vector<int>(200, 1));
        EXPECT_TRUE(all.complete);
    }
}

TEST(Ensemble, StopsWhenItsProgressSaysSo)
{
    // On one thread the chunks come in order: after the second no row is run.
    const auto all = ensemble(
        1000, number_of,
        {.threads = 1, .progress = [](const EnsembleProgress& now) { return now.done < 128; }});
    EXPECT_FALSE(all.complete);
    EXPECT_EQ(std::count_if(all.rows.begin(), all.rows.end(),
                            [](const auto& row) { return row.has_value(); }),
              128);
}

TEST(Ensemble, BeginsNoRowAfterItWasCancelled)
{
    std::atomic<bool> cancelled = false;
    std::size_t chunks = 0;
    const auto cancel = [&](const EnsembleRow& row) {
        if (row.index == 100) cancelled = true;
        return row.index;
    };
    const auto count = [&](const EnsembleProgress&) {
        ++chunks;
        return true;
    };
    const auto all =
        ensemble(1000, cancel, {.threads = 1, .progress = count, .cancelled = &cancelled});
    EXPECT_FALSE(all.complete);
    EXPECT_TRUE(all.rows[100].has_value());
    EXPECT_FALSE(all.rows[101].has_value());
    EXPECT_EQ(chunks, 1U);  // the chunk in hand is not reported
}

TEST(Ensemble, ThrowsWhatItsProgressThrows)
{
    for (const unsigned threads : {1U, 3U}) {
        EXPECT_THROW((void)ensemble(1000, number_of,
                                    {.threads = threads,
                                     .progress = [](const EnsembleProgress&) -> bool {
                                         throw std::domain_error("full");
                                     }}),
                     std::domain_error);
    }
}

TEST(Ensemble, OfNoRowsIsComplete)
{
    const auto all = ensemble(std::vector<Drop>{}, fall);
    EXPECT_TRUE(all.complete);
    EXPECT_TRUE(all.rows.empty());
}

TEST(Ensemble, RefusesMoreThreadsThanItCanHave)
{
    EXPECT_THROW((void)ensemble(std::vector<Drop>{}, fall, {.threads = 1025}),
                 std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::ensemble_test
