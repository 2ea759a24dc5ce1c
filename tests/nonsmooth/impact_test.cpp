// Time stepping with impacts and friction; friction in the plane.

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "problems/incline_block.hpp"
#include "refusal.hpp"
#include "ricochet/nonsmooth/time_stepping.hpp"
#include "ricochet/systems/two_contact_block.hpp"
#include "ricochet/systems/woodpecker.hpp"

namespace ricochet::impact_test {
namespace {

// --- friction in the plane ---

TEST(InclineBlockMotion, KeepsItsInvariantToOrderTwoWhileItTurns)
{
    const InclineBlock block({.slope = 0.3, .friction = 0.2});
    double drift[2];
    for (int k = 0; k < 2; ++k) {
        SetValuedMotion<InclineBlock> motion(block, {-1, 2, 0, 0},
                                             {.t_end = 0.6, .step = 0.01 / (1 << k)});
        const double start = block.invariant(motion.state().w);
        EXPECT_EQ(motion.run(), Outcome::reached_end);
        drift[k] = block.invariant(motion.state().w) - start;
        EXPECT_LT(std::abs(drift[k]), 1e-2 * start);
    }
    EXPECT_NEAR(drift[0] / drift[1], 4, 0.4);
}

TEST(InclineBlockMotion, ComesToRestWhereFrictionHoldsIt)
{
    // Straight down: 2 m/s against g (0.5 cos 0.3 - sin 0.3).
    const InclineBlock block;
    const double braking = 9.81 * (0.5 * std::cos(0.3) - std::sin(0.3));
    SetValuedMotion<InclineBlock> motion(block, {2, 0, 0, 0}, {.t_end = 2, .step = 1e-3});
    EXPECT_EQ(motion.run(), Outcome::reached_end);
    EXPECT_NEAR(motion.state().w[0], 0, 1e-10);
    EXPECT_NEAR(motion.state().w[1], 0, 1e-10);
    EXPECT_NEAR(motion.state().w[2], 2 * 2 / (2 * braking), 2e-3);  // a step at 2 m/s
    // At rest friction is the weight's component along the slope.
    EXPECT_NEAR(motion.state().reaction[0], -9.81 * std::sin(0.3), 1e-6);
    EXPECT_NEAR(motion.state().reaction[1], 0, 1e-6);
}

TEST(InclineBlockMotion, StartsWithTheFrictionOfItsDirection)
{
    const InclineBlock block;
    const detail::InclusionMatrices<InclineBlock> m(block);
    const double bound = 0.5 * 9.81 * std::cos(0.3);
    const auto sliding = minimal_selection(m, 0, {3, -4, 0, 0});
    EXPECT_NEAR(sliding[0], -0.6 * bound, 1e-7);
    EXPECT_NEAR(sliding[1], 0.8 * bound, 1e-7);
    const auto resting = minimal_selection(m, 0, {0, 0, 0, 0});
    EXPECT_NEAR(resting[0], -9.81 * std::sin(0.3), 1e-10);
    EXPECT_NEAR(resting[1], 0, 1e-10);
}

// --- impacts ---

struct Ball1d {
    static constexpr int coordinates = 1;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;
    using V = Eigen::Matrix<double, 1, 1>;
    double e = 0.5;
    static void mass(const V&, V& m) { m << 1; }
    static void force(double, const V&, const V&, V& f) { f << -9.81; }
    static void gaps(const V& q, V& g) { g = q; }
    static void directions(const V&, Eigen::Matrix<double, 2, 1>& h) { h << 1, 0; }
    [[nodiscard]] double restitution(int) const { return e; }
    static double friction(int) { return 0; }
};

TEST(TimeStepping, RoundingOfManyStepsLeavesNoTinyLastStep)
{
    // The sum of 100 000 times 0.01 is 7.6e-10 less than 1000.
    TimeStepping<Ball1d> motion({}, Ball1d::V(1.0), Ball1d::V(0.0), {.t_end = 1000, .step = 0.01});
    EXPECT_EQ(motion.run(), Outcome::reached_end);
    EXPECT_EQ(motion.statistics().steps, 100'000U);
    EXPECT_EQ(motion.state().t, 1000);
}

TEST(TimeStepping, PassesTheAccumulationOfABouncingBallAndRests)
{
    // From 1 m with e = 0.5 the impacts end at sqrt(2 / g) (1 + e) / (1 - e) = 1.3546 s.
    TimeStepping<Ball1d> motion({}, Ball1d::V(1.0), Ball1d::V(0.0), {.t_end = 2, .step = 1e-3});
    EXPECT_EQ(motion.run(), Outcome::reached_end);
    EXPECT_EQ(motion.state().t, 2);
    EXPECT_NEAR(motion.state().v[0], 0, 1e-9);
    EXPECT_NEAR(motion.state().q[0], 0, 5e-3);
    EXPECT_NEAR(motion.state().impulse[0], 9.81e-3, 1e-9);  // the weight over a step
}

TEST(TimeStepping, IsOfOrderOneAcrossAnImpact)
{
    // After one bounce, at t = 0.8: thrown up at e sqrt(2 g) at t1 = sqrt(2 / g).
    const double t1 = std::sqrt(2 / 9.81);
    const double s = 0.8 - t1;
    const double exact = 0.5 * std::sqrt(2 * 9.81) * s - 9.81 / 2 * s * s;
    const auto mean_error = [&](int steps) {
        double sum = 0;
        for (int k = 0; k < 20; ++k) {
            TimeStepping<Ball1d> motion({}, Ball1d::V(1.0), Ball1d::V(0.0),
                                        {.t_end = 0.8, .step = 0.8 / (steps + 3 * k)});
            EXPECT_EQ(motion.run(), Outcome::reached_end);
            sum += std::abs(motion.state().q[0] - exact);
        }
        return sum / 20;
    };
    const double order = std::log2(mean_error(200) / mean_error(3200)) / 4;
    EXPECT_GT(order, 0.8);
    EXPECT_LT(order, 1.3);
}

TEST(TimeStepping, EnergyOfAnElasticBallNeverGrowsAtAnImpact)
{
    TimeStepping<Ball1d> motion({.e = 1}, Ball1d::V(1.0), Ball1d::V(0.0),
                                {.t_end = 5, .step = 1e-3});
    // The midpoint rule keeps the energy of flight; an impact at depth below the floor
    // exchanges velocities exactly.
    EXPECT_EQ(motion.run([](const auto& state) {
        const double energy = 9.81 * state.q[0] + state.v[0] * state.v[0] / 2;
        EXPECT_NEAR(energy, 9.81, 0.15) << state.t;
    }),
              Outcome::reached_end);
}

TEST(TimeStepping, ABlockOnTwoCornersSlidesToRestAndLeansForward)
{
    const TwoContactBlock block;
    const double stop = 3 / (0.4 * 9.81);
    const double h = 1e-4;
    TimeStepping<TwoContactBlock> motion(block, {0, 0, 0}, {3, 0, 0}, {.t_end = 1, .step = h});
    // The fraction of the front corner while it slides: 1/2 + 0.4 * 0.25 / (2 * 0.5) = 0.6.
    const double weight = block.mass_of_block * block.gravity * h;
    EXPECT_EQ(motion.run([&](const auto& state) {
        if (state.t < 0.01 || state.t > stop - 0.01) return;
        EXPECT_NEAR(state.impulse[2], 0.6 * weight, 1e-6 * weight) << state.t;
        EXPECT_NEAR(state.impulse[0], 0.4 * weight, 1e-6 * weight) << state.t;
        EXPECT_NEAR(state.impulse[3], -0.4 * 0.6 * weight, 1e-6 * weight);
    }),
              Outcome::reached_end);
    EXPECT_NEAR(motion.state().q[0], 3 * 3 / (2 * 0.4 * 9.81), 3 * h);
    EXPECT_NEAR(motion.state().v.norm(), 0, 1e-9);
    // A corner opened by rounding falls for one step: g h^2.
    EXPECT_NEAR(motion.state().q[2], 0, 2 * 9.81 * h * h);
}

TEST(TimeStepping, TheWoodpeckerClimbsDownInACycle)
{
    const Woodpecker toy;
    TimeStepping<Woodpecker> motion(toy, Woodpecker::start(), Woodpecker::start_velocity(),
                                    {.t_end = 2, .step = 2e-5});
    std::vector<double> beak;     // times of the beak's impacts
    std::vector<double> heights;  // heights at these times
    EXPECT_EQ(motion.run([&](const auto& state) {
        if (state.impulse[0] > 0 && (beak.empty() || state.t - beak.back() > 0.02)) {
            beak.push_back(state.t);
            heights.push_back(state.q[0]);
        }
    }),
              Outcome::reached_end);
    ASSERT_GT(beak.size(), 8U);
    // The last cycles are equal, and in each the bird descends.
    const std::size_t n = beak.size();
    const double period = beak[n - 1] - beak[n - 2];
    RecordProperty("period", std::to_string(period));
    EXPECT_NEAR(beak[n - 2] - beak[n - 3], period, 2e-3);
    EXPECT_GT(period, 0.12);
    EXPECT_LT(period, 0.17);
    EXPECT_LT(heights[n - 1], heights[n - 2] - 1e-3);
}

/// A unit mass in a corner of a floor and a wall, each the other's tangent.
struct Corner {
    static constexpr int coordinates = 2;
    static constexpr int contacts = 2;
    static constexpr int tangents = 1;
    using V = Eigen::Vector2d;
    double mu = 1;
    double e = 1;
    double broken_from = 10;  ///< [s], no force from then on
    static void mass(const V&, Eigen::Matrix2d& m) { m.setIdentity(); }
    void force(double t, const V&, const V&, V& f) const
    {
        f << 0, t < broken_from ? -1.0 : std::nan("");
    }
    static void gaps(const V& q, V& g) { g << q[1], q[0]; }
    static void directions(const V&, Eigen::Matrix<double, 4, 2>& h)
    {
        h << 0, 1, 1, 0, 1, 0, 0, 1;
    }
    [[nodiscard]] double restitution(int) const { return e; }
    [[nodiscard]] double friction(int c) const { return c == 0 ? mu : 0; }
};

/// With friction on both sides.
struct RoughCorner : Corner {
    [[nodiscard]] double friction(int) const { return mu; }
};

TEST(TimeStepping, AnImpactWithoutASolutionEndsTheRunAndMakesNoEnergy)
{
    for (const double mu : {1.0, 2.0}) {
        RoughCorner corner;
        corner.mu = mu;
        TimeStepping<RoughCorner> motion(corner, {0, 0}, {-1, -1}, {.t_end = 1, .step = 0.01});
        EXPECT_EQ(motion.run(), Outcome::not_converged);
        EXPECT_EQ(motion.state().t, 0);
        EXPECT_EQ(motion.state().v, Eigen::Vector2d(-1, -1));
        EXPECT_GT(motion.failure().residual, 1e-3);
        EXPECT_TRUE(std::isfinite(motion.failure().residual));
    }
}

TEST(TimeStepping, AForceThatIsNotFiniteEndsTheRunWithWhatWasComputed)
{
    for (const double height : {0.0, 5.0}) {  // in contact, in flight
        TimeStepping<Corner> motion({.e = 0, .broken_from = 0.5}, {1, height}, {0, 0},
                                    {.t_end = 1, .step = 0.01});
        EXPECT_EQ(motion.run(), Outcome::not_converged);
        // Steps are halved ten times before the run gives up.
        EXPECT_GT(motion.state().t, 0.48);
        EXPECT_LT(motion.state().t, 0.51);
        EXPECT_TRUE(motion.state().q.allFinite());
        EXPECT_TRUE(std::isinf(motion.failure().residual));
    }
}

TEST(TimeStepping, ARunOfNoLengthIsOver)
{
    TimeStepping<Ball1d> motion({}, Ball1d::V(1.0), Ball1d::V(0.0),
                                {.t_start = 2, .t_end = 2, .step = 0.1});
    int seen = 0;
    EXPECT_EQ(motion.run([&](const auto&) { ++seen; }), Outcome::reached_end);
    EXPECT_EQ(seen, 1);
    EXPECT_EQ(motion.state().t, 2);
    EXPECT_EQ(motion.state().q[0], 1);
    EXPECT_EQ(motion.statistics().steps, 0U);
    EXPECT_THROW((TimeStepping<Ball1d>({}, Ball1d::V(1.0), Ball1d::V(0.0),
                                       {.t_start = 2, .t_end = 1.9, .step = 0.1})),
                 std::invalid_argument);
}

TEST(TimeStepping, ARefusalSaysWhatIsWrongAndNamesTheContact)
{
    const auto start = [](Eigen::Vector2d q, Eigen::Vector2d v, double mu) {
        return refusal([&] { TimeStepping<Corner>({.mu = mu}, q, v, {.t_end = 1, .step = 0.1}); });
    };
    const double nan = std::nan("");
    const auto has = [](const std::string& text, const char* part) {
        return text.find(part) != std::string::npos;
    };
    EXPECT_EQ(start({1, 1}, {0, 0}, 1), "accepted");
    EXPECT_PRED2(has, start({nan, 1}, {0, 0}, 1), "position is not finite");
    EXPECT_PRED2(has, start({1, 1}, {0, nan}, 1), "velocity is not finite");
    EXPECT_PRED2(has, start({-0.25, 1}, {0, 0}, 1), "the gap of contact 1 is -0.25");
    EXPECT_PRED2(has, start({1, 1}, {0, 0}, std::numeric_limits<double>::infinity()),
                 "contact 0: friction must be finite, zero or positive, got inf");
}

/// A point above a roof with its ridge at x = 0, whose normal is multiplied by `factor`.
struct Roof {
    static constexpr int coordinates = 2;
    static constexpr int contacts = 1;
    static constexpr int tangents = 1;
    using V = Eigen::Vector2d;
    double factor = 1;
    double size = 1;  ///< [m] of everything

    void mass(const V&, Eigen::Matrix2d& m) const { m.setIdentity(); }
    void force(double, const V&, const V&, V& f) const { f = {0, -9.81}; }
    void gaps(const V& q, Eigen::Matrix<double, 1, 1>& g) const
    {
        g[0] = q[1] + std::abs(q[0]) + q[0] * q[0] / size;
    }
    void directions(const V& q, Eigen::Matrix2d& h) const
    {
        h << (q[0] < 0 ? -1 : 1) + 2 * q[0] / size, 1, 0, 0;
        h *= factor;
    }
    [[nodiscard]] double restitution(int) const { return 0.5; }
    [[nodiscard]] double friction(int) const { return 0; }
};

TEST(TimeStepping, RefusesADirectionThatIsNotTheGradientOfItsGap)
{
    const auto start = [](const Roof& roof, const Roof::V& q) {
        return refusal([&] {
            TimeStepping<Roof>(roof, q * roof.size, {0, 0}, {.t_end = 1, .step = 0.1});
        });
    };
    for (const double size : {1e-6, 1.0, 1e6}) {
        for (const double x : {-3.0, -1e-4, 0.0, 0.5}) {  // the ridge has two gradients
            EXPECT_EQ(start({.size = size}, {x, 1}), "accepted") << size << ' ' << x;
        }
        EXPECT_NE(start({.factor = -1, .size = size}, {0.5, 1}), "accepted") << size;
        EXPECT_NE(start({.factor = 2, .size = size}, {0.5, 1}), "accepted") << size;
    }
    EXPECT_EQ(start({.factor = -1}, {0.5, 1}),
              "contact 0: the first row of its directions must be the gradient of its gap, about "
              "(2, 1), got (-2, -1)");
    EXPECT_EQ(start({.factor = std::nan("")}, {0.5, 1}), "accepted");  // the run reports it
}

TEST(TimeStepping, RefusesAStartInsideAnObstacleAndWrongCoefficients)
{
    const auto start = [](double height, double e) {
        return [=] {
            TimeStepping<Ball1d>({.e = e}, Ball1d::V(height), Ball1d::V(0.0),
                                 {.t_end = 1, .step = 0.1});
        };
    };
    EXPECT_NO_THROW(start(0, 1)());
    EXPECT_THROW(start(-0.1, 1)(), std::invalid_argument);
    EXPECT_THROW(start(1, 1.1)(), std::invalid_argument);
    EXPECT_THROW((TimeStepping<Ball1d>({}, Ball1d::V(1.0), Ball1d::V(0.0), {.t_end = 1})),
                 std::invalid_argument);
}

TEST(TimeStepping, RefusesARestartThatIsNotFinite)
{
    TimeStepping<Ball1d> steps({}, Ball1d::V(1.0), Ball1d::V(0.0), {.t_end = 1, .step = 0.1});
    const double nan = std::nan("");
    const auto refused = [&](double t, double q, double v) {
        return refusal([&] { steps.restart(t, Ball1d::V(q), Ball1d::V(v)); });
    };
    EXPECT_EQ(refused(nan, 1, 0), "inclusion: the time at the start must be finite, not nan");
    EXPECT_EQ(refused(0, nan, 0), "inclusion: the initial position is not finite");
    EXPECT_EQ(refused(0, 1, nan), "inclusion: the initial velocity is not finite");
    EXPECT_EQ(refused(0, 1, 0), "accepted");
}

}  // namespace
}  // namespace ricochet::impact_test
