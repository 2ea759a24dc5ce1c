#include "ricochet/taylor/taylor.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/systems/impact_oscillator.hpp"

namespace ricochet::taylor_test {
namespace {

using Two = std::array<double, 2>;
using Four = std::array<double, 4>;
constexpr double pi = std::numbers::pi;

struct Ball {
    using State = Two;
    static constexpr bool unilateral = true;
    double gravity = 9.81;  ///< [m/s²]
    double restitution = 0.9;

    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -gravity;
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return x[0];
    }
    void reset(double /*t*/, State& x) const
    {
        x[0] = 0;
        x[1] *= -restitution;
    }
};

TEST(Taylor, ImpactsOfABallAreThoseOfTheGeometricSeries)
{
    // Between impacts the polynomial of degree 2 is the motion; the errors are the roundings of
    // times and of the velocity at each of 13 impacts, of half a unit in the last place each: times
    // up to 19 s, 3.6e-15, velocities up to 14 m/s that shift all later impacts by 2 v eps / g.
    const Ball ball;
    const auto run =
        integrate(ball, Two{10, 0}, {.t_end = 20.5, .rtol = 1e-12}, ErrorControlled<Taylor>{});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 13U);
    long double t = std::sqrt(20 / static_cast<long double>(ball.gravity));
    long double flight = 2 * t;
    for (const auto& event : run.events) {
        EXPECT_NEAR(event.t, static_cast<double>(t), 5e-15);
        flight *= ball.restitution;
        t += flight;
    }
    EXPECT_LT(run.statistics.steps, 20U);  // one for each flight, and some at the start
    EXPECT_EQ(run.statistics.rejected, 0U);
}

/// As `ImpactOscillator`, written for any scalar.
struct Impact {
    using State = Two;
    static constexpr bool unilateral = true;
    double frequency = 0.8, wall = 1, restitution = 0.8, damping = 0.1;

    template <class S>
    constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::cos;
        dxdt[0] = x[1];
        dxdt[1] = cos(frequency * t) - x[0] - damping * x[1];
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return wall - x[0];
    }
    [[nodiscard]] double guard_rate(double /*t*/, const State& /*x*/, const State& dxdt) const
    {
        return -dxdt[0];
    }
    void reset(double /*t*/, State& x) const
    {
        x[0] = wall;
        x[1] *= -restitution;
    }
};

TEST(Taylor, ImpactsOfBallsFromAThousandHeightsAreThoseOfTheGeometricSeries)
{
    for (int k = 0; k < 1000; ++k) {
        const double height = 9.5 + 1e-3 * k;
        const Ball ball;
        const auto run =
            integrate(ball, Two{height, 0}, {.t_end = 20.5, .rtol = 1e-12, .atol = 1e-12},
                      ErrorControlled<Taylor>{});
        long double t = std::sqrt(2 * static_cast<long double>(height) / ball.gravity);
        long double flight = 2 * t;
        for (const auto& event : run.events) {
            ASSERT_NEAR(event.t, static_cast<double>(t), 2e-14) << height;
            t += flight *= ball.restitution;
        }
    }
}

/// A quadrature of a polynomial: the motion is of degree 3.
struct Cubic {
    using State = std::array<double, 1>;
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 1>& /*x*/, std::array<S, 1>& dxdt) const
    {
        dxdt[0] = (3.0 * t + 12.0) * t - 4.0;
    }
};

TEST(Taylor, AMotionThatIsAPolynomialIsOneStepWhateverItsDegree)
{
    // x = (t + 6) (t + 2) (t - 2), of terms up to 12^3, each of which is rounded.
    for (const double rtol : {1e-6, 1e-15}) {
        const auto run =
            integrate(Cubic{}, Cubic::State{-120}, {.t_start = -8, .t_end = 4, .rtol = rtol},
                      ErrorControlled<Taylor>{});
        EXPECT_NEAR(run.x[0], 120, 4 * 1728 * 1.2e-16);
        EXPECT_LE(run.statistics.steps, 3U);
    }
}

TEST(Taylor, EveryImpactOfAForcedOscillatorIsFoundToTheRoundingOfItsTime)
{
    for (const double wall : {1.0, 1.2}) {
        const Impact system{.wall = wall};
        const ImpactOscillator closed({.frequency = 0.8, .wall = wall, .restitution = 0.8});
        const double t_end = 100 * closed.period();
        const std::vector<double> impacts = closed.impacts(t_end);
        for (const double rtol : {1e-8, 1e-10, 1e-12, 2e-16}) {
            const auto run =
                integrate(system, Two{0, 0}, {.t_end = t_end, .rtol = rtol, .atol = rtol},
                          ErrorControlled<Taylor>{});
            ASSERT_EQ(run.events.size(), impacts.size());
            // The motion is stable, so that errors of steps do not add up; at a slow
            // impact, an error of the position is divided by its velocity, 0.2 at least. A unit in
            // the last place of times up to 785 is 1.1e-13.
            const double tolerance = std::max(10 * rtol, 2.3e-13);
            for (std::size_t i = 0; i < impacts.size(); ++i) {
                EXPECT_NEAR(run.events[i].t, impacts[i], tolerance) << "impact " << i;
            }
        }
        // Over a thousand periods no error is larger than 1e-12, a unit of the last times; the
        // first ten impacts are found to a unit of theirs.
        const double far = 1000 * closed.period();
        const std::vector<double> all = closed.impacts(far);
        for (const double rtol : {1e-12, 2e-16}) {
            const auto run =
                integrate(system, Two{0, 0}, {.t_end = far, .rtol = rtol, .atol = rtol},
                          ErrorControlled<Taylor>{});
            ASSERT_EQ(run.events.size(), all.size());
            for (std::size_t i = 0; i < all.size(); ++i) {
                ASSERT_NEAR(run.events[i].t, all[i], 1e-12) << "impact " << i;
            }
            for (std::size_t i = 0; i < 10 && rtol < 1e-12; ++i) {
                EXPECT_NEAR(run.events[i].t, all[i], wall == 1 ? 7.2e-15 : 1.5e-14);
            }
        }
    }
}

struct Pendulum {
    using State = Two;
    static constexpr bool resets = false;
    double ratio = 1;  ///< g / l [1/s²]
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::sin;
        dxdt[0] = x[1];
        dxdt[1] = -ratio * sin(x[0]);
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return x[0];
    }
};

TEST(Taylor, PendulumReturnsAfterThePeriodOfTheEllipticIntegral)
{
    // The period is 4 K(sin(amplitude / 2)); the angle falls through 0 after a quarter of it, and
    // then once a period. Errors of 1e-16 a step grow with the time, and some 30 steps are taken a
    // period.
    const double period = 4 * static_cast<double>(std::comp_ellint_1l(std::sin(1.0L)));
    const auto run =
        integrate(Pendulum{}, Two{2, 0}, {.t_end = 20 * period, .rtol = 1e-15, .atol = 1e-15},
                  ErrorControlled<Taylor>{});
    ASSERT_EQ(run.events.size(), 20U);
    for (std::size_t i = 0; i < 20; ++i) {
        EXPECT_NEAR(run.events[i].t, (static_cast<double>(i) + 0.25) * period, 1e-12);
    }
    EXPECT_NEAR(run.x[0], 2, 1e-12);
    EXPECT_NEAR(run.x[1], 0, 1e-12);
}

TEST(Taylor, ParametersAreThoseOfTheObject)
{
    // Four times the stiffness is half the period.
    const double period = 2 * static_cast<double>(std::comp_ellint_1l(std::sin(0.5L)));
    const auto run =
        integrate(Pendulum{.ratio = 4}, Two{1, 0}, {.t_end = period, .rtol = 1e-14, .atol = 1e-14},
                  ErrorControlled<Taylor>{});
    EXPECT_NEAR(run.x[0], 1, 1e-13);
    EXPECT_NEAR(run.x[1], 0, 1e-13);
}

TEST(Taylor, FixedStepsConvergeWithTheOrder)
{
    // The error of a step is the first omitted term, of order 1 / (p + 1)!, in h^(p+1). Half the
    // step has 2^-p of the error. Steps of a quarter and an eighth of the radius of convergence
    // still show the next terms, so that the slope is found to one half.
    const double t_end = 4;
    const auto reference =
        integrate(Pendulum{}, Two{2, 0}, {.t_end = t_end, .rtol = 1e-16, .atol = 1e-16},
                  ErrorControlled<Taylor>{});
    for (const int order : {12, 16, 20}) {
        const auto error = [&](double h) {
            const auto run = integrate(Pendulum{}, Two{2, 0}, {.t_end = t_end, .step = h},
                                       FixedStep<Taylor>{{.order = order}});
            return std::hypot(run.x[0] - reference.x[0], run.x[1] - reference.x[1]);
        };
        const double coarse = error(1), fine = error(0.5);
        EXPECT_NEAR(std::log2(coarse / fine), order, 0.15 * order) << coarse << ", " << fine;
    }
}

struct HenonHeiles {
    using State = Four;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = -x[0] - 2.0 * x[0] * x[1];
        dxdt[3] = x[1] * x[1] - x[1] - x[0] * x[0];
    }
    [[nodiscard]] static double energy(const State& x)
    {
        return 0.5 * (x[2] * x[2] + x[3] * x[3] + x[0] * x[0] + x[1] * x[1]) + x[0] * x[0] * x[1] -
               x[1] * x[1] * x[1] / 3;
    }
};

TEST(Taylor, HenonHeilesKeepsItsEnergyAndComesBack)
{
    // Energy 1/12, where the motion is regular, so that errors grow with the time alone: 250 steps
    // of some 1e-16.
    const Four x0{0, 0.1, std::sqrt(1.0 / 6 - 0.01 + 2e-3 / 3), 0};
    const Options there{.t_end = 100, .rtol = 1e-16, .atol = 1e-16};
    const auto out = integrate(HenonHeiles{}, x0, there, ErrorControlled<Taylor>{});
    EXPECT_NEAR(HenonHeiles::energy(out.x), HenonHeiles::energy(x0), 1e-15);
    Options back = there;
    back.t_start = 100;
    back.t_end = 0;
    const auto home = integrate(HenonHeiles{}, out.x, back, ErrorControlled<Taylor>{});
    for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(home.x[i], x0[i], 1e-13);
}

struct Kepler {
    using State = Four;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 4>& x, std::array<S, 4>& dxdt) const
    {
        using std::sqrt;
        const S r2 = x[0] * x[0] + x[1] * x[1];
        const S r3 = r2 * sqrt(r2);
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = -x[0] / r3;
        dxdt[3] = -x[1] / r3;
    }
};

TEST(Taylor, AnEccentricOrbitClosesAndItsSolutionIsThatOfKeplersEquation)
{
    const double e = 0.9;
    const Four x0{1 - e, 0, 0, std::sqrt((1 + e) / (1 - e))};
    const auto run = integrate(
        Kepler{}, x0, {.t_end = 2 * pi, .rtol = 1e-15, .atol = 1e-16, .record_steps = true},
        ErrorControlled<Taylor>{});
    // The velocity at the start, 4.36, turns an error of the period into one of the position, and
    // an error of the energy at the pericentre into one of the period: 3 pi a dE, with dE = v dv of
    // some roundings of 1e-15.
    for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(run.x[i], x0[i], 1e-11) << i;
    // t = E - e sin E, x = cos E - e, y = sqrt(1 - e^2) sin E; inside the steps, too.
    for (int k = 0; k <= 200; ++k) {
        const double anomaly = 2 * pi * k / 200;
        const Four x = run.solution(anomaly - e * std::sin(anomaly));
        EXPECT_NEAR(x[0], std::cos(anomaly) - e, 1e-12) << k;
        EXPECT_NEAR(x[1], std::sqrt(1 - e * e) * std::sin(anomaly), 1e-12) << k;
    }
}

/// Decays in mode 0, grows in mode 1; switches at both ends of [1, 2], and at whole times.
struct Heater {
    using State = std::array<double, 1>;
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 2;
    double decay = 1, growth = 0.5;

    template <class S>
    constexpr void flow(Mode mode, const S& /*t*/, const std::array<S, 1>& x,
                        std::array<S, 1>& dxdt) const
    {
        if (mode == 0) {
            dxdt[0] = -decay * x[0];
        } else {
            dxdt[0] = growth * (4.0 - x[0]);
        }
    }
    [[nodiscard]] double guard(std::size_t which, double /*t*/, const State& x) const
    {
        return which == 0 ? x[0] - 1 : 2 - x[0];
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const { return which == mode; }
    Mode reset(std::size_t which, Mode /*mode*/, double /*t*/, State& /*x*/) const
    {
        return which == 0 ? 1 : 0;
    }
};

TEST(Taylor, EachModeHasItsOwnFlow)
{
    // From 2 to 1 in log 2 / decay, from 1 to 2 in log(3 / 2) / growth.
    const Heater heater{.decay = 2, .growth = 0.25};
    const auto run =
        integrate(heater, Heater::State{2}, {.t_end = 10, .rtol = 1e-14, .atol = 1e-14},
                  ErrorControlled<Taylor>{});
    const double down = std::log(2.0) / 2, up = std::log(1.5) / 0.25;
    double t = 0;
    ASSERT_GE(run.events.size(), 8U);
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        t += i % 2 == 0 ? down : up;
        EXPECT_NEAR(run.events[i].t, t, 1e-13);
        EXPECT_EQ(run.events[i].guard, i % 2);
    }
}

/// Kicked at every whole time.
struct Kicked {
    using State = Two;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    [[nodiscard]] double next_time_event(double t) const { return std::floor(t) + 1; }
    [[nodiscard]] double previous_time_event(double t) const { return std::ceil(t) - 1; }
    void time_reset(double /*t*/, State& x) const { x[1] += 1; }
};

TEST(Taylor, TimeEventsInterruptTheSteps)
{
    // A rotation by 1 and a kick, ten times, including the last kick, at the end of the run.
    Two x{1, 0};
    for (int k = 0; k < 10; ++k) {
        x = {std::cos(1.0) * x[0] + std::sin(1.0) * x[1],
             std::cos(1.0) * x[1] - std::sin(1.0) * x[0] + 1};
    }
    auto run = integrate(Kicked{}, Two{1, 0}, {.t_end = 10.25, .rtol = 1e-14, .atol = 1e-14},
                         ErrorControlled<Taylor>{});
    EXPECT_EQ(run.events.size(), 10U);
    EXPECT_NEAR(run.x[0], std::cos(0.25) * x[0] + std::sin(0.25) * x[1], 1e-13);
    EXPECT_NEAR(run.x[1], std::cos(0.25) * x[1] - std::sin(0.25) * x[0], 1e-13);
    // Backward in time kicks are applied unchanged: (rotate back by 1, kick) from 0.5 to -0.5.
    run = integrate(Kicked{}, Two{1, 0},
                    {.t_start = 0.5, .t_end = -0.5, .rtol = 1e-14, .atol = 1e-14},
                    ErrorControlled<Taylor>{});
    const double c = std::cos(0.5), s = std::sin(0.5);
    const Two kicked{c, s + 1};
    EXPECT_NEAR(run.x[0], c * kicked[0] - s * kicked[1], 1e-13);
    EXPECT_NEAR(run.x[1], c * kicked[1] + s * kicked[0], 1e-13);
}

/// Six oscillators of different frequencies: more components than the loop keeps in registers.
struct Six {
    static constexpr bool resets = false;
    static constexpr std::size_t n = 12;
    using State = std::array<double, n>;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, n>& x, std::array<S, n>& dxdt) const
    {
        for (std::size_t i = 0; i < n / 2; ++i) {
            const double frequency = 1.0 + 0.25 * static_cast<double>(i);
            dxdt[2 * i] = frequency * x[2 * i + 1];
            dxdt[2 * i + 1] = -frequency * x[2 * i];
        }
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, n>& x) const
    {
        return x[10];
    }
};

TEST(Taylor, StatesOfAnySizeAreIntegratedAndRecorded)
{
    Six::State x0{};
    for (std::size_t i = 0; i < 6; ++i) x0[2 * i] = 1;
    const auto run =
        integrate(Six{}, x0, {.t_end = 10, .rtol = 1e-14, .atol = 1e-14, .record_steps = true},
                  ErrorControlled<Taylor>{});
    for (const double t : {0.0, 0.1, 3.3, 7.7, 10.0}) {
        const Six::State x = run.solution(t);
        for (std::size_t i = 0; i < 6; ++i) {
            const double phase = (1.0 + 0.25 * static_cast<double>(i)) * t;
            EXPECT_NEAR(x[2 * i], std::cos(phase), 1e-13) << t;
            EXPECT_NEAR(x[2 * i + 1], -std::sin(phase), 1e-13) << t;
        }
    }
    // cos(2.25 t) falls through 0 at (pi / 2 + 2 pi k) / 2.25.
    ASSERT_EQ(run.events.size(), 4U);
    for (std::size_t k = 0; k < 4; ++k) {
        EXPECT_NEAR(run.events[k].t, (pi / 2 + 2 * pi * static_cast<double>(k)) / 2.25, 1e-14 * 10);
    }
}

TEST(Taylor, ARunThatIsSavedAndOneInSingleStepsHaveTheBitsOfOneInAPiece)
{
    const Impact system;
    const Options options{.t_end = 60, .rtol = 1e-12, .atol = 1e-12, .record_steps = true};
    const auto whole = integrate(system, Two{0, 0}, options, ErrorControlled<Taylor>{});
    Simulation first(system, Two{0, 0}, options, ErrorControlled<Taylor>{});
    for (int i = 0; i < 17; ++i) first.step();
    const Snapshot saved = first.save();
    Simulation second(system, Two{0, 0}, options, ErrorControlled<Taylor>{});
    second.restore(saved);
    while (second.step()) {
    }
    const auto resumed = second.take();
    Options plain = options;
    plain.record_steps = false;
    const auto in_a_piece = integrate(system, Two{0, 0}, plain, ErrorControlled<Taylor>{});
    EXPECT_EQ(whole.x, resumed.x);
    EXPECT_EQ(whole.x, in_a_piece.x);
    EXPECT_EQ(whole.statistics.steps, in_a_piece.statistics.steps);
    EXPECT_EQ(whole.statistics.guard_calls, in_a_piece.statistics.guard_calls);
    EXPECT_EQ(whole.statistics.flow_calls, in_a_piece.statistics.flow_calls);
    EXPECT_EQ(whole.events.size(), in_a_piece.events.size());
    EXPECT_EQ(whole.events.back().t, in_a_piece.events.back().t);
}

TEST(Taylor, ASnapshotKnowsTheOrderThatItsRunWasGiven)
{
    const Impact system;
    const Options options{.t_end = 60, .rtol = 1e-12, .atol = 1e-12};
    const auto of_order = [&](int order) {
        return Simulation(system, Two{0, 0}, options, ErrorControlled<Taylor>{{.order = order}});
    };
    auto first = of_order(16);
    for (int i = 0; i < 7; ++i) first.step();
    const Snapshot saved = first.save();
    auto same = of_order(16), other = of_order(20), by_tolerance = of_order(0);
    same.restore(saved);
    EXPECT_EQ(same.t(), first.t());
    EXPECT_THROW(other.restore(saved), std::invalid_argument);
    EXPECT_THROW(by_tolerance.restore(saved), std::invalid_argument);
}

/// A guard that fails once, after some calls.
struct Failing : Impact {
    mutable int left = -1;
    template <class S>
    [[nodiscard]] constexpr S guard(const S& t, const std::array<S, 2>& x) const
    {
        if constexpr (std::is_same_v<S, double>) {
            if (left >= 0 && left-- == 0) throw std::runtime_error("the guard fails");
        }
        return Impact::guard(t, x);
    }
};

TEST(Taylor, ARunGoesOnAfterAnExceptionWithTheBitsOfOneWithoutIt)
{
    const Options options{.t_end = 60, .rtol = 1e-12, .atol = 1e-12};
    const auto whole = integrate(Failing{}, Two{0, 0}, options, ErrorControlled<Taylor>{});
    for (const int calls : {10, 17, 23, 38, 51}) {
        const Failing system;
        Simulation simulation(system, Two{0, 0}, options, ErrorControlled<Taylor>{});
        system.left = calls;
        EXPECT_THROW(static_cast<void>(simulation.take()), std::runtime_error);
        const auto run = simulation.take();
        EXPECT_EQ(run.x, whole.x);
        EXPECT_EQ(run.statistics.steps, whole.statistics.steps);
        ASSERT_EQ(run.events.size(), whole.events.size());
        EXPECT_EQ(run.events.back().t, whole.events.back().t);
    }
}

struct Rooted {
    using State = std::array<double, 1>;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 1>& x, std::array<S, 1>& dxdt) const
    {
        dxdt[0] = x[0] * x[0];
    }
};

TEST(Taylor, StepsShrinkBeforeASingularityUntilTheyUnderflow)
{
    // x = 1 / (1 - t).
    const auto run =
        integrate(Rooted{}, Rooted::State{1}, {.t_end = 2, .rtol = 1e-12, .atol = 1e-12},
                  ErrorControlled<Taylor>{});
    EXPECT_TRUE(run.outcome == Outcome::step_underflow || run.outcome == Outcome::non_finite);
    EXPECT_NEAR(run.t, 1, 1e-12);
}

TEST(Taylor, WhatCannotBeExpandedIsRefusedBeforeTheRun)
{
    const auto run = [](const auto& system, const Taylor& method) {
        return integrate(system, Two{1, 0}, {.t_end = 1}, ErrorControlled<Taylor>{method});
    };
    EXPECT_THROW(static_cast<void>(run(Pendulum{std::numeric_limits<double>::quiet_NaN()}, {})),
                 std::invalid_argument);
    EXPECT_THROW(static_cast<void>(run(Pendulum{}, {.order = 14})), std::invalid_argument);
}

/// e^t meets 2, 3, ...: as many levels as the object says.
struct Levels {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;
    std::size_t levels = 2;

    [[nodiscard]] std::size_t guard_count() const { return levels; }
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 1>& x, std::array<S, 1>& dxdt) const
    {
        dxdt[0] = x[0];
    }
    template <class S>
    [[nodiscard]] S guard(std::size_t which, const S& /*t*/, const std::array<S, 1>& x) const
    {
        return 2 + static_cast<double>(which) - x[0];
    }
};

TEST(Taylor, GuardsThatTheObjectCountsAreSampled)
{
    for (const std::size_t levels : {0U, 1U, 4U}) {
        const auto run = integrate(Levels{levels}, {1.0}, {.t_end = 3, .rtol = 1e-12},
                                   ErrorControlled<Taylor>{});
        ASSERT_EQ(run.events.size(), levels);
        for (std::size_t k = 0; k < levels; ++k) {
            EXPECT_NEAR(run.events[k].t, std::log(2.0 + static_cast<double>(k)), 1e-12);
        }
    }
}

/// x'' = -x^degree beside a wall at 0, from which every flight starts with a series in
/// t^(degree + 1): its last two terms may vanish, whatever the length of the step.
template <int degree>
struct FlatBowl {
    using State = Two;
    static constexpr bool unilateral = true;

    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        using std::pow;
        dxdt[0] = x[1];
        dxdt[1] = -pow(x[0], degree);
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return x[0];
    }
    void reset(double /*t*/, State& x) const { x = {0, -x[1]}; }
};

template <int degree>
void expect_flights_of_one_energy()
{
    for (const double tolerance : {1e-6, 1e-9, 1e-13}) {
        const auto run = integrate(FlatBowl<degree>{}, Two{1, 0},
                                   {.t_end = 40, .rtol = tolerance, .atol = tolerance},
                                   ErrorControlled<Taylor>{});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << degree << ", " << tolerance;
        ASSERT_GE(run.events.size(), 8U);
        const double flight = 2 * run.events[0].t;
        for (std::size_t k = 0; k < run.events.size(); ++k) {
            const auto& event = run.events[k];
            EXPECT_NEAR(event.t, (static_cast<double>(k) + 0.5) * flight, 1e3 * tolerance);
            EXPECT_NEAR(event.after[1] * event.after[1] / 2, 1.0 / (degree + 1), 1e3 * tolerance);
        }
    }
}
TEST(Taylor, StepsAreRightWhereTheLastTermsVanishBySymmetry)
{
    expect_flights_of_one_energy<3>();
    expect_flights_of_one_energy<5>();
    expect_flights_of_one_energy<7>();
    expect_flights_of_one_energy<9>();
}

/// x' = cos(t^2), of which a step is requested that is too long.
struct Fresnel {
    using State = std::array<double, 1>;
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 1>& /*x*/, std::array<S, 1>& dxdt) const
    {
        using std::cos;
        dxdt[0] = cos(t * t);
    }
};

TEST(Taylor, FirstStepsAreShortenedWhereTheLastTermsVanishBySymmetry)
{
    const double exact = 0.702863557730269;  // the integral from 0 to 3
    for (const double tolerance : {1e-6, 1e-9, 1e-12}) {
        const auto run = integrate(Fresnel{}, Fresnel::State{0},
                                   {.t_end = 3, .step = 3, .rtol = tolerance, .atol = tolerance},
                                   ErrorControlled<Taylor>{});
        EXPECT_NEAR(run.x[0], exact, 10 * tolerance);
    }
}

/// x' = 1 - t^24, of whose series from t = 0 no term is kept but the first.
struct LateDecay {
    using State = std::array<double, 1>;
    template <class S>
    constexpr void flow(const S& t, const std::array<S, 1>& /*x*/, std::array<S, 1>& dxdt) const
    {
        using std::pow;
        dxdt[0] = 1.0 - pow(t, 24);
    }
};

TEST(Taylor, FirstStepsAreShortenedWhereNoTermThatIsKeptShowsTheFlow)
{
    const double exact = 1.5 - std::pow(1.5, 25) / 25;  // -1008.5
    for (const double tolerance : {1e-6, 1e-9, 1e-12}) {
        const auto run =
            integrate(LateDecay{}, LateDecay::State{0},
                      {.t_end = 1.5, .step = 1.5, .rtol = tolerance, .atol = tolerance},
                      ErrorControlled<Taylor>{});
        EXPECT_NEAR(run.x[0], exact, 100 * tolerance * std::fabs(exact));
    }
}

/// x' = -1 - root / 10, with the root as a power or as a cube root.
template <bool is_power>
struct ThirdPower {
    using State = std::array<double, 1>;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 1>& x, std::array<S, 1>& dxdt) const
    {
        using std::cbrt, std::pow;
        if constexpr (is_power) dxdt[0] = -1.0 - 0.1 * pow(x[0], 1.0 / 3);
        if constexpr (!is_power) dxdt[0] = -1.0 - 0.1 * cbrt(x[0]);
    }
};

TEST(Taylor, ThirdPowersOfNegativeNumbersAreNoCubeRoots)
{
    const Options options{.t_end = 3, .rtol = 1e-12, .atol = 1e-12};
    const auto power = integrate(ThirdPower<true>{}, {-0.5}, options, ErrorControlled<Taylor>{});
    EXPECT_EQ(power.outcome, Outcome::non_finite);
    EXPECT_EQ(integrate(ThirdPower<true>{}, {-0.5}, options).outcome, Outcome::non_finite);
    const auto root = integrate(ThirdPower<false>{}, {-0.5}, options, ErrorControlled<Taylor>{});
    const auto expected = integrate(ThirdPower<false>{}, {-0.5}, options);
    EXPECT_EQ(root.outcome, Outcome::reached_end);
    EXPECT_NEAR(root.x[0], expected.x[0], 1e-9);
}

/// x' = 1 - x^20, from x = 0.
struct HighPower {
    using State = std::array<double, 1>;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 1>& x, std::array<S, 1>& dxdt) const
    {
        using std::pow;
        dxdt[0] = 1.0 - pow(x[0], 20);
    }
};

TEST(Taylor, WholePowersOfZeroHaveASeries)
{
    const Options options{.t_end = 1.5, .rtol = 1e-12, .atol = 1e-12};
    const auto run = integrate(HighPower{}, {0.0}, options, ErrorControlled<Taylor>{});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], integrate(HighPower{}, {0.0}, options).x[0], 1e-10);
}

}  // namespace
}  // namespace ricochet::taylor_test
