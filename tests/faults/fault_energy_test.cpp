// Energy of a fault's runs: the work of the load is stored, dissipated or radiated.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "fault_energy.hpp"

namespace ricochet::test::fault_energy_test {
namespace {

constexpr double constant_steps = std::numeric_limits<double>::infinity();
constexpr double bound = 1e-8;  // of the polynomial for sqrt(K): H v.v is a fortieth of the work

TEST(FaultEnergy, ExplicitStepsKeepTheBalanceToTheirOrder)
{
    // At 8 s all elements slip, and the order is 5: a factor of 32 for half the step, down to the
    // bound of the polynomial. At 30 s all are at rest, and arrests were of order 2: 16 for a
    // quarter, with some scatter by where they fall in a step.
    const StrikeSlipFault fault({.elements = 5});
    const auto defect = [&](double t_end, double step) {
        return explicit_energy(fault,
                               {.t_end = t_end,
                                .step = step,
                                .rtol = constant_steps,
                                .polynomial_bound = bound},
                               4000)
            .defect();
    };
    EXPECT_LT(defect(8, 0.2), 1e-8);
    EXPECT_GT(defect(8, 0.2) / defect(8, 0.1), 20);
    EXPECT_LT(defect(30, 0.2), 1e-5);
    EXPECT_GT(defect(30, 0.2) / defect(30, 0.05), 8);
    // By default, where velocities are kept to 1e-4.
    const FaultEnergy usual = explicit_energy(fault, {.t_end = 30}, 4000);
    EXPECT_LT(usual.defect(), 1e-6);
    EXPECT_EQ(usual.kinetic, 0);
    EXPECT_GT(usual.radiation, 0.01 * usual.work);  // more than the defect can hide
}

TEST(FaultEnergy, BatheStepsKeepTheBalanceToTheirOrder)
{
    // 16 for a quarter of the step at order 2, 4 for the published scheme, whose order is 1.
    const StrikeSlipFault fault({.elements = 5});
    const auto defect = [&](FirstStage first, double t_end, double step) {
        return bathe_energy(fault, {.t_end = t_end, .step = step, .polynomial_bound = bound},
                            {.first_stage = first})
            .defect();
    };
    for (const double t_end : {8.0, 30.0}) {
        const double coarse = defect(FirstStage::averaged, t_end, 0.2);
        EXPECT_LT(coarse, 5e-5) << t_end;
        EXPECT_GT(coarse / defect(FirstStage::averaged, t_end, 0.05), 12) << t_end;
        const double published = defect(FirstStage::at_end, t_end, 0.2);
        EXPECT_LT(published, 3e-3) << t_end;
        EXPECT_NEAR(published / defect(FirstStage::at_end, t_end, 0.05), 4, 0.5) << t_end;
    }
}

TEST(FaultEnergy, RateAndStateFrictionKeepsTheBalance)
{
    // The trapezoidal rule over the steps is of order 2 for any order of the steps.
    const StrikeSlipFault small({.elements = 3});
    const FaultFriction sliding{.plate_velocity = 1e-3, .slip_rate = 2e-3, .overload = 1e-3};
    for (const int order : {1, 2, 4}) {
        const auto defect = [&](double step) {
            return rate_state_energy(small,
                                     {.t_end = 16,
                                      .step = step,
                                      .rtol = constant_steps,
                                      .polynomial_bound = bound},
                                     sliding, {.order = order})
                .defect();
        };
        EXPECT_LT(defect(0.25), order == 1 ? 2e-2 : 1e-3) << order;
        EXPECT_NEAR(std::log2(defect(0.25) / defect(0.0625)) / 2, order == 1 ? 1 : 2, 0.3) << order;
    }
    // Years of load and an earthquake, every velocity kept to 1e-3.
    const StrikeSlipFault fault({.elements = 4});
    FaultFriction friction{.overload = 1e-3};
    friction.law = {.a = 0.006, .b = 0.024, .f_star = 0.6, .v_star = 1e-6, .d_rs = 0.006};
    for (const int order : {2, 4}) {
        const RuptureOptions options{.t_end = 1e7, .rtol = 1e-3, .polynomial_bound = bound};
        const FaultEnergy e = rate_state_energy(fault, options, friction, {.order = order});
        EXPECT_LT(e.defect(), 1e-3) << order;
        EXPECT_GT(e.radiation, 0.1 * e.work) << order;
        EXPECT_GT(e.friction, 0.5 * e.work) << order;
    }
}

}  // namespace
}  // namespace ricochet::test::fault_energy_test
