// Random inclusions beside events that have nothing to do with them: the events come when they have
// to, and the motion of the inclusion does not notice them.

#include "random_phases.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/ricochet.hpp"

namespace ricochet::random_phases_test {
namespace {

using test::InclusionFamily;
using test::random_inclusion;
using test::RandomInclusion;
using test::WithSawtooth;

using State = std::array<double, 6>;

/// The implicit steps of the reference are of order two, but of order one across changes that are
/// not located: as for `ReferenceMotion::allowed`, a thousandth of the motion, or its change in two
/// steps.
constexpr double of_motion = 1e-3;

#ifndef RICOCHET_RANDOM_PHASES
#define RICOCHET_RANDOM_PHASES 20
#endif
constexpr std::uint64_t seeds = RICOCHET_RANDOM_PHASES;

template <int M>
[[nodiscard]] Options options_of(const WithSawtooth<M>& system, double rtol = 1e-9)
{
    return {.t_end = system.inclusion.t_end, .rtol = rtol, .atol = rtol / 100};
}

template <class Run, int M>
void expect_teeth(const Run& run, const WithSawtooth<M>& system)
{
    const std::vector<double> expected = system.expected();
    const bool stops = expected.size() == system.teeth;
    EXPECT_EQ(run.outcome, stops ? Outcome::stopped_by_event : Outcome::reached_end);
    std::vector<double> found;
    for (const auto& event : run.events) {
        if (event.guard == 0 && event.kind != EventKind::time) found.push_back(event.t);
    }
    ASSERT_EQ(found.size(), expected.size());
    // The sawtooth is linear, and exact in every kind of step; 1e-9 holds the solver's tolerance.
    for (std::size_t k = 0; k < found.size(); ++k) {
        EXPECT_NEAR(found[k], expected[k], 1e-9 * system.inclusion.t_end);
    }
}

/// The motion of the inclusion alone up to t, by steps five times as short.
template <int M>
void expect_motion_of_inclusion(const State& x, double t, const RandomInclusion<M>& inclusion)
{
    HandOverOptions options{.t_end = t, .rtol = 1e-9, .atol = 1e-11};
    options.set_valued.step = inclusion.t_end / 5000;
    const auto alone = hand_over(inclusion, inclusion.start, options);
    ASSERT_EQ(alone.outcome, Outcome::reached_end);
    Eigen::Matrix<double, 6, 1> rate;
    inclusion.smooth(t, alone.x, rate);
    rate += inclusion.lever * Eigen::Map<const Eigen::Matrix<double, M, 1>>(alone.reaction.data());
    rate[4] = 0;
    const double h = inclusion.t_end / 1000;
    const double allowed = std::max(
        {of_motion * alone.x.cwiseAbs().maxCoeff(), 2 * h * rate.cwiseAbs().maxCoeff(), of_motion});
    for (std::size_t i = 0; i < x.size(); ++i) {
        if (i == 4) continue;
        EXPECT_NEAR(x[i], alone.x[static_cast<Eigen::Index>(i)], allowed) << i;
    }
}

/// Each step has an error of at most its tolerance, of which the motion makes at most ten times as
/// much; a tenth of the tolerance leaves a fifth of it in steps of order two.
void expect_errors_of_steps(const Run<State>& run, const State& x)
{
    const auto steps = static_cast<double>(run.statistics.steps);
    double size = 1;
    for (const double component : x) size = std::max(size, std::fabs(component));
    for (std::size_t i = 0; i < x.size(); ++i) {
        EXPECT_NEAR(run.x[i], x[i], 10 * steps * 1e-9 * size) << i;
    }
}

/// Whether the run ended by itself, with a word about it.
[[nodiscard]] bool gave_up(Outcome outcome)
{
    return outcome != Outcome::reached_end && outcome != Outcome::stopped_by_event;
}

/// Returns false if the run ended with a word about it.
template <int M>
[[nodiscard]] bool follow(const RandomInclusion<4>& full, std::uint64_t seed)
{
    const auto system = WithSawtooth<M>::make(test::without_unused<M>(full), seed);
    State x0;
    for (std::size_t i = 0; i < 6; ++i) x0[i] = full.start[static_cast<Eigen::Index>(i)];
    const auto run = integrate(system, x0, options_of(system));
    if (gave_up(run.outcome)) return false;
    expect_teeth(run, system);
    expect_motion_of_inclusion(run.x, run.t, system.inclusion);
    const auto finer = integrate(system, x0, options_of(system, 1e-10));
    if (gave_up(finer.outcome)) return false;
    expect_errors_of_steps(run, finer.x);

    Simulation stepped(system, x0, options_of(system));
    for (int k = 1; stepped.step(); ++k) {
        if (k % 10 == 0) stepped.restore(stepped.save());
    }
    const auto again = stepped.finish();
    EXPECT_EQ(again.t, run.t);
    EXPECT_EQ(again.x, run.x);
    return true;
}

[[nodiscard]] bool follow(const RandomInclusion<4>& full, std::uint64_t seed)
{
    switch (full.reactions) {
        case 1: return follow<1>(full, seed);
        case 2: return follow<2>(full, seed);
        case 3: return follow<3>(full, seed);
        default: return follow<4>(full, seed);
    }
}

class RandomPhases : public testing::TestWithParam<std::size_t> {};

TEST_P(RandomPhases, EventsBesideAnInclusionComeWhenTheyHaveTo)
{
    const auto family = static_cast<InclusionFamily>(GetParam());
    std::vector<std::uint64_t> reported;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        if (!follow(random_inclusion<4>(family, seed), seed)) reported.push_back(seed);
    }
    EXPECT_LE(reported.size(), seeds / 1000) << testing::PrintToString(reported);
}

INSTANTIATE_TEST_SUITE_P(Families, RandomPhases,
                         testing::Range<std::size_t>(0, test::family_names.size() - 1));

}  // namespace
}  // namespace ricochet::random_phases_test
