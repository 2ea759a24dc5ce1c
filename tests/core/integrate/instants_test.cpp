// What happens at one instant: guards that cross at time events, samples or the end of the run,
// flows that jump at time events, and functions at the ends of the run.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "ricochet/bernstein.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/rosenbrock.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::instants_test {
namespace {

using One = std::array<double, 1>;
constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr double never = std::numeric_limits<double>::infinity();

/// Calls `check(run, label)` for a run by each method.
template <class System, class X, class Check>
void by_methods(const System& system, const X& x0, Options options, double step, const Check& check)
{
    check(integrate(system, x0, options), "dopri5");
    check(integrate(system, x0, options, ErrorControlled<Fehlberg78>{}), "fehlberg78");
    check(integrate(system, x0, options, ErrorControlled<CashKarp54>{}), "cash-karp54");
    check(integrate(system, x0, options, ErrorControlled<Rosenbrock4>{}), "rosenbrock4");
    options.step = step;
    check(integrate(system, x0, options, FixedStep<Rk4>{}), "rk4");
    check(integrate(system, x0, options, FixedStep<Euler>{}), "euler");
}

// --- guards that tie with time events ---

/// A clock x' = 1 whose guard sets it back after a period, beside ticks of the same period.
struct TickedClock {
    using State = One;
    double period = 1, start = 0;
    bool ticks_set_back = false;

    template <class S>
    void flow(const S& /*t*/, const std::array<S, 1>& /*x*/, std::array<S, 1>& dxdt) const
    {
        dxdt[0] = 1;
    }
    template <class S>
    [[nodiscard]] S guard(const S& /*t*/, const std::array<S, 1>& x) const
    {
        return period - x[0];
    }
    void reset(double /*t*/, State& x) const { x[0] = 0; }
    [[nodiscard]] double next_time_event(double t) const
    {
        double n = std::floor((t - start) / period);
        while (start + n * period <= t) ++n;
        return start + n * period;
    }
    void time_reset(double /*t*/, State& x) const
    {
        if (ticks_set_back) x[0] = 0;
    }
};

/// Number of instants at which a tick and the guard have their events in one set.
template <class Run>
std::size_t sets_of_two(const Run& run)
{
    std::size_t sets = 0;
    const auto& events = run.events;
    for (std::size_t i = 0; i + 1 < events.size(); ++i) {
        const bool pair = events[i].kind == EventKind::time && events[i + 1].guard == 0;
        sets += pair && events[i].t == events[i + 1].t && events[i].before == events[i + 1].before;
    }
    return sets;
}

TEST(Instants, AGuardAndATickAtOneInstantAreOneSetByEveryMethod)
{
    for (const bool sets_back : {false, true}) {
        for (const double period : {1.0, 0.3, 0.1, 1.0 / 3, 0.001}) {
            const TickedClock clock{.period = period, .ticks_set_back = sets_back};
            const Options options{.t_end = 1000 * period};
            const auto check = [&](const auto& run, const std::string& label) {
                SCOPED_TRACE(label + ", period " + std::to_string(period));
                EXPECT_EQ(run.outcome, Outcome::reached_end);
                EXPECT_EQ(sets_of_two(run), 1000U);
                EXPECT_EQ(run.events.size(), 2000U);
                EXPECT_EQ(run.statistics.unmet_conditions, 0U);
                for (const auto& event : run.events) {
                    ASSERT_GE(event.before[0], period);  // the condition of the guard holds
                }
            };
            by_methods(clock, One{0}, options, period / 7, check);
            check(integrate(clock, One{0}, options, ErrorControlled<Taylor>{}), "taylor");
        }
    }
}

/// The same clock with bounds, for detectors that defer checks.
struct BoundedClock : TickedClock {
    [[nodiscard]] double lipschitz() const { return 1; }
    [[nodiscard]] double speed_bound(double /*t*/, const State& /*x*/) const { return 1; }
};

TEST(Instants, AGuardAndATickAtOneInstantAreOneSetForEveryDetector)
{
    for (const bool sets_back : {false, true}) {
        for (const double period : {1.0, 0.3, 0.1, 1.0 / 3, 0.001}) {
            const BoundedClock clock{{.period = period, .ticks_set_back = sets_back}};
            const Options options{.t_end = 1000 * period};
            const auto check = [&](const auto& run, const std::string& label) {
                SCOPED_TRACE(label + ", period " + std::to_string(period));
                EXPECT_EQ(sets_of_two(run), 1000U);
                EXPECT_EQ(run.events.size(), 2000U);
            };
            const ErrorControlled<Dopri5> stepping;
            check(integrate(clock, One{0}, options, stepping, Ends{}), "ends");
            check(integrate(clock, One{0}, options, stepping, Bernstein{}), "bernstein");
            check(integrate(clock, One{0}, options, stepping, Planned<Extremum>{}), "planned");
        }
    }
}

TEST(Instants, TiesAtOtherScalesAndOffsetsAreNotPartedByRounding)
{
    for (int k = -12; k <= 12; k += 3) {
        const double period = std::pow(3, k) * 0.7;
        for (const double start : {0.0, 1e3 * period}) {
            const TickedClock clock{.period = period, .start = start};
            const Options options{.t_start = start, .t_end = start + 30.5 * period};
            by_methods(clock, One{0}, options, period / 7,
                       [&](const auto& run, const std::string& label) {
                           SCOPED_TRACE(label + ", period " + std::to_string(period));
                           EXPECT_EQ(sets_of_two(run), 30U);
                           EXPECT_EQ(run.events.size(), 60U);
                       });
        }
    }
}

/// The same clock with its guard recorded only: x' = 1, ticks set it back.
struct RecordedClock {
    using State = One;
    static constexpr bool resets = false;
    double period = 1;
    void flow(double /*t*/, const State& /*x*/, State& dxdt) const { dxdt[0] = 1; }
    [[nodiscard]] double guard(double /*t*/, const State& x) const { return period - x[0]; }
    [[nodiscard]] double next_time_event(double t) const
    {
        return TickedClock{.period = period}.next_time_event(t);
    }
    void time_reset(double /*t*/, State& x) const { x[0] = 0; }
};

TEST(Instants, ARecordedGuardAtATickThatSetsTheClockBackIsNotLost)
{
    for (const double period : {1.0, 0.3, 0.1, 1.0 / 3, 0.001}) {
        by_methods(RecordedClock{period}, One{0}, {.t_end = 1000 * period}, period / 7,
                   [&](const auto& run, const std::string& label) {
                       SCOPED_TRACE(label + ", period " + std::to_string(period));
                       std::size_t crossings = 0;
                       for (const auto& event : run.events) crossings += event.guard == 0;
                       EXPECT_EQ(crossings, 1000U);
                       EXPECT_EQ(run.events.size(), 2000U);
                   });
    }
}

/// A guard that touches its surface at a tick; a reset toggles the mode.
struct TouchAtTick {
    using State = One;
    double above = 0, late = 0;  ///< the guard is (x - 1 - late)^2 + above

    [[nodiscard]] std::size_t mode_count() const { return 2; }
    void flow(Mode /*m*/, double /*t*/, const State& /*x*/, State& dxdt) const { dxdt[0] = 1; }
    [[nodiscard]] double guard(Mode /*m*/, double /*t*/, const State& x) const
    {
        const double apart = x[0] - 1 - late;
        return apart * apart + above;
    }
    [[nodiscard]] Mode reset(Mode m, double /*t*/, State& /*x*/) const { return 1 - m; }
    [[nodiscard]] double next_time_event(double t) const { return t < 1 ? 1 : never; }
    [[nodiscard]] Mode time_reset(Mode m, double /*t*/, State& /*x*/) const { return m; }
};

TEST(Instants, ATouchAtATickStaysATouch)
{
    for (const TouchAtTick& system :
         {TouchAtTick{}, TouchAtTick{.above = 1e-19, .late = 1e-9}, TouchAtTick{.late = epsilon}}) {
        by_methods(
            system, One{0}, {.t_end = 3}, 0.09, [&](const auto& run, const std::string& label) {
                SCOPED_TRACE(label);
                EXPECT_EQ(run.mode, 0U);
                std::size_t ticks = 0;
                for (const auto& event : run.events) {
                    ticks += event.kind == EventKind::time;
                    EXPECT_TRUE(event.kind == EventKind::time || event.kind == EventKind::touch);
                }
                EXPECT_EQ(ticks, 1U);
            });
    }
}

TEST(Instants, ATouchAtATickIsNoCrossingForTheSignsAtTheEndsOfSteps)
{
    for (const double end : {1.0, 3.0}) {
        for (const double step : {0.25, 0.09}) {
            const auto run = integrate(TouchAtTick{}, One{0}, {.t_end = end, .step = step},
                                       FixedStep<Rk4>{}, Ends{});
            SCOPED_TRACE("steps of " + std::to_string(step) + " to " + std::to_string(end));
            ASSERT_EQ(run.events.size(), 1U);
            EXPECT_EQ(run.events[0].kind, EventKind::time);
            EXPECT_EQ(run.mode, 0U);
        }
    }
}

/// x' = 1 with a guard that sets the clock back, and no ticks.
struct Clock {
    using State = One;
    double period = 1;
    void flow(double /*t*/, const State& /*x*/, State& dxdt) const { dxdt[0] = 1; }
    [[nodiscard]] double guard(double /*t*/, const State& x) const { return period - x[0]; }
    void reset(double /*t*/, State& x) const { x[0] = 0; }
};

TEST(Instants, AGuardThatCrossesAtTheEndHasItsEventThere)
{
    for (const double period : {1.0, 0.3, 0.1, 1.0 / 3, 0.001}) {
        for (int n = 1; n <= 60; ++n) {
            by_methods(Clock{period}, One{0}, {.t_end = n * period}, period / 7,
                       [&](const auto& run, const std::string& label) {
                           SCOPED_TRACE(label + ", " + std::to_string(n) + " periods of " +
                                        std::to_string(period));
                           EXPECT_EQ(run.events.size(), static_cast<std::size_t>(n));
                           EXPECT_LE(run.x[0], 4 * epsilon * n * period);
                       });
        }
    }
}

TEST(Instants, ASampleAtAnEventIsTakenAfterItWhateverTheRounding)
{
    for (const double period : {1.0, 0.3, 0.1, 1.0 / 3, 0.001}) {
        Options options{.t_end = 100.5 * period};
        for (int n = 1; n <= 100; ++n) options.sample_times.push_back(n * period);
        by_methods(Clock{period}, One{0}, options, period / 7,
                   [&](const auto& run, const std::string& label) {
                       SCOPED_TRACE(label + ", period " + std::to_string(period));
                       ASSERT_EQ(run.trajectory.x.size(), 100U);
                       for (const auto& x : run.trajectory.x) {
                           EXPECT_LE(x[0], 1000 * epsilon * period);
                       }
                   });
    }
}

TEST(Instants, ASampleAtAnEventIsItsStateAfterAndOneStop)
{
    for (const double period : {1.0, 0.3, 0.1, 1.0 / 3, 0.001}) {
        Options options{.t_end = 100.5 * period};
        for (int n = 1; n <= 100; ++n) options.sample_times.push_back(n * period);
        const auto check = [&](auto&& simulation, const std::string& label) {
            SCOPED_TRACE(label + ", period " + std::to_string(period));
            std::size_t stops = 0;
            while (simulation.advance()) {
                ASSERT_LT(stops, 100U);
                EXPECT_EQ(simulation.t(), options.sample_times[stops++]);
                EXPECT_EQ(simulation.x(), simulation.run().events.back().after);
            }
            EXPECT_EQ(stops, 100U);
            EXPECT_EQ(simulation.run().events.size(), 100U);
        };
        check(Simulation(Clock{period}, One{0}, options), "dopri5");
        options.step = period / 7;
        check(Simulation(Clock{period}, One{0}, options, FixedStep<Rk4>{}), "rk4");
        // The same samples without stops.
        const auto run = integrate(Clock{period}, One{0}, options, FixedStep<Rk4>{});
        for (const auto& x : run.trajectory.x) EXPECT_EQ(x, One{0});
    }
}

TEST(Instants, ASampleAtTheEventThatEndsTheRunIsOneStop)
{
    struct Ending : Clock {
        [[nodiscard]] GuardInfo guard_info() const { return {.stop_after = 2}; }
    };
    Simulation simulation(Ending{}, One{0}, {.t_end = 5, .sample_times = {0.5, 1, 2, 3}});
    std::vector<double> stops;
    while (simulation.advance()) stops.push_back(simulation.t());
    EXPECT_EQ(stops, (std::vector<double>{0.5, 1, 2}));
}

// --- flows that jump at time events ---

/// x' = 1 from time 1 on, which is a time event.
struct Switch {
    using State = std::array<double, 2>;
    bool at_once = false;  ///< the flow at 1 is the later one
    double on = 1;         ///< the time of the switch

    void flow(double t, const State& /*x*/, State& dxdt) const
    {
        const bool later = at_once ? t >= on : t > on;
        dxdt = {later ? 1.0 : 0.0, later ? -3.0 : 1.0};
    }
    [[nodiscard]] double next_time_event(double t) const { return t < on ? on : never; }
    [[nodiscard]] double previous_time_event(double t) const { return t > on ? on : -never; }
    void time_reset(double /*t*/, State& /*x*/) const {}
};

TEST(Instants, AFlowThatJumpsAtATimeEventIsIntegratedOnBothSides)
{
    // The rates are constant on either side, and every method is exact to rounding.
    for (const bool at_once : {false, true}) {
        for (const double on : {1.0, 0.3, 0.1 * 3}) {
            const Switch system{.at_once = at_once, .on = on};
            by_methods(system, Switch::State{0, 0}, {.t_end = 2}, 0.1,
                       [&](const auto& run, const std::string& label) {
                           SCOPED_TRACE(label);
                           EXPECT_NEAR(run.x[0], 2 - on, 8 * epsilon);
                           EXPECT_NEAR(run.x[1], on - 3 * (2 - on), 32 * epsilon);
                           EXPECT_EQ(run.statistics.rejected, 0U);
                       });
            by_methods(system, Switch::State{0, 0}, {.t_start = 2, .t_end = 0}, 0.1,
                       [&](const auto& run, const std::string& label) {
                           SCOPED_TRACE(label + ", backward");
                           EXPECT_NEAR(run.x[0], on - 2, 8 * epsilon);
                           EXPECT_NEAR(run.x[1], 3 * (2 - on) - on, 32 * epsilon);
                       });
        }
    }
}

/// A square wave of large states, by its phase: x_i' = +-1, declared at each jump.
struct SquareWave {
    using State = std::vector<double>;
    double period = 0.1;
    void flow(double t, const State& x, State& dxdt) const
    {
        const double phase = std::fmod(t, period) / period;
        dxdt.assign(x.size(), phase < 0.5 ? 1.0 : -1.0);
    }
    [[nodiscard]] double next_time_event(double t) const
    {
        double n = std::floor(2 * t / period);
        while (n * period / 2 <= t) ++n;
        return n * period / 2;
    }
    void time_reset(double /*t*/, State& /*x*/) const {}
};

TEST(Instants, ASquareWaveReturnsAfterEveryPeriod)
{
    // Each half of the wave moves the state by 0.05; the phase of a jump rounds to either side.
    const auto check = [](const auto& run, const std::string& label) {
        SCOPED_TRACE(label);
        for (const double x : run.x) EXPECT_NEAR(x, 0, 1e-13);
        EXPECT_EQ(run.statistics.rejected, 0U);
    };
    by_methods(SquareWave{}, std::vector<double>(6, 0.0), {.t_end = 10}, 0.0125, check);
}

/// A flow that is smooth, and fast at the time of the event.
struct FastWave {
    using State = One;
    bool ticks = true;
    void flow(double t, const State& /*x*/, State& dxdt) const { dxdt[0] = std::cos(1e6 * t); }
    [[nodiscard]] double next_time_event(double t) const { return ticks && t < 1 ? 1 : never; }
    void time_reset(double /*t*/, State& /*x*/) const {}
};

TEST(Instants, AFastFlowDoesNotJump)
{
    // A step that were taken again would cost six evaluations more than the three of the test for
    // a jump at its end.
    const Options options{.t_start = 1 - 1e-7, .t_end = 1 + 1e-7, .h_max = 1e-7};
    const auto with = integrate(FastWave{true}, One{0}, options);
    const double exact = (std::sin(1e6 + 0.1) - std::sin(1e6 - 0.1)) / 1e6;
    EXPECT_NEAR(with.x[0], exact, 1e-14);
    EXPECT_LE(with.statistics.flow_calls, 2 + 6 * with.statistics.steps + 6);
}

/// A heater that a schedule turns on: the guard sees the flow that begins at the event.
struct Scheduled {
    using State = One;
    [[nodiscard]] std::size_t mode_count() const { return 2; }
    void flow(Mode /*m*/, double t, const State& /*x*/, State& dxdt) const
    {
        dxdt[0] = t > 1 ? -1 : 0;
    }
    [[nodiscard]] double guard(Mode m, double /*t*/, const State& x) const
    {
        return m == 0 ? x[0] - 0.5 : 1;
    }
    [[nodiscard]] Mode reset(Mode /*m*/, double /*t*/, State& /*x*/) const { return 1; }
    [[nodiscard]] double next_time_event(double t) const { return t < 1 ? 1 : never; }
    [[nodiscard]] Mode time_reset(Mode m, double /*t*/, State& /*x*/) const { return m; }
};

TEST(Instants, AGuardAfterAJumpOfTheFlowSeesTheLaterFlow)
{
    by_methods(Scheduled{}, One{1}, {.t_end = 3}, 0.1,
               [](const auto& run, const std::string& label) {
                   SCOPED_TRACE(label);
                   ASSERT_EQ(run.events.size(), 2U);
                   EXPECT_NEAR(run.events[1].t, 1.5, 8 * epsilon);
                   EXPECT_EQ(run.mode, 1U);
               });
}

TEST(Instants, ASnapshotAfterAJumpContinuesWithTheSameBits)
{
    const Switch system{};
    const Options options{.t_end = 2};
    const ErrorControlled<Fehlberg78> stepping;
    Simulation whole(system, Switch::State{0, 0}, options, stepping);
    while (whole.t() < 1) whole.step();
    ASSERT_EQ(whole.t(), 1);
    const Snapshot snapshot = whole.save();
    Simulation rest(system, Switch::State{0, 0}, options, stepping);
    rest.restore(snapshot);
    const auto a = whole.take();
    const auto b = rest.take();
    EXPECT_EQ(a.x, b.x);
    EXPECT_NEAR(b.x[0], 1, 8 * epsilon);
}

// --- nothing is called outside of the run ---

/// Refuses times outside of its span.
struct Bounded {
    using State = One;
    double from = 0, to = 1;
    mutable std::size_t outside = 0;

    void see(double t) const { outside += t < from || t > to; }
    void flow(double t, const State& x, State& dxdt) const
    {
        see(t);
        dxdt[0] = std::cos(t) - 0.01 * x[0];
    }
    [[nodiscard]] std::size_t guard_count() const { return 2; }
    [[nodiscard]] double guard(std::size_t which, double t, const State& x) const
    {
        see(t);
        return which == 0 ? x[0] - 0.3 * std::sin(t) : std::sqrt(std::max(0.0, t - from)) - 0.5;
    }
    void reset(std::size_t /*which*/, double t, State& /*x*/) const { see(t); }
};

TEST(Instants, NothingIsCalledOutsideOfTheRun)
{
    for (const auto& [from, to] :
         {std::pair{0.0, 1e-4}, {0.0, 2.0}, {-3.0, -1.0}, {1e6, 1e6 + 1e-3}, {1.0, 1 + 1e-9}}) {
        for (const bool backward : {false, true}) {
            for (const double x0 : {0.0, 1.0, 1e9}) {
                const Bounded system{.from = from, .to = to};
                const Options options{.t_start = backward ? to : from,
                                      .t_end = backward ? from : to};
                const auto check = [&](const auto& run, const std::string& label) {
                    SCOPED_TRACE(label + " from " + std::to_string(options.t_start));
                    EXPECT_EQ(run.outcome, Outcome::reached_end);
                    EXPECT_EQ(system.outside, 0U);
                    system.outside = 0;
                };
                by_methods(system, One{x0}, options, (to - from) / 13, check);
                check(integrate(system, One{x0}, options, ErrorControlled<Dopri5>{}, Bernstein{}),
                      "bernstein");
                check(integrate(system, One{x0}, options, ErrorControlled<Dopri5>{}, Ends{},
                                Bisection{}),
                      "ends");
            }
        }
    }
}

/// A guard with a rate that is a difference, which touches its surface at the end.
struct EndTouch {
    using State = One;
    static constexpr bool resets = false;
    mutable double latest = 0;
    void flow(double t, const State& /*x*/, State& dxdt) const
    {
        latest = std::max(latest, t);
        dxdt[0] = 1;
    }
    [[nodiscard]] double guard(double t, const State& x) const
    {
        latest = std::max(latest, t);
        return (x[0] - 1) * (x[0] - 1);
    }
};

TEST(Instants, ATouchAtTheEndIsDecidedInsideTheRun)
{
    const EndTouch system;
    EXPECT_EQ(integrate(system, One{0}, {.t_end = 1}).t, 1);
    EXPECT_EQ(system.latest, 1);
    const auto run =
        integrate(system, One{0}, {.t_end = 1}, ErrorControlled<Dopri5>{}, Bernstein{});
    EXPECT_EQ(run.t, 1);
    EXPECT_EQ(system.latest, 1);
}

/// Notes calls of the flow in a mode that has been left.
struct OldMode {
    using State = std::array<double, 2>;
    mutable bool left = false;
    mutable std::size_t late = 0;
    [[nodiscard]] std::size_t mode_count() const { return 2; }
    void flow(Mode m, double t, const State& x, State& dxdt) const
    {
        late += m == 0 && left;
        dxdt = {x[1], m == 0 ? -1 + 0.1 * std::sin(t) : 0.5};
    }
    [[nodiscard]] double guard(Mode m, double /*t*/, const State& x) const
    {
        return m == 0 ? x[0] : 1;
    }
    [[nodiscard]] Mode reset(Mode /*m*/, double /*t*/, State& x) const
    {
        left = true;
        x = {0, 0};
        return 1;
    }
};

// --- the direction of a crossing ---

TEST(Instants, AResetThatActsInOneDirectionOnlyIsNotIneffective)
{
    struct UpOnly {
        using State = One;
        Crossing crossing = Crossing::either;
        void flow(double, const State&, State& dxdt) const { dxdt = {0}; }
        [[nodiscard]] double guard(double t, const State&) const { return std::sin(t); }
        void reset(Crossing direction, double, State& x) const
        {
            if (direction == Crossing::rising) x[0] += 1;
        }
    };
    const auto run = integrate(UpOnly{}, One{0}, {.t_start = 0.1, .t_end = 20, .h_max = 0.5});
    EXPECT_EQ(run.x[0], 3);
    EXPECT_EQ(run.statistics.events, 6U);
    EXPECT_EQ(run.statistics.ineffective_resets, 0U);
    EXPECT_EQ(run.statistics.declined_guard, no_guard);
}

/// Counts the turns of sin t: up and down, in a mode each or without.
struct Turns {
    using State = std::array<double, 2>;
    Crossing crossing = Crossing::either;
    void flow(double, const State&, State& dxdt) const { dxdt = {0, 0}; }
    [[nodiscard]] double guard(double t, const State&) const { return std::sin(t); }
    void reset(Crossing direction, double, State& x) const
    {
        x[direction == Crossing::rising ? 1 : 0] += 1;
    }
};
struct ModedTurns {
    using State = Turns::State;
    static constexpr std::size_t guard_count = 1, mode_count = 2;
    Crossing crossing = Crossing::either;
    void flow(Mode, double, const State&, State& dxdt) const { dxdt = {0, 0}; }
    [[nodiscard]] double guard(std::size_t, Mode, double t, const State&) const
    {
        return std::sin(t);
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.crossing = crossing}; }
    Mode reset(std::size_t, Crossing direction, Mode, double t, State& x) const
    {
        Turns{}.reset(direction, t, x);
        return direction == Crossing::rising ? 1 : 0;
    }
};

/// Two guards that cross together, one up and one down.
struct Both {
    using State = Turns::State;
    static constexpr std::size_t guard_count = 2;
    void flow(double, const State&, State& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(std::size_t which, double, const State& x) const
    {
        return which == 0 ? x[0] - 1 : 1 - x[0];
    }
    void reset(std::size_t which, Crossing direction, double, State& x) const
    {
        x[1] += (which == 0 ? 1 : 10) * (direction == Crossing::rising ? 1 : 2);
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.crossing = Crossing::either}; }
};

TEST(Instants, AResetIsToldTheDirectionOfItsCrossing)
{
    // From 0.5 to 20 the sine falls at pi, 3 pi, 5 pi, and rises at 2 pi, 4 pi, 6 pi.
    const Options options{.t_start = 0.5, .t_end = 20, .h_max = 0.5};
    by_methods(Turns{}, Turns::State{}, options, 0.21, [](const auto& run, const char* label) {
        EXPECT_EQ(run.x, (Turns::State{3, 3})) << label;
    });
    by_methods(ModedTurns{}, Turns::State{}, options, 0.21, [](const auto& run, const char* label) {
        EXPECT_EQ(run.x, (Turns::State{3, 3})) << label;
        EXPECT_EQ(run.mode, 1U) << label;
    });
    const Turns down{Crossing::falling};
    by_methods(down, Turns::State{}, options, 0.21, [](const auto& run, const char* label) {
        EXPECT_EQ(run.x, (Turns::State{3, 0})) << label;
    });
    // Each is told its own direction.
    by_methods(Both{}, Turns::State{}, {.t_end = 2}, 0.21,
               [](const auto& run, const char* label) { EXPECT_EQ(run.x[1], 21) << label; });
}

TEST(Instants, TheFlowOfAModeThatWasLeftIsNotCalledAfterItsReset)
{
    for (const bool records : {false, true}) {
        const OldMode system;
        Options options{.t_end = 3, .record_steps = records};
        for (int k = 0; k < 100; ++k) options.sample_times.push_back(0.03 * k);
        by_methods(system, OldMode::State{0.7, 0.1}, options, 0.21,
                   [&](const auto& run, const std::string& label) {
                       SCOPED_TRACE(label);
                       EXPECT_EQ(run.mode, 1U);
                       EXPECT_EQ(system.late, 0U);
                       system.left = false;
                       system.late = 0;
                   });
    }
}

}  // namespace
}  // namespace ricochet::instants_test
