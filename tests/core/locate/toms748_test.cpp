#include "ricochet/locators.hpp"

#include <array>
#include <cmath>

#include "locators.hpp"
#include "ricochet/integrate.hpp"

namespace ricochet::test::toms748_test {
namespace {

INSTANTIATE_TYPED_TEST_SUITE_P(Toms748, LocatorSuite, Toms748);

/// A turning vector, crossed by an oscillating line; the reset counts the parity of the events.
struct TurnsAcrossALine {
    using State = std::array<double, 3>;

    double turning, a, b, size, frequency, phase, level;

    [[nodiscard]] GuardInfo guard_info() const { return {.crossing = Crossing::either}; }
    void flow(double, const State& x, State& dxdt) const
    {
        dxdt = {turning * x[1], -turning * x[0], 0};
    }
    [[nodiscard]] double guard(double t, const State& x) const
    {
        return a * x[0] + b * x[1] + size * std::sin(frequency * t + phase) - level;
    }
    void reset(double, State& x) const { x[2] = -x[2]; }
};

TEST(Toms748, ACrossingAtTheStartOfAStepIsNotFoundOnceMore)
{
    const auto run = [](const TurnsAcrossALine& system, const TurnsAcrossALine::State& x0,
                        double t_start, double t_end) {
        return integrate(system, x0,
                         {.t_start = t_start, .t_end = t_end, .rtol = 1e-11, .atol = 1e-11},
                         ErrorControlled<Fehlberg78>{}, Extremum{}, Toms748{});
    };
    // After an event the guard is a rounding below its surface and still falls, but the rounding of
    // the time raises it above the surface for a moment.
    const auto first = run(
        {0x1.3e9fba09cd0bp-1, -0x1.f72fcecb90652p-1, -0x1.97d807aec0458p-3, 0x1.5206fb73d60c4p-1,
         -0x1.a5a03f5f550d6p+0, 0x1.890fcc1331e56p-1, -0x1.0c0e9feb39376p-3},
        {-0x1.80bf424ec45aep-2, 0x1.ce39cc32ca078p-2, 1}, 0, 12);
    EXPECT_EQ(first.events.size(), 7U);
    EXPECT_EQ(first.x[2], -1);
    const auto second = run(
        {0x1.ed99e751d23ep-1, 0x1.a1d19e02b264cp-1, -0x1.7621195ce2ec4p-2, 0x1.2e154ccc4d5d2p-1,
         0x1.4b3ec4bda1d9ep+0, -0x1.18051be309b08p-2, -0x1.9a04ab5b0b103p-2},
        {0x1.4a16d975fdc4cp-1, 0x1.c173ee06d86b8p-1, 1}, 0x1.9bcf8094a9f7fp+0, 0x1.b379f012953fp+3);
    EXPECT_EQ(second.events.size(), 3U);
    EXPECT_EQ(second.x[2], -1);
}

}  // namespace
}  // namespace ricochet::test::toms748_test
