// The slider in the event loop, beside variational steps.
#include "ricochet/faults/spring_slider.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "ricochet/integrate.hpp"

namespace ricochet::rate_state_slider_test {
namespace {

constexpr double threshold = 2e-4;  // [m/s]

SpringSlider stick_slip()
{
    SpringSlider slider;
    const RateStateParameters& p = slider.friction;
    slider.block.stiffness = 0.6 * critical_stiffness(p, 1, 9.81, 1.5e-4);
    slider.load =
        SliderLoad(9.81 * p.f_star / slider.block.stiffness, {{0, 1.5e-4}, {0.15, 1.2e-4}});
    return slider;
}

TEST(RateStateSlider, HasTheEventsOfVariationalSteps)
{
    // Both at 1e-10 for every step, over one cycle; between two methods the errors of some
    // thousand steps remain, and log V changes by 10 to 1e3 per second at the threshold.
    const SpringSlider slider = stick_slip();
    const SliderState start = slider_case_start();
    const RateStateSlider system(slider, threshold);
    const auto loop =
        integrate(system, system.start(start), {.t_end = 0.3, .rtol = 1e-10, .atol = 1e-10});
    const SliderRun steps =
        run_slider(slider, start, {.t_end = 0.3, .rtol = 1e-10, .threshold = threshold});

    ASSERT_EQ(loop.outcome, Outcome::reached_end);
    ASSERT_EQ(steps.outcome, Outcome::reached_end);
    std::size_t matched = 0;
    for (const auto& event : loop.events) {
        if (event.kind != EventKind::crossing) continue;  // the corner of the load
        ASSERT_LT(matched, steps.events.size());
        EXPECT_NEAR(event.t, steps.events[matched].at.t, 1e-8);
        EXPECT_EQ(event.slope > 0, steps.events[matched].kind == SliderEventKind::onset);
        ++matched;
    }
    EXPECT_EQ(matched, steps.events.size());
    EXPECT_GE(matched, 2U);
    EXPECT_NEAR(std::exp(loop.x[1]) * 1e-4 / steps.state.v, 1, 1e-6);
    EXPECT_NEAR(loop.x[0] * 1e-6, steps.state.x, 1e-12);
}

// Friction stops these blocks, which then creep or slide back, within the resolution of time.
TEST(RateStateSlider, StopsWithinTheResolutionOfTime)
{
    SpringSlider creeping;
    creeping.friction = {.a = 0.0045964490879702325,
                         .b = 0.014733529198414129,
                         .f_star = 0.78937926333736363,
                         .v_star = 1.2672082298855943e-06,
                         .d_rs = 4.0241288814008634e-07};
    creeping.evolution = StateEvolution::prz;
    creeping.block = {.mass = 0.023507186209987738,
                      .stiffness = 211161.77215733367,
                      .normal_force = 18.857885154629873};
    creeping.load =
        SliderLoad(7.0495825732940759e-05,
                   {{0, 5.1395195382155542e-07}, {1.49675806688722, 1.5671842779168046e-06}});
    const SliderState start{.v = 6.3123819580566046e-06, .xi = 1.5662212298018794};
    SliderRun last;
    for (const double rtol : {1e-5, 1e-6, 1e-7}) {
        const SliderRun run = run_slider(
            creeping, start, {.t_end = 3.7418951672180496, .rtol = rtol, .threshold = 6.6e-7});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        ASSERT_EQ(run.events.size(), 3U);
        EXPECT_NEAR(run.events[2].at.t, 3.0379365782, 1e-8);
        EXPECT_LT(run.state.v, 1e-20);
        last = run;
    }
    EXPECT_NEAR(last.state.xi, 0.7962468, 1e-6);

    SpringSlider turning = stick_slip();
    const double back = -2e-4;
    const SliderRun run = run_slider(turning, {.v = back}, {.t_end = 1e-3, .rtol = 1e-10});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_FALSE(run.events.empty());
    EXPECT_EQ(run.events[0].kind, SliderEventKind::reversal);
}

TEST(RateStateSlider, RefusesWhatItIsNotFor)
{
    SpringSlider slider = stick_slip();
    EXPECT_THROW(RateStateSlider(slider, 0), std::invalid_argument);
    EXPECT_THROW((void)RateStateSlider(slider, threshold).start({.v = -1e-4}),
                 std::invalid_argument);
    slider.evolution = StateEvolution::slip;
    EXPECT_THROW(RateStateSlider(slider, threshold), std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::rate_state_slider_test
