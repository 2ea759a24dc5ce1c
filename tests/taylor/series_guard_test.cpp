#include "ricochet/detail/series_guard.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <random>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/taylor/detail/series_root.hpp"
#include "ricochet/taylor/taylor.hpp"

namespace ricochet::series_guard_test {
namespace {

using detail::first_leaving;
using detail::GuardSeries;
using detail::series_clears;
using detail::SeriesInterval;
using Kind = SeriesInterval::Kind;

/// The coefficients of the product of (s - root) over all roots, times `factor`, up to order 12.
[[nodiscard]] std::vector<double> with_roots(const std::vector<double>& roots, double factor)
{
    std::vector<double> c(13);
    c[0] = factor;
    int degree = 0;
    for (const double root : roots) {
        ++degree;
        for (int k = degree; k > 0; --k) {
            c[static_cast<std::size_t>(k)] =
                c[static_cast<std::size_t>(k) - 1] - root * c[static_cast<std::size_t>(k)];
        }
        c[0] *= -root;
    }
    return c;
}
/// The polynomial as a guard in a step of length 1.
[[nodiscard]] GuardSeries guard_of(const std::vector<double>& c, double sign, bool from_surface)
{
    return {.terms = {c.data(), 12, 1}, .h = 1, .sign = sign, .from_surface = from_surface};
}

/// The first event of the polynomial in a step of length 1.
[[nodiscard]] SeriesInterval first_of(const std::vector<double>& c, double sign, bool from_surface)
{
    double end = 0;
    for (const double term : c) end += term;
    return first_leaving(guard_of(c, sign, from_surface), {.s = 0, .value = c[0]},
                         {.s = 1, .value = end});
}

TEST(SeriesGuard, ExclusionIsNeverSaidOfAPolynomialThatReachesZero)
{
    // Random roots, one or two of them in the step: an interval reported as clear has none.
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> within(0.001, 0.999), outside(1.05, 6);
    int cleared = 0;
    for (int k = 0; k < 20'000; ++k) {
        std::vector<double> roots;
        const int inside = k % 3;
        for (int i = 0; i < inside; ++i) roots.push_back(within(random));
        for (int i = 0; i < 5; ++i) roots.push_back((i % 2 == 0 ? 1 : -1) * outside(random));
        std::vector<double> c = with_roots(roots, 1);
        const double sign = c[0] > 0 ? 1 : -1;
        const bool clear = series_clears(guard_of(c, sign, false));
        EXPECT_FALSE(clear && inside > 0);
        cleared += clear;
        const SeriesInterval first = first_of(c, sign, false);
        EXPECT_TRUE(inside > 0 || first.kind == Kind::clear);
        if (inside == 1) {
            EXPECT_EQ(first.kind, Kind::crossing);
            EXPECT_LE(first.lo, roots[0]);
            EXPECT_GE(first.hi, roots[0]);
        }
        if (inside == 2) {
            EXPECT_NE(first.kind, Kind::clear);
            const double root = std::min(roots[0], roots[1]);
            EXPECT_LE(first.lo, root + 1e-12);
            EXPECT_GE(first.hi, root - 1e-12);
        }
    }
    EXPECT_GT(cleared, 500);
}

TEST(SeriesGuard, ARootAtTheStartIsDividedOut)
{
    const std::vector<double> c = with_roots({0, 0.75}, -1);
    GuardSeries guard = guard_of(c, 1, true);
    EXPECT_FALSE(series_clears(guard));
    guard.h = 0.5;
    EXPECT_TRUE(series_clears(guard));
    const SeriesInterval first = first_of(c, 1, true);
    EXPECT_EQ(first.kind, Kind::crossing);
    EXPECT_LE(first.lo, 0.75);
    EXPECT_GE(first.hi, 0.75);
}

/// A rotation, and a wall that its first component exceeds by `depth`.
struct Grazing {
    using State = std::array<double, 2>;
    static constexpr bool resets = false;
    static constexpr Crossing crossing = Crossing::either;
    double depth = 0;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return (1.0 - x[0]) - depth;
    }
};

/// The same with a guard that is not linear; the wall has a second side.
struct SquareGrazing : Grazing {
    template <class S>
    [[nodiscard]] constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        return (1.0 - depth) * (1.0 - depth) - x[0] * x[0];
    }
};

template <class System>
class NearlyTangent : public testing::Test {
};
using Walls = testing::Types<Grazing, SquareGrazing>;
TYPED_TEST_SUITE(NearlyTangent, Walls);

TYPED_TEST(NearlyTangent, PairsOfCrossingsAreFoundDownToRoundingAndNoneIsInvented)
{
    // cos(t - phase) is beyond 1 - depth for 2 sqrt(2 depth) around the phase. Steps of this motion
    // have errors of some 1e-16.
    std::mt19937_64 random(2);
    std::uniform_real_distribution<double> phases(1, 1.9);
    for (const double depth : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13, 1e-14}) {
        for (int k = 0; k < 2000; ++k) {
            const double phase = phases(random);
            const Grazing::State x0{std::cos(phase), std::sin(phase)};
            // Half a turn before the crest, and less than one after.
            const Options options{.t_end = phase + 1.2, .rtol = 1e-15, .atol = 1e-15};
            const auto pair = integrate(TypeParam{depth}, x0, options, ErrorControlled<Taylor>{});
            ASSERT_EQ(pair.events.size(), 2U) << depth << " at " << phase;
            const double half = std::acos(1 - depth);
            // Half the width is sqrt(2 depth): an error of 5e-16 of the depth is one of
            // 5e-16 / sqrt(2 depth) of the time.
            const double tolerance = 1e-14 + 1e-15 / std::sqrt(depth);
            EXPECT_NEAR(pair.events[0].t, phase - half, tolerance);
            EXPECT_NEAR(pair.events[1].t, phase + half, tolerance);
            const auto miss = integrate(TypeParam{-depth}, x0, options, ErrorControlled<Taylor>{});
            EXPECT_EQ(miss.events.size(), 0U) << -depth << " at " << phase;
        }
    }
}

TEST(SeriesGuard, RootsAreLocatedAndAreTheFirst)
{
    // One root in the step, or three: Newton's method may converge to any of three, and only the
    // first may be reported as the first.
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> within(0.001, 0.999), outside(1.5, 6);
    int found = 0;
    for (int k = 0; k < 20'000; ++k) {
        std::vector<double> roots;
        const int inside = 1 + 2 * (k % 2);
        for (int i = 0; i < inside; ++i) roots.push_back(within(random));
        for (int i = 0; i < 4; ++i) roots.push_back((i % 2 == 0 ? 1 : -1) * outside(random));
        const bool from_surface = k % 3 == 0;
        if (from_surface) roots.push_back(0);
        const std::vector<double> c = with_roots(roots, 1);
        const double ahead = from_surface ? c[1] : c[0];
        const double sign = ahead > 0 ? 1 : -1;
        double end = 0;
        for (const double term : c) end += term;
        detail::SeriesRoot root;
        if (!detail::find_first_root(guard_of(c, sign, from_surface), sign * end, root)) continue;
        ++found;
        double first = 1;
        for (const double r : roots) first = r > 0 ? std::min(first, r) : first;
        // The last correction is no more than 2^-13 of a root, and its square over the distance of
        // the next root, down to 1e-3, is left to the guard.
        EXPECT_NEAR(root.s, first, 2e-5);
        EXPECT_LT(sign * root.slope, 0);
    }
    EXPECT_GT(found, 9'000);
}

/// Harmonic motion with a guard that varies many times in a step of the motion.
struct Harmonic {
    using State = std::array<double, 2>;
    template <class S>
    constexpr void flow(const S& /*t*/, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -x[0];
    }
};
struct FastClock : Harmonic {
    static constexpr bool resets = false;
    template <class S>
    constexpr S guard(const S& t, const std::array<S, 2>& /*x*/) const
    {
        using std::sin;
        return sin(10.0 * t);
    }
};
struct Corrugated : Harmonic {
    static constexpr bool resets = false;
    template <class S>
    constexpr S guard(const S& /*t*/, const std::array<S, 2>& x) const
    {
        using std::sin;
        return sin(40.0 * x[0]) + 0.5;
    }
};

TEST(SeriesGuard, ASeriesThatHasNotConvergedIsNoEvidence)
{
    const auto clock = integrate(FastClock{}, Harmonic::State{1, 0},
                                 {.t_start = 0.01, .t_end = 100}, ErrorControlled<Taylor>{});
    ASSERT_EQ(clock.events.size(), 159u);
    // sin falls through zero where 10 t is an odd multiple of pi.
    for (std::size_t k = 0; k < clock.events.size(); ++k) {
        const double exact = (2.0 * static_cast<double>(k) + 1) * std::numbers::pi / 10;
        EXPECT_NEAR(clock.events[k].t, exact, 4e-14 * (1 + exact));
    }
    for (const double tolerance : {1e-6, 1e-10, 1e-14}) {
        const Options options{.t_end = 20, .rtol = tolerance, .atol = tolerance};
        const auto ours =
            integrate(Corrugated{}, Harmonic::State{2, 0.3}, options, ErrorControlled<Taylor>{});
        EXPECT_EQ(ours.events.size(), 158u) << tolerance;
    }
}

TEST(SeriesGuard, StepsThatTheSeriesClearsAreProved)
{
    const auto run = integrate(Grazing{-1}, Grazing::State{1, 0}, {.t_end = 100, .rtol = 1e-12},
                               ErrorControlled<Taylor>{});
    EXPECT_EQ(run.statistics.evidence.proved, run.statistics.steps);
    // One value at each end, and a difference for its rate where it is armed.
    EXPECT_LE(run.statistics.guard_calls, run.statistics.steps + 12);
}

}  // namespace
}  // namespace ricochet::series_guard_test
