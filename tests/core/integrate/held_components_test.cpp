// What a rest holds: a box on a floor, which a load presses down and lifts again, and a clock in
// the same state that is not held. The first rise of a function, by which the lift is found, too.
#include "core/held_components.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "ricochet/detail/finders.hpp"
#include "ricochet/integrate.hpp"
#include "step_of.hpp"

namespace ricochet::held_components_test {
namespace {

using X = std::array<double, 3>;
using Core = detail::CoreState<X>;

/// State (height, velocity, clock); the clock runs at 1, or as it is told.
struct Box {
    using State = X;
    std::function<double(double)> load;  ///< acceleration at time t
    bool clock_is_set = false;           ///< the rest puts the clock to the time

    void flow(double t, const X& x, X& dxdt) const { dxdt = {x[1], load(t), 1}; }
    template <class V>
    [[nodiscard]] double guard(double, const V& x) const
    {
        return x[0];
    }
    [[nodiscard]] static GuardInfo guard_info() { return {.unilateral = true}; }
    static void reset(double, X& x) { x[1] = -0.5 * x[1]; }
    void rest(double t, X& x) const
    {
        x[0] = x[1] = 0;
        if (clock_is_set) x[2] = t;
    }
};

/// The box on its floor at time t.
class OnFloor {
public:
    explicit OnFloor(Box box, double t = 0, const X& x = {0, 0, 0})
        : box_(std::move(box)),
          adapter_(box_, X{}),
          system_(detail::system_table<Box, X>, &adapter_),
          step(box_, t, x),
          table(system_,
                detail::GuardRules::of(detail::DetectorTableOf<Extremum, Box, X>::make(extremum_),
                                       system_),
                false),
          holds(system_, step, table, calls, false)
    {
        table.sample_start(step, calls, scale);
        table.arm(0, Side::above);
    }

    /// Brings the box to rest; true if what has to be held is held.
    [[nodiscard]] bool rests()
    {
        holds.add({.guard = 0});
        return holds.hold_rested(scale) == no_guard;
    }
    [[nodiscard]] double lifted_in(double length)
    {
        const auto release = holds.first_release(length, [this](double s, Core& x) {
            x = step.x0();
            x[2] += s;
        });
        EXPECT_EQ(release.hold, release.at < length ? 0 : no_guard);
        return release.at;
    }

    static constexpr double scale = 0.01;

private:
    Box box_;
    detail::SystemAdapter<Box, X> adapter_;
    detail::SystemAt<Core> system_;
    Extremum extremum_;

public:
    test::StepOf<Dopri5, Box, X> step;
    std::uint64_t calls = 0;
    detail::GuardTable<Core, false> table;
    detail::HeldComponents<Core, false> holds;
};

[[nodiscard]] Box pressed_until(double t)
{
    return {.load = [=](double now) { return now - t; }};
}

TEST(HeldComponents, ARestHoldsWhatItSetsWhileTheFlowPresses)
{
    OnFloor box(pressed_until(1));
    ASSERT_TRUE(box.rests());
    EXPECT_TRUE(box.holds.is_held(0));
    EXPECT_TRUE(box.holds.has_changed());
    ASSERT_EQ(box.step.held().size(), 2U);
    EXPECT_EQ(box.step.rate0()[1], 0);  // the load no longer accelerates it
    EXPECT_EQ(box.step.rate0()[2], 1);

    OnFloor lifted(pressed_until(-1));  // the load lifts it: nothing is held, which is right
    EXPECT_TRUE(lifted.rests());
    EXPECT_TRUE(lifted.holds.empty());
    EXPECT_TRUE(lifted.step.held().empty());
}

TEST(HeldComponents, AValueThatMovesWithTheTimeCannotBeHeld)
{
    Box box = pressed_until(1);
    box.clock_is_set = true;
    OnFloor floor(box);
    EXPECT_FALSE(floor.rests());
}

TEST(HeldComponents, TheLiftIsWhereTheFreeFlowLeavesTheSurface)
{
    // The drift over `ahead`, at most the scale, exceeds the rounding of a height of zero where the
    // load turns.
    OnFloor box(pressed_until(0.25));
    ASSERT_TRUE(box.rests());
    EXPECT_EQ(box.holds.lifted(), no_guard);
    EXPECT_EQ(box.lifted_in(0.2), 0.2);
    EXPECT_NEAR(box.lifted_in(1), 0.25, 1e-12);

    OnFloor later(pressed_until(0.25), 0.5);
    later.holds.add({.guard = 0});
    EXPECT_EQ(later.holds.hold_rested(later.scale), no_guard);
    EXPECT_TRUE(later.holds.empty());
}

TEST(HeldComponents, AResetOfAHeldComponentReleasesItAndOneOfAnotherDoesNot)
{
    OnFloor box(pressed_until(1));
    ASSERT_TRUE(box.rests());
    Core after = box.step.x0();
    after[2] = 7;
    box.holds.release_changed(box.step.x0(), after, false);
    EXPECT_FALSE(box.holds.empty());
    after[1] = 1;
    box.holds.release_changed(box.step.x0(), after, false);
    EXPECT_TRUE(box.holds.empty());
    EXPECT_TRUE(box.step.held().empty());

    OnFloor other(pressed_until(1));
    ASSERT_TRUE(other.rests());
    other.holds.release_changed(other.step.x0(), other.step.x0(), true);  // another mode
    EXPECT_TRUE(other.holds.empty());
}

TEST(HeldComponents, ARestIsHeldAgainWhereARunContinues)
{
    const auto all = [](std::size_t) { return true; };
    OnFloor box(pressed_until(1));
    box.holds.hold_again(box.scale, [](std::size_t) { return false; });
    EXPECT_TRUE(box.holds.empty());
    box.holds.hold_again(box.scale, all);
    EXPECT_TRUE(box.holds.is_held(0));

    OnFloor moving(pressed_until(1), 0, {0, -1, 0});  // `rest` would change it
    moving.holds.hold_again(moving.scale, all);
    EXPECT_TRUE(moving.holds.empty());
    OnFloor above(pressed_until(1), 0, {1e-3, 0, 0});
    above.holds.hold_again(above.scale, all);
    EXPECT_TRUE(above.holds.empty());
}

TEST(HeldComponents, NothingMovesWhereNoRateAndNoLaterFlowDoes)
{
    OnFloor box(pressed_until(1));
    ASSERT_TRUE(box.rests());
    box.holds.review(1);
    EXPECT_FALSE(box.holds.rests());  // the clock runs
}

TEST(HeldComponents, WhatIsKeptIsPutBack)
{
    OnFloor box(pressed_until(1));
    ASSERT_TRUE(box.rests());
    const auto kept = box.holds.keep();
    box.holds.forget();
    EXPECT_TRUE(box.step.held().empty());
    box.holds.put_back(kept);
    EXPECT_TRUE(box.holds.is_held(0));
    EXPECT_EQ(box.step.held().size(), 2U);
    EXPECT_TRUE(box.holds.fit(3));
    EXPECT_FALSE(box.holds.fit(1));  // the velocity would be no component
}

}  // namespace
}  // namespace ricochet::held_components_test
