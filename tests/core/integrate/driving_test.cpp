// Runs that the caller drives: stops at events and samples, restarts, other ends, snapshots that
// go on.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/simulation.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::driving_test {
namespace {

using Two = std::array<double, 2>;
constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr double pi = std::numbers::pi;
constexpr double never = std::numeric_limits<double>::infinity();

/// x' = v, v' = -x: guards record the zeros of x and of v, and one reflects at x = -0.9.
struct Oscillator {
    using State = Two;
    double wall = -2;
    void flow(double /*t*/, const State& x, State& dxdt) const { dxdt = {x[1], -x[0]}; }
    [[nodiscard]] std::size_t guard_count() const { return 3; }
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const State& x) const
    {
        return which == 0 ? x[0] : which == 1 ? x[1] : x[0] - wall;
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        GuardInfo info;
        info.crossing = which == 2 ? Crossing::falling : Crossing::either;
        info.resets = which == 2;
        return info;
    }
    void reset(std::size_t /*which*/, double /*t*/, State& x) const { x[1] = -x[1]; }
};

template <class Sim>
std::vector<std::pair<double, Two>> stops_of(Sim& simulation)
{
    std::vector<std::pair<double, Two>> stops;
    while (simulation.advance()) stops.emplace_back(simulation.t(), simulation.x());
    return stops;
}

TEST(Driving, AdvanceStopsAtRecordedEventsEachOnce)
{
    // One step holds several of the events; the state at each is the recorded one.
    for (const double wall : {-2.0, -0.9}) {
        const Oscillator system{wall};
        const Options options{.t_end = 20};
        const auto whole = integrate(system, Two{1, 0}, options);
        Simulation simulation(system, Two{1, 0}, options);
        const auto stops = stops_of(simulation);
        std::size_t k = 0;
        for (std::size_t i = 0; i < whole.events.size(); ++i) {
            const auto& event = whole.events[i];
            if (i + 1 < whole.events.size() && whole.events[i + 1].t == event.t) continue;
            ASSERT_LT(k, stops.size());
            EXPECT_EQ(stops[k].first, event.t);
            EXPECT_EQ(stops[k].second, event.after);
            ++k;
        }
        EXPECT_EQ(k, stops.size());
        EXPECT_GE(k, 12U);
        EXPECT_TRUE(simulation.ended());
        EXPECT_EQ(simulation.t(), 20);
    }
}

TEST(Driving, SamplesAndRecordedEventsAreShownInTheOrderOfTime)
{
    const Oscillator system{};
    Options options{.t_end = 10};
    for (int k = 0; k <= 40; ++k) options.sample_times.push_back(0.25 * k);
    const auto whole = integrate(system, Two{1, 0}, options);
    Simulation simulation(system, Two{1, 0}, options);
    const auto stops = stops_of(simulation);
    EXPECT_EQ(stops.size(), whole.events.size() + 41);
    for (std::size_t i = 0; i + 1 < stops.size(); ++i) {
        EXPECT_LT(stops[i].first, stops[i + 1].first);
        EXPECT_NEAR(stops[i].second[0], std::cos(stops[i].first), 1e-6);
    }
}

TEST(Driving, EventsWithoutStatesAreShownAtTheEndOfTheirStep)
{
    const Oscillator system{};
    Simulation simulation(system, Two{1, 0}, {.t_end = 10, .record_events = false});
    std::size_t stops = 0;
    while (simulation.advance()) {
        ++stops;
        EXPECT_NEAR(simulation.x()[0], std::cos(simulation.t()), 1e-6);
    }
    EXPECT_GE(stops, 2U);
    EXPECT_LE(stops, simulation.run().statistics.events);
}

TEST(Driving, TheSolutionAtAnEventIsTheStateThatItsResetHasSeen)
{
    const auto check = [](const auto& run, const std::string& label) {
        SCOPED_TRACE(label);
        ASSERT_GE(run.events.size(), 10U);
        for (std::size_t i = 0; i < run.events.size(); ++i) {
            const auto& event = run.events[i];
            const bool is_first = i == 0 || run.events[i - 1].t != event.t;
            const bool is_last = i + 1 == run.events.size() || run.events[i + 1].t != event.t;
            if (is_first) {
                EXPECT_EQ(run.solution.before(event.t), event.before) << event.t;
            }
            if (is_last) {
                EXPECT_EQ(run.solution(event.t), event.after) << event.t;
            }
        }
    };
    for (const double wall : {-2.0, -0.9}) {
        const Oscillator system{wall};
        Options options{.t_start = 0.1, .t_end = 20, .record_steps = true};
        check(integrate(system, Two{1, 0}, options), "dopri5");
        check(integrate(system, Two{1, 0}, options, ErrorControlled<Fehlberg78>{}), "fehlberg78");
        options.step = 0.07;
        check(integrate(system, Two{1, 0}, options, FixedStep<Rk4>{}), "rk4");
    }
}

// --- restart ---

TEST(Driving, ARestartIsARunFromThere)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.8});
    Simulation simulation(ball, Two{1, 0}, {.t_end = 3});
    ASSERT_TRUE(simulation.advance());
    const double t = simulation.t();
    simulation.restart(t, Two{2, 1});
    EXPECT_EQ(simulation.t(), t);
    EXPECT_EQ(simulation.x(), (Two{2, 1}));
    const auto rest = simulation.take();
    const auto other = integrate(ball, Two{2, 1}, {.t_start = t, .t_end = 3});
    EXPECT_EQ(rest.x, other.x);
    ASSERT_EQ(rest.events.size(), other.events.size() + 1);
    EXPECT_EQ(rest.events.back().t, other.events.back().t);
    EXPECT_EQ(rest.statistics.events, rest.events.size());
}

TEST(Driving, ARestartInsideAStepDropsWhatCameAfterIt)
{
    const Oscillator system{};
    Options options{.t_end = 10, .record_steps = true};
    for (int k = 0; k <= 40; ++k) options.sample_times.push_back(0.25 * k);
    Simulation simulation(system, Two{1, 0}, options);
    while (simulation.t() != 2.25) ASSERT_TRUE(simulation.advance());
    simulation.restart(2.25, Two{0, 1});
    EXPECT_EQ(simulation.t(), 2.25);
    while (simulation.advance()) {
        EXPECT_NEAR(simulation.x()[0], std::sin(simulation.t() - 2.25), 1e-6);
    }
    const auto run = simulation.finish();
    ASSERT_EQ(run.trajectory.t.size(), 41U);
    EXPECT_EQ(run.statistics.events, run.events.size());
    double last = 0;
    for (const auto& event : run.events) {
        EXPECT_GE(event.t, last);
        last = event.t;
        const double x = event.t < 2.25 ? std::cos(event.t) : std::sin(event.t - 2.25);
        EXPECT_NEAR(event.before[0], x, 1e-6);
    }
    for (double t = 0.05; t < 10; t += 0.1) {
        const double x = t < 2.25 ? std::cos(t) : std::sin(t - 2.25);
        EXPECT_NEAR(run.solution(t)[0], x, 1e-6) << t;
    }
    EXPECT_NEAR(run.solution.before(2.25)[0], std::cos(2.25), 1e-6);
    EXPECT_EQ(run.solution(2.25), (Two{0, 1}));
}

/// A motor with two modes; ticks at whole seconds count.
struct Motor {
    using State = Two;
    [[nodiscard]] std::size_t mode_count() const { return 2; }
    void flow(Mode m, double /*t*/, const State& /*x*/, State& dxdt) const
    {
        dxdt = {m == 0 ? 1.0 : -1.0, 0};
    }
    [[nodiscard]] double guard(Mode m, double /*t*/, const State& x) const
    {
        return m == 0 ? 5 - x[0] : x[0];
    }
    [[nodiscard]] Mode reset(Mode m, double /*t*/, State& /*x*/) const { return 1 - m; }
    [[nodiscard]] double next_time_event(double t) const { return std::floor(t) + 1; }
    [[nodiscard]] Mode time_reset(Mode m, double /*t*/, State& x) const
    {
        x[1] += 1;
        return m;
    }
};

TEST(Driving, ARestartChoosesTheModeAndLeavesATimeEventThereInThePast)
{
    const Motor motor;
    Simulation simulation(motor, Two{0, 0}, {.t_end = 6.5});
    while (simulation.t() < 2) ASSERT_TRUE(simulation.advance());
    ASSERT_EQ(simulation.t(), 2);
    EXPECT_EQ(simulation.x()[1], 2);  // ticks at 1 and 2
    simulation.restart(2, simulation.x(), 1);
    EXPECT_EQ(simulation.mode(), 1U);
    const auto run = simulation.take();
    // Down from 2 to 0 at 4, up again; ticks at 3, 4, 5, 6.
    EXPECT_EQ(run.mode, 0U);
    EXPECT_NEAR(run.x[0], 2.5, 1e-14);
    EXPECT_EQ(run.x[1], 6);
}

/// x' = 1; a timer is due when x[1] is reached, and sets itself a second further. A guard records
/// the whole and half seconds.
struct Timer {
    using State = Two;
    void flow(double /*t*/, const State& /*x*/, State& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(double t, const State& /*x*/) const { return std::sin(2 * pi * t); }
    [[nodiscard]] GuardInfo guard_info() const
    {
        return {.crossing = Crossing::either, .resets = false};
    }
    void reset(double /*t*/, State& /*x*/) const {}
    [[nodiscard]] double next_time_event(double /*t*/, const State& x) const { return x[1]; }
    void time_reset(double /*t*/, State& x) const { x[1] += 1; }
};

TEST(Driving, AnEventAtARestartIsShownAndFollowsThoseBefore)
{
    const Timer system{};
    const FixedStep<Rk4> coarse{};
    // The first step ends at 4 and holds guard events behind the restart inside it.
    for (const bool records : {true, false}) {
        const Options options{.t_end = 4, .step = 4, .event_states = records};
        Simulation simulation(system, Two{0, 10}, options, coarse);
        const double restart = records ? 2.25 : 0.25;
        while (records && simulation.t() < 2) ASSERT_TRUE(simulation.advance());
        simulation.restart(restart, Two{7, restart});
        ASSERT_TRUE(simulation.advance());
        EXPECT_EQ(simulation.t(), restart);
        EXPECT_EQ(simulation.x(), (Two{7, restart + 1}));
        ASSERT_TRUE(simulation.advance());
        EXPECT_GT(simulation.t(), restart);
        const auto run = simulation.take();
        double last = -1;
        std::size_t timers = 0;
        for (const auto& event : run.events) {
            EXPECT_GE(event.t, last);
            last = event.t;
            timers += event.kind == EventKind::time ? 1 : 0;
        }
        EXPECT_EQ(timers, records ? 2U : 4U);
        EXPECT_EQ(run.statistics.events, run.events.size());
    }
}

TEST(Driving, AnObserverSeesTheEventsAtTheStartAndAtARestart)
{
    struct Doses {
        using State = Two;
        Times time_events{0, 1, 1, 3};
        void flow(double /*t*/, const State& /*x*/, State& dxdt) const { dxdt = {0, 0}; }
        void time_reset(double /*t*/, State& x) const { x[0] += 1; }
    };
    std::vector<double> seen;
    const auto note = [&](const Event<Two>& event) { seen.push_back(event.t); };
    Simulation whole(Doses{}, Two{0, 0}, {.t_end = 3});
    whole.run_to_end(note);
    EXPECT_EQ(seen, (std::vector<double>{0, 1, 1, 3}));

    // What `advance` has shown, or would not show any more, is not shown again.
    seen.clear();
    Simulation advanced(Doses{}, Two{0, 0}, {.t_end = 3});
    ASSERT_TRUE(advanced.advance());
    advanced.run_to_end(note);
    EXPECT_EQ(seen, (std::vector<double>{1, 1, 3}));
    seen.clear();
    Simulation stepped(Doses{}, Two{0, 0}, {.t_end = 3, .step = 2});
    ASSERT_TRUE(stepped.step());
    EXPECT_EQ(stepped.t(), 1);
    stepped.run_to_end(note);
    EXPECT_EQ(seen, (std::vector<double>{1, 1, 3}));

    seen.clear();
    Simulation restarted(Timer{}, Two{0, 10}, {.t_end = 1.3});
    restarted.restart(0.25, Two{0, 0.25});
    restarted.run_to_end([&](const Event<Two>& event) {
        if (event.kind == EventKind::time) seen.push_back(event.t);
    });
    EXPECT_EQ(seen, (std::vector<double>{0.25, 1.25}));

    // An observer that throws has seen its event; the next call goes on behind it.
    seen.clear();
    Simulation thrown(Doses{}, Two{0, 0}, {.t_end = 3});
    const auto throws_at_zero = [&](const Event<Two>& event) {
        note(event);
        if (event.t == 0) throw std::runtime_error("not this one");
    };
    EXPECT_THROW(thrown.run_to_end(throws_at_zero), std::runtime_error);
    thrown.run_to_end(throws_at_zero);
    EXPECT_EQ(seen, (std::vector<double>{0, 1, 1, 3}));
}

TEST(Driving, ARestartThatIsRefusedLeavesNoEventOfIt)
{
    struct Refuses : Timer {
        void time_reset(double t, State& x) const
        {
            if (x[0] < 0) throw std::runtime_error("no");
            Timer::time_reset(t, x);
            x[0] = x[0] == 5 ? -1 : x[0];
            x[1] = x[0] == -1 ? t : x[1];
        }
    };
    Simulation simulation(Refuses{}, Two{0, 10}, {.t_end = 4});
    const std::size_t before = simulation.run().events.size();
    EXPECT_THROW(simulation.restart(0.25, Two{5, 0.25}), std::runtime_error);
    EXPECT_EQ(simulation.run().events.size(), before);
    EXPECT_EQ(simulation.run().statistics.events, before);
}

TEST(Driving, ARestartAtARecordedEventDoesNotRecordItAgain)
{
    struct Passage {
        using State = std::array<double, 1>;
        double at;
        void flow(double /*t*/, const State& /*x*/, State& dxdt) const { dxdt = {1}; }
        [[nodiscard]] double guard(double /*t*/, const State& x) const { return x[0] - at; }
        [[nodiscard]] GuardInfo guard_info() const
        {
            return {.crossing = Crossing::either, .resets = false};
        }
        void reset(double /*t*/, State& /*x*/) const {}
    };
    for (int k = 1; k < 400; ++k) {
        const Passage passage{0.0371 * k};
        Simulation simulation(passage, {0.0}, {.t_end = 40});
        ASSERT_TRUE(simulation.advance());
        const double t = simulation.t();
        const auto x = simulation.x();
        simulation.restart(t, x);
        while (simulation.advance()) {
        }
        EXPECT_EQ(simulation.run().events.size(), 1U) << k;
    }
}

TEST(Driving, ARunWithoutALengthIsExtended)
{
    struct Plain {
        using State = std::array<double, 1>;
        void flow(double /*t*/, const State& /*x*/, State& dxdt) const { dxdt = {1}; }
    };
    const auto check = [](double step, const auto& stepping) {
        Simulation simulation(Plain{}, {0.0}, {.t_end = 0, .step = step}, stepping);
        while (simulation.advance()) {
        }
        simulation.extend(2);
        const auto run = simulation.take();
        EXPECT_EQ(run.t, 2);
        EXPECT_NEAR(run.x[0], 2, 1e-14);
        EXPECT_LT(run.statistics.steps, 100U);
    };
    check(0, ErrorControlled<Dopri5>{});
    check(0, ErrorControlled<Fehlberg78>{});
    check(0.1, FixedStep<Rk4>{});
}

/// A circle whose flow may be told to throw after one second.
template <class X>
struct Circle {
    using State = X;
    const bool* throws;
    void flow(double t, const X& x, X& dxdt) const
    {
        if (*throws && t > 1) throw std::runtime_error("told to");
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
};

template <class X>
void drive_circle()
{
    bool throws = false;
    const Circle<X> system{&throws};
    const X start{1, 0};
    const Options options{.t_end = 3};
    const auto whole = integrate(system, start, options);
    Simulation simulation(system, start, options);
    throws = true;
    EXPECT_THROW(while (simulation.step()){}, std::runtime_error);
    throws = false;
    const Snapshot snapshot = simulation.save();
    Simulation other(system, start, options);
    other.restore(snapshot);
    EXPECT_EQ(other.take().x, whole.x);
    while (simulation.step()) {
    }
    EXPECT_EQ(simulation.x(), whole.x);
    simulation.restart(0.5, start);
    EXPECT_EQ(simulation.take().x, integrate(system, start, {.t_start = 0.5, .t_end = 3}).x);
}

TEST(Driving, ARunWithoutGuardsAndTimeEventsIsDrivenLikeOthers)
{
    drive_circle<Two>();
    drive_circle<std::vector<double>>();
}

TEST(Driving, ASampleTimeThatIsListedTwiceIsOneStop)
{
    Simulation simulation(Oscillator{}, Two{1, 0.1}, {.t_end = 1.4, .sample_times = {1, 1.2, 1.2}});
    std::vector<double> stops;
    while (simulation.advance()) stops.push_back(simulation.t());
    EXPECT_EQ(std::count(stops.begin(), stops.end(), 1.2), 1);
    EXPECT_EQ(simulation.run().trajectory.t, (std::vector<double>{1, 1.2, 1.2}));
}

TEST(Driving, ARunThatHasEndedRestarts)
{
    const Motor motor;
    Simulation simulation(motor, Two{0, 0}, {.t_end = 3, .stop_at_event = true});
    while (simulation.advance()) {
    }
    EXPECT_EQ(simulation.run().outcome, Outcome::stopped_by_event);
    EXPECT_EQ(simulation.t(), 1);
    simulation.restart(1.5, Two{0, 0});
    EXPECT_FALSE(simulation.ended());
    while (simulation.advance()) {
    }
    EXPECT_EQ(simulation.t(), 2);
}

TEST(Driving, ABadRestartIsRefusedAndChangesNothing)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.8});
    const Options options{.t_end = 2};
    Simulation simulation(ball, Two{1, 0}, options);
    Simulation undisturbed(ball, Two{1, 0}, options);
    simulation.advance();
    undisturbed.advance();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double t = simulation.t();
    EXPECT_THROW(simulation.restart(nan, Two{1, 0}), std::invalid_argument);
    EXPECT_THROW(simulation.restart(never, Two{1, 0}), std::invalid_argument);
    EXPECT_THROW(simulation.restart(-1, Two{1, 0}), std::invalid_argument);
    EXPECT_THROW(simulation.restart(2, Two{1, 0}), std::invalid_argument);
    EXPECT_THROW(simulation.restart(t, Two{1, nan}), std::invalid_argument);
    EXPECT_THROW(simulation.restart(t, Two{1, 0}, 1), std::invalid_argument);
    try {
        simulation.restart(t, Two{-1, 0});  // below the floor
        FAIL();
    } catch (const std::invalid_argument& refused) {
        EXPECT_EQ(std::string(refused.what()).rfind("restart: the start lies behind", 0), 0U)
            << refused.what();
    }
    EXPECT_EQ(simulation.t(), t);
    EXPECT_EQ(simulation.take().x, undisturbed.take().x);
    EXPECT_THROW(simulation.restart(t, Two{1, 0}), std::invalid_argument);  // it is over
    EXPECT_THROW(simulation.extend(4), std::invalid_argument);

    const auto large = [](double, const std::vector<double>& x, std::vector<double>& dxdt) {
        dxdt = x;
    };
    struct Growth {
        using State = std::vector<double>;
        decltype(large) f;
        void flow(double at, const State& x, State& dxdt) const { f(at, x, dxdt); }
    };
    const Growth growth{large};
    Simulation vectors(growth, std::vector<double>(5, 1.0), Options{.t_end = 1});
    EXPECT_THROW(vectors.restart(0.5, std::vector<double>(4, 1.0)), std::invalid_argument);
    EXPECT_THROW(vectors.restart(0.5, {}), std::invalid_argument);
    vectors.restart(0.5, std::vector<double>(5, 2.0));
    EXPECT_NEAR(vectors.take().x[4], 2 * std::exp(0.5), 1e-6);
}

TEST(Driving, AnExceptionInARestartLeavesTheRunWhereItWas)
{
    struct Refusing {
        using State = Two;
        mutable bool refuse = false;
        void flow(double /*t*/, const State& x, State& dxdt) const
        {
            if (refuse) throw std::runtime_error("no");
            dxdt = {x[1], -x[0]};
        }
    };
    const Refusing system;
    Simulation simulation(system, Two{1, 0}, {.t_end = 2});
    Simulation undisturbed(system, Two{1, 0}, {.t_end = 2});
    for (int k = 0; k < 3; ++k) {
        simulation.step();
        undisturbed.step();
    }
    system.refuse = true;
    EXPECT_THROW(simulation.restart(1, Two{0, 1}), std::runtime_error);
    system.refuse = false;
    EXPECT_EQ(simulation.t(), undisturbed.t());
    EXPECT_EQ(simulation.take().x, undisturbed.take().x);
}

// --- extend ---

TEST(Driving, ARunIsExtendedFromItsEnd)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    Simulation simulation(ball, Two{1, 0}, {.t_end = 1});
    for (const double t_end : {1.5, 2.0, 3.0, 4.0}) {
        while (simulation.advance()) {
        }
        EXPECT_EQ(simulation.run().outcome, Outcome::reached_end);
        simulation.extend(t_end);
        EXPECT_FALSE(simulation.ended());
    }
    const auto run = simulation.take();
    const auto whole = integrate(ball, Two{1, 0}, {.t_end = 4});
    EXPECT_EQ(run.t, 4);
    ASSERT_EQ(run.events.size(), whole.events.size());
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_NEAR(run.events[i].t, whole.events[i].t, 1e-13);
    }
}

TEST(Driving, AnExtendedRunStopsAtItsEndsOnlyOnce)
{
    // A run may also be shortened to an end that is ahead.
    const Motor motor;
    Simulation simulation(motor, Two{0, 0}, {.t_end = 100});
    while (simulation.t() < 3) simulation.advance();
    simulation.extend(3.5);
    while (simulation.advance()) {
    }
    EXPECT_EQ(simulation.t(), 3.5);
    EXPECT_NEAR(simulation.x()[0], 3.5, 1e-14);
    EXPECT_THROW(simulation.extend(3.5), std::invalid_argument);
    EXPECT_THROW(simulation.extend(1), std::invalid_argument);
    EXPECT_THROW(simulation.extend(std::numeric_limits<double>::quiet_NaN()),
                 std::invalid_argument);
    simulation.extend(4.5);
    const auto run = simulation.take();
    EXPECT_EQ(run.x[1], 4);
    EXPECT_NEAR(run.x[0], 4.5, 1e-14);
}

// --- snapshots that go on ---

TEST(Driving, ARunThatEndedAtALimitGoesOnFromItsSnapshotWhenMoreIsAllowed)
{
    const Oscillator system{};
    const auto whole = integrate(system, Two{1, 0}, {.t_end = 10});
    Simulation limited(system, Two{1, 0}, {.t_end = 10, .max_steps = 7});
    while (limited.step()) {
    }
    ASSERT_EQ(limited.run().outcome, Outcome::step_limit);
    const Snapshot snapshot = limited.save();
    Simulation more(system, Two{1, 0}, {.t_end = 10});
    more.restore(snapshot);
    EXPECT_FALSE(more.ended());
    const auto rest = more.take();
    EXPECT_EQ(rest.outcome, Outcome::reached_end);
    EXPECT_EQ(rest.x, whole.x);

    // Without more steps it stays where it is.
    limited.restore(snapshot);
    EXPECT_TRUE(limited.ended());
    EXPECT_EQ(limited.run().outcome, Outcome::step_limit);
}

TEST(Driving, AStalledRunGoesOnFromItsSnapshot)
{
    const Oscillator system{};
    const Options stalls{.t_end = 1e13, .h_max = 0.01, .stall_steps = 2};
    Simulation stalled(system, Two{1, 0}, stalls);
    while (stalled.step()) {
    }
    ASSERT_EQ(stalled.run().outcome, Outcome::stalled);
    const double t = stalled.t();
    const Snapshot snapshot = stalled.save();
    Options patient = stalls;
    patient.stall_steps = 0;
    patient.max_steps = 500;
    Simulation more(system, Two{1, 0}, patient);
    more.restore(snapshot);
    EXPECT_FALSE(more.ended());
    while (more.step()) {
    }
    EXPECT_EQ(more.run().outcome, Outcome::step_limit);
    EXPECT_GT(more.t(), t + 4);
}

TEST(Driving, ASnapshotLaterThanTheEndSaysSo)
{
    const Oscillator system{};
    Simulation late(system, Two{1, 0}, {.t_end = 10});
    while (late.t() < 5) late.step();
    const Snapshot snapshot = late.save();
    Simulation early(system, Two{1, 0}, {.t_end = 3});
    try {
        early.restore(snapshot);
        FAIL() << "it was restored";
    } catch (const std::invalid_argument& error) {
        EXPECT_NE(std::string(error.what()).find("later than t_end = 3"), std::string::npos)
            << error.what();
    }
    EXPECT_EQ(early.t(), 0);
    early.extend(20);
    early.restore(snapshot);
    EXPECT_EQ(early.t(), late.t());
}

}  // namespace
}  // namespace ricochet::driving_test
