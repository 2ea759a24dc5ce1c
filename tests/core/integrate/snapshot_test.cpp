// A snapshot identifies its run, and is read only where it is valid.

#include "ricochet/run.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/planned.hpp"
#include "saved_systems.hpp"

namespace ricochet::snapshot_test {
namespace {

using test::Ball;
using test::changed;
using test::Droplet;
using test::refused_by;
using test::saved_ball;
using X = Ball::State;

/// A system with another name.
struct Named : Ball {
    std::string name = "marble";
};

struct Decay {
    void flow(double, const std::vector<double>& x, std::vector<double>& dxdt) const
    {
        for (std::size_t i = 0; i < x.size(); ++i) dxdt[i] = -x[i];
    }
};

const Options options{.t_end = 4, .step = 0.01};

TEST(Snapshot, BelongsToOneKindOfRun)
{
    const Snapshot saved = saved_ball(options);
    EXPECT_EQ(refused_by(saved, Ball{}, options), "accepted");
    // The end of the run, its first step and its records may differ.
    EXPECT_EQ(refused_by(saved, Ball{}, {.t_end = 9, .step = 0.1, .record_steps = true}),
              "accepted");

    const std::string ours = "snapshot: it is of a run with ";
    EXPECT_EQ(refused_by(saved, Droplet{}, options),
              ours + "system = Ball, and this one has system = Droplet");
    EXPECT_EQ(refused_by(saved, Named{}, options),
              ours + "system = Ball, and this one has system = marble");
    EXPECT_EQ(refused_by(saved, Ball{}, options, ErrorControlled<Fehlberg78>{}),
              ours +
                  "stepping = ErrorControlled<Dopri5>, and this one has "
                  "stepping = ErrorControlled<Fehlberg78>");
    EXPECT_EQ(refused_by(saved, Ball{}, options, ErrorControlled<Dopri5>{}, Ends{}),
              ours + "detector = Extremum, and this one has detector = Ends");
    EXPECT_EQ(refused_by(saved, Ball{}, options, ErrorControlled<Dopri5>{}, Extremum{}, Toms748{}),
              ours + "locator = Newton, and this one has locator = Toms748");
    EXPECT_EQ(refused_by(saved, Ball{}, {.t_start = 1e-9, .t_end = 4}),
              ours + "t_start = 0, and this one has t_start = 1e-09");
    EXPECT_EQ(refused_by(saved, Ball{}, {.t_end = -4}),
              ours + "direction = forward, and this one has direction = backward");
    EXPECT_EQ(refused_by(saved, Ball{}, {.t_end = 4, .rtol = 1e-6}),
              ours + "rtol = 1e-08, and this one has rtol = 1e-06");
    EXPECT_EQ(refused_by(saved, Ball{}, {.t_end = 4, .event_tolerance = 1e-6}),
              ours + "event_tolerance = 0, and this one has event_tolerance = 1e-06");
    EXPECT_EQ(refused_by(saved, Ball{}, {.t_end = 4, .check_inside = false}),
              ours + "check_inside = true, and this one has check_inside = false");
    EXPECT_NE(refused_by(saved, Ball{}, {.t_end = 4, .step = 0.01}, FixedStep<Dopri5>{}),
              "accepted");
    for (const Options& other : {Options{.t_end = 4, .atol = 1e-6},
                                 {.t_end = 4, .h_max = 1},
                                 {.t_end = 4, .event_window = 1e-6},
                                 {.t_end = 4, .stop_at_event = true}}) {
        EXPECT_EQ(refused_by(saved, Ball{}, other).find(ours), 0u);
    }
    EXPECT_NE(refused_by(saved, Ball{}, {.t_end = 1e-3}).find("later than t_end"),
              std::string::npos);

    // Files of version 0.1 have another name for `check_inside`.
    Snapshot former = saved;
    for (RunProperty& property : former.run) {
        if (property.name == "check_inside") property.name = "look_inside";
    }
    EXPECT_NE(former.run, saved.run);
    EXPECT_EQ(refused_by(former, Ball{}, options), "accepted");
    EXPECT_EQ(refused_by(former, Ball{}, {.t_end = 4, .step = 0.01, .check_inside = false}),
              ours + "look_inside = true, and this one has check_inside = false");

    Snapshot nameless = saved;
    nameless.run.clear();
    EXPECT_EQ(refused_by(nameless, Ball{}, options),
              "snapshot: it does not say of which run it is");

    using V = std::vector<double>;
    const Decay decay;
    Simulation<Decay, V> two(decay, V{1, 2}, {.t_end = 1});
    Simulation<Decay, V> three(decay, V{1, 2, 3}, {.t_end = 1});
    EXPECT_EQ(refusal([&] { three.restore(two.save()); }),
              ours + "components at the start = 2, and this one has components at the start = 3");
}

TEST(Snapshot, TypesAreNamedAlikeByEveryCompiler)
{
    const auto plain = detail::plain_type_name;
    EXPECT_EQ(plain("constexpr const char* ricochet::detail::written_type() [with T = "
                    "ricochet::{anonymous}::Ball]"),
              "Ball");
    EXPECT_EQ(plain("const char *ricochet::detail::written_type() [T = ricochet::(anonymous "
                    "namespace)::Ball]"),
              "Ball");
    EXPECT_EQ(plain("f() [with T = main()::Own<a::B, c::D<e::F> >::Inner]"), "Inner");
    EXPECT_EQ(plain("f() [T = ricochet::Planned<ricochet::Extremum>]"), "Planned<Extremum>");
    EXPECT_EQ(plain("f() [T = a::Pair<b::X, c::Y<d::Z>>]"), "Pair<X, Y<Z>>");
}

TEST(Snapshot, AChangedTextIsRefused)
{
    const std::string text = to_text(saved_ball(options));
    EXPECT_EQ(snapshot_from_text(text), saved_ball(options));
    std::mt19937_64 random(5);
    for (int i = 0; i < 2000; ++i) {
        const std::string other = changed(text, random);
        if (other == text) continue;
        EXPECT_NE(refusal([&] { (void)snapshot_from_text(other); }), "accepted") << other;
    }
    EXPECT_NE(refusal([] {
                  (void)snapshot_from_text("ricochet-snapshot 1 35 12\n");
              }).find("an earlier version"),
              std::string::npos);
}

TEST(Snapshot, NumbersThatAreNoStateAreRefusedAndChangeNothing)
{
    const Ball ball;
    Simulation<Ball, X> simulation(ball, X{1, 0}, options);
    for (int i = 0; i < 9; ++i) simulation.step();
    const Snapshot good = simulation.save();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double infinity = std::numeric_limits<double>::infinity();
    // The time, its remainder, the state, its remainder, its rate, the next step, the first step,
    // and the time of the last event and the longest step after it.
    for (std::size_t i = 0; i <= 11; ++i) {
        for (const double wrong : {nan, infinity, -infinity}) {
            Snapshot bad = good;
            bad.numbers[i] = wrong;
            EXPECT_NE(refusal([&] { simulation.restore(bad); }), "accepted") << i << ' ' << wrong;
        }
    }
    for (const auto& [at, wrong] : {std::pair{0, -1e-3}, {0, 4.1}, {1, 1.0}, {8, -1.0}, {8, 0.0}}) {
        Snapshot bad = good;
        bad.numbers[static_cast<std::size_t>(at)] = wrong;
        EXPECT_NE(refusal([&] { simulation.restore(bad); }), "accepted") << at << ' ' << wrong;
    }
    // No flag, side, outcome or mode is as large; a count of events may be.
    int taken = 0;
    for (std::size_t i = 0; i < good.counts.size(); ++i) {
        Snapshot bad = good;
        bad.counts[i] = std::numeric_limits<std::uint64_t>::max() - 7;
        taken += refusal([&] { simulation.restore(bad); }) == "accepted";
        simulation.restore(good);
    }
    EXPECT_LE(taken, 2);
    EXPECT_EQ(simulation.save(), good);

    // One number or count at a time is replaced: what is not refused runs to an outcome.
    std::mt19937_64 random(9);
    Options limited = options;
    limited.max_steps = 20'000;
    for (int i = 0; i < 1000; ++i) {
        Snapshot bad = good;
        if (random() % 2 == 0) {
            const std::array hostile{nan, infinity, -infinity, 1e308, -1.0, 5e-324, 0.0, 1e9};
            bad.numbers[random() % bad.numbers.size()] = hostile[random() % hostile.size()];
        } else {
            const std::array<std::uint64_t, 5> hostile{2, 3, 255, 1u << 31, ~std::uint64_t{0}};
            bad.counts[random() % bad.counts.size()] = hostile[random() % hostile.size()];
        }
        Simulation<Ball, X> other(ball, X{1, 0}, limited);
        if (refusal([&] { other.restore(bad); }) != "accepted") continue;
        const auto run = other.take();
        EXPECT_TRUE(run.t >= 0 && run.t <= options.t_end) << i;
    }
}

TEST(Snapshot, SampleTimesAreThoseOfTheRunThatGoesOn)
{
    const Ball ball;
    Options sampled = options;
    sampled.sample_times = {0.1, 0.2, 3};
    Simulation<Ball, X> whole(ball, X{1, 0}, sampled);
    while (whole.t() < 1) whole.step();
    const Snapshot saved = whole.save();
    sampled.sample_times = {0.5, 1.5, 3};
    Simulation<Ball, X> other(ball, X{1, 0}, sampled);
    other.restore(saved);
    const auto run = other.take();
    EXPECT_EQ(run.trajectory.t, (std::vector<double>{1.5, 3}));
    EXPECT_EQ(run.trajectory.x.back(), whole.take().trajectory.x.back());
}

/// A ball between two floors whose resets contradict each other.
struct Contradiction {
    using State = X;
    static constexpr std::size_t guard_count = 3;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -1}; }
    double guard(std::size_t which, double, const X& x) const { return which == 0 ? 9 : x[0]; }
    void reset(std::size_t which, double, X& x) const { x[1] = which == 1 ? 1 : 2; }
};

/// A ball that claims to be slow.
struct Slow {
    using State = X;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -1}; }
    double guard(double, const X& x) const { return x[0]; }
    void reset(double, X& x) const { x = {0, -x[1]}; }
    double speed_bound(double, const X&) const { return 0.1; }
};

TEST(Snapshot, ARunThatHasReachedItsEndGoesOnToALaterOne)
{
    const Ball ball;
    const auto whole = integrate(ball, X{1, 0}, options, FixedStep<Rk4>{});
    using Fixed = Simulation<Ball, X, FixedStep<Rk4>>;
    Options early = options;
    for (const double end : {0.5, 2.0, 3.99}) {
        early.t_end = end;
        Fixed first(ball, X{1, 0}, early);
        while (first.step()) {
        }
        const Snapshot saved = first.save();
        Fixed same(ball, X{1, 0}, early);
        same.restore(saved);
        EXPECT_TRUE(same.ended());
        EXPECT_EQ(same.run().outcome, Outcome::reached_end);
        Fixed later(ball, X{1, 0}, options);
        later.restore(saved);
        EXPECT_FALSE(later.ended());
        const auto run = later.take();
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.t, 4);
        EXPECT_EQ(first.run().events.size() + run.events.size(), whole.events.size());
        EXPECT_NEAR(run.x[0], whole.x[0], 1e-12);
    }
}

TEST(Snapshot, ARunThatWasCancelledGoesOn)
{
    const Ball ball;
    std::atomic<bool> cancelled = false;
    Options stopped = options;
    stopped.cancelled = &cancelled;
    Simulation<Ball, X> first(ball, X{1, 0}, stopped);
    for (int i = 0; i < 9; ++i) first.step();
    cancelled = true;
    EXPECT_FALSE(first.step());
    EXPECT_EQ(first.run().outcome, Outcome::cancelled);
    const double t = first.t();
    Simulation<Ball, X> second(ball, X{1, 0}, options);
    second.restore(first.save());
    EXPECT_FALSE(second.ended());
    EXPECT_EQ(second.t(), t);
    const auto run = second.take();
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x, integrate(ball, X{1, 0}, options).x);
}

/// x'' = sin t - x, with a kick at 0.5. Fehlberg's method evaluates the flow at the start of a step
/// twice, once of them as a later stage.
struct Kicked {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    static void flow(double t, const State& x, State& dxdt) { dxdt = {x[1], std::sin(t) - x[0]}; }
    static double guard(double t, const State& x) { return x[0] - 0.1 * std::cos(3 * t); }
    static GuardInfo guard_info() { return {.crossing = Crossing::either, .resets = false}; }
    static double next_time_event(double t)
    {
        return t < 0.5 ? 0.5 : std::numeric_limits<double>::infinity();
    }
    static void time_reset(double, State& x) { x[1] += 0.3; }
};

template <class Method>
void expect_the_same_bits_from_every_step(const Method& method)
{
    const Options span{.t_end = 9, .rtol = 1e-9, .atol = 1e-11};
    const Kicked::State x0{1, 0};
    const auto whole = integrate(Kicked{}, x0, span, method);
    Simulation<Kicked, Kicked::State, Method> simulation(Kicked{}, x0, span, method);
    while (simulation.step()) {
        Simulation<Kicked, Kicked::State, Method> next(Kicked{}, x0, span, method);
        next.restore(simulation.save());
        while (next.advance()) {
        }
        EXPECT_EQ(next.x(), whole.x) << simulation.t();
    }
    EXPECT_EQ(simulation.x(), whole.x);
}

TEST(Snapshot, GivesTheSameBitsFromEveryStepAfterATimeEvent)
{
    expect_the_same_bits_from_every_step(ErrorControlled<Fehlberg78>{});
    expect_the_same_bits_from_every_step(ErrorControlled<Dopri5>{});
    expect_the_same_bits_from_every_step(ErrorControlled<CashKarp54>{});
}

TEST(Snapshot, WhatEndedARunIsKept)
{
    const Contradiction contradiction;
    Simulation<Contradiction, X> first(contradiction, X{1, 0}, options);
    while (first.step()) {
    }
    ASSERT_EQ(first.run().outcome, Outcome::conflicting_resets);
    Simulation<Contradiction, X> second(contradiction, X{1, 0}, options);
    second.restore(first.save());
    EXPECT_TRUE(second.ended());
    EXPECT_EQ(second.run().outcome, Outcome::conflicting_resets);
    EXPECT_EQ(second.run().guard, 1U);
    EXPECT_EQ(second.run().other_guard, 2U);
    // The guards that contradict each other are the only counts of 1 and 2 in turn.
    Snapshot bad = first.save();
    const std::array<std::uint64_t, 2> guards{1, 2};
    const auto at = std::search(bad.counts.begin(), bad.counts.end(), guards.begin(), guards.end());
    ASSERT_NE(at, bad.counts.end());
    *at = 3;
    EXPECT_NE(refusal([&] { second.restore(bad); }).find("the guard that ended"),
              std::string::npos);

    const Slow slow;
    using Planning = Simulation<Slow, X, FixedStep<Rk4>, Planned<>>;
    Planning third(slow, X{1, 0}, options);
    while (third.step()) {
    }
    ASSERT_EQ(third.run().outcome, Outcome::wrong_bound);
    Planning fourth(slow, X{1, 0}, options);
    fourth.restore(third.save());
    ASSERT_TRUE(fourth.run().wrong_bound);
    EXPECT_EQ(fourth.run().guard, 0U);
    EXPECT_EQ(fourth.run().wrong_bound->t, third.run().wrong_bound->t);
    EXPECT_EQ(fourth.run().wrong_bound->x, third.run().wrong_bound->x);
    EXPECT_EQ(fourth.run().wrong_bound->allowed, third.run().wrong_bound->allowed);
    const Snapshot again = fourth.save();
    EXPECT_EQ(again.counts, third.save().counts);
}

}  // namespace
}  // namespace ricochet::snapshot_test
