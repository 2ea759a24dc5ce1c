// Guards that the steps of the state do not resolve, that decay, touch in a kink, end the
// domain of the flow or are not finite.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "random_guards.hpp"
#include "ricochet/bernstein.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"

namespace ricochet::resolved_guard_test {
namespace {

using test::Draining;
using test::Misses;
using test::misses_of;
using test::Spiral;
using X1 = std::array<double, 1>;

TEST(ResolvedGuards, StepsTooShortToBeDividedEnd)
{
    // A fraction of the shortest number above 0 is that number or 0.
    const double shortest = std::numeric_limits<double>::denorm_min();
    const auto run = integrate(CoulombOscillator(), CoulombOscillator::State{2, 0},
                               {.t_end = 100 * shortest, .step = shortest}, FixedStep<Rk4>{});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.t, 100 * shortest);
    EXPECT_EQ(run.statistics.steps, 100U);
}

TEST(ResolvedGuards, OfThreeHundredMovingGuardsNoDipIsMissed)
{
    std::size_t roots = 0;
    for (std::uint32_t seed = 1; seed <= 300; ++seed) {
        const Misses misses = misses_of(seed);
        roots += misses.roots;
        EXPECT_LT(misses.widest, 0.125) << seed;
        EXPECT_EQ(misses.missed, 0u) << seed;
    }
    EXPECT_GT(roots, 20'000u);
}

TEST(ResolvedGuards, WithoutTheCheckInsideMostAreLost)
{
    std::size_t roots = 0;
    std::size_t missed = 0;
    for (std::uint32_t seed = 1; seed <= 30; ++seed) {
        const Misses misses = misses_of(seed, false);
        roots += misses.roots;
        missed += misses.missed;
    }
    EXPECT_GT(2 * missed, roots);
}

/// A state that stands still, and a guard of the time alone.
template <double (*value)(double t, double parameter)>
struct StillState {
    static constexpr bool resets = false;
    double parameter = 0;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {0}; }
    [[nodiscard]] double guard(double t, const X1&) const { return value(t, parameter); }
    [[nodiscard]] GuardInfo guard_info() const
    {
        return {.crossing = Crossing::either, .resets = false};
    }
};

/// Below the surface for 11.2 s around `centre`, and flat away from it.
double smooth_dip(double t, double centre)
{
    const double u = (t - centre) / 5.6;
    return 0.5 - std::exp(-u * u * std::log(2.0));
}
double box_dip(double t, double centre)
{
    return 0.5 - 1 / (1 + std::exp(20 * (std::fabs(t - centre) / 5.6 - 1)));
}

TEST(ResolvedGuards, NoDipOfAnEighthOfAStepIsMissedWhereTheStateStandsStill)
{
    // The last step is 88.9 s long: nothing but the end of the run limits it.
    for (int centre = 20; centre <= 90; ++centre) {
        const StillState<smooth_dip> smooth{static_cast<double>(centre)};
        EXPECT_EQ(integrate(smooth, X1{1}, {.t_end = 100}).events.size(), 2u) << centre;
        const StillState<box_dip> box{static_cast<double>(centre)};
        EXPECT_EQ(integrate(box, X1{1}, {.t_end = 100}).events.size(), 2u) << centre;
    }
}

double decaying_wave(double t, double decay)
{
    return std::exp(-decay * t) * std::sin(3 * t + 1);
}

TEST(ResolvedGuards, AGuardThatDecaysWithinAStepKeepsItsCrossings)
{
    // By e^-600 within a few steps; 3 t + 1 passes floor((3 t_end + 1) / pi) multiples of pi.
    for (const double decay : {0.01, 0.1, 0.3, 1.0}) {
        const StillState<decaying_wave> wave{decay};
        EXPECT_EQ(integrate(wave, X1{1}, {.t_end = 100}).events.size(), 95u) << decay;
        EXPECT_EQ(integrate(wave, X1{1}, {.t_end = 600}).events.size(), 573u) << decay;
    }
}

/// x' = rate, with a guard that is a number only within its domain.
struct LogarithmicGuard {
    static constexpr bool resets = false;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const { return std::log(2.5 - x[0]); }
    [[nodiscard]] GuardInfo guard_info() const { return {.resets = false}; }
};

TEST(ResolvedGuards, AGuardWhoseDomainEndsBeyondItsSurfaceHasItsEvent)
{
    const auto within = integrate(LogarithmicGuard{}, X1{0}, {.t_end = 2.4});
    for (const double t_end : {2.6, 3.0, 30.0}) {
        const auto run = integrate(LogarithmicGuard{}, X1{0}, {.t_end = t_end});
        EXPECT_EQ(run.outcome, Outcome::non_finite);
        EXPECT_NEAR(run.t, 2.5, 1e-12);
        ASSERT_EQ(run.events.size(), 1u) << t_end;
        EXPECT_NEAR(run.events[0].t, 1.5, 1e-15);
        EXPECT_EQ(within.events.size(), 1u);
    }
}

/// Flows that end at surfaces elsewhere than at zero.
template <double (*rate)(double t, double x), double (*surface)(double t)>
struct EndsAt {
    static constexpr bool resets = false;
    double sign = 1;
    void flow(double t, const X1& x, X1& dxdt) const { dxdt = {rate(t, x[0])}; }
    [[nodiscard]] double guard(double t, const X1& x) const { return sign * (x[0] - surface(t)); }
    [[nodiscard]] GuardInfo guard_info() const { return {.resets = false}; }
};
double towards_one(double, double x)
{
    return 1 + std::acos(x);
}
double one(double)
{
    return 1;
}
double below(double, double x)
{
    return -1 - std::sqrt(x + 3.7);
}
double minus(double)
{
    return -3.7;
}
double drifting(double t, double x)
{
    return -1 - std::sqrt(x - 0.1 * t);
}
double drift(double t)
{
    return 0.1 * t;
}

TEST(ResolvedGuards, AFlowThatEndsAtASurfaceAwayFromZeroHasItsEvent)
{
    const Options fine{.t_end = 5, .rtol = 1e-13, .atol = 1e-15};
    for (const Options& options : {Options{.t_end = 5}, fine}) {
        EXPECT_EQ(integrate(EndsAt<towards_one, one>{-1}, X1{0}, options).events.size(), 1u);
        EXPECT_EQ(integrate(EndsAt<below, minus>{}, X1{-2.7}, options).events.size(), 1u);
        EXPECT_EQ(integrate(EndsAt<drifting, drift>{}, X1{1}, options).events.size(), 1u);
    }
    // x + 3.7 = y: t = 2 (sqrt y - log(1 + sqrt y)), from y = 1.
    const auto run = integrate(EndsAt<below, minus>{}, X1{-2.7}, fine);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, 2 - 2 * std::log(2.0), 1e-12);
}

/// Four crossings within one step, of which the ends show none.
struct FourCrossings {
    static constexpr bool resets = false;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const
    {
        return (x[0] - 1) * (x[0] - 3) * (x[0] - 6) * (x[0] - 8);
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.crossing = Crossing::either}; }
};

/// A guard of the given size, which a swinging state crosses, or with a lead does not.
struct Sized {
    static constexpr bool resets = false;
    double unit = 1;
    double lead = 0;
    using State = std::array<double, 2>;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -x[0]}; }
    [[nodiscard]] double guard(double, const State& x) const { return unit * (lead + x[0] / 2); }
    [[nodiscard]] GuardInfo guard_info() const
    {
        return {.crossing = Crossing::either, .resets = false};
    }
};

TEST(ResolvedGuards, HugeOnesAreCheckedAsThoseOfSizeOne)
{
    // 0x1.cp1023 is 1.6e308, so that the guard reaches 1.57e308. A power of two in the unit changes
    // no bit of a guard, of its rate and of a comparison. Where terms overflow a step may take a
    // second evaluation inside it; divided to the end it would take 12 000.
    for (const double lead : {0.0, 0.475}) {
        const auto run_in = [&](double unit) {
            return integrate(Sized{unit, lead}, {1.0, 0.0}, {.t_end = 30});
        };
        const auto one = run_in(0x1.cp0);
        const auto huge = run_in(0x1.cp1023);
        ASSERT_EQ(huge.events.size(), one.events.size());
        for (std::size_t k = 0; k < one.events.size(); ++k) {
            EXPECT_EQ(huge.events[k].t, one.events[k].t);
        }
        EXPECT_EQ(huge.x, one.x);
        EXPECT_EQ(one.events.size(), 10U);
        EXPECT_LE(huge.statistics.guard_calls, one.statistics.guard_calls + one.statistics.steps);
    }
}

TEST(ResolvedGuards, HugeOnesOfAStateThatHardlyMovesAreNotDivided)
{
    // The drop is lost in the rounding of the height; at most the eight places of a step where
    // nothing moves are looked at, and both ends.
    const auto run = integrate(BouncingBall(), {1e308, 0.0}, {.t_end = 20.5});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.x[0], 1e308);
    EXPECT_LE(run.statistics.guard_calls, 12 * run.statistics.steps + 4);
    EXPECT_EQ(run.statistics.unresolved_steps, 0U);
}

TEST(ResolvedGuards, FourCrossingsInOneStepAreFourEvents)
{
    const auto run = integrate(FourCrossings{}, X1{0}, {.t_end = 9, .step = 9}, FixedStep<Rk4>{});
    ASSERT_EQ(run.events.size(), 4u);
    EXPECT_EQ(run.statistics.steps, 1u);
    EXPECT_EQ(run.statistics.refined_steps, 1u);
    EXPECT_EQ(run.statistics.unresolved_steps, 0u);
}

TEST(ResolvedGuards, ADecayingGuardKeepsAllItsCrossingsDownTo1em287)
{
    for (const Spiral::Kind kind : {Spiral::product, Spiral::component, Spiral::cube}) {
        for (const double decay : {0.1, 0.5, 2.0}) {
            const Spiral spiral{.kind = kind, .decay = decay};
            // exp(-decay t) to the power of the guard is exp(-660) = 1e-287
            const int power = kind == Spiral::product ? 2 : kind == Spiral::component ? 1 : 3;
            const double end = 660 / (decay * power);
            const auto run =
                integrate(spiral, Spiral::start, {.t_end = end, .rtol = 1e-8, .atol = 0});
            EXPECT_EQ(run.outcome, Outcome::reached_end);
            EXPECT_EQ(run.x[2], spiral.crossings(end)) << kind << ' ' << decay;
            EXPECT_EQ(static_cast<double>(run.events.size()), run.x[2]) << kind << ' ' << decay;
        }
    }
}

/// Reaches its surface in a kink, flat, or with an infinite slope, and turns back.
struct Kink {
    double power = 1;
    double at = 1;
    static constexpr bool resets = false;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const
    {
        return std::pow(std::fabs(x[0] - at), power);
    }
};

TEST(ResolvedGuards, TouchesInAKinkAreRecorded)
{
    for (const double power : {0.5, 1.0, 1.5, 2.0, 4.0}) {
        for (int i = 0; i < 20; ++i) {
            const Kink kink{.power = power, .at = 0.0637 + 0.481 * i};
            const auto run = integrate(kink, X1{0}, {.t_end = 10});
            ASSERT_EQ(run.events.size(), 1u) << power << ' ' << kink.at;
            EXPECT_EQ(run.events[0].kind, EventKind::touch);
            // |u|^power <= 64 units in the last place of 10^power, or rounding of u
            const double flat = 10 * std::pow(1.5e-14, 1 / power);
            EXPECT_NEAR(run.events[0].t, kink.at, 4 * flat + 1e-9) << power;
        }
    }
}

TEST(ResolvedGuards, AFlowThatEndsAtItsSurfaceHasItsEventThere)
{
    for (const Draining::Kind kind : {Draining::root, Draining::torricelli, Draining::logarithm}) {
        const Draining tank{.kind = kind};
        const Options options{.t_end = 5, .rtol = 1e-13, .atol = 1e-26, .stop_at_event = true};
        const auto run = integrate(tank, X1{1}, options);
        ASSERT_EQ(run.outcome, Outcome::stopped_by_event) << kind;
        ASSERT_EQ(run.events.size(), 1u);
        EXPECT_NEAR(run.t, tank.empty(), 1e-12 * tank.empty()) << kind;
        EXPECT_GE(run.x[0], 0);

        const auto fixed = integrate(tank, X1{1}, {.t_end = 5, .step = 1e-3, .stop_at_event = true},
                                     FixedStep<Rk4>{});
        ASSERT_EQ(fixed.outcome, Outcome::stopped_by_event) << kind;
        EXPECT_NEAR(fixed.t, tank.empty(), 1e-4) << kind;
    }
}

/// The flow is not a number beyond x = 1, where there is no guard.
struct Nowhere {
    static constexpr bool resets = false;
    void flow(double, const X1& x, X1& dxdt) const { dxdt = {1 + std::sqrt(1 - x[0])}; }
    [[nodiscard]] double guard(double, const X1& x) const { return 3 - x[0]; }
};

TEST(ResolvedGuards, AFlowThatEndsElsewhereIsNotFinite)
{
    const auto run = integrate(Nowhere{}, X1{0}, {.t_end = 5, .stop_at_event = true});
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    EXPECT_TRUE(run.events.empty());
}

struct NotFinite {
    double beyond;
    static constexpr bool resets = false;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const { return x[0] > 2.5 ? beyond : 1 + x[0]; }
};

TEST(ResolvedGuards, AGuardThatIsNotFiniteEndsTheRunWhateverItsSign)
{
    constexpr double infinity = std::numeric_limits<double>::infinity();
    for (const double beyond : {infinity, -infinity, std::nan("")}) {
        const auto run = integrate(NotFinite{beyond}, X1{0}, {.t_end = 10});
        EXPECT_EQ(run.outcome, Outcome::non_finite) << beyond;
        EXPECT_LE(run.t, 2.5);
        EXPECT_EQ(run.guard, 0u);
        const auto ends =
            integrate(NotFinite{beyond}, X1{0}, {.t_end = 10}, ErrorControlled<Dopri5>{}, Ends{});
        EXPECT_EQ(ends.outcome, Outcome::non_finite) << beyond;
    }
}

/// The time or a number that grows like it, and whether it is outside of a window.
struct Window {
    static constexpr bool resets = false;
    double from = 0;
    double rate = 1;  ///< of the state; 0: only the time moves
    void flow(double, const X1&, X1& dxdt) const { dxdt = {rate}; }
    [[nodiscard]] GuardInfo guard_info() const
    {
        return {.crossing = Crossing::either, .resets = false};
    }
    [[nodiscard]] bool guard(double t, const X1& x) const
    {
        const double at = rate == 0 ? t : x[0];
        return at < from || at > from + 0.25;
    }
};
struct BoundedWindow : Window {
    double speed_bound(double, const X1&) const { return 1; }
};

template <class Detector, class System>
void expect_window(const System& window)
{
    const std::size_t changes = window.from + 0.25 < 1 ? 2 : 1;
    for (const double step : {0.0, 1.0, 0.5, 0.3}) {
        const Options options{.t_end = 1, .step = step};
        const auto run =
            step == 0 ? integrate(window, X1{0}, options, ErrorControlled<Dopri5>{}, Detector{})
                      : integrate(window, X1{0}, options, FixedStep<Rk4>{}, Detector{});
        ASSERT_EQ(run.events.size(), changes) << step;
        // A guard with bounds is located within 1e-10 of a step.
        EXPECT_NEAR(run.events[0].t, window.from, 1e-10);
        if (changes == 2) {
            EXPECT_NEAR(run.events[1].t, window.from + 0.25, 1e-10);
        }
    }
}

TEST(ResolvedGuards, AWindowOfAQuarterOfTheRunIsFoundByItsSignAlone)
{
    for (const double rate : {0.0, 1.0}) {
        for (double from = 0.003; from < 1; from += 0.01) {
            SCOPED_TRACE(from);
            expect_window<Extremum>(Window{from, rate});
            expect_window<Bernstein>(Window{from, rate});
            expect_window<Planned<>>(BoundedWindow{{from, rate}});
        }
    }
}

TEST(ResolvedGuards, TheEventToleranceSavesCallsOfBooleanGuards)
{
    struct Level {
        void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
        [[nodiscard]] bool guard(double, const X1& x) const { return x[0] < 1; }
        void reset(double, X1& x) const { x[0] = 0; }
    };
    const auto calls = [](double tolerance, double step = 0.1) {
        const Options options{.t_end = 20.55, .step = step, .event_tolerance = tolerance};
        const auto run = integrate(Level{}, X1{0}, options, FixedStep<Rk4>{});
        EXPECT_EQ(run.events.size(), 20u);
        for (std::size_t k = 0; k < run.events.size(); ++k) {
            // Every event ends a bracket of the tolerance, and the next level begins there.
            const double before = k == 0 ? 0 : run.events[k - 1].t;
            EXPECT_GE(run.events[k].t - before, 1 - 1e-14);
            EXPECT_LE(run.events[k].t - before, 1 + tolerance + 1e-14);
        }
        // Beyond the one at the start, and those at the end and inside of every step.
        return static_cast<double>(run.statistics.guard_calls - 1 - 2 * run.statistics.steps) / 20;
    };
    // A hundredth of the step is seven halvings. The value inside of the step saves one of them;
    // where the change comes later, the second place inside is the first. One call after the reset.
    for (double step = 0.1; step < 0.2; step += 0.0037) {
        EXPECT_LE(calls(0.01 * step, step), 7 + 1) << step;
    }
    EXPECT_NEAR(calls(1e-6) - calls(1e-3), std::log2(1e3), 1);
    EXPECT_GT(calls(0), 45);
}

}  // namespace
}  // namespace ricochet::resolved_guard_test
