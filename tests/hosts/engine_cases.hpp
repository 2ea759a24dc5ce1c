// Cases for every physics engine that moves a body in steps of a fixed length.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "ricochet/hosts/detail/run.hpp"

namespace ricochet::hosts_test {

/// x = (position, velocity) of a body, gravity downward along the third axis, and a floor at 0.
struct FallingBody {
    using State = std::array<double, 6>;
    static constexpr bool unilateral = true;
    static constexpr double gravity = 9.81;
    double restitution = 0.9;

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        dxdt = {x[3], x[4], x[5], 0, 0, -gravity};
    }
    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const
    {
        return x[2];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return dxdt[2];
    }
    void reset(double /*t*/, State& x) const
    {
        x[2] = 0;
        x[5] *= -restitution;
    }
    void rest(double /*t*/, State& x) const { x[2] = x[5] = 0; }
};

/// The same without a floor: passages of the height `level` are recorded.
struct Gate {
    using State = FallingBody::State;
    static constexpr bool resets = false;
    static constexpr Crossing crossing = Crossing::either;
    double level;

    void flow(double t, const State& x, State& dxdt) const { FallingBody{}.flow(t, x, dxdt); }
    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const
    {
        return level - x[2];
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const
    {
        return -dxdt[2];
    }
};

/// The engine's own fall from height z at velocity v: steps of `length`, v before x.
struct EngineFall {
    double z, v, t = 0;

    /// Advances to the next impact: the root of z + s (v - g s) in the step that contains it.
    void fall(double length, double first)
    {
        for (double h = first;; h = length) {
            const double g = FallingBody::gravity;
            const double s = (v + std::sqrt(v * v + 4 * g * z)) / (2 * g);
            if (s <= h) {
                t += s;
                v -= g * s;
                z = 0;
                return;
            }
            v -= g * h;
            z += h * v;
            t += h;
        }
    }
};

template <class World>
class InEngine : public testing::Test {
};
TYPED_TEST_SUITE_P(InEngine);

TYPED_TEST_P(InEngine, ImpactsAreThoseOfTheEnginesOwnMap)
{
    const FallingBody system;
    const FallingBody::State x0{0, 0, 10, 0.5, 0, 0};
    TypeParam world(x0);
    auto host = world.host(0.01);
    EventMonitor monitor(system, x0);
    std::vector<double> heights;
    EXPECT_EQ(
        hosts::run(host, monitor, 15, [&](const auto& cut) { heights.push_back(cut.before[2]); }),
        Verdict::stands);
    EngineFall expected{10, 0};
    const auto events = monitor.events();
    ASSERT_GE(events.size(), 6u);
    for (std::size_t k = 0; k < 6; ++k) {
        expected.fall(0.01, 0.01);
        EXPECT_NEAR(events[k].t, expected.t, 20 * double(k + 1) * TypeParam::rounding);
        EXPECT_NEAR(heights[k], 0, TypeParam::rounding);
        expected.v *= -0.9;
    }
    EXPECT_NEAR(host.x()[0], 0.5 * 15, 1e3 * TypeParam::rounding);
}

TYPED_TEST_P(InEngine, ImpactsAccumulateAndTheBodyRests)
{
    const FallingBody system{.restitution = 0.5};
    const FallingBody::State x0{0, 0, 1, 0, 0, 0};
    TypeParam world(x0);
    auto host = world.host(0.01);
    EventMonitor monitor(system, x0);
    EXPECT_EQ(hosts::run(host, monitor, 3), Verdict::rests);
    EXPECT_EQ(host.x()[2], 0);
    EXPECT_EQ(host.x()[5], 0);
    EXPECT_EQ(host.t(), 3);
    // 3 sqrt(2 / g) by the physics; the engine's flights are shorter, by up to a step each.
    EXPECT_NEAR(monitor.events().back().t, 3 * std::sqrt(2 / FallingBody::gravity), 0.2);
}

TYPED_TEST_P(InEngine, APassageThatChangesNothingLeavesTheMotionAsItIs)
{
    const FallingBody::State x0{0, 0, 10, 0, 0, 5};
    const auto end = [&](double level, std::size_t passages) {
        TypeParam world(x0);
        auto host = world.host(0.01);
        const Gate gate{level};
        EventMonitor monitor(gate, x0);
        EXPECT_EQ(hosts::run(host, monitor, 2), Verdict::stands);
        EXPECT_EQ(monitor.events().size(), passages);
        return host.x()[2];
    };
    EXPECT_EQ(end(11, 2), end(100, 0));
}

TYPED_TEST_P(InEngine, AnotherBodyOfTheWorldMovesOnlyOnce)
{
    // The engine's v - g s is exact for any division of the time into steps: a body that repeated
    // steps had moved, too, would be faster by g times their sum.
    const FallingBody system;
    const FallingBody::State x0{0, 0, 10, 0.5, 0, 0};
    TypeParam world(x0);
    world.add_beside(20);
    auto host = world.host(0.01);
    EventMonitor monitor(system, x0);
    EXPECT_EQ(hosts::run(host, monitor, 8), Verdict::stands);
    EXPECT_GE(monitor.events().size(), 3u);
    // Rounding of 80 m/s in each of 800 steps, and the steps at cuts.
    EXPECT_NEAR(world.velocity_beside(), -8 * FallingBody::gravity, 8e3 * TypeParam::rounding);
}

TYPED_TEST_P(InEngine, AStartOnTheFloorIsNoEvent)
{
    const FallingBody system;
    const FallingBody::State x0{0, 0, 0, 0, 0, 5};
    TypeParam world(x0);
    auto host = world.host(0.01);
    EventMonitor monitor(system, x0);
    EXPECT_EQ(hosts::run(host, monitor, 1.2), Verdict::stands);
    EXPECT_EQ(monitor.events().size(), 1u);
}

TYPED_TEST_P(InEngine, ABodyThatIsMovedBetweenStepsIsRefused)
{
    const FallingBody system;
    const FallingBody::State x0{0, 0, 10, 0, 0, 0};
    TypeParam world(x0);
    auto host = world.host(0.01);
    EventMonitor monitor(system, x0);
    EXPECT_EQ(monitor.start({host.t()}, host.x(), host.rate(), host.scale()), Verdict::stands);
    host.step(1);
    EXPECT_EQ(monitor.examine(host), Verdict::stands);
    world.move_up();
    host.step(1);
    EXPECT_THROW((void)monitor.examine(host), std::logic_error);
}

REGISTER_TYPED_TEST_SUITE_P(InEngine, ImpactsAreThoseOfTheEnginesOwnMap,
                            ImpactsAccumulateAndTheBodyRests,
                            APassageThatChangesNothingLeavesTheMotionAsItIs,
                            AnotherBodyOfTheWorldMovesOnlyOnce, AStartOnTheFloorIsNoEvent,
                            ABodyThatIsMovedBetweenStepsIsRefused);

}  // namespace ricochet::hosts_test
