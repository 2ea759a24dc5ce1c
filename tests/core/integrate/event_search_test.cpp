// The search of a single step by itself: a step of a clock, and guards that are functions of its
// time with known roots. The state is the time, and the step is exact.
#include "core/event_search.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <tuple>
#include <utility>
#include <vector>

#include "clock_system.hpp"
#include "core/event_notes.hpp"
#include "core/event_series.hpp"
#include "core/event_sets.hpp"
#include "ricochet/detail/finders.hpp"
#include "ricochet/integrate.hpp"
#include "step_of.hpp"

namespace ricochet::event_search_test {
namespace {

using namespace test;
using X = Clock::State;
using Core = detail::CoreState<X>;
using Table = detail::GuardTable<Core, false>;
using Search = detail::EventSearch<Core, false>;
using Set = std::vector<std::size_t>;
/// Roots are of order one, and located within neighbouring doubles of them.
constexpr double rounding = 4e-16;

/// A step of length 1 from t = 0, with all guards sampled and armed on their sides.
class InStep {
public:
    explicit InStep(std::vector<Clock::Guard> guards, const Options& options = {.t_end = 100})
        : clock_{std::move(guards)},
          adapter_(clock_, X{}),
          system_(detail::system_table<Clock, X>, &adapter_),
          detector_(detail::DetectorTableOf<Extremum, Clock, X>::make(extremum_)),
          locator_(detail::locator_table<Newton>()),
          finders_{detector_, &extremum_, locator_, &newton_},
          step(clock_, 0, X{}),
          table(system_, detail::GuardRules::of(detector_, system_), false),
          search(system_, step.x0(), table.size(), finders_, options)
    {
        EXPECT_TRUE(step.attempt(1));
        table.sample_start(step, calls, 1);
        for (std::size_t i = 0; i < table.size(); ++i) {
            table[i].acting = table[i].info.resets;
            table.arm(i, detail::side_of(table.g0(i)));
        }
        table.sample_end(step, calls);
        Core inside = step.x0();
        step.peek(detail::CubicCheck::inside, inside);
        table.sample_inside(step, inside, calls);
        search.begin(step.x0());
        table.begin_search(1);
    }
    InStep(const InStep&) = delete;
    InStep& operator=(const InStep&) = delete;

    [[nodiscard]] bool find(bool time_event_due = false)
    {
        return search.find_set(step, table, time_event_due, calls);
    }
    [[nodiscard]] Set fired() { return {search.fired().begin(), search.fired().end()}; }
    void note_crossings(std::size_t i)
    {
        search.note_crossings(step, table, i, table.end(i, 1), calls);
    }
    /// Notes the guards of a set that changes nothing, and goes on behind it.
    void go_on()
    {
        for (const std::size_t i : search.fired()) {
            search.note(i, search.side_left(i), true);
            search.pass(step, table, i, calls);
        }
    }
    [[nodiscard]] double guard(std::size_t i, const Core& x) const
    {
        return clock_.guards[i].value(x[0]);
    }

private:
    Clock clock_;
    detail::SystemAdapter<Clock, X> adapter_;
    detail::SystemAt<Core> system_;
    Extremum extremum_;
    Newton newton_;
    detail::DetectorTable<Core> detector_;
    detail::LocatorTable locator_;
    detail::Finders<Core> finders_;

public:
    test::StepOf<Dopri5, Clock, X> step;
    Table table;
    Search search;
    std::uint64_t calls = 0;
};

TEST(EventSearch, TheFirstEventOfSeveralIsTheSet)
{
    // One that is only recorded does not cut the step.
    InStep in({line(0.7), line(0.4), line(1.5), line(0.6), line(0.3, -1, {.resets = false})});
    ASSERT_TRUE(in.find());
    EXPECT_EQ(in.fired(), Set{1});
    EXPECT_NEAR(in.search.at(), 0.4, rounding);
    EXPECT_EQ(in.search.before()[0], in.search.at());
    EXPECT_EQ(in.search.side_left(1), Side::above);
    EXPECT_NEAR(in.search.where(1).slope, -1, rounding);
    EXPECT_FALSE(in.search.late());

    InStep without({line(1.5), line(-0.5)});
    EXPECT_FALSE(without.find());
    EXPECT_TRUE(without.fired().empty());
}

TEST(EventSearch, OnlyTheDirectionThatCountsIsAnEvent)
{
    EXPECT_FALSE(InStep({line(0.5, -1, {.crossing = Crossing::rising})}).find());
    for (const Crossing crossing : {Crossing::falling, Crossing::rising, Crossing::either}) {
        InStep in({dip(0.5, 0.25, {.crossing = crossing})});
        ASSERT_TRUE(in.find());
        EXPECT_NEAR(in.search.at(), crossing == Crossing::rising ? 0.75 : 0.25, rounding);
        EXPECT_EQ(in.search.side_left(0), crossing == Crossing::rising ? Side::below : Side::above);
    }
}

TEST(EventSearch, EventsWithinTheWindowOfTheFirstAreOneSet)
{
    // The window begins with the first event, and does not go on with the second. The set happens
    // with its last event.
    const std::vector<Clock::Guard> guards{line(0.412), line(0.4), line(0.406)};
    InStep in(guards, {.t_end = 100, .event_window = 0.01});
    ASSERT_TRUE(in.find());
    EXPECT_EQ(in.fired(), (Set{1, 2}));
    EXPECT_NEAR(in.search.at(), 0.406, rounding);
    EXPECT_NEAR(in.search.before()[0], 0.406, rounding);
    EXPECT_NEAR(in.search.first_root(), 0.4, rounding);

    InStep narrow(guards, {.t_end = 100, .event_window = 0.005});
    ASSERT_TRUE(narrow.find());
    EXPECT_EQ(narrow.fired(), Set{1});
    EXPECT_NEAR(narrow.search.at(), 0.4, rounding);
}

TEST(EventSearch, TheWindowBeginsWithTheFirstRootAndNotWithTheFirstGuess)
{
    // The cubic through the ends of the second guard has its root 8e-6 behind that of the guard, so
    // that the first guard is located first. The third is in its window, but not in that of the
    // second, which turns out to be the first.
    constexpr double root = 0.395;
    const Clock::Guard bent{[](double t) { return -std::expm1(0.15 * (t - root)); },
                            [](double t) { return -0.15 * std::exp(0.15 * (t - root)); }};
    InStep in({line(root + 4e-6), bent, line(root + 1.2e-5)}, {.t_end = 100, .event_window = 1e-5});
    ASSERT_TRUE(in.find());
    EXPECT_EQ(in.fired(), (Set{0, 1}));
    EXPECT_NEAR(in.search.first_root(), root, rounding);
    EXPECT_NEAR(in.search.at(), root + 4e-6, rounding);
}

TEST(EventSearch, TheOrderOfTheGuardsDoesNotMatter)
{
    // Two at one time, by guards of different size and shape; one just behind them, and one after.
    const std::vector<Clock::Guard> guards{line(0.3), dip(0.5, 0.2), line(0.3005), line(0.8, 1e6)};
    const auto found = [&](const std::array<std::size_t, 4>& order, double window) {
        std::vector<Clock::Guard> shuffled;
        for (const std::size_t i : order) shuffled.push_back(guards[i]);
        InStep in(shuffled, {.t_end = 100, .event_window = window});
        EXPECT_TRUE(in.find());
        Set set;
        for (const std::size_t i : in.fired()) set.push_back(order[i]);
        std::sort(set.begin(), set.end());
        return std::tuple(set, in.search.at(), in.search.before()[0]);
    };
    for (const double window : {0.0, 1e-3}) {
        std::array<std::size_t, 4> order{0, 1, 2, 3};
        const auto first = found(order, window);
        EXPECT_EQ(std::get<0>(first), window == 0 ? (Set{0, 1}) : (Set{0, 1, 2}));
        EXPECT_NEAR(std::get<1>(first), window == 0 ? 0.3 : 0.3005, rounding);
        while (std::next_permutation(order.begin(), order.end())) {
            EXPECT_EQ(found(order, window), first);
        }
    }
}

TEST(EventSearch, ATimeEventInTheWindowTakesTheSetToTheEndOfTheStep)
{
    const Options options{.t_end = 100, .event_window = 0.01};
    for (const double root : {0.98, 0.995}) {
        for (const bool due : {false, true}) {
            InStep in({line(root)}, options);
            ASSERT_TRUE(in.find(due));
            const double at = due && root == 0.995 ? 1 : root;
            EXPECT_NEAR(in.search.at(), at, rounding) << root << ' ' << due;
            EXPECT_NEAR(in.search.before()[0], at, rounding);
        }
    }
}

TEST(EventSearch, ATouchIsNoCrossing)
{
    // A parabola that reaches its surface, dips below it, or stays above.
    InStep touches({dip(0.5, 0)});
    EXPECT_FALSE(touches.find());
    ASSERT_EQ(touches.search.notes().size(), 1u);
    EXPECT_EQ(touches.search.notes()[0].kind, EventKind::touch);
    EXPECT_NEAR(touches.search.notes()[0].where.root, 0.5, 1e-8);  // of a double root
    EXPECT_EQ(touches.search.noted(0), 0u);
    EXPECT_EQ(touches.table[0].examined.next, Side::above);
    touches.search.begin(touches.step.x0());
    EXPECT_TRUE(touches.search.notes().empty());
    EXPECT_FALSE(InStep({dip(0.5, 0, {.crossing = Crossing::either})}).find());

    InStep dips({dip(0.5, 1e-3)});
    ASSERT_TRUE(dips.find());
    EXPECT_NEAR(dips.search.at(), 0.499, 1e-13);  // its slope is 2e-3
    EXPECT_TRUE(dips.search.notes().empty());

    InStep misses({{[](double t) { return (t - 0.5) * (t - 0.5) + 1e-6; },
                    [](double t) { return 2 * (t - 0.5); }}});
    EXPECT_FALSE(misses.find());
    EXPECT_TRUE(misses.search.notes().empty());
}

TEST(EventSearch, EveryCrossingOfARecordedGuardIsNoted)
{
    const GuardInfo counts{.crossing = Crossing::either, .resets = false};
    EXPECT_FALSE(InStep({line(0.6, -1, counts)}).find());
    InStep in({dip(0.5, 0.25, counts), line(0.6, -1, counts)});
    EXPECT_FALSE(in.find());
    in.note_crossings(1);
    in.note_crossings(0);
    EXPECT_EQ(in.search.noted(0), 2u);
    EXPECT_EQ(in.search.noted(1), 1u);
    EXPECT_EQ(in.table[0].examined.next, Side::above);
    EXPECT_EQ(in.table[1].examined.next, Side::below);

    in.search.keep_notes_until(0.7);
    const auto& notes = in.search.notes();
    ASSERT_EQ(notes.size(), 2u);
    EXPECT_EQ(notes[0].guard, 0u);
    EXPECT_NEAR(notes[0].where.root, 0.25, rounding);
    EXPECT_EQ(notes[0].side, Side::above);
    EXPECT_EQ(notes[1].guard, 1u);
    EXPECT_NEAR(in.search.state_at(in.step, notes[1])[0], 0.6, rounding);
}

TEST(EventSearch, TheSearchGoesOnBehindAnEventThatChangesNothing)
{
    InStep in({dip(0.5, 0.25, {.crossing = Crossing::either}), line(0.5)});
    const std::array<double, 3> roots{0.25, 0.5, 0.75};
    const std::array<std::size_t, 3> guards{0, 1, 0};
    for (std::size_t k = 0; k < roots.size(); ++k) {
        ASSERT_TRUE(in.find()) << k;
        EXPECT_EQ(in.fired(), Set{guards[k]});
        EXPECT_NEAR(in.search.at(), roots[k], rounding);
        in.search.before()[0] += 10;  // the state that is kept is the set's, and not the step's
        in.go_on();
    }
    EXPECT_FALSE(in.find());
    const auto& notes = in.search.notes();
    ASSERT_EQ(notes.size(), 3u);
    for (std::size_t k = 0; k < notes.size(); ++k) {
        EXPECT_EQ(notes[k].guard, guards[k]);
        EXPECT_EQ(notes[k].side, k == 2 ? Side::below : Side::above);
        EXPECT_NEAR(in.search.state_at(in.step, notes[k])[0], 10 + roots[k], 1e-14);
    }
}

TEST(EventSearch, AGuardLeavesItsPlateauWhereItEnds)
{
    // It is 0 up to 1/4, and falls from there; the event is to leave it downward.
    InStep in({{[](double t) { return t <= 0.25 ? 0 : 0.25 - t; },
                [](double t) { return t <= 0.25 ? 0.0 : -1.0; }}});
    in.table.await_none();
    in.table.await(0, Side::above);
    in.table.arm(0, Side::plateau);
    ASSERT_TRUE(in.table.leaves_plateau(0));
    in.search.end_plateau(in.step, in.table, 0, in.calls);
    in.table.begin_search(1);
    ASSERT_TRUE(in.find());
    EXPECT_EQ(in.search.side_left(0), Side::above);
    EXPECT_NEAR(in.search.at(), 0.25, rounding);
}

TEST(EventSearch, AGuardThatHasASignAloneIsBisectedToNeighbouringDoubles)
{
    for (const double from : {0.1, 0.3, 0.37}) {
        InStep in({pulse(from, 2)});
        ASSERT_TRUE(in.find());
        EXPECT_GE(in.search.at(), from);
        EXPECT_LE(in.search.at(), from + rounding);
        EXPECT_LT(in.guard(0, in.search.before()), 0);  // its condition holds there
        EXPECT_TRUE(in.search.meet_conditions(in.step, in.table, in.calls));
        EXPECT_LT(in.search.where(0).lo, from);
    }
    // One that returns is seen at the place inside the step.
    InStep returns({pulse(0.3, 0.6)});
    ASSERT_TRUE(returns.find());
    EXPECT_NEAR(returns.search.at(), 0.3, rounding);
    returns.go_on();
    ASSERT_TRUE(returns.find());
    EXPECT_NEAR(returns.search.at(), 0.6, rounding);
}

TEST(EventSearch, ASetIsMovedToWhereItsConditionHolds)
{
    // The root of c - t² is rounded, so that the guard is still positive at some of the states
    // there.
    std::size_t unmet = 0;
    for (int k = 1; k < 100; ++k) {
        const double c = k / 100.0;
        InStep in({{[=](double t) { return c - t * t; }, [](double t) { return -2 * t; }}});
        ASSERT_TRUE(in.find());
        unmet += in.guard(0, in.search.before()) > 0;
        EXPECT_TRUE(in.search.meet_conditions(in.step, in.table, in.calls));
        EXPECT_LE(in.guard(0, in.search.before()), 0);
        EXPECT_NEAR(in.search.at(), std::sqrt(c), rounding);
        EXPECT_EQ(in.search.before()[0], in.search.at() + in.search.at_remainder());
        EXPECT_EQ(in.search.value_at_set(0), -in.guard(0, in.search.before()));
        // A little farther it is beyond its surface.
        Core x = in.search.before();
        const double t = in.search.go_beyond(in.step, in.table, 0, x, in.calls);
        EXPECT_GE(t, in.search.at());
        EXPECT_NEAR(t, std::sqrt(c), 2 * rounding);
        EXPECT_LT(in.guard(0, x), 0);
    }
    EXPECT_GT(unmet, 10u);
}

TEST(EventSearch, ARecordedGuardCrossesWithASetWithinRoundingAlone)
{
    const GuardInfo counts{.resets = false};
    InStep in({line(0.3), line(0.3, -5, counts), line(0.3 + 1e-9, -5, counts)});
    ASSERT_TRUE(in.find());
    EXPECT_EQ(in.fired(), Set{0});
    for (const std::size_t i : {1u, 2u}) {
        const auto sample = in.search.sample_at_set(in.step, in.table, i, in.calls);
        EXPECT_NEAR(sample.value, i == 1 ? 0 : 5e-9, 1e-15);
        EXPECT_EQ(sample.rate, -5);
        EXPECT_EQ(in.search.crosses_with_set(in.step, in.table, i, sample), i == 1);
    }
    in.search.note_at_set(in.table, 1, Side::above, -5);
    EXPECT_EQ(in.search.noted(1), 1u);
    EXPECT_EQ(in.search.notes()[0].where.root, in.search.at());
    EXPECT_EQ(in.table[1].side, Side::below);
}

TEST(EventSearch, AGuardThatTiesWithTheEndJoinsTheSetThere)
{
    InStep in({line(0.4), line(1 + 1e-15)});
    ASSERT_TRUE(in.find());
    EXPECT_FALSE(in.search.was_joined(in.step, 0));
    in.go_on();
    EXPECT_FALSE(in.find());
    in.search.stay_at_end(in.step);
    in.search.join_at_end(in.step, 1, Side::above, -1);
    EXPECT_EQ(in.fired(), Set{1});
    EXPECT_TRUE(in.search.was_joined(in.step, 1));
    EXPECT_EQ(in.search.at(), 1);
    EXPECT_EQ(in.search.before()[0], 1);
    EXPECT_EQ(in.search.side_left(1), Side::above);
}

}  // namespace
}  // namespace ricochet::event_search_test
