// Cases for every locator, run for each of them by its own test file.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "host_step.hpp"
#include "ricochet/step_probe.hpp"

namespace ricochet::test {

using detail::Location;

/// Locates the first crossing of a step whose guard is armed on `side` and has left
/// it at the end.
template <class Locator>
[[nodiscard]] Location locate(const HostStep& step, Side side, double tolerance = 0)
{
    std::uint64_t calls = 0;
    const HostSystem system;
    const detail::GuardView<HostSystem, HostState> guard(system, calls);
    ProbeSpace<HostState> space(step.x0());
    StepProbe probe(guard, step, space);
    probe.watch(side);
    const GuardSample lo{.s = 0, .value = step.x0()[1], .rate = step.rate0()[1]};
    const GuardSample hi{.s = step.h(), .value = step.x1()[1], .rate = step.rate1()[1]};
    return Locator{}.locate(probe, lo, hi, tolerance);
}

template <class Locator>
class LocatorSuite : public testing::Test {
};

TYPED_TEST_SUITE_P(LocatorSuite);

TYPED_TEST_P(LocatorSuite, ClosesToNeighbouringOffsets)
{
    // cos crosses zero at pi/2, whose neighbours are 2.2e-16 apart.
    const HostStep step(
        3.0, [](double s) { return std::cos(s); }, [](double s) { return -std::sin(s); });
    const Location where = locate<TypeParam>(step, Side::above);
    EXPECT_LE(where.hi - where.lo, 4 * std::numeric_limits<double>::epsilon());
    EXPECT_NEAR(where.hi, std::acos(0.0), 3 * std::numeric_limits<double>::epsilon());
}

TYPED_TEST_P(LocatorSuite, TheBracketHoldsTheCrossing)
{
    const auto g = [](double s) { return std::exp(-s) - 0.3; };
    const HostStep step(5.0, g, [](double s) { return -std::exp(-s); });
    const Location where = locate<TypeParam>(step, Side::above);
    EXPECT_GT(g(where.lo), 0);
    EXPECT_LE(g(where.hi), 0);
    EXPECT_LE(where.lo, where.hi);
}

TYPED_TEST_P(LocatorSuite, StopsAtTheTolerance)
{
    const HostStep step(
        5.0, [](double s) { return std::exp(-s) - 0.3; }, [](double s) { return -std::exp(-s); });
    const Location where = locate<TypeParam>(step, Side::above, 1e-6);
    EXPECT_LE(where.hi - where.lo, 1e-6);
    EXPECT_NEAR(where.hi, -std::log(0.3), 1e-6);
}

TYPED_TEST_P(LocatorSuite, ARisingCrossingIsLocatedAsWell)
{
    const HostStep step(
        3.0, [](double s) { return -std::cos(s); }, [](double s) { return std::sin(s); });
    EXPECT_NEAR(locate<TypeParam>(step, Side::below).hi, std::acos(0.0), 1e-15);
}

TYPED_TEST_P(LocatorSuite, AStartOnTheSurfaceIsNotTheEvent)
{
    // A flight from the floor back to it: s (1 - s), on the surface at 0 and 1.
    const HostStep step(
        3.0, [](double s) { return s * (1 - s); }, [](double s) { return 1 - 2 * s; });
    EXPECT_NEAR(locate<TypeParam>(step, Side::above).hi, 1, 4e-16);
}

TYPED_TEST_P(LocatorSuite, RoundingBesideTheStartIsNotTheEvent)
{
    // Leaves the surface downwards, a rounding below it, and comes back at s = 0.1. The rounding of
    // the time 8 + s makes it positive at s = 1e-15, too, where the secant of the ends leads.
    const HostStep step(
        0.11, [](double s) { return ((8 + s) - 8) - 1.1 * s + s * s - 1e-17; },
        [](double s) { return 2 * s - 0.1; });
    EXPECT_NEAR(locate<TypeParam>(step, Side::below).hi, 0.1, 2e-14);
}

TYPED_TEST_P(LocatorSuite, AVeryShortFlightInALongStepIsFound)
{
    const double flight = 1e-9;
    const HostStep step(
        10.0, [=](double s) { return s * (flight - s); }, [=](double s) { return flight - 2 * s; });
    // Located on the offset, to a millionth of the spacing at the end of the step,
    // 1.8e-15 s: far finer than the time, 100 s, resolves.
    EXPECT_NEAR(locate<TypeParam>(step, Side::above).hi, flight, 1e-16);
}

TYPED_TEST_P(LocatorSuite, AFlatCrossingIsLocatedToTheRoundingOfTheGuard)
{
    // A triple root: the guard is zero to rounding for |s - 1| < 1e-108, so the
    // crossing is defined, only slow for Newton's method.
    const HostStep step(
        2.5, [](double s) { return -std::pow(s - 1, 3); },
        [](double s) { return -3 * std::pow(s - 1, 2); });
    EXPECT_NEAR(locate<TypeParam>(step, Side::above).hi, 1, 1e-15);
}

TYPED_TEST_P(LocatorSuite, AJumpIsLocatedAlthoughItHasNoSlope)
{
    const HostStep step(
        1.0, [](double s) { return s < 0.7 ? 1.0 : -1.0; }, [](double) { return 0.0; });
    const Location where = locate<TypeParam>(step, Side::above);
    EXPECT_LE(where.lo, 0.7);
    EXPECT_GE(where.hi, 0.7);
    EXPECT_LE(where.hi - where.lo, 2e-15);
    EXPECT_TRUE(where.jump);
}

TYPED_TEST_P(LocatorSuite, APoleIsNoCrossing)
{
    const HostStep step(
        1.0, [](double s) { return 1 / (0.3 - s); },
        [](double s) { return 1 / (0.3 - s) / (0.3 - s); });
    const Location where = locate<TypeParam>(step, Side::above);
    EXPECT_TRUE(where.jump);
    EXPECT_LE(where.lo, 0.3);
    EXPECT_GT(where.hi, 0.3);  // where the guard is finite again
    EXPECT_EQ(where.root, where.hi);
    EXPECT_LE(where.hi - where.lo, 2e-16);
}

TYPED_TEST_P(LocatorSuite, ASteepCrossingIsNoJumpAtAnyTolerance)
{
    // The slope is 1000 at the crossing, and 1 at both ends of the step.
    const HostStep step(
        1.0, [](double s) { return std::tanh(1000 * (0.3 - s)); },
        [](double s) { return -1000 / std::pow(std::cosh(1000 * (0.3 - s)), 2); });
    for (const double tolerance : {0.0, 1e-9, 1e-6, 1e-3}) {
        EXPECT_FALSE(locate<TypeParam>(step, Side::above, tolerance).jump) << tolerance;
    }
}

TYPED_TEST_P(LocatorSuite, AFlightThatEndsWithTheStepIsNoJump)
{
    // On the surface at the start and the end: the guard's ends do not show its size.
    const HostStep step(
        1.0, [](double s) { return s * (1 - s) - 1e-17; }, [](double s) { return 1 - 2 * s; });
    EXPECT_FALSE(locate<TypeParam>(step, Side::above).jump);
}

TYPED_TEST_P(LocatorSuite, ASaturatedGuardIsLocatedAllTheSame)
{
    // Flat at both ends, where its slope carries no information: erf is 1 to the last bit there.
    const HostStep step(
        10.0, [](double s) { return std::erf(10 * (5.03 - s)); },
        [](double s) { return -11.283791670955126 * std::exp(-std::pow(10 * (5.03 - s), 2)); });
    const Location where = locate<TypeParam>(step, Side::above);
    EXPECT_NEAR(where.hi, 5.03, 4e-15);
    EXPECT_LE(where.hi - where.lo, 4e-15);
}

TYPED_TEST_P(LocatorSuite, APlateauAtZeroIsEnteredAtItsEdge)
{
    const HostStep step(
        5.0, [](double s) { return std::max(0.0, 4 - s); },
        [](double s) { return s < 4 ? -1.0 : 0.0; });
    const Location where = locate<TypeParam>(step, Side::above);
    EXPECT_NEAR(where.hi, 4, 2e-15);
    EXPECT_LE(where.hi - where.lo, 2e-15);
}

TYPED_TEST_P(LocatorSuite, TheNumberOfStepsTakenIsBounded)
{
    const HostStep step(
        1.0, [](double s) { return s < 0.7 ? 1.0 : -1e-300; }, [](double) { return -1.0; });
    (void)locate<TypeParam>(step, Side::above);
    EXPECT_LE(step.resteps, 250);
}

REGISTER_TYPED_TEST_SUITE_P(LocatorSuite, ClosesToNeighbouringOffsets, TheBracketHoldsTheCrossing,
                            StopsAtTheTolerance, ARisingCrossingIsLocatedAsWell,
                            AStartOnTheSurfaceIsNotTheEvent, RoundingBesideTheStartIsNotTheEvent,
                            AVeryShortFlightInALongStepIsFound,
                            AFlatCrossingIsLocatedToTheRoundingOfTheGuard,
                            AJumpIsLocatedAlthoughItHasNoSlope, ASaturatedGuardIsLocatedAllTheSame,
                            APoleIsNoCrossing, ASteepCrossingIsNoJumpAtAnyTolerance,
                            AFlightThatEndsWithTheStepIsNoJump, APlateauAtZeroIsEnteredAtItsEdge,
                            TheNumberOfStepsTakenIsBounded);

}  // namespace ricochet::test
