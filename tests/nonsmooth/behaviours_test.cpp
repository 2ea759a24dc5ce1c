// Expected behaviour of a solver of variational inequalities on nearly trivial problems, which
// the reference implementation of the Bathe integrator also tests.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "ricochet/nonsmooth/set_valued_motion.hpp"

namespace ricochet::behaviours_test {
namespace {

using namespace sets;

/// The whole space as a set: its projection is the identity, and the reaction is zero.
struct Everything {
    [[nodiscard]] static std::size_t dimension() { return 5; }
    static void project(std::span<const double> z, std::span<double> p)
    {
        std::copy(z.begin(), z.end(), p.begin());
    }
    static void derivative(std::span<const double> /*z*/, std::span<double> d)
    {
        for (std::size_t i = 0; i < 25; ++i) d[i] = i % 6 == 0 ? 1 : 0;
    }
};

struct Relaxation {
    static constexpr int state_size = Eigen::Dynamic;
    static constexpr int reaction_size = Eigen::Dynamic;
    static constexpr Confines confines = Confines::state;
    using Vector = Eigen::VectorXd;
    using Square = Eigen::MatrixXd;
    Square stiffness;
    static int size() { return 5; }
    static int reactions() { return 5; }
    void smooth(double /*t*/, const Vector& w, Vector& f) const { f = -stiffness * w; }
    [[nodiscard]] static Everything reaction_set(double, const Vector&) { return {}; }
};

TEST(NonsmoothBehaviours, AFixedPointSolvesRandomDefiniteSystems)
{
    // A backward Euler step solves (1 + h S) w = w0, S symmetric and positive definite.
    std::mt19937_64 random(11);
    std::normal_distribution<double> normal;
    for (int trial = 0; trial < 20; ++trial) {
        Relaxation system;
        Relaxation::Square m(5, 5);
        Relaxation::Vector w0(5);
        for (double& entry : m.reshaped()) entry = normal(random);
        for (double& entry : w0) entry = normal(random);
        system.stiffness = m * m.transpose() + Relaxation::Square::Identity(5, 5);
        const double h = 0.5;
        SetValuedMotion<Relaxation> motion(
            system, w0,
            {.t_end = h,
             .step = h,
             .scheme = {.scheme = Scheme::backward_euler,
                        .stage = {.method = StageMethod::fixed_point, .tolerance = 1e-11}}});
        ASSERT_EQ(motion.run(), Outcome::reached_end);
        const Relaxation::Square whole = Relaxation::Square::Identity(5, 5) + h * system.stiffness;
        const Relaxation::Vector exact = whole.llt().solve(w0);
        // The residual of 1e-11 over the least eigenvalue, which is at least 1 + h.
        EXPECT_LE((motion.state().w - exact).norm(), 1e-10) << trial;
        EXPECT_LE(motion.statistics().iterations, 200U) << trial;
    }
}

struct Decay {
    static constexpr int state_size = 1;
    static constexpr int reaction_size = 1;
    using Vector = Eigen::Matrix<double, 1, 1>;
    static void smooth(double t, const Vector& w, Vector& f) { f[0] = -w[0] + std::sin(1e4 * t); }
    static IntervalSet reaction_set(double, const Vector&) { return IntervalSet::symmetric(0.1); }
};

TEST(NonsmoothBehaviours, NoStepIsShorterThanTheLeastOne)
{
    // The tolerance cannot be met at the least step: the run reports so, and no step was
    // shorter, except for the last one of a run that ends.
    const double h_min = 1e-3;
    SetValuedMotion<Decay> motion(Decay{}, Decay::Vector::Constant(1.0),
                                  {.t_end = 1,
                                   .step = 0.01,
                                   .controller = FilteredStep::h211b(4),
                                   .estimate = ErrorEstimate::doubling,
                                   .rtol = 1e-12,
                                   .atol = 1e-12,
                                   .h_min = h_min});
    double shortest = 1;
    while (motion.advance() == Outcome::running) {
        shortest = std::min(shortest, motion.state().t - motion.before().t);
    }
    EXPECT_EQ(motion.outcome(), Outcome::step_underflow);
    EXPECT_GE(shortest, h_min);
}

/// 300 masses in a row on springs, with friction on the floor.
struct Chain {
    static constexpr int state_size = Eigen::Dynamic;
    static constexpr int reaction_size = Eigen::Dynamic;
    static constexpr int n = 300;  // 150 positions and as many velocities
    static constexpr bool affine = true;
    [[nodiscard]] static int size() { return n; }
    [[nodiscard]] static int reactions() { return n / 2; }
    static void smooth(double t, const Eigen::VectorXd& w, Eigen::VectorXd& f)
    {
        f.resize(n);
        const int m = n / 2;
        for (int i = 0; i < m; ++i) {
            f[i] = w[m + i];
            f[m + i] = (i > 0 ? w[i - 1] - w[i] : -w[i]) + (i + 1 < m ? w[i + 1] - w[i] : 0.0);
        }
        f[m] += std::sin(3 * t);
    }
    static void smooth_jacobian(double /*t*/, const Eigen::VectorXd& /*w*/, Eigen::MatrixXd& j)
    {
        const int m = n / 2;
        j.setZero(n, n);
        for (int i = 0; i < m; ++i) {
            j(i, m + i) = 1;
            j(m + i, i) = i + 1 < m ? -2 : -1;
            if (i > 0) j(m + i, i - 1) = 1;
            if (i + 1 < m) j(m + i, i + 1) = 1;
        }
    }
    static void observe(Eigen::MatrixXd& e)
    {
        e.setZero(n / 2, n);
        e.rightCols(n / 2).setIdentity();
    }
    struct Floor {
        [[nodiscard]] static std::size_t dimension() { return n / 2; }
        static double lower(std::size_t) { return -0.05; }
        static double upper(std::size_t) { return 0.05; }
        static void project(std::span<const double> z, std::span<double> p)
        {
            for (std::size_t i = 0; i < z.size(); ++i) p[i] = std::clamp(z[i], -0.05, 0.05);
        }
        static void derivative(std::span<const double> z, std::span<double> d)
        {
            std::fill(d.begin(), d.end(), 0.0);
            for (std::size_t i = 0; i < z.size(); ++i) {
                d[i * z.size() + i] = std::abs(z[i]) < 0.05 ? 1 : 0;
            }
        }
    };
    static Floor reaction_set(double, const Eigen::VectorXd&) { return {}; }
};

TEST(NonsmoothBehaviours, AChainOfThreeHundredUnknownsIsFollowed)
{
    SetValuedMotion<Chain> motion(Chain{}, Eigen::VectorXd::Zero(Chain::n),
                                  {.t_end = 1, .step = 0.1});
    ASSERT_EQ(motion.run(), Outcome::reached_end);
    EXPECT_TRUE(motion.state().w.allFinite());
    // The front has passed a few masses; the floor holds the others, to the residual.
    EXPECT_GT(motion.state().w[0], 0.01);
    EXPECT_LT(motion.state().w.segment(100, 50).cwiseAbs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace ricochet::behaviours_test
