// Errors that runs with set-valued phases state about themselves, against closed forms: not less
// than a tenth of the true ones, nor more than ten times as large.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "ricochet/nonsmooth/contact_motion.hpp"

namespace ricochet::estimated_error_test {
namespace {

constexpr double rounding = 1e-9;

void expect_bound(double stated, double found, double exact)
{
    const double error = std::abs(found - exact);
    EXPECT_GE(10 * stated + rounding, error) << found << " instead of " << exact;
    EXPECT_LE(stated, 10 * error + rounding) << found << " instead of " << exact;
}

// --- six blocks with friction ---

/// Block i, with friction 1, is pulled by 1.5 sin(t + i).
struct Blocks {
    static constexpr int state_size = Eigen::Dynamic, reaction_size = Eigen::Dynamic;

    struct Friction {
        [[nodiscard]] static std::size_t dimension() { return 6; }
        [[nodiscard]] static double lower(std::size_t) { return -1; }
        [[nodiscard]] static double upper(std::size_t) { return 1; }
        void project(std::span<const double> z, std::span<double> p) const
        {
            detail::clamp(*this, z, p);
        }
        void derivative(std::span<const double> z, std::span<double> d) const
        {
            detail::clamp_derivative(*this, z, d);
        }
    };
    [[nodiscard]] static int size() { return 6; }
    [[nodiscard]] static int reactions() { return 6; }
    static void smooth(double t, const Eigen::VectorXd&, Eigen::VectorXd& f)
    {
        for (int i = 0; i < 6; ++i) f[i] = 1.5 * std::sin(t + i);
    }
    [[nodiscard]] static Friction reaction_set(double, const Eigen::VectorXd&) { return {}; }
};

/// Speed of a block that starts from rest while friction holds it and slips in the direction of its
/// load, before it stops again: from the time a at which the load is as large as the friction.
[[nodiscard]] double speed_after_slip(double a, double t, double i, double direction)
{
    return 1.5 * (std::cos(a + i) - std::cos(t + i)) - direction * (t - a);
}

TEST(EstimatedError, OfSixBlocksWithFrictionBoundsTheTrueOne)
{
    const double angle = std::asin(1 / 1.5);
    // Steps that do not meet the slips.
    for (const double step : {0.013, 0.0041}) {
        HandOverOptions options{.t_end = 1.1};
        options.set_valued.step = step;
        const auto run = hand_over(Blocks{}, Eigen::VectorXd::Zero(6), options);
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        const auto error = estimate_error(run, Blocks{}, Eigen::VectorXd::Zero(6), options);
        // Block 0 slips at asin(2 / 3), block 3 where its load is at - 2 / 3, beyond pi.
        expect_bound(error.end[0], run.x[0], speed_after_slip(angle, 1.1, 0, 1));
        const double third = std::acos(-1.0) + angle - 3;
        expect_bound(error.end[3], run.x[3], speed_after_slip(third, 1.1, 3, -1));
    }
}

// --- backlash ---

/// A stop, |w| <= 1, under the load 2 cos t: its input less w is that of a backlash.
struct Backlash {
    static constexpr int state_size = 1, reaction_size = 1;
    static constexpr Confines confines = Confines::state;
    using Vector = Eigen::Matrix<double, 1, 1>;
    static void smooth(double t, const Vector&, Vector& f) { f[0] = 2 * std::cos(t); }
    static sets::IntervalSet reaction_set(double, const Vector&)
    {
        return sets::IntervalSet::symmetric(1);
    }
};

TEST(EstimatedError, OfABacklashBoundsTheTrueOneAtSamplesToo)
{
    // The input 2 sin t turns at pi / 2, at 3 pi / 2 and so on; w is 1 less what it has gone back.
    HandOverOptions options{.t_end = 7.3, .sample_times = {0.2, 2, 5.5}};
    for (const double step : {0.1, 0.037}) {
        options.set_valued.step = step;
        const auto run = hand_over(Backlash{}, Backlash::Vector::Zero(), options);
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        const auto error = estimate_error(run, Backlash{}, Backlash::Vector::Zero(), options);
        ASSERT_EQ(error.samples.size(), 3U);
        const std::vector<double> exact{2 * std::sin(0.2), 1 - 2 * (1 - std::sin(2)),
                                        -1 + 2 * (1 + std::sin(5.5))};
        for (std::size_t k = 0; k < 3; ++k) {
            expect_bound(error.samples[k][0], run.trajectory.x[k][0], exact[k]);
        }
        expect_bound(error.end[0], run.x[0], 1);
    }
}

// --- a rocking block ---

/// A block of 1 kg and 4 kg m^2 on corners 1 m beside its centre, for small angles, under 10 m/s^2;
/// q = (way, height, angle). On a corner the angle has the acceleration -2, and where it strikes
/// the other one its speed is multiplied by 0.6.
struct Rocking {
    static constexpr int coordinates = 3;
    static constexpr int contacts = 2;
    static constexpr int tangents = 1;
    using V = Eigen::Vector3d;
    static void mass(const V&, Eigen::Matrix3d& m) { m = V(1, 1, 4).asDiagonal(); }
    static void force(double, const V&, const V&, V& f) { f << 0, -10, 0; }
    static void gaps(const V& q, Eigen::Vector2d& g) { g << q[1] - q[2], q[1] + q[2]; }
    static void directions(const V&, Eigen::Matrix<double, 4, 3>& h)
    {
        h << 0, 1, -1, 1, 0, 0, 0, 1, 1, 1, 0, 0;
    }
    static double restitution(int) { return 0; }
    static double friction(int) { return 0; }
};

TEST(EstimatedError, OfARockingBlockBoundsTheTrueOne)
{
    const double start = 0.1, first = std::sqrt(start);  // angle [rad], time of the first blow [s]
    // At a quarter of the swing after it, s = 0.3 first: - 1.2 first s + s^2.
    const double t = 1.3 * first, s = 0.3 * first;
    const double angle = -1.2 * first * s + s * s;
    // With 0.0007 half of the steps meet the blow at the same time as the whole ones.
    for (const double step : {0.01, 0.0037, 0.0007}) {
        HandOverOptions options{.t_end = t};
        options.set_valued.step = step;
        const Rocking::V q(0, start, start), v = Rocking::V::Zero();
        const auto run = hand_over(Rocking{}, q, v, options);
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        const auto error = estimate_error(run, Rocking{}, q, v, options);
        expect_bound(error.end[2], run.x[2], angle);
        expect_bound(error.end[5], run.x[5], -1.2 * first + 2 * s);
    }
}

// --- where there is none ---

TEST(EstimatedError, OfARunThatIsCutShortIsInfinite)
{
    const HandOverOptions options{.t_end = 1, .max_steps = 100};
    const auto run = hand_over(Backlash{}, Backlash::Vector::Zero(), options);
    EXPECT_EQ(run.outcome, Outcome::step_limit);
    const auto error = estimate_error(run, Backlash{}, Backlash::Vector::Zero(), options);
    EXPECT_EQ(error.end[0], std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace ricochet::estimated_error_test
