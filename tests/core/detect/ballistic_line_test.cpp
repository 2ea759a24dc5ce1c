#include "app/ballistic_line.hpp"

#include <gtest/gtest.h>

#include "ricochet/integrate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::ballistic_line_test {
namespace {

template <class Stepping>
void expect_exact(const Options& options)
{
    const auto exact = integrate(BouncingBall(), {10.0, 0.0}, options, Stepping{}, Ends{});
    const auto line = integrate(BouncingBall(), {10.0, 0.0}, options, Stepping{}, BallisticLine{});
    ASSERT_EQ(line.events.size(), 13u);
    for (std::size_t i = 0; i < 13; ++i) {
        EXPECT_EQ(line.events[i].t, exact.events[i].t);
    }
    EXPECT_EQ(line.statistics.missed_events, 0u);
    EXPECT_EQ(line.statistics.false_alarms, 0u);
    EXPECT_EQ(line.statistics.checks_deferred + 13, line.statistics.steps);
}

TEST(BallisticLine, PredictsTheBallWithoutAMistake)
{
    for (const double h : {1e-3, 0.01, 0.1, 1.0}) {
        expect_exact<FixedStep<Rk4>>({.t_end = 20.5, .step = h});
    }
    expect_exact<ErrorControlled<Dopri5>>({.t_end = 20.5});
}

}  // namespace
}  // namespace ricochet::ballistic_line_test
