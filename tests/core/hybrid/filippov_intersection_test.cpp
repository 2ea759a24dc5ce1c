// Sliding where two surfaces meet; memory and threads.

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <thread>
#include <vector>

#include "allocations.hpp"
#include "filippov_runs.hpp"

namespace ricochet::filippov_intersection_test {
namespace {

using test::run_from;
using test::tight;

// --- two surfaces ---

/// Constant fields in the four quadrants of (x, y), with a third component that shows
/// which of them act.
struct Quadrants {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 3>;

    std::array<std::array<double, 3>, 4> fields;
    bool swapped = false;  ///< surface 0 is y = 0

    double surface(std::size_t which, double, const auto& x) const
    {
        return x[(which == 0) != swapped ? 0 : 1];
    }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return dxdt[(which == 0) != swapped ? 0 : 1];
    }
    void field(std::size_t region, double, const auto&, auto& dxdt) const
    {
        if (swapped) region = region / 2 + 2 * (region % 2);
        for (std::size_t i = 0; i < 3; ++i) dxdt[i] = fields[region][i];
    }
};

using Two = Filippov<Quadrants>;

/// The mode with the surfaces numbered in the other order.
Mode mirrored(Mode mode)
{
    return Two::mode_of(Two::place(1, mode), Two::place(0, mode));
}

constexpr Place b = Place::below;
constexpr Place a = Place::above;
constexpr Place s = Place::sliding;

/// All fields lead to both surfaces, with drifts (0.5, -0.25) and only the field of
/// x > 0, y > 0 in z.
Quadrants node()
{
    return {{{{1.5, 0.75, 0}, {-0.5, 0.75, 0}, {1.5, -1.25, 0}, {-0.5, -1.25, 1}}}};
}

/// Fields that turn around the origin, each quadrant halving the distance.
Quadrants spiral()
{
    return {{{{1, -0.5, 0}, {0.5, 1, 0}, {-0.5, -1, 0}, {-1, 0.5, 1}}}};
}

TEST(Filippov, ANodeIsReachedAlongASurfaceAndHeld)
{
    // From (1, 1) both rates are known: y = 0 at 1/1.25 = 0.8 with x = 0.6, then along
    // y = 0 at -0.5 until x = 0 at 2. There the weights a, b solve 1.5 - 2 a = 0 and
    // 0.75 - 2 b = 0, and z' = a b = 0.75 * 0.375.
    const Two system(node());
    const auto run = run_from(system, {1.0, 1.0, 0.0}, 3);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 2u);
    EXPECT_NEAR(run.events[0].t, 0.8, 1e-15);
    EXPECT_EQ(run.events[0].mode_after, Two::mode_of(a, s));
    EXPECT_NEAR(run.events[1].t, 2, 1e-15);
    EXPECT_EQ(run.events[1].mode_after, Two::mode_of(s, s));
    EXPECT_EQ(run.x[0], 0);
    EXPECT_EQ(run.x[1], 0);
    const auto shares = system.shares(run.mode, run.t, run.x);
    EXPECT_NEAR(shares[0], 0.75, 1e-15);
    EXPECT_NEAR(shares[1], 0.375, 1e-15);
    std::array<double, 3> dxdt;
    system.flow(run.mode, run.t, run.x, dxdt);
    EXPECT_EQ(dxdt[0], 0);
    EXPECT_EQ(dxdt[1], 0);
    EXPECT_NEAR(dxdt[2], 0.75 * 0.375, 1e-15);
    // 0.8 s of z' = 1, 1.2 s of z' = b, 1 s of z' = a b.
    EXPECT_NEAR(run.x[2], 0.8 + 1.2 * 0.375 + 0.75 * 0.375, 1e-14);
}

TEST(Filippov, ANodeReachedExactlyAtItsCornerIsHeldAtOnce)
{
    // (1, 2.5) along (-0.5, -1.25) meets both surfaces at t = 2.
    const Two system(node());
    const auto run = run_from(system, {1.0, 2.5, 0.0}, 3);
    ASSERT_EQ(run.events.size(), 2u);
    for (const auto& event : run.events) {
        EXPECT_NEAR(event.t, 2, 1e-15);
        EXPECT_EQ(event.mode_after, Two::mode_of(s, s));
    }
    EXPECT_EQ(run.x[0], 0);
    EXPECT_EQ(run.x[1], 0);
}

TEST(Filippov, ASpiralOfCrossingsEndsOnTheIntersection)
{
    // From (1, 0) each quadrant takes the distance from the origin in time and halves
    // it: 1 + 1/2 + 1/4 + ... = 2. A guard of the four fires once per turn, at
    // distances 16 times smaller each time; its remainder is below the resolution of
    // the time, 16 * 4.4e-16 s, after 12 turns.
    const Two system(spiral());
    const std::array<double, 3> x0 = {1.0, 0.0, 0.0};
    EXPECT_EQ(system.start_mode(0, x0), Two::mode_of(a, a));
    const auto run = run_from(system, x0, 5);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_GE(run.events.size(), 40u);
    EXPECT_LE(run.events.size(), 56u);
    const auto& last = run.events.back();
    EXPECT_EQ(last.kind, EventKind::accumulation);
    EXPECT_NEAR(last.t, 2, 1e-14);
    EXPECT_EQ(last.mode_after, Two::mode_of(s, s));
    EXPECT_EQ(run.x[0], 0);
    EXPECT_EQ(run.x[1], 0);
    // By symmetry the weights are 1/2: z' = 1/4 after t = 2. Before, z grows in the first
    // quadrant, the time in which is 1 + 1/16 + ... = 16/15.
    EXPECT_NEAR(run.x[2], 16.0 / 15 + 3.0 / 4, 1e-13);
}

/// A node whose drift in x grows with time, and a drift in y in proportion.
struct Release {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 3>;

    double proportion = 0;

    double surface(std::size_t which, double, const auto& x) const { return x[which]; }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return dxdt[which];
    }
    void field(std::size_t region, double t, const auto&, auto& dxdt) const
    {
        dxdt[0] = t + (region & 1 ? -1 : 1);
        dxdt[1] = proportion * t + (region & 2 ? -1 : 1);
        dxdt[2] = region == 3 ? 1 : 0;
    }
};

TEST(Filippov, OneOfTwoSurfacesIsLeftWhereItsShareIsOne)
{
    // The weight of x > 0 is (1 + t) / 2, so that x = 0 is left upward at t = 1 with
    // x = (t - 1)^2 / 2; y = 0 is held with b = (1 + t / 4) / 2 until t = 4.
    const Filippov<Release> system({0.25});
    const auto run = run_from(system, {0.0, 0.0, 0.0}, 5);
    ASSERT_EQ(run.events.size(), 2u);
    EXPECT_NEAR(run.events[0].t, 1, 1e-13);
    EXPECT_EQ(run.events[0].mode_after, Two::mode_of(a, s));
    EXPECT_NEAR(run.events[1].t, 4, 1e-13);
    EXPECT_EQ(run.events[1].mode_after, Two::mode_of(a, a));
    EXPECT_NEAR(run.x[0], 8, 1e-12);
    EXPECT_NEAR(run.x[1], 0.125, 1e-12);  // (t - 4)^2 / 8
    // z' = a b, then b, then 1; a b = (1 + t)(1 + t / 4) / 4.
    const double held = (1 + 5.0 / 8 + 1.0 / 12) / 4;
    const double along = 0.5 * (3 + 15.0 / 8);
    EXPECT_NEAR(run.x[2], held + along + 1, 1e-12);
}

TEST(Filippov, BothSurfacesAreLeftTogetherIntoOneRegion)
{
    const Filippov<Release> system({1});
    const auto run = run_from(system, {0.0, 0.0, 0.0}, 3);
    ASSERT_EQ(run.events.size(), 2u);
    for (const auto& event : run.events) {
        EXPECT_NEAR(event.t, 1, 1e-13);
        EXPECT_EQ(event.mode_after, Two::mode_of(a, a));
    }
    EXPECT_NEAR(run.x[0], 2, 1e-12);
    EXPECT_NEAR(run.x[1], 2, 1e-12);
}

TEST(Filippov, SlidingAlongOneSurfaceGoesOnAcrossTheOther)
{
    // Along y = 0 at 1, through x = 0: y = 0 holds on both sides, x crosses.
    const Two system({{{{1, 1, 0}, {2, 1, 0}, {1, -1, 0}, {2, -1, 1}}}});
    const auto run = run_from(system, {-1.0, 0.0, 0.0}, 2);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].mode_before, Two::mode_of(b, s));
    EXPECT_EQ(run.events[0].mode_after, Two::mode_of(a, s));
    EXPECT_NEAR(run.x[0], 2, 1e-14);
    EXPECT_EQ(run.x[1], 0);
    EXPECT_NEAR(run.x[2], 0.5, 1e-14);
}

TEST(Filippov, SlidingEndsAtAnotherSurfaceBeyondWhichNothingHoldsIt)
{
    // Beyond x = 0 both fields lead up: the motion continues into the first quadrant.
    const Two system({{{{1, 1, 0}, {2, 1, 0}, {1, -1, 0}, {2, 3, 0}}}});
    const auto run = run_from(system, {-1.0, 0.0, 0.0}, 2);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_EQ(run.events[0].mode_after, Two::mode_of(a, a));
    EXPECT_NEAR(run.x[0], 2, 1e-14);
    EXPECT_NEAR(run.x[1], 3, 1e-14);
}

TEST(Filippov, MeetingOfSlidingMotionsIsSeenAlongTheOtherSurface)
{
    const std::array<double, 3> origin{};
    EXPECT_EQ(Two(node()).meeting(0, Two::mode_of(b, s), 0, origin), Meeting::attractive);
    const Two through({{{{1, 1, 0}, {2, 1, 0}, {1, -1, 0}, {2, -1, 1}}}});
    EXPECT_EQ(through.meeting(0, Two::mode_of(b, s), 0, origin), Meeting::crossing_up);
}

/// y'' = -2 Sgn(y) - Sgn(y') + force: finite-time control by twisting (Levant, Int. J.
/// Control 58, 1993). Both surfaces meet at rest, where the rate of y does not depend on the
/// field.
struct Twisting {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 2>;

    double force = 0;  ///< amplitude of a perturbation

    double surface(std::size_t which, double, const auto& x) const { return x[which]; }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return dxdt[which];
    }
    void field(std::size_t region, double t, const auto& x, auto& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = (region & 1 ? -2 : 2) + (region & 2 ? -1 : 1) + force * std::sin(t);
    }
};

TEST(Filippov, TwistingComesToRestInFiniteTime)
{
    // From (1, 0): y falls with y'' = -2 + 1 = -1 to 0, at speed v = sqrt(2), in v s.
    // Then it is braked with y'' = 3 over v / 3 s and v^2 / 6 m, and starts back with
    // y'' = 1 from a distance smaller by 3: v is smaller by sqrt(3).
    const double v = std::sqrt(2.0);
    const double t_rest = v * (1 + 1.0 / 3) / (1 - 1 / std::sqrt(3.0));
    const Filippov<Twisting> system;
    const auto run = run_from(system, {1.0, 0.0}, 20);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.mode, (Two::mode_of(s, s)));
    // Some 120 events, each at its root to the rounding of times around 4; the last are
    // no longer distinguished, or found to accumulate.
    EXPECT_NEAR(run.events.back().t, t_rest, 1e-12);
    EXPECT_NEAR(run.x[0], 0, 1e-25);
    EXPECT_EQ(run.x[1], 0);
}

TEST(Filippov, TwistingStaysAtRestAgainstAPerturbation)
{
    const Filippov<Twisting> system({0.5});
    const auto run = run_from(system, {1.0, 0.0}, 40);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_LT(run.events.back().t, 10);
    EXPECT_EQ(run.mode, (Two::mode_of(s, s)));
    EXPECT_NEAR(run.x[0], 0, 1e-24);
    EXPECT_EQ(run.x[1], 0);
}

/// Four fields that turn around the intersection and hold it. The field of the third quadrant
/// leads to y = 0 until t = 1 and away from it afterwards.
struct Turning {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 2>;

    double surface(std::size_t which, double, const auto& x) const { return x[which]; }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return dxdt[which];
    }
    void field(std::size_t region, double t, const auto&, auto& dxdt) const
    {
        constexpr std::array<double, 4> first = {-0.4, -0.86, 0.27, 0.25};
        const std::array<double, 4> second = {0.1 * (1 - t), 0.12, 0.9, -0.41};
        dxdt[0] = first[region];
        dxdt[1] = second[region];
    }
};

TEST(Filippov, AFieldThatTurnsAwayDoesNotEndSlidingThatOthersHold)
{
    // The weight b of y > 0 satisfies -0.4 - 0.46 a + 0.67 b + 0.44 a b = 0; a stays near 0.4
    // through t = 1, where the field of the third quadrant begins to lead away.
    const Filippov<Turning> system;
    const auto run = run_from(system, {0.0, 0.0}, 1.5);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 0u);
    EXPECT_EQ(run.mode, (Two::mode_of(s, s)));
    const auto shares = system.shares(run.mode, run.t, run.x);
    EXPECT_GT(std::min(shares[0], shares[1]), 0.1);
    EXPECT_LT(std::max(shares[0], shares[1]), 0.9);
}

/// x' = 1.1 - a - b and y' = c - a b while sliding, with c rising: the weights that keep
/// both still merge with a second solution at c = 1.1^2 / 4 = 0.3025, at t = 1.
struct Vanishing {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 2>;

    double surface(std::size_t which, double, const auto& x) const { return x[which]; }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return dxdt[which];
    }
    void field(std::size_t region, double t, const auto&, auto& dxdt) const
    {
        constexpr std::array<double, 4> first = {1.1, 0.1, 0.1, -0.9};
        dxdt[0] = first[region];
        dxdt[1] = 0.2525 + 0.05 * t - (region == 3 ? 1 : 0);
    }
};

TEST(Filippov, SlidingOnBothSurfacesEndsWhereItsCombinationCeasesToExist)
{
    // From then on y grows; x = 0 holds on with a = 0.1, and y' = c - 0.1.
    const Filippov<Vanishing> system;
    const auto run = run_from(system, {0.0, 0.0}, 2);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 4u);  // all four exits
    for (const auto& event : run.events) {
        // The discriminant, 4 (0.3025 - c), is known to 1e-15 of its terms, 1.2, and
        // falls at 0.2 per second.
        EXPECT_NEAR(event.t, 1, 1e-13);
        EXPECT_EQ(event.mode_after, Two::mode_of(s, a));
    }
    EXPECT_EQ(run.x[0], 0);
    EXPECT_NEAR(run.x[1], 0.1525 + 0.025 * 3, 1e-13);
}

/// A node on two oblique planes, with a third component.
struct Oblique {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 3>;

    double surface(std::size_t which, double t, const auto& x) const
    {
        return which == 0 ? x[0] + 2 * x[1] - 0.1 * x[2] : x[0] - x[1] + std::sin(t);
    }
    double surface_rate(std::size_t which, double t, const auto&, const auto& dxdt) const
    {
        return which == 0 ? dxdt[0] + 2 * dxdt[1] - 0.1 * dxdt[2] : dxdt[0] - dxdt[1] + std::cos(t);
    }
    void field(std::size_t region, double t, const auto& x, auto& dxdt) const
    {
        // Rates of h: -2 or 2 and -3 or 3 beside smaller drifts.
        const double first = (region & 1 ? -2 : 2) + 0.3 * std::sin(3 * t) - 0.1 * x[2];
        const double second = (region & 2 ? -3 : 3) + 0.5 * std::cos(t);
        dxdt[2] = std::cos(t) + (region == 3 ? 0.5 : 0);
        dxdt[0] = (first + 2 * second) / 3;
        dxdt[1] = (first - second) / 3;
    }
};

TEST(Filippov, ObliqueAndMovingPlanesAreKeptToRounding)
{
    const Filippov<Oblique> system;
    const auto run = run_from(system, {1.0, 2.0, 0.0}, 100);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_EQ(run.events.size(), 2u);
    EXPECT_EQ(run.mode, (Two::mode_of(s, s)));
    // The plane that moves as sin t is followed to the error of the steps, 1e-12 of a
    // state of size 1 each, some thousand of them, which mostly cancel.
    EXPECT_NEAR(system.fields().surface(0, run.t, run.x), 0, 1e-13);
    EXPECT_NEAR(system.fields().surface(1, run.t, run.x), 0, 1e-10);
}

/// Twisting seen in oblique coordinates: y = p + 2 q and y' = p - q + 1, so that rest is
/// no point that floating point hits exactly.
struct ObliqueTwisting {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 2>;

    double surface(std::size_t which, double, const auto& x) const
    {
        return which == 0 ? x[0] + 2 * x[1] : x[0] - x[1] + 1;
    }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return which == 0 ? dxdt[0] + 2 * dxdt[1] : dxdt[0] - dxdt[1];
    }
    void field(std::size_t region, double t, const auto& x, auto& dxdt) const
    {
        const double speed = x[0] - x[1] + 1;
        const double force = (region & 1 ? -2 : 2) + (region & 2 ? -1 : 1) + 0.5 * std::sin(t);
        dxdt[0] = (speed + 2 * force) / 3;
        dxdt[1] = (speed - force) / 3;
    }
};

TEST(Filippov, TwistingComesToRestWhereRoundingKeepsItOffTheSurfaces)
{
    // From y = 1 at rest. The speed that rounding leaves at rest, 1e-16,
    // makes y drift by that much per second.
    const Filippov<ObliqueTwisting> system;
    const auto run = run_from(system, {-1.0 / 3, 2.0 / 3}, 40);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_LT(run.events.back().t, 10);
    EXPECT_EQ(run.mode, (Two::mode_of(s, s)));
    EXPECT_NEAR(system.fields().surface(0, run.t, run.x), 0, 1e-13);
    EXPECT_NEAR(system.fields().surface(1, run.t, run.x), 0, 1e-14);
}

TEST(Filippov, AStartOnTheWrongSideOfASurfaceIsRefused)
{
    const Filippov<ObliqueTwisting> system;
    const std::array x0 = {-1.0 / 3, 2.0 / 3};  // y = 1
    EXPECT_THROW((void)integrate(system, x0, tight(1, Two::mode_of(b, b))), std::invalid_argument);
}

TEST(Filippov, SpiralsOfAnyContractionEndOnTheIntersection)
{
    // Four quadrants that shrink the distance by factors from 3 to 1/300 each: crossings
    // may accumulate so fast that four of them are soon no longer distinguished, or so
    // slowly that there are hundreds.
    std::mt19937 random(1);
    std::uniform_real_distribution<double> number(0, 1);
    int runs = 0;
    for (int i = 0; i < 300; ++i) {
        std::array<double, 4> q;
        double product = 1;
        for (double& factor : q) product *= factor = std::pow(10, 0.5 - 3 * number(random));
        if (product > 0.9) continue;
        ++runs;
        const Two system({{{{1, -q[0], 0}, {q[1], 1, 0}, {-q[2], -1, 0}, {-1, q[3], 0}}}});
        const auto run = run_from(system, {number(random), number(random), 0.0}, 30);
        EXPECT_EQ(run.outcome, Outcome::reached_end) << i;
        EXPECT_EQ(run.mode, Two::mode_of(s, s)) << i;
        EXPECT_EQ(run.x[0], 0) << i;
        EXPECT_EQ(run.x[1], 0) << i;
    }
    EXPECT_GT(runs, 200);
}

/// Super-twisting (Levant, Int. J. Control 58, 1993): y' = z - 1.5 sqrt(|y|) Sgn(y),
/// z' = -1.1 Sgn(y). With one surface, y = 0, or z = 0 as a second one.
template <std::size_t surfaces>
struct SuperTwisting {
    static constexpr std::size_t surface_count = surfaces;
    using State = std::array<double, 2>;

    double surface(std::size_t which, double, const auto& x) const { return x[which]; }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return dxdt[which];
    }
    void field(std::size_t region, double, const auto& x, auto& dxdt) const
    {
        const double side = region & 1 ? 1 : -1;
        dxdt[0] = x[1] - 1.5 * side * std::sqrt(std::fabs(x[0]));
        dxdt[1] = -1.1 * side;
    }
};

TEST(Filippov, SlidingOfSecondOrderNeedsItsRateAsASecondSurface)
{
    const auto one = run_from(Filippov<SuperTwisting<1>>(), {1.0, 0.5}, 20);
    EXPECT_NE(one.outcome, Outcome::reached_end);  // it reports that it cannot continue
    EXPECT_LT(one.t, 2);
    const auto two = run_from(Filippov<SuperTwisting<2>>(), {1.0, 0.5}, 20);
    EXPECT_EQ(two.outcome, Outcome::reached_end);
    EXPECT_EQ(two.mode, (Two::mode_of(s, s)));
    // Of a state of size 1, at an event whose condition holds in floating point.
    EXPECT_NEAR(two.x[0], 0, 1e-17);
    EXPECT_EQ(two.x[1], 0);
}

// --- against steep but continuous switching ---

/// Fields of smooth random functions on either side of one or two surfaces, one of which
/// may be curved.
template <std::size_t surfaces>
struct Mixed {
    static constexpr std::size_t surface_count = surfaces;
    using State = std::array<double, 3>;

    std::array<std::array<double, 3>, 4> constant{};
    std::array<std::array<std::array<double, 3>, 3>, 4> slope{};
    double frequency = 1;
    double bend = 0;

    Mixed(std::mt19937& random, bool curved) : bend(curved ? 0.3 : 0)
    {
        std::uniform_real_distribution<double> number(-1, 1);
        for (std::size_t r = 0; r < 4; ++r) {
            for (double& c : constant[r]) c = number(random);
            for (auto& row : slope[r]) {
                for (double& c : row) c = 0.5 * number(random);
            }
        }
        frequency = 2 * number(random);
    }

    double surface(std::size_t which, double, const auto& x) const
    {
        return which == 0 ? x[0] + bend * x[2] * x[2] : x[1];
    }
    double surface_rate(std::size_t which, double, const auto& x, const auto& dxdt) const
    {
        return which == 0 ? dxdt[0] + 2 * bend * x[2] * dxdt[2] : dxdt[1];
    }
    void field(std::size_t region, double t, const auto& x, auto& dxdt) const
    {
        for (std::size_t i = 0; i < 3; ++i) {
            dxdt[i] = constant[region][i] - (i == 2 ? 1.3 : 0.3) * x[i];
            for (std::size_t j = 0; j < 3; ++j) dxdt[i] += slope[region][i][j] * std::sin(x[j]);
        }
        dxdt[0] += 0.5 * std::sin(frequency * t);
        dxdt[1] += 0.4 * std::cos(frequency * t);
    }
};

/// The same with weights that grow from 0 to 1 over |h| < width.
template <class Fields>
struct Steep {
    using State = typename Fields::State;

    const Fields& fields;
    double width = 1e-4;

    void flow(double t, const State& x, State& dxdt) const
    {
        std::array<double, 2> share{};
        for (std::size_t i = 0; i < Fields::surface_count; ++i) {
            const double u = std::clamp(fields.surface(i, t, x) / width, -1.0, 1.0);
            share[i] = 0.5 + 0.25 * u * (3 - u * u);
        }
        const auto weights = detail::Shares{share[0], share[1]}.weights();
        dxdt.fill(0);
        State f;
        for (std::size_t region = 0; region < 4; ++region) {
            if (weights[region] == 0) continue;
            fields.field(region, t, x, f);
            for (std::size_t i = 0; i < 3; ++i) dxdt[i] += weights[region] * f[i];
        }
    }
};

/// Number of `runs` random motions that end elsewhere with steep switching.
template <std::size_t surfaces>
int count_disagreements(unsigned seed, int runs, bool curved)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> number(-1, 1);
    int disagreements = 0;
    for (int i = 0; i < runs; ++i) {
        const Mixed<surfaces> fields(random, curved);
        const std::array<double, 3> x0 = {number(random), number(random), number(random)};
        const auto sharp = run_from(Filippov<Mixed<surfaces>>(fields), x0, 10);
        EXPECT_EQ(sharp.outcome, Outcome::reached_end);
        const Steep<Mixed<surfaces>> steep{fields};
        const auto smooth = integrate(steep, x0, {.t_end = 10, .rtol = 1e-6, .atol = 1e-8});
        double difference = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            difference = std::max(difference, std::fabs(sharp.x[k] - smooth.x[k]));
        }
        // The width of the layer, 1e-4, times its growth in 10 s.
        disagreements += difference > 0.01;
    }
    return disagreements;
}

TEST(Filippov, OneSurfaceGivesTheLimitOfSteepSwitching)
{
    EXPECT_EQ(count_disagreements<1>(1, 60, false), 0);
    EXPECT_EQ(count_disagreements<1>(2, 60, true), 0);
}

TEST(Filippov, TwoSurfacesGiveTheLimitOfSteepSwitching)
{
    // Steep switching may leave an intersection earlier, where its layer loses stability
    // while the sliding combination still exists: of 800 random motions 3 did.
    EXPECT_LE(count_disagreements<2>(3, 60, false), 1);
    EXPECT_LE(count_disagreements<2>(4, 60, true), 1);
}

// --- the order in which the surfaces are written ---

/// Whether the mode agrees with the state; planes are kept to rounding.
bool is_where_it_says(const Quadrants& fields, Mode mode, const std::array<double, 3>& x)
{
    for (const std::size_t i : {0u, 1u}) {
        const double h = fields.surface(i, 0, x);
        const Place place = Two::place(i, mode);
        if (place == a ? h < -1e-14 : place == b ? h > 1e-14 : std::fabs(h) > 1e-14) return false;
    }
    return true;
}

/// A run with either numbering: the same times, modes and bits.
void expect_same_either_way(Quadrants fields, const std::array<double, 3>& x0, double t_end)
{
    const auto one = run_from(Two(fields), x0, t_end);
    fields.swapped = true;
    const auto other = run_from(Two(fields), x0, t_end);
    EXPECT_EQ(one.outcome, Outcome::reached_end);
    EXPECT_EQ(other.outcome, Outcome::reached_end);
    EXPECT_EQ(one.x, other.x);
    EXPECT_EQ(one.mode, mirrored(other.mode));
    ASSERT_EQ(one.events.size(), other.events.size());
    for (std::size_t i = 0; i < one.events.size(); ++i) {
        EXPECT_EQ(one.events[i].t, other.events[i].t);
        EXPECT_EQ(one.events[i].mode_after, mirrored(other.events[i].mode_after));
        EXPECT_TRUE(is_where_it_says(fields, other.events[i].mode_after, other.events[i].after));
    }
    EXPECT_TRUE(is_where_it_says(fields, other.mode, other.x));
}

TEST(Filippov, TheMotionDoesNotDependOnTheNumbersOfTheSurfaces)
{
    expect_same_either_way(node(), {1, 1, 0}, 4);
    expect_same_either_way(node(), {-0.3, 0.7, 0}, 4);
    expect_same_either_way(node(), {1, 2.5, 0}, 4);
    expect_same_either_way(spiral(), {1, 0.1, 0}, 4);
    std::mt19937 random(7);
    std::uniform_real_distribution<double> number(-1, 1);
    for (int i = 0; i < 300; ++i) {
        Quadrants fields{};
        for (auto& field : fields.fields) {
            for (double& component : field) component = number(random);
        }
        expect_same_either_way(fields, {number(random), number(random), 0}, 3);
        expect_same_either_way(fields, {0, 0, 0}, 1);
    }
}

// --- the algebra of sliding on two surfaces ---

/// Fields whose rates have two common zeros in the unit square of the shares: one near (0.1, 0.1),
/// and a saddle near (0.5, 0.5). The third component moves with the weight of the last field.
Quadrants with_a_saddle()
{
    return {{{{0.02, 0.05, 0}, {-1, -0.25, 0}, {1, -0.25, 0}, {0, 0.45, 1}}}};
}

TEST(Filippov, TheMotionSlidesWithTheSharesAtWhichSteepSwitchingSettles)
{
    // Steep switching, in the limit: a' and b' are the rates, from the corner of the arrival.
    const auto settled = [](const Quadrants& of) {
        std::array<double, 2> at{};
        for (int i = 0; i < 200000; ++i) {
            const auto w = detail::Shares{at[0], at[1]}.weights();
            std::array<double, 2> next = at;
            for (std::size_t k = 0; k < 2; ++k) {
                double rate = 0;
                for (std::size_t r = 0; r < 4; ++r) rate += w[r] * of.fields[r][k];
                next[k] = std::clamp(at[k] + 0.01 * rate, 0.0, 1.0);
            }
            at = next;
        }
        return at;
    };
    const auto shares = settled(with_a_saddle());
    for (const bool swapped : {false, true}) {
        Quadrants fields = with_a_saddle();
        fields.swapped = swapped;
        const Two two(fields);
        const auto run = run_from(two, {-0.1, -0.1, 0}, 10);
        ASSERT_EQ(run.mode, Two::mode_of(s, s));
        const auto own = two.shares(run.mode, run.t, run.x);
        EXPECT_NEAR(own[swapped ? 1 : 0], shares[0], 1e-12);
        EXPECT_NEAR(own[swapped ? 0 : 1], shares[1], 1e-12);
        // It slides from its arrival on; z is of the weight of the last field until the end.
        EXPECT_NEAR(run.x[2], shares[0] * shares[1] * (10 - run.events.back().t), 0.05);
    }
}

/// Two relays of one surface, x = 0 and k x = 0, against a force 2 t:
/// x' = 2 t - sign(x) u0 - sign(k x) u1.
struct CoincidingRelays {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 2>;
    double k, u0, u1;

    double surface(std::size_t which, double, const auto& x) const
    {
        return which == 0 ? x[0] : k * x[0];
    }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return which == 0 ? dxdt[0] : k * dxdt[0];
    }
    void field(std::size_t region, double t, const auto&, auto& dxdt) const
    {
        const double s0 = (region & 1) ? 1 : -1;
        const double s1 = (region & 2) ? 1 : -1;
        dxdt = {2 * t - s0 * u0 - s1 * u1, 0};
    }
};

TEST(Filippov, RelaysOnOneSurfaceReleaseTogether)
{
    for (const double k : {1.0, 2.0, 0.5, 3.0, -1.0, -0.7}) {
        for (const double u1 : {0.1, 0.3, 0.55}) {
            // Together they hold against u0 + u1, where k turns one of them against u0 - u1.
            const double release = 0.5 * (0.6 + (k > 0 ? u1 : -u1));
            const Filippov<CoincidingRelays> relays(CoincidingRelays{k, 0.6, u1});
            for (const double start : {0.0, -1e-4}) {  // the second arrives at once
                const auto run = run_from(relays, {start, 0}, 1.6);
                EXPECT_EQ(run.outcome, Outcome::reached_end);
                ASSERT_FALSE(run.events.empty());
                EXPECT_NEAR(run.events.back().t, release, 1e-9) << k << ' ' << u1;
                EXPECT_NEAR(run.x[0], (1.6 - release) * (1.6 - release), 1e-9) << k << ' ' << u1;
            }
        }
    }
}

detail::RegionRates random_rates(std::mt19937& random)
{
    std::uniform_real_distribution<double> number(-1, 1);
    detail::RegionRates rates;
    for (auto& surface : rates) {
        for (double& rate : surface) rate = number(random);
    }
    return rates;
}

/// Sliding on both surfaces ends at t = 0.0984, where the second share is 1, near the corner
/// (0, 1); sliding on the first one at t = 0.1, where the field of region 2 turns away from it.
struct NearTheCorner {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 3>;

    double surface(std::size_t which, double, const auto& x) const { return x[which]; }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return dxdt[which];
    }
    void field(std::size_t region, double t, const auto&, auto& dxdt) const
    {
        const std::array<double, 4> first{-0.2, -0.146, 0.01 - 0.1 * t, -0.03};
        const std::array<double, 4> second{-0.04, -0.73, 0.005, -0.942};
        dxdt = {first[region], second[region], 1};
    }
};

TEST(Filippov, SlidingOnBothEndsAlsoWhereTheOtherShareIsNearItsBound)
{
    // Regression: whether the motion leaves was asked of the middle of the edge, where it does not,
    // and the shares ran out of [0, 1] while both surfaces were held.
    using Near = Filippov<NearTheCorner>;
    const auto run = integrate(Near(), {0, 0, 0}, tight(1, Near::mode_of(s, s)));
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 2U);
    EXPECT_EQ(run.events[0].mode_after, Near::mode_of(s, a));
    // (1 - a) 0.005 = 0.942 a, with a = r / (r + 0.03) and r = 0.01 - 0.1 t.
    const double released = 0.1 - 10 * 0.03 * 0.005 / 0.942;
    EXPECT_NEAR(run.events[0].t, released, 1e-12);
    EXPECT_EQ(run.events[1].mode_after, Near::mode_of(b, a));
    EXPECT_NEAR(run.events[1].t, 0.1, 1e-12);
    EXPECT_NEAR(run.x[0], -0.05 * 0.9 * 0.9, 1e-12);
}

/// Two oblique planes that are parallel, one of which swings through the other, without the rates
/// of their surfaces.
struct ParallelPlanes {
    static constexpr std::size_t surface_count = 2;
    using State = std::array<double, 3>;

    std::array<std::array<double, 3>, 4> constant{};
    std::array<double, 3> normal{};
    double swing = 0;
    double frequency = 1;

    explicit ParallelPlanes(std::mt19937& random)
    {
        std::uniform_real_distribution<double> number(-1, 1);
        double square = 0;
        for (double& n : normal) {
            n = number(random);
            square += n * n;
        }
        for (double& n : normal) n /= std::sqrt(square);
        for (std::size_t region = 0; region < 4; ++region) {
            for (std::size_t i = 0; i < 3; ++i) {
                constant[region][i] = 0.5 * number(random) - (region % 2 == 0 ? -1 : 1) * normal[i];
            }
        }
        swing = 0.1 + 0.1 * number(random);
        frequency = 3 + number(random);
    }

    double surface(std::size_t which, double t, const auto& x) const
    {
        const double along = normal[0] * x[0] + normal[1] * x[1] + normal[2] * x[2];
        return along - 0.1 - (which == 0 ? 0 : swing * std::sin(frequency * t));
    }
    void field(std::size_t region, double, const auto& x, auto& dxdt) const
    {
        for (std::size_t i = 0; i < 3; ++i) dxdt[i] = constant[region][i] - 0.3 * x[i];
    }
};

TEST(Filippov, DifferencesOfParallelSurfacesMoveNoStateFar)
{
    // Regression: errors of the differences made the planes oblique to one another, and the motion
    // was moved far along both, to their intersection.
    int events = 0;
    for (unsigned seed = 0; seed < 100; ++seed) {
        std::mt19937 random(seed);
        const Filippov<ParallelPlanes> planes{ParallelPlanes(random)};
        const std::array<double, 3> x0{0.5, 0.3, -0.2};
        const auto run = integrate(planes, x0, tight(5, planes.start_mode(0, x0)));
        EXPECT_NE(run.outcome, Outcome::endless_cascade) << seed;
        for (const auto& event : run.events) {
            ++events;
            for (std::size_t i = 0; i < 3; ++i) {
                EXPECT_NEAR(event.after[i], event.before[i], 1e-9) << seed << " at " << event.t;
            }
        }
    }
    EXPECT_GT(events, 100);
}

TEST(FilippovRates, WhereTheSharesStayInsideTheyKeepBothSurfacesStill)
{
    std::mt19937 random(11);
    int held = 0;
    for (int i = 0; i < 20000; ++i) {
        const detail::RegionRates rates = random_rates(random);
        const auto way = detail::follow_shares(detail::normalised(rates), {});
        if (way.to != detail::Places{s, s}) continue;
        ++held;
        const auto [shares, apart] = detail::sliding_shares(rates);
        EXPECT_GT(apart, 0);
        EXPECT_GE(std::min(shares.first, shares.second), 0);
        EXPECT_LE(std::max(shares.first, shares.second), 1);
        for (const auto& r : rates) {
            // Four products of at most 1 and their sums: some units of 1.1e-16.
            EXPECT_NEAR(detail::blend(shares.weights(), r[0], r[1], r[2], r[3]), 0, 1e-15);
        }
        const detail::RegionRates other = {{{rates[1][0], rates[1][2], rates[1][1], rates[1][3]},
                                            {rates[0][0], rates[0][2], rates[0][1], rates[0][3]}}};
        const detail::Shares mirrored_shares = detail::sliding_shares(other).shares;
        EXPECT_EQ(shares.first, mirrored_shares.second);
        EXPECT_EQ(shares.second, mirrored_shares.first);
    }
    EXPECT_GT(held, 1000);  // else nothing was tested
}

/// The same by Euler's method with small steps for a long time; nothing if it does not
/// reach an end.
std::optional<detail::Places> followed_by_euler(const detail::RegionRates& r, double first,
                                                double second)
{
    std::array<double, 2> at = {first, second};
    std::array<double, 2> moved{};
    for (int i = 0; i < 100000; ++i) {
        const auto w = detail::Shares{at[0], at[1]}.weights();
        for (std::size_t k = 0; k < 2; ++k) {
            const double rate = detail::blend(w, r[k][0], r[k][1], r[k][2], r[k][3]);
            const double next = std::clamp(at[k] + 0.01 * rate, 0.0, 1.0);
            moved[k] = next - at[k];
        }
        for (std::size_t k = 0; k < 2; ++k) at[k] += moved[k];
    }
    if (std::fabs(moved[0]) + std::fabs(moved[1]) > 1e-9) return std::nullopt;
    detail::Places to;
    for (std::size_t k = 0; k < 2; ++k) {
        to[k] = at[k] == 0 ? Place::below : at[k] == 1 ? Place::above : Place::sliding;
    }
    return to;
}

TEST(FilippovRates, FollowingTheSharesAgreesWithSmallSteps)
{
    std::mt19937 random(5);
    std::uniform_real_distribution<double> share(0, 1);
    int compared = 0;
    for (int i = 0; i < 300; ++i) {
        const detail::RegionRates rates = detail::normalised(random_rates(random));
        const detail::Shares from{share(random), share(random)};
        const auto expected = followed_by_euler(rates, from.first, from.second);
        if (!expected) continue;
        ++compared;
        EXPECT_EQ(detail::follow_shares(rates, from).to, *expected) << i;
    }
    EXPECT_GT(compared, 280);
}

TEST(FilippovRates, SharesOfAlmostCoincidingSurfacesAreFollowedToTheirEnd)
{
    // Regression: after 10 000 steps along the line on which both rates are small, the shares
    // counted as at rest, although the zero of both rates lies outside the square.
    for (const double angle : {1e-3, 1e-4, 1e-5, 1e-6}) {
        const std::array<double, 4> of_both{0.45, -0.71, 0.81, -1};
        detail::RegionRates rates{of_both, of_both};
        for (const std::size_t region : {0u, 1u, 2u, 3u}) {
            rates[1][region] += angle * (region < 2 ? 2 : 1);
        }
        const auto up = detail::follow_shares(rates, {0.39, 0});
        EXPECT_EQ(up.to, (detail::Places{s, a})) << angle;
        EXPECT_NEAR(up.at.first, 0.81 / 1.81, 1e-12);
        EXPECT_EQ(up.at.second, 1);
        const detail::RegionRates swapped{{{rates[1][0], rates[1][2], rates[1][1], rates[1][3]},
                                           {rates[0][0], rates[0][2], rates[0][1], rates[0][3]}}};
        EXPECT_EQ(detail::follow_shares(swapped, {0, 0.39}).to, (detail::Places{a, s})) << angle;
    }
}

TEST(FilippovRates, SharesLeaveThroughCornersAndEdgesAsTheRatesSay)
{
    // A node holds; two fields beside y = 0 that lead on to x > 0 release it there.
    const detail::RegionRates node = {{{1, -1, 1, -1}, {1, 1, -1, -1}}};
    EXPECT_EQ(detail::follow_shares(node, {0, 0}).to, (detail::Places{s, s}));
    const detail::RegionRates along = {{{1, 0.5, 1, 0.25}, {1, 1, -1, -1}}};
    const auto way = detail::follow_shares(along, {0, 0.5});
    EXPECT_EQ(way.to, (detail::Places{a, s}));
    EXPECT_NEAR(way.margin, 0.375, 1e-15);
    // All fields lead the same way.
    const detail::RegionRates through = {{{1, 1, 1, 1}, {-1, -0.5, -1, -0.5}}};
    EXPECT_EQ(detail::follow_shares(through, {0, 1}).to, (detail::Places{a, b}));
    // A repulsive node, from its middle: up.
    const detail::RegionRates away = {{{-1, 1, -1, 1}, {-1, -1, 1, 1}}};
    EXPECT_EQ(detail::follow_shares(away, {}).to, (detail::Places{a, a}));
    EXPECT_EQ(detail::follow_shares(away, {0.4, 0.7}).to, (detail::Places{b, a}));
}

TEST(FilippovRates, ThePairOfSharesThatVanishesIsSeenToDoSo)
{
    // a + b = 1 and a b = c have the solutions 1/2 +- sqrt(1/4 - c), until c = 1/4.
    const auto rates = [](double c) {
        return detail::RegionRates{{{-1, 0, 0, 1}, {-c, -c, -c, 1 - c}}};
    };
    const auto before = detail::sliding_shares(rates(0.24));
    EXPECT_GT(before.apart, 0);
    EXPECT_NEAR(std::fabs(before.shares.first - 0.5), 0.1, 1e-14);
    EXPECT_NEAR(before.shares.first + before.shares.second, 1, 1e-15);
    const auto after = detail::sliding_shares(rates(0.26));
    EXPECT_LT(after.apart, 0);
    EXPECT_NEAR(after.shares.first, 0.5, 1e-14);
}

// --- memory and threads ---

/// Two relays side by side, for any state type.
struct TwoRelays {
    static constexpr std::size_t surface_count = 2;
    double surface(std::size_t which, double, const auto& x) const
    {
        return which == 0 ? x[0] : x[1];
    }
    double surface_rate(std::size_t which, double, const auto&, const auto& dxdt) const
    {
        return which == 0 ? dxdt[0] : dxdt[1];
    }
    void field(std::size_t region, double t, const auto& x, auto& dxdt) const
    {
        dxdt[0] = 0.5 * std::sin(t) + (region & 1 ? -1 : 1);
        dxdt[1] = 0.3 * std::cos(t) * x[0] + (region & 2 ? -1 : 1);
    }
};

/// One of them.
struct OneRelay {
    static constexpr std::size_t surface_count = 1;
    double surface(std::size_t, double, const auto& x) const { return x[0]; }
    double surface_rate(std::size_t, double, const auto&, const auto& dxdt) const
    {
        return dxdt[0];
    }
    void field(std::size_t region, double t, const auto&, auto& dxdt) const
    {
        dxdt[0] = 0.5 * std::sin(t) + (region ? -1 : 1);
    }
};

template <class X>
X state_of(double x, double y)
{
    X result(2);
    result[0] = x;
    result[1] = y;
    return result;
}

TEST(Filippov, SlidingAllocatesNothing)
{
    const auto allocated_by_run = [](const auto& system, const auto& x0) {
        Options options = tight(10, system.start_mode(0, x0));
        options.record_events = false;
        const auto before = testing_support::allocations();
        const auto run = integrate(system, x0, options);
        const auto count = testing_support::allocations() - before;
        EXPECT_GT(run.statistics.events, 0u);
        return count;
    };
    EXPECT_EQ(allocated_by_run(Filippov<OneRelay>(), std::array{2.0}), 0u);
    EXPECT_EQ(allocated_by_run(Filippov<TwoRelays>(), std::array{1.0, -2.0}), 0u);
    EXPECT_EQ(allocated_by_run(Filippov<TwoRelays>(), Eigen::Vector2d(1.0, -2.0)), 0u);
}

TEST(Filippov, SlidingOfDynamicStatesAllocatesOncePerThread)
{
    const Filippov<TwoRelays> system;
    const auto x = state_of<Eigen::VectorXd>(0, 0);
    auto dxdt = x;
    const Mode mode = Two::mode_of(s, s);
    const auto calls = [&] {
        for (int i = 0; i < 10; ++i) {
            system.flow(mode, 0.1 * i, x, dxdt);
            (void)system.guard(2, mode, 0.1 * i, x);
            (void)system.guard_rate(2, mode, 0.1 * i, x, dxdt);
        }
    };
    calls();
    const auto before = testing_support::allocations();
    calls();
    EXPECT_EQ(testing_support::allocations() - before, 0u);
}

TEST(Filippov, TwoThreadsMayShareASystem)
{
    const Filippov<TwoRelays> system;
    const auto go = [&](double x) {
        const auto x0 = state_of<std::vector<double>>(x, -2);
        return integrate(system, x0, tight(20, system.start_mode(0, x0))).x;
    };
    const auto alone = std::array{go(1), go(3)};
    std::array<std::vector<double>, 2> together;
    std::thread first([&] {
        for (int i = 0; i < 20; ++i) together[0] = go(1);
    });
    std::thread second([&] {
        for (int i = 0; i < 20; ++i) together[1] = go(3);
    });
    first.join();
    second.join();
    EXPECT_EQ(together, alone);
}

}  // namespace
}  // namespace ricochet::filippov_intersection_test
