// The implicit method: its steps, its Jacobians, and events on it.
#include "ricochet/rosenbrock.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "hosts/stiff_systems.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/simulation.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/pendulum.hpp"

namespace ricochet::rosenbrock_test {

namespace {

using hosts_test::BuckConverter;
using hosts_test::RobertsonValve;
using Stiff = ErrorControlled<Rosenbrock4>;

/// x' = -50 (x - cos t), y' = x.
struct Following {
    using State = std::array<double, 2>;
    template <class X>
    void flow(const ScalarOf<X>& t, const X& x, X& dxdt) const
    {
        using std::cos;
        dxdt[0] = -50 * (x[0] - cos(t));
        dxdt[1] = x[0];
    }
};

// The numbers are those of boost::numeric::odeint::rosenbrock4<double>::do_step and calc_state with
// exact Jacobians (Boost 1.74). Sums are formed in another order: a few units in the last place of
// the terms, which are up to a hundred times an increment. (Where the flow depends on the time,
// odeint's method is of order 1: its d4 has the wrong sign.)
TEST(Rosenbrock, StepsAreThoseOfOdeint)
{
    const auto robertson =
        integrate(RobertsonValve{}, {0.7, 1e-5, 0.3},
                  {.t_end = 0.01, .step = 0.01, .record_steps = true}, FixedStep<Rosenbrock4>{});
    const std::array<double, 3> end{0.69997840292293623, 8.7805883730295991e-06,
                                    0.30002281648869072};
    const std::array<double, 3> inside{0.69999273710713938, 7.8927851334415763e-06,
                                       0.30000937010772716};
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(robertson.x[i], end[i], 1e-15 * end[i]);
        EXPECT_NEAR(robertson.solution(0.004)[i], inside[i], 1e-14 * inside[i]);
    }
}

template <class System>
double observed_order(const System& system, const typename System::State& x0)
{
    const auto by = [&](auto stepping, double h) {
        return integrate(system, x0, {.t_end = 2, .step = h}, stepping).x;
    };
    const auto exact = by(FixedStep<Fehlberg78>{}, 0.002);
    const auto error = [&](double h) {
        const auto x = by(FixedStep<Rosenbrock4>{}, h);
        return std::hypot(x[0] - exact[0], x[1] - exact[1]);
    };
    return std::log2(error(0.02) / error(0.01));
}

TEST(Rosenbrock, IsOfOrderFourAlsoInTime)
{
    EXPECT_NEAR(observed_order(Pendulum(), {1, 0}), 4, 0.15);
    EXPECT_NEAR(observed_order(ImpactOscillator({.frequency = 3, .wall = 10}), {0.3, 0}), 4, 0.15);
    // Stiff, and driven: the order is reduced towards that of the stages.
    EXPECT_GE(observed_order(Following{}, {0, 1}), 2.5);
}

// A difference must change a component whose units in the last place are longer than the reach of
// a short one.
TEST(Rosenbrock, DifferencesAreTakenInComponentsOfAnySize)
{
    struct Decay {
        using State = std::array<double, 2>;
        void flow(double, const State& x, State& dxdt) const { dxdt = {-x[0], 0}; }
    };
    for (const double size : {1e-300, 1.0, 1e14, 1e16, 1e100, 1e300}) {
        const auto run = integrate(Decay{}, {size, -std::numeric_limits<double>::max()},
                                   {.t_end = 1, .rtol = 1e-8, .atol = 0}, Stiff{});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << size;
        EXPECT_NEAR(run.x[0] / size, std::exp(-1), 1e-6) << size;
    }
}

/// The flow of the valve for doubles alone.
struct OfDoubles {
    using State = RobertsonValve::State;
    static constexpr std::size_t mode_count = 2;
    static constexpr std::size_t guard_count = 2;
    RobertsonValve valve;
    void flow(Mode mode, double t, const State& y, State& rate) const
    {
        valve.flow(mode, t, y, rate);
    }
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& y) const
    {
        return valve.guard(which, mode, t, y);
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const
    {
        return valve.enabled(which, mode);
    }
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double t, State& y) const
    {
        return valve.reset(which, mode, t, y);
    }
};

struct WithJacobian : OfDoubles {
    void jacobian(Mode, double, const State& y, std::span<double> rows) const
    {
        const double back1 = 1e4 * y[2], back2 = 1e4 * y[1], fast = 6e7 * y[1];
        const std::array<double, 9> j{-0.04, back1, back2, 0.04, -back1 - fast, -back2, 0, fast, 0};
        std::ranges::copy(j, rows.begin());
    }
};

template <class System>
auto run_valve(const System& system, double rtol)
{
    return integrate(system, {1.0, 0.0, 0.0}, {.t_end = 2000, .rtol = rtol, .atol = 1e-4 * rtol},
                     Stiff{});
}

// With error control at rtol a method of order 4 has global errors of some rtol here.
TEST(Rosenbrock, RobertsonsValveOpensAndClosesToTheTolerance)
{
    const auto exact = run_valve(RobertsonValve{}, 1e-10);
    ASSERT_EQ(exact.outcome, Outcome::reached_end);
    ASSERT_EQ(exact.events.size(), 16u);
    for (const double rtol : {1e-5, 1e-7}) {
        const auto run = run_valve(RobertsonValve{}, rtol);
        ASSERT_EQ(run.events.size(), exact.events.size());
        for (std::size_t k = 0; k < run.events.size(); ++k) {
            EXPECT_NEAR(run.events[k].t, exact.events[k].t, rtol * exact.events[k].t);
            EXPECT_EQ(run.events[k].mode_after, exact.events[k].mode_after);
        }
    }
}

TEST(Rosenbrock, TheJacobianIsWrittenOrByDualsOrByDifferences)
{
    const auto duals = run_valve(RobertsonValve{}, 1e-6);
    const auto written = run_valve(WithJacobian{}, 1e-6);
    const auto differences = run_valve(OfDoubles{}, 1e-6);
    ASSERT_EQ(written.events.size(), duals.events.size());
    ASSERT_EQ(differences.events.size(), duals.events.size());
    for (std::size_t k = 0; k < duals.events.size(); ++k) {
        const double t = duals.events[k].t;
        EXPECT_NEAR(written.events[k].t, t, 1e-11 * t);  // the order of sums
        EXPECT_NEAR(differences.events[k].t, t, 1e-6 * t);
    }
    EXPECT_EQ(written.statistics.steps, duals.statistics.steps);
    EXPECT_LT(duals.statistics.flow_calls, differences.statistics.flow_calls);
}

TEST(Rosenbrock, TheBuckConverterSwitches)
{
    const auto run_to = [](double rtol) {
        return integrate(BuckConverter{}, {0.0, 0.0, 0.0},
                         {.t_end = 25.5 * BuckConverter::half_period,
                          .mode = BuckConverter::switched_on,
                          .rtol = rtol,
                          .atol = 10 * rtol},
                         Stiff{});
    };
    const auto exact = run_to(1e-9);
    const auto run = run_to(1e-6);
    ASSERT_EQ(exact.events.size(), 50u);  // 25 switchings, and the diode after each
    ASSERT_EQ(run.events.size(), 50u);
    for (std::size_t k = 0; k < 50; ++k) {
        EXPECT_NEAR(run.events[k].t, exact.events[k].t, 1e-6 * exact.events[k].t);
        EXPECT_EQ(run.events[k].mode_after, exact.events[k].mode_after);
    }
}

TEST(Rosenbrock, ASnapshotGoesOnWithTheSameBits)
{
    const RobertsonValve valve;
    const Options options{.t_end = 300, .rtol = 1e-6, .atol = 1e-10};
    const std::array<double, 3> x0{1, 0, 0};
    Simulation whole(valve, x0, options, Stiff{});
    for (int k = 0; k < 60; ++k) whole.step();
    const Snapshot snapshot = snapshot_from_text(to_text(whole.save()));
    Simulation other(valve, x0, options, Stiff{});
    other.restore(snapshot);
    whole.run_to_end([](const auto&) {});
    other.run_to_end([](const auto&) {});
    EXPECT_EQ(whole.x(), other.x());
    EXPECT_EQ(whole.t(), other.t());
}

// Between steps the solution is a cubic: the fourth derivative, which is one here, leaves h^4 / 30,
// or 3e-8 for steps of 0.03.
TEST(Rosenbrock, SamplesAndSolutionAreThoseOfTheMotion)
{
    std::vector<double> times;
    for (int k = 1; k < 40; ++k) times.push_back(0.1 * k);
    const auto run = integrate(
        Following{}, {0.0, 1.0},
        {.t_end = 4, .rtol = 1e-7, .atol = 1e-9, .record_steps = true, .sample_times = times},
        Stiff{});
    ASSERT_EQ(run.trajectory.t.size(), times.size());
    for (std::size_t k = 0; k < times.size(); ++k) {
        const double t = times[k];
        const double exact =
            (2500 * std::cos(t) + 50 * std::sin(t) - 2500 * std::exp(-50 * t)) / 2501;
        EXPECT_NEAR(run.trajectory.x[k][0], exact, 1e-6);
        EXPECT_NEAR(run.solution(t)[0], exact, 1e-6);
    }
}

/// Times evenly spaced in (0, t_end), which no step is likely to end at.
std::vector<double> sample_times(double t_end, std::size_t count)
{
    std::vector<double> times;
    for (std::size_t k = 0; k < count; ++k) {
        times.push_back(t_end * (static_cast<double>(k) + 0.63) / static_cast<double>(count));
    }
    return times;
}

/// log2 of the ratio of the largest errors of samples with steps h and h / 2.
template <class System>
double observed_order_of_samples(const System& system, const typename System::State& x0, double h)
{
    const std::vector<double> times = sample_times(2, 200);
    const auto by = [&](auto stepping, double step) {
        return integrate(system, x0, {.t_end = 2, .step = step, .rtol = 1, .sample_times = times},
                         stepping)
            .trajectory.x;
    };
    const auto exact = by(FixedStep<Fehlberg78>{}, 0.002);
    const auto error = [&](double step) {
        const auto x = by(FixedStep<Rosenbrock4>{}, step);
        double worst = 0;
        for (std::size_t k = 0; k < times.size(); ++k) {
            worst = std::max(worst, std::hypot(x[k][0] - exact[k][0], x[k][1] - exact[k][1]));
        }
        return worst;
    };
    return std::log2(error(h) / error(h / 2));
}

TEST(Rosenbrock, SamplesAreOfOrderFour)
{
    EXPECT_NEAR(observed_order_of_samples(Pendulum(), {1, 0}, 0.05), 4, 0.2);
    EXPECT_NEAR(
        observed_order_of_samples(ImpactOscillator({.frequency = 3, .wall = 10}), {0.3, 0}, 0.02),
        4, 0.2);
}

/// x' = -rate (x - cos t).
struct Drawn {
    using State = std::array<double, 1>;
    double rate;
    template <class X>
    void flow(const ScalarOf<X>& t, const X& x, X& dxdt) const
    {
        using std::cos;
        dxdt[0] = -rate * (x[0] - cos(t));
    }
    [[nodiscard]] double exact(double t, double x0) const
    {
        const double d = 1 + rate * rate;
        return (rate * rate * std::cos(t) + rate * std::sin(t)) / d +
               (x0 - rate * rate / d) * std::exp(-rate * t);
    }
};

// Steps that end at the samples are wrong by up to 9 tolerances here, where the order of a method
// is reduced in stiff components, and the cubic of a step by up to 28 000.
TEST(Rosenbrock, SamplesOfStiffComponentsAreAsAccurateAsSteps)
{
    std::vector<double> times = sample_times(4, 200);
    for (const double rate : {1.0, 50.0, 1e4, 1e6}) {
        for (const double x0 : {1.0, 0.0}) {
            for (const double rtol : {1e-3, 1e-5, 1e-7}) {
                const Drawn system{rate};
                const auto run = integrate(
                    system, {x0}, {.t_end = 4, .rtol = rtol, .atol = rtol, .sample_times = times},
                    Stiff{});
                ASSERT_EQ(run.trajectory.t.size(), times.size());
                for (std::size_t k = 0; k < times.size(); ++k) {
                    EXPECT_NEAR(run.trajectory.x[k][0], system.exact(times[k], x0), 10 * rtol)
                        << rate << ' ' << x0 << ' ' << rtol << ' ' << times[k];
                }
            }
        }
    }
}

// A decay by 1e4 a second from 1 to 0 in a first step of any length; samples lie in it.
TEST(Rosenbrock, SamplesFollowATransient)
{
    const Drawn system{1e4};
    std::vector<double> times;
    for (int k = 1; k <= 60; ++k) times.push_back(1e-6 * std::pow(1.2, k));
    for (const double rtol : {1e-2, 1e-4, 1e-6}) {
        const auto run =
            integrate(system, {0.0},
                      {.t_end = 1, .rtol = rtol, .atol = rtol, .sample_times = times}, Stiff{});
        for (std::size_t k = 0; k < times.size(); ++k) {
            EXPECT_NEAR(run.trajectory.x[k][0], system.exact(times[k], 0), 4 * rtol) << times[k];
        }
    }
}

// A step with samples takes one call of the flow more, and each sample one; without a
// factorization, and without a call for the Jacobian, which is of the step.
TEST(Rosenbrock, SamplesCostACallEach)
{
    const Options options{.t_end = 4, .rtol = 1e-6, .atol = 1e-6};
    Options sampled = options;
    sampled.sample_times = sample_times(4, 300);
    const auto run = integrate(Drawn{50}, {0.9}, options, Stiff{});
    const auto with = integrate(Drawn{50}, {0.9}, sampled, Stiff{});
    EXPECT_EQ(run.x, with.x);
    EXPECT_EQ(run.statistics.steps, with.statistics.steps);
    EXPECT_LE(with.statistics.flow_calls,
              run.statistics.flow_calls + run.statistics.steps + sampled.sample_times.size());
    EXPECT_EQ(with.statistics.resteps, 0u);
}

// A sample at the end of a step is that end.
TEST(Rosenbrock, ASampleAtTheEndHasItsBits)
{
    const auto run =
        integrate(Pendulum(), {1.0, 0.0},
                  {.t_end = 1.5, .rtol = 1e-6, .sample_times = {0.3, 0.7, 1.5}}, Stiff{});
    ASSERT_EQ(run.trajectory.x.size(), 3u);
    EXPECT_EQ(run.trajectory.x[2], run.x);
    const std::vector<double> x{1, 0};
    const auto large = integrate(
        Pendulum(), x, {.t_end = 1.5, .rtol = 1e-6, .sample_times = {0.3, 0.7, 1.5}}, Stiff{});
    for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t i = 0; i < 2; ++i) {
            EXPECT_EQ(run.trajectory.x[k][i], large.trajectory.x[k][i]);
        }
    }
}

TEST(Rosenbrock, SamplesBackwardAreThoseOfTheMotion)
{
    const Drawn slow{1};
    const double x = slow.exact(3, 0.5);
    const auto run = integrate(slow, {x},
                               {.t_start = 3,
                                .t_end = 0,
                                .rtol = 1e-7,
                                .atol = 1e-7,
                                .sample_times = {2.71, 2.03, 1.13, 0.77, 0.31, 0}},
                               Stiff{});
    ASSERT_EQ(run.trajectory.x.size(), 6u);
    for (std::size_t k = 0; k < 6; ++k) {  // errors grow by e^3 = 20
        EXPECT_NEAR(run.trajectory.x[k][0], slow.exact(run.trajectory.t[k], 0.5), 1e-5);
    }
}

/// x follows 1 + 0.2 sin t at a rate of 1e4, and is moved 1 away from it every second.
struct Kicked {
    using State = std::array<double, 2>;
    static constexpr std::size_t guard_count = 2;
    double level = 0;
    bool acts = false;
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.crossing = Crossing::either, .resets = acts && which == 0};
    }
    template <class X>
    void flow(const ScalarOf<X>& t, const X& x, X& dxdt) const
    {
        using std::sin;
        dxdt[0] = -1e4 * (x[0] - 1 - 0.2 * sin(t));
        dxdt[1] = x[0];
    }
    template <class X>
    [[nodiscard]] ScalarOf<X> guard(std::size_t which, const ScalarOf<X>&, const X& x) const
    {
        return which == 0 ? x[0] - level : x[1] - 4;
    }
    void reset(std::size_t, double, State& x) const { x[0] = 1; }
    [[nodiscard]] double next_time_event(double t) const { return std::floor(t + 1e-9) + 1; }
    void time_reset(double, State& x) const { x[0] += 1; }
};

// The motion stays above 0.8 and never reaches 0.5; the interpolant of a step that is longer than
// the transient does, since it swings by 0.94 to the other side of 1 + 0.2 sin t. The motion is at
// 1.5 twice each second: when it is moved up, and on its way back, unless an event takes it back at
// the same instant.
TEST(Rosenbrock, TransientsShorterThanAStepHaveNoEventsOfTheirOwn)
{
    for (const bool acts : {false, true}) {
        for (const double rtol : {1e-2, 1e-3, 1e-4, 1e-6}) {
            for (const double level : {0.5, 1.5}) {
                const auto run = integrate(Kicked{level, acts}, {1.0, 0.0},
                                           {.t_end = 7.5, .rtol = rtol, .atol = rtol}, Stiff{});
                ASSERT_EQ(run.outcome, Outcome::reached_end);
                std::size_t crossed = 0;
                for (const auto& event : run.events) crossed += event.guard == 0;
                EXPECT_EQ(crossed, level < 1 ? 0u : acts ? 7u : 14u) << rtol << ' ' << acts;
                EXPECT_LT(run.statistics.steps, 1500u) << rtol << ' ' << acts;
            }
        }
    }
}

// There and back, each way with an error of some rtol; the turning points are reached again.
/// x'' = -x.
struct Turning {
    using State = std::array<double, 2>;
    template <class X>
    void flow(const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
};

TEST(Rosenbrock, StepsWhoseCubesUnderflowAreTaken)
{
    // The first step is as short as the tolerance of the component that starts at zero: down to
    // 1e-190 s. The motion is (cos t, -sin t), by a relative tolerance of 1e-8 of each of some
    // hundred steps.
    for (const double size : {1.0, 1e100, 1e120, 1e150, 1e290}) {
        for (const double atol : {1e-10, 1e-200}) {
            const auto run =
                integrate(Turning{}, {size, 0}, {.t_end = 1, .rtol = 1e-8, .atol = atol}, Stiff{});
            ASSERT_EQ(run.outcome, Outcome::reached_end) << size << ", " << atol;
            EXPECT_NEAR(run.x[0] / size, std::cos(1.0), 1e-6) << size << ", " << atol;
            EXPECT_NEAR(run.x[1] / size, -std::sin(1.0), 1e-6) << size << ", " << atol;
        }
    }
}

TEST(Rosenbrock, RunsBackward)
{
    const Options options{.t_end = 5, .rtol = 1e-9, .atol = 1e-11};
    const auto there = integrate(Pendulum(), {1.0, 0.0}, options, Stiff{});
    const auto back = integrate(Pendulum(), there.x,
                                {.t_start = 5, .t_end = 0, .rtol = 1e-9, .atol = 1e-11}, Stiff{});
    EXPECT_NEAR(back.x[0], 1, 1e-6);
    EXPECT_NEAR(back.x[1], 0, 1e-6);
    ASSERT_GE(there.events.size(), 4u);
    EXPECT_NEAR(back.events[0].t, there.events.back().t, 1e-7);
    // f depends on the time: its derivative by the time keeps its sign.
    const auto following =
        integrate(Following{}, {0.5, 1.0},
                  {.t_start = 0.1, .t_end = 0, .rtol = 1e-9, .atol = 1e-11}, Stiff{});
    const auto again =
        integrate(Following{}, following.x, {.t_end = 0.1, .rtol = 1e-9, .atol = 1e-11}, Stiff{});
    EXPECT_NEAR(again.x[0], 0.5, 1e-6);
}

/// Heat along a rod: stiffer with every component.
struct Rod {
    static constexpr bool resets = false;
    template <class X>
    void flow(const ScalarOf<X>&, const X& x, X& dxdt) const
    {
        using S = ScalarOf<X>;
        const auto n = static_cast<std::size_t>(x.size());
        const auto at = [&](std::size_t i) { return static_cast<decltype(x.size())>(i); };
        for (std::size_t i = 0; i < n; ++i) {
            const S left = i > 0 ? S(x[at(i - 1)]) : S(0);
            const S right = i + 1 < n ? S(x[at(i + 1)]) : S(0);
            dxdt[at(i)] = 1e3 * (left - 2 * x[at(i)] + right) + x[at(i)] * x[at(i)];
        }
    }
    template <class X>
    [[nodiscard]] ScalarOf<X> guard(const ScalarOf<X>&, const X& x) const
    {
        return x[2] - 0.5;
    }
};

TEST(Rosenbrock, StatesOfAllTypesHaveTheSameBits)
{
    const Options options{.t_end = 0.02, .rtol = 1e-7, .atol = 1e-9};
    const std::array<double, 6> x0{1, 1, 1, 1, 1, 1};
    const auto a = integrate(Rod{}, x0, options, Stiff{});
    const auto v = integrate(Rod{}, std::vector<double>(6, 1.0), options, Stiff{});
    const auto e = integrate(Rod{}, Eigen::VectorXd(Eigen::VectorXd::Ones(6)), options, Stiff{});
    const auto f = integrate(
        Rod{}, Eigen::Matrix<double, 6, 1>(Eigen::Matrix<double, 6, 1>::Ones()), options, Stiff{});
    ASSERT_EQ(a.events.size(), 1u);
    ASSERT_EQ(v.events.size(), 1u);
    EXPECT_EQ(a.events[0].t, v.events[0].t);
    EXPECT_EQ(a.events[0].t, e.events[0].t);
    EXPECT_EQ(a.events[0].t, f.events[0].t);
    for (std::size_t i = 0; i < 6; ++i) {
        EXPECT_EQ(a.x[i], v.x[i]);
        EXPECT_EQ(a.x[i], e.x[static_cast<Eigen::Index>(i)]);
        EXPECT_EQ(a.x[i], f.x[static_cast<Eigen::Index>(i)]);
    }
    const auto explicit_run = integrate(Rod{}, x0, options, ErrorControlled<Dopri5>{});
    EXPECT_NEAR(a.events[0].t, explicit_run.events[0].t, 1e-8);
}

}  // namespace

}  // namespace ricochet::rosenbrock_test
