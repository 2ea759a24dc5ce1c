// Guards that the steps of the state do not resolve, that decay, touch in a kink, end the
// domain of the flow or are not finite.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "random_guards.hpp"
#include "ricochet/detect/ends.hpp"
#include "ricochet/integrate/integrate.hpp"

namespace ricochet {
namespace {

using test::Draining;
using test::Misses;
using test::misses_of;
using test::Spiral;
using X1 = std::array<double, 1>;

TEST(ResolvedGuards, OfThreeHundredMovingGuardsNoDipIsMissed)
{
    std::size_t roots = 0;
    for (std::uint32_t seed = 1; seed <= 300; ++seed) {
        const Misses misses = misses_of(seed);
        roots += misses.roots;
        EXPECT_LT(misses.widest, 0.125) << seed;
        EXPECT_EQ(misses.missed, 0u) << seed;
    }
    EXPECT_GT(roots, 20'000u);
}

TEST(ResolvedGuards, WithoutTheLookInsideMostAreLost)
{
    std::size_t roots = 0;
    std::size_t missed = 0;
    for (std::uint32_t seed = 1; seed <= 30; ++seed) {
        const Misses misses = misses_of(seed, false);
        roots += misses.roots;
        missed += misses.missed;
    }
    EXPECT_GT(2 * missed, roots);
}

/// Four crossings within one step, of which the ends show none.
struct FourCrossings {
    static constexpr bool resets = false;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const
    {
        return (x[0] - 1) * (x[0] - 3) * (x[0] - 6) * (x[0] - 8);
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.crossing = Crossing::either}; }
};

TEST(ResolvedGuards, FourCrossingsInOneStepAreFourEvents)
{
    const auto run = integrate(FourCrossings{}, X1{0}, {.t_end = 9, .step = 9}, FixedStep<Rk4>{});
    ASSERT_EQ(run.events.size(), 4u);
    EXPECT_EQ(run.statistics.steps, 1u);
    EXPECT_EQ(run.statistics.refined_steps, 1u);
    EXPECT_EQ(run.statistics.unresolved_steps, 0u);
}

TEST(ResolvedGuards, ADecayingGuardKeepsAllItsCrossingsDownTo1em260)
{
    for (const Spiral::Kind kind : {Spiral::product, Spiral::component, Spiral::cube}) {
        const Spiral spiral{.kind = kind, .decay = 2};
        // exp(-2 t) to the power of the guard
        const double end = kind == Spiral::product ? 150 : kind == Spiral::component ? 300 : 100;
        const auto run = integrate(spiral, Spiral::start, {.t_end = end, .rtol = 1e-8, .atol = 0});
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.x[2], spiral.crossings(end)) << kind;
        EXPECT_EQ(static_cast<double>(run.events.size()), run.x[2]) << kind;
    }
}

/// Reaches its surface in a kink, flat, or with an infinite slope, and turns back.
struct Kink {
    double power = 1;
    double at = 1;
    static constexpr bool resets = false;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const
    {
        return std::pow(std::fabs(x[0] - at), power);
    }
};

TEST(ResolvedGuards, TouchesInAKinkAreRecorded)
{
    for (const double power : {0.5, 1.0, 1.5, 2.0, 4.0}) {
        for (int i = 0; i < 20; ++i) {
            const Kink kink{.power = power, .at = 0.0637 + 0.481 * i};
            const auto run = integrate(kink, X1{0}, {.t_end = 10});
            ASSERT_EQ(run.events.size(), 1u) << power << ' ' << kink.at;
            EXPECT_EQ(run.events[0].kind, EventKind::touch);
            // |u|^power <= 64 units in the last place of 10^power, or rounding of u
            const double flat = 10 * std::pow(1.5e-14, 1 / power);
            EXPECT_NEAR(run.events[0].t, kink.at, 4 * flat + 1e-9) << power;
        }
    }
}

TEST(ResolvedGuards, AFlowThatEndsAtItsSurfaceHasItsEventThere)
{
    for (const Draining::Kind kind : {Draining::root, Draining::torricelli, Draining::logarithm}) {
        const Draining tank{.kind = kind};
        const Options options{.t_end = 5, .rtol = 1e-13, .atol = 1e-26, .stop_at_event = true};
        const auto run = integrate(tank, X1{1}, options);
        ASSERT_EQ(run.outcome, Outcome::stopped_by_event) << kind;
        ASSERT_EQ(run.events.size(), 1u);
        EXPECT_NEAR(run.t, tank.empty(), 1e-12 * tank.empty()) << kind;
        EXPECT_GE(run.x[0], 0);

        const auto fixed = integrate(tank, X1{1}, {.t_end = 5, .step = 1e-3, .stop_at_event = true},
                                     FixedStep<Rk4>{});
        ASSERT_EQ(fixed.outcome, Outcome::stopped_by_event) << kind;
        EXPECT_NEAR(fixed.t, tank.empty(), 1e-4) << kind;
    }
}

/// The flow is no number beyond x = 1, where no guard is.
struct Nowhere {
    void flow(double, const X1& x, X1& dxdt) const { dxdt = {1 + std::sqrt(1 - x[0])}; }
    [[nodiscard]] double guard(double, const X1& x) const { return 3 - x[0]; }
};

TEST(ResolvedGuards, AFlowThatEndsElsewhereIsNotFinite)
{
    const auto run = integrate(Nowhere{}, X1{0}, {.t_end = 5, .stop_at_event = true});
    EXPECT_EQ(run.outcome, Outcome::non_finite);
    EXPECT_TRUE(run.events.empty());
}

struct NotFinite {
    double beyond;
    static constexpr bool resets = false;
    void flow(double, const X1&, X1& dxdt) const { dxdt = {1}; }
    [[nodiscard]] double guard(double, const X1& x) const { return x[0] > 2.5 ? beyond : 1 + x[0]; }
};

TEST(ResolvedGuards, AGuardThatIsNotFiniteEndsTheRunWhateverItsSign)
{
    constexpr double infinity = std::numeric_limits<double>::infinity();
    for (const double beyond : {infinity, -infinity, std::nan("")}) {
        const auto run = integrate(NotFinite{beyond}, X1{0}, {.t_end = 10});
        EXPECT_EQ(run.outcome, Outcome::non_finite) << beyond;
        EXPECT_LE(run.t, 2.5);
        EXPECT_EQ(run.guard, 0u);
        const auto ends =
            integrate(NotFinite{beyond}, X1{0}, {.t_end = 10}, ErrorControlled<Dopri5>{}, Ends{});
        EXPECT_EQ(ends.outcome, Outcome::non_finite) << beyond;
    }
}

}  // namespace
}  // namespace ricochet
