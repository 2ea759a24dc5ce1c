#include "base/workers.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <stdexcept>
#include <vector>

namespace ricochet::detail::workers_test {
namespace {

TEST(Workers, DoEveryPartOnce)
{
    for (const unsigned threads : {1U, 2U, 5U}) {
        Workers workers(threads);
        std::vector<int> done(16, 0);
        for (std::size_t round = 0; round < 2000; ++round) {
            workers.run(round % 17, [&](std::size_t i) { ++done[i]; });
        }
        for (std::size_t i = 0; i < 16; ++i) {
            int expected = 0;
            for (std::size_t round = 0; round < 2000; ++round) expected += round % 17 > i;
            EXPECT_EQ(done[i], expected) << "part " << i << " of " << threads << " threads";
        }
    }
}

TEST(Workers, PassOnWhatAPartThrowsAndGoOnWithTheNextTask)
{
    for (const unsigned threads : {1U, 3U}) {
        Workers workers(threads);
        for (int round = 0; round < 200; ++round) {
            EXPECT_THROW(workers.run(8,
                                     [](std::size_t i) {
                                         if (i == 3) throw std::domain_error("part 3");
                                     }),
                         std::domain_error);
            std::vector<int> done(5, 0);
            workers.run(5, [&](std::size_t i) { done[i] = 1; });
            EXPECT_EQ(done, std::vector<int>(5, 1));
        }
    }
}

}  // namespace
}  // namespace ricochet::detail::workers_test
