// Flows that jump at time events, in kernels with the flow inlined.
#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "ricochet/integrate.hpp"

namespace ricochet {
namespace {

/// x' = (t > 1) or (t >= 1), with a time event at 1; the event adds nothing.
struct InlinedSwitch {
    using State = std::array<double, 1>;
    bool at_once = false;
    void flow(double t, const State& /*x*/, State& dxdt) const
    {
        dxdt[0] = (at_once ? t >= 1 : t > 1) ? 1 : 0;
    }
    [[nodiscard]] double next_time_event(double t) const { return t < 1 ? 1 : 1e300; }
};

TEST(InlinedJumps, AFlowThatJumpsAtATimeEventIsIntegratedOnBothSides)
{
    constexpr double rounding = 8 * std::numeric_limits<double>::epsilon();
    for (const bool at_once : {false, true}) {
        const InlinedSwitch system{at_once};
        const InlinedSwitch::State x0{0};
        EXPECT_NEAR(integrate(system, x0, {.t_end = 2}).x[0], 1, rounding);
        EXPECT_NEAR(integrate(system, x0, {.t_end = 2}, ErrorControlled<Fehlberg78>{}).x[0], 1,
                    rounding);
        EXPECT_NEAR(integrate(system, x0, {.t_end = 2, .step = 0.1}, FixedStep<Rk4>{}).x[0], 1,
                    rounding);
    }
}

}  // namespace
}  // namespace ricochet
