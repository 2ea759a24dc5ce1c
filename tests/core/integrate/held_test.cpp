// What a rest holds, and when it goes free.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/rosenbrock.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::held_test {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Times of the events of a kind.
template <class Run>
[[nodiscard]] std::vector<double> times_of(const Run& run, EventKind kind)
{
    std::vector<double> times;
    for (const auto& event : run.events) {
        if (event.kind == kind) times.push_back(event.t);
    }
    return times;
}

void expect_near(const std::vector<double>& found, const std::vector<double>& expected,
                 double tolerance)
{
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], tolerance);
}

// --- a ball that is thrown sideways ---

/// x, y and their rates, above a floor at `floor`; g = 10 m/s², e = 0.5.
struct Thrown {
    using State = std::array<double, 4>;
    double floor = 0;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[2], x[3], 0, -10}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[1] - floor; }
    void reset(double, State& x) const { x[1] = floor, x[3] *= -0.5; }
    void rest(double, State& x) const { x[1] = floor, x[3] = 0; }
};

/// The same with a second guard, which records where x = 2.
struct Recorded : Thrown {
    static constexpr std::size_t guard_count = 2;
    [[nodiscard]] double guard(std::size_t which, double t, const State& x) const
    {
        return which == 0 ? Thrown::guard(t, x) : x[0] - 2;
    }
    void reset(std::size_t, double t, State& x) const { Thrown::reset(t, x); }
    void rest(std::size_t, double t, State& x) const { Thrown::rest(t, x); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        if (which == 0) return {};
        return {.crossing = Crossing::rising, .resets = false};
    }
};

/// From the height 0.1 at 1 m/s: the flights end at sqrt(2 0.1 / 10) (1 + e) / (1 - e), with a
/// remainder below 16 units in the last place; x is t, linear in time and exact by any method.
template <class System, class Stepping = ErrorControlled<Dopri5>>
auto expect_slide(const System& system, const Stepping& stepping = {}, double step = 0)
{
    const auto run =
        integrate(system, {0, 0.1, 1, 0}, {.t_end = 4, .step = step, .rtol = 1e-10}, stepping);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    expect_near(times_of(run, EventKind::accumulation), {3 * std::sqrt(0.02)}, 1e-12);
    EXPECT_NEAR(run.x[0], 4, 1e-12);
    EXPECT_EQ(run.x[1], 0);
    EXPECT_EQ(run.x[2], 1);
    EXPECT_EQ(run.x[3], 0);
    return run;
}

TEST(Held, AThrownBallSlidesOn)
{
    expect_slide(Thrown{});
    expect_slide(Thrown{}, ErrorControlled<Fehlberg78>{});
    expect_slide(Thrown{}, ErrorControlled<CashKarp54>{});
    expect_slide(Thrown{}, FixedStep<Rk4>{}, 0.01);
}

/// The same, for methods that read the formulas of the flow.
struct Formulas : Thrown {
    template <class S>
    constexpr void flow(const S&, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = 0.0 * x[2];
        dxdt[3] = 0.0 * x[3] - 10.0;
    }
    template <class V>
    [[nodiscard]] auto guard(const auto&, const V& x) const
    {
        return x[1];
    }
};

TEST(Held, ByMethodsThatAreReplacedMeanwhile)
{
    expect_slide(Formulas{}, ErrorControlled<Taylor>{});
    expect_slide(Formulas{}, FixedStep<Taylor>{}, 0.01);
    expect_slide(Formulas{}, ErrorControlled<Rosenbrock4>{});
}

TEST(Held, AnotherGuardChangesNothing)
{
    const auto run = expect_slide(Recorded{});
    ASSERT_EQ(run.events.back().guard, 1U);
    EXPECT_NEAR(run.events.back().t, 2, 1e-12);
}

TEST(Held, ASlideOnAFloorThatHasARounding)
{
    // The limit is known to its `error` alone; x keeps the time.
    for (const double floor : {1.0, -3.7, 1000.0}) {
        const auto run = integrate(Thrown{floor}, {0, floor + 0.1, 1, 0}, {.t_end = 4});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << floor;
        const auto& last = run.events.back();
        ASSERT_EQ(last.kind, EventKind::accumulation) << floor;
        EXPECT_NEAR(last.t, 3 * std::sqrt(0.02), last.error) << floor;
        EXPECT_NEAR(run.x[0], 4, 1e-12) << floor;
        EXPECT_EQ(run.x[1], floor);
    }
}

TEST(Held, SamplesAndTheSolutionFollowTheSlide)
{
    const std::vector<double> times = {0.43, 1, 2.5, 3.9, 4};
    const auto run = integrate(Thrown{}, {0, 0.1, 1, 0},
                               {.t_end = 4, .record_steps = true, .sample_times = times});
    ASSERT_EQ(run.trajectory.t, times);
    for (std::size_t i = 0; i < times.size(); ++i) {
        EXPECT_NEAR(run.trajectory.x[i][0], times[i], 1e-12);
        EXPECT_EQ(run.trajectory.x[i][1], 0);
        EXPECT_NEAR(run.solution(times[i])[0], times[i], 1e-12);
    }
}

TEST(Held, ASavedSlideGoesOnWithTheSameBits)
{
    Simulation simulation(Recorded{}, {0, 0.1, 1, 0}, {.t_end = 4});
    while (simulation.t() < 0.5) ASSERT_TRUE(simulation.step());
    const Snapshot snapshot = simulation.save();
    const auto whole = simulation.take();
    Simulation other(Recorded{}, {0, 0.1, 1, 0}, {.t_end = 4});
    other.restore(snapshot);
    const auto rest = other.take();
    EXPECT_EQ(rest.x, whole.x);
    EXPECT_NEAR(whole.x[0], 4, 1e-12);
    EXPECT_EQ(rest.statistics.events, 1U);
}

TEST(Held, ARunThatContinuesFromARestIsHeldAgain)
{
    const auto check = [](const auto& system, const auto& stepping, double step) {
        const auto first = integrate(system, {0, 0.1, 1, 0},
                                     {.t_end = 1.5, .step = step, .rtol = 1e-10}, stepping);
        const auto run = integrate(
            system, first.x,
            {.t_start = 1.5, .t_end = 4, .continues = true, .step = step, .rtol = 1e-10}, stepping);
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_TRUE(times_of(run, EventKind::accumulation).empty());
        EXPECT_EQ(run.statistics.armed_beyond, 0U);
        EXPECT_NEAR(run.x[0], 4, 1e-12);
        EXPECT_EQ(run.x[1], system.floor);
        EXPECT_EQ(run.x[3], 0);
    };
    struct Unilateral : Thrown {
        bool unilateral = true;
    };
    check(Thrown{}, ErrorControlled<Dopri5>{}, 0);
    check(Thrown{}, FixedStep<Rk4>{}, 0.01);
    check(Recorded{}, ErrorControlled<Fehlberg78>{}, 0);
    check(Formulas{}, ErrorControlled<Taylor>{}, 0);
    check(Unilateral{}, ErrorControlled<Dopri5>{}, 0);
}

TEST(Held, ARestartOfARestIsHeldUnlessItMovesWhatIsHeld)
{
    Simulation simulation(Thrown{}, {0, 0.1, 1, 0}, {.t_end = 4});
    while (simulation.t() < 1.5) ASSERT_TRUE(simulation.step());
    simulation.restart(1.5, {1.5, 0, 2, 0});
    while (simulation.step()) {
    }
    EXPECT_NEAR(simulation.x()[0], 6.5, 1e-12);
    EXPECT_EQ(simulation.x()[1], 0);
    simulation.restart(1, {1, 0, 1, 2});  // kicked up, it rests again after 0.8 s
    const auto kicked = simulation.take();
    EXPECT_EQ(kicked.x[1], 0);
    EXPECT_NEAR(kicked.x[0], 4, 1e-12);
    EXPECT_EQ(times_of(kicked, EventKind::accumulation).size(), 2U);
    EXPECT_EQ(kicked.statistics.armed_beyond, 0U);
}

TEST(Held, ARestartBeyondASurfaceIsCounted)
{
    Simulation simulation(Thrown{}, {0, 0.1, 1, 0}, {.t_end = 4});
    while (simulation.t() < 1.5) ASSERT_TRUE(simulation.step());
    simulation.restart(1.5, {1.5, 0, 1, -1});
    const auto run = simulation.take();
    EXPECT_EQ(run.statistics.armed_beyond, 1U);
    EXPECT_EQ(run.armed_beyond, std::vector<std::size_t>{0});
}

TEST(Held, ARunThatBeginsAtRestSaysWhyItMovesOnAndWhatHoldsIt)
{
    // Where a run ended at rest, another one begins: by itself it falls, 5 (4 - 1.5)^2 = 31.25 m.
    const auto first = integrate(Thrown{}, {0, 0.1, 1, 0}, {.t_end = 1.5});
    const auto again = [&](const auto& system, bool continues) {
        return integrate(system, first.x, {.t_start = 1.5, .t_end = 4, .continues = continues});
    };
    const auto falls = again(Thrown{}, false);
    EXPECT_NEAR(falls.x[1], -31.25, 1e-12);
    EXPECT_EQ(falls.armed_beyond, std::vector<std::size_t>{0});
    EXPECT_EQ(falls.armed_on_surface, std::vector<std::size_t>{0});
    EXPECT_EQ(
        describe(falls),
        "the end time was reached; guard 0 began on its surface and moved on beyond it, which "
        "is no event (unilateral and at_start give it one; a start from what a run has left at "
        "rest is held again by `continues`)");
    // What the sentence says is so.
    EXPECT_EQ(again(Thrown{}, true).x[1], 0);
    EXPECT_EQ(describe(again(Thrown{}, true)), describe(Outcome::reached_end));
    struct Unilateral : Thrown {
        bool unilateral = true;
    };
    EXPECT_EQ(again(Unilateral{}, false).x[1], 0);
    struct AtStart : Thrown {
        [[nodiscard]] static GuardInfo guard_info() { return {.at_start = true}; }
    };
    EXPECT_EQ(again(AtStart{}, false).events.size(), 1U);

    // Beyond the surface is another matter; of a guard that began in both ways the last one counts.
    Simulation simulation(Thrown{}, first.x, {.t_start = 1.5, .t_end = 4});
    simulation.restart(2, {1.5, -1, 1, 0});
    const auto beyond = simulation.take();
    EXPECT_EQ(beyond.armed_beyond, std::vector<std::size_t>{0});
    EXPECT_TRUE(beyond.armed_on_surface.empty());
    EXPECT_EQ(describe(beyond),
              "the end time was reached; guard 0 began beyond its surface, and waited until it had "
              "returned (at_start and at_entry let it fire there)");
}

TEST(Held, ABallThatBeginsAtRestAtAnyHeightSaysThatItFell)
{
    // At a height other than zero the rounding of x - h hides for the first steps where it heads.
    const auto check = [](double height, const auto& stepping) {
        const Thrown ball{.floor = height};
        const Options options{
            .t_end = 4,
            .step = std::is_same_v<decltype(stepping), const FixedStep<Rk4>&> ? 0.01 : 0};
        const auto run = integrate(ball, {0, height, 1, 0}, options, stepping);
        EXPECT_NEAR(run.x[1], height - 80, 1e-9 * (80 + std::fabs(height)));
        EXPECT_EQ(run.armed_beyond, std::vector<std::size_t>{0}) << height;
        EXPECT_EQ(run.armed_on_surface, std::vector<std::size_t>{0}) << height;
        EXPECT_EQ(run.statistics.armed_beyond, 1U) << height;
        EXPECT_NE(describe(run).find("began on its surface and moved on"), std::string::npos);
    };
    for (const double height : {0.0, 0.5, 1.0, -1.0, 3.0, 1000.0, 0.001, 1e8}) {
        check(height, ErrorControlled<Dopri5>{});
        check(height, ErrorControlled<Fehlberg78>{});
        check(height, FixedStep<Rk4>{});
        // One that stays where it is, rises, or has an event there, has nothing to say.
        const Thrown ball{.floor = height};
        EXPECT_EQ(integrate(ball, {0, height, 1, 2}, {.t_end = 0.1}).statistics.armed_beyond, 0U);
        struct Stands : Thrown {
            void flow(double t, const State& x, State& dxdt) const
            {
                dxdt = {x[2], x[3], 0, t < 2 ? 0.0 : 10.0};
            }
        };
        Stands stands;
        stands.floor = height;
        EXPECT_EQ(integrate(stands, {0, height, 1, 0}, {.t_end = 1}).statistics.armed_beyond, 0U);
        EXPECT_EQ(integrate(stands, {0, height, 1, 0}, {.t_end = 3}).statistics.armed_beyond, 0U);
    }
    Simulation simulation(Thrown{.floor = 1}, {0, 1.1, 1, 0}, {.t_end = 4});
    while (simulation.t() < 1.5) ASSERT_TRUE(simulation.step());
    simulation.restart(1, {1, 1, 1, -0.0}, 0);
    const auto held = simulation.take();  // a restart holds again what is at rest
    EXPECT_EQ(held.x[1], 1);
    EXPECT_EQ(held.statistics.armed_beyond, 0U);
}

TEST(Held, ARunThatIsSavedAfterAReleaseIsTheSameRun)
{
    // The first ball is lifted off its floor while the second still bounces.
    struct Balls {
        using State = std::array<double, 4>;
        std::size_t guard_count = 2;
        void flow(double t, const State& x, State& dxdt) const
        {
            dxdt = {x[2], x[3], 10 * std::min(t - 1, 0.1), -1};
        }
        [[nodiscard]] double guard(std::size_t which, double, const State& x) const
        {
            return x[which];
        }
        void reset(std::size_t which, double, State& x) const
        {
            x[which] = 0;
            x[which + 2] *= -0.5 - 0.4 * static_cast<double>(which);
        }
        void rest(std::size_t which, double, State& x) const { x[which] = x[which + 2] = 0; }
    };
    Simulation simulation(Balls{}, {0.01, 0.1, 0, 0}, {.t_end = 3});
    while (times_of(simulation.run(), EventKind::mode).empty()) ASSERT_TRUE(simulation.step());
    Simulation other(Balls{}, {0.01, 0.1, 0, 0}, {.t_end = 3});
    other.restore(simulation.save());
    while (simulation.step()) {
        ASSERT_TRUE(other.step());
        ASSERT_EQ(to_text(other.save()), to_text(simulation.save())) << simulation.t();
    }
    EXPECT_EQ(other.x(), simulation.x());
}

// --- what goes free ---

/// A ball that is pulled by `pull(t)`; the floor has e = 0.5, and throws it up by `launch` where
/// its flights end. At the time `tick` it gets the speed `kick`.
struct Pulled {
    using State = std::array<double, 2>;
    std::function<double(double)> pull = [](double) { return -10.0; };
    double launch = 0;
    double tick = infinity;
    double kick = 0;
    void flow(double t, const State& x, State& dxdt) const { dxdt = {x[1], pull(t)}; }
    [[nodiscard]] double guard(double, const State& x) const { return x[0]; }
    void reset(double, State& x) const { x = {0, -0.5 * x[1]}; }
    void rest(double, State& x) const { x = {0, launch}; }
    [[nodiscard]] double next_time_event(double t) const { return t < tick ? tick : infinity; }
    void time_reset(double, State& x) const { x[1] += kick; }
};

TEST(Held, ARestThatThrowsTheBallUpHoldsNothing)
{
    // It flies for 1 s, and again and again by half; two seconds from limit to limit.
    const auto run = integrate(Pulled{.launch = 5}, {0.2, 0}, {.t_end = 10, .rtol = 1e-10});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    expect_near(times_of(run, EventKind::accumulation), {0.6, 2.6, 4.6, 6.6, 8.6}, 1e-12);
    EXPECT_NEAR(run.x[0], 0.2, 1e-11);
    EXPECT_NEAR(run.x[1], -1.5, 1e-11);
}

TEST(Held, AKickSetsTheBallFree)
{
    const Pulled kicked{.tick = 2, .kick = 1};
    const auto run = integrate(kicked, {0.2, 0}, {.t_end = 5, .sample_times = {2.1}});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    expect_near(times_of(run, EventKind::accumulation), {0.6, 2.4}, 1e-12);
    EXPECT_NEAR(run.trajectory.x.at(0)[0], 0.05, 1e-12);
    EXPECT_EQ(run.x, (Pulled::State{0, 0}));
    EXPECT_TRUE(times_of(run, EventKind::mode).empty());
}

TEST(Held, ALiftSetsTheBallFree)
{
    // From 1 s on the weight is lifted by 10 N/s per kg: at 2 s it hangs free, then
    // v = 5 (t - 2)^2 and x = 5/3 (t - 2)^3.
    const auto lift = [](double t) { return t < 1 ? -10 : -10 + 10 * (t - 1); };
    const auto expect_lift = [](const auto& run) {
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        expect_near(times_of(run, EventKind::mode), {2}, 1e-12);
        EXPECT_NEAR(run.x[0], 5.0 / 3, 1e-9);
        EXPECT_NEAR(run.x[1], 5, 1e-9);
    };
    for (const double tick : {1.0, infinity}) {
        const Pulled pulled{.pull = lift, .tick = tick};
        const auto run = integrate(pulled, {0.2, 0}, {.t_end = 3, .rtol = 1e-10});
        expect_near(times_of(run, EventKind::accumulation), {0.6}, 1e-12);
        expect_lift(run);
        expect_lift(integrate(pulled, {0, 0},
                              {.t_start = 0.7, .t_end = 3, .continues = true, .rtol = 1e-10}));
    }
}

TEST(Held, ALiftOfAShortTimeIsSeenInALongRun)
{
    /// It lies on its floor from the start.
    struct Lying : Pulled {
        bool unilateral = true;
    };
    // Lifted each time that 12 sin t exceeds the weight; at rest again before the next.
    Lying ball;
    ball.pull = [](double t) { return -10 + 12 * std::sin(t); };
    const auto run = integrate(ball, {0, 0}, {.t_end = 100, .rtol = 1e-9});
    const auto freed = times_of(run, EventKind::mode);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(freed.size(), 16U);  // once a turn, the last at 15 turns + asin(10 / 12)
    const double pi = std::acos(-1);
    for (std::size_t k = 0; k < freed.size(); ++k) {
        EXPECT_NEAR(freed[k], std::asin(10.0 / 12) + 2 * pi * static_cast<double>(k), 1e-9);
    }
}

/// At x = 2 the floor ends.
struct Ledge : Thrown {
    static constexpr std::size_t guard_count = 2, mode_count = 2;
    void flow(Mode, double t, const State& x, State& dxdt) const { Thrown::flow(t, x, dxdt); }
    [[nodiscard]] double guard(std::size_t which, Mode, double t, const State& x) const
    {
        return which == 0 ? Thrown::guard(t, x) : 2 - x[0];
    }
    [[nodiscard]] bool enabled(std::size_t, Mode mode) const { return mode == 0; }
    Mode reset(std::size_t which, Mode, double t, State& x) const
    {
        if (which == 0) Thrown::reset(t, x);
        return which == 0 ? 0 : 1;
    }
    Mode rest(std::size_t, Mode mode, double t, State& x) const
    {
        Thrown::rest(t, x);
        return mode;
    }
};

TEST(Held, AVetoSetsTheBallFree)
{
    // The platform is there until 2 s, or as far as x = 2.
    struct Platform : Thrown {
        bool by_place = false;
        [[nodiscard]] bool enabled(double t, const State& x) const
        {
            return (by_place ? x[0] : t) < 2;
        }
    };
    for (const bool by_place : {false, true}) {
        for (const double speed : {1.0, 0.0}) {
            if (by_place && speed == 0) continue;
            Platform platform;
            platform.by_place = by_place;
            for (const bool fixed : {false, true}) {
                const Options options{.t_end = 3, .step = fixed ? 0.013 : 0, .rtol = 1e-10};
                const auto run =
                    fixed ? integrate(platform, {0, 0.1, speed, 0}, options, FixedStep<Rk4>{})
                          : integrate(platform, {0, 0.1, speed, 0}, options);
                SCOPED_TRACE(speed);
                expect_near(times_of(run, EventKind::mode), {2}, 1e-9);
                EXPECT_NEAR(run.x[1], -5, 1e-7);
                EXPECT_NEAR(run.x[0], 3 * speed, 1e-12);
            }
        }
    }
}

TEST(Held, AChangeOfModeSetsTheBallFree)
{
    const auto run = integrate(Ledge{}, {0, 0.1, 1, 0}, {.t_end = 3, .rtol = 1e-10});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 3, 1e-12);
    EXPECT_NEAR(run.x[1], -5, 1e-11);  // a second of free fall
    EXPECT_NEAR(run.x[3], -10, 1e-11);
}

/// Two balls on a floor; at 2 s something throws the first up at 1 m/s.
struct Two {
    using State = std::array<double, 4>;  // y0, v0, y1, v1
    static constexpr std::size_t guard_count = 3;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -10, x[3], -10}; }
    [[nodiscard]] double guard(std::size_t which, double t, const State& x) const
    {
        return which < 2 ? x[2 * which] : 2 - t;
    }
    void reset(std::size_t which, double, State& x) const
    {
        if (which == 2) x[1] += 1;
        if (which < 2) x[2 * which] = 0, x[2 * which + 1] *= -0.5;
    }
    void rest(std::size_t which, double, State& x) const { x[2 * which] = x[2 * which + 1] = 0; }
};

TEST(Held, OneBallOfTwoIsHeldAndThenStruck)
{
    // Limits at sqrt(2 h / g) (1 + e) / (1 - e): 0.6 and 3 s; the second flights of ball 0 end
    // after 2 v / g (1 + e + ...) = 0.4 s.
    const auto run = integrate(Two{}, {0.2, 0, 5, 0}, {.t_end = 4, .rtol = 1e-10});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    expect_near(times_of(run, EventKind::accumulation), {0.6, 2.4, 3}, 1e-12);
    EXPECT_EQ(run.x, (Two::State{0, 0, 0, 0}));
}

// --- what cannot be held ---

TEST(Held, WhatCannotBeHeldEndsTheRun)
{
    /// The floor moves.
    struct Moving : Pulled {
        double speed = 0.1, bend = 0;
        [[nodiscard]] double at(double t) const { return speed * t + bend * t * t / 2; }
        [[nodiscard]] double guard(double t, const State& x) const { return x[0] - at(t); }
        void reset(double t, State& x) const
        {
            const double v = speed + bend * t;
            x = {at(t), v - 0.5 * (x[1] - v)};
        }
        void rest(double t, State& x) const { x = {at(t), speed + bend * t}; }
    };
    /// A slope: `rest` projects the state onto it, and every result depends on the state.
    struct Sloped : Thrown {
        double slope = 0.1;
        [[nodiscard]] double guard(double, const State& x) const { return x[1] - slope * x[0]; }
        void reset(double, State& x) const
        {
            const double own = (x[3] - slope * x[2]) / (1 + slope * slope);
            x[1] = slope * x[0];
            x[2] += 1.5 * own * slope;
            x[3] -= 1.5 * own;
        }
        void rest(double, State& x) const
        {
            const double along = (x[2] + slope * x[3]) / (1 + slope * slope);
            x = {x[0], slope * x[0], along, slope * along};
        }
    };
    for (const double bend : {0.0, 0.1, -0.1}) {
        Moving moving;
        moving.bend = bend;
        const auto run = integrate(moving, {0.2, 0}, {.t_end = 10});
        EXPECT_EQ(run.outcome, Outcome::zeno) << bend;
        EXPECT_LT(run.t, 1) << bend;
        EXPECT_EQ(run.guard, 0U);
    }
    const auto run = integrate(Sloped{}, {0, 0.1, 1, 0}, {.t_end = 4});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_LT(run.t, 1);
}

TEST(Held, ASurfaceThatLeavesLaterEndsTheRunThere)
{
    /// The floor sinks from 5 s on.
    struct Sinking : Pulled {
        [[nodiscard]] double guard(double t, const State& x) const
        {
            return x[0] + (t > 5 ? std::pow(t - 5, 3) : 0);
        }
    };
    const auto run = integrate(Sinking{}, {0.2, 0}, {.t_end = 10, .h_max = 0.1});
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_NEAR(run.t, 5, 0.1);  // the step in which it is seen
}

// --- cost ---

/// Counts its calls.
struct Counted : Pulled {
    std::uint64_t* rests;
    std::uint64_t* flows;
    void flow(double t, const State& x, State& dxdt) const
    {
        ++*flows;
        Pulled::flow(t, x, dxdt);
    }
    void rest(double t, State& x) const
    {
        ++*rests;
        Pulled::rest(t, x);
    }
};

TEST(Held, ABallAtRestTakesNoSteps)
{
    std::uint64_t rests = 0, flows = 0;
    const auto run = integrate(Counted{{}, &rests, &flows}, {0.2, 0}, {.t_end = 1e7});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.t, 1e7);
    EXPECT_EQ(run.x, (Pulled::State{0, 0}));
    EXPECT_LT(run.statistics.steps, 300U);
    EXPECT_EQ(rests, 5U);  // the rest, two displacements of the state and two times
}

TEST(Held, WhereNothingPressesNothingIsAsked)
{
    std::uint64_t rests = 0, flows = 0;
    const Counted thrown{{.launch = 5}, &rests, &flows};
    const auto run = integrate(thrown, {0.2, 0}, {.t_end = 10});
    EXPECT_EQ(rests, times_of(run, EventKind::accumulation).size());
}

}  // namespace
}  // namespace ricochet::held_test
