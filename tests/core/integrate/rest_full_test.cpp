// Thousands of cycles that accumulate, and of groups of clocks that do not.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <map>
#include <random>
#include <string>

#include "random_cycles.hpp"

namespace ricochet {
namespace {

TEST(Limits, OfAHundredThousandRandomCyclesAreReachedAndWithinTheirErrors)
{
    // One states an error that is of no use, where the intervals hardly shrink.
    std::map<std::string, int> faults;
    for (std::uint64_t seed = 1; seed <= 100'000; ++seed) {
        const test::CycleCase cycle = test::RandomCycles(seed).any();
        const std::string fault = seed % 3 == 0
                                      ? test::fault_of(cycle, ErrorControlled<Fehlberg78>{})
                                      : test::fault_of(cycle, ErrorControlled<Dopri5>{});
        if (!fault.empty()) ++faults[fault + ", seed " + std::to_string(seed)];
    }
    EXPECT_EQ(faults.size(), 1U);
    for (const auto& [fault, count] : faults) EXPECT_EQ(fault, "no error stated, seed 98335");
}

TEST(Limits, AreNotSeenInTenThousandGroupsOfClocks)
{
    std::mt19937 random(4);
    for (int k = 0; k < 10'000; ++k) {
        std::array<int, 6> late{};
        for (int& units : late) units = std::uniform_int_distribution<>(0, 60)(random);
        EXPECT_TRUE(test::clocks_run(late)) << k;
    }
}

}  // namespace
}  // namespace ricochet
