// As random_inclusions_test.cpp and random_mechanisms_test.cpp, with a thousand systems of each
// family.

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "exact_inclusions.hpp"
#include "law_at_end.hpp"
#include "random_inclusions.hpp"
#include "random_mechanisms.hpp"

namespace ricochet::inclusions_full_test {
namespace {

using test::InclusionFamily;
using test::random_inclusion;
using test::RandomInclusion;
using test::ReferenceMotion;

constexpr std::uint64_t seeds = 1000;
constexpr int samples = 10;

class RandomRunsInFull : public testing::Test {
protected:
    int runs = 0;
    int reported = 0;  ///< runs that end early or are refused, with a sentence

    template <int M>
    void follow(const RandomInclusion<M>& system, const ReferenceMotion& reference,
                double divisions)
    {
        HandOverOptions options{.t_end = system.t_end, .max_steps = 1'000'000};
        options.sample_times = test::equal_times(system.t_end, samples);
        options.set_valued.step = system.t_end / divisions;
        ++runs;
        try {
            const auto run = hand_over(system, system.start, options);
            if (run.outcome != Outcome::reached_end) {
                ++reported;
                return;
            }
            for (std::size_t i = 0; i < run.trajectory.x.size(); ++i) {
                EXPECT_LE(reference.error(i, run.trajectory.x[i]),
                          reference.allowed(options.set_valued.step));
            }
            EXPECT_LE(test::law_violation_at_end(system, run, options.set_valued.step), 1e-6);
        } catch (const std::invalid_argument&) {
            ++reported;
        }
    }

    template <int M>
    void follow_family(InclusionFamily family)
    {
        for (std::uint64_t seed = 0; seed < seeds; ++seed) {
            SCOPED_TRACE(seed);
            const auto system = random_inclusion<M>(family, seed);
            // For small or accumulating motions backward Euler needs more steps.
            const ReferenceMotion reference(system, system.reactions > 2 ? 10'000 : 50'000,
                                            samples);
            // The motion is not known where backward Euler has not converged.
            if (!reference.solved || reference.uncertainty > 1e-2 * reference.size) continue;
            for (const double divisions : {200, 1000, 5000}) follow(system, reference, divisions);
        }
        EXPECT_GT(runs, 0);
        EXPECT_LE(1000 * reported, 14 * runs);
    }
};

class InclusionsInFull : public RandomRunsInFull,
                         public testing::WithParamInterface<std::size_t> {};

TEST_P(InclusionsInFull, AreRightWithinTheOrderOfTheStepAndObeyTheirLaws)
{
    const auto family = static_cast<InclusionFamily>(GetParam());
    if (family == InclusionFamily::five_contacts) {
        follow_family<5>(family);
    } else {
        follow_family<4>(family);
    }
}

INSTANTIATE_TEST_SUITE_P(Families, InclusionsInFull,
                         testing::Range<std::size_t>(0, test::family_names.size()));

TEST_F(RandomRunsInFull, OfFiveDependentReactionsEnd)
{
    // More reactions than modes support: set-valued steps from the start, whose stages are singular
    // for Newton's method.
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
        SCOPED_TRACE(seed);
        const auto system = random_inclusion<5>(InclusionFamily::redundant_chain, seed);
        const ReferenceMotion reference(system, 2000, samples);
        ASSERT_TRUE(reference.solved);
        for (const double divisions : {200, 1000, 5000}) follow(system, reference, divisions);
        EXPECT_EQ(reported, 0);
    }
}

TEST(MechanismsInFull, EveryStepObeysItsLawsAndBalancesEnergy)
{
    test::MechanismTally tally;
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
        test::MechanismMaker(seed).block(tally);
        test::MechanismMaker(seed).woodpecker(tally);
        EXPECT_EQ(test::follow_ball(seed, 50'000, tally.reported), "") << seed;
    }
    EXPECT_EQ(tally.fault, "");
    EXPECT_LE(tally.reported, 5U);
}

}  // namespace
}  // namespace ricochet::inclusions_full_test
