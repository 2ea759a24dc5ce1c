// Random inclusions with several relays, contacts and diodes, against backward Euler.

#include "random_inclusions.hpp"

#include <gtest/gtest.h>

#include "law_at_end.hpp"

namespace ricochet::random_inclusions_test {
namespace {

using test::InclusionFamily;
using test::random_inclusion;
using test::RandomInclusion;
using test::ReferenceMotion;

constexpr int samples = 8;

/// One instantiation for all families.
template <int M>
[[gnu::noinline]] Run<StateOf<RandomInclusion<M>>> run_of(const RandomInclusion<M>& system,
                                                          double divisions)
{
    HandOverOptions options{.t_end = system.t_end, .max_steps = 100'000};
    options.sample_times = test::equal_times(system.t_end, samples);
    options.set_valued.step = system.t_end / divisions;
    return hand_over(system, system.start, options);
}

/// Three step lengths: none may be wrong, and the law must hold at the end.
template <int M>
void follow(InclusionFamily family, std::uint64_t seed, int reference_steps)
{
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const RandomInclusion<M> system = random_inclusion<M>(family, seed);
    const ReferenceMotion reference(system, reference_steps, samples);
    ASSERT_TRUE(reference.solved);
    for (const double divisions : {200, 1000, 5000}) {
        const auto run = run_of<M>(system, divisions);
        ASSERT_EQ(run.outcome, Outcome::reached_end) << name(run.outcome);
        const double h = system.t_end / divisions;
        for (std::size_t i = 0; i < run.trajectory.x.size(); ++i) {
            EXPECT_LE(reference.error(i, run.trajectory.x[i]), reference.allowed(h))
                << "T / " << divisions << " at " << run.trajectory.t[i];
        }
        EXPECT_LE(test::law_violation_at_end(system, run, h), 1e-6);
    }
}

void follow_family(InclusionFamily family)
{
    for (std::uint64_t seed = 0; seed < 3; ++seed) follow<4>(family, seed, 2000);
}

TEST(RandomInclusions, ExitsFromRestAreNotSteppedOver)
{
    follow_family(InclusionFamily::relay_from_rest);
    follow_family(InclusionFamily::relay_at_its_limit);
}

TEST(RandomInclusions, RelaysSlideOnTheirIntersections)
{
    follow_family(InclusionFamily::coupled_relays);
}

TEST(RandomInclusions, ContactsThatDependOnOneAnotherAgreeWithTheirVelocities)
{
    follow_family(InclusionFamily::redundant_chain);
    follow_family(InclusionFamily::chain);
    follow_family(InclusionFamily::dependent);
    follow_family(InclusionFamily::four_contacts);
}

TEST(RandomInclusions, DiodesAlsoOpposed)
{
    follow_family(InclusionFamily::diodes);
    follow_family(InclusionFamily::opposed_diodes);
    follow_family(InclusionFamily::one_sided);
}

TEST(RandomInclusions, ControllersAndWeakeningFriction)
{
    follow_family(InclusionFamily::twisting);
    follow_family(InclusionFamily::super_twisting);
    follow_family(InclusionFamily::weakening);
}

TEST(RandomInclusions, ARelayTwoIntegrationsAwayIsCrossedAtAnySpeed)
{
    // Regression: for x2 >= 2, a reaction with no effect on x1' was mistaken for one that holds it.
    auto system = random_inclusion<4>(InclusionFamily::twisting, 0);
    for (const double speed : {1.0, 3.0, 100.0, 1e6}) {
        system.start[0] = -0.1 * speed;
        system.start[1] = speed;
        system.t_end = 0.2;
        const auto run = run_of<4>(system, 1000);
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_FALSE(run.phases.size() > 1) << name(run.phases[1].cause) << " at " << speed;
    }
}

}  // namespace
}  // namespace ricochet::random_inclusions_test
