#include "ricochet/extremum.hpp"
#include "ricochet/locators.hpp"

#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "locators.hpp"
#include "ricochet/integrate.hpp"

namespace ricochet::test::newton_test {
namespace {

INSTANTIATE_TYPED_TEST_SUITE_P(Newton, LocatorSuite, Newton);

TEST(Newton, AParabolaCostsOneStep)
{
    // The first guess is exact on cubics, and the remaining error is removed along the flow.
    const HostStep step(
        19.0, [](double s) { return s * (2.5 - s); }, [](double s) { return 2.5 - 2 * s; });
    (void)locate<Newton>(step, Side::above);
    EXPECT_EQ(step.resteps, 1);
}

TEST(Newton, ASineCostsAtMostFourSteps)
{
    const HostStep step(
        3.0, [](double s) { return std::cos(s); }, [](double s) { return -std::sin(s); });
    (void)locate<Newton>(step, Side::above);
    EXPECT_LE(step.resteps, 4);
}

TEST(Newton, TheSlopeIsTheRateOfTheGuardAtTheEvent)
{
    const HostStep step(
        3.0, [](double s) { return std::cos(s); }, [](double s) { return -std::sin(s); });
    EXPECT_NEAR(locate<Newton>(step, Side::above).slope, -1, 1e-12);
}

TEST(Newton, ARootOfHigherOrderCostsAtMostSixtySteps)
{
    // Newton's method alone gains a factor of 1 - 1/m per sample, which took 100 steps for m = 3
    // and 134 for m = 5.
    for (const int order : {3, 5}) {
        for (const double root : {0.3, 0.7}) {
            const HostStep step(
                1.0, [=](double s) { return -std::pow(s - root, order); },
                [=](double s) { return -order * std::pow(s - root, order - 1); });
            const Location where = locate<Newton>(step, Side::above);
            EXPECT_LT(where.lo, root);
            EXPECT_EQ(where.hi, root);
            EXPECT_LE(where.hi - where.lo, std::numeric_limits<double>::epsilon());
            EXPECT_LE(step.resteps, 60) << "order " << order;
        }
    }
}

/// A guard of time alone, without a rate, beside x' = 1 from x = 0.
struct GuardOfTime {
    using State = std::array<double, 1>;
    static constexpr bool resets = false;

    double (*function)(double);

    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.crossing = Crossing::either}; }
    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = 1;
    }
    template <class X>
    [[nodiscard]] double guard(double, const X& x) const
    {
        return function(x[0]);
    }
};

/// One step from 0 to 1.
Run<GuardOfTime::State> run_once(double (*function)(double))
{
    return integrate(GuardOfTime{function}, {0.0}, {.t_end = 1, .step = 1}, FixedStep<Rk4>{},
                     Ends{});
}

constexpr double root = 0.3141592653589793;

TEST(Newton, FlatRootsWithoutARateAreLocatedToNeighbouringDoubles)
{
    // The difference that replaces the rate spans 2e-5, and contains no information below that.
    for (const auto function :
         {+[](double x) { return std::pow(x - root, 3); },
          +[](double x) { return std::pow(x - root, 5); },
          +[](double x) { return (x - root) * std::fabs(x - root); },
          +[](double x) { return std::pow(std::sin(x - root), 3) * (1 + x * x); },
          +[](double x) { return std::fmax(0, root - x); },
          +[](double x) { return std::pow(std::fmax(0, root - x), 2); }}) {
        const auto run = run_once(function);
        ASSERT_EQ(run.events.size(), 1u);
        const auto& event = run.events[0];
        EXPECT_EQ(event.t, root);
        EXPECT_LE(event.bracket.hi - event.bracket.lo, std::numeric_limits<double>::epsilon() / 2);
        EXPECT_EQ(event.kind, EventKind::crossing);
    }
}

TEST(Newton, TheNoiseOfFloatsEndsTheSearchAndIsStated)
{
    // Each is rounded to a few of 6e-8 of its terms, which are about 1; the slope is 0.5 to 3.
    for (const auto function :
         {+[](double x) -> double { return float(x) - float(root); },
          +[](double x) -> double { return std::sin(3 * (float(root) - float(x))); },
          +[](double x) -> double { return std::cos(2 * float(x)) - float(std::cos(2 * root)); },
          +[](double x) -> double {
              return float(x) * float(x) - 2 * float(x) - float(root * (root - 2));
          }}) {
        const auto run = run_once(function);
        ASSERT_EQ(run.events.size(), 1u);
        EXPECT_NEAR(run.events[0].t, root, 1e-6);
        EXPECT_LE(std::fabs(run.events[0].t - root), run.events[0].error + 1e-6);
        EXPECT_GE(run.events[0].error, 1e-8);
        EXPECT_LE(run.events[0].error, 1e-6);
        // 4 of them for the rates at the ends, up to 5 on the polynomial of the step.
        EXPECT_LE(run.statistics.guard_calls, 45u);
    }
}

TEST(Newton, CloseRootsOfASmoothGuardAreNotTakenForNoise)
{
    // Three roots within 1e-3, 1e-5 and 1e-7 of a step: the guard is below 1e-9, 1e-15 and
    // 1e-21 between them. One of them is found, to the rounding of the factors.
    for (const double gap : {1e-3, 1e-5, 1e-7}) {
        static double gap_;
        gap_ = gap;
        const auto run = run_once([](double x) {
            return (x - root) * (x - root - gap_) * (x - root - 2.5 * gap_) * (1 + x);
        });
        ASSERT_GE(run.events.size(), 1u);
        double off = 1;
        for (const double at : {root, root + gap, root + 2.5 * gap}) {
            off = std::min(off, std::fabs(run.events[0].t - at));
        }
        EXPECT_LE(off, 2e-16) << gap;
    }
}

/// A pendulum of small swings whose guard has any size.
struct Magnified {
    using State = std::array<double, 2>;
    double factor = 1, level = 0;

    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -x[0]}; }
    [[nodiscard]] double guard(double, const State& x) const { return factor * (x[0] - level); }
    void reset(double, State&) const {}
};

TEST(Newton, GuardsOfAnySizeHaveTheirEventsAtTheSameTimes)
{
    for (int k = 1; k < 200; ++k) {
        const double level = 1 - 0.002 * k;
        for (const double factor : {1e-300, 1.0, 1e280, 1e290, 1e298, 1e304, 1.2e308}) {
            const auto run =
                integrate(Magnified{factor, level}, {1.0, 0.0}, {.t_end = 2.2, .rtol = 1e-12});
            ASSERT_EQ(run.events.size(), 1u) << factor << ", " << level;
            // That of the run, and the rounding of the level where the guard is flat: 1e-16 / 0.06.
            EXPECT_NEAR(run.events[0].t, std::acos(level), 1e-10) << factor << ", " << level;
            EXPECT_LT(run.events[0].error, 1e-10) << factor << ", " << level;
        }
    }
}

}  // namespace
}  // namespace ricochet::test::newton_test
