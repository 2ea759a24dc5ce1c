// The resets of a set of events, by themselves: what two, three and five of them do to common
// components, in exact numbers.

#include "core/merged_resets.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

namespace ricochet {
namespace {

using State = detail::SmallState;
using Reset = std::function<Mode(Mode, State&)>;

/// A set of guards with resets, of which each still has its event unless told otherwise.
class Set {
public:
    explicit Set(std::vector<Reset> resets) : resets_(std::move(resets))
    {
        table_.reset = [](void* adapter, std::size_t which, Mode mode, double, State& x) {
            return static_cast<Set*>(adapter)->resets_[which](mode, x);
        };
    }
    Set& on_time(Reset reset)
    {
        timed_ = std::move(reset);
        table_.time_reset = [](void* adapter, Mode mode, double, State& x) {
            return static_cast<Set*>(adapter)->timed_(mode, x);
        };
        return *this;
    }
    /// Whether guard i still has its event in a state that an earlier reset has left.
    Set& stands_if(std::function<bool(std::size_t, const State&)> stands)
    {
        stands_ = std::move(stands);
        return *this;
    }

    detail::MergedResets<State> apply(State before, Mode mode = 0)
    {
        std::vector<std::size_t> fired(resets_.size());
        for (std::size_t i = 0; i < fired.size(); ++i) fired[i] = i;
        detail::MergedResets<State> merged(before);
        merged.apply({table_, this}, Table{}, {fired, timed_ != nullptr, mode, 0}, before,
                     Stands{*this});
        return merged;
    }

private:
    struct Table {
        struct Record {
            GuardInfo info;
        };
        Record operator[](std::size_t) const
        {
            Record record;
            record.info.resets = true;
            return record;
        }
    };
    struct Stands {
        const Set& set;

        [[nodiscard]] static bool knows_flow() { return true; }
        [[nodiscard]] static bool enabled(std::size_t, Mode) { return true; }
        [[nodiscard]] static Crossing direction(std::size_t) { return Crossing::falling; }
        [[nodiscard]] bool moves(std::size_t i, Mode, const State& x) const
        {
            return !set.stands_ || set.stands_(i, x);
        }
    };

    detail::SystemTable<State> table_;
    std::vector<Reset> resets_;
    Reset timed_;
    std::function<bool(std::size_t, const State&)> stands_;
};

State state(double a, double b)
{
    State x(2);
    x[0] = a;
    x[1] = b;
    return x;
}

Reset adds(std::size_t c, double amount)
{
    return [=](Mode mode, State& x) {
        x[c] += amount;
        return mode;
    };
}
Reset sets(std::size_t c, double value)
{
    return [=](Mode mode, State& x) {
        x[c] = value;
        return mode;
    };
}
Reset scales(std::size_t c, double factor)
{
    return [=](Mode mode, State& x) {
        x[c] *= factor;
        return mode;
    };
}
Reset turns_on(Mode bit)
{
    return [=](Mode mode, State&) { return mode | bit; };
}

constexpr auto none = std::pair{no_guard, no_guard};

TEST(MergedResets, ChangesOfDifferentComponentsAreMerged)
{
    const auto merged = Set({sets(0, 5), sets(1, 7)}).apply(state(1, 2));
    EXPECT_EQ(merged.conflict(), none);
    EXPECT_EQ(merged.after()[0], 5);
    EXPECT_EQ(merged.after()[1], 7);
}

TEST(MergedResets, IncrementsOfOneComponentAdd)
{
    const auto two = Set({adds(0, 2), adds(0, 2)}).apply(state(1, 0));
    EXPECT_EQ(two.conflict(), none);
    EXPECT_EQ(two.after()[0], 5);

    // Five are asked in two orders alone.
    const auto five =
        Set({adds(0, 1), adds(0, 2), adds(0, 4), adds(0, 8), adds(0, 16)}).apply(state(0, 0));
    EXPECT_EQ(five.conflict(), none);
    EXPECT_EQ(five.after()[0], 31);
}

TEST(MergedResets, ATimeEventIsOneMoreMember)
{
    const auto merged = Set({adds(0, 2)}).on_time(adds(0, 3)).apply(state(1, 0));
    EXPECT_EQ(merged.conflict(), none);
    EXPECT_EQ(merged.after()[0], 6);
}

TEST(MergedResets, OrdersThatEndAlikeAreNoConflict)
{
    const auto merged = Set({sets(0, 3), sets(0, 3)}).apply(state(1, 0));
    EXPECT_EQ(merged.conflict(), none);
    EXPECT_EQ(merged.after()[0], 3);

    const auto scaled = Set({scales(0, 2), scales(0, 0.25)}).apply(state(8, 0));
    EXPECT_EQ(scaled.conflict(), none);
    EXPECT_EQ(scaled.after()[0], 4);
}

TEST(MergedResets, OrdersThatEndElsewhereNameTwoMembers)
{
    const auto merged = Set({adds(1, 1), sets(0, 3), sets(0, 4)}).apply(state(1, 0));
    EXPECT_EQ(merged.conflict(), (std::pair<std::size_t, std::size_t>{1, 2}));

    const auto timed = Set({sets(0, 3)}).on_time(adds(0, 1)).apply(state(1, 0));
    EXPECT_EQ(timed.conflict(), (std::pair{std::size_t{0}, time_event_reset}));
}

TEST(MergedResets, AResetThatReadsWhatAnotherWritesAsItWasIsMerged)
{
    // The second reads the first's component, but writes another one: both read the state before.
    const Reset reads = [](Mode mode, State& x) {
        x[1] = 10 * x[0];
        return mode;
    };
    const auto merged = Set({sets(0, 3), reads}).apply(state(1, 0));
    EXPECT_EQ(merged.conflict(), none);
    EXPECT_EQ(merged.after()[0], 3);
    EXPECT_EQ(merged.after()[1], 10);
}

TEST(MergedResets, AMemberWhoseEventAnEarlierOneHasTurnedIsLeftOut)
{
    // Two walls return one ball: whichever comes first, it then moves away from the other.
    Set set({scales(0, -1), scales(0, -1)});
    set.stands_if([](std::size_t, const State& x) { return x[0] < 0; });
    const auto merged = set.apply(state(-3, 0));
    EXPECT_EQ(merged.conflict(), none);
    EXPECT_EQ(merged.after()[0], 3);
}

TEST(MergedResets, BitsOfTheModeAreBothTurnedOn)
{
    const auto merged = Set({turns_on(1), turns_on(2)}).apply(state(0, 0));
    EXPECT_EQ(merged.conflict(), none);
    EXPECT_EQ(merged.mode(), Mode{3});
}

TEST(MergedResets, ModesThatOverwriteEachOtherAreInConflict)
{
    const Reset to_one = [](Mode, State&) { return Mode{1}; };
    const Reset to_two = [](Mode, State&) { return Mode{2}; };
    const auto merged = Set({to_one, to_two}).apply(state(0, 0));
    EXPECT_EQ(merged.conflict(), (std::pair<std::size_t, std::size_t>{0, 1}));
}

TEST(MergedResets, TheDeclaredOrderDoesNotMatter)
{
    std::array<double, 3> amounts{0.1, 0.2, 0.7};
    std::vector<double> ends;
    do {
        const auto merged =
            Set({adds(0, amounts[0]), adds(0, amounts[1]), adds(0, amounts[2])}).apply(state(1, 0));
        EXPECT_EQ(merged.conflict(), none);
        ends.push_back(merged.after()[0]);
    } while (std::next_permutation(amounts.begin(), amounts.end()));
    for (const double end : ends) EXPECT_EQ(end, ends.front());
}

TEST(MergedResets, TheFirstStopGivesItsReasonOnce)
{
    int asked = 0;
    const Reset stops = [&](Mode, State& x) -> Mode {
        ++asked;
        x[0] = 9;
        throw StopRun("the cable is cut");
    };
    const auto merged = Set({stops, sets(0, 9)}).apply(state(1, 0));
    EXPECT_TRUE(merged.stops());
    EXPECT_EQ(merged.stopper(), 0u);
    EXPECT_EQ(merged.reason(), "the cable is cut");
    EXPECT_EQ(merged.conflict(), none);
    EXPECT_EQ(merged.after()[0], 9);
    EXPECT_GT(asked, 1);
}

}  // namespace
}  // namespace ricochet
