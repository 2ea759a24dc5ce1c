#include "step_of.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "ricochet/step_probe.hpp"
#include "walled_oscillator.hpp"

namespace ricochet::step_test {
namespace {

using X = std::array<double, 2>;
using Core = detail::CoreState<X>;
using test::WalledOscillator;

template <class Method>
using StepOf = test::StepOf<Method, WalledOscillator, X>;

static_assert(MethodStep<StepOf<Rk4>, Core>);
static_assert(MethodStep<StepOf<Dopri5>, Core>);
static_assert(MethodStep<StepOf<Fehlberg78>, Core>);

template <class Method>
class StepTest : public testing::Test {
};

using Methods = testing::Types<Euler, Rk4, CashKarp54, Dopri5, Fehlberg78>;
TYPED_TEST_SUITE(StepTest, Methods);

TYPED_TEST(StepTest, RestepToTheEndIsTheStep)
{
    const WalledOscillator oscillator;
    StepOf<TypeParam> step(oscillator, 0, {1.0, 0.5});
    step.attempt(0.1);
    Core x(2);
    Core rate(2);
    step.restep(0.1, x, rate);
    EXPECT_EQ(x, step.x1());
    EXPECT_EQ(rate, step.rate1());
}

TYPED_TEST(StepTest, AskingDoesNotDisturbTheStep)
{
    const WalledOscillator oscillator;
    StepOf<TypeParam> step(oscillator, 0, {1.0, 0.5});
    step.attempt(0.1);
    Core before(2);
    Core between(2);
    Core after(2);
    step.interpolate(0.05, before);
    step.restep(0.03, between);
    step.interpolate(0.05, after);
    EXPECT_EQ(before, after);
}

TYPED_TEST(StepTest, DenseOutputMeetsBothEnds)
{
    const WalledOscillator oscillator;
    StepOf<TypeParam> step(oscillator, 0, {1.0, 0.5});
    step.attempt(0.1);
    Core x(2);
    step.interpolate(0, x);
    EXPECT_EQ(x, step.x0());
    step.interpolate(0.1, x);
    // the weights of the polynomial at 1 are those of the step, to rounding
    EXPECT_NEAR(x[0], step.x1()[0], 1e-15);
    EXPECT_NEAR(x[1], step.x1()[1], 1e-15);
}

TEST(Step, DenseOutputOfDopri5IsOfFourthOrder)
{
    const auto error = [](double h) {
        const WalledOscillator oscillator;
        StepOf<Dopri5> step(oscillator, 0, {1.0, 0.0});
        step.attempt(h);
        Core x(2);
        step.interpolate(0.4 * h, x);
        return std::abs(x[0] - std::cos(0.4 * h));
    };
    // locally h^5; a step of 0.4 leaves 1e-7, far above rounding
    EXPECT_GT(std::log2(error(0.4) / error(0.2)), 4.8);
}

TEST(Step, RoundingDoesNotGrowWithTheNumberOfSteps)
{
    // A million steps of free motion x' = v: exact but for rounding, which by plain
    // addition reaches 1e-11 here.
    struct Drift {
        void flow(double, const X& x, X& dxdt) const { dxdt = {x[1], 0}; }
    };
    const Drift drift;
    test::StepOf<Rk4, Drift, X> step(drift, 0, {0.0, 0.1});
    for (int i = 0; i < 1'000'000; ++i) {
        step.attempt(0.1);
        step.accept();
    }
    EXPECT_NEAR(step.x0()[0], 1e4, 2e-12);    // one ulp
    EXPECT_NEAR(step.time(0), 1e5, 1.5e-11);  // one ulp
}

}  // namespace
}  // namespace ricochet::step_test
