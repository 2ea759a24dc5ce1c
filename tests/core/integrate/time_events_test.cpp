// The next time event by itself: of a function of the time, a list with repetitions, and a timer in
// the state.
#include "core/time_events.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace ricochet::time_events_test {
namespace {

using X = detail::SmallState;
using TimeEvents = detail::TimeEvents<X>;
using After = TimeEvents::After;
constexpr double window = 1e-9;

/// A host's step, at rest at a time and a state, of a system that has no more than time events.
class Place {
public:
    explicit Place(bool backward = false, bool continues = false)
        : step_(system_, kernel_, state(0), {.t_end = backward ? -9.0 : 9.0}),
          events(system_, backward, continues)
    {
    }

    [[nodiscard]] bool find(After what, double t, double timer = 0)
    {
        step_.restart(Instant{t, 0}, state(timer), 0);
        return events.find(what, step_, window);
    }

    detail::SystemTable<X> table;
    std::vector<double> list;

private:
    [[nodiscard]] static X state(double timer)
    {
        X x(1);
        x[0] = timer;
        return x;
    }

    detail::SystemAt<X> system_{table, this};
    detail::StepKernel<X> kernel_{};
    detail::Step<X> step_;

public:
    TimeEvents events;
};

TEST(TimeEvents, OneOfAFunctionOfTheTimeHasToLieAhead)
{
    Place at;
    at.table.next_time_event = [](void*, double t) { return t < 2 ? 2.0 : 1.0; };
    EXPECT_TRUE(at.find(After::start, 0));
    EXPECT_EQ(at.events.next(), 2);
    EXPECT_FALSE(at.events.is_due_here());
    EXPECT_FALSE(at.find(After::time_event, 2));

    Place back(true);
    back.table.next_time_event = [](void*, double) { return 5.0; };
    back.table.previous_time_event = [](void*, double t) { return t - 1; };
    EXPECT_TRUE(back.find(After::start, 0));
    EXPECT_EQ(back.events.next(), -1);
}

/// A list with 1 twice and 3.
void set_list(Place& at)
{
    at.list = {1, 1, 3};
    at.table.next_time_event = [](void* place, double t) {
        const auto& list = static_cast<Place*>(place)->list;
        const auto next = std::upper_bound(list.begin(), list.end(), t);
        return next == list.end() ? std::numeric_limits<double>::infinity() : *next;
    };
    at.table.time_event_count = [](void* place, double t) {
        const auto& list = static_cast<Place*>(place)->list;
        return static_cast<std::size_t>(std::count(list.begin(), list.end(), t));
    };
}

TEST(TimeEvents, AListHasEachOfItsEntries)
{
    Place at;
    set_list(at);
    EXPECT_TRUE(at.find(After::start, 0));
    EXPECT_EQ(at.events.next(), 1);
    // The first entry brings the run to its time, where one more is due.
    EXPECT_TRUE(at.find(After::time_event, 1));
    EXPECT_TRUE(at.events.is_due_here());
    EXPECT_EQ(at.events.next(), 1);
    EXPECT_TRUE(at.find(After::set, 1));  // another set of the instant takes none
    EXPECT_TRUE(at.events.is_due_here());
    EXPECT_TRUE(at.find(After::time_event, 1));
    EXPECT_FALSE(at.events.is_due_here());
    EXPECT_EQ(at.events.next(), 3);
}

TEST(TimeEvents, EntriesAtTheStartHappenUnlessAnEarlierRunHadThem)
{
    for (const bool continues : {false, true}) {
        for (const After what : {After::start, After::restart}) {
            Place at(false, continues);
            set_list(at);
            EXPECT_TRUE(at.find(what, 1));
            EXPECT_EQ(at.events.is_due_here(), what == After::start && !continues);
        }
    }
}

TEST(TimeEvents, ATimerIsDueInsideTheWindowAndIdlesWhereNothingChanges)
{
    Place at;
    at.table.next_time_event_at = [](void*, Mode, double, const X& x) { return x[0]; };
    EXPECT_TRUE(at.find(After::start, 0, 1));
    EXPECT_FALSE(at.events.is_due_here());
    EXPECT_TRUE(at.find(After::set, 1, 1 - window / 2));
    EXPECT_TRUE(at.events.is_due_here());
    EXPECT_EQ(at.events.next(), 1);
    EXPECT_FALSE(at.find(After::set, 1, 1 - 2 * window));  // it would be lost

    // A timer whose event changes nothing would be due again for ever.
    at.events.see_set(false, true, false);
    EXPECT_FALSE(at.find(After::time_event, 1, 1));
    EXPECT_FALSE(at.events.is_due_here());
    at.events.see_set(false, false, false);  // nor does a set at the same instant
    EXPECT_FALSE(at.find(After::set, 1, 1));
    at.events.see_set(true, false, false);  // unless it changes something
    EXPECT_TRUE(at.find(After::set, 1, 1));
    at.events.see_set(false, true, false);
    at.events.forget();
    EXPECT_TRUE(at.find(After::set, 1, 1));
}

TEST(TimeEvents, KnowsTheLastOneAndIsPutBack)
{
    Place at;
    set_list(at);
    EXPECT_TRUE(at.find(After::start, 1));
    EXPECT_FALSE(at.events.was_at(1));
    at.events.pass(1);
    EXPECT_TRUE(at.events.was_at(1));
    at.events.put_back(0.5);
    EXPECT_EQ(at.events.next(), 0.5);
    EXPECT_FALSE(at.events.is_due_here());
    EXPECT_TRUE(at.find(After::time_event, 1));  // the list is counted again
    EXPECT_TRUE(at.events.is_due_here());
}

}  // namespace
}  // namespace ricochet::time_events_test
