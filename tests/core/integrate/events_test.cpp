// The semantics of events: many guards, modes, order, progress, and events that other
// libraries miss.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "problems/near_tangent.hpp"
#include "recorded_oscillators.hpp"
#include "refusal.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::events_test {
namespace {

using X1 = std::array<double, 1>;
using X = std::array<double, 2>;
constexpr double pi = std::numbers::pi;

template <class State>
std::vector<double> times(const ricochet::Run<State>& run)
{
    std::vector<double> out;
    for (const auto& event : run.events) out.push_back(event.t);
    return out;
}

template <class State>
std::vector<std::size_t> guards(const ricochet::Run<State>& run)
{
    std::vector<std::size_t> out;
    for (const auto& event : run.events) out.push_back(event.guard);
    return out;
}

template <class State>
bool same_bits(const ricochet::Run<State>& a, const ricochet::Run<State>& b)
{
    if (a.events.size() != b.events.size() || a.t != b.t || a.x != b.x) return false;
    for (std::size_t i = 0; i < a.events.size(); ++i) {
        if (a.events[i].t != b.events[i].t || a.events[i].after != b.events[i].after) return false;
    }
    return true;
}

// --- evaluations inside the step ---

/// y' = 3 t^2 + 12 t - 4, y(-8) = -120: y = (t + 6) (t + 2) (t - 2). A cubic that
/// other integrators step across (scipy issue 9228).
struct HiddenPair {
    using State = X1;
    static constexpr bool resets = false;
    Crossing crossing = Crossing::either;
    void flow(double t, const X1&, X1& dxdt) const { dxdt = {3 * t * t + 12 * t - 4}; }
    [[nodiscard]] double guard(double, const X1& x) const { return x[0]; }
};

TEST(Events, AHiddenPairIsFoundInOneGiantStep)
{
    // Both methods integrate a cubic exactly; its values reach 120, whose rounding over
    // the slopes 32 and 16 at the roots is below 1e-15, and rk4 adds a few of these.
    for (const double h : {12.0, 5.0, 1.0, 0.3}) {
        const Options options{.t_start = -8, .t_end = 4, .step = h};
        const auto run = integrate(HiddenPair{}, X1{-120}, options, FixedStep<Rk4>{});
        ASSERT_EQ(run.events.size(), 3u) << h;
        EXPECT_NEAR(run.events[0].t, -6, 1e-14);
        EXPECT_NEAR(run.events[1].t, -2, 1e-14);
        EXPECT_NEAR(run.events[2].t, 2, 1e-14);
    }
    for (const double rtol : {1e-3, 1e-6, 1e-9}) {
        const auto run =
            integrate(HiddenPair{}, X1{-120}, {.t_start = -8, .t_end = 4, .rtol = rtol});
        ASSERT_EQ(run.events.size(), 3u) << rtol;
    }
}

/// y = cos(t + p); guard y - (1 - depth).
struct NearTangent {
    using State = X;
    static constexpr bool resets = false;
    double depth;
    Crossing crossing = Crossing::either;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -x[0]}; }
    template <class V>
    [[nodiscard]] double guard(double, const V& x) const
    {
        return x[0] - (1 - depth);
    }
    template <class V, class D>
    [[nodiscard]] double guard_rate(double, const V&, const D& dxdt) const
    {
        return dxdt[0];
    }
};

struct Found {
    int events = 0;
    int expected = 0;
    int touches = 0;
    double error = 0;  ///< of the guard at the time found
};

Found find_near_tangent(double depth, double phase)
{
    const auto run =
        integrate(NearTangent{depth}, X{std::cos(phase), -std::sin(phase)},
                  {.t_end = 20, .rtol = 1e-14, .atol = 1e-15}, ErrorControlled<Fehlberg78>{});
    Found found;
    const double half_width = depth > 0 ? std::acos(1 - depth) : 0;
    for (int n = 0; n <= 4; ++n) {
        for (const double t : {2 * pi * n - phase - half_width, 2 * pi * n - phase + half_width}) {
            found.expected += t > 0 && t < 20;
        }
    }
    for (const auto& event : run.events) {
        (event.kind == EventKind::touch ? found.touches : found.events) += 1;
        const double g = std::cos(event.t + phase) - (1 - depth);
        found.error = std::max(found.error, std::fabs(g));
    }
    return found;
}

TEST(Events, NearTangentPairsAreFoundDownToTwiceTheTouchBand)
{
    // The touch tolerance is 64 units in the last place of the guard's size, 2: 2.8e-14.
    // The stepper's own error in the crest is a few 1e-15 after 20 radians.
    std::mt19937 engine(1);
    std::uniform_real_distribution<double> phases(0.5, 5.5);
    for (const double depth : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13}) {
        for (int i = 0; i < 100; ++i) {
            const double phase = phases(engine);
            const Found found = find_near_tangent(depth, phase);
            ASSERT_EQ(found.events, found.expected) << "depth " << depth << ", phase " << phase;
            ASSERT_EQ(found.touches, 0);
            EXPECT_LE(found.error, 2e-14);
        }
    }
}

TEST(Events, ExactTouchesAreTouchesAndNearMissesNothing)
{
    std::mt19937 engine(2);
    std::uniform_real_distribution<double> phases(0.5, 5.5);
    for (int i = 0; i < 200; ++i) {
        const double phase = phases(engine);
        const Found touch = find_near_tangent(0, phase);
        EXPECT_EQ(touch.events, 0) << phase;
        EXPECT_EQ(touch.touches, touch.expected / 2) << phase;  // the roots are double
        for (const double miss : {1e-6, 1e-12}) {
            const Found found = find_near_tangent(-miss, phase);
            EXPECT_EQ(found.events + found.touches, 0) << phase;
        }
    }
}

TEST(Events, ATouchIsReportedOnceWhereverTheStepsFall)
{
    // g = (t - 1/2)^2 is zero with zero rate at 1/2, which lies inside a step, at the
    // end of one, and a rounding away from it.
    struct Squared {
        static constexpr bool resets() { return false; }
        Crossing crossing = Crossing::either;
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] double guard(double, const X1& x) const
        {
            return (x[0] - 0.5) * (x[0] - 0.5);
        }
        [[nodiscard]] double guard_rate(double, const X1& x, const X1& dxdt) const
        {
            return 2 * (x[0] - 0.5) * dxdt[0];
        }
    };
    for (const double h : {0.5, 0.25, 0.125, 0.1, 0.3, 1.0, 0.5 + 1e-9, 0.5 - 1e-9, 0.5 + 1e-15,
                           0.25 - 1e-16, 0.05}) {
        const auto run = integrate(Squared{}, X1{0}, {.t_end = 1, .step = h}, FixedStep<Rk4>{});
        ASSERT_EQ(run.events.size(), 1u) << h;
        EXPECT_EQ(run.events[0].kind, EventKind::touch);
        // |g| <= 64 eps within sqrt(64 eps / 4) of the touch
        EXPECT_NEAR(run.events[0].t, 0.5, 1e-7) << h;
    }
}

TEST(Events, ADeclaredBandTurnsDipsOfLessThanItIntoTouches)
{
    // Crests of cos(t + 1) that exceed the level by less than the tolerance, or fall short
    // of it by less, are one touch each, wherever the steps fall; higher ones are crossed.
    const auto kinds = [](double depth, double touch, double h_max) {
        const ricochet::NearTangent system({.depth = depth, .phase = 1, .touch = touch});
        const Options options{.t_end = 20, .rtol = 1e-9, .atol = 1e-9, .h_max = h_max};
        const auto run = integrate(system, system.start(), options);
        std::string found;
        for (const auto& event : run.events) {
            const bool is_touch = event.kind == EventKind::touch;
            // The search for the crest ends where the value no longer changes by touch / 64.
            const double turn = 2 * pi * std::round((event.t + 1) / (2 * pi)) - 1;
            const double late = is_touch ? event.t - turn : 0;
            EXPECT_LE(std::fabs(late), std::sqrt(touch / 32)) << depth << ' ' << touch;
            found += is_touch ? 'T' : 'C';
        }
        return found;
    };
    for (const double h_max : {0.03, 0.3, 10.0}) {
        for (const double depth : {1e-2, 1e-4, 0.0, -1e-4, -1e-2}) {
            for (const double touch : {0.05, 0.012}) {
                EXPECT_EQ(kinds(depth, touch, h_max), "TTT") << depth << ' ' << touch;
            }
        }
        EXPECT_EQ(kinds(1e-2, 1e-3, h_max), "CCCCCC");
        EXPECT_EQ(kinds(-1e-2, 1e-3, h_max), "");
    }
}

TEST(Events, ATripleRootIsOneCrossing)
{
    struct Cubed {
        static constexpr bool resets() { return false; }
        Crossing crossing = Crossing::either;
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] double guard(double, const X1& x) const
        {
            return (x[0] - 0.5) * (x[0] - 0.5) * (x[0] - 0.5);
        }
    };
    for (const double h : {0.5, 0.1, 0.3, 1.0}) {
        const auto run = integrate(Cubed{}, X1{0}, {.t_end = 1, .step = h}, FixedStep<Rk4>{});
        ASSERT_EQ(run.events.size(), 1u) << h;
        EXPECT_EQ(run.events[0].kind, EventKind::crossing);
        EXPECT_NEAR(run.events[0].t, 0.5, 1e-5);
    }
}

// --- order ---

/// x' = 1; guards at given places, in any order.
struct Milestones {
    using State = X1;
    std::vector<double> places;
    Crossing crossing = Crossing::either;
    bool resetting = false;
    [[nodiscard]] std::size_t guard_count() const { return places.size(); }
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    template <class V>
    [[nodiscard]] double guard(std::size_t which, double, const V& x) const
    {
        return x[0] - places[which];
    }
    void reset(std::size_t, double, X1&) const {}
    [[nodiscard]] GuardInfo guard_info(std::size_t) const
    {
        return {.crossing = crossing, .resets = resetting};
    }
};

TEST(Events, ClusteredEventsComeInTheirOrder)
{
    for (const bool resetting : {false, true}) {
        Milestones line{.places = {0, 1e-8, 2e-8, 2e-7}, .resetting = resetting};
        do {
            const Options forward{.t_start = -1, .t_end = 1, .step = 2};
            const auto there = integrate(line, X1{-1}, forward, FixedStep<Rk4>{});
            ASSERT_EQ(there.events.size(), 4u);
            const Options backward{.t_start = 1, .t_end = -1, .step = 2};
            const auto back = integrate(line, X1{1}, backward, FixedStep<Rk4>{});
            ASSERT_EQ(back.events.size(), 4u);
            const std::array<double, 4> sorted{0, 1e-8, 2e-8, 2e-7};
            for (std::size_t i = 0; i < 4; ++i) {
                EXPECT_NEAR(there.events[i].t, sorted[i], 1e-15);
                EXPECT_EQ(line.places[there.events[i].guard], sorted[i]);
                EXPECT_NEAR(back.events[i].t, sorted[3 - i], 1e-15);
            }
        } while (std::next_permutation(line.places.begin(), line.places.end()));
    }
}

/// u1 = cos 3t, u2 = cos t; the two resets are counted in a third and fourth component.
struct Synchronous {
    using State = std::array<double, 6>;
    static constexpr std::size_t guard_count = 2;
    bool swapped = false;
    bool resetting = false;
    void flow(double, const State& x, State& dxdt) const
    {
        dxdt = {x[1], -9 * x[0], x[3], -x[2], 0, 0};
    }
    template <class V>
    [[nodiscard]] double guard(std::size_t which, double, const V& x) const
    {
        return x[(which == 0) != swapped ? 0 : 2];
    }
    void reset(std::size_t which, double, State& x) const
    {
        x[(which == 0) != swapped ? 4 : 5] += 1;
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const
    {
        return {.crossing = Crossing::either, .resets = resetting};
    }
};

TEST(Events, SynchronousEventsDoNotDependOnTheOrderOfTheGuards)
{
    // cos 3t vanishes at the odd multiples of pi/6, cos t at two of them.
    for (const bool resetting : {false, true}) {
        const Options options{
            .t_end = 2 * pi, .rtol = 1e-12, .atol = 1e-14, .event_tolerance = 1e-9};
        const Synchronous::State x0{1, 0, 1, 0, 0, 0};
        const auto a = integrate(Synchronous{false, resetting}, x0, options);
        const auto b = integrate(Synchronous{true, resetting}, x0, options);
        ASSERT_EQ(a.events.size(), 8u);
        EXPECT_EQ(times(a), times(b));
        EXPECT_EQ(a.x, b.x);
        EXPECT_EQ(a.x[4], resetting ? 6 : 0);
        EXPECT_EQ(a.x[5], resetting ? 2 : 0);
        for (const auto& event : a.events) {
            const double sixths = event.t / (pi / 6);
            EXPECT_NEAR(sixths, std::round(sixths), 1e-9);
            EXPECT_EQ(std::lround(sixths) % 2, 1);
        }
        if (resetting) {
            EXPECT_EQ(a.events[1].t, a.events[2].t);  // one set at pi/2
            EXPECT_EQ(a.events[1].before, a.events[2].before);
        }
    }
}

/// N balls in one state.
struct Balls {
    using State = std::vector<double>;
    std::size_t guard_count = 2;
    double restitution = 0.9;
    void flow(double, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < guard_count; ++i) {
            dxdt[2 * i] = x[2 * i + 1];
            dxdt[2 * i + 1] = x[2 * i] == 0 && x[2 * i + 1] == 0 ? 0 : -9.81;
        }
    }
    template <class V>
    [[nodiscard]] double guard(std::size_t which, double, const V& x) const
    {
        return x[2 * which];
    }
    template <class V, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double, const V&, const D& dxdt) const
    {
        return dxdt[2 * which];
    }
    void reset(std::size_t which, double, State& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] *= -restitution;
    }
    void rest(std::size_t which, double, State& x) const { x[2 * which] = x[2 * which + 1] = 0; }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.unilateral = true}; }
};

/// Guard i is that of ball order[i].
struct ReorderedBalls : Balls {
    std::vector<std::size_t> order;

    template <class V>
    [[nodiscard]] double guard(std::size_t which, double t, const V& x) const
    {
        return Balls::guard(order[which], t, x);
    }
    template <class V, class D>
    [[nodiscard]] double guard_rate(std::size_t which, double t, const V& x, const D& dxdt) const
    {
        return Balls::guard_rate(order[which], t, x, dxdt);
    }
    void reset(std::size_t which, double t, State& x) const { Balls::reset(order[which], t, x); }
    void rest(std::size_t which, double t, State& x) const { Balls::rest(order[which], t, x); }
};

TEST(Events, TheOrderOfTheGuardsOfBallsChangesNoBit)
{
    // From six heights, so that many of them bounce together.
    constexpr std::size_t n = 24;
    std::mt19937 engine(7);
    Balls::State x0(2 * n, 0.0);
    for (std::size_t i = 0; i < n; ++i) x0[2 * i] = 1 + 0.25 * static_cast<double>(engine() % 6);
    ReorderedBalls balls{{.guard_count = n}, {}};
    for (std::size_t i = 0; i < n; ++i) balls.order.push_back(i);
    const auto rows = [&] {
        const auto run = integrate(balls, x0, {.t_end = 4});
        std::vector<std::tuple<double, std::size_t, Balls::State>> out;
        for (const auto& event : run.events) {
            out.emplace_back(event.t, balls.order[event.guard], event.after);
        }
        std::sort(out.begin(), out.end());
        out.emplace_back(run.t, n, run.x);
        return out;
    };
    const auto expected = rows();
    EXPECT_GT(expected.size(), 3 * n);
    for (int k = 0; k < 50; ++k) {
        std::shuffle(balls.order.begin(), balls.order.end(), engine);
        ASSERT_EQ(rows(), expected) << k;
    }
}

TEST(Events, AnImpactOfOneOfManyBallsTakesFewCallsOfTheFlow)
{
    // A search, a restart and a new first step: the number of balls does not matter.
    for (const std::size_t n : {1U, 10U, 100U}) {
        Balls::State x0(2 * n, 0.0);
        for (std::size_t i = 0; i < n; ++i) {
            x0[2 * i] = 5 + 5 * std::fmod(0.618033988 * static_cast<double>(i), 1.0);
        }
        const auto run = integrate(Balls{.guard_count = n}, x0,
                                   {.t_end = 5, .atol = 1e-10, .record_events = false});
        EXPECT_GE(run.statistics.events, 2 * n);
        EXPECT_LE(run.statistics.flow_calls, 60 * run.statistics.events) << n;
    }
}

TEST(Events, ManyOscillatorsHaveAllTheirRecordedPassages)
{
    // A step adds an error of up to 1e-8, met at rates of order one: most steps add a tenth.
    for (const std::size_t n : {1U, 10U, 100U}) {
        const test::Oscillators system(n);
        const double t_end = 100;
        const auto run =
            integrate(system, system.start(),
                      {.t_end = t_end, .rtol = 1e-8, .atol = 1e-8, .event_states = n < 10});
        std::vector<std::size_t> seen(n, 0);
        const double bound = 1e-8 * static_cast<double>(run.statistics.steps);
        for (const auto& event : run.events) {
            ASSERT_NEAR(event.t, system.passage(event.guard, seen[event.guard]++), bound);
        }
        for (std::size_t i = 0; i < n; ++i) {
            EXPECT_LE(system.passage(i, seen[i] - 1), t_end + bound);
            EXPECT_GT(system.passage(i, seen[i]), t_end - bound) << i << " of " << n;
        }
    }
}

TEST(Events, OfIdenticalBallsNoneIsLost)
{
    for (const std::size_t n : {std::size_t{2}, std::size_t{1000}}) {
        const Balls balls{.guard_count = n};
        Balls::State x0(2 * n, 0.0);
        for (std::size_t i = 0; i < n; ++i) x0[2 * i] = 10;
        const BouncingBall one;
        const auto run = integrate(balls, x0, {.t_end = n == 2 ? 20.5 : 7});
        const std::size_t impacts = n == 2 ? 13 : 3;
        ASSERT_EQ(run.events.size(), impacts * n);
        for (std::size_t k = 0; k < run.events.size(); ++k) {
            EXPECT_EQ(run.events[k].guard, k % n);
            EXPECT_NEAR(run.events[k].t, one.impact_time(static_cast<int>(k / n), 10), 2e-13);
        }
        for (std::size_t i = 0; i < n; ++i) ASSERT_EQ(run.x[2 * i], run.x[0]);
    }
}

TEST(Events, BallsComeToRestOneByOne)
{
    const Balls balls{.guard_count = 3, .restitution = 0.5};
    const auto run = integrate(balls, {1.0, 0.0, 2.0, 0.0, 3.0, 0.0}, {.t_end = 10});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x, Balls::State(6, 0.0));
    int rests = 0;
    for (const auto& event : run.events) {
        if (event.kind != EventKind::accumulation) continue;
        ++rests;
        const BouncingBall one({.gravity = 9.81, .restitution = 0.5});
        EXPECT_NEAR(event.t, one.zeno_time(1.0 + static_cast<double>(event.guard)), 1e-12);
    }
    EXPECT_EQ(rests, 3);
}

// --- progress ---

TEST(Events, ABallOfAnyRestitutionNeverFallsThroughTheFloor)
{
    for (const double restitution : {0.0, 0.1, 0.5, 0.9, 0.99, 1.0}) {
        const BouncingBall ball({.gravity = 9.81, .restitution = restitution});
        const double t_end = restitution < 1 ? 1e7 : 1e6;
        Simulation<BouncingBall, X> simulation(ball, {1.0, 0.0},
                                               {.t_end = t_end, .record_events = false});
        double lowest = 1;
        double energy = 0;
        for (bool going = true; going;) {
            going = simulation.step();
            const X& x = simulation.x();
            lowest = std::min(lowest, x[0]);
            energy = std::max(energy, 9.81 * x[0] + x[1] * x[1] / 2);
        }
        const auto run = simulation.finish();
        EXPECT_EQ(run.outcome, Outcome::reached_end) << restitution;
        EXPECT_EQ(run.t, t_end) << restitution;
        EXPECT_GE(lowest, 0) << restitution;
        // Four units in the last place for every bounce.
        const double growth =
            4 * std::numeric_limits<double>::epsilon() * static_cast<double>(run.statistics.events);
        EXPECT_LE(energy, 9.81 * (1 + growth)) << restitution;
        if (restitution < 1) {
            EXPECT_EQ(run.x, (X{0, 0})) << restitution;
        }
    }
}

TEST(Events, AnElasticBallKeepsItsEnergy)
{
    // In steps of at most a fifth of a flight the energy keeps its last bit; 4 units in
    // the last place per bounce and 1e-10 in all are required.
    const BouncingBall ball({.gravity = 9.81, .restitution = 1});
    const Options options{.t_end = 1e6, .h_max = 0.2, .record_events = false};
    Simulation<BouncingBall, X> simulation(ball, {1.0, 0.0}, options);
    double last = 9.81;
    double worst_bounce = 0;
    double worst = 0;
    while (simulation.advance()) {
        const double energy = simulation.x()[1] * simulation.x()[1] / 2;
        worst_bounce = std::max(worst_bounce, energy - last);
        worst = std::max(worst, std::fabs(energy - 9.81));
        last = energy;
    }
    EXPECT_LE(worst_bounce, 4 * 9.81 * std::numeric_limits<double>::epsilon());
    EXPECT_LE(worst, 1e-10 * 9.81);
    EXPECT_GT(simulation.run().statistics.events, 1'100'000u);
}

TEST(Events, AResetBackOntoTheSurfaceDoesNotRepeat)
{
    // The reset moves back by 1e-14, inside the window of the event.
    struct StepBack {
        Crossing crossing = Crossing::either;
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] double guard(double, const X1& x) const { return x[0] - 0.5; }
        void reset(double, X1& x) const { x[0] -= 1e-14; }
    };
    const auto run =
        integrate(StepBack{}, X1{0}, {.t_end = 1, .event_tolerance = 1e-12, .max_steps = 1000});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.statistics.suppressed, 1u);
    EXPECT_NEAR(run.x[0], 1 - 1e-14, 1e-15);
}

TEST(Events, ANoOpEventLeavesTheTrajectoryAlone)
{
    struct Swing {
        bool resetting = false;
        double offset = 0;
        Crossing crossing = Crossing::either;
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -std::sin(x[0])}; }
        [[nodiscard]] double guard(double, const X& x) const { return 1e6 * (x[0] - offset); }
        void reset(double, X&) const {}
    };
    struct Free {
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -std::sin(x[0])}; }
    };
    const Options options{.t_end = 100};
    const auto free = integrate(Free{}, X{1, 0}, options);
    const auto crossed = integrate(Swing{}, X{1, 0}, options);
    const auto far = integrate(Swing{.offset = 10}, X{1, 0}, options);
    EXPECT_GT(crossed.events.size(), 25u);
    EXPECT_EQ(far.events.size(), 0u);
    EXPECT_EQ(free.x, crossed.x);
    EXPECT_EQ(free.x, far.x);
    EXPECT_EQ(free.statistics.steps, crossed.statistics.steps);
}

TEST(Events, APlateauWaits)
{
    // g = max(0, 1 - t) - max(0, t - 2): down to zero at 1, away below at 2.
    struct Plateau {
        static constexpr bool resets() { return false; }
        Crossing crossing = Crossing::either;
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] double guard(double, const X1& x) const
        {
            return std::max(0.0, 1 - x[0]) - std::max(0.0, x[0] - 2);
        }
    };
    for (const double h : {0.1, 0.25, 0.3, 0.7}) {
        for (const bool ends : {false, true}) {
            const Options options{.t_end = 3, .step = h, .max_steps = 1000};
            const auto run =
                ends ? integrate(Plateau{}, X1{0}, options, FixedStep<Rk4>{}, Ends{})
                     : integrate(Plateau{}, X1{0}, options, FixedStep<Rk4>{}, Extremum{});
            ASSERT_EQ(run.outcome, Outcome::reached_end);
            ASSERT_EQ(run.events.size(), 1u) << h << ends;
            EXPECT_NEAR(run.events[0].t, 1, 1e-12) << h;
        }
    }
}

TEST(Events, AStepThatEndsNextToTheSurfaceMissesNothing)
{
    // x = t and surfaces at every double near the end of a step.
    for (int ulps = -3; ulps <= 3; ++ulps) {
        double place = 0.3;
        for (int i = 0; i < std::abs(ulps); ++i) place = std::nextafter(place, ulps < 0 ? 0 : 1);
        for (const bool resetting : {false, true}) {
            const Milestones line{.places = {place}, .resetting = resetting};
            for (const double h : {0.1, 0.3, 0.15, 0.05}) {
                const auto run = integrate(line, X1{0}, {.t_end = 1, .step = h}, FixedStep<Rk4>{});
                ASSERT_EQ(run.events.size(), 1u) << ulps << " " << h;
                EXPECT_NEAR(run.events[0].t, 0.3, 3e-16);
            }
        }
    }
}

TEST(Events, AGuardOfAnyKindOfStartIsArmedByItsMotion)
{
    // x = t from the surface upward: it rises off it, so only a later return would count.
    const Milestones line{.places = {0.0}, .resetting = true};
    EXPECT_EQ(integrate(line, X1{0}, {.t_end = 1}).events.size(), 0u);
}

// --- modes ---

struct Thermostat {
    using State = X1;
    static constexpr std::size_t guard_count = 2;
    static constexpr Mode mode_count = 2;
    enum : Mode { off, on };
    bool swapped = false;
    void flow(Mode mode, double, const X1& x, X1& dxdt) const
    {
        dxdt = {mode == off ? -0.1 * x[0] : -0.1 * (x[0] - 30)};
    }
    [[nodiscard]] bool is_lower(std::size_t which) const { return (which == 0) != swapped; }
    template <class V>
    [[nodiscard]] double guard(std::size_t which, double, const V& x) const
    {
        return is_lower(which) ? x[0] - 18 : 22 - x[0];
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        return is_lower(which) == (mode == off);
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode, double, X1&) const
    {
        return is_lower(which) ? on : off;
    }
};

TEST(Events, AThermostatSwitchesInTime)
{
    const std::array<double, 6> exact{1.05360515657826301, 5.10825623765990683,
                                      7.11496319228141844, 11.1696142733630623,
                                      13.1763212279845739, 17.2309723090662177};
    const Options options{.t_end = 18, .rtol = 1e-13, .atol = 1e-14};
    const auto run = integrate(Thermostat{}, X1{20}, options, ErrorControlled<Fehlberg78>{});
    ASSERT_EQ(run.events.size(), 6u);
    for (std::size_t i = 0; i < 6; ++i) {
        EXPECT_NEAR(run.events[i].t, exact[i], 1e-12 * exact[i]);
        EXPECT_EQ(run.events[i].guard, i % 2);
        EXPECT_EQ(run.events[i].mode_before, i % 2);
        EXPECT_EQ(run.events[i].mode_after, 1 - i % 2);
    }
    const auto swapped =
        integrate(Thermostat{true}, X1{20}, options, ErrorControlled<Fehlberg78>{});
    EXPECT_TRUE(same_bits(run, swapped));
}

TEST(Events, AModeThatDoesNotExistEndsTheRun)
{
    struct Lost : Thermostat {
        [[nodiscard]] Mode reset(std::size_t, Mode, double, X1&) const { return 7; }
    };
    const auto run = integrate(Lost{}, X1{20}, {.t_end = 18});
    EXPECT_EQ(run.outcome, Outcome::unknown_mode);
    EXPECT_EQ(run.guard, 0u);
    EXPECT_NEAR(run.t, 1.0536, 1e-4);
    EXPECT_THROW((void)integrate(Thermostat{}, X1{20}, {.t_end = 18, .mode = 2}),
                 std::invalid_argument);
}

TEST(Events, ASystemWithoutModesIsInModeZero)
{
    const BouncingBall ball;
    EXPECT_EQ(refusal([&] {
                  (void)integrate(ball, BouncingBall::State{1, 0}, {.t_end = 1, .mode = 3});
              }),
              "integrate: mode must be 0, the only one of the system, got 3");
}

/// A rod that breaks in two: the state (x, v) becomes (x1, v1, x2, v2).
struct Breaking {
    using State = std::vector<double>;
    static constexpr std::size_t guard_count = 1;
    static constexpr Mode mode_count = 2;
    void flow(Mode mode, double, const State& x, State& dxdt) const
    {
        for (std::size_t i = 0; i < (mode == 0 ? 1u : 2u); ++i) {
            dxdt[2 * i] = x[2 * i + 1];
            dxdt[2 * i + 1] = 0;
        }
    }
    template <class V>
    [[nodiscard]] double guard(std::size_t, double, const V& x) const
    {
        return 1 - x[0];
    }
    [[nodiscard]] bool enabled(std::size_t, Mode mode) const { return mode == 0; }
    [[nodiscard]] Mode reset(std::size_t, Mode, double, State& x) const
    {
        x = {x[0], x[1] / 2, x[0], x[1] * 2};
        return 1;
    }
};

TEST(Events, AResetMayChangeTheDimension)
{
    const auto run = integrate(Breaking{}, Breaking::State{0.0, 1.0},
                               {.t_end = 3, .record_steps = true, .sample_times = {0.5, 2}});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.x.size(), 4u);
    EXPECT_NEAR(run.x[0], 2, 1e-14);
    EXPECT_NEAR(run.x[2], 5, 1e-14);
    EXPECT_EQ(run.mode, 1u);
    EXPECT_EQ(run.trajectory.x[0].size(), 2u);
    EXPECT_EQ(run.trajectory.x[1].size(), 4u);
    EXPECT_EQ(run.solution.before(run.events[0].t).size(), 2u);
    EXPECT_EQ(run.solution(run.events[0].t).size(), 4u);
}

// --- predicates, boolean guards, counts, time events ---

TEST(Events, AGuardCountsOnlyWhereItIsEnabled)
{
    // One turn on the unit circle: the axis y = 0 is crossed at pi and 2 pi, and only
    // the half axis x > 0 counts.
    struct HalfAxis {
        std::size_t guard_count = 1;
        bool resetting = false;
        void flow(double, const X& x, X& dxdt) const { dxdt = {-x[1], x[0]}; }
        [[nodiscard]] double guard(std::size_t, double, const X& x) const { return x[1]; }
        [[nodiscard]] bool enabled(std::size_t, double, const X& x) const { return x[0] > 0; }
        void reset(std::size_t, double, X& x) const { x[0] *= 2; }
        [[nodiscard]] GuardInfo guard_info(std::size_t) const
        {
            return {.crossing = Crossing::either, .resets = resetting};
        }
    };
    for (const bool resetting : {false, true}) {
        const auto run = integrate(HalfAxis{.resetting = resetting}, X{0, 1}, {.t_end = 7});
        ASSERT_EQ(run.events.size(), 1u);
        EXPECT_NEAR(run.events[0].t, 1.5 * pi, 1e-7);
        EXPECT_EQ(run.statistics.disabled, 1u);
    }
}

TEST(Events, ABooleanGuardIsBisected)
{
    struct Inside {
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] bool guard(double, const X1& x) const { return x[0] * x[0] < 2; }
        void reset(double, X1& x) const { x[0] = 0; }
    };
    const auto run = integrate(Inside{}, X1{0}, {.t_end = 3});
    ASSERT_EQ(run.events.size(), 2u);
    EXPECT_NEAR(run.events[0].t, std::sqrt(2.0), 5e-16);
    EXPECT_NEAR(run.events[1].t, 2 * std::sqrt(2.0), 1e-15);
}

TEST(Events, AGuardOfIntegersIsANumber)
{
    struct Inside {
        static constexpr bool resets() { return false; }
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] int guard(double, const X1& x) const { return x[0] * x[0] < 2 ? 1 : -1; }
    };
    const auto run = integrate(Inside{}, X1{0}, {.t_end = 3});
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, std::sqrt(2.0), 5e-16);
    EXPECT_EQ(run.events[0].kind, EventKind::jump);
}

TEST(Events, BooleanGuardsAreKnownInEveryForm)
{
    // From 0 at unit speed to the square root of 2, again and again; a crossing, not a jump.
    struct Inside {
        static void flow(double, const X1&, X1& dxdt) { dxdt = {1}; }
    };
    struct Counted : Inside {
        std::size_t guard_count = 1;
        [[nodiscard]] static bool guard(std::size_t, double, const X1& x)
        {
            return x[0] * x[0] < 2;
        }
        static void reset(std::size_t, double, X1& x) { x[0] = 0; }
        [[nodiscard]] static GuardInfo guard_info(std::size_t) { return {.name = "edge"}; }
    };
    struct Switching : Inside {
        std::size_t mode_count = 2;
        [[nodiscard]] static bool guard(Mode, double, const X1& x) { return x[0] * x[0] < 2; }
        static Mode reset(Mode mode, double, X1& x)
        {
            x[0] = 0;
            return 1 - mode;
        }
    };
    const auto check = [](const auto& system) {
        const auto run = integrate(system, X1{0}, {.t_end = 3});
        ASSERT_EQ(run.events.size(), 2u);
        EXPECT_EQ(run.events[0].kind, EventKind::crossing);
        EXPECT_NEAR(run.events[0].t, std::sqrt(2.0), 5e-16);
        EXPECT_NEAR(run.events[1].t, 2 * std::sqrt(2.0), 1e-15);
    };
    check(Counted{});
    check(Switching{});
}

TEST(Events, AGuardMayStopTheRunAfterSoManyEvents)
{
    struct Third : HiddenPair {
        std::size_t guard_count = 1;
        [[nodiscard]] double guard(std::size_t, double, const X1& x) const { return x[0]; }
        [[nodiscard]] GuardInfo guard_info(std::size_t) const
        {
            return {.crossing = Crossing::either, .stop_after = 3};
        }
    };
    const auto run = integrate(Third{}, X1{-120}, {.t_start = -8, .t_end = 4});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(run.guard, 0u);
    EXPECT_EQ(run.events.size(), 3u);
    EXPECT_NEAR(run.t, 2, 1e-12);
}

/// y'' = 0.2 y' - (pi^2 + 0.01) y +- 1 by parity of floor(t).
struct Kicked {
    using State = X;
    static constexpr Mode mode_count = 2;
    void flow(Mode mode, double, const X& x, X& dxdt) const
    {
        dxdt = {x[1], 0.2 * x[1] - (pi * pi + 0.01) * x[0] + (mode == 0 ? 1 : -1)};
    }
    [[nodiscard]] double next_time_event(double t) const { return std::floor(t) + 1; }
    [[nodiscard]] double previous_time_event(double t) const { return std::ceil(t) - 1; }
    [[nodiscard]] Mode time_reset(Mode mode, double, X&) const { return 1 - mode; }
};

TEST(Events, TimeEventsAreMetExactly)
{
    const auto run = integrate(Kicked{}, X{0, 0}, {.t_end = 20, .rtol = 1e-13, .atol = 1e-15},
                               ErrorControlled<Fehlberg78>{});
    EXPECT_NEAR(run.x[0], -12.944606212134734, 1e-11);
    ASSERT_EQ(run.events.size(), 20u);
    for (std::size_t i = 0; i < 20; ++i) {
        EXPECT_EQ(run.events[i].t, static_cast<double>(i + 1));
        EXPECT_EQ(run.events[i].kind, EventKind::time);
    }
    // ... and back to where it came from
    const auto back = integrate(
        Kicked{}, run.x, {.t_start = 20, .t_end = 0, .mode = 1, .rtol = 1e-13, .atol = 1e-15},
        ErrorControlled<Fehlberg78>{});
    EXPECT_EQ(back.events.size(), 19u + 1u);
}

TEST(Events, ATimeEventAndAStateEventThatCoincideAreOneSet)
{
    struct Both {
        std::size_t guard_count = 1;
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
        [[nodiscard]] double guard(std::size_t, double, const X& x) const { return 0.3 - x[0]; }
        void reset(std::size_t, double, X& x) const { x[0] = -10; }
        [[nodiscard]] double next_time_event(double t) const { return t < 0.3 ? 0.3 : 1e300; }
        void time_reset(double, X& x) const { x[1] += 1; }
    };
    for (const double h : {0.1, 0.3, 0.07}) {
        const auto run = integrate(Both{}, X{0, 0}, {.t_end = 1, .step = h}, FixedStep<Rk4>{});
        ASSERT_EQ(run.events.size(), 2u) << h;
        EXPECT_EQ(run.events[0].t, 0.3);
        EXPECT_EQ(run.events[1].t, 0.3);
        EXPECT_EQ(run.x[1], 1);
        EXPECT_NEAR(run.x[0], -9.3, 1e-14);
    }
}

TEST(Events, AResetThatContradictsATimeEventIsNamedWithIt)
{
    struct Both {
        std::size_t guard_count = 2;
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
        [[nodiscard]] double guard(std::size_t which, double, const X& x) const
        {
            return (which == 0 ? 0.9 : 0.3) - x[0];
        }
        void reset(std::size_t, double, X& x) const { x[1] = 2; }
        [[nodiscard]] double next_time_event(double t) const { return t < 0.3 ? 0.3 : 1e300; }
        void time_reset(double, X& x) const { x[1] = 1; }
    };
    const auto run = integrate(Both{}, X{0, 0}, {.t_end = 1, .step = 0.1}, FixedStep<Rk4>{});
    EXPECT_EQ(run.outcome, Outcome::conflicting_resets);
    EXPECT_EQ(run.guard, 1u);
    EXPECT_EQ(run.other_guard, time_event_reset);
    EXPECT_EQ(run.x[1], 0);
    EXPECT_NE(describe(run.outcome).find("a guard and a time event"), std::string_view::npos);
}

// --- sets, cascades ---

/// Two guards on one surface whose resets write the same component.
struct Quarrel {
    using State = X;
    static constexpr std::size_t guard_count = 2;
    void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
    [[nodiscard]] double guard(std::size_t, double, const X& x) const { return 0.5 - x[0]; }
    void reset(std::size_t which, double, X& x) const { x[1] = which == 0 ? 1 : 2; }
};

TEST(Events, TwoResetsThatDisagreeAreNamed)
{
    const auto run = integrate(Quarrel{}, X{0, 0}, {.t_end = 1});
    EXPECT_EQ(run.outcome, Outcome::conflicting_resets);
    EXPECT_EQ(run.guard, 0u);
    EXPECT_EQ(run.other_guard, 1u);
    EXPECT_NEAR(run.t, 0.5, 1e-15);
    EXPECT_EQ(run.x[1], 0);

    struct Settled : Quarrel {
        void reset(const FiredGuards& fired, double, X& x) const
        {
            x[1] = 10.0 * static_cast<double>(fired.size());
        }
    };
    const auto settled = integrate(Settled{}, X{0, 0}, {.t_end = 1});
    EXPECT_EQ(settled.outcome, Outcome::reached_end);
    EXPECT_EQ(settled.x[1], 20);
}

TEST(Events, ResetsThatTriggerEachOtherForEverAreNamed)
{
    struct PingPong {
        std::size_t guard_count = 2;
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
        [[nodiscard]] double guard(std::size_t which, double, const X& x) const
        {
            return which == 0 ? 1 - x[0] : x[0] + 1;
        }
        void reset(std::size_t which, double, X& x) const { x[0] = which == 0 ? -2 : 2; }
    };
    const auto run = integrate(PingPong{}, X{0, 0}, {.t_end = 10, .max_steps = 1000});
    EXPECT_EQ(run.outcome, Outcome::endless_cascade);
    EXPECT_LT(run.guard, 2u);
    EXPECT_NEAR(run.t, 1, 1e-14);
}

TEST(Events, AGuardThatAResetFlipsFiresAtTheSameInstant)
{
    struct Domino {
        std::size_t guard_count = 2;
        void flow(double, const X&, X& dxdt) const { dxdt = {1, 0}; }
        [[nodiscard]] double guard(std::size_t which, double, const X& x) const
        {
            return which == 0 ? 1 - x[0] : 5 - x[1];
        }
        void reset(std::size_t which, double, X& x) const
        {
            if (which == 0) x = {0, x[1] + 6};
            if (which == 1) x[1] = -100;
        }
    };
    const auto run = integrate(Domino{}, X{0, 0}, {.t_end = 1.5});
    EXPECT_EQ(guards(run), (std::vector<std::size_t>{0, 1}));
    EXPECT_EQ(run.events[0].t, run.events[1].t);
    EXPECT_EQ(run.x[1], -100);
}

TEST(Events, AGuardThatHasPassedWithoutAnEventIsFlippedFromItsNewSide)
{
    // x = 1 - t. Guard 0 rises at t = 1, which does not count; at 1.5 guard 1 resets x to
    // 1, which carries guard 0 from above to below.
    struct Passed {
        std::size_t guard_count = 2;
        void flow(double, const X1&, X1& dxdt) const { dxdt = {-1}; }
        [[nodiscard]] double guard(std::size_t which, double, const X1& x) const
        {
            return which == 0 ? -x[0] : x[0] + 0.5;
        }
        void reset(std::size_t which, double, X1& x) const
        {
            if (which == 1) x[0] = 1;
        }
    };
    for (const double h : {2.0, 0.7, 0.1}) {
        const auto run = integrate(Passed{}, X1{1}, {.t_end = 2, .step = h}, FixedStep<Rk4>{});
        EXPECT_EQ(guards(run), (std::vector<std::size_t>{1, 0})) << h;
        EXPECT_EQ(run.events[0].t, run.events[1].t);
    }
}

TEST(Events, ANotificationThatCoincidesWithAResetIsNotLost)
{
    // A twin of the floor, with a guard that is only recorded, records every impact.
    struct Twin {
        std::size_t guard_count = 2;
        bool swapped = false;
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -9.81}; }
        [[nodiscard]] double guard(std::size_t, double, const X& x) const { return x[0]; }
        void reset(std::size_t, double, X& x) const { x = {0, -0.9 * x[1]}; }
        [[nodiscard]] GuardInfo guard_info(std::size_t which) const
        {
            const bool floor = (which == 0) != swapped;
            return {.resets = floor, .unilateral = floor};
        }
    };
    for (const bool swapped : {false, true}) {
        for (const double height : {10.0, 1.0, 3.7, 0.123}) {
            const double t_end = 14 * std::sqrt(2 * height / 9.81);
            const auto run = integrate(Twin{.swapped = swapped}, X{height, 0}, {.t_end = t_end});
            ASSERT_EQ(run.events.size(), 26u) << height;
            for (std::size_t i = 0; i < run.events.size(); i += 2) {
                EXPECT_NE(run.events[i].guard, run.events[i + 1].guard);
                EXPECT_NEAR(run.events[i].t, run.events[i + 1].t, 1e-14);
            }
        }
    }
}

TEST(Events, AResetBehindTheSurfaceIsNamed)
{
    struct Behind : BouncingBall {
        void reset(double, X& x) const { x = {-1, 0}; }
    };
    const auto run = integrate(Behind{}, X{1, 0}, {.t_end = 10});
    EXPECT_EQ(run.outcome, Outcome::outside_mode);
    EXPECT_EQ(run.guard, 0u);
    EXPECT_EQ(run.x, (X{-1, 0}));
}

TEST(Events, ContradictoryDeclarationsAreRefused)
{
    // The rising of a guard that bounds the motion from below cannot count.
    struct Rising : BouncingBall {
        Crossing crossing = Crossing::rising;
    };
    EXPECT_THROW((void)integrate(Rising{}, X{1, 0}, {.t_end = 1}), std::invalid_argument);
    struct NoReset {
        static constexpr bool resets() { return false; }
        bool unilateral = true;
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -1}; }
        [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
    };
    EXPECT_THROW((void)integrate(NoReset{}, X{1, 0}, {.t_end = 1}), std::invalid_argument);
}

// --- saving, driving ---

TEST(Events, ARunSavedAndRestoredGoesOnWithTheSameBits)
{
    const BouncingBall ball;
    const Options options{.t_end = 26};
    const auto whole = integrate(ball, X{10, 0}, options);
    std::mt19937 engine(3);
    for (int i = 0; i < 100; ++i) {
        Simulation<BouncingBall, X> first(ball, X{10, 0}, options);
        const int steps = std::uniform_int_distribution<int>(0, 80)(engine);
        for (int k = 0; k < steps; ++k) first.step();
        const Snapshot snapshot = snapshot_from_text(to_text(first.save()));
        Simulation<BouncingBall, X> second(ball, X{1, 0}, options);
        second.restore(snapshot);
        const auto a = first.take();
        const auto b = second.take();
        ASSERT_EQ(a.x, whole.x);
        ASSERT_EQ(b.x, whole.x) << steps;
        ASSERT_EQ(b.t, whole.t);
        for (std::size_t k = 0; k < b.events.size(); ++k) {
            ASSERT_EQ(b.events[b.events.size() - 1 - k].t,
                      whole.events[whole.events.size() - 1 - k].t);
        }
    }
    const Thermostat thermostat;
    Simulation<Thermostat, X1> other(thermostat, X1{20}, {.t_end = 1});
    EXPECT_THROW(other.restore(Simulation<BouncingBall, X>(ball, X{1, 0}, options).save()),
                 std::invalid_argument);
}

TEST(Events, ASimulationIsDrivenFromEventToEvent)
{
    const BouncingBall ball;
    Simulation<BouncingBall, X> simulation(ball, X{10, 0}, {.t_end = 8, .sample_times = {2, 3}});
    std::vector<double> stops;
    while (simulation.advance()) stops.push_back(simulation.t());
    const auto run = simulation.finish();
    EXPECT_EQ(run.events.size(), 3u);
    EXPECT_EQ(run.trajectory.t, (std::vector<double>{2, 3}));
    EXPECT_GE(stops.size(), 3u);
    EXPECT_EQ(run.outcome, Outcome::reached_end);

    Simulation<BouncingBall, X> left(ball, X{10, 0}, {.t_end = 8});
    EXPECT_TRUE(left.advance());
    EXPECT_EQ(left.finish().outcome, Outcome::cancelled);
}

TEST(Events, AnObserverSeesEveryEventAndStep)
{
    const BouncingBall ball;
    Simulation<BouncingBall, X> simulation(ball, X{10, 0}, {.t_end = 20.5});
    int events = 0;
    simulation.run_to_end([&](const Event<X>&) { ++events; });
    EXPECT_EQ(events, 13);
}

TEST(Events, ACancelledRunKeepsWhatItHas)
{
    const BouncingBall ball;
    std::atomic<bool> cancelled = false;
    Simulation<BouncingBall, X> simulation(ball, X{10, 0},
                                           {.t_end = 20.5, .cancelled = &cancelled});
    simulation.advance();
    cancelled = true;
    const auto run = simulation.take();
    EXPECT_EQ(run.outcome, Outcome::cancelled);
    EXPECT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.t, run.events[0].t);
}

TEST(Events, TheSolutionHasALimitOnEitherSideOfAnEvent)
{
    const BouncingBall ball;
    const auto run = integrate(ball, X{10, 0}, {.t_end = 3, .record_steps = true});
    const double t1 = run.events[0].t;
    const double speed = 9.81 * ball.first_impact(10);
    EXPECT_NEAR(run.solution.before(t1)[1], -speed, 1e-13);
    EXPECT_NEAR(run.solution(t1)[1], 0.9 * speed, 1e-13);
    EXPECT_NEAR(run.solution(1)[0], 10 - 9.81 / 2, 1e-13);
    EXPECT_NEAR(run.solution(0)[0], 10, 0);
    EXPECT_EQ(run.solution(3), run.x);
}

TEST(Events, ASolutionWithoutStepsOrTimeIsRefused)
{
    const BouncingBall ball;
    const auto kept = integrate(ball, X{10, 0}, {.t_end = 1, .record_steps = true});
    const auto dropped = integrate(ball, X{10, 0}, {.t_end = 1});
    const auto none = integrate(ball, X{10, 0}, {.t_end = 0, .record_steps = true});
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW((void)kept.solution(nan), std::invalid_argument);
    EXPECT_THROW((void)kept.solution.before(nan), std::invalid_argument);
    for (const auto& run : {dropped, none}) {
        EXPECT_THROW((void)run.solution(0), std::invalid_argument);
        EXPECT_THROW((void)run.solution.before(0), std::invalid_argument);
        EXPECT_THROW((void)run.solution.mode(0), std::invalid_argument);
    }
}

TEST(Events, TheSolutionEndsWithTheStateAfterTheLastReset)
{
    const BouncingBall ball;
    const auto run =
        integrate(ball, X{10, 0}, {.t_end = 3, .stop_at_event = true, .record_steps = true});
    ASSERT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(run.solution(run.t), run.x);
    EXPECT_EQ(run.solution(run.t + 1), run.x);
    EXPECT_LT(run.solution.before(run.t)[1], 0);
    EXPECT_EQ(run.solution.time(run.solution.size()), run.t);
}

TEST(Events, TheSolutionOfARunInProgressEndsWithTheStateAfterTheLastReset)
{
    const auto advance = [](const auto& ball, const auto& start, double t_end) {
        Simulation simulation(ball, start, {.t_end = t_end, .record_steps = true});
        std::size_t events = 0;
        while (simulation.advance()) {
            ++events;
            const auto& solution = simulation.run().solution;
            EXPECT_EQ(solution(simulation.t()), simulation.x()) << simulation.t();
            EXPECT_EQ(solution(simulation.t() + (t_end > 0 ? 1 : -1)), simulation.x());
            EXPECT_NE(solution.before(simulation.t()), simulation.x());
            EXPECT_EQ(solution.time(solution.size()), simulation.t());
        }
        const auto run = simulation.finish();
        EXPECT_EQ(run.solution(run.t), run.x);
        return events;
    };
    /// Kicked every second between its impacts.
    struct Kicked : BouncingBall {
        double next_time_event(double t) const { return std::floor(t) + 1; }
        double previous_time_event(double t) const { return std::ceil(t) - 1; }
        void time_reset(double, X& x) const { x[1] += 1; }
    };
    EXPECT_EQ(advance(BouncingBall{}, X{10, 0}, 7.5), 3u);
    EXPECT_EQ(advance(BouncingBall{}, std::vector<double>{10, 0}, 7.5), 3u);
    EXPECT_GE(advance(Kicked{}, X{10, 0}, 5.5), 6u);
    EXPECT_GE(advance(Kicked{}, X{10, 0}, -5.5), 6u);
}

TEST(Events, TheSolutionKeepsTheStateOfAMotionAtRest)
{
    // At rest the ball is marked by its third component; at 5 s it is thrown up again.
    struct Marked {
        using State = std::array<double, 3>;
        void flow(double /*t*/, const State& x, State& dxdt) const { dxdt = {x[1], -9.81, 0}; }
        double guard(double /*t*/, const State& x) const { return x[0]; }
        GuardInfo guard_info() const { return {.unilateral = true}; }
        void reset(double /*t*/, State& x) const { x = {0, -0.5 * x[1], x[2]}; }
        void rest(double /*t*/, State& x) const { x = {0, 0, x[2] + 1}; }
        double next_time_event(double t) const
        {
            return t < 5 ? 5 : std::numeric_limits<double>::infinity();
        }
        void time_reset(double /*t*/, State& x) const { x[1] = 10; }
    };
    const auto run =
        integrate(Marked{}, {1, 0, 0}, {.t_end = 20, .sample_times = {2, 4, 5, 6, 15, 20}});
    const auto kept = integrate(Marked{}, {1, 0, 0}, {.t_end = 20, .record_steps = true});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.trajectory.t.size(), 6u);
    for (std::size_t i = 0; i < 6; ++i) {
        for (std::size_t c = 0; c < 3; ++c) {
            EXPECT_NEAR(kept.solution(run.trajectory.t[i])[c], run.trajectory.x[i][c], 1e-12);
        }
    }
    EXPECT_EQ(kept.solution.before(5), (Marked::State{0, 0, 1}));
    EXPECT_EQ(kept.solution(5), (Marked::State{0, 10, 1}));
    EXPECT_EQ(kept.solution(19), (Marked::State{0, 0, 2}));
    EXPECT_EQ(kept.solution.time(kept.solution.size()), 20);
}

TEST(Events, TimeMayRunBackward)
{
    // Back through the third impact of an inelastic ball that gains the energy it lost.
    struct Reversed : BouncingBall {
        void reset(double, X& x) const { x = {0, -x[1] / 0.9}; }
    };
    const BouncingBall ball;
    const auto there = integrate(ball, X{10, 0}, {.t_end = 7, .rtol = 1e-12});
    const auto back = integrate(Reversed{}, there.x, {.t_start = 7, .t_end = 0, .rtol = 1e-12});
    ASSERT_EQ(back.events.size(), there.events.size());
    for (std::size_t i = 0; i < there.events.size(); ++i) {
        EXPECT_NEAR(back.events[i].t, there.events[there.events.size() - 1 - i].t, 1e-13);
    }
    EXPECT_NEAR(back.x[0], 10, 1e-12);
    EXPECT_NEAR(back.x[1], 0, 1e-12);
}

TEST(Events, AFastTrainOfEventsIsNotTakenForAnAccumulation)
{
    struct Fast {
        Crossing crossing = Crossing::either;
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -1e12 * x[0]}; }
        [[nodiscard]] double guard(double, const X& x) const { return x[0]; }
        void reset(double, X& x) const { x[0] = 0; }
    };
    const auto run = integrate(Fast{}, X{0, 1e6}, {.t_end = 1e-3});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 318u);  // 1000 / pi
}

}  // namespace
}  // namespace ricochet::events_test
