// Cases for every host: the host computes the motion, the library the events.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

#include "hosts/host_systems.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/planned.hpp"

namespace ricochet::hosts_test {

template <class Maker>
class InHost : public testing::Test {
};
TYPED_TEST_SUITE_P(InHost);

TYPED_TEST_P(InHost, TheBallHasItsThirteenImpacts)
{
    // Every method is exact on a parabola; the remaining error is that of a tolerance of 1e-10.
    const BouncingBall ball;
    const auto result = run<TypeParam>(ball, {10, 0}, 20.5);
    ASSERT_EQ(result.events.size(), 13u);
    EXPECT_EQ(result.verdict, Verdict::stands);
    EXPECT_NEAR(result.t, 20.5, 1e-12);
    for (int k = 0; k < 13; ++k) {
        EXPECT_NEAR(result.events[std::size_t(k)].t, ball.impact_time(k, 10),
                    TypeParam::impact_error);
    }
}

TYPED_TEST_P(InHost, StickSlipChangesItsModes)
{
    const StickSlip system;
    const auto result = run<TypeParam>(system, {0, StickSlip::belt}, 40);
    // A period is 5 s + 3.9 s.
    ASSERT_EQ(result.cuts.size(), 8u);
    for (int k = 0; k < 8; ++k) {
        const auto& cut = result.cuts[std::size_t(k)];
        // An error of the sticking place delays the next slip by five times as much.
        EXPECT_NEAR(cut.t.value, StickSlip::event_time(k), 1e-7);
        EXPECT_EQ(cut.mode_after, k % 2 == 0 ? StickSlip::slips : StickSlip::sticks);
        ASSERT_EQ(cut.fired.size(), 1u);
        EXPECT_EQ(cut.fired[0], std::size_t(k % 2));
    }
}

TYPED_TEST_P(InHost, EqualBallsFireTogether)
{
    const TwoBalls balls;
    const auto result = run<TypeParam>(balls, {10, 0, 10, 0}, 10);
    ASSERT_GE(result.cuts.size(), 3u);
    for (const auto& cut : result.cuts) EXPECT_EQ(cut.fired.size(), 2u);
    EXPECT_EQ(result.events.size(), 2 * result.cuts.size());
}

TYPED_TEST_P(InHost, ImpactsAccumulateAndTheBallRests)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.5});
    const auto result = run<TypeParam>(ball, {1, 0}, 5);
    EXPECT_EQ(result.verdict, Verdict::rests);
    ASSERT_FALSE(result.cuts.empty());
    EXPECT_TRUE(result.cuts.back().accumulation);
    // The host no longer resolves flights as low as the absolute tolerance, 3e-7 s.
    EXPECT_NEAR(result.cuts.back().t.value, ball.zeno_time(1), 1e-6);
    EXPECT_EQ(result.end, (BouncingBall::State{0, 0}));
    EXPECT_EQ(result.t, 5);
}

TYPED_TEST_P(InHost, PairsOfCrossingsAtACrestAreFound)
{
    // Their distances have the host's own error of the crest, below `least_depth`.
    for (const double depth : {1e-2, 1e-4, 1e-6, 1e-8, 1e-9, 1e-10}) {
        if (depth < TypeParam::least_depth) continue;
        const auto result = run<TypeParam>(Crests{depth}, {0, 1}, 18,
                                           {TypeParam::finest, 0.01 * TypeParam::finest});
        ASSERT_EQ(result.events.size(), 6u) << "depth " << depth;
        EXPECT_TRUE(result.cuts.empty());
        for (std::size_t k = 0; k < 6; ++k) {
            const std::size_t turns = k / 2;
            const double crest = std::numbers::pi * (0.5 + 2 * double(turns));
            const double half = std::acos(1 - depth);
            const double expected = k % 2 == 0 ? crest - half : crest + half;
            EXPECT_NEAR(result.events[k].t, expected, 0.5 * half) << "depth " << depth;
        }
    }
}

TYPED_TEST_P(InHost, CrestsBelowTheSurfaceAreNoEvents)
{
    for (const double depth : {-1e-2, -1e-4, -1e-6, -1e-8, -1e-10}) {
        const auto result = run<TypeParam>(Crests{depth}, {0, 1}, 18,
                                           {TypeParam::finest, 0.01 * TypeParam::finest});
        EXPECT_TRUE(result.events.empty()) << "depth " << depth;
    }
}

TYPED_TEST_P(InHost, AStartOnTheSurfaceIsNoEvent)
{
    const BouncingBall ball;
    const double flight = 2 * 5 / ball.gravity();
    const auto result = run<TypeParam>(ball, {0, 5}, 1.2);
    ASSERT_EQ(result.events.size(), 1u);
    EXPECT_NEAR(result.events[0].t, flight, 1e-9);
}

TYPED_TEST_P(InHost, PlateausEndAsInARunOfTheLibrary)
{
    for (const double sign : {1.0, -1.0}) {
        const Plateau system{sign};
        const auto expected = integrate(system, {0, 0, 1}, {.t_end = 4, .h_max = 0.1});
        const auto result = run<TypeParam>(system, {0, 0, 1}, 4);
        ASSERT_EQ(result.events.size(), expected.events.size()) << "sign " << sign;
        for (std::size_t k = 0; k < result.events.size(); ++k) {
            EXPECT_EQ(result.events[k].kind, expected.events[k].kind);
            // The end of a plateau depends on the step; the crossing does not.
            if (expected.events[k].t > 2) {
                EXPECT_NEAR(result.events[k].t, expected.events[k].t, 1e-9);
            }
        }
    }
}

TYPED_TEST_P(InHost, TimeEventsAreMet)
{
    const auto result = run<TypeParam>(Dosed{}, {1}, 3.5);
    ASSERT_EQ(result.cuts.size(), 3u);
    double x = 1;
    for (std::size_t k = 0; k < 3; ++k) {
        x = x * std::exp(-1) + 1;
        EXPECT_EQ(result.cuts[k].t.value, double(k + 1));
        EXPECT_TRUE(result.cuts[k].on_time);
        EXPECT_NEAR(result.cuts[k].after[0], x, 1e-8);
    }
}

TYPED_TEST_P(InHost, BoundsSpareAnExpensiveGuard)
{
    const Corridor::State x0{1, 0.7, 0, 1};
    const Corridor watched;
    const auto exact = run<TypeParam>(watched, x0, 60);
    const Corridor spared;
    const auto result = run<TypeParam, Planned<>>(spared, x0, 60);
    ASSERT_EQ(exact.cuts.size(), 2u);
    ASSERT_EQ(result.cuts.size(), exact.cuts.size());
    for (std::size_t k = 0; k < exact.cuts.size(); ++k) {
        EXPECT_NEAR(result.cuts[k].t.value, exact.cuts[k].t.value, 1e-10);
    }
    EXPECT_LT(3 * spared.calls, watched.calls);
}

REGISTER_TYPED_TEST_SUITE_P(InHost, TheBallHasItsThirteenImpacts, StickSlipChangesItsModes,
                            EqualBallsFireTogether, ImpactsAccumulateAndTheBallRests,
                            PairsOfCrossingsAtACrestAreFound, CrestsBelowTheSurfaceAreNoEvents,
                            AStartOnTheSurfaceIsNoEvent, PlateausEndAsInARunOfTheLibrary,
                            TimeEventsAreMet, BoundsSpareAnExpensiveGuard);

}  // namespace ricochet::hosts_test
