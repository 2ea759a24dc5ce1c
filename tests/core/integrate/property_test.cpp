// Random hybrid systems, run by every method, against their exact runs.
//
// The flows are polynomials, on which the methods are exact, so that a step may be as
// long as a flight and hold any number of crossings.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "exact_run.hpp"
#include "property_check.hpp"
#include "random_systems.hpp"

namespace ricochet::property_test {
namespace {

using test::ExactMotion;
using test::ExactRun;
using test::PropertyReport;
using test::RandomProblem;
using test::RandomSystem;
using test::Write;

std::string text(const PropertyReport& report)
{
    return "problem " + std::to_string(report.first_wrong) + " is the first of " +
           std::to_string(report.unfinished) + " unfinished, " + std::to_string(report.missed) +
           " with missed and " + std::to_string(report.spurious) + " with spurious events, " +
           std::to_string(report.misplaced) + " misplaced, " + std::to_string(report.astray) +
           " astray, " + std::to_string(report.order_dependent) + " that depend on the order";
}

TEST(RandomSystems, LoseNoEventInventNoneAndDoNotDependOnTheOrderOfTheirGuards)
{
    const PropertyReport report = test::check_random_systems(1, 2000);
    EXPECT_EQ(report.wrong(), 0u) << text(report);
    // The sample is large enough.
    EXPECT_GT(report.events, 5000u);
    EXPECT_GT(report.together, 100u);
    EXPECT_GT(report.cascades, 300u);
    EXPECT_LT(report.irregular, 500u);
}

// --- the check itself ---

/// A stone thrown up, x_0'' = -1. Guard 0 records x_0 = 3 / 8 both ways, guard 1 throws it
/// up again from x_0 = 0 with the speed 1, and guard 2, flipped by that, records that the
/// speed exceeds 1 / 2.
RandomProblem throws()
{
    RandomProblem problem;
    RandomSystem& system = problem.system;
    system.flows.push_back({.drift = {0, -1, 0}, .c01 = 1});
    RandomSystem::Guard level{.a = {1, 0, 0}, .level = 0.375};
    level.info = {.crossing = Crossing::either, .resets = false};
    RandomSystem::Guard floor{.a = {1, 0, 0}};
    floor.reset.writes = {Write{Write::put, 0}, Write{Write::put, 1}, Write{}};
    RandomSystem::Guard speed{.a = {0, 1, 0}, .level = 0.5};
    speed.info = {.crossing = Crossing::rising, .resets = false};
    system.guards_of = {level, floor, speed};
    problem.x0 = {0.125, 0.875, 0};
    problem.t_end = 3;
    return problem;
}

TEST(ExactMotion, FollowsAStoneThatIsThrownUpAgain)
{
    // Roots in long double, to a few of its units in the last place, 1e-19.
    const ExactRun run = ExactMotion(throws())();
    ASSERT_TRUE(run.regular);
    // 1 / 8 + 7 t / 8 - t² / 2 = 3 / 8 at (7 +- sqrt 17) / 8, and 0 at (7 + sqrt 65) / 8;
    // from there t - t² / 2 = 3 / 8 at 1 / 2 and 3 / 2.
    const long double up = (7 - std::sqrt(17.0L)) / 8;
    const long double down = (7 + std::sqrt(17.0L)) / 8;
    const long double floor = (7 + std::sqrt(65.0L)) / 8;
    const std::pair<long double, std::size_t> events[] = {
        {up, 0}, {down, 0}, {floor, 1}, {floor, 2}, {floor + 0.5L, 0}};
    ASSERT_EQ(run.events.size(), std::size(events));
    for (std::size_t i = 0; i < std::size(events); ++i) {
        EXPECT_NEAR(static_cast<double>(run.events[i].t - events[i].first), 0, 1e-17) << i;
        EXPECT_EQ(run.events[i].guard, events[i].second) << i;
    }
}

TEST(ExactMotion, DeclinesWhatHangsByAThread)
{
    // Guard 0 is placed so that the stone just touches its level.
    RandomProblem problem = throws();
    problem.system.guards_of[0].level = 0.125 + 0.875 * 0.875 / 2;
    learn::Random random(1);
    EXPECT_FALSE(test::property::expected(problem, random));
}

class ARun : public testing::Test {
protected:
    ARun()
    {
        expected = test::property::expected(problem, random);
        run = test::property::run(problem, 0, 1);
    }

    [[nodiscard]] PropertyReport report() const
    {
        PropertyReport out;
        test::property::compare(run, *expected, problem, out);
        return out;
    }

    learn::Random random{1};
    RandomProblem problem = throws();
    std::optional<test::property::Expected> expected;
    ricochet::Run<RandomSystem::State> run;
};

TEST_F(ARun, ThatIsRightPasses)
{
    ASSERT_TRUE(expected);
    EXPECT_EQ(report().wrong(), 0u);
}

TEST_F(ARun, WithoutAnEventIsFoundOut)
{
    run.events.erase(run.events.begin() + 1);
    EXPECT_EQ(report().missed, 1u);
}

TEST_F(ARun, WithAnEventTwiceIsFoundOut)
{
    run.events.insert(run.events.begin() + 2, run.events[2]);
    EXPECT_EQ(report().spurious, 1u);
}

TEST_F(ARun, WithAnEventABillionthOfASecondLateIsFoundOut)
{
    run.events[1].t += 1e-9;
    EXPECT_EQ(report().misplaced, 1u);
}

TEST_F(ARun, ThatEndsElsewhereIsFoundOut)
{
    run.x[1] += 1e-9;
    EXPECT_EQ(report().astray, 1u);
}

TEST_F(ARun, ThatTurnsInTimeIsFoundOut)
{
    std::swap(run.events[0], run.events[1]);
    EXPECT_EQ(report().unfinished, 1u);
}

TEST_F(ARun, WhoseTraceNamesOtherGuardsIsNotTheSame)
{
    const std::vector<std::size_t> same{0, 1, 2};
    const std::vector<std::size_t> other{1, 0, 2};
    EXPECT_EQ(test::property::trace(run, same), test::property::trace(run, same));
    EXPECT_NE(test::property::trace(run, same), test::property::trace(run, other));
}

}  // namespace
}  // namespace ricochet::property_test
