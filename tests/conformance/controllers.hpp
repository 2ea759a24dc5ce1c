// Conformance suite of step controllers.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <random>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet::test {

/// A closed range; by default of all nonnegative numbers.
struct Range {
    double least = 0;
    double most = std::numeric_limits<double>::infinity();
};

/// A controller with its promised properties.
struct ControllerCase {
    std::string name;
    /// Makes a new one, where the unit of time is that many seconds; a power of two.
    std::function<StepController(double unit)> make;
    double accepts = std::numeric_limits<double>::infinity();  ///< largest error accepted by a new
                                                               ///< controller
    Range next{};                                              ///< factors after accepted steps
    Range retry{};                                             ///< factors after rejected ones
    int order = 2;                          ///< of the error of a closed loop in the step
    Range settles{};                        ///< final errors of that loop
    std::vector<StepController> refused{};  ///< rejected by `validate`
};

inline void PrintTo(const ControllerCase& controller, std::ostream* out)
{
    *out << controller.name;
}

/// The verdict of a controller; a learned one receives steps at a tolerance of 1e-3.
[[nodiscard]] inline StepVerdict told(StepController& controller, double error, double h)
{
    return judge(controller, error, h, [] { return StepView{.tolerance = 1e-3}; });
}

[[nodiscard]] inline double failed(StepController& controller)
{
    return std::visit([](auto& rule) { return rule.failed(); }, controller);
}

inline void reset(StepController& controller)
{
    std::visit([](auto& rule) { rule.reset(); }, controller);
}

/// Errors from 0 to the largest double, rising.
[[nodiscard]] inline std::vector<double> rising_errors()
{
    std::vector<double> errors{0, 5e-324, 1e-300, 1e-100, 1e-30};
    for (double error = 1e-12; error < 1e8; error *= 1.3) errors.push_back(error);
    for (const double error : {1e30, 1e100, 1e300}) errors.push_back(error);
    errors.push_back(std::numeric_limits<double>::max());
    return errors;
}

class ControllerSuite : public testing::TestWithParam<ControllerCase> {
protected:
    [[nodiscard]] StepController fresh(double unit = 1) const { return GetParam().make(unit); }

    /// An error between 1e-6 and 1e3.
    [[nodiscard]] double error()
    {
        return std::pow(10, std::uniform_real_distribution(-6., 3.)(random_));
    }

    /// Passes the errors of steps from `h` on to a controller; some steps have no solution.
    void remember(StepController& controller, int steps, double h = 0.01)
    {
        for (int i = 0; i < steps; ++i) {
            h *= random_() % 5 == 0 ? failed(controller) : told(controller, error(), h).factor;
            if (!(h > 1e-6 && h < 1e6)) h = 0.01;
        }
    }

    /// Calls check(controller) with a new one and with some that have a history.
    template <class Check>
    void for_any_past(Check&& check)
    {
        for (int steps = 0; steps < 12; ++steps) {
            SCOPED_TRACE("after " + std::to_string(steps) + " steps");
            StepController controller = fresh();
            remember(controller, steps);
            check(controller);
        }
    }

private:
    std::mt19937_64 random_{20};
};

TEST_P(ControllerSuite, EveryFactorIsPositiveAndFiniteWhateverTheErrors)
{
    for_any_past([](const StepController& controller) {
        for (const double error : rising_errors()) {
            StepController one = controller;
            const double factor = told(one, error, 0.01).factor;
            EXPECT_GT(factor, 0) << error;
            EXPECT_TRUE(std::isfinite(factor)) << error;
            // Checks after it too, when the extreme error is the previous one.
            for (const double after : {0.0, 0.5, 1e3}) {
                StepController other = one;
                const double next = told(other, after, 0.01).factor;
                EXPECT_TRUE(next > 0 && std::isfinite(next)) << error << ", then " << after;
            }
        }
    });
}

TEST_P(ControllerSuite, AcceptsUpToItsThresholdAndRejectsBeyond)
{
    const double threshold = GetParam().accepts;
    for (const double error : rising_errors()) {
        StepController controller = fresh();
        const bool accepted = told(controller, error, 0.01).accepted;
        if (error != threshold) {
            EXPECT_EQ(accepted, error < threshold) << error;
        }
    }
    if (std::isinf(threshold)) return;
    StepController below = fresh();
    StepController above = fresh();
    EXPECT_TRUE(told(below, threshold * (1 - 1e-12), 0.01).accepted);
    EXPECT_FALSE(told(above, threshold * (1 + 1e-12), 0.01).accepted);
}

TEST_P(ControllerSuite, ARejectedStepIsRepeatedShorter)
{
    std::vector<double> errors = rising_errors();
    errors.push_back(std::nextafter(GetParam().accepts, 1e308));
    for_any_past([&](const StepController& controller) {
        for (const double error : errors) {
            StepController one = controller;
            const StepVerdict verdict = told(one, error, 0.01);
            if (!verdict.accepted) {
                EXPECT_LT(0.01 * verdict.factor, 0.01) << error;
            }
        }
    });
}

TEST_P(ControllerSuite, AStepWithoutASolutionIsRepeatedShorter)
{
    for_any_past([](StepController controller) {
        for (int i = 0; i < 10; ++i) {
            const double factor = failed(controller);
            EXPECT_GT(factor, 0);
            EXPECT_LE(factor, 0.9);  // so that ten of them shorten a step to a third
        }
    });
}

TEST_P(ControllerSuite, ALargerErrorGivesNoLongerStep)
{
    for_any_past([](const StepController& controller) {
        double before = std::numeric_limits<double>::infinity();
        bool accepted_before = true;
        for (const double error : rising_errors()) {
            StepController one = controller;
            const StepVerdict verdict = told(one, error, 0.01);
            EXPECT_LE(verdict.factor, before) << error;
            EXPECT_TRUE(accepted_before || !verdict.accepted) << error;
            before = verdict.factor;
            accepted_before = verdict.accepted;
        }
    });
}

TEST_P(ControllerSuite, FactorsKeepWithinTheirLimits)
{
    const Range next = GetParam().next;
    const Range retry = GetParam().retry;
    for_any_past([&](const StepController& controller) {
        for (const double error : rising_errors()) {
            StepController one = controller;
            const StepVerdict verdict = told(one, error, 0.01);
            const Range& range = verdict.accepted ? next : retry;
            EXPECT_GE(verdict.factor, range.least) << error;
            EXPECT_LE(verdict.factor, range.most) << error;
        }
    });
}

TEST_P(ControllerSuite, OtherUnitsOfTimeAndErrorChangeNoBit)
{
    // error = (h / goal)^order / tolerance with h and goal in another unit, and with error
    // and tolerance both 1024 times as large.
    const int order = GetParam().order;
    const auto lengths = [&](double unit, double scale) {
        StepController controller = fresh(unit);
        std::vector<double> steps;
        for (double h = unit * 0.25; steps.size() < 100;) {
            const double error = scale * std::pow(h / (0.01 * unit), order);
            h *= told(controller, error / scale, h).factor;
            steps.push_back(h / unit);
        }
        return steps;
    };
    const std::vector<double> expected = lengths(1, 1);
    EXPECT_EQ(lengths(0x1p-20, 1), expected);
    EXPECT_EQ(lengths(0x1p20, 1), expected);
    EXPECT_EQ(lengths(1, 1024), expected);
}

TEST_P(ControllerSuite, AResetForgetsThePast)
{
    for_any_past([&](StepController controller) {
        reset(controller);
        StepController other = fresh();
        for (int i = 0; i < 20; ++i) {
            const double e = error();
            const StepVerdict again = told(controller, e, 0.01 * (i + 1));
            const StepVerdict first = told(other, e, 0.01 * (i + 1));
            EXPECT_EQ(again.accepted, first.accepted);
            EXPECT_EQ(again.factor, first.factor);
        }
    });
}

TEST_P(ControllerSuite, ACopyHasThePastOfItsOriginalAndAFutureOfItsOwn)
{
    for_any_past([&](StepController controller) {
        StepController copy = controller;
        StepController disturbed = controller;
        remember(disturbed, 5);
        for (int i = 0; i < 20; ++i) {
            const double e = error();
            EXPECT_EQ(told(controller, e, 0.01).factor, told(copy, e, 0.01).factor);
        }
    });
}

TEST_P(ControllerSuite, AClosedLoopSettlesAtItsError)
{
    const int order = GetParam().order;
    for (const double from : {1e-4, 0.3}) {
        StepController controller = fresh();
        double h = from;
        for (int i = 0; i < 600; ++i) {
            const double error = std::pow(h / 0.01, order);
            h *= told(controller, error, h).factor;
            if (i < 500) continue;
            EXPECT_GE(error, GetParam().settles.least) << "from " << from;
            EXPECT_LE(error, GetParam().settles.most) << "from " << from;
        }
    }
}

TEST_P(ControllerSuite, PossibleOnesAreValidAndImpossibleOnesRefused)
{
    EXPECT_NO_THROW(validate(fresh()));
    for (std::size_t i = 0; i < GetParam().refused.size(); ++i) {
        EXPECT_THROW(validate(GetParam().refused[i]), std::invalid_argument) << i;
    }
}

}  // namespace ricochet::test
