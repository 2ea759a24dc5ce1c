// The table of guards by itself: what it remembers of each from the samples of one step to the
// next, on steps of a clock.
#include "core/guard_table.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "clock_system.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/integrate.hpp"
#include "step_of.hpp"

namespace ricochet::guard_table_test {
namespace {

using namespace test;
using X = Clock::State;
using Core = detail::CoreState<X>;
using Numbers = std::vector<std::size_t>;

/// The table of a clock's guards, sampled at the start of a step of length 1 from t = 0, and armed
/// on their sides there.
template <bool single = false>
class TableOf {
public:
    explicit TableOf(std::vector<Clock::Guard> guards)
        : clock_{std::move(guards)},
          adapter_(clock_, X{}),
          system_(detail::system_table<Clock, X>, &adapter_),
          step(clock_, 0, X{}),
          table(system_,
                detail::GuardRules::of(detail::DetectorTableOf<Extremum, Clock, X>::make(extremum_),
                                       system_),
                false)
    {
        table.sample_start(step, calls, 1);
        for (std::size_t i = 0; i < table.size(); ++i) table.arm(i, detail::side_of(table.g0(i)));
    }
    TableOf(const TableOf&) = delete;
    TableOf& operator=(const TableOf&) = delete;

    void take_step(double h = 1)
    {
        EXPECT_TRUE(step.attempt(h));
        table.sample_end(step, calls);
        Core inside = step.x0();
        step.peek(detail::CubicCheck::inside, inside);
        table.sample_inside(step, inside, calls);
    }
    [[nodiscard]] Numbers suspects()
    {
        table.begin_search(step.h());
        const auto found = table.suspects();
        return {found.begin(), found.end()};
    }
    [[nodiscard]] Side side(std::size_t i) const { return table[i].side; }

private:
    Clock clock_;
    detail::SystemAdapter<Clock, X> adapter_;
    detail::SystemAt<Core> system_;
    Extremum extremum_;

public:
    StepOf<Dopri5, Clock, X> step;
    detail::GuardTable<Core, single> table;
    std::uint64_t calls = 0;
};

TEST(GuardTable, TheEndOfAClearStepIsTheStartOfTheNext)
{
    TableOf of({line(2), line(3, 1)});
    of.take_step();
    EXPECT_FALSE(of.table.suspicious(1));
    of.table.pass_on();
    of.step.accept();
    // 2 - t and t - 3 at t = 1.
    EXPECT_EQ(of.table.g0(0), 1);
    EXPECT_EQ(of.table.g0(1), -2);
    EXPECT_EQ(of.table.rate0(0), -1);
    EXPECT_EQ(of.table.rate0(1), 1);
    const std::uint64_t calls = of.calls;
    of.take_step(0.5);
    EXPECT_EQ(of.calls - calls, 4U);  // two guards, at the end and inside
    EXPECT_EQ(of.table.end(0, 0.5).value, 0.5);
    EXPECT_EQ(of.table.start(0).value, 1);
}

TEST(GuardTable, AGuardThatLeavesItsSideIsSuspectedAmongAnyNumber)
{
    // Few guards are screened one by one, many in blocks.
    for (const std::size_t count : {2U, 7U, 9U, 100U}) {
        std::vector<Clock::Guard> guards(count, line(2));
        guards[count - 2] = line(0.5);                                             // crosses
        guards[count - 1] = dip(0.5, 0.25);                                        // twice
        if (count > 2) guards[0] = line(0.5, -1, {.crossing = Crossing::rising});  // does not count
        TableOf of(guards);
        of.take_step();
        EXPECT_TRUE(of.table.suspicious(1)) << count;
        const Numbers found = of.suspects();
        EXPECT_NE(std::find(found.begin(), found.end(), count - 2), found.end()) << count;
        EXPECT_NE(std::find(found.begin(), found.end(), count - 1), found.end()) << count;
        EXPECT_LE(found.size(), 3U) << count;
    }
    TableOf<true> alone({line(0.5)});
    alone.take_step();
    EXPECT_TRUE(alone.table.suspicious(1));
    TableOf<true> clear({line(1.5)});
    clear.take_step();
    EXPECT_FALSE(clear.table.suspicious(1));
}

TEST(GuardTable, ASearchChangesItsSuspectsAlone)
{
    TableOf of({line(0.5), line(2)});
    of.take_step();
    ASSERT_EQ(of.suspects(), Numbers{0});
    of.table.go_on_from(0, Side::below, {.s = 0.5, .value = 0, .rate = -1});
    EXPECT_EQ(of.table.start(0).s, 0.5);
    of.table.pass_on_after_events();
    EXPECT_EQ(of.side(0), Side::below);
    EXPECT_EQ(of.side(1), Side::above);
    EXPECT_EQ(of.table.start(0).s, 0);
    EXPECT_EQ(of.table.g0(0), -0.5);
    EXPECT_EQ(of.table.g0(1), 1);
}

TEST(GuardTable, AGuardIsPutBackAsItWasKept)
{
    TableOf of({line(0.5), line(2)});
    of.take_step();
    ASSERT_EQ(of.suspects(), Numbers{0});
    const auto kept = of.table.keep(0);
    of.table.go_on_from(0, Side::below, {.s = 0.75, .value = -0.25, .rate = -2});
    of.table.put_back(kept);
    EXPECT_EQ(of.side(0), Side::above);
    EXPECT_EQ(of.table.g0(0), 0.5);
    EXPECT_EQ(of.table.rate0(0), -1);
    EXPECT_EQ(of.table.start(0).s, 0);
}

TEST(GuardTable, APlateauIsLeftToTheSideAtTheEndOfAStep)
{
    TableOf of({line(0.5), line(0.5), line(-0.5)});
    of.table.await_none();
    for (std::size_t i = 1; i < 3; ++i) {
        of.table.arm(i, Side::plateau);
        of.table.await(i, Side::above);
    }
    EXPECT_TRUE(of.table.waiting());
    EXPECT_TRUE(of.table.any_stands());
    of.take_step(0.25);
    of.table.pass_on();
    EXPECT_EQ(of.side(1), Side::above);
    EXPECT_EQ(of.side(2), Side::below);
}

TEST(GuardTable, AGuardHasReturnedWhereItIsBackOnTheSideOfItsLastEvent)
{
    TableOf of({line(0.5)});
    of.table[0].last.side = Side::above;
    of.table.arm(0, Side::below);
    EXPECT_FALSE(of.table[0].last.returned);
    of.table.arm(0, Side::above);
    EXPECT_TRUE(of.table[0].last.returned);
}

TEST(GuardTable, ADeferredGuardIsNotSuspectedUntilItIsWoken)
{
    TableOf of({line(0.5), line(2)});
    of.table.put_to_sleep(0);
    of.take_step();
    EXPECT_FALSE(of.table.suspicious(1));
    of.table.wake(0, {.s = 0, .value = 0.5, .rate = -1}, {.s = 1, .value = -0.5, .rate = -1});
    EXPECT_TRUE(of.table.suspicious(1));
    EXPECT_EQ(of.suspects(), Numbers{0});
}

TEST(GuardTable, TheToleranceOfASetIsTakenOnce)
{
    TableOf of({line(0.5), line(2)});
    of.table[0].noted.tolerance = 1e-9;
    of.table[1].tolerance = 1e-3;  // of an earlier set
    of.table.take_tolerances();
    EXPECT_EQ(of.table[0].tolerance, 1e-9);
    EXPECT_EQ(of.table[1].tolerance, 0);
    of.table.take_tolerances();
    EXPECT_EQ(of.table[0].tolerance, 0);
}

TEST(GuardTable, OneBeyondItsToleranceOnItsSideStaysArmed)
{
    TableOf of({line(0.5), line(0.5), line(0.5), line(-0.5, -1, {.unilateral = true}), line(0.5)});
    of.table[1].fired = true;
    of.table[2].tolerance = 0.75;
    of.table.arm(4, Side::below);
    EXPECT_TRUE(of.table.stays_armed(0));
    EXPECT_FALSE(of.table.stays_armed(1));  // its own reset may have moved it
    EXPECT_FALSE(of.table.stays_armed(2));  // it counts as being on its surface
    EXPECT_FALSE(of.table.stays_armed(3));  // it is where it must not be
    EXPECT_FALSE(of.table.stays_armed(4));  // another reset has carried it across
    // Those that stay are passed over from then on, as long as they do.
    Numbers armed;
    of.table.for_each_to_arm([&](std::size_t i) { armed.push_back(i); });
    EXPECT_EQ(armed, (Numbers{1, 2, 3, 4}));
}

TEST(GuardTable, ATouchIsWithinTheRoundingOfTheLargestValue)
{
    TableOf of({line(0.5), line(0.5, -1, {.touch = 1e-3})});
    of.take_step();
    // The ends of the step are 0.5 from the surface, and the cubic between them stays within that.
    EXPECT_EQ(of.table.scale(0, 1), 0.5);
    EXPECT_EQ(of.table.touch(0, 1), 0.5 * 64 * 2.220446049250313e-16);
    EXPECT_EQ(of.table.touch(1, 1), 1e-3);
}

TEST(GuardTable, ForgetsAllButWhatIsDeclaredAndTheNumberOfEvents)
{
    TableOf of({line(0.5)});
    of.table[0].acting = true;
    of.table[0].events = 7;
    of.table[0].last.t = 0.25;
    of.table[0].tolerance = 1e-9;
    of.table[0].last.returned = true;
    of.table.forget();
    const auto& record = std::as_const(of.table)[0];
    EXPECT_TRUE(record.acting);
    EXPECT_EQ(record.events, 7U);
    EXPECT_TRUE(std::isnan(record.last.t));
    EXPECT_EQ(record.tolerance, 0);
    EXPECT_FALSE(record.last.returned);
    EXPECT_EQ(record.side, Side::plateau);
}

TEST(GuardTable, TheBitsOfTheGuardsAtTheEndAreCompared)
{
    double offset = 0;
    TableOf of({{[&](double t) { return 2 - t + offset; }, [](double) { return -1.0; }}, line(3)});
    of.take_step();
    EXPECT_TRUE(of.table.end_alike(of.step, of.calls));
    offset = 1e-15;  // a variable outside of the system, by a few units in the last place of 1
    EXPECT_FALSE(of.table.end_alike(of.step, of.calls));
}

}  // namespace
}  // namespace ricochet::guard_table_test
