#include "ricochet/step_control.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace ricochet::step_control_test {
namespace {

TEST(StepControl, TheTableOfRootsIsAPowerToThreeDigits)
{
    // The cubic through four nodes of Chebyshev differs from m^(-1/n) in [1, 2] by at most
    // max |f''''| / (4! 2^7): 7.8e-3 for n = 1, where it is largest, and in fact 1.8e-3.
    for (int order = 1; order <= detail::InverseRoots::most_order; ++order) {
        const double allowed = order == 1 ? 1.8e-3 : order < 4 ? 6e-4 : 2.1e-4;
        const auto& roots = detail::inverse_roots[static_cast<std::size_t>(order)];
        double worst = 0;
        for (double x = 4e-18; x < 2e11; x *= 1.01) {
            worst = std::fmax(worst, std::fabs(roots(x) / std::pow(x, -1.0 / order) - 1));
        }
        EXPECT_LT(worst, allowed) << order;
        EXPECT_GT(worst, 1e-5) << order;  // it is the table that was asked
    }
}

TEST(StepControl, TheFactorOfAStepIsWithinItsLimitsForEveryError)
{
    const ErrorRule rule;
    for (int order = 1; order <= 20; ++order) {
        for (const double error : {0.0, std::numeric_limits<double>::denorm_min(), 1e-300, 1e-19}) {
            // (0.9 / 10)^20 is 1e-21; up to order 16 it is 2e-17.
            if (error < 1e-21 || order <= 16) {
                EXPECT_EQ(rule.factor(error, order), 10) << order;
            }
        }
        for (const double error : {1e20, 1e300, std::numeric_limits<double>::max()}) {
            EXPECT_EQ(rule.factor(error, order), 0.2) << order;
        }
        EXPECT_NEAR(rule.factor(1, order), 0.9, 0.9 * 1.8e-3) << order;
        double last = 10;
        for (double error = 1e-20; error < 1e20; error *= 1.3) {
            const double factor = rule.factor(error, order);
            EXPECT_LE(factor, last);
            last = factor;
        }
    }
}

}  // namespace
}  // namespace ricochet::step_control_test
