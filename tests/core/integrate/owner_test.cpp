#include "ricochet/base/detail/owner.hpp"

#include <gtest/gtest.h>

#include <utility>

namespace ricochet::owner_test {
namespace {

/// Counts how many of it there are.
struct Counted {
    explicit Counted(int& number) : count(&number) { ++*count; }
    Counted(const Counted&) = delete;
    Counted& operator=(const Counted&) = delete;
    ~Counted() { --*count; }
    int* count;
};

TEST(Owner, DeletesItsObjectOnceHoweverItIsMoved)
{
    int count = 0;
    {
        detail::Owner<Counted> first(new Counted(count));
        detail::Owner<Counted> second(std::move(first));
        EXPECT_FALSE(first);
        EXPECT_TRUE(second);
        second = detail::Owner<Counted>(new Counted(count));
        EXPECT_EQ(count, 1);
        second = {};
        EXPECT_EQ(count, 0);
        second = detail::Owner<Counted>(new Counted(count));
    }
    EXPECT_EQ(count, 0);
}

TEST(Owner, TheLastCopyDeletesASharedObject)
{
    int count = 0;
    detail::Shared<void> any;
    {
        const auto made = detail::Shared<Counted>::make(count);
        const auto copy = made;
        EXPECT_EQ(copy.get(), made.get());
        EXPECT_EQ(copy->count, &count);
        detail::Shared<Counted> other;
        EXPECT_EQ(other.get(), nullptr);
        other = copy;
        other = detail::Shared<Counted>::make(count);
        EXPECT_EQ(count, 2);
        any = detail::Shared<void>::make<Counted>(count);
        EXPECT_EQ(count, 3);
    }
    EXPECT_EQ(count, 1);
    auto moved = std::move(any);
    EXPECT_EQ(count, 1);
    moved = {};
    EXPECT_EQ(count, 0);
}

}  // namespace
}  // namespace ricochet::owner_test
