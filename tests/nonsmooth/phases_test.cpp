// Set-valued motion as a phase of a run: everything else that a system declares happens meanwhile.
// Every expected number is a closed form. Where no tolerance is named, the motion is a polynomial
// of degree two or less, exact for the method, and what is left is rounding of the location: 1e-9
// holds all of it with a reserve of more than a thousand.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "phased_runs.hpp"
#include "refusal.hpp"

namespace ricochet::phases_test {
namespace {

constexpr double tolerance = exact_motion;
constexpr double never = std::numeric_limits<double>::infinity();

using One = Slider<1>::State;
using Two = Slider<2>::State;
using Three = Slider<3>::State;

[[nodiscard]] GuardInfo bounding()
{
    GuardInfo info;
    info.name = "floor";
    info.unilateral = true;
    return info;
}
[[nodiscard]] GuardInfo recorded()
{
    GuardInfo info;
    info.name = "section";
    info.crossing = Crossing::either;
    info.resets = false;
    return info;
}

/// A block that slides, and beside it a ball: its height and speed.
[[nodiscard]] OwnGuard<3> elastic_floor()
{
    return {bounding(), [](double, const Three& x) { return x[1]; },
            [](double, Three& x) { x[2] = -x[2]; }};
}
[[nodiscard]] OwnGuard<3> section_at(double height)
{
    return {recorded(), [height](double, const Three& x) { return x[1] - height; }};
}
void fall(double, const Three& x, Three& dxdt)
{
    dxdt = {0, x[2], -1};
}
void fall_under_load(double t, const Three& x, Three& dxdt)
{
    dxdt = {t, x[2], -1};
}

/// Time events at multiples of a duration.
[[nodiscard]] auto every(double duration)
{
    return [duration](double t) { return (std::floor(t / duration + 1e-9) + 1) * duration; };
}
[[nodiscard]] auto once(double at)
{
    return [at](double t) { return t < at ? at : never; };
}

template <class Events>
[[nodiscard]] std::vector<double> times_of(const Events& events, std::size_t guard)
{
    std::vector<double> times;
    for (const auto& event : events) {
        if (event.guard == guard) times.push_back(event.t);
    }
    return times;
}
// --- guards, resets and time events while a block is held ---

TEST(Phases, ABallMeetsItsFloorWhileABlockIsHeld)
{
    const Slider<3> system{.f = fall, .own = {elastic_floor()}};
    const auto run = run_of(system, Three{1, 1.125, 0}, until(3));
    expect_end(run, Three{0, 1.125, 0});
    expect_times(times_of(run.events, 1), {1.5});
    expect_times(times_of(run.events, EventKind::stick), {1});
    ASSERT_EQ(run.phases.size(), 2U);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::held);
    EXPECT_NEAR(run.phases[1].from, 1, tolerance);
}

TEST(Phases, ARecordedSectionIsCrossedMeanwhile)
{
    const Slider<3> system{.f = fall, .own = {section_at(0.5)}};
    const auto run = run_of(system, Three{1, 1.125, 0}, until(3));
    expect_times(times_of(run.events, 1), {std::sqrt(1.25)});
}

TEST(Phases, FloorSectionAndTimeEventsAllHappenMeanwhile)
{
    const Slider<3> system{
        .f = fall, .own = {elastic_floor(), section_at(0.5)}, .next = every(0.75)};
    const auto run = run_of(system, Three{1, 1.125, 0}, until(3));
    const double down = std::sqrt(1.25);
    expect_end(run, Three{0, 1.125, 0});
    expect_times(times_of(run.events, 1), {1.5});
    expect_times(times_of(run.events, 2), {down, 3 - down});
    expect_times(times_of(run.events, EventKind::time), {0.75, 1.5, 2.25, 3});
}

TEST(Phases, ALoadHoldsAndReleases)
{
    // v' = t - 3 from 1/2 stops at 3 - sqrt 8; held until the load is 3; then v = (t - 3)^2 / 2.
    const Slider<3> system{.f = fall_under_load, .friction = 3, .own = {elastic_floor()}};
    const auto run = run_of(system, Three{0.5, 1.125, 0}, until(6));
    expect_end(run, Three{4.5, 1.125, 0}, 1e-8);
    expect_times(times_of(run.events, 1), {1.5, 4.5});
    expect_times(times_of(run.events, EventKind::stick), {3 - std::sqrt(8.0)});
    expect_times(times_of(run.events, EventKind::slip), {3});
}

TEST(Phases, AChangingLoadIsFollowedThroughSticksAndSlips)
{
    const Slider<3> system{.f =
                               [](double t, const Three& x, Three& dxdt) {
                                   dxdt = {1.25 * std::sin(t), x[2], -1};
                               },
                           .own = {elastic_floor()}};
    const auto run = run_of(system, Three{0, 1.125, 0}, until(12));
    expect_times(times_of(run.events, 1), {1.5, 4.5, 7.5, 10.5}, 1e-8);
    const auto slips = times_of(run.events, EventKind::slip);
    ASSERT_FALSE(slips.empty());
    EXPECT_NEAR(slips[0], std::asin(0.8), 1e-8);
}

// --- several events at one instant ---

TEST(Phases, ASlipAndAnImpactAtOneInstantBothHappen)
{
    const Slider<3> system{.f = fall_under_load, .friction = 2, .own = {elastic_floor()}};
    const auto run = run_of(system, Three{0, 2, 0}, until(3));
    expect_end(run, Three{0.5, 1.5, 1});
    expect_times(times_of(run.events, 1), {2});
    expect_times(times_of(run.events, EventKind::slip), {2});
}

TEST(Phases, AStickAndAnImpactAtOneInstantBothHappen)
{
    const Slider<3> system{.f = fall, .own = {elastic_floor()}};
    const auto run = run_of(system, Three{1, 0.5, 0}, until(2));
    expect_end(run, Three{0, 0.5, 0});
    expect_times(times_of(run.events, 1), {1});
    expect_times(times_of(run.events, EventKind::stick), {1});
}

TEST(Phases, ASlipAnImpactAndATimeEventAtOneInstantAllHappen)
{
    const Slider<3> system{
        .f = fall_under_load, .friction = 2, .own = {elastic_floor()}, .next = once(2)};
    const auto run = run_of(system, Three{0, 2, 0}, until(3));
    expect_end(run, Three{0.5, 1.5, 1});
    expect_times(times_of(run.events, 1), {2});
    expect_times(times_of(run.events, EventKind::time), {2});
}

TEST(Phases, ATimeEventKicksTheHeldBlock)
{
    const Slider<3> system{
        .f = fall, .own = {elastic_floor()}, .next = once(2), .kick = [](double, Three& x) {
            x[0] = 0.5;
        }};
    const auto run = run_of(system, Three{1, 1.125, 0}, until(4));
    expect_end(run, Three{0, 0.625, -1});
    expect_times(times_of(run.events, 1), {1.5});
    expect_times(times_of(run.events, EventKind::stick), {1, 2.5});
    // A reset that sets it in motion is no slip of the reaction's own, but the reaction lets go.
    expect_times(times_of(run.events, EventKind::slip), {2});
}

// From 1 with the rate 1/2 - 1: 1 - u/2 at u, where it changes its sign; with the rate 3/2 it comes
// to rest after another (1 - u/2) / (3/2). With short steps the reset lies in a step that does not
// reach zero by itself.
TEST(Phases, AResetThatCarriesASlidingSpeedAcrossZeroIsNoArrival)
{
    const auto load = [](double, const One&, One& dxdt) { dxdt = {0.5}; };
    const auto turn = [](double, One& x) { x[0] = -x[0]; };
    for (const double at : {0.3, 0.5, 1.1}) {
        const OwnGuard<1> mark{{}, [=](double t, const One&) { return at - t; }, turn};
        const Slider<1> by_guard{.f = load, .own = {mark}};
        const Slider<1> by_time{.f = load, .next = once(at), .kick = turn};
        for (const Slider<1>& system : {by_guard, by_time}) {
            for (const double h_max : {never, 0.01}) {
                Options options = until(3);
                options.h_max = h_max;
                const auto run = run_of(system, One{1}, options);
                expect_end(run, One{0});
                expect_times(times_of(run.events, EventKind::stick), {at + (1 - at / 2) / 1.5});
            }
        }
    }
}

TEST(Phases, ATimeEventAtWhichTheFrictionDropsReleasesTheBlock)
{
    struct Drops : Slider<1> {
        struct Dropping : Motion {
            [[nodiscard]] static sets::Box<1> reaction_set(double t, const Vector&)
            {
                const double bound = t < 1 ? 2 : 0.5;
                return sets::Box<1>({-bound}, {bound});
            }
        };
        void flow(double t, const State& x, State& dxdt) const
        {
            const double bound = t < 1 ? 2 : 0.5;
            dxdt[0] = 1 - (x[0] >= 0 ? bound : -bound);
        }
        [[nodiscard]] Dropping set_valued() const { return {{this}}; }
    };
    const Drops system{{.f = [](double, const One&, One& dxdt) { dxdt[0] = 1; }, .next = once(1)}};
    const auto run = run_of(system, One{0}, until(2));
    expect_end(run, One{0.5});
    expect_times(times_of(run.events, EventKind::time), {1});
    expect_times(times_of(run.events, EventKind::slip), {1});
}

// --- motions that a wall or another body changes ---

void carry(double, const Two& x, Two& dxdt)
{
    dxdt = {0, x[0]};
}

/// A belt of 1/2 m/s carries the block into a wall at 1 m, which returns it with 1.5 times its
/// speed; it slides back, sticks after 1.25 s at 0.84375 m, and so on.
[[nodiscard]] Slider<2> belt_and_wall()
{
    return {.f = carry,
            .belt = 0.5,
            .own = {{bounding(), [](double, const Two& x) { return 1 - x[1]; },
                     [](double, Two& x) { x[0] = -1.5 * x[0]; }}}};
}

TEST(Phases, ABeltCarriesABlockIntoAWallAgainAndAgain)
{
    const auto run = run_of(belt_and_wall(), Two{0.5, 0}, until(10));
    expect_end(run, Two{-0.5625, 0.876953125});
    std::vector<double> impacts;
    for (int k = 0; k < 6; ++k) impacts.push_back(2 + 1.5625 * k);
    expect_times(times_of(run.events, 1), impacts);
    std::vector<double> sticks;
    for (int k = 0; k < 5; ++k) sticks.push_back(3.25 + 1.5625 * k);
    expect_times(times_of(run.events, EventKind::stick), sticks);
}

TEST(Phases, ABeltCarriesABlockAcrossASection)
{
    const Slider<2> system{.f = carry,
                           .belt = 0.5,
                           .own = {{recorded(), [](double, const Two& x) { return x[1] - 0.7; }}}};
    const auto run = run_of(system, Two{0, 0}, until(4));
    expect_times(times_of(run.events, 1), {0.5 + 0.575 / 0.5});
}

/// Sliding speed, gap and speed of a ball that comes towards the block.
[[nodiscard]] Slider<3> struck_by_a_ball(double share)
{
    return {.f =
                [](double, const Three& x, Three& dxdt) {
                    dxdt = {0, x[0] - x[2], 0};
                },
            .own = {{bounding(), [](double, const Three& x) { return x[1]; },
                     [share](double, Three& x) {
                         const double v = x[0], u = x[2];
                         x[0] = (1 - share) * v + share * u;
                         x[2] = share * v + (1 - share) * u;
                     }}}};
}

TEST(Phases, ABallStrikesTheHeldBlock)
{
    const auto run = run_of(struck_by_a_ball(1), Three{0, 1, 1}, until(3));
    expect_end(run, Three{0, 0.5, 0});
    expect_times(times_of(run.events, 1), {1});
}

TEST(Phases, ABallStrikesTheBlockThatSlidesTowardsIt)
{
    const auto run = run_of(struck_by_a_ball(1), Three{-0.5, 1, 1}, until(3));
    expect_end(run, Three{0, 0.5, 0});
    expect_times(times_of(run.events, 1), {0.875});
}

TEST(Phases, ABallStrikesTheHeldBlockInelastically)
{
    const auto run = run_of(struck_by_a_ball(0.75), Three{0, 1, 1}, until(1.7));
    expect_end(run, Three{0.05, 0.75 * 0.7 - 0.245 - 0.25 * 0.7, 0.25});
}

TEST(Phases, AnOscillatorWithFrictionMeetsAStop)
{
    // From 2 m: u = 0.3 + 1.7 cos t until -1.2 m.
    const Slider<2> system{.f =
                               [](double, const Two& x, Two& dxdt) {
                                   dxdt = {-x[1], x[0]};
                               },
                           .friction = 0.3,
                           .own = {{bounding(), [](double, const Two& x) { return x[1] + 1.2; },
                                    [](double, Two& x) { x[0] = -x[0]; }}}};
    const auto run = run_of(system, Two{0, 2}, until(30));
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    const auto impacts = times_of(run.events, 1);
    ASSERT_FALSE(impacts.empty());
    EXPECT_NEAR(impacts[0], std::acos(-1.5 / 1.7), tolerance);
    EXPECT_EQ(run.x[0], 0);
    EXPECT_LE(std::fabs(run.x[1]), 0.3);
}

// --- a sliding mode ---

void swing(double t, const One&, One& dxdt)
{
    dxdt[0] = 1.75 * std::sin(50 * t);
}

TEST(Phases, AGuardOfTimeAloneCountsOnASlidingMode)
{
    const Slider<1> system{.f = swing,
                           .friction = 2,
                           .own = {{recorded(), [](double t, const One&) { return t - 0.25; }}}};
    const auto run = run_of(system, One{0.15}, until(0.5));
    expect_end(run, One{0}, 0);
    expect_times(times_of(run.events, 1), {0.25}, 1e-12);
}

TEST(Phases, ATimeEventThrowsTheStateOffASlidingMode)
{
    const Slider<1> system{
        .f = swing, .friction = 2, .next = once(0.3), .kick = [](double, One& x) { x[0] = 0.05; }};
    const auto run = run_of(system, One{0.15}, until(0.31));
    const double x = 0.05 - 2 * 0.01 + 0.035 * (std::cos(15.0) - std::cos(15.5));
    expect_end(run, One{x});
}

// --- where y is zero the inclusion decides ---

[[nodiscard]] Slider<1> loaded(std::function<double(double)> load)
{
    return {.f = [load = std::move(load)](double t, const One&, One& dxdt) { dxdt[0] = load(t); }};
}

TEST(Phases, TheInclusionDecidesAtTheStart)
{
    const auto end_of = [](const Slider<1>& system, double t_end) {
        return run_of(system, One{0}, until(t_end));
    };
    expect_end(end_of(loaded([](double) { return 1; }), 2), One{0}, 0);
    expect_end(end_of(loaded([](double t) { return 1 + t; }), 2), One{2});
    expect_end(end_of(loaded([](double t) { return 1 + t * t; }), 2), One{8.0 / 3});
    const auto drops = end_of(loaded([](double t) { return 1 - t; }), 3);
    expect_end(drops, One{-0.5});
    expect_times(times_of(drops.events, EventKind::slip), {2});
    const auto bends = end_of(loaded([](double t) { return 1 - t * t; }), 2);
    // From sqrt 2: w' = 2 - t^2.
    expect_end(bends, One{4 - 8.0 / 3 - std::sqrt(2.0) * (2 - 2.0 / 3)});
    expect_times(times_of(bends.events, EventKind::slip), {std::sqrt(2.0)});
}

TEST(Phases, AShortStickIsNotPassedOver)
{
    // w' = 2 t - 2 from 1 - d: sticks where t^2 - 2 t + 1 = d, slips at 1.
    const Slider<1> system = loaded([](double t) { return 2 * t - 1; });
    const double d = 1e-5;
    const auto run = run_of(system, One{1 - d}, until(2));
    expect_end(run, One{1});
    expect_times(times_of(run.events, EventKind::stick), {1 - std::sqrt(d)}, 1e-8);
    expect_times(times_of(run.events, EventKind::slip), {1});
}

TEST(Phases, AMotionThroughZeroIsOneEvent)
{
    // w' = -3 above zero, -1 below.
    const auto run = run_of(loaded([](double) { return -2; }), One{1}, until(1));
    expect_end(run, One{-2.0 / 3});
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_EQ(run.events[0].kind, EventKind::mode);
    EXPECT_EQ(run.events[0].guard, 0U);
    EXPECT_EQ(run.events[0].reaction, 0U);
    EXPECT_NEAR(run.events[0].t, 1.0 / 3, tolerance);
}

TEST(Phases, TimeEventsThatDoNothingLeaveTheMotion)
{
    // w' = t - 3 from 1/2 as above; the load is t.
    Slider<1> system = loaded([](double t) { return t; });
    system.friction = 3;
    const auto plain = run_of(system, One{0.5}, until(6));
    system.next = every(0.1);
    const auto ticking = run_of(system, One{0.5}, until(6));
    expect_end(plain, One{4.5});
    expect_end(ticking, One{4.5});
    expect_times(times_of(ticking.events, EventKind::stick), {3 - std::sqrt(8.0)});
    expect_times(times_of(ticking.events, EventKind::slip), {3});
    EXPECT_EQ(times_of(ticking.events, EventKind::time).size(), 60U);
}

TEST(Phases, ALoadThatIsGoneAtATimeEventReleasesNothing)
{
    // It reaches the bound at the tick at which it ends.
    Slider<1> system = loaded([](double t) { return t < 1 ? t : 0; });
    system.next = once(1);
    const auto run = run_of(system, One{0}, until(2));
    expect_end(run, One{0}, 0);
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_EQ(run.events[0].kind, EventKind::time);
}

TEST(Phases, AStickIsOneEventWhateverGuardsStandForIt)
{
    Slider<1> system = loaded([](double) { return 0; });
    system.own = {{recorded(), [](double, const One& x) { return 3 * x[0]; }}};
    const auto run = run_of(system, One{1}, until(2));
    expect_end(run, One{0}, 0);
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_EQ(run.events[0].kind, EventKind::stick);
    EXPECT_EQ(run.events[0].guard, 0U);
    EXPECT_EQ(run.statistics.events, 1U);
}

TEST(Phases, AResetThatOnlyCountsIsAskedOnce)
{
    int calls = 0;
    Slider<1> system = loaded([](double) { return 0; });
    GuardInfo counting = recorded();
    counting.resets = true;
    system.own = {
        {counting, [](double, const One& x) { return x[0]; }, [&](double, One&) { ++calls; }}};
    const auto run = integrate(system, {1}, until(2));
    expect_end(run, One{0}, 0);
    EXPECT_EQ(calls, 1);
    expect_end(run_of(system, One{1}, until(2)), One{0}, 0);
}

// --- what has nothing to do with the inclusion ---

TEST(Phases, AnAccumulationOfAnotherGuardEndsTheRunAsInAnySystem)
{
    // The block slides until 10; the bounces of the ball, with restitution 1/2, end at 4.5.
    const Slider<3> system{.f = fall,
                           .own = {{bounding(), [](double, const Three& x) { return x[1]; },
                                    [](double, Three& x) { x[2] = -0.5 * x[2]; }}}};
    const auto run = integrate(system, {10, 1.125, 0}, until(6));
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_EQ(run.guard, 1U);
    EXPECT_NEAR(run.t, 4.5, 1e-6);
    EXPECT_NEAR(run.x[1], 0, 1e-9);
    EXPECT_NEAR(run.x[0], 5.5, 1e-6);
}

TEST(Phases, AnAccumulationOfAnotherGuardEndsTheRunWhileTheBlockIsHeld)
{
    const Slider<3> system{.f = fall,
                           .own = {{bounding(), [](double, const Three& x) { return x[1]; },
                                    [](double, Three& x) { x[2] = -0.5 * x[2]; }}}};
    const auto run = integrate(system, {1, 1.125, 0}, until(6));
    EXPECT_EQ(run.outcome, Outcome::zeno);
    EXPECT_NEAR(run.t, 4.5, 1e-6);
    EXPECT_EQ(run.x[0], 0);
}

TEST(Phases, AnExceptionOfTheFlowPassesUnchanged)
{
    const Slider<3> system{.f =
                               [](double t, const Three& x, Three& dxdt) {
                                   if (t > 1.2) throw std::invalid_argument("table ends at 1.2 s");
                                   dxdt = {0, x[2], -1};
                               },
                           .own = {elastic_floor()}};
    EXPECT_EQ(refusal([&] {
                  (void)integrate(system, {1, 1.125, 0}, until(3));
              }),
              "table ends at 1.2 s");
}

// --- what ends a run, and what it shows ---

TEST(Phases, StopAfterCountsWhileABlockIsHeld)
{
    OwnGuard<3> floor = elastic_floor();
    floor.info.stop_after = 2;
    const Slider<3> system{.f = fall, .own = {floor}};
    const auto run = run_of(system, Three{1, 1.125, 0}, until(6));
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_EQ(run.guard, 1U);
    EXPECT_NEAR(run.t, 4.5, tolerance);
}

TEST(Phases, StopAtEventStopsAtASlip)
{
    Options options = until(6);
    options.stop_at_event = true;
    Slider<1> system = loaded([](double t) { return t; });
    const auto run = run_of(system, One{0}, options);
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 1, tolerance);
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_EQ(run.events[0].kind, EventKind::slip);
}

TEST(Phases, SamplesAreThoseOfTheWholeMotion)
{
    Options options = until(3);
    options.sample_times = {0.5, 1.25, 1.5, 2.5};
    options.record_steps = true;
    const Slider<3> system{.f = fall, .own = {elastic_floor()}};
    const auto run = run_of(system, Three{1, 1.125, 0}, options);
    ASSERT_EQ(run.trajectory.x.size(), 4U);
    EXPECT_NEAR(run.trajectory.x[0][0], 0.5, tolerance);
    EXPECT_NEAR(run.trajectory.x[1][1], 1.125 - 0.78125, tolerance);
    EXPECT_NEAR(run.trajectory.x[2][1], 0, tolerance);
    EXPECT_NEAR(run.trajectory.x[3][1], 1, tolerance);
    EXPECT_NEAR(run.solution(1.25)[1], 1.125 - 0.78125, tolerance);
    EXPECT_NEAR(run.solution(2.5)[1], 1, tolerance);
}

TEST(Phases, AdvanceShowsEventsOfAllPhases)
{
    const Slider<3> system{.f = fall, .own = {elastic_floor()}};
    Simulation simulation(system, Three{1, 1.125, 0}, until(3));
    std::vector<double> shown;
    while (simulation.advance()) shown.push_back(simulation.t());
    expect_times(shown, {1, 1.5});
    EXPECT_EQ(simulation.mode(), 0U);
}

TEST(Phases, ASimulationGoesOnFromASnapshotWithTheSameBits)
{
    const auto expect_same = [](const auto& system, const auto& x0, const Options& options) {
        Simulation whole(system, x0, options);
        while (whole.step()) {
        }
        EXPECT_EQ(end_by_snapshots(system, x0, options), whole.x());
        const auto run = integrate(system, x0, options);
        for (std::size_t i = 0; i < x0.size(); ++i) EXPECT_NEAR(run.x[i], whole.x()[i], 1e-9) << i;
    };
    expect_same(belt_and_wall(), Two{0.5, 0}, until(10));
    expect_same(Slider<3>{.f = fall_under_load, .friction = 3, .own = {elastic_floor()}},
                Three{0.5, 1.125, 0}, until(6));
    expect_same(Slider<1>{.f = swing, .friction = 2, .next = every(0.01)}, One{0.15}, until(0.5));
}

TEST(Phases, ASimulationGoesOnAfterAnExceptionWithTheSameBits)
{
    bool throws = false;
    const Slider<3> system{.f =
                               [&](double t, const Three& x, Three& dxdt) {
                                   if (throws && t > 1.6) {
                                       throws = false;
                                       throw std::runtime_error("once");
                                   }
                                   dxdt = {t, x[2], -1};
                               },
                           .friction = 3,
                           .own = {elastic_floor()}};
    const Three x0{0.5, 1.125, 0};
    Simulation whole(system, x0, until(6));
    while (whole.step()) {
    }
    throws = true;
    Simulation broken(system, x0, until(6));
    int exceptions = 0;
    for (bool goes_on = true; goes_on;) {
        try {
            goes_on = broken.step();
        } catch (const std::runtime_error&) {
            ++exceptions;
        }
    }
    EXPECT_EQ(exceptions, 1);
    EXPECT_EQ(broken.x(), whole.x());
}

TEST(Phases, ARestartDecidesAsAStart)
{
    const Slider<3> system{.f = fall, .own = {elastic_floor()}};
    Simulation simulation(system, Three{1, 1.125, 0}, until(3));
    while (simulation.t() < 1.2) ASSERT_TRUE(simulation.step());
    simulation.restart(1.2, Three{0, 0.5, 0});
    while (simulation.step()) {
    }
    // It falls for a second, and rises for 0.8.
    EXPECT_EQ(simulation.x()[0], 0);
    EXPECT_NEAR(simulation.x()[1], 0.8 - 0.32, tolerance);
}

/// The block is held from 1 s on.
[[nodiscard]] auto held_block(const Slider<3>& system)
{
    auto simulation = std::make_unique<Simulation<Slider<3>>>(system, Three{1, 1.125, 0}, until(3));
    while (simulation->t() < 1.8) EXPECT_TRUE(simulation->step());
    return simulation;
}

TEST(Phases, ASimulationListsThemAsTheyBegin)
{
    const Slider<3> system{.f = fall, .own = {elastic_floor()}};
    const auto simulation = held_block(system);
    const std::vector<MotionPhase>& phases = simulation->run().phases;
    ASSERT_EQ(phases.size(), 2U);
    EXPECT_NEAR(phases[1].from, 1, tolerance);
    EXPECT_EQ(phases[1].cause, PhaseCause::held);
    EXPECT_EQ(simulation->take().phases.size(), 2U);
}

TEST(Phases, ARestartDropsThoseAfterIt)
{
    const Slider<3> system{.f = fall, .own = {elastic_floor()}};
    const auto simulation = held_block(system);
    simulation->restart(1.5, Three{2, 0.5, 0});
    const auto run = simulation->take();
    ASSERT_EQ(run.phases.size(), 3U);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::held);
    EXPECT_EQ(run.phases[2].from, 1.5);
    EXPECT_EQ(run.phases[2].cause, PhaseCause::start);
    EXPECT_FALSE(run.phases[2].set_valued);
}

TEST(Phases, ARefusedRestartOrSnapshotLeavesThem)
{
    const Slider<3> system{.f = fall, .own = {elastic_floor()}};
    const auto simulation = held_block(system);
    // Behind the floor.
    EXPECT_NE(refusal([&] { simulation->restart(0.5, Three{2, -1, 0}); }), "accepted");
    Snapshot start = Simulation(system, Three{1, 1.125, 0}, until(3)).save();
    start.numbers.push_back(0);
    EXPECT_NE(refusal([&] { simulation->restore(start); }), "accepted");
    EXPECT_EQ(simulation->run().phases.size(), 2U);
}

TEST(Phases, AnyMethodOfTheLibraryFollowsThem)
{
    const auto run = integrate(belt_and_wall(), {0.5, 0}, until(10), ErrorControlled<Fehlberg78>{});
    expect_end(run, Two{-0.5625, 0.876953125});
}

TEST(Phases, OptionsAreRefusedInTheNameOfIntegrate)
{
    const Slider<1> system = loaded([](double) { return 1; });
    const std::string sentence = "integrate: rtol must lie in [0, 1), got -1";
    EXPECT_EQ(refusal([&] { (void)integrate(system, {1}, {.t_end = 1, .rtol = -1}); }), sentence);
    EXPECT_EQ(refusal([&] { Simulation(system, {1}, {.t_end = 1, .rtol = -1}); }), sentence);
}

TEST(Phases, BackwardRunsAreRefused)
{
    const Slider<1> system = loaded([](double) { return 1; });
    EXPECT_NE(refusal([&] { (void)integrate(system, {1}, until(-1)); }), "accepted");
}

/// Two masses on springs, with friction of combinations of their speeds, and a kick at 1.1.
struct CoupledMasses {
    using State = std::array<double, 4>;
    struct Friction {
        static constexpr int state_size = 4, reaction_size = 2;
        using W = Eigen::Vector4d;
        static void smooth(double t, const W& w, W& f)
        {
            f << w[1], std::sin(3 * t) - 2 * w[0] + w[2], w[3], std::cos(2 * t) - 3 * w[2] + w[0];
        }
        static void observe(Eigen::Matrix<double, 2, 4>& e) { e << 0, 1, 0, 0.4, 0, -0.3, 0, 1; }
        [[nodiscard]] static sets::Box<2> reaction_set(double, const W&)
        {
            return sets::Box<2>({-1, -0.7}, {1, 0.7});
        }
    };
    static void flow(double t, const State& x, State& dxdt)
    {
        Friction::W f;
        Friction::smooth(t, Friction::W(x.data()), f);
        const double r0 = x[1] + 0.4 * x[3] >= 0 ? -1 : 1, r1 = x[3] - 0.3 * x[1] >= 0 ? -0.7 : 0.7;
        dxdt = {f[0], f[1] + r0 - 0.3 * r1, f[2], f[3] + 0.4 * r0 + r1};
    }
    static double next_time_event(double t)
    {
        return t < 1.1 ? 1.1 : std::numeric_limits<double>::infinity();
    }
    static void time_reset(double, State& x) { x[1] += 0.1; }
    static Friction set_valued() { return {}; }
};

template <class Method>
void expect_the_same_bits_from_every_step(const Method& method)
{
    using Run = Simulation<CoupledMasses, CoupledMasses::State, Method>;
    for (const double speed : {0.9, 0.4, -0.3}) {
        const CoupledMasses::State x0{0, speed, 0.2, -0.5};
        const auto whole = integrate(CoupledMasses{}, x0, until(6), method);
        Run simulation(CoupledMasses{}, x0, until(6), method);
        while (simulation.step()) {
            Run next(CoupledMasses{}, x0, until(6), method);
            next.restore(simulation.save());
            while (next.advance()) {
            }
            EXPECT_EQ(next.x(), whole.x) << speed << ' ' << simulation.t();
        }
    }
}

TEST(Phases, SnapshotsGiveTheSameBitsFromEveryStep)
{
    expect_the_same_bits_from_every_step(ErrorControlled<Fehlberg78>{});
    expect_the_same_bits_from_every_step(ErrorControlled<Dopri5>{});
}

}  // namespace
}  // namespace ricochet::phases_test
