// Runs with set-valued motion whose end is infinite: something else ends them.

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>

#include "phased_runs.hpp"
#include "refusal.hpp"

namespace ricochet::endless_phases_test {
namespace {

using One = std::array<double, 1>;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// A block at speed 1 under friction 1, and a guard of time with `stop_after` at t = 2.5.
Slider<1> stopping()
{
    OwnGuard<1> clock{.value = [](double t, const One&) { return 2.5 - t; }};
    clock.info.stop_after = 1;
    clock.info.resets = false;
    return {.f = [](double, const One&, One& dxdt) { dxdt[0] = 0; }, .own = {clock}};
}

Options endless()
{
    return {.t_end = infinity, .rtol = 1e-10, .atol = 1e-12, .h_max = 0.01};
}

TEST(EndlessPhases, AGuardEndsTheRunThroughAllDoors)
{
    const auto run = run_of(stopping(), One{1}, endless());
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 2.5, exact_motion);
    EXPECT_EQ(run.x[0], 0);
    expect_times(times_of(run.events, EventKind::stick), {1});
}

TEST(EndlessPhases, TheFirstEventEndsTheRun)
{
    Options options = endless();
    options.stop_at_event = true;
    const auto run = run_of(stopping(), One{1}, options);
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 1, exact_motion);
}

TEST(EndlessPhases, NothingThatCanEndTheRunIsRefused)
{
    Slider<1> system = stopping();
    system.own.clear();
    EXPECT_EQ(refusal([&] { (void)integrate(system, {1}, endless()); }),
              "integrate: t_end must be a finite time where nothing else may end the run, got inf; "
              "expected a guard with stop_after, stop_at_event, or max_steps, also beside a reset "
              "that ends the run");
}

TEST(EndlessPhases, AStepWithoutALengthIsRefused)
{
    Options options = endless();
    options.h_max = infinity;
    const std::string sentence =
        "integrate: found an infinite t_end and no h_max beside set-valued motion, whose steps are "
        "then no thousandth of the run; expected h_max, their length [s]";
    EXPECT_EQ(refusal([&] { (void)integrate(stopping(), {1}, options); }), sentence);
    EXPECT_EQ(refusal([&] { Simulation(stopping(), {1}, options); }), sentence);
    EXPECT_EQ(refusal([&] { (void)integrate(stopping(), {1}, {.t_end = std::nan("")}); }),
              "integrate: t_end must be no earlier than t_start, got nan");
}

TEST(EndlessPhases, StepsOfFixedLengthHaveOne)
{
    const Options options{.t_end = infinity, .step = 0.01};
    const auto run = integrate(stopping(), {1}, options, FixedStep<Rk4>{});
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 2.5, exact_motion);
    EXPECT_NEAR(run.x[0], 0, exact_motion);
}

TEST(EndlessPhases, ImplicitStepsGoOnUntilAGuardEndsThem)
{
    // Two contacts with bounds 1 and 3 hold the load t until t = 4; then x = (t - 4)^2 / 2.
    struct Watched : TwoContactsOnBelts {
        static std::size_t guard_count() { return 2; }
        static double guard(std::size_t i, double, const State& x)
        {
            return i == 0 ? x[0] : 0.5 - x[0];
        }
        static GuardInfo guard_info(std::size_t i)
        {
            if (i == 0) return TwoContacts::guard_info();
            GuardInfo info;
            info.resets = false;
            info.stop_after = 1;
            return info;
        }
    };
    const auto run = run_of(Watched{}, One{0}, endless());
    EXPECT_EQ(run.outcome, Outcome::stopped_by_event);
    EXPECT_NEAR(run.t, 5, 1e-3);  // the release lies within one step of order 2
    EXPECT_TRUE(run.phases.front().set_valued);
}

// --- an inclusion alone ---

/// w' = sin t - Sgn(w) / 2 in branches, or as a set that is no box.
struct Relay {
    static constexpr int state_size = 1, reaction_size = 1;
    using Vector = Eigen::Matrix<double, 1, 1>;
    static void smooth(double t, const Vector&, Vector& f) { f[0] = std::sin(t); }
    static sets::Box<1> reaction_set(double, const Vector&) { return sets::Box<1>({-0.5}, {0.5}); }
};
struct RelayBySteps : Relay {
    static sets::Ball<1> reaction_set(double, const Vector&) { return sets::Ball<1>(0.5); }
};

template <class System>
void expect_as_with_an_end(const System& system)
{
    HandOverOptions options{.t_end = 10, .sample_times = {1, 5, 9}};
    options.set_valued.step = 0.01;
    const Relay::Vector w0 = Relay::Vector::Constant(0.1);
    const auto ended = hand_over(system, w0, options);
    options.t_end = infinity;
    options.max_steps = 2000;
    const auto run = hand_over(system, w0, options);
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    EXPECT_GT(run.t, 10);
    ASSERT_EQ(run.trajectory.x.size(), 3U);
    for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(run.trajectory.x[k][0], ended.trajectory.x[k][0], 1e-7);
    }
}

TEST(EndlessPhases, AnInclusionAloneIsLimitedByItsSteps)
{
    expect_as_with_an_end(Relay{});
    expect_as_with_an_end(RelayBySteps{});
}

TEST(EndlessPhases, AnInclusionAloneEndsWhereItIsReleased)
{
    HandOverOptions options{.t_end = infinity, .until_released = true};
    options.set_valued.step = 0.01;
    const auto run = hand_over(Relay{}, Relay::Vector::Zero(), options);
    EXPECT_EQ(run.outcome, Outcome::released);
    EXPECT_NEAR(run.t, std::asin(0.5), 0.05);  // beyond, once y is clear of zero
}

TEST(EndlessPhases, AnInclusionAloneThroughIntegrateIsLimitedByTheCaller)
{
    const Relay::Vector w0 = Relay::Vector::Constant(0.1);
    const auto end_of = [&](const Options& options) {
        return integrate(RelayBySteps{}, w0, options).outcome;
    };
    const std::atomic<bool> cancelled = true;
    EXPECT_EQ(end_of({.t_end = infinity, .h_max = 0.01, .max_steps = 100}), Outcome::step_limit);
    EXPECT_EQ(end_of({.t_end = infinity, .h_max = 0.01, .cancelled = &cancelled}),
              Outcome::cancelled);
    EXPECT_NE(refusal([&] { (void)end_of({.t_end = infinity, .h_max = 0.01}); }), "accepted");
    EXPECT_NE(refusal([&] { (void)end_of({.t_end = infinity, .max_steps = 100}); }), "accepted");
}

TEST(EndlessPhases, AnInclusionAloneWithoutALengthOfStepsIsRefused)
{
    EXPECT_EQ(refusal([] {
                  (void)hand_over(Relay{}, Relay::Vector::Zero(),
                                  {.t_end = infinity, .max_steps = 10});
              }),
              "HandOverOptions: found an infinite t_end and no set_valued.step, which is then no "
              "thousandth of the run; expected the length [s] of the set-valued steps");
}

}  // namespace
}  // namespace ricochet::endless_phases_test
