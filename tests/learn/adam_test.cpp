#include "ricochet/learn/adam.hpp"

#include <cmath>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace ricochet::learn::adam_test {
namespace {

TEST(Adam, FirstStepHasTheLengthOfTheRateWhateverTheGradient)
{
    // m^ = g and v^ = g^2 in the first step, so that it is rate g / (|g| + eps).
    Adam adam(2, {});
    std::vector<double> p{1, 1};
    adam.step(p, std::vector<double>{1e3, -1e-3}, 0.1);
    EXPECT_NEAR(p[0], 0.9, 1e-11);
    EXPECT_NEAR(p[1], 1.1, 1e-5);
}

TEST(Adam, TwoStepsFollowTheFormula)
{
    // b1 = 1/2, b2 = 3/4, gradients 1 and 3, eps negligible:
    //   m = 1/2, v = 1/4,   m^ = 1,   v^ = 1    p = -rate
    //   m = 7/4, v = 39/16, m^ = 7/3, v^ = 39/7
    Adam adam(1, {.beta1 = 0.5, .beta2 = 0.75, .epsilon = 1e-300});
    std::vector<double> p{0};
    adam.step(p, std::vector<double>{1}, 0.1);
    adam.step(p, std::vector<double>{3}, 0.1);
    EXPECT_NEAR(p[0], -0.1 - 0.1 * (7.0 / 3) / std::sqrt(39.0 / 7), 1e-15);
}

TEST(Adam, FindsTheMinimumOfAnIllConditionedQuadratic)
{
    // f = (p0 - 3)^2 / 2 + 1e4 (p1 + 2)^2 / 2. With a rate that falls to zero the
    // steps do so as well, and the error of the iterate is a few of the last ones.
    Adam adam(2, {});
    std::vector<double> p{0, 0};
    const int iterations = 20'000;
    for (int k = 0; k < iterations; ++k) {
        const std::vector<double> gradient{p[0] - 3, 1e4 * (p[1] + 2)};
        adam.step(p, gradient, 0.01 * (1 - static_cast<double>(k) / iterations));
    }
    EXPECT_NEAR(p[0], 3, 1e-5);
    EXPECT_NEAR(p[1], -2, 1e-5);
}

TEST(Adam, ContinuesFromAStoredStateToTheSameBits)
{
    Adam whole(1, {});
    std::vector<double> p{1};
    for (int k = 0; k < 10; ++k) whole.step(p, std::vector<double>{p[0]}, 0.1);

    Adam first(1, {});
    std::vector<double> q{1};
    for (int k = 0; k < 4; ++k) first.step(q, std::vector<double>{q[0]}, 0.1);
    Adam second(1, {});
    second.restore(first.state());
    for (int k = 4; k < 10; ++k) second.step(q, std::vector<double>{q[0]}, 0.1);
    EXPECT_EQ(p, q);
    EXPECT_THROW(Adam(2, {}).restore(first.state()), std::invalid_argument);
}

TEST(Adam, RefusesOptionsOutsideTheirRange)
{
    EXPECT_THROW(Adam(1, {.beta1 = 1}), std::invalid_argument);
    EXPECT_THROW(Adam(1, {.beta2 = -0.1}), std::invalid_argument);
    EXPECT_THROW(Adam(1, {.epsilon = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::learn::adam_test
