// The ready systems against their known solutions.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <ostream>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clustered_systems.hpp"
#include "known_solutions.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/buck_converter.hpp"

namespace ricochet::systems_test {
namespace {

using test::Happening;
using test::How;
using test::KnownSolution;
using test::PlainRun;

constexpr double ulp = std::numeric_limits<double>::epsilon();

// --- every system, one list ---

struct Case {
    KnownSolution known;
    How how;
};

void PrintTo(const Case& c, std::ostream* out)
{
    *out << c.known.name;
}

std::vector<Case> cases()
{
    std::vector<Case> all;
    for (const KnownSolution& known : test::known_solutions()) {
        for (const How how : known.hows) all.push_back({known, how});
    }
    return all;
}

std::string name_of(const testing::TestParamInfo<Case>& info)
{
    switch (info.param.how) {
        case How::dopri5_extremum: break;
        case How::dopri5_ends: return info.param.known.name + "_dopri5_ends";
        case How::fehlberg78_extremum: return info.param.known.name + "_fehlberg78_extremum";
    }
    return info.param.known.name + "_dopri5_extremum";
}

/// No event is missed, none is spurious, and they come in the right order.
void expect_events(const std::vector<Happening>& found, const std::vector<Happening>& known,
                   double error)
{
    EXPECT_EQ(found.size(), known.size());
    for (std::size_t i = 0; i < std::min(found.size(), known.size()); ++i) {
        SCOPED_TRACE("event " + std::to_string(i));
        EXPECT_EQ(found[i].guard, known[i].guard);
        EXPECT_EQ(found[i].kind, known[i].kind);
        EXPECT_NEAR(found[i].t, known[i].t, error * std::max(1.0, std::abs(known[i].t)));
    }
}

class Systems : public testing::TestWithParam<Case> {};

TEST_P(Systems, FollowTheKnownSolution)
{
    const auto& [known, how] = GetParam();
    const PlainRun run = known.run(known.start, known.options, how);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.mode, known.mode);
    expect_events(run.events, known.events, known.time_error);
    for (std::size_t i = 0; i < known.end.size(); ++i) {
        EXPECT_NEAR(run.x[i], known.end[i],
                    known.end_error * std::max(1.0, std::abs(known.end[i])));
    }
}

INSTANTIATE_TEST_SUITE_P(All, Systems, testing::ValuesIn(cases()), name_of);

// --- there and back ---

std::vector<Case> reversible_cases()
{
    std::vector<Case> all;
    for (const KnownSolution& known : test::known_solutions()) {
        if (std::isfinite(known.turn_at)) all.push_back({known, How::dopri5_extremum});
    }
    return all;
}

class SystemsBackward : public testing::TestWithParam<Case> {};

TEST_P(SystemsBackward, MeetTheSameEventsInReverseAndReturnToTheStart)
{
    // Backward the first millisecond is run separately: some guards are zero at the start,
    // and rounding decides whether that is met once more.
    const auto& [known, how] = GetParam();
    Options options = known.options;
    options.t_end = known.turn_at;
    const PlainRun there = known.run(known.start, options, how);

    std::swap(options.t_start, options.t_end);
    const double start = options.t_end;
    options.t_end = start + 1e-3;
    options.mode = there.mode;
    const PlainRun back = known.run(there.x, options, how);
    std::vector<Happening> reversed(there.events.rbegin(), there.events.rend());
    // Twice the error of one way, more where that grows (F2 by exp(3.75)).
    expect_events(back.events, reversed, 4 * known.time_error);
    EXPECT_EQ(back.outcome, Outcome::reached_end);
    EXPECT_EQ(back.mode, known.options.mode);

    options.t_start = options.t_end;
    options.t_end = start;
    options.mode = back.mode;
    const PlainRun last = known.run(back.x, options, how);
    for (std::size_t i = 0; i < known.start.size(); ++i) {
        EXPECT_NEAR(last.x[i], known.start[i], 1e-10 * std::max(1.0, std::abs(known.start[i])));
    }
}

INSTANTIATE_TEST_SUITE_P(All, SystemsBackward, testing::ValuesIn(reversible_cases()), name_of);

// --- the closed forms themselves, against figures computed in 34 digits or more ---

TEST(ClosedForms, AgreeWithHighPrecision)
{
    EXPECT_NEAR(Pendulum().half_period(), 1.0037017879400650603, ulp);
    const std::pair<double, double> widths[] = {{1e-2, 0.141539473324427219},
                                                {1e-4, 0.0141422534775128776},
                                                {1e-6, 0.00141421368022425},
                                                {1e-8, 0.000141421356355161}};
    for (const auto& [depth, width] : widths) {
        // A depth is rounded to a double, and the width goes with its root; the last two
        // figures have fifteen digits.
        EXPECT_NEAR(NearTangent({.depth = depth}).half_width(), width, 4e-15 * width);
    }
    const double switches[] = {1.05360515657826301, 5.10825623765990683, 7.11496319228141844,
                               11.1696142733630623, 13.1763212279845739, 17.2309723090662177};
    for (int n = 0; n < 6; ++n) {
        // The rate 0.1 is rounded to a double, by 6e-17 of it.
        EXPECT_NEAR(Thermostat().switch_time(n), switches[n], ulp * switches[n]);
    }
    EXPECT_NEAR(DetestF1::solution(20)[0], -12.944606212134734, 16 * ulp);
    EXPECT_NEAR(DetestF2::solution(20)[0], 70.037310570086067, 64 * ulp);
    EXPECT_NEAR(DetestF4::solution(10)[0], 1.0 / 21, ulp / 21);
    EXPECT_NEAR(DetestF4::solution(20)[0], 9.8150172497074182e-11, 9.8e-11 * ulp);
    EXPECT_NEAR(DetestF5::solution(10)[0], 0.53416729921351663, ulp);
    EXPECT_NEAR(DetestF5::solution(20)[0], 1, ulp);
}

TEST(ClosedForms, OfDetestF1AndF2HoldInsideTheSeconds)
{
    // y' by a central difference: error d²y'/dt² delta² / 6 and 1e-16 |y| / delta.
    const double delta = 1e-5;
    for (const double t : {0.3, 1.7, 6.5, 19.25}) {
        const Mode mode = static_cast<Mode>(t) % 2;
        DetestF1::State rate{};
        DetestF1().flow(mode, t, DetestF1::solution(t), rate);
        for (std::size_t i = 0; i < 2; ++i) {
            const double slope =
                (DetestF1::solution(t + delta)[i] - DetestF1::solution(t - delta)[i]) / (2 * delta);
            EXPECT_NEAR(rate[i], slope, 1e-7);
        }
        DetestF2::State pace{};
        DetestF2().flow(mode, t, DetestF2::solution(t), pace);
        const double slope =
            (DetestF2::solution(t + delta)[0] - DetestF2::solution(t - delta)[0]) / (2 * delta);
        EXPECT_NEAR(pace[0], slope, 1e-7);
    }
}

// --- conserved quantities ---

TEST(HenonHeiles, ConservesItsEnergy)
{
    const HenonHeiles system;
    EXPECT_NEAR(system.energy(HenonHeiles::start), 0.083333, 1e-15);
    const auto run =
        integrate(system, HenonHeiles::start, {.t_end = 35, .rtol = 1e-13, .atol = 1e-13});
    EXPECT_NEAR(system.energy(run.x), 0.083333, 1e-12);  // as the state
}

TEST(ThreeBody, ConservesJacobisIntegral)
{
    // Near the Moon the integral is a difference of numbers of order ten.
    const ThreeBody system;
    const auto run =
        integrate(system, ThreeBody::start, {.t_end = 6.2, .rtol = 1e-13, .atol = 1e-13});
    EXPECT_NEAR(system.jacobi(run.x), system.jacobi(ThreeBody::start), 1e-11);
}

// --- hidden pair ---

TEST(HiddenPair, IsFoundByTheExtremumInOneStepOverAllThreeZeros)
{
    // The method is exact, and so is the cubic through the ends: the error is the
    // rounding of sums of up to 400 over a slope of at least 4, 16 or 44.
    const auto run = integrate(HiddenPair(), HiddenPair::start,
                               {.t_start = -8, .t_end = 4, .step = 12}, FixedStep<Rk4>{});
    EXPECT_EQ(run.statistics.steps, 1U);
    expect_events(test::plain(run).events, test::crossings(test::as_vector(HiddenPair::zeros)),
                  1e-13);
}

TEST(HiddenPair, IsMissedByTheEndsOfThatStep)
{
    const auto run = integrate(HiddenPair(), HiddenPair::start,
                               {.t_start = -8, .t_end = 4, .step = 12}, FixedStep<Rk4>{}, Ends{});
    EXPECT_EQ(run.events.size(), 1U);
}

// --- near tangent ---

TEST(NearTangent, PassagesAreFoundAtEveryDepthAndPhase)
{
    // The crest is moved by the error of the integration, here below 1e-12, and the times
    // by that over the slope; that holds while the crest stays well above the level.
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> phases(0.5, 5.5);
    for (const double depth : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10}) {
        for (int i = 0; i < 10; ++i) {
            const NearTangent system({.depth = depth, .phase = phases(random)});
            SCOPED_TRACE("depth " + std::to_string(depth) + ", start " +
                         std::to_string(system.start()[0]));
            const auto run =
                integrate(system, system.start(), {.t_end = 20, .rtol = 1e-13, .atol = 1e-13});
            const std::vector<double> exact = system.events(20);
            ASSERT_EQ(run.events.size(), exact.size());
            for (std::size_t k = 0; k < exact.size(); ++k) {
                EXPECT_EQ(run.events[k].kind, EventKind::crossing);
                EXPECT_NEAR(run.events[k].t, exact[k], 1e-12 / std::sin(system.half_width()));
            }
        }
    }
}

TEST(NearTangent, ATouchIsRecordedAsATouch)
{
    // A touch is settled as soon as the remaining height to the crest is below a
    // sixty-fourth of the tolerance: (t - crest)² / 2 <= touch / 64.
    const double touch = 1e-9;
    for (const double phase : {0.5, 1.0, 2.2, 3.7, 5.5}) {
        const NearTangent system({.depth = 0, .phase = phase, .touch = touch});
        const auto run =
            integrate(system, system.start(), {.t_end = 20, .rtol = 1e-13, .atol = 1e-13});
        const std::vector<double> exact = system.events(20);
        ASSERT_EQ(run.events.size(), exact.size());
        for (std::size_t k = 0; k < exact.size(); ++k) {
            EXPECT_EQ(run.events[k].kind, EventKind::touch);
            EXPECT_NEAR(run.events[k].t, exact[k], std::sqrt(touch / 32));
        }
    }
}

TEST(NearTangent, ANearMissIsNothing)
{
    for (const double touch : {0.0, 1e-9}) {
        const NearTangent system({.depth = -1e-6, .phase = 1, .touch = touch});
        EXPECT_TRUE(system.events(20).empty());
        for (const double rtol : {1e-9, 1e-13}) {
            const auto run =
                integrate(system, system.start(), {.t_end = 20, .rtol = rtol, .atol = rtol});
            EXPECT_TRUE(run.events.empty());
        }
    }
}

// --- impact oscillator ---

TEST(ImpactOscillator, ThousandPeriodsHaveTheExactImpacts)
{
    // The impacts settle on stable periodic motions, so that an error added in a flight
    // decays within a few flights: the times do not become less certain, except
    // for their own rounding, and that of w t.
    const std::pair<double, std::size_t> counts[] = {
        {0.7, 2000}, {0.8, 1001}, {1.0, 999}, {1.2, 999}};
    for (const auto& [frequency, count] : counts) {
        const ImpactOscillator oscillator({.frequency = frequency});
        const double t_end = 1000 * oscillator.period();
        const std::vector<double> exact = oscillator.impacts(t_end);
        EXPECT_EQ(exact.size(), count);
        const Options options{.t_end = t_end, .rtol = 1e-13, .atol = 1e-13};
        for (const How how : {How::fehlberg78_extremum, How::dopri5_ends}) {
            const PlainRun run = test::runs(oscillator)({0, 0}, options, how);
            ASSERT_EQ(run.events.size(), count) << "frequency " << frequency;
            for (std::size_t i = 0; i < count; ++i) {
                EXPECT_NEAR(run.events[i].t, exact[i], 1e-12 + 2 * ulp * exact[i]);
            }
        }
    }
}

TEST(ImpactOscillator, ExactImpactsEndWhereTheMassComesToRestAtTheWall)
{
    // A slow force presses the mass against the wall, and flights become shorter by the restitution
    // until their heights are lost in rounding: here 2e-9 s after some forty of them, not less.
    const double restitution = 0.57051402692391884;
    const ImpactOscillator oscillator({.frequency = 0.43597592109397371,
                                       .wall = 0.3578622610174616,
                                       .restitution = restitution,
                                       .damping = 0.030578733450074402});
    const std::vector<double> times = oscillator.impacts(20 * oscillator.period());
    ASSERT_GT(times.size(), 30U);
    ASSERT_LT(times.size(), 60U);
    const std::size_t n = 30;
    EXPECT_NEAR((times[n] - times[n - 1]) / (times[n - 1] - times[n - 2]), restitution, 1e-4);
    EXPECT_NEAR(times.back(), 16.9078745, 1e-6);
}

TEST(ImpactOscillator, ExactImpactsIncludeALowOneWhileTheForceReleasesTheMass)
{
    // The last flight before the release, 0.01 s long, rises and is drawn back within one step
    // of the search.
    const ImpactOscillator oscillator({.frequency = 0.64676998199290758,
                                       .wall = 0.20179036747016277,
                                       .restitution = 0.48402883259190876,
                                       .damping = 0.26892575918342682});
    const std::vector<double> exact = oscillator.impacts(30);
    const auto run =
        integrate(oscillator, ImpactOscillator::start, {.t_end = 30, .rtol = 1e-13, .atol = 1e-13});
    ASSERT_EQ(run.events.size(), exact.size());
    for (std::size_t i = 0; i < exact.size(); ++i) EXPECT_NEAR(run.events[i].t, exact[i], 1e-9);
}

TEST(ImpactOscillator, OtherParametersHaveTheirExactImpacts)
{
    // The velocity at impacts is a few tenths at least.
    const ImpactOscillator oscillator({.frequency = 0.9, .wall = 0.4, .restitution = 0.6});
    const std::vector<double> exact = oscillator.impacts(60);
    ASSERT_GT(exact.size(), 5U);
    const auto run =
        integrate(oscillator, ImpactOscillator::start, {.t_end = 60, .rtol = 1e-13, .atol = 1e-13});
    ASSERT_EQ(run.events.size(), exact.size());
    for (std::size_t i = 0; i < exact.size(); ++i) {
        EXPECT_NEAR(run.events[i].t, exact[i], 1e-11);
        EXPECT_EQ(run.events[i].after[0], 0.4);
        EXPECT_EQ(run.events[i].after[1], -0.6 * run.events[i].before[1]);
    }
}

// --- dry friction ---

TEST(CoulombOscillator, TurnsWhereEachHalfCycleHasLostTwiceTheFriction)
{
    const CoulombOscillator oscillator;
    const auto run = integrate(
        oscillator, CoulombOscillator::start,
        {.t_end = 20, .mode = CoulombOscillator::start_mode, .rtol = 1e-13, .atol = 1e-13});
    ASSERT_EQ(run.events.size(), 3U);
    const double points[] = {-1.4, 0.8, -0.2};
    const Mode modes[] = {CoulombOscillator::slip_right, CoulombOscillator::slip_left,
                          CoulombOscillator::stick};
    for (int n = 0; n < 3; ++n) {
        const auto i = static_cast<std::size_t>(n);
        EXPECT_NEAR(oscillator.turning_point(n + 1), points[n], 1e-15);
        EXPECT_NEAR(run.events[i].before[0], points[n], 1e-12);
        EXPECT_EQ(run.events[i].after[1], 0);
        EXPECT_EQ(run.events[i].mode_after, modes[n]);
    }
}

TEST(CoulombOscillator, SticksEarlierWhereStickingBearsMore)
{
    const CoulombOscillator oscillator({.friction = 0.3, .static_friction = 0.9});
    EXPECT_EQ(oscillator.stops(), 2);
    const auto run = integrate(oscillator, CoulombOscillator::start,
                               {.t_end = 20, .mode = CoulombOscillator::start_mode});
    ASSERT_EQ(run.events.size(), 2U);
    EXPECT_EQ(run.mode, CoulombOscillator::stick);
    EXPECT_NEAR(run.x[0], 0.8, 1e-7);
}

TEST(CoulombOscillator, WithoutFrictionNeverStops)
{
    const CoulombOscillator oscillator({.friction = 0, .static_friction = 0});
    EXPECT_EQ(oscillator.stops(), std::numeric_limits<int>::max());
    const auto run = integrate(oscillator, CoulombOscillator::start,
                               {.t_end = 20, .mode = CoulombOscillator::start_mode});
    EXPECT_EQ(run.events.size(), 6U);  // at multiples of pi
    EXPECT_NE(run.mode, CoulombOscillator::stick);
}

TEST(CoulombOscillator, ModeOfAStateIsDecidedBySpeedThenBySpring)
{
    const CoulombOscillator oscillator;
    EXPECT_EQ(oscillator.mode_at(2, 0), CoulombOscillator::slip_left);
    EXPECT_EQ(oscillator.mode_at(-2, 0), CoulombOscillator::slip_right);
    EXPECT_EQ(oscillator.mode_at(0.3, 0), CoulombOscillator::stick);
    EXPECT_EQ(oscillator.mode_at(0.1, 1), CoulombOscillator::slip_right);
    EXPECT_EQ(oscillator.mode_at(0.1, -1), CoulombOscillator::slip_left);
    const StickSlip belt;
    EXPECT_EQ(belt.mode_at(1, 0.2), StickSlip::slip_left);  // the belt moves it on
    EXPECT_EQ(belt.mode_at(-1, 0.2), StickSlip::stick);     // the belt moves it back
}

TEST(StickSlip, SticksAtTheKnownPlaceAndSlipsFromTheExactLimit)
{
    const auto run =
        integrate(StickSlip(), StickSlip::start,
                  {.t_end = 50, .mode = StickSlip::start_mode, .rtol = 1e-13, .atol = 1e-13});
    ASSERT_EQ(run.events.size(), 8U);
    for (std::size_t i = 0; i < run.events.size(); i += 2) {
        EXPECT_NEAR(run.events[i].before[0], StickSlip::stick_position, 1e-12);
        EXPECT_EQ(run.events[i].after[1], 0.2);
        EXPECT_EQ(run.events[i].mode_after, StickSlip::stick);
        EXPECT_EQ(run.events[i + 1].after, StickSlip::start);
        EXPECT_EQ(run.events[i + 1].mode_after, StickSlip::slip_left);
    }
}

TEST(StickSlip, ArmsTheDoubleZeroInLongSteps)
{
    // The sliding speed leaves zero as t². For any accuracy the first event is the
    // stick and not the start; the error of rk4 in steps of up to a second is below a
    // tenth of the step.
    for (const double step : {0.01, 0.1, 0.5, 1.0}) {
        const auto run =
            integrate(StickSlip(), StickSlip::start,
                      {.t_end = 10, .mode = StickSlip::start_mode, .step = step}, FixedStep<Rk4>{});
        ASSERT_EQ(run.events.size(), 1U);
        EXPECT_NEAR(run.events[0].t, StickSlip::stick_time, 0.1 * step);
    }
}

TEST(StickSlip, OnABeltThatRunsLeftIsTheMirrorImage)
{
    const Options options{.t_end = 50, .mode = StickSlip::slip_left};
    const auto run = integrate(StickSlip(), StickSlip::start, options);
    Options mirrored = options;
    mirrored.mode = StickSlip::slip_right;
    const auto image = integrate(StickSlip({.belt_speed = -0.2}), {-1, -0.2}, mirrored);
    ASSERT_EQ(run.events.size(), image.events.size());
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_EQ(run.events[i].t, image.events[i].t);
        EXPECT_EQ(run.events[i].after[0], -image.events[i].after[0]);
        EXPECT_EQ(image.events[i].guard, i % 2 == 0 ? StickSlip::stop : StickSlip::pulled_right);
    }
}

// --- other parameters ---

TEST(Pendulum, LargeSwingsHaveTheirOwnPeriod)
{
    const Pendulum pendulum({.gravity = 1.62, .length = 0.5});
    for (const double amplitude : {0.5, -2.0, 3.0}) {
        const double half_period = pendulum.half_period(amplitude);
        const auto run = integrate(pendulum, {amplitude, 0},
                                   {.t_end = 3.5 * half_period, .rtol = 1e-13, .atol = 1e-13});
        ASSERT_EQ(run.events.size(), 3U) << amplitude;
        for (std::size_t i = 0; i < 3; ++i) {
            // At an amplitude of 3 half a period changes by 8 s for every radian, and each of
            // 2500 steps may have added a part of 1e-13.
            EXPECT_NEAR(run.events[i].t, static_cast<double>(i + 1) * half_period, 1e-10);
        }
    }
}

TEST(Thermostat, OtherTemperaturesHaveTheirOwnTimes)
{
    const Thermostat thermostat(
        {.rate = 0.3, .ambient = -5, .heated = 40, .low = 19, .high = 19.5});
    const auto run = integrate(thermostat, {25.0}, {.t_end = 20, .rtol = 1e-13, .atol = 1e-13});
    ASSERT_GT(run.events.size(), 10U);
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        // The temperature, 20 in size, is met at rates of 6 and more.
        EXPECT_NEAR(run.events[i].t, thermostat.switch_time(static_cast<int>(i), 25), 2e-11);
        EXPECT_EQ(run.events[i].before, run.events[i].after);
    }
}

// --- order of convergence ---

/// Largest error of the event times, which must be the known ones.
template <class System, class Stepping>
double largest_error(const System& system, const typename System::State& start,
                     const std::vector<double>& known, const Options& options, Stepping stepping)
{
    const auto run = integrate(system, start, options, stepping);
    EXPECT_EQ(run.events.size(), known.size());
    double worst = 0;
    for (std::size_t i = 0; i < std::min(known.size(), run.events.size()); ++i) {
        worst = std::max(worst, std::abs(run.events[i].t - known[i]));
    }
    return worst;
}

template <class System>
struct Problem {
    System system;
    typename System::State start;
    double t_end;
    std::vector<double> known;
};

Problem<Thermostat> thermostat_problem()
{
    Problem<Thermostat> problem{
        .system = {}, .start = Thermostat::start, .t_end = 100, .known = {}};
    for (int n = 0; problem.system.switch_time(n) <= 100; ++n) {
        problem.known.push_back(problem.system.switch_time(n));
    }
    return problem;
}

Problem<ImpactOscillator> impact_problem()
{
    return {.system = {},
            .start = ImpactOscillator::start,
            .t_end = 60,
            .known = ImpactOscillator().impacts(60)};
}

Problem<Pendulum> pendulum_problem()
{
    Problem<Pendulum> problem{.system = {}, .start = Pendulum::start, .t_end = 10, .known = {}};
    const double half_period = problem.system.half_period();
    for (int n = 1; n * half_period <= 10; ++n) problem.known.push_back(n * half_period);
    return problem;
}

/// Halving the step twice must divide the error by 16 each time: the leading term
/// dominates in these steps, and the next term changes the observed order by a
/// tenth. Errors are above 1e-9, far from rounding.
template <class System>
void expect_order_four(const Problem<System>& problem, double h)
{
    const auto error = [&](double step) {
        return largest_error(problem.system, problem.start, problem.known,
                             {.t_end = problem.t_end, .step = step}, FixedStep<Rk4>{});
    };
    const double coarse = error(h);
    const double middle = error(h / 2);
    const double fine = error(h / 4);
    EXPECT_GT(fine, 1e-9);
    EXPECT_NEAR(std::log2(coarse / middle), 4, 0.15);
    EXPECT_NEAR(std::log2(middle / fine), 4, 0.15);
}

TEST(Convergence, Rk4KeepsOrderFourThroughSwitchesOfTheMode)
{
    expect_order_four(thermostat_problem(), 0.4);
}

TEST(Convergence, Rk4KeepsOrderFourThroughImpactsOfTheForcedOscillator)
{
    expect_order_four(impact_problem(), 0.05);
}

TEST(Convergence, Rk4KeepsOrderFourInNotifications)
{
    expect_order_four(pendulum_problem(), 0.05);
}

/// A decade of tolerance must give at least half a decade of error, and the error stay
/// below 100 times the tolerance; both hold per step, and a run has a few hundred steps
/// whose errors partly add up.
template <class System>
void expect_error_to_follow_tolerance(const Problem<System>& problem, double factor)
{
    double previous = std::numeric_limits<double>::infinity();
    for (const double tolerance : {1e-6, 1e-8, 1e-10, 1e-12}) {
        const double error =
            largest_error(problem.system, problem.start, problem.known,
                          {.t_end = problem.t_end, .rtol = tolerance, .atol = tolerance},
                          ErrorControlled<Dopri5>{});
        EXPECT_LT(error, previous / 10) << "tolerance " << tolerance;
        EXPECT_LT(error, factor * tolerance);
        previous = error;
    }
}

TEST(Convergence, ErrorFollowsToleranceThroughSwitchesOfTheMode)
{
    // The temperature is 20 in size, and met at a rate of one.
    expect_error_to_follow_tolerance(thermostat_problem(), 20 * 10);
}

TEST(Convergence, ErrorFollowsToleranceThroughImpactsOfTheForcedOscillator)
{
    expect_error_to_follow_tolerance(impact_problem(), 10);
}

TEST(Convergence, ErrorFollowsToleranceInNotifications)
{
    // The absolute tolerance is against an angle of 0.05, and w is met at a rate of 0.5.
    expect_error_to_follow_tolerance(pendulum_problem(), 2 * 50);
}

TEST(DetestF5, ErrorFollowsToleranceAcrossItsSingularities)
{
    double previous = std::numeric_limits<double>::infinity();
    for (const double tolerance : {1e-8, 1e-10, 1e-12, 1e-14}) {
        const auto run = integrate(DetestF5(), DetestF5::start,
                                   {.t_end = 20, .rtol = tolerance, .atol = tolerance});
        const double error = std::abs(run.x[0] - 1);
        EXPECT_LT(error, previous / 10) << "tolerance " << tolerance;
        EXPECT_LT(error, 1000 * tolerance);
        previous = error;
    }
}

TEST(DetestF4, FehlbergsPairSeesThePulse)
{
    // The rate depends on time alone, which the pair's own estimate does not see.
    const auto run =
        integrate(DetestF4(), DetestF4::start, {.t_end = 20, .rtol = 1e-13, .atol = 1e-22},
                  ErrorControlled<Fehlberg78>{});
    EXPECT_NEAR(run.x[0] / DetestF4::solution(20)[0], 1, 1e-11);
}

// --- clusters and coincidences ---

TEST(Clustered, EventsOfOneLongStepComeInOrderForwardAndBackward)
{
    // Offsets in the step are of order one and known to an ulp, x to two.
    const test::Clustered system;
    const auto expect = [](const auto& run, bool backward) {
        EXPECT_EQ(run.statistics.steps, 1U);
        ASSERT_EQ(run.events.size(), 4U);
        for (std::size_t i = 0; i < 4; ++i) {
            const std::size_t guard = backward ? 3 - i : i;
            EXPECT_EQ(run.events[i].guard, guard);
            EXPECT_NEAR(run.events[i].t, test::Clustered::offsets[guard], 4 * ulp);
        }
    };
    const Options forward{.t_start = -1, .t_end = 1, .step = 2};
    const Options backward{.t_start = 1, .t_end = -1, .step = 2};
    expect(integrate(system, {-1.0}, forward, FixedStep<Rk4>{}), false);
    expect(integrate(system, {-1.0}, forward, FixedStep<Rk4>{}, Ends{}), false);
    expect(integrate(system, {1.0}, backward, FixedStep<Rk4>{}), true);
    expect(integrate(system, {1.0}, backward, FixedStep<Rk4>{}, Ends{}), true);
}

TEST(Synchronous, TheOrderOfTheGuardsDoesNotMatter)
{
    for (const bool acts : {false, true}) {
        const test::Synchronous system{.acts = acts};
        const test::Synchronous swapped{.swapped = true, .acts = acts};
        const Options options{.t_end = 6.28, .rtol = 1e-13, .atol = 1e-13, .event_window = 1e-11};
        const auto run = integrate(system, test::Synchronous::start, options);
        const auto other = integrate(swapped, test::Synchronous::start, options);
        ASSERT_EQ(run.events.size(), 8U);
        ASSERT_EQ(other.events.size(), 8U);
        const auto by_time_and_component = [](const auto& events, const test::Synchronous& of) {
            std::vector<std::pair<double, std::size_t>> out;
            for (const auto& event : events) out.emplace_back(event.t, of.component(event.guard));
            std::sort(out.begin(), out.end());
            return out;
        };
        EXPECT_EQ(by_time_and_component(run.events, system),
                  by_time_and_component(other.events, swapped));
        const double sixth = std::numbers::pi / 6;
        std::size_t of_both = 0;
        for (const auto& event : run.events) {
            // cos 3t at odd multiples of pi / 6, cos t at the third and ninth of them.
            const double multiple = std::round(event.t / sixth);
            EXPECT_EQ(std::fmod(multiple, 2), 1);
            EXPECT_NEAR(event.t, multiple * sixth, 1e-12);
            if (event.guard == 1) {
                EXPECT_EQ(std::fmod(multiple, 6), 3);
                ++of_both;
            }
        }
        EXPECT_EQ(of_both, 2U);
    }
}

TEST(Synchronous, GuardsThatActTogetherDoSoAtOneTime)
{
    const test::Synchronous system{.acts = true};
    const auto run =
        integrate(system, test::Synchronous::start,
                  {.t_end = 6.28, .rtol = 1e-13, .atol = 1e-13, .event_window = 1e-11});
    EXPECT_EQ(run.x[2], 8);  // each of eight events adds one, in sets of one or two
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        if (run.events[i].guard != 1) continue;
        ASSERT_GT(i, 0U);
        EXPECT_EQ(run.events[i - 1].guard, 0U);
        EXPECT_EQ(run.events[i].t, run.events[i - 1].t);
        EXPECT_EQ(run.events[i].after, run.events[i - 1].after);
    }
}

TEST(Balls, IdenticalOnesBounceTogetherAsOneAlone)
{
    const Options options{.t_end = 20.5, .step = 0.01};
    const BouncingBall one;
    const auto alone = integrate(one, BouncingBall::State{10, 0}, options, FixedStep<Rk4>{});
    for (const std::size_t n : {2U, 1000U}) {
        const test::Balls balls{.balls = n, .gravity = 9.81, .restitution = 0.9};
        const auto run = integrate(balls, balls.drop(10), options, FixedStep<Rk4>{});
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        ASSERT_EQ(run.events.size(), 13 * n);
        for (std::size_t i = 0; i < run.events.size(); ++i) {
            ASSERT_EQ(run.events[i].guard, i % n);
            ASSERT_EQ(run.events[i].t, alone.events[i / n].t);
            ASSERT_NEAR(run.events[i].t, one.impact_time(static_cast<int>(i / n), 10), 2e-14);
        }
        // The instant of a set of several is rounded once more: 1e-15 s at speeds of ten.
        for (std::size_t i = 0; i < n; ++i) {
            ASSERT_NEAR(run.x[2 * i], alone.x[0], 1e-13);
            ASSERT_NEAR(run.x[2 * i + 1], alone.x[1], 1e-13);
        }
    }
}

// --- refusals ---

/// `make` throws std::invalid_argument with these pieces in its sentence.
template <class Make>
void expect_refused(const Make& make, const std::vector<std::string_view>& pieces)
{
    try {
        make();
        FAIL() << "nothing was thrown; expected " << pieces.front();
    } catch (const std::invalid_argument& error) {
        const std::string_view sentence = error.what();
        for (const std::string_view piece : pieces) {
            EXPECT_NE(sentence.find(piece), std::string_view::npos) << sentence;
        }
    }
}

TEST(Parameters, OutsideTheirRangeAreRefusedByName)
{
    constexpr double inf = std::numeric_limits<double>::infinity();
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    expect_refused([] { Pendulum({.gravity = -1}); }, {"Pendulum", "gravity", "positive", "-1"});
    expect_refused([] { Pendulum({.length = 0}); }, {"Pendulum", "length", "positive", "0"});
    expect_refused([] { ThreeBody({.mass_ratio = 0.6}); }, {"mass_ratio", "(0, 1/2]", "0.6"});
    expect_refused([] { NearTangent({.depth = 2}); }, {"NearTangent", "depth", "below 2"});
    expect_refused([] { NearTangent({.phase = inf}); }, {"phase", "finite", "inf"});
    expect_refused([] { NearTangent({.touch = -1e-9}); }, {"touch", "zero or positive", "-1e-09"});
    expect_refused([] { Thermostat({.rate = 0}); }, {"Thermostat", "rate", "positive"});
    expect_refused([] { Thermostat({.ambient = 18}); }, {"low", "above ambient 18", "18"});
    expect_refused([] { Thermostat({.low = 23}); }, {"high", "above low 23", "22"});
    expect_refused([] { Thermostat({.high = 31}); }, {"heated", "above high 31", "30"});
    expect_refused([] { ImpactOscillator({.frequency = 0}); }, {"frequency", "positive"});
    expect_refused([] { ImpactOscillator({.wall = -1}); }, {"wall", "positive", "-1"});
    expect_refused([] { ImpactOscillator({.restitution = 1.2}); },
                   {"restitution", "[0, 1]", "1.2"});
    expect_refused([] { ImpactOscillator({.damping = 2}); }, {"damping", "(0, 2)", "2"});
    expect_refused([] { CoulombOscillator({.mass = 0}); }, {"CoulombOscillator", "mass"});
    expect_refused([] { CoulombOscillator({.stiffness = nan}); }, {"stiffness", "nan"});
    expect_refused([] { CoulombOscillator({.friction = 0.4}); },
                   {"static_friction", "at least friction 0.4", "0.3"});
    expect_refused([] { StickSlip({.belt_speed = inf}); }, {"StickSlip", "belt_speed", "inf"});
    expect_refused([] { StickSlip({.weakening = -3}); }, {"StickSlip", "weakening", "-3"});
    expect_refused([] { BuckConverter({.inductance = 0}); }, {"BuckConverter", "inductance"});
    expect_refused([] { BuckConverter({.capacitance = nan}); }, {"capacitance", "nan"});
    expect_refused([] { BuckConverter({.resistance = -1}); }, {"resistance", "positive", "-1"});
    expect_refused([] { BuckConverter({.low = 0}); }, {"low", "positive"});
    expect_refused([] { BuckConverter({.high = 0.3}); }, {"high", "above low 0.4", "0.3"});
    expect_refused([] { BuckConverter({.input = 5}); }, {"input", "above resistance * high 6"});
}

}  // namespace
}  // namespace ricochet::systems_test
