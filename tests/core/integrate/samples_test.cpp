// Samples of a trajectory: their errors, and the calls of the flow that they cost.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ricochet/integrate.hpp"

namespace ricochet::samples_test {
namespace {

using X = std::array<double, 2>;

/// (cos t, -sin t) from (1, 0).
struct Oscillator {
    using State = X;
    void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], -x[0]}; }
};

/// The same, as a state that is sized at run time.
struct LargeOscillator {
    using State = std::vector<double>;
    void flow(double, const State& x, State& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
};

constexpr double t_end = 20;

std::vector<double> spread(std::size_t count)
{
    std::vector<double> times;
    for (std::size_t k = 1; k <= count; ++k) {
        times.push_back(t_end * static_cast<double>(k) / static_cast<double>(count + 1));
    }
    return times;
}

template <class X>
double error_at(double t, const X& x)
{
    return std::max(std::fabs(x[0] - std::cos(t)), std::fabs(x[1] + std::sin(t)));
}

template <class X>
double worst(const Run<X>& run)
{
    double error = 0;
    for (std::size_t k = 0; k < run.trajectory.t.size(); ++k) {
        error = std::max(error, error_at(run.trajectory.t[k], run.trajectory.x[k]));
    }
    return error;
}

template <class System, class Method>
void costs_no_more_than_dense_output(const Options& options, const Method& method)
{
    const System system;
    const typename System::State x0 = {1.0, 0.0};
    Options dense = options;
    dense.record_steps = true;
    const auto kept = integrate(system, x0, dense, method);
    for (const std::size_t count : {5u, 50u, 500u, 5000u}) {
        SCOPED_TRACE(count);
        Options sampled = options;
        sampled.sample_times = spread(count);
        const auto run = integrate(system, x0, sampled, method);
        ASSERT_EQ(run.trajectory.t.size(), count);
        EXPECT_EQ(run.x, kept.x);
        EXPECT_LE(static_cast<double>(run.statistics.flow_calls),
                  1.2 * static_cast<double>(kept.statistics.flow_calls));
        sampled.record_steps = true;
        const auto both = integrate(system, x0, sampled, method);
        EXPECT_EQ(both.x, kept.x);
        EXPECT_LE(static_cast<double>(both.statistics.flow_calls),
                  1.2 * static_cast<double>(kept.statistics.flow_calls));
        // Both follow the motion to the error of an accepted step, at most 1e-10 + 1e-12.
        for (std::size_t k = 0; k < count; ++k) {
            const auto on_solution = kept.solution(both.trajectory.t[k]);
            for (const std::size_t i : {0u, 1u}) {
                EXPECT_NEAR(both.trajectory.x[k][i], on_solution[i], 2.02e-10);
            }
        }
    }
}

TEST(Samples, CostNoMoreFlowCallsThanTheDenseOutput)
{
    const Options controlled{.t_end = t_end, .rtol = 1e-10, .atol = 1e-12};
    costs_no_more_than_dense_output<Oscillator>(controlled, ErrorControlled<Fehlberg78>{});
    costs_no_more_than_dense_output<Oscillator>(controlled, ErrorControlled<Dopri5>{});
    costs_no_more_than_dense_output<Oscillator>(controlled, ErrorControlled<CashKarp54>{});
    costs_no_more_than_dense_output<LargeOscillator>(controlled, ErrorControlled<Fehlberg78>{});
    costs_no_more_than_dense_output<Oscillator>({.t_end = t_end, .step = 0.5},
                                                FixedStep<Fehlberg78>{});
}

/// The error of the worst of 2000 samples with steps of length h.
template <class Method>
double error_with(double h, const Method& method)
{
    return worst(integrate(Oscillator{}, X{1.0, 0.0},
                           {.t_end = t_end, .step = h, .sample_times = spread(2000)}, method));
}

TEST(Samples, HaveTheOrderOfTheMethod)
{
    // The power of h between the errors of two lengths of the step, for at least 25 samples a
    // step. The errors of the steps themselves have these orders, and those of the polynomials
    // have it or one more, so that the sum of both is at most 0.3 below it at these lengths.
    const auto order = [](double h, const auto& method) {
        return std::log2(error_with(h, method) / error_with(h / 2, method));
    };
    EXPECT_GT(order(0.5, FixedStep<Rk4>{}), 3.7);
    EXPECT_GT(order(0.5, FixedStep<CashKarp54>{}), 4.7);
    EXPECT_GT(order(1.25, FixedStep<Fehlberg78>{}), 7.7);
    EXPECT_GT(order(0.5, FixedStep<Euler>{}), 0.7);
}

TEST(Samples, ManyAreAsAccurateAsFew)
{
    // The steps are the same. A sample alone is a step of its own; its error is that of the run so
    // far, which the polynomial exceeds by at most the error of an accepted step.
    constexpr double tolerance = 1e-10;
    const auto run_with = [&](std::size_t count) {
        return integrate(
            Oscillator{}, X{1.0, 0.0},
            {.t_end = t_end, .rtol = tolerance, .atol = tolerance, .sample_times = spread(count)},
            ErrorControlled<Fehlberg78>{});
    };
    const auto few = run_with(5);
    const auto many = run_with(5000);
    EXPECT_EQ(few.x, many.x);
    EXPECT_LE(worst(many), std::max(worst(few), error_at(t_end, few.x)) + tolerance);
}

TEST(Samples, BackwardInTimeAndBeforeAnEventAreThoseOfTheMotion)
{
    // Each event cuts a step: samples before it lie on the polynomial of the whole step, those
    // behind it on that of the next. The third component counts the events.
    struct Counting {
        using State = std::array<double, 3>;
        void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -x[0], 0}; }
        [[nodiscard]] double guard(double, const State& x) const { return x[1] - 0.3; }
        void reset(double, State& x) const { x[2] += 1; }
    };
    for (const double sign : {1.0, -1.0}) {
        SCOPED_TRACE(sign);
        std::vector<double> times = spread(3000);
        for (double& t : times) t *= sign;
        const auto run =
            integrate(Counting{}, {1.0, 0.0, 0.0},
                      {.t_end = sign * t_end, .rtol = 1e-11, .atol = 1e-11, .sample_times = times},
                      ErrorControlled<Fehlberg78>{});
        ASSERT_GE(run.events.size(), 3u);
        ASSERT_EQ(run.trajectory.t, times);
        // At most 100 steps, each with an error of about the tolerance.
        EXPECT_LE(worst(run), 1e-9);
    }
}

}  // namespace
}  // namespace ricochet::samples_test
