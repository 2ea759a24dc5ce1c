// As events_test.cpp, accumulation_test.cpp and resolved_guard_test.cpp, with as many random cases
// as take a minute.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "accumulating_systems.hpp"
#include "problems/near_tangent.hpp"
#include "random_guards.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"

namespace ricochet::events_full_test {
namespace {

/// Crossings and touches of a run over 20 s, to be compared with those of the closed form.
struct Found {
    std::size_t crossings = 0;
    std::size_t touches = 0;
    std::size_t expected = 0;  ///< crossings, or touches where the depth is zero
};

Found find(double depth, double phase)
{
    constexpr double t_end = 20;
    constexpr double two_pi = 6.283185307179586;
    const NearTangent system({.depth = depth, .phase = phase});
    const auto run =
        integrate(system, system.start(), {.t_end = t_end, .rtol = 1e-14, .atol = 1e-15},
                  ErrorControlled<Fehlberg78>{});
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    Found found;
    for (const auto& event : run.events) {
        (event.kind == EventKind::touch ? found.touches : found.crossings) += 1;
    }
    const double width = depth > 0 ? 2 * std::asin(std::sqrt(depth / 2)) : 0;
    for (int n = 1; two_pi * n - phase - width <= t_end && depth >= 0; ++n) {
        found.expected += 1 + (depth > 0 && two_pi * n - phase + width <= t_end);
    }
    return found;
}

TEST(NearTangentInFull, AllPairsAreFoundAboveTwiceTheTouchBandAndNoneIsInvented)
{
    // The band: 64 units in the last place of the guard's size, which is 2 at a trough.
    const double band = 64 * std::numeric_limits<double>::epsilon() * 2;
    std::vector<double> depths{0, -1e-12, -1e-9, -1e-6, -1e-3};
    for (int k = 2; std::pow(10.0, -k) > 2 * band; ++k) depths.push_back(std::pow(10.0, -k));
    for (const double depth : depths) {
        std::mt19937_64 random(20'260'101);
        std::uniform_real_distribution<double> phases(0.5, 5.5);
        for (int k = 0; k < 2000; ++k) {
            const double phase = phases(random);
            const Found found = find(depth, phase);
            ASSERT_EQ(depth == 0 ? found.touches : found.crossings, found.expected)
                << depth << ' ' << phase;
            ASSERT_EQ(depth == 0 ? found.crossings : found.touches, 0U) << depth << ' ' << phase;
        }
    }
}

TEST(AccumulationInFull, OfAHundredThousandRandomBallsNoneFallsThroughItsFloorOrFlutters)
{
    for (std::uint32_t seed = 1; seed <= 100'000; ++seed) {
        EXPECT_EQ(test::fault_of(seed), "") << seed;
    }
}

TEST(ResolvedGuardsInFull, OfAHundredThousandNoDipWiderThanAnEighthOfItsStepIsMissed)
{
    for (std::uint32_t seed = 1; seed <= 100'000; ++seed) {
        EXPECT_LE(test::misses_of(seed).widest, 0.125) << seed;
    }
}

}  // namespace
}  // namespace ricochet::events_full_test
