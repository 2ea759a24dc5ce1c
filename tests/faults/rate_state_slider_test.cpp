// The slider in the event loop, beside variational steps.
#include "ricochet/faults/spring_slider.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "ricochet/integrate/integrate.hpp"

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
