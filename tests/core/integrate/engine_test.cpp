// The engine as a member of a loop that is not one of the library's: of ten lines, with steps of
// one length.
#include "core/engine.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>

#include "core/instantiate.hpp"
#include "ricochet/simulation.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::engine_test {
namespace {

using X = std::array<double, 2>;
using Core = detail::CoreState<X>;
using Engine = detail::EventEngine<Core, false>;

/// A loop for a system from `start`, with steps of `h` [s].
template <class System>
class TenLines {
    using Components = detail::RunComponents<System, X, FixedStep<Dopri5>, Extremum, Newton>;

public:
    TenLines(const System& system, const X& start, const Options& options, double h)
        : components_(system, start, FixedStep<Dopri5>{}, Extremum{}, Newton{}),
          setup_(components_.setup()),
          engine(setup_, detail::core_state(start), options, {.who = "ten lines"}),
          h_(h)
    {
        engine.h_next() = h;
        engine.refuse_bad_guards();
        engine.arm_at_start(true);
        engine.settle_all();
    }

    /// Takes a step, with the first set of events in it. True: there was one.
    bool take_step()
    {
        detail::Step<Core>& step = engine.step();
        EXPECT_TRUE(step.attempt(h_));
        bool cleared = false;
        if (engine.deserves_search(cleared) && engine.find(cleared)) {
            engine.apply_found();
            engine.settle_all();
            return true;
        }
        step.accept();
        engine.last_h() = h_;
        return false;
    }

private:
    Components components_;
    detail::RunBindings<Core> setup_;

public:
    Engine engine;

private:
    double h_;
};

TEST(EventEngine, FindsAppliesSettlesAndRecords)
{
    // From 1 m at rest: every step is exact, and the floor is reached after sqrt(2 / g).
    const BouncingBall ball({.gravity = 2, .restitution = 0.5});
    TenLines loop(ball, {1, 0}, {.t_end = 10}, 0.3);
    EXPECT_FALSE(loop.take_step());
    EXPECT_FALSE(loop.take_step());
    EXPECT_FALSE(loop.take_step());
    EXPECT_EQ(loop.engine.guards()[0].side, Side::above);
    ASSERT_TRUE(loop.take_step());
    EXPECT_NEAR(loop.engine.set_time(), 1, 1e-15);
    EXPECT_NEAR(loop.engine.before()[1], -2, 1e-14);
    EXPECT_EQ(loop.engine.step().start().value, loop.engine.set_time());
    EXPECT_NEAR(loop.engine.step().x0()[1], 1, 1e-14);
    EXPECT_EQ(loop.engine.pending(), Engine::Pending::nothing);
    EXPECT_EQ(loop.engine.guards()[0].side, Side::above);  // it leaves upward
    ASSERT_EQ(loop.engine.run().events.size(), 1U);
    EXPECT_EQ(loop.engine.run().events[0].t, loop.engine.set_time());
    EXPECT_FALSE(loop.engine.ended());
}

TEST(EventEngine, BringsWhatAccumulatesToRestAndHoldsIt)
{
    // Flights of 1, 1/2, 1/4 ... s after the first impact at 1 s: at rest at 3 s.
    const BouncingBall ball({.gravity = 2, .restitution = 0.5});
    TenLines loop(ball, {1, 0}, {.t_end = 10}, 0.3);
    while (loop.engine.holds().empty()) {
        loop.take_step();
        ASSERT_LT(loop.engine.step().start().value, 4);
    }
    EXPECT_TRUE(loop.engine.holds().rests());
    EXPECT_NEAR(loop.engine.step().start().value, 3, 1e-10);
    EXPECT_EQ(loop.engine.run().events.back().kind, EventKind::accumulation);
    EXPECT_FALSE(loop.engine.ended());
}

/// Two clocks; where the first reaches 1, it is set back, and the second one is set ahead, across
/// the surface at 1 that is its own.
struct Cascade {
    using State = X;
    static constexpr std::size_t guard_count = 2;
    double back = 0;  ///< of the second

    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    template <class V>
    [[nodiscard]] double guard(std::size_t i, double, const V& x) const
    {
        return 1 - x[i];
    }
    void reset(std::size_t i, double, X& x) const
    {
        if (i == 0) {
            x = {0, 2};
        } else {
            x[1] = back;
        }
    }
};

TEST(EventEngine, AGuardThatIsCarriedAcrossIsTheNextSetOfTheInstant)
{
    TenLines loop(Cascade{}, {0, 0}, {.t_end = 10}, 0.75);
    EXPECT_FALSE(loop.take_step());
    ASSERT_TRUE(loop.take_step());
    const auto& events = loop.engine.run().events;
    ASSERT_EQ(events.size(), 2U);
    EXPECT_EQ(events[0].guard, 0U);
    EXPECT_EQ(events[1].guard, 1U);
    EXPECT_EQ(events[1].t, events[0].t);
    EXPECT_EQ(events[1].before[1], 2);
    EXPECT_EQ(events[1].after[1], 0);
}

TEST(EventEngine, WhatItKeepsIsPutBackAfterAnEvent)
{
    const BouncingBall ball({.gravity = 2, .restitution = 0.5});
    TenLines loop(ball, {1, 0}, {.t_end = 10}, 0.75);
    EXPECT_FALSE(loop.take_step());
    Engine::Checkpoint kept(loop.engine);
    loop.engine.keep(kept);
    const double height = loop.engine.step().x0()[0];
    double first = 0;
    for (int k = 0; k < 2; ++k) {
        ASSERT_TRUE(loop.take_step());
        if (k == 0) first = loop.engine.set_time();
        EXPECT_EQ(loop.engine.set_time(), first);
        loop.engine.put_back(kept);
        loop.engine.forget_exception(false, false);
        EXPECT_EQ(loop.engine.step().start().value, 0.75);
        EXPECT_EQ(loop.engine.step().x0()[0], height);
        EXPECT_EQ(loop.engine.guards()[0].events, 0U);
    }
}

TEST(EventEngine, ForgetsARunBeforeAnotherOneStarts)
{
    const BouncingBall ball({.gravity = 2, .restitution = 0.5});
    TenLines loop(ball, {1, 0}, {.t_end = 10}, 0.75);
    while (loop.engine.holds().empty()) loop.take_step();
    loop.engine.end(Outcome::zeno, 0);
    loop.engine.forget_run();
    EXPECT_FALSE(loop.engine.ended());
    EXPECT_TRUE(loop.engine.holds().empty());
    EXPECT_EQ(loop.engine.run().outcome, Outcome::reached_end);
    EXPECT_EQ(loop.engine.run().guard, no_guard);
    EXPECT_TRUE(std::isnan(loop.engine.guards()[0].last.t));
}

}  // namespace
}  // namespace ricochet::engine_test
