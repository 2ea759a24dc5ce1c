// Ordinary hybrid systems that also know their motion as an inclusion.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "ricochet/nonsmooth/event_hand_over.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet {
namespace {

/// A mass on a spring and on a belt, written as one would without a thought of sticking: the
/// sign of the sliding velocity is a guard, and the flow asks for it.
struct Belt {
    using State = std::array<double, 2>;
    FrictionInclusion inclusion;
    static constexpr Crossing crossing = Crossing::either;

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        const double y = x[1] - inclusion.parameters().belt_speed;
        dxdt[0] = x[1];
        dxdt[1] = -x[0] - std::copysign(inclusion.friction(std::abs(y)), y);
    }
    [[nodiscard]] double guard(double /*t*/, const State& x) const
    {
        return x[1] - inclusion.parameters().belt_speed;
    }
    [[nodiscard]] const FrictionInclusion& set_valued() const { return inclusion; }
};

TEST(EventHandOver, AMassThatWouldChatterSticks)
{
    // From 2 m against 0.3 N: turns at pi, 2 pi and 3 pi, 0.6 m less each time, and stays at
    // -0.2 m, where the spring is weaker than friction.
    const Belt belt{FrictionInclusion({.friction = 0.3})};
    const auto run =
        integrate(belt, Belt::State{2, 0},
                  {.t_end = 12, .rtol = 1e-11, .atol = 1e-12, .sample_times = {5, 11}});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.t, 12);
    EXPECT_NEAR(run.x[0], -0.2, 1e-9);
    EXPECT_EQ(run.x[1], 0);
    ASSERT_EQ(run.phases.size(), 2U);
    EXPECT_EQ(run.phases[1].cause, PhaseCause::chattering);
    EXPECT_NEAR(run.phases[1].from, 3 * std::numbers::pi, 1e-4);
    for (std::size_t n = 0; n < 3; ++n) {
        EXPECT_NEAR(run.events[n].t, static_cast<double>(n + 1) * std::numbers::pi, 1e-9) << n;
    }
    // At 5 s: on the way from -1.4 about 0.3.
    ASSERT_EQ(run.trajectory.t.size(), 2U);
    EXPECT_NEAR(run.trajectory.x[0][0], -0.3 - 1.1 * std::cos(5 - std::numbers::pi), 1e-9);
    EXPECT_NEAR(run.trajectory.x[1][0], -0.2, 1e-9);
}

TEST(EventHandOver, StickSlipIsGivenBackAtEverySlip)
{
    // Sticks on the belt while the spring is stretched to what friction bears, 1 N at 1 m,
    // slips there, and so on: the slips are one period apart.
    const Belt belt{FrictionInclusion(
        {.belt_speed = 0.2, .friction = 1, .weakening = 3, .law = FrictionLaw::hyperbolic})};
    const auto run =
        integrate(belt, Belt::State{0, 0.2}, {.t_end = 40, .rtol = 1e-11, .atol = 1e-12});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    const auto alone = hand_over(belt.inclusion, Eigen::Vector2d(0, 0.2),
                                 {.t_end = 40, .rtol = 1e-11, .atol = 1e-12});
    std::vector<double> slips;
    for (const auto& event : run.events) {
        if (event.kind == EventKind::slip) slips.push_back(event.t);
    }
    std::vector<double> expected;
    for (const auto& event : alone.events) {
        if (event.kind == EventKind::slip) expected.push_back(event.t);
    }
    ASSERT_GE(expected.size(), 3U);
    ASSERT_EQ(slips.size(), expected.size());
    // The spring reaches 1 m after 5 s on the belt.
    EXPECT_NEAR(slips[0], 5, 1e-9);
    for (std::size_t i = 0; i < slips.size(); ++i) EXPECT_NEAR(slips[i], expected[i], 1e-7) << i;
    EXPECT_GE(run.statistics.to_events, 3U);
    EXPECT_NEAR(run.x[0], alone.state.w[0], 1e-6);
}

TEST(EventHandOver, StepsOfAllPhasesCountTowardsTheLimit)
{
    const Belt belt{FrictionInclusion(
        {.belt_speed = 0.2, .friction = 1, .weakening = 3, .law = FrictionLaw::hyperbolic})};
    const auto with = [&](std::uint64_t most) {
        return integrate(belt, Belt::State{0, 0.2},
                         {.t_end = 40, .rtol = 1e-11, .atol = 1e-12, .max_steps = most});
    };
    const auto taken = [](const auto& run) {
        return run.statistics.event_driven.steps + run.statistics.set_valued.attempted;
    };
    const std::uint64_t all = taken(with(1'000'000));
    // The last of three quarters of the steps is far behind the first hand-over.
    const auto run = with(all * 3 / 4);
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    EXPECT_GT(run.phases.size(), 2U);
    EXPECT_LE(taken(run), all * 3 / 4);
    EXPECT_EQ(with(all + 1).outcome, Outcome::reached_end);
}

/// With modes, whose reset leads from one field into the other and back: endless at one instant.
struct Relay {
    using State = Eigen::Matrix<double, 1, 1>;
    SlidingMode inclusion;
    static constexpr std::size_t mode_count = 2;  // 0: w > 0, 1: w < 0

    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        inclusion.smooth(t, x, dxdt);
        dxdt[0] += mode == 0 ? -inclusion.parameters().gain : inclusion.parameters().gain;
    }
    [[nodiscard]] static GuardInfo guard_info()
    {
        GuardInfo info;
        info.unilateral = true;
        return info;
    }
    [[nodiscard]] static double guard(Mode mode, double /*t*/, const State& x)
    {
        return mode == 0 ? x[0] : -x[0];
    }
    static Mode reset(Mode mode, double /*t*/, State& /*x*/) { return 1 - mode; }
    [[nodiscard]] static Mode start_mode(double /*t*/, const State& x) { return x[0] > 0 ? 0 : 1; }
    [[nodiscard]] const SlidingMode& set_valued() const { return inclusion; }
};

TEST(EventHandOver, TwoFieldsThatPointAtEachOtherSlide)
{
    const Relay relay;
    const auto run = integrate(relay, Relay::State(Relay::State::Constant(SlidingMode::start)),
                               {.t_end = SlidingMode::t_end, .rtol = 1e-12, .atol = 1e-13});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.phases.size(), 2U);
    // As `HandOver.SlidingModeReachesZeroInTimeAndStaysThereToTheBit`.
    EXPECT_NEAR(run.phases[1].from, 0.093315472931294579027, 1e-12);
    EXPECT_EQ(run.x[0], 0);
}

TEST(EventHandOver, AnInclusionAloneNeedsNoOtherCall)
{
    const auto run =
        integrate(SlidingMode{}, SlidingMode::Vector(SlidingMode::Vector::Constant(0.15)),
                  {.t_end = 0.5, .rtol = 1e-12, .atol = 1e-13});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 1U);
    EXPECT_NEAR(run.events[0].t, 0.093315472931294579027, 1e-12);
}

TEST(EventHandOver, RefusesWhatAHandOverDoesNotHave)
{
    const Belt belt;
    const Belt::State x0{2, 0};
    EXPECT_THROW((void)integrate(belt, x0, {.t_end = 1, .stop_at_event = true}),
                 std::invalid_argument);
    EXPECT_THROW((void)integrate(belt, x0, {.t_end = -1}), std::invalid_argument);
    EXPECT_THROW((void)integrate(belt, x0, {.t_end = 1, .rtol = -1}), std::invalid_argument);
}

}  // namespace
}  // namespace ricochet
