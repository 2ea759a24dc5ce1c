// Every state type takes the same steps and finds the same events, bit for bit.

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <vector>

#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "walled_oscillator.hpp"

namespace ricochet::state_types_test {
namespace {

using test::WalledOscillator;

template <class X>
X state(double a, double b)
{
    if constexpr (requires(X x) { x.resize(2); }) {
        X x;
        x.resize(2);
        x[0] = a;
        x[1] = b;
        return x;
    } else {
        return X{a, b};
    }
}

template <class X>
class StateTypes : public testing::Test {
};

using Types = testing::Types<std::vector<double>, Eigen::Vector2d, Eigen::VectorXd,
                             Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 4, 1>>;
TYPED_TEST_SUITE(StateTypes, Types);

template <class X, class Stepping>
void expect_same_as_array(const Options& options)
{
    const WalledOscillator oscillator;
    const auto expected = integrate(oscillator, std::array{1.0, 0.0}, options, Stepping{});
    const auto run = integrate(oscillator, state<X>(1, 0), options, Stepping{});
    ASSERT_EQ(run.events.size(), expected.events.size());
    ASSERT_GT(run.events.size(), 3u);
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        EXPECT_EQ(run.events[i].t, expected.events[i].t);
        EXPECT_EQ(run.events[i].before[1], expected.events[i].before[1]);
        EXPECT_EQ(run.events[i].after[1], expected.events[i].after[1]);
    }
    EXPECT_EQ(run.x[0], expected.x[0]);
    EXPECT_EQ(run.x[1], expected.x[1]);
    EXPECT_EQ(run.statistics.steps, expected.statistics.steps);
}

TYPED_TEST(StateTypes, FixedStepsAreTheSameBits)
{
    const Options options{.t_end = 20, .step = 0.01};
    expect_same_as_array<TypeParam, FixedStep<Euler>>(options);
    expect_same_as_array<TypeParam, FixedStep<Rk4>>(options);
    expect_same_as_array<TypeParam, FixedStep<CashKarp54>>(options);
    expect_same_as_array<TypeParam, FixedStep<Dopri5>>(options);
    expect_same_as_array<TypeParam, FixedStep<Fehlberg78>>(options);
}

TYPED_TEST(StateTypes, ErrorControlledStepsAreTheSameBits)
{
    const Options options{.t_end = 20, .rtol = 1e-9};
    expect_same_as_array<TypeParam, ErrorControlled<CashKarp54>>(options);
    expect_same_as_array<TypeParam, ErrorControlled<Dopri5>>(options);
    expect_same_as_array<TypeParam, ErrorControlled<Fehlberg78>>(options);
}

TYPED_TEST(StateTypes, TheBallBouncesThirteenTimes)
{
    const auto run = integrate(BouncingBall(), state<TypeParam>(10, 0), {.t_end = 20.5});
    EXPECT_EQ(run.events.size(), 13u);
}

}  // namespace
}  // namespace ricochet::state_types_test
