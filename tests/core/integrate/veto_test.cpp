// `enabled(t, x)`: a veto concerns the instant of a crossing, and what is passed stays passed.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"

namespace ricochet::veto_test {
namespace {

/// A point (x, y) beside or above a platform at y = 0 that reaches from the left to x = 1. The
/// velocity of y is the third component.
struct Platform {
    using State = std::array<double, 3>;
    double push = 0;  ///< [m/s] x' at the start, less 1 each second
    double pull = 0;  ///< [m/s^2] y''
    bool unilateral = true;
    bool resets_beside = false;

    void flow(double t, const State& s, State& dsdt) const { dsdt = {push - push * t, s[2], pull}; }
    [[nodiscard]] double guard(double, const State& s) const { return s[1]; }
    [[nodiscard]] bool enabled(double, const State& s) const { return s[0] < 1; }
    void reset(double, State& s) const
    {
        s = resets_beside ? State{2, -0.5, s[2]} : State{s[0], s[1], -s[2]};
    }
    [[nodiscard]] GuardInfo guard_info() const { return {.unilateral = unilateral}; }
};

/// The same with a tick at which the point is put above the platform, or over its edge.
struct MovedPlatform : Platform {
    double tick = 1;
    double to = 0;
    [[nodiscard]] double next_time_event(double t) const
    {
        return t < tick ? tick : std::numeric_limits<double>::infinity();
    }
    void time_reset(double, State& s) const { s[0] = to; }
};

template <class System, class Check>
void by_several(const System& system, const typename System::State& start, double t_end,
                const Check& check)
{
    const Options options{.t_end = t_end};
    check(integrate(system, start, options));
    check(
        integrate(system, start, options, ErrorControlled<Fehlberg78>{}, Extremum{}, Bisection{}));
    check(integrate(system, start, options, ErrorControlled<Dopri5>{}, Ends{}, Toms748{}));
    check(integrate(system, start, {.t_end = t_end, .step = 0.0173}, FixedStep<Rk4>{}));
}

TEST(Veto, APointThatHasPassedBesideAPlatformIsNotStruckFromBelow)
{
    // x = 0.5 + 2 t - t^2, y = 0.4 - 1.2 t + t^2 / 2: down through 0 at 0.4 where x = 1.14, below
    // the platform from 1.707 on, where x is 1 again, and up through 0 at 2.
    for (const bool unilateral : {false, true}) {
        const Platform platform{.push = 2, .pull = 1, .unilateral = unilateral};
        by_several(platform, {0.5, 0.4, -1.2}, 3, [](const auto& run) {
            EXPECT_EQ(run.outcome, Outcome::reached_end);
            EXPECT_EQ(run.statistics.events, 0U);
            EXPECT_EQ(run.statistics.disabled, 1U);
            EXPECT_NEAR(run.x[1], 1.3, 1e-9);
        });
    }
}

TEST(Veto, OfAStartIsAVeto)
{
    // Below the platform, but beside it; and on its height there, falling.
    by_several(Platform{}, {2, -1, 1}, 3, [](const auto& run) {
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.statistics.events, 0U);
        EXPECT_NEAR(run.x[1], 2, 1e-12);
    });
    by_several(Platform{}, {2, 0, -1}, 3, [](const auto& run) {
        EXPECT_EQ(run.statistics.events, 0U);
        EXPECT_EQ(run.statistics.disabled, 1U);
        EXPECT_NEAR(run.x[1], -3, 1e-12);
    });
    // On it, falling, the point is thrown up at once; below it, a run does not start.
    by_several(Platform{}, {0, 0, -1}, 3, [](const auto& run) {
        EXPECT_EQ(run.statistics.events, 1U);
        EXPECT_NEAR(run.x[1], 3, 1e-12);
    });
    EXPECT_THROW((void)integrate(Platform{}, {0, -1, 1}, {.t_end = 3}), std::invalid_argument);
}

TEST(Veto, ThatEndsWhereTheGuardIsOnItsSurfaceLeavesItsEvent)
{
    // y = 1 - t is 0 at the tick, which puts the point on the platform: it presses, and rebounds.
    for (const bool unilateral : {false, true}) {
        const MovedPlatform platform{{.unilateral = unilateral}};
        by_several(platform, {2, 1, -1}, 3, [](const auto& run) {
            EXPECT_EQ(run.outcome, Outcome::reached_end);
            ASSERT_EQ(run.events.size(), 2U);
            EXPECT_EQ(run.events[0].kind, EventKind::time);
            EXPECT_EQ(run.events[1].t, 1);
            EXPECT_NEAR(run.x[1], 2, 1e-12);
        });
    }
    // A quarter of a second later it has passed.
    by_several(MovedPlatform{{}, 1.25}, {2, 1, -1}, 3, [](const auto& run) {
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.statistics.events, 1U);
        EXPECT_EQ(run.statistics.disabled, 1U);
        EXPECT_NEAR(run.x[1], -2, 1e-12);
    });
}

TEST(Veto, OfThePlaceBehindAResetAllowsIt)
{
    // The platform throws the point over its edge and below.
    by_several(Platform{.resets_beside = true}, {0, 1, -1}, 3, [](const auto& run) {
        EXPECT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_EQ(run.statistics.events, 1U);
        EXPECT_NEAR(run.x[1], -2.5, 1e-9);
    });
}

}  // namespace
}  // namespace ricochet::veto_test
