// Derivatives through events that are not simple crossings, one at a time.

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ricochet/filippov.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"
#include "sensitivity_systems.hpp"

namespace ricochet::sensitivity_events_test {
namespace {

using namespace test;

// --- notifications ---

/// An oscillator with a guard that records upward passages of `level`.
struct Section {
    using State = X2;
    static constexpr bool resets = false;
    double level = 0.5;
    bool only_sign = false;
    static constexpr std::size_t guard_count = 1;

    [[nodiscard]] GuardInfo guard_info(std::size_t) const
    {
        return {.crossing = Crossing::rising, .boolean = only_sign, .touch = 1e-9};
    }
    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        Oscillator{}.flow(t, x, dxdt);
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t, double, const X& x) const
    {
        return only_sign ? (x[0] > level ? 1 : -1) : x[0] - level;
    }
};

// From (0, v0): x = v0 sin t, so t = asin(level / v0) + 2 pi n.
TEST(SensitivityThroughEvents, NotificationsMoveButLeaveTheDerivativesAlone)
{
    const auto s = sensitivities(
        Section{}, {0.0, 1.0},
        {.parameters = {{.with = [](double l) { return Section{l}; }, .nominal = 0.5}}},
        {.t_end = 8, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(s.events.size(), 2u);
    const double c = std::sqrt(1 - 0.25);
    for (const EventSensitivity& event : s.events) {
        // Located on the polynomial of the step, slightly less accurate than the method.
        EXPECT_NEAR(event.dt[1], -0.5 / c, 1e-9);
        EXPECT_NEAR(event.dt[2], 1 / c, 1e-9);
        EXPECT_EQ(event.before, event.after);
    }
    EXPECT_NEAR(s.state(0, 0), std::cos(8.0), 1e-10);
    EXPECT_EQ(s.state(0, 2), 0);
}

TEST(SensitivityThroughEvents, ATouchOrASignAloneHasNoTimeToDifferentiate)
{
    const auto touch = sensitivities(Section{.level = 1}, {0.0, 1.0}, {},
                                     {.t_end = 3, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(touch.events.size(), 1u);
    ASSERT_EQ(touch.run.events[0].kind, EventKind::touch);
    const auto sign = sensitivities(Section{.only_sign = true}, {0.0, 1.0}, {},
                                    {.t_end = 3, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(sign.events.size(), 1u);
    for (const auto* s : {&touch, &sign}) {
        EXPECT_TRUE(s->events[0].dt.array().isNaN().all());
        EXPECT_FALSE(s->undefined_at);
        EXPECT_NEAR(s->state(0, 0), std::cos(3.0), 1e-10);
    }
}

// --- grazing ---

/// An oscillator between an elastic wall at -1/4 and another wall.
struct TwoWalls {
    using State = X2;
    double wall = 1;
    double touch = 0;
    static constexpr std::size_t guard_count = 2;

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.unilateral = true, .touch = which == 1 ? touch : 0};
    }
    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        Oscillator{}.flow(t, x, dxdt);
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 ? x[0] + 0.25 : wall - x[0];
    }
    template <class X>
    void reset(std::size_t which, double, X& x) const
    {
        x[0] = which == 0 ? -0.25 : wall;
        x[1] *= which == 0 ? -1 : -0.8;
    }
};

void expect_ends_at_second_event(const Sensitivities<X2>& s)
{
    ASSERT_TRUE(s.undefined_at);
    EXPECT_EQ(s.undefined_at->event, 1u);
    EXPECT_EQ(s.undefined_at->reason, Undefined::grazing);
    ASSERT_GE(s.events.size(), 2u);
    EXPECT_TRUE(s.events[0].dt.allFinite());
    EXPECT_TRUE(s.events[0].after.allFinite());
    EXPECT_TRUE(s.events[1].before.allFinite());
    EXPECT_TRUE(s.events[1].dt.array().isNaN().all());
    EXPECT_TRUE(s.events[1].after.array().isNaN().all());
    EXPECT_TRUE(s.state.array().isNaN().all());
    ASSERT_EQ(s.trajectory.size(), 2u);
    EXPECT_TRUE(s.trajectory[0].allFinite());
    EXPECT_TRUE(s.trajectory[1].array().isNaN().all());
    EXPECT_EQ(s.run.outcome, Outcome::reached_end);
    EXPECT_TRUE(std::isfinite(s.run.x[0]));
}

// From (0, -1) the wall at -1/4 is met at asin(1/4), and the amplitude 1 is reached at
// pi / 2 + 2 asin(1/4) = 2.076. A wall that is 1e-10 nearer is met with the speed 1.4e-5,
// and reaches into the motion by less than rtol = 1e-9. Steps of 1e-3 by RK4 have an
// error of 1e-13.
TEST(SensitivityThroughEvents, AGrazingImpactEndsTheDerivativesAndOnlyThem)
{
    const Options options{
        .t_end = 3.5, .step = 1e-3, .rtol = 1e-9, .atol = 1e-9, .sample_times = {1.5, 2.5}};
    const FixedStep<Rk4> stepping;
    const X2 x0{0, -1};
    const auto barely = sensitivities(TwoWalls{.wall = 1 - 1e-10}, x0, {}, options, stepping);
    ASSERT_EQ(barely.run.events.size(), 2u);
    EXPECT_EQ(barely.run.events[1].kind, EventKind::crossing);
    EXPECT_LT(std::abs(barely.run.events[1].before[1]), 2e-5);
    expect_ends_at_second_event(barely);
    const TwoWalls touched{.wall = 1, .touch = 1e-10};
    const auto touch = sensitivities(touched, x0, {}, options, stepping);
    ASSERT_EQ(touch.run.events.size(), 2u);
    EXPECT_EQ(touch.run.events[1].kind, EventKind::touch);
    expect_ends_at_second_event(touch);
}

// t_2 = 2 asin(1 / 4 v0) + asin(wall / v0): the derivatives are large but exist. The
// speed of impact is 0.014, which amplifies errors of 1e-12 by its inverse square.
TEST(SensitivityThroughEvents, AGlancingImpactStillHasDerivatives)
{
    const double wall = 1 - 1e-4;
    const auto s = sensitivities(TwoWalls{.wall = wall}, {0.0, -1.0}, {},
                                 {.t_end = 2.2, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_GE(s.events.size(), 2u);
    EXPECT_FALSE(s.undefined_at);
    const double expected = -0.5 / std::sqrt(1 - 0.0625) - wall / std::sqrt(1 - wall * wall);
    expect_relative(s.events[1].dt[1], -expected, 1e-7, "dt by -v0");
}

// --- events at one time ---

/// Two independent balls.
struct TwoBalls {
    using State = std::array<double, 4>;
    static constexpr std::size_t guard_count = 2;

    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.unilateral = true}; }
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = x[1];
        dxdt[1] = -9.81;
        dxdt[2] = x[3];
        dxdt[3] = -9.81;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return x[2 * which];
    }
    template <class X>
    void reset(std::size_t which, double, X& x) const
    {
        x[2 * which] = 0;
        x[2 * which + 1] *= which == 0 ? -0.9 : -0.8;
    }
};

TEST(SensitivityThroughEvents, EventsThatDoNotInterfereMayHappenTogether)
{
    const auto s = sensitivities(TwoBalls{}, {10.0, 0.0, 10.0, 0.0}, {},
                                 {.t_end = 2, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(s.events.size(), 2u);
    ASSERT_EQ(s.run.events[0].t, s.run.events[1].t);
    EXPECT_FALSE(s.undefined_at);
    const auto first = BallClosedForm{.r = 0.9}.state(0, 2);
    const auto second = BallClosedForm{.r = 0.8}.state(0, 2);
    Eigen::Matrix4d expected = Eigen::Matrix4d::Zero();
    expected.topLeftCorner<2, 2>() = first.leftCols<2>();
    expected.bottomRightCorner<2, 2>() = second.leftCols<2>();
    EXPECT_LE((s.state - expected).cwiseAbs().maxCoeff(), 1e-10);
    const double by_height = BallClosedForm().impact(0)[1];
    EXPECT_NEAR(s.events[0].dt[0], by_height, 1e-11);
    EXPECT_EQ(s.events[0].dt[2], 0);
    EXPECT_EQ(s.events[1].dt[0], 0);
    EXPECT_NEAR(s.events[1].dt[2], by_height, 1e-11);
}

/// Two clocks that run down together; the first doubles y, the second adds one.
struct TwoClocks {
    using State = std::array<double, 3>;
    static constexpr std::size_t guard_count = 2;

    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = -1;
        dxdt[1] = -1;
        dxdt[2] = 0;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 ? x[0] : x[1];
    }
    template <class X>
    void reset(const FiredGuards& fired, double, X& x) const
    {
        if (fired.contains(0)) x[2] *= 2;
        if (fired.contains(1)) x[2] += 1;
    }
};

TEST(SensitivityThroughEvents, EventsWhoseOrderMattersHaveNoDerivativeTogether)
{
    const auto together = sensitivities(TwoClocks{}, {1.0, 1.0, 3.0}, {}, {.t_end = 2});
    ASSERT_EQ(together.events.size(), 2u);
    ASSERT_TRUE(together.undefined_at);
    EXPECT_EQ(together.undefined_at->event, 0u);
    EXPECT_EQ(together.undefined_at->reason, Undefined::simultaneous);
    EXPECT_EQ(together.run.x[2], 7);

    const auto apart = sensitivities(TwoClocks{}, {1.0, 1.5, 3.0}, {}, {.t_end = 2});
    EXPECT_FALSE(apart.undefined_at);
    EXPECT_NEAR(apart.state(2, 2), 2, 1e-12);
}

/// As `TwoClocks`, with a reset for each guard.
struct QuarrellingClocks : TwoClocks {
    template <class X>
    void reset(std::size_t which, double, X& x) const
    {
        x[2] = which == 0 ? 2 * x[2] : x[2] + 1;
    }
};

TEST(SensitivityThroughEvents, ConflictingResetsEndTheRunAsTheyDoWithoutDerivatives)
{
    const auto plain = integrate(QuarrellingClocks{}, {1.0, 1.0, 3.0}, {.t_end = 2});
    ASSERT_EQ(plain.outcome, Outcome::conflicting_resets);
    const auto s = sensitivities(QuarrellingClocks{}, {1.0, 1.0, 3.0}, {}, {.t_end = 2});
    EXPECT_EQ(s.run.outcome, Outcome::conflicting_resets);
    EXPECT_EQ(s.run.guard, plain.guard);
    EXPECT_EQ(s.run.other_guard, plain.other_guard);
    EXPECT_EQ(s.run.t, plain.t);
}

/// One ball with two guards for the same floor.
struct TwoFloors : ExactBall {
    static constexpr std::size_t guard_count = 2;
    [[nodiscard]] GuardInfo guard_info(std::size_t) const { return {.unilateral = true}; }
    template <class X>
    [[nodiscard]] double guard(std::size_t, double, const X& x) const
    {
        return x[0];
    }
    template <class X>
    void reset(std::size_t, double t, X& x) const
    {
        ExactBall::reset(t, x);
    }
};

TEST(SensitivityThroughEvents, AGuardThatIsThereTwiceChangesNothing)
{
    const auto s =
        sensitivities(TwoFloors{}, {10.0, 0.0}, {}, {.t_end = 6, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(s.events.size(), 4u);
    EXPECT_FALSE(s.undefined_at);
    const auto expected = BallClosedForm().state(1, 6);
    EXPECT_LE((s.state - expected.leftCols<2>()).cwiseAbs().maxCoeff(), 1e-10);
}

/// A clock c; when it has run down, it is set to one and y loses two. Where y falls below its
/// surface, or c rises above zero, y is set to five.
struct CarriedBack {
    using State = X2;
    bool watches_clock = false;
    static constexpr std::size_t guard_count = 2;

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.crossing = which == 1 && watches_clock ? Crossing::rising : Crossing::falling};
    }
    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = -1;
        dxdt[1] = 1;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return which == 0 || watches_clock ? x[0] : x[1];
    }
    template <class X>
    void reset(std::size_t which, double, X& x) const
    {
        if (which == 0) {
            x[0] = 1;
            x[1] -= 2;
        } else {
            x[1] = 5;
        }
    }
};

// Where y is zero when it loses two, neighbouring motions have it above zero, and fall, or not.
TEST(SensitivityThroughEvents, AGuardThatIsCarriedBackFromItsSurfaceEndsTheDerivatives)
{
    const Options options{.t_end = 1.5};
    const auto at_zero = sensitivities(CarriedBack{}, {1.0, -1.0}, {}, options);
    ASSERT_TRUE(at_zero.undefined_at);
    EXPECT_EQ(at_zero.undefined_at->event, 0u);
    EXPECT_EQ(at_zero.undefined_at->reason, Undefined::simultaneous);

    const auto below = sensitivities(CarriedBack{}, {1.0, -1.01}, {}, options);
    EXPECT_FALSE(below.undefined_at);
    EXPECT_NEAR(below.run.x[1], -1.51, 1e-12);
    EXPECT_NEAR(below.state(1, 1), 1, 1e-12);
    const auto above = sensitivities(CarriedBack{}, {1.0, -0.99}, {}, options);
    EXPECT_FALSE(above.undefined_at);
    EXPECT_NEAR(above.run.x[1], 5.5, 1e-12);
    EXPECT_NEAR(above.state(1, 1), 0, 1e-12);
}

// All motions leave the same surface at the same time, and are set back across it: y = 5 + t - c0.
TEST(SensitivityThroughEvents, TheOtherSideOfASurfaceHidesNoDerivative)
{
    const auto s =
        sensitivities(CarriedBack{.watches_clock = true}, {1.0, -1.0}, {}, {.t_end = 1.5});
    EXPECT_FALSE(s.undefined_at);
    EXPECT_NEAR(s.run.x[0], 0.5, 1e-12);
    EXPECT_NEAR(s.state(0, 0), 1, 1e-12);
    EXPECT_NEAR(s.run.x[1], 5.5, 1e-12);
    EXPECT_NEAR(s.state(1, 0), -1, 1e-12);
    EXPECT_NEAR(s.state(1, 1), 0, 1e-12);
}

/// A clock c; when it has run down, y loses `loss`, and if that makes y negative it
/// is turned around.
struct Cascade {
    using State = X2;
    double loss = 2;
    double keep = 1;
    static constexpr std::size_t guard_count = 2;

    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = -1;
        dxdt[1] = -0.5;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return x[which];
    }
    template <class X>
    void reset(std::size_t which, double, X& x) const
    {
        if (which == 0) {
            x[0] = 10;
            x[1] = keep * x[1] - loss;
        } else {
            x[1] = 0.3 - 0.8 * x[1];
        }
    }
};

// y = 0.3 - 0.8 (y0 - c0 / 2 - 2) - (t - c0) / 2 after both events at t = c0.
TEST(SensitivityThroughEvents, AGuardThatIsPushedOverMovesWithWhatPushedIt)
{
    const auto s = sensitivities(Cascade{}, {1.0, 2.0}, {}, {.t_end = 1.5, .rtol = 1e-12});
    ASSERT_EQ(s.events.size(), 2u);
    EXPECT_EQ(s.run.events[1].t, s.run.events[0].t);
    EXPECT_FALSE(s.undefined_at);
    for (const EventSensitivity& event : s.events) {
        EXPECT_NEAR(event.dt[0], 1, 1e-11);
        EXPECT_NEAR(event.dt[1], 0, 1e-11);
    }
    EXPECT_NEAR(s.state(1, 0), 0.4 + 0.5, 1e-11);
    EXPECT_NEAR(s.state(1, 1), -0.8, 1e-11);
}

// With keep = loss = 0 every neighbour is put on the second surface, so both events
// happen together: y = 0.3 - (t - c0) / 2. A loss of 3/2 puts the run itself there, but
// some of its neighbours before it and some beyond.
TEST(SensitivityThroughEvents, AGuardThatIsPutOnItsSurfaceFollowsIfAllNeighboursAre)
{
    const auto all =
        sensitivities(Cascade{.loss = 0, .keep = 0}, {1.0, 2.0}, {}, {.t_end = 1.5, .rtol = 1e-12});
    ASSERT_EQ(all.events.size(), 2u);
    EXPECT_FALSE(all.undefined_at);
    EXPECT_NEAR(all.state(1, 0), 0.5, 1e-11);
    EXPECT_NEAR(all.state(1, 1), 0, 1e-11);

    const auto some =
        sensitivities(Cascade{.loss = 1.5}, {1.0, 2.0}, {}, {.t_end = 1.5, .rtol = 1e-12});
    ASSERT_GE(some.events.size(), 2u);
    ASSERT_TRUE(some.undefined_at);
    EXPECT_EQ(some.undefined_at->event, 1u);
    EXPECT_EQ(some.undefined_at->reason, Undefined::simultaneous);
}

/// At x = 0 y loses `loss` and begins to move, or not; where it crosses zero, it is set to five.
struct PutOnSurface {
    using State = X2;
    double rate = 1;  ///< of y from then on
    double loss = 1;
    double keep = 1;
    Crossing crossing = Crossing::falling;
    static constexpr std::size_t guard_count = 2;

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        return {.crossing = which == 1 ? crossing : Crossing::falling};
    }
    template <class X>
    void flow(double, const X& x, X& dxdt) const
    {
        dxdt[0] = -1;
        dxdt[1] = x[0] > 5 ? rate : 0;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        return x[which];
    }
    template <class X>
    void reset(std::size_t which, double, X& x) const
    {
        if (which == 0) {
            x[0] = 10;
            x[1] = keep * (x[1] - loss);
        } else {
            x[1] = 5;
        }
    }
};

// From y = rate the run is put on zero and leaves it; neighbours that are put before zero are set
// to five. With keep = 0 all neighbours are put on the surface.
TEST(SensitivityThroughEvents, AGuardThatIsPutOnItsSurfaceAndLeavesItEndsTheDerivatives)
{
    const Options options{.t_end = 1.5};
    for (const double rate : {1.0, -1.0}) {
        const PutOnSurface system{.rate = rate, .loss = rate, .crossing = Crossing::either};
        const auto at_zero = sensitivities(system, {1.0, rate}, {}, options);
        ASSERT_EQ(at_zero.events.size(), 1u);
        ASSERT_TRUE(at_zero.undefined_at) << rate;
        EXPECT_EQ(at_zero.undefined_at->event, 0u);
        EXPECT_EQ(at_zero.undefined_at->reason, Undefined::simultaneous);
        EXPECT_NEAR(at_zero.events[0].dt[0], 1, 1e-12);
        EXPECT_TRUE(std::isnan(at_zero.state(1, 1)));

        const auto beyond = sensitivities(system, {1.0, 1.01 * rate}, {}, options);
        EXPECT_FALSE(beyond.undefined_at);
        EXPECT_NEAR(beyond.state(1, 1), 1, 1e-12);
        PutOnSurface none = system;
        none.keep = 0;
        const auto all = sensitivities(none, {1.0, rate}, {}, options);
        EXPECT_FALSE(all.undefined_at);
        EXPECT_NEAR(all.state(1, 0), -rate, 1e-12);
    }
}

// From y = 1 the run is put on zero and does not leave it downward; neighbours that are carried
// below zero are set to five.
TEST(SensitivityThroughEvents, AGuardThatIsCarriedOntoItsSurfaceEndsTheDerivatives)
{
    const Options options{.t_end = 1.5};
    for (const double rate : {1.0, 0.0}) {
        const PutOnSurface system{.rate = rate};
        const auto at_zero = sensitivities(system, {1.0, 1.0}, {}, options);
        ASSERT_EQ(at_zero.events.size(), 1u);
        ASSERT_TRUE(at_zero.undefined_at) << rate;
        EXPECT_EQ(at_zero.undefined_at->event, 0u);
        EXPECT_EQ(at_zero.undefined_at->reason, Undefined::simultaneous);
        EXPECT_TRUE(std::isnan(at_zero.state(1, 1)));

        const auto above = sensitivities(system, {1.0, 1.01}, {}, options);
        EXPECT_FALSE(above.undefined_at);
        EXPECT_NEAR(above.state(1, 1), 1, 1e-12);
        const auto all =
            sensitivities(PutOnSurface{.rate = rate, .keep = 0}, {1.0, 1.0}, {}, options);
        EXPECT_FALSE(all.undefined_at);
        EXPECT_NEAR(all.state(1, 0), -rate, 1e-12);
    }
    // A guard that stays on its surface, as it did before, is not put there.
    const auto still = sensitivities(PutOnSurface{.rate = 0, .loss = 0}, {1.0, 0.0}, {}, options);
    EXPECT_FALSE(still.undefined_at);
    EXPECT_NEAR(still.state(1, 1), 1, 1e-12);
}

/// A clock c; when it has run down, y loses two, and where y falls below zero, resets change it.
struct Pushed {
    using State = std::array<double, 3>;
    bool twice = false;  ///< whether two of them set z
    static constexpr std::size_t guard_count = 3;

    template <class X>
    void flow(double, const X&, X& dxdt) const
    {
        dxdt[0] = -1;
        dxdt[1] = dxdt[2] = 0;
    }
    template <class X>
    [[nodiscard]] double guard(std::size_t which, double, const X& x) const
    {
        if (which < 2) return x[which];
        return twice ? x[1] + 0.5 : 1.0;
    }
    template <class X>
    void reset(std::size_t which, double, X& x) const
    {
        if (which == 0) {
            x[0] = 10;
            x[1] -= 2;
        } else if (which == 1) {
            if (twice) x[2] = 4 + 2 * x[1];
            x[1] = -1.8 - 0.8 * x[1];
        } else {
            x[2] = 3 + x[1];
        }
    }
};

// The second reset leaves y = -1 where it is, but not its neighbours.
TEST(SensitivityThroughEvents, AResetThatChangesNothingStillHasADerivative)
{
    const auto s = sensitivities(Pushed{}, {1.0, 1.0, 0.0}, {}, {.t_end = 1.5});
    ASSERT_EQ(s.events.size(), 2u);
    EXPECT_FALSE(s.undefined_at);
    EXPECT_EQ(s.run.x[1], -1);
    EXPECT_NEAR(s.state(1, 1), -0.8, 1e-12);
}

// Both resets set z to two, but to different values for every neighbour.
TEST(SensitivityThroughEvents, ResetsThatAgreeOnlyHereEndTheDerivatives)
{
    const auto s = sensitivities(Pushed{.twice = true}, {1.0, 1.0, 0.0}, {}, {.t_end = 1.5});
    EXPECT_EQ(s.run.outcome, Outcome::reached_end);
    EXPECT_EQ(s.run.x[2], 2);
    ASSERT_TRUE(s.undefined_at);
    EXPECT_EQ(s.undefined_at->reason, Undefined::simultaneous);
}

/// A motion that meets the surface x = p from below; beyond it x' = y - 5e-4.
struct Ramp {
    using State = X2;
    static constexpr std::size_t surface_count = 1;
    double p = 0;

    [[nodiscard]] double surface(std::size_t, double, const X2& x) const { return x[0] - p; }
    void field(std::size_t region, double, const X2& x, X2& dxdt) const
    {
        dxdt = {region == 0 ? 1 : x[1] - 5e-4, 0};
    }
};

// Sliding keeps x = p, whatever y is, though a y that is larger by 5e-4 would not slide.
TEST(SensitivityThroughEvents, SlidingMovesWithItsSurface)
{
    using Sliding = Filippov<Ramp>;
    const Parameter<Sliding> p{
        .with = [](double value) { return Sliding(Ramp{value}); }, .nominal = 0, .start = {0, 1}};
    const auto s = sensitivities(Sliding(), {-1.0, 0.0}, {.parameters = {p}}, {.t_end = 2});
    ASSERT_EQ(s.events.size(), 1u);
    EXPECT_FALSE(s.undefined_at);
    EXPECT_EQ(s.run.mode, Sliding::mode_of(Place::sliding));
    EXPECT_NEAR(s.state(0, 0), 0, 1e-9);
    EXPECT_NEAR(s.state(0, 2), 1, 1e-9);
    EXPECT_NEAR(s.state(1, 2), 1, 1e-9);
}

/// A block that sticks at the start, under the load sin t: x = (position, velocity).
struct LoadedBlock {
    using State = X2;
    static constexpr std::size_t surface_count = 1;
    double friction = 0.5;

    [[nodiscard]] double surface(std::size_t, double, const X2& x) const { return x[1]; }
    void field(std::size_t region, double t, const X2& x, X2& dxdt) const
    {
        dxdt = {x[1], std::sin(t) + ((region & 1) != 0 ? -friction : friction)};
    }
};

// It is released at asin(mu), without a jump of its acceleration, and slides on: until then the
// velocity does not depend on mu, from then on it falls with it as the time that has passed.
TEST(SensitivityThroughEvents, AReleaseFromStickingHasDerivatives)
{
    using Sticking = Filippov<LoadedBlock>;
    for (int k = 1; k < 20; ++k) {
        const double mu = 0.05 * k;
        const Parameter<Sticking> by{.with = [](double value) { return Sticking({value}); },
                                     .nominal = mu};
        const Sticking block({mu});
        const X2 rest = {0, 0};
        Options options{.t_end = 1.8, .rtol = 1e-12, .atol = 1e-12};
        options.mode = block.start_mode(0, rest);
        const auto s = sensitivities(block, rest, {.parameters = {by}}, options);
        ASSERT_EQ(s.run.events.size(), 1u) << mu;
        ASSERT_FALSE(s.undefined_at) << mu << ": " << name(s.undefined_at->reason);
        const double slides = 1.8 - std::asin(mu);
        // The tolerance of the run, a hundred times for the steps that add up.
        EXPECT_NEAR(s.state(1, 2), -slides, 1e-10) << mu;
        EXPECT_NEAR(s.state(0, 2), -slides * slides / 2, 1e-10) << mu;
    }
}

/// A ball whose floor is known only by its sign.
struct BlindBall : ExactBall {
    static constexpr bool unilateral = false;
    template <class X>
    [[nodiscard]] bool guard(double, const X& x) const
    {
        return x[0] > 0;
    }
};

TEST(SensitivityThroughEvents, AResetAtAGuardWithoutValueHasNoDerivative)
{
    const auto s = sensitivities(BlindBall{}, {10.0, 0.0}, {}, {.t_end = 2});
    ASSERT_TRUE(s.undefined_at);
    EXPECT_EQ(s.undefined_at->reason, Undefined::boolean_guard);
    EXPECT_EQ(s.undefined_at->event, 0u);
}

// --- accumulation and rest ---

// The limit is t_1 (1 + r) / (1 - r). The ball is caught a few units in the last place
// of t before it; some 300 impacts add up rounding of 1e-13 each.
TEST(SensitivityThroughEvents, WhereBouncesAccumulateTheirLimitHasDerivatives)
{
    const auto s = sensitivities(BouncingBall(), {10.0, 0.0}, {.parameters = {restitution}},
                                 {.t_end = 30, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(s.run.outcome, Outcome::reached_end);
    ASSERT_FALSE(s.undefined_at) << name(s.undefined_at->reason) << s.undefined_at->event;
    ASSERT_EQ(s.run.events.back().kind, EventKind::accumulation);
    const double t1 = std::sqrt(20 / 9.81);
    const Eigen::VectorXd& dt = s.events.back().dt;
    expect_relative(dt[0], 19 * t1 / 20, 1e-9, "u0");
    expect_relative(dt[1], 1 / 9.81, 1e-9, "v0");
    expect_relative(dt[2], t1 * 2 / 0.01, 1e-9, "r");
    EXPECT_EQ(s.state, Eigen::MatrixXd::Zero(2, 3));
}

TEST(SensitivityThroughEvents, ABallThatDoesNotBounceRestsWhereverItFell)
{
    const BouncingBall ball({.restitution = 0});
    const auto s = sensitivities(ball, {10.0, 0.0}, {}, {.t_end = 3, .rtol = 1e-12});
    const auto plain = integrate(ball, {10.0, 0.0}, {.t_end = 3, .rtol = 1e-12});
    EXPECT_EQ(s.run.outcome, plain.outcome);
    EXPECT_EQ(s.run.events.size(), plain.events.size());
    EXPECT_FALSE(s.undefined_at);
    for (const EventSensitivity& event : s.events) {
        EXPECT_NEAR(event.dt[0], BallClosedForm().impact(0)[1], 1e-11);
    }
    EXPECT_EQ(s.state, Eigen::MatrixXd::Zero(2, 2));
}

/// x, y and their rates; y comes to rest on the floor, and x does not.
struct ThrownBall {
    using State = std::array<double, 4>;
    template <class V>
    void flow(const V&, const std::array<V, 4>& x, std::array<V, 4>& dxdt) const
    {
        dxdt[0] = x[2];
        dxdt[1] = x[3];
        dxdt[2] = V(0);
        dxdt[3] = V(-10);
    }
    template <class V>
    [[nodiscard]] V guard(const V&, const std::array<V, 4>& x) const
    {
        return x[1];
    }
    void reset(double, State& x) const { x[1] = 0, x[3] *= -0.5; }
    void rest(double, State& x) const { x[1] = x[3] = 0; }
};

TEST(SensitivityThroughEvents, AThrownBallThatRestsSlidesOn)
{
    // x = x0 + u t, whatever the flights are; y and its rate are those of the floor.
    const auto s = sensitivities(ThrownBall{}, {0, 0.1, 1, 0}, {}, {.t_end = 4, .rtol = 1e-12});
    ASSERT_EQ(s.run.outcome, Outcome::reached_end);
    EXPECT_FALSE(s.undefined_at);
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(4, 4);
    expected(0, 0) = expected(2, 2) = 1;
    expected(0, 2) = 4;
    EXPECT_LE((s.state - expected).cwiseAbs().maxCoeff(), 1e-9) << s.state;
}

// --- a reset that changes the dimension ---

/// x' = 1 up to x = 1, then (x, v) with x' = -x, v' = x, from v = 1 + t.
struct Growing {
    static constexpr std::size_t guard_count = 1;

    void flow(Mode mode, double, const std::vector<double>& x, std::vector<double>& dxdt) const
    {
        dxdt[0] = mode == 0 ? 1 : -x[0];
        if (mode == 1) dxdt[1] = x[0];
    }
    [[nodiscard]] double guard(std::size_t, double, const std::vector<double>& x) const
    {
        return 1 - x[0];
    }
    [[nodiscard]] bool enabled(std::size_t, Mode mode) const { return mode == 0; }
    [[nodiscard]] Mode reset(std::size_t, Mode, double t, std::vector<double>& x) const
    {
        x.push_back(x[0] + t);
        return 1;
    }
};

// t_1 = 1 - x0, x = exp(-(t - t_1)), v = 1 + t_1 + 1 - exp(-(t - t_1)).
TEST(SensitivityThroughEvents, TheDimensionMayChange)
{
    const auto s = sensitivities(Growing{}, std::vector<double>{0.2}, {},
                                 {.t_end = 2, .rtol = 1e-12, .atol = 1e-12});
    ASSERT_EQ(s.events.size(), 1u);
    EXPECT_EQ(s.events[0].before.rows(), 1);
    EXPECT_EQ(s.events[0].after.rows(), 2);
    EXPECT_NEAR(s.events[0].dt[0], -1, 1e-12);
    ASSERT_EQ(s.state.rows(), 2);
    const double e = std::exp(-1.2);
    EXPECT_NEAR(s.state(0, 0), -e, 1e-11);
    EXPECT_NEAR(s.state(1, 0), -1 + e, 1e-11);
}

}  // namespace
}  // namespace ricochet::sensitivity_events_test
