// Times of events: lists, clocks, timers in the state; what happens at the start of a run and at
// the entry of a mode; runs without an end, and resets that end them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/monitor.hpp"
#include "ricochet/times.hpp"
#include "rk4_host.hpp"

namespace ricochet {
namespace {

using std::numbers::e;

constexpr double infinity = std::numeric_limits<double>::infinity();

template <class X>
std::vector<double> times_of(const std::vector<Event<X>>& events)
{
    std::vector<double> times;
    for (const auto& event : events) times.push_back(event.t);
    return times;
}

// --- Times ---

TEST(Times, AListKnowsItsEntriesInAnyOrder)
{
    const Times times{2, 0, 1, 1};
    EXPECT_EQ(times.next(-1), 0);
    EXPECT_EQ(times.next(0), 1);
    EXPECT_EQ(times.next(1), 2);
    EXPECT_EQ(times.next(2), infinity);
    EXPECT_EQ(times.previous(2), 1);
    EXPECT_EQ(times.previous(0), -infinity);
    EXPECT_EQ(times.count(1), 2U);
    EXPECT_EQ(times.count(0.5), 0U);
    EXPECT_EQ(Times{}.next(0), infinity);
}

TEST(Times, TheTicksOfAClockDoNotDrift)
{
    // Tick k is phase + k period, rounded once more than the product; next and previous meet every
    // one of them, whatever the quotient is rounded to.
    for (const double period : {0.1, 0.3, 1 / 3.0, 1e-3, 7.0}) {
        for (const double phase : {0.0, 0.05, -2.0}) {
            const Times clock = every(period, phase);
            double t = phase - 1000 * period;
            for (int k = -999; k <= 1000; ++k) {
                const double tick = phase + k * period;
                ASSERT_EQ(clock.next(t), tick) << period << " " << k;
                ASSERT_EQ(clock.previous(tick), t);
                ASSERT_EQ(clock.count(tick), 1U);
                ASSERT_EQ(clock.count(std::nextafter(tick, infinity)), 0U);
                t = tick;
            }
        }
    }
}

TEST(Times, WrongNumbersAreRefusedByName)
{
    EXPECT_EQ(refusal([] { (void)every(0); }), "every: period must be positive and finite, got 0");
    EXPECT_EQ(refusal([] { (void)every(infinity); }),
              "every: period must be positive and finite, got inf");
    EXPECT_EQ(refusal([] { (void)every(1, std::nan("")); }),
              "every: phase must be finite, got nan");
    EXPECT_EQ(refusal([] { (void)every(-1, 0, "sampler"); }),
              "sampler: period must be positive and finite, got -1");
    EXPECT_EQ(refusal([] {
                  (void)Times({0, std::nan("")}, "doses");
              }),
              "doses: entry 1 must be a time, got nan");
}

// --- lists and clocks in runs ---

/// x' = 0 with a dose of `amount` at each of some times.
struct Doses {
    using State = std::array<double, 1>;
    Times time_events;
    double amount = 1;

    void flow(double, const State&, State& dxdt) const { dxdt = {0}; }
    void time_reset(double, State& x) const { x[0] += amount; }
};

TEST(Lists, IncludeStartAndEndAndEveryEntry)
{
    const Doses doses{{0, 12, 24}, 100};
    const auto run = integrate(doses, {0}, {.t_end = 24});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x[0], 300);
    EXPECT_EQ(times_of(run.events), (std::vector<double>{0, 12, 24}));

    EXPECT_EQ(integrate(Doses{{1, 1}, 100}, {0}, {.t_end = 2}).x[0], 200);
    EXPECT_EQ(integrate(Doses{{0, 0, 2, 2, 2}, 1}, {0}, {.t_end = 2}).x[0], 5);
    EXPECT_EQ(integrate(Doses{{-1, 3}, 1}, {0}, {.t_end = 2}).statistics.events, 0U);
}

TEST(Lists, OfChainedRunsHaveEachEntryOnce)
{
    const Doses doses{{0, 12, 24}, 100};
    const auto first = integrate(doses, {0}, {.t_end = 12});
    const auto second = integrate(doses, first.x, {.t_start = 12, .t_end = 24, .continues = true});
    EXPECT_EQ(second.x[0], 300);
}

TEST(Lists, BackwardInTimeIncludeBothEnds)
{
    const auto run = integrate(Doses{{0, 1, 1, 2}, 1}, {0}, {.t_start = 2, .t_end = 0});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(times_of(run.events), (std::vector<double>{2, 1, 1, 0}));
}

TEST(Lists, AClockTicksFromStartToEnd)
{
    const auto run = integrate(Doses{every(0.5), 1}, {0}, {.t_end = 2});
    EXPECT_EQ(times_of(run.events), (std::vector<double>{0, 0.5, 1, 1.5, 2}));
    const auto later = integrate(Doses{every(0.5, 0.25), 1}, {0}, {.t_end = 1});
    EXPECT_EQ(times_of(later.events), (std::vector<double>{0.25, 0.75}));
}

TEST(Lists, EntriesThatChangeNothingHappenAsOftenAsListed)
{
    const Doses doses{Times(std::vector<double>(2000, 1.0)), 0};
    const auto run = integrate(doses, {0}, {.t_end = 2});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.statistics.events, 2000U);
}

TEST(Lists, OfAFunctionAreNeverAskedBeforeTheStart)
{
    struct Sampler {
        using State = std::array<double, 1>;
        void flow(double, const State&, State& dxdt) const { dxdt = {0}; }
        [[nodiscard]] double next_time_event(double t) const
        {
            EXPECT_GE(t, 0);
            return 0.5 * (std::floor(2 * t) + 1);
        }
        void time_reset(double, State& x) const { x[0] += 1; }
    };
    // Tick at 0.5, 1, 1.5, 2: a function that excludes t has none at the start.
    EXPECT_EQ(integrate(Sampler{}, {0}, {.t_end = 2}).x[0], 4);
}

/// x' = -1 from 1 with a floor at 0 that puts it back to 1, and doses.
struct DosedFloor {
    using State = std::array<double, 1>;
    Times time_events;

    void flow(double, const State&, State& dxdt) const { dxdt = {-1}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    void reset(double, State& x) const { x[0] = 1; }
    void time_reset(double, State& x) const { x[0] = -1; }
};

TEST(Lists, EachEntryIsALevelThatGuardsMayAnswer)
{
    // Each entry puts x below the floor, whose guard puts it back: an instant of six events, in
    // which state and set repeat, but which ends.
    const auto run = integrate(DosedFloor{{0.5, 0.5, 0.5}}, {1}, {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.statistics.events, 6U);
    EXPECT_NEAR(run.x[0], 0.5, 1e-15);
}

TEST(Lists, ACrossingAtATimeThatIsListedTwiceIsOneEvent)
{
    // x' = 1 or -1 through zero at 0.1 k, which rounding moves by some 1e-17: the second entry
    // takes the guard to be as near to its surface as the first has found it.
    struct Line {
        using State = std::array<double, 1>;
        static constexpr bool resets() { return false; }
        double rate;
        GuardInfo info;
        Times time_events;
        void flow(double, const State&, State& dxdt) const { dxdt = {rate}; }
        [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
        [[nodiscard]] GuardInfo guard_info() const { return info; }
    };
    for (const Crossing crossing : {Crossing::falling, Crossing::rising, Crossing::either}) {
        for (const std::uint32_t stop_after : {0U, 100U}) {
            for (const double rate : {-1.0, 1.0}) {
                const bool counts =
                    crossing == Crossing::either || (crossing == Crossing::falling) == (rate < 0);
                for (int k = 1; k <= 100; ++k) {
                    const double t = 0.1 * k;
                    const Line line{
                        rate, {.crossing = crossing, .stop_after = stop_after}, {t, t, t}};
                    const auto run = integrate(line, {-rate * t}, {.t_end = t + 1});
                    EXPECT_EQ(run.statistics.events, 3U + counts) << t << ' ' << rate;
                }
            }
        }
    }
}

TEST(Lists, AGuardInTheStepsOfAHostMayAnswerAnyNumberOfTicks)
{
    // The thousandth event of a guard at one instant ends a run, not the thousandth of its answers.
    const DosedFloor floor{every(1e-3)};
    EventMonitor monitor(floor, std::array<double, 1>{});
    const auto run = test::drive(floor, monitor, std::array<double, 1>{1}, 1.5, 1e-3);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 2 * 1501U);
}

// --- timers in the state ---

/// Counts in x[0] how often its timers are due; the due times are the other components.
struct Spikes {
    using State = std::vector<double>;
    void flow(double, const State&, State& dxdt) const { dxdt.assign(dxdt.size(), 0.0); }
    [[nodiscard]] double next_time_event(double, const State& x) const
    {
        return *std::min_element(x.begin() + 1, x.end());
    }
    void time_reset(double, State& x) const
    {
        *std::min_element(x.begin() + 1, x.end()) = 1e9;  // a state is finite
        x[0] += 1;
    }
};

TEST(Timers, SpikesThatAreDueTogetherEachHappen)
{
    const auto run = integrate(Spikes{}, std::vector<double>{0, 1, 1, 1}, {.t_end = 2});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x[0], 3);
    EXPECT_EQ(times_of(run.events), (std::vector<double>{1, 1, 1}));
    const auto at_start = integrate(Spikes{}, std::vector<double>{0, 0, 0, 1}, {.t_end = 2});
    EXPECT_EQ(times_of(at_start.events), (std::vector<double>{0, 0, 1}));
}

/// A timer that always answers `due`, whose event changes nothing.
struct Stuck {
    using State = std::array<double, 1>;
    double due = 1;
    void flow(double, const State&, State& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double next_time_event(double, const State&) const { return due; }
};

TEST(Timers, OneThatStaysDueUnchangedEndsTheRun)
{
    const auto run = integrate(Stuck{}, {0}, {.t_end = 2});
    EXPECT_EQ(run.outcome, Outcome::time_event_not_ahead);
    EXPECT_EQ(run.t, 1);
    EXPECT_EQ(run.statistics.events, 1U);
}

TEST(Timers, OneThatLiesInThePastIsRefused)
{
    EXPECT_EQ(refusal([] { (void)integrate(Stuck{-1}, {0}, {.t_end = 2}); }),
              "integrate: next_time_event(t, x) must return t or a time after it, or infinity; at "
              "the start t = 0 it returned -1");
    EXPECT_THROW((void)integrate(Stuck{std::nan("")}, {0}, {.t_end = 2}), std::invalid_argument);
    EXPECT_THROW((void)integrate(Stuck{-1}, {0}, {.t_end = 2, .continues = true}),
                 std::invalid_argument);
}

/// Spikes whose count ends the run at its second: more may be due at the same time.
struct CountedSpikes : Spikes {
    static constexpr bool resets = false;
    [[nodiscard]] double guard(double, const State& x) const { return 1.5 - x[0]; }
    [[nodiscard]] GuardInfo guard_info() const { return {.resets = false, .stop_after = 1}; }
};

TEST(Timers, DueWhereARunGoesOnHappenThereOnce)
{
    // The run ends between the second of three spikes and the third, which is still in the state:
    // an event that has happened has moved its timer on, and no other record of it is needed.
    const CountedSpikes spikes;
    const std::vector<double> start{0, 1, 1, 1};
    const auto first = integrate(spikes, start, {.t_end = 2});
    ASSERT_EQ(first.outcome, Outcome::stopped_by_event);
    ASSERT_EQ(first.x[0], 2);

    const auto second = integrate(spikes, first.x, {.t_start = 1, .t_end = 2, .continues = true});
    EXPECT_EQ(second.x[0], 3);
    EXPECT_EQ(times_of(second.events), std::vector<double>{1});

    Simulation simulation(spikes, start, {.t_end = 2});
    while (simulation.advance()) continue;
    simulation.restart(simulation.t(), simulation.x());
    while (simulation.advance()) continue;
    const auto whole = simulation.finish();
    EXPECT_EQ(whole.x, second.x);
    EXPECT_EQ(whole.statistics.events, 4U);
}

TEST(Timers, ThatHaveFiredAtTheJointOfTwoRunsDoNotFireAgain)
{
    const Spikes spikes;
    const auto first = integrate(spikes, std::vector<double>{0, 1, 1, 2}, {.t_end = 1});
    EXPECT_EQ(first.x[0], 2);
    const auto second = integrate(spikes, first.x, {.t_start = 1, .t_end = 2, .continues = true});
    EXPECT_EQ(times_of(second.events), std::vector<double>{2});
}

TEST(Timers, OneThatIsAlwaysDueAgainIsAnEndlessCascade)
{
    struct Again : Stuck {
        void time_reset(double, State& x) const { x[0] += 1; }
    };
    const auto run = integrate(Again{}, {0}, {.t_end = 2});
    EXPECT_EQ(run.outcome, Outcome::endless_cascade);
    EXPECT_EQ(run.t, 1);
    struct Turns : Stuck {
        void time_reset(double, State& x) const { x[0] = -x[0]; }
    };
    const auto turns = integrate(Turns{}, {0}, {.t_end = 2});
    EXPECT_EQ(turns.outcome, Outcome::endless_cascade);
    EXPECT_LE(turns.statistics.events, 8U);  // found where a level repeats one of number 2^k
}

/// A monostable: x' = 1 crosses 1, which starts a timer of 0.25 s; then x falls back to 0.
///
/// Period 1.25 s, of which 0.25 s in the mode `waits`, with x = 1.
struct Monostable {
    using State = std::array<double, 2>;  // x, time at which the timer is due
    static constexpr std::size_t mode_count = 2;
    enum : Mode { rises, waits };

    void flow(Mode mode, double, const State&, State& dxdt) const
    {
        dxdt = {mode == rises ? 1.0 : 0.0, 0.0};
    }
    [[nodiscard]] double guard(Mode, double, const State& x) const { return 1 - x[0]; }
    [[nodiscard]] bool enabled(Mode mode) const { return mode == rises; }
    Mode reset(Mode, double t, State& x) const
    {
        x[1] = t + 0.25;
        return waits;
    }
    [[nodiscard]] double next_time_event(Mode mode, double, const State& x) const
    {
        return mode == waits ? x[1] : infinity;
    }
    Mode time_reset(Mode, double, State& x) const
    {
        x[0] = 0;
        return rises;
    }
};

template <class Run>
void expect_monostable(const Run& run, double tolerance)
{
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 16U);
    for (std::size_t k = 0; k < 8; ++k) {
        EXPECT_NEAR(run.events[2 * k].t, 1 + 1.25 * static_cast<double>(k), tolerance);
        EXPECT_NEAR(run.events[2 * k + 1].t, 1.25 * static_cast<double>(k + 1), tolerance);
        EXPECT_EQ(run.events[2 * k + 1].kind, EventKind::time);
    }
}

TEST(Timers, ThatAnEventStartsRunByEveryMethod)
{
    // Flights of a constant rate are exact but for the rounding of sums of eight periods.
    const double tolerance = 1e-13;
    const Monostable system;
    const Options options{.t_end = 10.5};
    expect_monostable(integrate(system, {0, 0}, options), tolerance);
    expect_monostable(integrate(system, {0, 0}, options, ErrorControlled<Fehlberg78>{}), tolerance);
    expect_monostable(integrate(system, {0, 0}, options, {}, Ends{}, Bisection{}), tolerance);
    Options fixed = options;
    fixed.step = 0.0173;
    expect_monostable(integrate(system, {0, 0}, fixed, FixedStep<Rk4>{}), tolerance);
}

TEST(Timers, ThatAnEventStartsStopTheStepsOfAHost)
{
    const Monostable system;
    EventMonitor monitor(system, std::array<double, 2>{});
    const auto run = test::drive(system, monitor, std::array<double, 2>{0, 0}, 10.5, 0.01);
    expect_monostable(run, 1e-12);  // the host adds a thousand steps
}

TEST(Timers, ThatAnEventStartsAreSaved)
{
    const Monostable system;
    const std::array<double, 2> x0{};
    Simulation whole(system, x0, {.t_end = 10.5});
    Simulation first(system, x0, {.t_end = 10.5});
    while (first.mode() != Monostable::waits) ASSERT_TRUE(first.advance());
    Simulation second(system, x0, {.t_end = 10.5});
    second.restore(first.save());
    const auto run = second.take();
    const auto expected = whole.take();
    EXPECT_EQ(run.x, expected.x);
    EXPECT_EQ(run.events.size() + 1, expected.events.size());
}

TEST(Timers, AnEventCancels)
{
    // A watchdog of 1 s, rewound by each crossing of sin(2 pi t) until x has decayed.
    struct Watchdog {
        using State = std::array<double, 2>;
        void flow(double, const State&, State& dxdt) const { dxdt = {0, 0}; }
        [[nodiscard]] double guard(double t, const State&) const
        {
            return t < 4 ? std::sin(2 * std::numbers::pi * t + 1) : 1.0;
        }
        void reset(double t, State& x) const { x[1] = t + 1.5; }
        [[nodiscard]] double next_time_event(double, const State& x) const { return x[1]; }
        void time_reset(double t, State& x) const { x = {t, 1e9}; }
    };
    // Falls at t = k + 1/2 - 1/(2 pi), the last at 3.5 - 1/(2 pi).
    const auto run = integrate(Watchdog{}, {0, 1.5}, {.t_end = 8, .h_max = 0.1});
    EXPECT_NEAR(run.x[0], 5 - 1 / (2 * std::numbers::pi), 1e-12);
    EXPECT_EQ(run.statistics.events, 5U);
}

// --- the start, and the entry of a mode ---

/// x' = `rate`, with a guard x or -x that adds 10, or is only recorded.
struct Limit {
    using State = std::array<double, 1>;
    double rate = 1;
    GuardInfo info{};
    Times time_events{};

    void flow(double, const State&, State& dxdt) const { dxdt = {rate}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    [[nodiscard]] GuardInfo guard_info() const { return info; }
    void reset(double, State& x) const { x[0] += 10; }
    void time_reset(double, State& x) const { x[0] += 10; }
};

std::uint64_t events_at_start(double x, double rate, Crossing crossing, bool continues = false)
{
    const Limit limit{rate, {.crossing = crossing, .at_start = true}};
    const auto run = integrate(limit, {x}, {.t_end = 1e-3, .continues = continues});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.statistics.armed_beyond, 0U);
    return run.statistics.events;
}

TEST(AtStart, AGuardFiresWhereItsConditionHolds)
{
    for (const double rate : {-1.0, 1.0}) {
        EXPECT_EQ(events_at_start(-1, rate, Crossing::falling), 1U);
        EXPECT_EQ(events_at_start(1, rate, Crossing::falling), 0U);
        EXPECT_EQ(events_at_start(1, rate, Crossing::rising), 1U);
        EXPECT_EQ(events_at_start(-1, rate, Crossing::rising), 0U);
    }
    // On the surface: not where it moves inside.
    EXPECT_EQ(events_at_start(0, 1, Crossing::falling), 0U);
    EXPECT_EQ(events_at_start(0, -1, Crossing::falling), 1U);
    EXPECT_EQ(events_at_start(0, 0, Crossing::falling), 1U);
    EXPECT_EQ(events_at_start(0, 1, Crossing::rising), 1U);
    EXPECT_EQ(events_at_start(0, -1, Crossing::rising), 0U);
    EXPECT_EQ(events_at_start(-1, 1, Crossing::falling, true), 0U);
}

TEST(AtStart, RecordedTerminalAndBooleanGuardsFireToo)
{
    Limit limit{-1, {.resets = false, .at_start = true}};
    auto run = integrate(limit, {-1}, {.t_end = 1});
    EXPECT_EQ(times_of(run.events), std::vector<double>{0});
    EXPECT_EQ(run.x[0], -2);
    limit.info.stop_after = 1;
    run = integrate(limit, {-1}, {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(run.t, 0);
    EXPECT_EQ(run.guard, 0U);
    struct Truth : Limit {
        [[nodiscard]] bool guard(double, const State& x) const { return x[0] > 0; }
    };
    const Truth truth{{-1, {.at_start = true}}};
    EXPECT_EQ(integrate(truth, {-1}, {.t_end = 1}).x[0], 8);
}

TEST(AtStart, IsOneSetWithATimeEventThere)
{
    const Limit limit{0, {.at_start = true}, {0, 0}};
    const auto run = integrate(limit, {-1}, {.t_end = 1});
    ASSERT_EQ(run.events.size(), 3U);
    EXPECT_EQ(run.events[0].after[0], 19);  // both add 10
    EXPECT_EQ(run.events[1].after[0], 19);
    EXPECT_EQ(run.events[2].after[0], 29);
}

TEST(AtStart, AGuardThatBeginsBeyondItsSurfaceIsCountedAndNamed)
{
    const auto run = integrate(Limit{1}, {-1}, {.t_end = 3});
    EXPECT_EQ(run.statistics.events, 0U);
    EXPECT_EQ(run.statistics.armed_beyond, 1U);
    EXPECT_EQ(run.armed_beyond, std::vector<std::size_t>{0});
    EXPECT_NE(describe(run).find("guard 0 began beyond its surface"), std::string::npos);
    const auto inside = integrate(Limit{1}, {1}, {.t_end = 3});
    EXPECT_EQ(inside.statistics.armed_beyond, 0U);
    EXPECT_EQ(describe(inside), describe(Outcome::reached_end));
}

TEST(AtStart, NeedsASideThatIsItsCondition)
{
    const auto refused = [](const GuardInfo& info) {
        return refusal([&] { (void)integrate(Limit{1, info}, {1}, {.t_end = 1}); });
    };
    EXPECT_EQ(refused({.name = "limit", .crossing = Crossing::either, .at_start = true}),
              "integrate: guard 0 (limit) has at_start, so it must be falling or rising, and not "
              "unilateral, got Crossing::either");
    EXPECT_EQ(refused({.unilateral = true, .at_entry = true}),
              "integrate: guard 0 has at_entry, so it must be falling or rising, and not "
              "unilateral, got unilateral");
}

/// A converter: on at each tick, off where the current x reaches 1, unless it is beyond already.
struct Converter {
    using State = std::array<double, 1>;
    static constexpr std::size_t mode_count = 2;
    enum : Mode { off, on };
    bool at_entry = true;
    Times time_events = every(1);

    void flow(Mode mode, double, const State&, State& dxdt) const
    {
        dxdt = {mode == on ? 2.0 : -0.1};
    }
    [[nodiscard]] double guard(Mode, double, const State& x) const { return 1 - x[0]; }
    [[nodiscard]] bool enabled(Mode mode) const { return mode == on; }
    [[nodiscard]] GuardInfo guard_info() const { return {.at_entry = at_entry}; }
    Mode reset(Mode, double, State&) const { return off; }
    Mode time_reset(Mode, double, State&) const { return on; }
};

TEST(AtEntry, AComparatorBeyondItsLimitWhereItsModeBeginsFires)
{
    // From 2 it falls by 0.1 s^-1, and each tick is answered within the same instant.
    const auto run = integrate(Converter{}, {2}, {.t_end = 4.5});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 2 - 0.45, 1e-12);
    EXPECT_EQ(run.statistics.events, 10U);
    EXPECT_EQ(run.statistics.armed_beyond, 0U);

    const auto runs_away = integrate(Converter{.at_entry = false}, {2}, {.t_end = 4.5});
    EXPECT_NEAR(runs_away.x[0], 2 + 9, 1e-12);
    EXPECT_EQ(runs_away.statistics.armed_beyond, 1U);  // later ticks change no mode
}

// --- runs without an end ---

/// x' = -x with a guard x - 1/e.
struct Decay {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;
    GuardInfo info{.resets = false};
    void flow(double, const State& x, State& dxdt) const { dxdt = {-x[0]}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0] - 1 / e; }
    [[nodiscard]] GuardInfo guard_info() const { return info; }
};

TEST(Endless, AnEventEndsARunWithoutAnEnd)
{
    const Decay decay{{.resets = false, .stop_after = 1}};
    const auto run = integrate(decay, {1}, {.t_end = infinity});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 1, 1e-7);  // rtol 1e-8 of x, whose rate is x
    const Decay rises{{.crossing = Crossing::rising, .resets = false}};
    const auto backward = integrate(rises, {0.1}, {.t_end = -infinity, .stop_at_event = true});
    EXPECT_EQ(backward.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(backward.t, -std::log(10 / e), 1e-7);
    const auto fixed = integrate(decay, {1}, {.t_end = infinity, .step = 0.01}, FixedStep<Rk4>{});
    EXPECT_NEAR(fixed.t, 1, 1e-9);
    const auto steps = integrate(Decay{}, {1}, {.t_end = infinity, .max_steps = 100});
    EXPECT_EQ(steps.outcome, Outcome::step_limit);
}

TEST(Endless, ARunThatNothingEndsStalls)
{
    // A guard that is never reached by a motion that stands still, or recedes.
    struct Receding {
        using State = std::array<double, 1>;
        static constexpr bool resets() { return false; }
        double rate = 0;
        void flow(double, const State&, State& dxdt) const { dxdt = {rate}; }
        [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
        [[nodiscard]] GuardInfo guard_info() const { return {.stop_after = 1}; }
    };
    for (const double rate : {0.0, 1.0}) {
        const auto run = integrate(Receding{rate}, {1}, {.t_end = infinity});
        EXPECT_EQ(run.outcome, Outcome::stalled) << rate;
        EXPECT_EQ(describe(run).rfind("stall_steps steps hardly advanced the time, or nothing", 0),
                  0U);
    }
}

TEST(Endless, WhereNothingEndsTheRunItIsRefused)
{
    EXPECT_EQ(refusal([] { (void)integrate(Decay{}, {1}, {.t_end = infinity}); }),
              "integrate: t_end must be a finite time where nothing else may end the run, got inf; "
              "expected a guard with stop_after, stop_at_event, or max_steps, also beside a reset "
              "that ends the run");
    // Whether a reset will end it cannot be seen beforehand.
    EXPECT_THROW((void)integrate(Limit{}, {1}, {.t_end = infinity}), std::invalid_argument);
    EXPECT_THROW((void)integrate(Doses{}, {1}, {.t_end = std::nan("")}), std::invalid_argument);
    EXPECT_THROW((void)integrate(Doses{}, {1}, {.t_start = infinity, .t_end = 1}),
                 std::invalid_argument);
}

TEST(Endless, AClockIsNoEndButItsResetMayBe)
{
    struct Ten : Doses {
        void time_reset(double, State& x) const
        {
            if (++x[0] == 10) throw StopRun("ten ticks");
        }
    };
    const auto run = integrate(Ten{{every(100)}}, {0}, {.t_end = infinity, .max_steps = 1'000'000});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(run.t, 900);
    EXPECT_EQ(run.reason, "ten ticks");
}

TEST(Endless, AHundredHertzForADayDoesNotStall)
{
    struct Sampler : Doses {
        void time_reset(double, State& x) const
        {
            if (++x[0] == 100'000) throw StopRun("enough");
        }
    };
    const auto run = integrate(Sampler{{every(0.01)}}, {0},
                               {.t_end = infinity,
                                .record_events = false,
                                .max_steps = 1'000'000'000,
                                .stall_steps = 1000});
    EXPECT_EQ(run.reason, "enough");
}

// --- resets that end the run ---

/// A ball that breaks at its third impact; with Modes and states of any type.
template <class X>
struct Fragile {
    using State = X;
    static constexpr std::size_t mode_count = 2;
    void flow(Mode, double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -10;
        dxdt[2] = 0;
    }
    [[nodiscard]] double guard(Mode, double, const X& x) const { return x[0]; }
    Mode reset(Mode mode, double, X& x) const
    {
        x[0] = 0;
        x[1] = -x[1];
        x[2] += 1;
        if (x[2] == 3) throw StopRun("it broke", Mode{1});
        return mode;
    }
};

template <class X>
void expect_broken(X x0)
{
    x0[0] = 5;
    x0[1] = x0[2] = 0;
    const auto run = integrate(Fragile<X>{}, x0, {.t_end = 100});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(run.reason, "it broke");
    EXPECT_EQ(describe(run), "a reset ended the run: it broke");
    EXPECT_EQ(run.guard, 0U);
    EXPECT_EQ(run.mode, 1U);
    EXPECT_EQ(run.x[2], 3);
    ASSERT_EQ(run.events.size(), 3U);
    EXPECT_EQ(run.events[2].mode_after, 1U);
    EXPECT_NEAR(run.t, 5, 1e-12);  // falls of 1 s and flights of 2 s
}

TEST(Stops, AResetEndsTheRunWithItsStateAndItsMode)
{
    expect_broken(std::array<double, 3>{});
    expect_broken(std::vector<double>(3));
    expect_broken(std::array<double, 6>{});
}

/// Two guards that add to one component at 1; the second ends the run above `most`.
struct Pair {
    using State = std::array<double, 1>;
    static constexpr std::size_t guard_count = 2;
    double most = 0;
    void flow(double, const State&, State& dxdt) const { dxdt = {0}; }
    [[nodiscard]] double guard(std::size_t, double t, const State&) const { return 1 - t; }
    void reset(std::size_t which, double, State& x) const
    {
        x[0] += 1;
        if (x[0] > most && which == 1) throw StopRun("too much");
    }
};

TEST(Stops, InASetTheFirstCallCounts)
{
    // Two guards that add to one component: their resets are asked again in every order, where the
    // sum would stop, but alone neither does.
    const auto goes_on = integrate(Pair{1.5}, {0}, {.t_end = 2});
    EXPECT_EQ(goes_on.outcome, Outcome::reached_end);
    EXPECT_EQ(goes_on.x[0], 2);
    EXPECT_EQ(goes_on.reason, "");
    const auto stops = integrate(Pair{0.5}, {0}, {.t_end = 2});
    EXPECT_EQ(stops.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(stops.x[0], 2);
    EXPECT_EQ(stops.guard, 1U);
    EXPECT_EQ(stops.reason, "too much");
}

TEST(Stops, AResetThatChangesNothingElseEndsTheRun)
{
    struct Wall : Limit {
        void reset(double, State&) const { throw StopRun("at the wall"); }
    };
    const auto run = integrate(Wall{{-1}}, {1}, {.t_end = 2});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 1, 1e-15);
    EXPECT_EQ(run.reason, "at the wall");
}

TEST(Stops, AResetEndsTheRunOfAMonitor)
{
    struct Wall : Limit {
        void reset(double, State&) const { throw StopRun("at the wall"); }
    };
    const Wall wall{{-1}};
    EventMonitor monitor(wall, std::array<double, 1>{});
    const auto run = test::drive(wall, monitor, std::array<double, 1>{1}, 2.0, 0.1);
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 1, 1e-12);
    EXPECT_EQ(monitor.reason(), "at the wall");
}

TEST(Stops, AnotherExceptionStillPassesThrough)
{
    struct Broken : Limit {
        void reset(double, State&) const { throw std::runtime_error("a defect"); }
    };
    EXPECT_THROW((void)integrate(Broken{{-1}}, {1}, {.t_end = 2}), std::runtime_error);
}

// --- exceptions in the middle of an instant ---

TEST(Lists, AreTakenAgainAfterAnException)
{
    struct Fails : Doses {
        mutable int calls = 0;
        void time_reset(double, State& x) const
        {
            if (++calls == 2) throw std::runtime_error("once");
            x[0] += 1;
        }
    };
    const Fails doses{{{1, 1, 1}}};
    Simulation simulation(doses, std::array<double, 1>{}, {.t_end = 2});
    EXPECT_THROW(simulation.run_to_end([](const auto&) {}), std::runtime_error);
    EXPECT_EQ(simulation.take().x[0], 3);
}

}  // namespace
}  // namespace ricochet
