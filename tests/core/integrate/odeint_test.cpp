#include "ricochet/odeint.hpp"

#include <gtest/gtest.h>

#include <array>
#include <boost/numeric/odeint/algebra/array_algebra.hpp>
#include <boost/numeric/odeint/stepper/euler.hpp>
#include <boost/numeric/odeint/stepper/modified_midpoint.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4_classic.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_cash_karp54_classic.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "ricochet/integrate.hpp"
#include "step_of.hpp"
#include "walled_oscillator.hpp"

namespace ricochet::odeint_test {
namespace {

namespace odeint = boost::numeric::odeint;
using X = std::array<double, 2>;
using test::WalledOscillator;

template <class Method>
using StepOf = test::StepOf<Method, WalledOscillator, X>;

/// Three components that depend on one another and on the time.
struct Tangle {
    template <class State>
    void flow(double t, const State& x, State& dxdt) const
    {
        dxdt[0] = x[1] * std::cos(t) + 0.1 * x[2];
        dxdt[1] = -std::sin(x[0]) + 0.3 * x[1] * x[2];
        dxdt[2] = std::exp(-x[2] * x[2]) - t * x[0];
    }
};

template <class State>
void expect_equal_to(double tolerance, const State& ours, const State& theirs)
{
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(ours[i], theirs[i], tolerance);
}

/// Steps of random lengths from random states, forward and backward, with all their results.
///
/// Ours add the newest rate last, and so round differently. With |x| <= 10 and |t| <= 5 the rates
/// are below 90 and their derivatives below 11; a step of at most 0.05 changes a state by at most
/// 4.5 and a perturbation by a factor below two. Each of up to 13 stages rounds its state, below
/// 15, a few times, and a tableau's coefficients reach 12: 13 * 4 * 12 ulps of 15 (1.8e-15) are
/// 1.1e-12 in the state, and 11 times as much in the rate.
template <class Ours, template <class...> class Theirs, class State>
void expect_steps_of_odeint(State x)
{
    const double of_state = 1.1e-12, of_rate = 11 * of_state;
    const Tangle system;
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int k = 0; k < 500 && !testing::Test::HasFailure(); ++k) {
        for (std::size_t i = 0; i < 3; ++i) x[i] = 10 * uniform(random);
        const double t = 5 * uniform(random);
        const double h = std::exp(3 * uniform(random) - 6);
        test::StepOf<Ours, Tangle, State> ours(system, t, x, 0, k % 2 == 1);
        test::StepOf<Odeint<Theirs>, Tangle, State> theirs(system, t, x, 0, k % 2 == 1);
        if constexpr (detail::has_error_estimate<typename Ours::template Stepper<State>>) {
            const double error = ours.attempt(h, 1e-8, 1e-8);
            const double their_error = theirs.attempt(h, 1e-8, 1e-8);
            // Over 1e-8 (1 + |x|); the estimates are sums like the states.
            EXPECT_NEAR(error, their_error, of_state / 1e-8);
        } else {
            ours.attempt(h);
            theirs.attempt(h);
        }
        expect_equal_to(of_state, ours.x1(), theirs.x1());
        expect_equal_to(of_rate, ours.rate1(), theirs.rate1());
        auto at = detail::core_state(x);
        auto there = at, rate = at, their_rate = at;
        for (const double s : {0.3 * h, 0.77 * h}) {
            ours.interpolate(s, at);
            theirs.interpolate(s, there);
            expect_equal_to(of_state, at, there);
            ours.restep(s, at, rate);
            theirs.restep(s, there, their_rate);
            expect_equal_to(of_state, at, there);
            expect_equal_to(of_rate, rate, their_rate);
        }
        EXPECT_EQ(ours.flow_calls(), theirs.flow_calls());
    }
}

template <class State>
void expect_all_steps_of_odeint(const State& x)
{
    expect_steps_of_odeint<Euler, odeint::euler>(x);
    expect_steps_of_odeint<Rk4, odeint::runge_kutta4_classic>(x);
    expect_steps_of_odeint<CashKarp54, odeint::runge_kutta_cash_karp54_classic>(x);
    expect_steps_of_odeint<Dopri5, odeint::runge_kutta_dopri5>(x);
    expect_steps_of_odeint<Fehlberg78, odeint::runge_kutta_fehlberg78>(x);
}

TEST(Odeint, OurMethodsTakeTheStepsOfItsSteppers)
{
    expect_all_steps_of_odeint(std::array<double, 3>{});
    expect_all_steps_of_odeint(std::vector<double>(3));
}

TEST(Odeint, ItsOtherOneStepMethodsWork)
{
    const WalledOscillator oscillator;
    StepOf<Odeint<odeint::modified_midpoint>> step(oscillator, 0, {1.0, 0.0});
    step.attempt(0.01);
    EXPECT_NEAR(step.x1()[0], std::cos(0.01), 1e-8);
}

TEST(Odeint, ManySamplesOfItsSteppersAreOnTheDenseOutputLikeThoseOfOurs)
{
    struct Oscillator {
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -x[0]}; }
    };
    Options options{.t_end = 20, .rtol = 1e-10, .atol = 1e-12};
    for (int k = 0; k < 500; ++k) options.sample_times.push_back(0.04 * k);
    const X x0 = {1.0, 0.0};
    const auto ours = integrate(Oscillator{}, x0, options, ErrorControlled<Fehlberg78>{});
    const auto theirs = integrate(Oscillator{}, x0, options,
                                  ErrorControlled<Odeint<odeint::runge_kutta_fehlberg78>>{});
    EXPECT_EQ(theirs.statistics.flow_calls, ours.statistics.flow_calls);
    ASSERT_EQ(theirs.trajectory.x.size(), ours.trajectory.x.size());
    // The steps differ by rounding: some ulps of 1 in each of about two hundred. Samples by steps
    // of their own would differ by the error of the dense output, 1e-10.
    for (std::size_t i = 0; i < ours.trajectory.x.size(); ++i) {
        EXPECT_NEAR(theirs.trajectory.x[i][0], ours.trajectory.x[i][0], 2e-13);
        EXPECT_NEAR(theirs.trajectory.x[i][1], ours.trajectory.x[i][1], 2e-13);
    }
}

TEST(Odeint, ADepartureFromTheTangentIsTheSameStep)
{
    // The same step by odeint on the state itself; the two differ by rounding.
    const WalledOscillator oscillator;
    StepOf<Dopri5> ours(oscillator, 0, {1.0, 0.5});
    ours.attempt(0.3);
    odeint::runge_kutta_dopri5<X, double, X, double, odeint::array_algebra> theirs;
    X x = {1.0, 0.5};
    theirs.do_step([&](const X& at, X& dxdt, double t) { oscillator.flow(t, at, dxdt); }, x, 0.0,
                   0.3);
    EXPECT_NEAR(ours.x1()[0], x[0], 4e-16);
    EXPECT_NEAR(ours.x1()[1], x[1], 4e-16);
}

/// The explicit midpoint rule, with the minimum that odeint's Stepper concept requires; without the
/// time of its second stage it is for flows that do not depend on time.
template <bool timed>
struct MidpointRule {
    using stepper_category = odeint::stepper_tag;
    static constexpr unsigned short order() { return 2; }
    template <class System>
    void do_step(System system, X& x, double t, double dt)
    {
        X k;
        system(x, k, t);
        X middle = {x[0] + dt / 2 * k[0], x[1] + dt / 2 * k[1]};
        system(middle, k, timed ? t + dt / 2 : t);
        x = {x[0] + dt * k[0], x[1] + dt * k[1]};
    }
};
using Midpoint = MidpointRule<true>;
using TimelessMidpoint = MidpointRule<false>;

TEST(Odeint, AUsersOwnStepperNeedsOnlyTheStepInPlace)
{
    const WalledOscillator oscillator;
    StepOf<ThisStepper<Midpoint>> step(oscillator, 0, {1.0, 0.0});
    step.attempt(0.01);
    EXPECT_EQ(step.order(), 2);
    EXPECT_NEAR(step.x1()[0], 1 - 0.01 * 0.01 / 2, 1e-16);
    EXPECT_NEAR(step.x1()[1], -0.01, 1e-18);
}

/// Euler's method with a velocity that is ahead of the position.
struct SymplecticEuler {
    using stepper_category = odeint::stepper_tag;
    static constexpr unsigned short order() { return 1; }
    template <class System>
    void do_step(System system, X& x, double t, double dt)
    {
        X k;
        system(x, k, t);
        x[1] += dt * k[1];
        system(x, k, t);
        x[0] += dt * k[0];
    }
};

/// A method of order 4 that puts the state back on the unit circle.
struct Normalising {
    using stepper_category = odeint::stepper_tag;
    static constexpr unsigned short order() { return 4; }
    template <class System>
    void do_step(System system, X& x, double t, double dt)
    {
        odeint::runge_kutta4_classic<X>().do_step(system, x, t, dt);
        const double size = std::hypot(x[0], x[1]);
        x = {x[0] / size, x[1] / size};
    }
};

/// Heun's method, which keeps the rate at the end of a step for the next one.
struct Remembering {
    using stepper_category = odeint::stepper_tag;
    static constexpr unsigned short order() { return 2; }
    template <class System>
    void do_step(System system, X& x, double t, double dt)
    {
        if (first) system(x, k1, t);
        first = false;
        X k2;
        const X there = {x[0] + dt * k1[0], x[1] + dt * k1[1]};
        system(there, k2, t + dt);
        x = {x[0] + dt / 2 * (k1[0] + k2[0]), x[1] + dt / 2 * (k1[1] + k2[1])};
        system(x, k1, t + dt);
    }
    bool first = true;
    X k1{};
};

template <class Stepper>
std::string refusal_of_stepper()
{
    return refusal([] {
        (void)integrate(WalledOscillator(), X{1, 0}, {.t_end = 1, .step = 0.1},
                        FixedStep<ThisStepper<Stepper>>{});
    });
}

TEST(Odeint, AStepperThatTakesAnotherStepOfADepartureIsRefused)
{
    EXPECT_EQ(refusal_of_stepper<Midpoint>(), "accepted");
    EXPECT_EQ(refusal_of_stepper<odeint::modified_midpoint<X>>(), "accepted");
    EXPECT_EQ(refusal_of_stepper<odeint::runge_kutta_dopri5<X>>(), "accepted");
    EXPECT_NE(refusal_of_stepper<TimelessMidpoint>().find("time of every stage"),
              std::string::npos);
    EXPECT_NE(refusal_of_stepper<SymplecticEuler>().find("departures"), std::string::npos);
    EXPECT_NE(refusal_of_stepper<Normalising>().find("departures"), std::string::npos);
    EXPECT_NE(refusal_of_stepper<Remembering>().find("departures"), std::string::npos);
}

/// A state of run-time size that cannot be resized.
struct Unresizable {
    std::vector<double> components;
    [[nodiscard]] double& operator[](std::size_t i) { return components[i]; }
    [[nodiscard]] double operator[](std::size_t i) const { return components[i]; }
    [[nodiscard]] std::size_t size() const { return components.size(); }
};

struct Rotation {
    void flow(double, const Unresizable& x, Unresizable& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
};

TEST(Odeint, AStateThatItsSteppersCannotMakeIsRefused)
{
    const auto refused = refusal([] {
        (void)integrate(Rotation{}, Unresizable{{1, 0}}, {.t_end = 1, .step = 0.1},
                        FixedStep<Odeint<odeint::runge_kutta4_classic>>{});
    });
    EXPECT_NE(refused.find("resize"), std::string::npos) << refused;
    // The library's own methods need no state but the start.
    const auto run = integrate(Rotation{}, Unresizable{{1, 0}}, {.t_end = 1});
    EXPECT_NEAR(run.x[0], std::cos(1), 1e-7);
}

}  // namespace
}  // namespace ricochet::odeint_test
