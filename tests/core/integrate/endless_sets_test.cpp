// Sets without an end at one instant: that they are recognised, and that a long cascade is not
// taken for one.
#include "core/endless_sets.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <vector>

namespace ricochet::endless_sets_test {
namespace {

using X = std::vector<double>;
using Sets = detail::EndlessSets<X>;
constexpr std::array<std::size_t, 1> first{0};
constexpr std::array<std::size_t, 1> second{1};

TEST(EndlessSets, ALoopOfAnyLengthIsFound)
{
    // The state counts the sets modulo `length`. A set is compared with the last one whose number
    // is a power of two, so that the loop is found before the second such number from its length
    // on, and one round later.
    for (const int length : {1, 2, 3, 7, 100}) {
        Sets sets(X{0});
        sets.begin_instant();
        int level = 0;
        while (!sets.repeats(X{double(level % length)}, 0, first))
            ASSERT_LT(++level, 1000) << length;
        EXPECT_GE(level, length);
        EXPECT_LT(level, 3 * length);
    }
}

TEST(EndlessSets, OnlyTheSameStateModeAndSetRepeat)
{
    Sets sets(X{0});
    sets.begin_instant();
    EXPECT_FALSE(sets.repeats(X{1}, 0, first));
    EXPECT_FALSE(sets.repeats(X{1}, 0, second));  // and is kept, as the second
    EXPECT_FALSE(sets.repeats(X{1}, 1, second));
    EXPECT_FALSE(sets.repeats(X{2}, 0, second));
    EXPECT_TRUE(sets.repeats(X{2}, 0, second));  // the fourth was kept
    EXPECT_EQ(sets.level(), 4U);
    sets.begin_instant();
    EXPECT_EQ(sets.level(), 0U);
    EXPECT_FALSE(sets.repeats(X{2}, 0, second));  // at another instant
}

TEST(EndlessSets, TheThousandthEventOfAnInstantIsOneTooMany)
{
    Sets sets(X{0});
    detail::TimesAtInstant guard, other;
    for (int instant = 0; instant < 2; ++instant) {  // the count begins again with each
        sets.begin_instant();
        for (int n = 1; n < 1000; ++n) ASSERT_FALSE(sets.exceeds(guard)) << n;
        EXPECT_FALSE(sets.exceeds(other));
    }
    EXPECT_TRUE(sets.exceeds(guard));
    EXPECT_EQ(sets.instants(), 2U);
}

}  // namespace
}  // namespace ricochet::endless_sets_test
