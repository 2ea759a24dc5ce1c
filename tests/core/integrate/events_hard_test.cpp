// Events that similar loops have lost or doubled: plateaus, touches of any order,
// rest that is disturbed, coincidences, starts on a surface.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "ricochet/bernstein.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/filippov.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::events_hard_test {
namespace {

using X1 = std::array<double, 1>;
using X = std::array<double, 2>;
using X3 = std::array<double, 3>;

// --- plateaus ---

/// Falls to zero at t = 1 and stays there, until t = 2 or forever.
struct Arriving {
    static constexpr bool resets = false;
    double leaves = std::numeric_limits<double>::infinity();
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const
    {
        return x[0] < 1 ? 1 - x[0] : x[0] < leaves ? 0 : leaves - x[0];
    }
};

TEST(HardEvents, AGuardThatArrivesAndStaysHasItsEventWhereverTheStepsFall)
{
    // Zero is across the surface, so the event is at the first zero, to rounding.
    for (int i = 0; i < 90; ++i) {
        const Options options{.t_end = 4, .h_max = 0.05 + 0.005 * i};
        for (const Arriving& system : {Arriving{}, Arriving{2}}) {
            for (const auto& run :
                 {integrate(system, X1{0}, options),
                  integrate(system, X1{0}, options, ErrorControlled<Dopri5>{}, Bernstein{}),
                  integrate(system, X1{0}, options, ErrorControlled<Dopri5>{}, Ends{})}) {
                ASSERT_EQ(run.events.size(), 1u) << options.h_max;
                EXPECT_EQ(run.events[0].kind, EventKind::crossing);
                EXPECT_NEAR(run.events[0].t, 1, 1e-12);
            }
        }
    }
}

/// Rises to zero at t = 1 and stays there, which is no fall; beside it a guard that falls at t = 2.
struct RisingToZero {
    std::size_t guard_count = 2;
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const { return {.resets = which == 1}; }
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(std::size_t which, double, const X1& x) const
    {
        return which == 1 ? 2 - x[0] : x[0] < 1 ? x[0] - 1 : 0;
    }
    void reset(std::size_t, double, X1& x) const { x[0] -= 0.5; }
};

TEST(HardEvents, AGuardThatRisesToAPlateauDoesNotFall)
{
    const RisingToZero system;
    for (int i = 1; i < 150; ++i) {
        const auto run =
            integrate(system, X1{0}, {.t_end = 2.4, .step = 0.01 * i}, FixedStep<Rk4>{});
        ASSERT_EQ(run.events.size(), 1u) << 0.01 * i << ", at " << run.events[0].t;
        EXPECT_EQ(run.events[0].guard, 1u);
        EXPECT_NEAR(run.events[0].t, 2, 1e-12);
    }
}

/// Guard 0 puts the second component on the surface of guard 1, where it stays until the
/// first reaches 2. State (clock, height, events of guard 1).
struct SetDown {
    std::size_t guard_count = 2;
    bool acts = true;
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.resets = which == 0 || acts};
    }
    void flow(double, const X3& x, X3& dxdt) const { dxdt = {1, x[0] > 2 ? -1.0 : 0.0, 0}; }
    [[nodiscard]] double guard(std::size_t which, double, const X3& x) const
    {
        return which == 0 ? 1 - x[0] : x[1];
    }
    void reset(std::size_t which, double, X3& x) const
    {
        x[1] = 0;
        if (which == 1) ++x[2];
    }
};

TEST(HardEvents, AGuardSetDownOnItsSurfaceHasItsEventWhenItLeaves)
{
    for (const bool acts : {true, false}) {
        const auto run = integrate(SetDown{.acts = acts}, X3{0, 1, 0}, {.t_end = 4});
        ASSERT_EQ(run.events.size(), 2u) << acts;
        EXPECT_EQ(run.events[1].guard, 1u);
        // The flow jumps at 2: an error-controlled step finds that to about its tolerance.
        EXPECT_NEAR(run.events[1].t, 2, 1e-6);
        EXPECT_EQ(run.x[2], acts ? 1 : 0);
    }
}

// --- rest ---

/// A floor without a pressing force until t = 1, and with one afterwards.
struct Pressed {
    std::size_t guard_count = 1;
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.unilateral = true}; }
    void flow(double t, const X& x, X& dxdt) const { dxdt = {x[1], t < 1 ? 0.0 : -1.0}; }
    [[nodiscard]] double guard(std::size_t, double, const X& x) const { return x[0]; }
    void reset(std::size_t, double, X& x) const
    {
        x[0] = 0;
        x[1] *= -0.5;
    }
    void rest(std::size_t, double, X& x) const { x = {0, 0}; }
};

TEST(HardEvents, AFloorHoldsWhatIsPressedOntoItLater)
{
    const auto run = integrate(Pressed{}, X{0, 0}, {.t_end = 3});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x[0], 0);
    EXPECT_EQ(run.x[1], 0);
}

/// The same floor, with a lifting force.
struct Lifted : Pressed {
    void flow(double t, const X& x, X& dxdt) const { dxdt = {x[1], t}; }
};

TEST(HardEvents, WhatAForceLiftsIsNotHeld)
{
    const auto run = integrate(Lifted{}, X{0, 0}, {.t_end = 3, .rtol = 1e-10, .atol = 1e-10});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_TRUE(run.events.empty());
    EXPECT_NEAR(run.x[0], 4.5, 1e-8);  // t^3 / 6
}

/// A ball that comes to rest in mode 1 and is thrown at t = 20.
struct Kicked {
    using State = X;
    double speed;
    static constexpr std::size_t guard_count = 1;
    static constexpr std::size_t mode_count = 2;
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.unilateral = true}; }
    void flow(Mode mode, double, const X& x, X& dxdt) const
    {
        dxdt = {mode == 0 ? x[1] : 0.0, mode == 0 ? -1.0 : 0.0};
    }
    [[nodiscard]] double guard(std::size_t, double, const X& x) const { return x[0]; }
    [[nodiscard]] Mode reset(std::size_t, Mode mode, double, X& x) const
    {
        x[0] = 0;
        x[1] *= -0.5;
        return mode;
    }
    [[nodiscard]] Mode rest(std::size_t, Mode, double, X& x) const
    {
        x = {0, 0};
        return 1;
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        return t < 20 ? 20 : std::numeric_limits<double>::infinity();
    }
    [[nodiscard]] Mode time_reset(Mode, double, X& x) const
    {
        x[1] = speed;
        return 0;
    }
};

TEST(HardEvents, AnythingKickedIntoItsFloorBouncesOrRests)
{
    for (const double speed : {-1.0, 0.0, 1.0}) {
        const auto run = integrate(Kicked{speed}, X{1, 0}, {.t_end = 40});
        EXPECT_EQ(run.outcome, Outcome::reached_end) << speed;
        EXPECT_EQ(run.mode, 1u) << speed;
        EXPECT_EQ(run.x[0], 0) << speed;
    }
}

// --- touches ---

/// (x - 1/2)^power, which touches zero for an even power.
struct Flat {
    int power;
    Crossing crossing = Crossing::either;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const { return std::pow(x[0] - 0.5, power); }
    void reset(double, X1&) const {}
};

TEST(HardEvents, FlatTouchesAreTouchesWhereverTheStepsFall)
{
    for (const int power : {2, 4, 6}) {
        for (const double step : {0.5, 0.25, 0.125, 0.1, 0.07, 0.3}) {
            const auto run =
                integrate(Flat{power}, X1{0}, {.t_end = 1, .step = step}, FixedStep<Rk4>{});
            for (const auto& event : run.events) {
                EXPECT_EQ(event.kind, EventKind::touch) << power << ' ' << step;
            }
            EXPECT_LE(run.events.size(), 1u) << power << ' ' << step;
        }
    }
}

TEST(HardEvents, AStartOnATouchIsNoEvent)
{
    for (const int power : {2, 4}) {
        for (const Crossing crossing : {Crossing::falling, Crossing::rising, Crossing::either}) {
            for (const double t : {0.0, 1.0}) {
                const Options options{
                    .t_start = t, .t_end = t + 1, .step = 0.125, .max_steps = 1000};
                const auto run =
                    integrate(Flat{power, crossing}, X1{0.5}, options, FixedStep<Rk4>{});
                EXPECT_EQ(run.outcome, Outcome::reached_end);
                EXPECT_TRUE(run.events.empty()) << power << ' ' << t;
            }
        }
    }
}

/// (x - 1/2)^2 with a time event at the touch.
struct TouchOnTime {
    static constexpr bool resets = false;
    Crossing crossing = Crossing::either;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const { return (x[0] - 0.5) * (x[0] - 0.5); }
    [[nodiscard]] double next_time_event(double t) const
    {
        return t < 0.5 ? 0.5 : std::numeric_limits<double>::infinity();
    }
};

TEST(HardEvents, ATouchAtATimeEventOrAtTheEndIsSeenOnce)
{
    for (const double t_end : {1.0, 0.5}) {
        const auto run =
            integrate(TouchOnTime{}, X1{0}, {.t_end = t_end, .step = 0.125}, FixedStep<Rk4>{});
        int touches = 0;
        int crossings = 0;
        for (const auto& event : run.events) {
            touches += event.kind == EventKind::touch;
            crossings += event.kind == EventKind::crossing;
        }
        EXPECT_EQ(touches, 1) << t_end;
        EXPECT_EQ(crossings, 0) << t_end;
    }
}

// --- starts ---

/// A straight line outside the unit disk.
struct Disk {
    using State = std::array<double, 4>;
    std::size_t guard_count = 1;
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.unilateral = true}; }
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[2], x[3], 0, 0}; }
    [[nodiscard]] double guard(std::size_t, double, const State& x) const
    {
        return std::sqrt(x[0] * x[0] + x[1] * x[1]) - 1;
    }
    void reset(std::size_t, double, State& x) const { x[2] = -x[2], x[3] = -x[3]; }
};

TEST(HardEvents, ATangentStartOnARoundedSurfaceIsNoEvent)
{
    for (int i = 0; i < 200; ++i) {
        const double a = 0.0314 * i;
        const Disk::State start{std::cos(a), std::sin(a), -std::sin(a), std::cos(a)};
        const auto run = integrate(Disk{}, start, {.t_end = 1});
        EXPECT_EQ(run.outcome, Outcome::reached_end) << a;
        EXPECT_TRUE(run.events.empty()) << a;
    }
}

// --- coincidences ---

/// Guard 0 adds a component to the state; guard 1 counts, on the same surface.
struct Growing {
    using State = std::vector<double>;
    std::size_t guard_count = 2;
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.resets = which == 0, .stop_after = which == 0 ? 0u : 5u};
    }
    void flow(double, const State&, State& dxdt) const
    {
        for (double& rate : dxdt) rate = 1;
    }
    [[nodiscard]] double guard(std::size_t, double, const State& x) const { return 1 - x[0]; }
    void reset(std::size_t, double, State& x) const { x = {0, 0}; }
};

TEST(HardEvents, AResetOfTheDimensionSurvivesACoincidence)
{
    const auto run = integrate(Growing{}, Growing::State{0}, {.t_end = 1.5});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.x.size(), 2u);
    EXPECT_NEAR(run.x[1], 0.5, 1e-12);
}

/// Counts how often the clock passes each threshold.
struct Thresholds {
    using State = std::array<double, 4>;
    std::array<double, 3> at;
    std::size_t guard_count = 3;
    void flow(double, const State&, State& dxdt) const { dxdt = {1, 0, 0, 0}; }
    [[nodiscard]] double guard(std::size_t which, double, const State& x) const
    {
        return at[which] - x[0];
    }
    void reset(std::size_t which, double, State& x) const { ++x[which + 1]; }
};

TEST(HardEvents, AGuardAfterTheWindowOfASetKeepsItsOwnTime)
{
    for (const double third : {1.12, 1.1499, 1.1501, 1.3}) {
        const auto run = integrate(Thresholds{{1, 1.05, third}}, Thresholds::State{},
                                   {.t_end = 2, .event_window = 0.1});
        ASSERT_EQ(run.events.size(), 3u) << third;
        EXPECT_EQ(run.events[0].t, run.events[1].t);
        EXPECT_NEAR(run.events[2].t, third, 1e-14);
        EXPECT_EQ(run.x[3], 1);
    }
}

TEST(HardEvents, AWindowIsHeldByOneStepWhereverTheStepsEnd)
{
    // (t - 1) (t - 1.05), which turns back in the window, and 1.08 - t.
    struct Window {
        using State = std::array<double, 2>;
        std::size_t guard_count = 2;
        void flow(double, const State&, State& dxdt) const { dxdt = {0, 0}; }
        [[nodiscard]] double guard(std::size_t which, double t, const State&) const
        {
            return which == 0 ? (t - 1) * (t - 1.05) : 1.08 - t;
        }
        void reset(std::size_t which, double, State& x) const { ++x[which]; }
    };
    const auto check = [](const auto& run, double step) {
        EXPECT_EQ(run.x, (Window::State{1, 1})) << step;
        ASSERT_EQ(run.events.size(), 2U) << step;
        EXPECT_NEAR(run.events[0].t, 1.08, 1e-14) << step;
        EXPECT_EQ(run.events[0].t, run.events[1].t) << step;
    };
    Options options{.t_end = 2, .event_window = 0.1};
    for (int k = 0; k <= 20; ++k) {
        options.step = 0.11 + 0.01 * k;
        check(integrate(Window{}, {0, 0}, options, FixedStep<Rk4>{}), options.step);
        check(integrate(Window{}, {0, 0}, options, FixedStep<Rk4>{}, Extremum{}, Bisection{}),
              options.step);
        options.h_max = options.step;
        check(integrate(Window{}, {0, 0}, options), options.step);
        options.h_max = std::numeric_limits<double>::infinity();
    }
}

/// A guard that swings about its surface, and a reset that counts its events.
struct Swinging {
    static constexpr double frequency = 100;  ///< [rad/s]
    Crossing counted = Crossing::falling;
    [[nodiscard]] GuardInfo guard_info() const { return {.crossing = counted}; }
    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(double t, const X&) const { return std::sin(frequency * t + 0.5); }
    void reset(double, X& x) const { ++x[1]; }
};

TEST(HardEvents, AGuardThatSwingsBackAndCrossesAgainInTheWindowHasANewEvent)
{
    for (const Crossing counted : {Crossing::falling, Crossing::rising, Crossing::either}) {
        // It falls through zero at odd multiples of pi, and rises at even ones; 63 within 2 s.
        const std::size_t events = counted == Crossing::falling  ? 32
                                   : counted == Crossing::rising ? 31
                                                                 : 63;
        for (const double step : {0.01, 0.05, 0.1, 0.2}) {
            for (const double window : {0.0, 0.1, 1.0}) {
                const auto run =
                    integrate(Swinging{counted}, X{0, 0},
                              {.t_end = 2, .step = step, .event_window = window}, FixedStep<Rk4>{});
                EXPECT_EQ(run.outcome, Outcome::reached_end) << step << ", " << window;
                EXPECT_EQ(run.events.size(), events) << step << ", " << window;
                EXPECT_EQ(run.x[1], static_cast<double>(events)) << step << ", " << window;
                EXPECT_EQ(run.statistics.suppressed, 0u) << step << ", " << window;
            }
        }
    }
}

/// A tank that fills, is closed when it is full, and is emptied every 2 s.
struct Tank {
    enum : Mode { fills, closed };
    double level = 1;  ///< at which the reset leaves it
    void flow(Mode mode, double, const X&, X& dxdt) const { dxdt = {mode == fills ? 1.0 : 0.0, 0}; }
    [[nodiscard]] double guard(Mode, double, const X& x) const { return 1 - x[0]; }
    [[nodiscard]] Mode reset(Mode, double, X& x) const
    {
        x = {level, x[1] + 1};
        return closed;
    }
    [[nodiscard]] double next_time_event(double t) const { return 2 * std::floor(t / 2) + 2; }
    [[nodiscard]] Mode time_reset(Mode, double, X& x) const
    {
        x[0] = 0;
        return fills;
    }
};

TEST(HardEvents, AGuardThatItsResetHoldsStillDoesNotAccumulate)
{
    for (const double level : {0.9, 1.0, 1.2}) {
        const auto run = integrate(Tank{level}, X{0, 0}, {.t_end = 100});
        EXPECT_EQ(run.outcome, Outcome::reached_end) << level;
        EXPECT_EQ(run.x[1], 50) << level;
        EXPECT_EQ(run.events.size(), 100u) << level;
    }
}

/// Falls from 1 with the speed 1; guard 0 throws it back to 1 at zero, and guard 1, with the same
/// surface, ends the run.
struct Stopped {
    static constexpr std::size_t guard_count = 2;
    Crossing counted = Crossing::falling;
    std::uint32_t stop_after = 1;
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        if (which == 0) return {};
        return {.crossing = counted, .resets = false, .stop_after = stop_after};
    }
    void flow(double, const X1&, X1& dxdt) const { dxdt = {-1}; }
    [[nodiscard]] double guard(std::size_t, double, const X1& x) const { return x[0]; }
    void reset(std::size_t, double, X1& x) const { x = {1}; }
};

TEST(HardEvents, TheGuardThatEndsARunIsNamedAmongThoseThatFire)
{
    const auto run = integrate(Stopped{.stop_after = 2}, X1{1}, {.t_end = 10});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(run.guard, 1u);
    EXPECT_NEAR(run.t, 2, 1e-14);
}

TEST(HardEvents, AGuardWithoutAResetIsCarriedBackWhetherOrNotItMayEndTheRun)
{
    // It falls and is carried back at each of the times 1, 2, 3, ...
    for (const std::uint32_t events : {1u, 2u, 3u, 4u, 5u}) {
        const auto run = integrate(Stopped{Crossing::either, events}, X1{1}, {.t_end = 10});
        EXPECT_EQ(run.outcome, Outcome::stopped_by_event) << events;
        const std::uint32_t falls = (events + 1) / 2;
        EXPECT_NEAR(run.t, falls, 1e-14) << events;
        EXPECT_EQ(run.guard, 1u) << events;
    }
}

/// Falls through zero; guard 0 sets a flag there, and guard 1, with the same surface, is enabled
/// where the flag is set.
struct Flagged {
    static constexpr std::size_t guard_count = 2;
    double factor = 1;
    double speed = 1;
    void flow(double, const X3&, X3& dxdt) const { dxdt = {-speed, 0, 0}; }
    [[nodiscard]] double guard(std::size_t which, double, const X3& x) const
    {
        return which == 0 ? x[0] : factor * x[0];
    }
    [[nodiscard]] bool enabled(std::size_t which, double, const X3& x) const
    {
        return which == 0 || x[1] > 0;
    }
    void reset(std::size_t which, double, X3& x) const { ++x[which + 1]; }
};

TEST(HardEvents, AGuardThatCrossedWhileItWasDisabledDoesNotFireWhenItIsEnabled)
{
    for (int k = 0; k < 100; ++k) {
        const Flagged system{.factor = k % 2 == 0 ? 1 : 0.25, .speed = 1 + 0.01 * k};
        const auto run = integrate(system, X3{1, 0, 0}, {.t_end = 3});
        EXPECT_EQ(run.events.size(), 1u) << k;
        EXPECT_EQ(run.x[2], 0) << k;
    }
}

/// Passes given times, each an event of the same guard.
struct Train {
    std::vector<double> times;
    Crossing crossing = Crossing::falling;
    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(double, const X& x) const
    {
        const auto next = static_cast<std::size_t>(x[1]);
        return (next < times.size() ? times[next] : 1e9) - x[0];
    }
    void reset(double, X& x) const { ++x[1]; }
    void rest(double, X&) const {}
};

TEST(HardEvents, AShortGapAfterShrinkingOnesIsNoAccumulation)
{
    for (const double gap : {1e-3, 1e-7, 1e-10, 1e-13}) {
        const Train train{{1, 4, 6, 7, 7 + gap, 8, 9, 10}};
        const auto run = integrate(train, X{0, 0}, {.t_end = 12});
        EXPECT_EQ(run.outcome, Outcome::reached_end) << gap;
        ASSERT_EQ(run.events.size(), train.times.size()) << gap;
        for (const auto& event : run.events) EXPECT_EQ(event.kind, EventKind::crossing);
    }
}

/// A bouncing ball with a time event just before its bounces accumulate.
struct Interrupted {
    double time;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -1}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    void reset(double, X& x) const
    {
        x[0] = 0;
        x[1] *= -0.5;
    }
    void rest(double, X& x) const { x = {0, 0}; }
    [[nodiscard]] double next_time_event(double t) const
    {
        return t < time ? time : std::numeric_limits<double>::infinity();
    }
};

TEST(HardEvents, AnAccumulationDoesNotOvertakeATimeEvent)
{
    // The bounces from 1 m accumulate at 3 sqrt 2 = 4.24264...
    for (const double time : {4.242, 4.2424, 4.2426, 4.2426406871192848}) {
        const auto run =
            integrate(Interrupted{time}, X{1, 0}, {.t_end = 4.5, .event_tolerance = 1e-3});
        double last = 0;
        for (const auto& event : run.events) {
            EXPECT_GE(event.t, last);
            last = event.t;
        }
        EXPECT_EQ(run.t, 4.5);
    }
}

// --- predicates, snapshots, numbers ---

/// The reset of guard 0 carries guard 1 across its surface, but that does not count.
struct Ruled {
    std::size_t guard_count = 2;
    void flow(double, const X3&, X3& dxdt) const { dxdt = {1, 0, 0}; }
    [[nodiscard]] double guard(std::size_t which, double, const X3& x) const
    {
        return which == 0 ? 1 - x[0] : x[1];
    }
    [[nodiscard]] bool enabled(std::size_t which, double, const X3&) const { return which == 0; }
    void reset(std::size_t which, double, X3& x) const
    {
        x[1] = -1;
        if (which == 1) x[2] = 1;
    }
};

TEST(HardEvents, APredicateHoldsForGuardsThatAResetFlips)
{
    const auto run = integrate(Ruled{}, X3{0, 1, 0}, {.t_end = 2});
    EXPECT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.x[2], 0);
    EXPECT_GE(run.statistics.disabled, 1u);
}

TEST(HardEvents, AGuardThatIsNoNumberEndsTheRunOnAPlateauToo)
{
    struct Broken {
        static constexpr bool resets() { return false; }
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] double guard(double, const X1& x) const
        {
            return x[0] < 0.5 ? 0 : std::numeric_limits<double>::quiet_NaN();
        }
    };
    EXPECT_EQ(integrate(Broken{}, X1{0}, {.t_end = 4, .h_max = 0.1}).outcome, Outcome::non_finite);
}

TEST(HardEvents, AGuardThatBecomesInfiniteHasNoEventThere)
{
    struct Broken {
        static constexpr bool resets() { return false; }
        double beyond;
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] double guard(double, const X1& x) const { return x[0] < 1.5 ? 1.2 : beyond; }
    };
    for (const double sign : {-1.0, 1.0}) {
        for (const double h_max : {0.1, 0.4, 10.0}) {
            const auto run = integrate(Broken{sign * std::numeric_limits<double>::infinity()},
                                       X1{0}, {.t_end = 3, .h_max = h_max});
            EXPECT_EQ(run.outcome, Outcome::non_finite);
            EXPECT_NEAR(run.t, 1.5, 1e-12);
            EXPECT_TRUE(run.events.empty()) << sign << " " << h_max;
        }
    }
}

TEST(HardEvents, ASpoiltSnapshotIsRefusedAndChangesNothing)
{
    const Pressed system;
    Simulation<Pressed, X> simulation(system, X{1, 0}, {.t_end = 3});
    simulation.step();
    const Snapshot good = simulation.save();
    for (std::size_t i = 0; i < good.numbers.size(); ++i) {
        Snapshot bad = good;
        bad.numbers[i] = std::numeric_limits<double>::quiet_NaN();
        try {
            simulation.restore(bad);
        } catch (const std::invalid_argument&) {
            EXPECT_EQ(to_text(simulation.save()), to_text(good)) << i;
        }
        simulation.restore(good);
    }
    Snapshot bad = good;
    bad.numbers[0] = std::numeric_limits<double>::infinity();  // the time
    EXPECT_THROW(simulation.restore(bad), std::invalid_argument);
    bad = good;
    bad.numbers.pop_back();
    EXPECT_THROW(simulation.restore(bad), std::invalid_argument);
    EXPECT_EQ(to_text(simulation.save()), to_text(good));
}

// --- driving ---

TEST(HardEvents, AdvanceStopsAtSamplesAndShowsTheLastEvent)
{
    struct Clock {
        static constexpr bool resets() { return false; }
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] double guard(double, const X1& x) const { return 1.2 - x[0]; }
    };
    const Clock clock;
    Simulation<Clock, X1> simulation(
        clock, X1{0}, {.t_end = 3, .stop_at_event = true, .sample_times = {0.5, 1.0, 2.0}});
    std::vector<double> shown;
    while (simulation.advance()) {
        shown.push_back(simulation.t());
        EXPECT_NEAR(simulation.x()[0], simulation.t(), 1e-12);
    }
    ASSERT_EQ(shown.size(), 3u);
    EXPECT_EQ(shown[0], 0.5);
    EXPECT_EQ(shown[1], 1.0);
    EXPECT_NEAR(shown[2], 1.2, 1e-12);
}

struct Relay {
    static constexpr std::size_t surface_count = 1;
    template <class V>
    [[nodiscard]] double surface(std::size_t, double, const V& x) const
    {
        return x[0];
    }
    template <class V>
    void field(std::size_t region, double, const V&, V& dxdt) const
    {
        dxdt[0] = (region & 1) != 0 ? -1 : 1;
    }
};

TEST(HardEvents, SlidingMotionIsNotRunBackward)
{
    const Filippov<Relay> system{Relay{}};
    EXPECT_THROW(static_cast<void>(integrate(system, X1{1}, {.t_start = 1, .t_end = 0})),
                 std::invalid_argument);
}

// --- a straight guard beside a state that bends ---

struct StraightGuard {
    using State = std::array<double, 2>;
    double at = 1;
    void flow(double, const State& x, State& dxdt) const { dxdt = {1, -x[1]}; }
    [[nodiscard]] double guard(double, const State& x) const { return at - x[0]; }
    void reset(double, State& x) const { x[0] = 0; }
};

TEST(HardEvents, AnEventAtTheEndOfAStepHasTheStateOfTheStep)
{
    // The guard reaches zero at the end of a step, up to rounding. The other component is that of
    // rk4, off exp(-t) by h^5 / 120 per step: no state may be extrapolated along the tangent.
    for (const double h : {0.125, 0.1, 0.05}) {
        for (const double at : {0.5, 0.75, 1.0}) {
            const auto run =
                integrate(StraightGuard{at}, {0, 1}, {.t_end = 1.2, .step = h}, FixedStep<Rk4>{});
            ASSERT_GE(run.events.size(), 1u);
            EXPECT_NEAR(run.events[0].t, at, 1e-15);
            EXPECT_NEAR(run.events[0].before[1], std::exp(-at), 2 * std::pow(h, 4) * at / 120)
                << h << ' ' << at;
            EXPECT_LT(run.statistics.resteps, 8u);
        }
    }
}

/// x'' = -x with a pole at x = 0.3, where the speed grows by a kick.
struct Pole {
    using State = std::array<double, 2>;

    bool resets = true;

    [[nodiscard]] GuardInfo guard_info(std::size_t) const
    {
        return {.crossing = Crossing::either, .resets = resets};
    }
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    template <class X>
    [[nodiscard]] double guard(double, const X& x) const
    {
        return 1 / (x[0] - 0.3);
    }
    void reset(double, State& x) const { x[1] += std::copysign(1e-3, x[1]); }
};

TEST(HardEvents, APoleIsPassedAsAJumpAndDoesNotHideTheNext)
{
    // From 1 at rest, 0.3 is passed twice in each of three turns. Beside the pole the guard is
    // 1e16, and the event, with its tolerance and its size, must not leave any trace of it.
    for (const bool resets : {true, false}) {
        const auto run = integrate(Pole{.resets = resets}, {1.0, 0.0},
                                   {.t_end = 18.8, .rtol = 1e-9, .atol = 1e-9});
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        ASSERT_EQ(run.events.size(), 6u);
        for (const auto& event : run.events) {
            EXPECT_EQ(event.kind, EventKind::jump);
            // On the other side already, by some units in the last place; if the event is only
            // recorded, the state is the polynomial's, which has the error of the step.
            EXPECT_NEAR(event.before[0], 0.3, resets ? 1e-14 : 1e-9);
            EXPECT_NE(event.before[0], 0.3);
        }
        EXPECT_NEAR(run.events[0].t, std::acos(0.3), 1e-8);
    }
}

/// A ball that is dropped from 1 m and loses a tenth of its speed at every impact.
struct Ball {
    using State = X;
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.unilateral = true}; }
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    void reset(double, X& x) const { x = {0, -0.9 * x[1]}; }
    void rest(double, X& x) const { x = {0, 0}; }
};

TEST(HardEvents, ImpactsDoNotDependOnHowFarTheEndLies)
{
    // All of them happen within 8.6 s, and the longest of their flights is the second, 0.81 s:
    // a step never exceeds two flights.
    std::vector<double> expected;
    for (const double t_end : {30.0, 31.0, 1e3, 1e6, 1e9, 1e15, 1e100, 1e300}) {
        for (const double h_max : {1.7, 5.0, 1e3, 1e300}) {
            const auto run = integrate(Ball{}, {1, 0}, {.t_end = t_end, .h_max = h_max});
            std::vector<double> impacts;
            for (const auto& event : run.events) impacts.push_back(event.t);
            EXPECT_EQ(run.outcome, Outcome::reached_end);
            if (expected.empty()) expected = impacts;
            EXPECT_EQ(impacts, expected) << "t_end " << t_end << ", h_max " << h_max;
        }
    }
    EXPECT_GT(expected.size(), 200u);
}

/// A weight on a spring, a surface that moves under it, and a guard with a reset beside a
/// recorded one with the same surface, which is computed in a different way.
struct CountedCrossings {
    std::size_t guard_count = 2;
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const { return {.resets = which == 0}; }
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -x[0]}; }
    [[nodiscard]] double guard(std::size_t which, double t, const X& x) const
    {
        const double surface = 0.4 - 0.6 * std::sin(1.3 * t + 0.2);
        return which == 0 ? std::sinh(x[0] - surface) : 3.1 * x[0] - 3.1 * surface;
    }
    void reset(std::size_t, double, X& x) const { x[1] *= 0.9; }
};

TEST(HardEvents, ARecordedGuardHasItsEventOnceWhereAResetSharesItsSurface)
{
    // The two determine their surface only up to their roundings, and the reset is applied where
    // the first of them is zero: the state may still be before the other, or a rounding beyond it.
    // Where the motion only grazes it, at a few hundredths of its speed, the reset may turn it back
    // from there: then the other guard has not changed its sign.
    int grazes = 0;
    for (int i = 0; i < 180; ++i) {
        const auto run = integrate(CountedCrossings{}, X{1.328 + 0.00006 * i, 0.3},
                                   {.t_start = 7, .t_end = 40, .rtol = 1e-11, .h_max = 0.3});
        int resets = 0;
        for (const auto& event : run.events) {
            if (!changes_sign(event.kind) || event.guard != 0) continue;
            ++resets;
            const auto recorded =
                std::count_if(run.events.begin(), run.events.end(), [&](const auto& other) {
                    return other.guard == 1 && changes_sign(other.kind) &&
                           std::fabs(other.t - event.t) < 1e-6;
                });
            if (recorded == 0 && std::fabs(event.slope) < 0.05) {
                ++grazes;
            } else {
                ASSERT_EQ(recorded, 1) << "start " << i << ", at " << event.t;
            }
        }
        ASSERT_GT(resets, 2);
    }
    EXPECT_LE(grazes, 9);  // 4; of 1800 starts up to 1.436 there are 12
}

TEST(HardEvents, AStartThatTellsNoTimeScaleDoesNotTakeItFromTheEnd)
{
    // At rest at the origin, under a force that grows with the time: x = t^3 / 6 meets 1.
    struct Pushed {
        static constexpr bool resets() { return false; }
        void flow(double t, const X& x, X& dxdt) const { dxdt = {x[1], t}; }
        [[nodiscard]] double guard(double, const X& x) const { return 1 - x[0]; }
    };
    std::vector<double> times;
    for (const double t_end : {2.0, 30.0, 1e9, 1e300}) {
        const auto run = integrate(Pushed{}, X{0, 0}, {.t_end = t_end, .stop_at_event = true});
        EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
        times.push_back(run.t);
    }
    EXPECT_NEAR(times[1], std::cbrt(6), 1e-8);
    EXPECT_EQ(times[2], times[1]);
    EXPECT_EQ(times[3], times[1]);
}

/// A crest one unit in the last place high, where the guard is zero at a great many offsets; its
/// declared rate falls there, like that of a flow that jumps at the surface.
struct RoundedCrest {
    static constexpr bool resets = false;
    static constexpr Crossing crossing = Crossing::either;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -1}; }
    [[nodiscard]] double guard(double, const X& x) const { return x[0] - 1; }
    [[nodiscard]] double guard_rate(double, const X& x, const X& dxdt) const
    {
        return x[0] >= 1 ? -0.12975690807267726 : dxdt[0];
    }
};

TEST(HardEvents, ARateThatContradictsASurfaceOfRoundingIsNotFollowedForEver)
{
    const double step = 5.2524596791578209e-08;
    const auto run = integrate(RoundedCrest{}, X{0.99999999999999978, 3.1083531824869161e-08},
                               {.t_end = 3 * step, .step = step}, FixedStep<Rk4>{});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    // Nine in a row, and a doubling of the omitted part after each: 30 of them span the step.
    EXPECT_LE(run.events.size(), 3 * 30 * 9U);
}

/// Two roots close to each other, passed at unit speed.
struct CloseRoots {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;
    void flow(double, const State&, State& dxdt) const { dxdt[0] = 1; }
    [[nodiscard]] double guard(double, const State& x) const
    {
        return (x[0] - 1.111) * (x[0] - 1.114);
    }
    [[nodiscard]] GuardInfo guard_info() const { return {.crossing = Crossing::either}; }
};

TEST(HardEvents, TomsFindsEachOfTwoCloseRootsOnce)
{
    const auto run = integrate(CloseRoots{}, X1{0.0}, {.t_end = 3, .step = 0.25}, FixedStep<Rk4>{},
                               Extremum{}, Toms748{});
    ASSERT_EQ(run.events.size(), 2U);
    // The guard's slope is 0.003, so its rounding, some 1e-19, moves a root by less than 1e-15.
    EXPECT_NEAR(run.events[0].t, 1.111, 2e-15);
    EXPECT_NEAR(run.events[1].t, 1.114, 2e-15);
}

/// Two roots, the first of which lies at the end of a step to half a unit in the last place.
struct RootAtAnEnd {
    using State = X1;
    static constexpr bool resets = false;
    double first = 0;
    double second = 0;
    void flow(double, const X1&, X1& dxdt) const { dxdt[0] = 1; }
    [[nodiscard]] double guard(double, const X1& x) const
    {
        return (x[0] - first) * (x[0] - second);
    }
    [[nodiscard]] GuardInfo guard_info() const { return {.crossing = Crossing::either}; }
};

TEST(HardEvents, ACrossingAtTheEndOfAStepLeavesTheGuardArmedForTheNext)
{
    // Where x is off + s, its rounding hides the guard's sign in the rest of the step; its rate
    // shows that it continues.
    for (const double off : {0.0, 1.0, 10.0, 100.0, 1e4}) {
        for (const double gap : {0.02, 0.2}) {
            for (const double step : {0.25, 0.125}) {
                const RootAtAnEnd system{.first = off + 0.25, .second = off + 0.25 + gap};
                const auto run =
                    integrate(system, X1{off}, {.t_end = 3, .step = step}, FixedStep<Rk4>{});
                ASSERT_EQ(run.events.size(), 2U) << off << ' ' << gap << ' ' << step;
                // Roots are located to the rounding of x, half a unit each of x and of the guard's
                // two factors.
                const double rounding = 4 * std::numeric_limits<double>::epsilon() * (off + 1);
                EXPECT_NEAR(run.events[0].t, 0.25, rounding);
                EXPECT_NEAR(run.events[1].t, 0.25 + gap, rounding);
            }
        }
    }
}

/// A guard that stands still between the resets of another, which carry it across its surface.
struct Flag {
    using State = X;
    static constexpr std::size_t guard_count = 2;
    Crossing crossing = Crossing::either;
    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 ? 1 - x[0] : x[1];
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.crossing = which == 0 ? Crossing::falling : crossing};
    }
    void reset(std::size_t which, double, X& x) const
    {
        if (which == 0) x = {0, -x[1]};
    }
};

TEST(HardEvents, AGuardThatStandsStillBetweenFlipsDoesNotAccumulate)
{
    // The first guard has 20 events; the other falls at ten of them and rises at ten.
    for (const auto& [crossing, events] :
         {std::pair{Crossing::either, 40U}, std::pair{Crossing::falling, 30U},
          std::pair{Crossing::rising, 30U}}) {
        const auto run = integrate(Flag{crossing}, X{0, 1}, {.t_end = 20.5});
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.events.size(), events);
    }
}

/// As `RootAtAnEnd`, with a reset that changes nothing.
struct ResetAtRoots : RootAtAnEnd {
    void reset(double, X1&) const {}
};

TEST(HardEvents, ARootNextToTheEndOfAStepIsResetOnce)
{
    // From the root to the end of the step is a unit in the last place of the state, in which the
    // guard is zero by rounding.
    int runs = 0;
    for (const double off : {0.0, 1.0, 10.0, 100.0, 1e4}) {
        for (int i = 1; i <= 8; ++i) {
            for (const double gap : {0.02, 0.0525, 0.11, 0.2, 0.3, 0.6}) {
                ResetAtRoots system;
                system.first = off + i * 0.25;
                system.second = system.first + gap;
                const auto run = integrate(system, X1{off}, {.t_end = 3, .step = 0.01},
                                           FixedStep<Rk4>{}, Ends{}, Newton{});
                EXPECT_EQ(run.events.size(), 2U) << off << ' ' << i << ' ' << gap;
                ++runs;
            }
        }
    }
    EXPECT_EQ(runs, 240);
}

/// An oscillator with a reset that changes nothing, or whose events are rejected. The guard throws
/// where a run evaluates it without end.
struct Unmoved {
    using State = X;
    bool rejects = false;
    mutable int calls = 0;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -x[0]}; }
    template <class View>
    [[nodiscard]] double guard(double, const View& x) const
    {
        if (++calls > 20'000) throw std::runtime_error("too many calls of the guard");
        return x[0] - 0.3;
    }
    [[nodiscard]] GuardInfo guard_info() const { return {.crossing = Crossing::either}; }
    [[nodiscard]] bool enabled(double, const X&) const { return !rejects; }
    void reset(double, X&) const {}
};

/// The guard crosses its surface at most twice in a turn, and once where it ends on the other side.
template <class Stepping>
void expect_single_crossings(const Options& options)
{
    for (const bool rejects : {false, true}) {
        for (int k = 0; k < 100; ++k) {
            const double angle = 0.0628 * k;
            const Unmoved system{.rejects = rejects};
            const X start{std::cos(angle), std::sin(angle)};
            const auto run = integrate(system, start, options, Stepping{});
            const auto crossings = rejects ? run.statistics.disabled : run.events.size();
            EXPECT_LE(crossings, 2U) << k;
            EXPECT_EQ(crossings % 2 == 1, (start[0] > 0.3) != (run.x[0] > 0.3)) << k;
            for (const auto& event : run.events) {
                // The offset in the step and the state there are rounded by 1e-16 each.
                EXPECT_NEAR(event.before[0], 0.3, 1e-15) << k;
                EXPECT_EQ(event.before, event.after);
            }
        }
    }
}

TEST(HardEvents, AnEventThatChangesNothingIsFoundOnceWhereTheStepDiffersFromItsPolynomial)
{
    // The event is located on the method's own step, which has its state. The polynomial, on which
    // the rest of the step is examined, crosses the surface later.
    expect_single_crossings<FixedStep<Euler>>({.t_end = 6.2, .step = 0.2});
    expect_single_crossings<FixedStep<Euler>>({.t_end = 6.2, .step = 0.05});
    expect_single_crossings<FixedStep<Rk4>>({.t_end = 6.2, .step = 0.9});
    expect_single_crossings<ErrorControlled<Dopri5>>({.t_end = 6.2, .rtol = 1e-2, .atol = 1e-2});
    expect_single_crossings<ErrorControlled<CashKarp54>>(
        {.t_end = 6.2, .rtol = 1e-2, .atol = 1e-2});
}

/// A clock beside a motion that makes its steps irregular.
struct Alarm {
    using State = X1;
    static constexpr bool resets = false;
    double at = 0;
    void flow(double t, const X1&, X1& dxdt) const { dxdt[0] = std::cos(t); }
    [[nodiscard]] double guard(double t, const X1&) const { return t - at; }
    [[nodiscard]] GuardInfo guard_info() const { return {.crossing = Crossing::either}; }
};

TEST(HardEvents, AGuardThatIsZeroAtTheEndOfTheRunHasItsEventThere)
{
    // The end of the last step rounds to t_end, or the guard is a unit in the last place short.
    for (int k = 1; k <= 2000; ++k) {
        const double end = 0.001 * k;
        const auto run = integrate(Alarm{end}, X1{0}, {.t_end = end});
        ASSERT_EQ(run.events.size(), 1U) << k;
        // The guard is zero at two neighbouring times where the sum of a step rounds to the other.
        EXPECT_NEAR(run.events[0].t, end, std::numeric_limits<double>::epsilon() * end) << k;
        EXPECT_EQ(run.t, end);
        const auto early = integrate(Alarm{-end}, X1{0}, {.t_start = -2.5, .t_end = -end});
        ASSERT_EQ(early.events.size(), 1U) << k;
        const auto back = integrate(Alarm{-end}, X1{0}, {.t_end = -end});
        ASSERT_EQ(back.events.size(), 1U) << k;
    }
}

TEST(HardEvents, ASampleAtTheTimeOfAnEventShowsTheStateAfterIt)
{
    std::size_t samples = 0;
    for (int k = 0; k < 200; ++k) {
        const X start{0.5 + 0.0125 * k, 0};
        Options options{.t_end = 2, .rtol = 1e-9, .atol = 1e-9};
        const auto run = integrate(BouncingBall(), start, options);
        for (const auto& event : run.events) options.sample_times.push_back(event.t);
        const auto sampled = integrate(BouncingBall(), start, options);
        ASSERT_EQ(sampled.trajectory.x.size(), run.events.size());
        for (std::size_t i = 0; i < run.events.size(); ++i) {
            // The event is within a unit in the last place of 2 s, in which the ball falls 2e-15 m.
            EXPECT_NEAR(sampled.trajectory.x[i][0], run.events[i].after[0], 4e-15) << k;
            EXPECT_NEAR(sampled.trajectory.x[i][1], run.events[i].after[1], 4e-15) << k;
            ++samples;
        }
    }
    EXPECT_GT(samples, 300U);
}

/// A state that does not move, and a cubic of the time, with roots at 1, 1.25 and 60.
struct Timetable {
    using State = X1;
    static constexpr bool resets = false;
    static void flow(double, const X1&, X1& dxdt) { dxdt = {0}; }
    [[nodiscard]] static double guard(double t, const X1& x)
    {
        return x[0] * ((t - 1) * (t - 1.25) * (t - 60));
    }
    static constexpr GuardInfo guard_info(std::size_t)
    {
        return {.crossing = Crossing::either, .degree = 3};
    }
};

TEST(HardEvents, WhereOnlyTheTimeMovesEveryRootOfACubicIsFound)
{
    const auto run = integrate(Timetable{}, X1{1}, {.t_end = 100}, ErrorControlled<Fehlberg78>{});
    ASSERT_EQ(run.events.size(), 3U);
    const std::array<double, 3> roots{1, 1.25, 60};
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(run.events[i].t, roots[i], 1e-12);
}

}  // namespace
}  // namespace ricochet::events_hard_test
