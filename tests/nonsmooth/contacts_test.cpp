// Contact problems with friction: closed forms, then random ones.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "random_contacts.hpp"
#include "ricochet/nonsmooth/contact_problem.hpp"
#include "ricochet/nonsmooth/linear_cases.hpp"

namespace ricochet::contacts_test {
namespace {

using testing_support::RandomContacts;

TEST(ContactSolver, OneContactSeparatesSticksOrSlides)
{
    ContactSolver solver;
    const Eigen::MatrixXd w = Eigen::Vector3d(2, 2, 2).asDiagonal();
    const std::array friction = {0.5};
    const auto solve = [&](double n, double t1, double t2) {
        Eigen::VectorXd q(3);
        q << n, t1, t2;
        Eigen::VectorXd p = Eigen::VectorXd::Zero(3);
        const ContactReport report = solver.solve(w, q, friction, 3, p);
        EXPECT_TRUE(report.converged);
        return p;
    };
    EXPECT_EQ(solve(1, 5, 5).norm(), 0);
    // Sticks: p = -q / 2, within the cone.
    EXPECT_LT((solve(-2, 0.3, -0.4) - Eigen::Vector3d(1, -0.15, 0.2)).norm(), 1e-10);
    // Slides: p_n = 1, friction 0.5 against the direction (3, -4) / 5.
    EXPECT_LT((solve(-2, 3, -4) - Eigen::Vector3d(1, -0.3, 0.4)).norm(), 1e-10);
    EXPECT_LT(solve(0, 0, 0).norm(), 1e-300);
}

// The end of a thin rod (mass 1, length 2) on a floor: with much friction W is far from monotone.
TEST(ContactSolver, ARodWithMuchFrictionHasTheStateThatItsCasesHave)
{
    ContactSolver solver;
    std::mt19937 random(11);
    std::uniform_real_distribution<double> any(-1, 1);
    int unique = 0;
    for (int k = 0; k < 4000; ++k) {
        const double angle = 1.5 * any(random), friction = std::pow(10.0, 2 + any(random) * 2);
        const double c = std::cos(angle), s = std::sin(angle), inverse_inertia = 3;
        Eigen::Matrix2d w;
        w << 1 + inverse_inertia * c * c, inverse_inertia * c * s, inverse_inertia * c * s,
            1 + inverse_inertia * s * s;
        const Eigen::Vector2d q(any(random), any(random));
        // The consistent states, by their signs.
        std::vector<Eigen::Vector2d> states;
        if (q[0] >= 0) states.emplace_back(0, 0);
        const Eigen::Vector2d sticks = -w.inverse() * q;
        if (std::abs(sticks[1]) <= friction * sticks[0]) states.push_back(sticks);
        for (const double sign : {1.0, -1.0}) {
            const double normal = -q[0] / (w(0, 0) - sign * friction * w(0, 1));
            const Eigen::Vector2d slips(normal, -sign * friction * normal);
            if (normal > 0 && sign * (q[1] + w.row(1).dot(slips)) > 0) states.push_back(slips);
        }
        if (states.size() != 1) continue;
        ++unique;
        const std::vector<double> coefficient = {friction};
        Eigen::VectorXd p = Eigen::VectorXd::Zero(2);
        const ContactReport report = solver.solve(w, q, coefficient, 2, p);
        ASSERT_TRUE(report.converged) << angle << ' ' << friction << ' ' << q.transpose();
        EXPECT_LE((p - states[0]).norm(), 1e-8 * (1 + states[0].norm()))
            << angle << ' ' << friction;
    }
    EXPECT_GT(unique, 2000);
}

TEST(ContactSolver, WithoutFrictionItIsALinearComplementarityProblem)
{
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    ContactSolver solver;
    for (int trial = 0; trial < 200; ++trial) {
        LinearInequality<3> cases;
        const Eigen::Matrix3d a = Eigen::Matrix3d::NullaryExpr([&] { return normal(random); });
        cases.w = a * a.transpose() + 0.01 * Eigen::Matrix3d::Identity();
        cases.y0 = Eigen::Vector3d::NullaryExpr([&] { return normal(random); });
        cases.lower.setZero();
        cases.upper.setConstant(std::numeric_limits<double>::infinity());
        LinearInequality<3>::Branches branches;
        branches.setConstant(Branch::inside);
        Eigen::Vector3d expected, u;
        ASSERT_TRUE(cases.solve(expected, u, branches));
        // The same with an irrelevant tangent.
        Eigen::MatrixXd w = Eigen::MatrixXd::Identity(6, 6);
        Eigen::VectorXd q = Eigen::VectorXd::Ones(6);
        for (int i = 0; i < 3; ++i) {
            q[2 * i] = cases.y0[i];
            for (int j = 0; j < 3; ++j) w(2 * i, 2 * j) = cases.w(i, j);
        }
        Eigen::VectorXd p = Eigen::VectorXd::Zero(6);
        const std::array friction = {0.0, 0.0, 0.0};
        ASSERT_TRUE(solver.solve(w, q, friction, 2, p).converged);
        for (int i = 0; i < 3; ++i) {
            EXPECT_NEAR(p[2 * i], expected[i], 1e-7 * (1 + expected.norm()));
            EXPECT_EQ(p[2 * i + 1], 0);
        }
    }
}

TEST(ContactSolver, RedundantContactsShareAForceThatIsRight)
{
    // Four feet under one weight: the sum is determined, the parts are not.
    Eigen::MatrixXd h(8, 2);
    for (int i = 0; i < 4; ++i) h.row(2 * i) << 1, 0, h.row(2 * i + 1) << 0, 1;
    const Eigen::MatrixXd w = h * h.transpose();
    const Eigen::VectorXd q = h * Eigen::Vector2d(-3, 0.5);
    Eigen::VectorXd p = Eigen::VectorXd::Zero(8);
    const std::array friction = {0.4, 0.4, 0.4, 0.4};
    ContactSolver solver;
    ASSERT_TRUE(solver.solve(w, q, friction, 2, p).converged);
    const Eigen::Vector2d sum = h.transpose() * p;
    EXPECT_NEAR(sum[0], 3, 1e-9);
    EXPECT_NEAR(sum[1], -0.5, 1e-9);
}

// Residuals of the law itself, written explicitly.
void expect_law_holds(const RandomContacts& problem, const Eigen::VectorXd& p, double tolerance)
{
    const Eigen::VectorXd u = problem.w * p + problem.q;
    const int n = problem.components;
    for (std::size_t c = 0; c < problem.friction.size(); ++c) {
        const auto i = static_cast<Eigen::Index>(c) * n;
        const double inverse_mass = problem.w.diagonal().segment(i, n).mean();
        // Impulse and velocity in units of one over the root of the mass.
        const double unit = std::sqrt(inverse_mass);
        EXPECT_GE(p[i] * unit, -tolerance);
        EXPECT_GE(u[i] / unit, -tolerance);
        EXPECT_LE(std::min(p[i] * unit, u[i] / unit), tolerance);
        const double sliding = u.segment(i + 1, n - 1).norm() / unit;
        const double friction = p.segment(i + 1, n - 1).norm() * unit;
        const double bound = problem.friction[c] * std::max(0.0, p[i]) * unit;
        EXPECT_LE(friction, bound + 3 * tolerance);
        if (sliding > 100 * tolerance) {
            // Friction opposes the sliding and is at the bound: p_t.u_t = -|p_t| |u_t|, to first
            // order.
            const double power = p.segment(i + 1, n - 1).dot(u.segment(i + 1, n - 1));
            EXPECT_NEAR(power, -bound * sliding, 20 * tolerance * (sliding + bound + tolerance));
        }
    }
}

TEST(ContactSolver, RandomProblemsAreSolvedOrReported)
{
    RandomContacts problem(1);
    ContactSolver solver;
    int converged = 0;
    const int problems = 300;
    for (int k = 0; k < problems; ++k) {
        problem.draw(12);
        Eigen::VectorXd p = Eigen::VectorXd::Zero(problem.q.size());
        const ContactReport report =
            solver.solve(problem.w, problem.q, problem.friction, problem.components, p);
        EXPECT_EQ(report.converged, report.residual <= 1e-10);
        EXPECT_LE(report.sweeps, 4000);
        if (!report.converged) continue;
        ++converged;
        double size = 0;
        for (Eigen::Index i = 0; i < p.size(); ++i) {
            const auto c = i / problem.components * problem.components;
            const double unit =
                std::sqrt(problem.w.diagonal().segment(c, problem.components).mean());
            size = std::max(size, std::abs(problem.q[i]) / unit);
        }
        expect_law_holds(problem, p, 1.1e-10 * size);
    }
    // Sliding with much friction may have no solution, or none that is found.
    EXPECT_GE(converged, problems * 95 / 100);
}

// A unit mass in a corner: a floor and a wall, each the other's tangent. Where both
// stop the approach, p = 2 / (1 - friction) in each, which diverges towards friction 1.
TEST(ContactSolver, ReboundsThatContradictFrictionALittleAreSolved)
{
    // A point in the corner of a floor and a wall, held there by its weight and a push. Restitution
    // at each surface demands a rebound that friction at the other one prevents. Such velocities
    // decay from event to event, so all magnitudes occur; the impulses that they select differ by
    // as much as friction allows.
    Eigen::Matrix<double, 4, 2> h;
    h << 0, 1, 1, 0, -1, 0, 0, 1;
    const Eigen::MatrixXd w = h * h.transpose();
    const std::array friction = {0.1, 0.3};
    const double restitution = 0.4;
    for (const double step : {1e-3, 1e-4, 1e-6}) {
        for (double speed = 1e-2; speed > 1e-19; speed /= 3) {
            for (const Eigen::Vector2d& v :
                 {Eigen::Vector2d(speed, 0), Eigen::Vector2d(0, -speed),
                  Eigen::Vector2d(speed, -speed), Eigen::Vector2d(speed, -1e-3 * speed)}) {
                Eigen::VectorXd q = h * (v + step * Eigen::Vector2d(2, -9.81));
                q[0] += restitution * v[1];
                q[2] -= restitution * v[0];
                Eigen::VectorXd p = Eigen::VectorXd::Zero(4);
                ContactSolver solver;
                const ContactReport report = solver.solve(w, q, friction, 2, p);
                ASSERT_TRUE(report.converged) << step << ' ' << v.transpose();
                ASSERT_LE(std::abs(p[1]), friction[0] * p[0] * (1 + 1e-6));
                ASSERT_LE(std::abs(p[3]), friction[1] * p[2] * (1 + 1e-6) + 1e-12);
            }
        }
    }
}

TEST(ContactSolver, ACornerWithoutASolutionIsReported)
{
    Eigen::Matrix<double, 4, 2> h;
    h << 0, 1, 1, 0, 1, 0, 0, 1;
    const Eigen::MatrixXd w = h * h.transpose();
    Eigen::VectorXd q = h * Eigen::Vector2d(-1, -1);
    q[0] *= 2, q[2] *= 2;  // restitution 1
    ContactSolver solver;
    for (const double friction : {0.0, 0.5, 0.9, 0.99}) {
        const std::array both = {friction, friction};
        Eigen::VectorXd p = Eigen::VectorXd::Zero(4);
        ASSERT_TRUE(solver.solve(w, q, both, 2, p).converged) << friction;
        // A defect of 2e-10 of velocity, divided by 1 - friction.
        EXPECT_NEAR(p[0], 2 / (1 - friction), 4e-10 / (1 - friction)) << friction;
    }
    for (const double friction : {1.0, 2.0}) {
        const std::array both = {friction, friction};
        // From rest, and from a start where every defect of velocity is small compared with the
        // impulse.
        for (const double start : {0.0, 5e12, 1e300}) {
            Eigen::VectorXd p = Eigen::VectorXd::Constant(4, start);
            const ContactReport report = solver.solve(w, q, both, 2, p);
            EXPECT_FALSE(report.converged) << friction;
            EXPECT_GT(report.residual, 1e-3) << friction;
        }
    }
}

TEST(ContactSolver, RegularContactsAreSolvedToRounding)
{
    // The corner without friction: each velocity is exchanged, p = (2, 0, 2, 0).
    Eigen::Matrix<double, 4, 2> h;
    h << 0, 1, 1, 0, 1, 0, 0, 1;
    Eigen::VectorXd q = h * Eigen::Vector2d(-1, -1);
    q[0] *= 2, q[2] *= 2;
    const std::array none = {0.0, 0.0};
    Eigen::VectorXd p = Eigen::VectorXd::Zero(4);
    ContactSolver solver;
    ASSERT_TRUE(solver.solve(h * h.transpose(), q, none, 2, p).converged);
    EXPECT_LT((p - Eigen::Vector4d(2, 0, 2, 0)).lpNorm<Eigen::Infinity>(), 2e-15);
}

TEST(ContactSolver, OneContactIsClosedToRounding)
{
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    ContactSolver solver;
    int sticking = 0;
    int sliding = 0;
    for (int trial = 0; trial < 500; ++trial) {
        const Eigen::Matrix2d a = Eigen::Matrix2d::NullaryExpr([&] { return normal(random); });
        const Eigen::MatrixXd w = a * a.transpose() + Eigen::Matrix2d::Identity();
        const Eigen::VectorXd q = Eigen::Vector2d(-std::abs(normal(random)), normal(random));
        // Unique as long as friction |W_nt| < W_nn.
        const std::array friction = {0.9 * std::min(1.0, w(0, 0) / std::abs(w(0, 1)))};
        Eigen::VectorXd p = Eigen::VectorXd::Zero(2);
        const ContactReport report = solver.solve(w, q, friction, 2, p);
        ASSERT_TRUE(report.converged);
        EXPECT_EQ(report.iterations, 0);
        const Eigen::VectorXd u = w * p + q;
        // Each product rounds once: a few units of the largest term.
        const double rounding = 8e-16 * (w.norm() * p.norm() + q.norm());
        const bool sticks = std::abs(p[1]) < friction[0] * p[0] * (1 - 1e-12);
        EXPECT_NEAR(u[0], 0, sticks ? rounding * w.norm() : rounding);
        EXPECT_LE(std::abs(p[1]), friction[0] * p[0] * (1 + 1e-15));
        if (sticks) {
            EXPECT_NEAR(u[1], 0, rounding * w.norm());
        } else {
            EXPECT_LE(p[1] * u[1], rounding);
        }
        ++(sticks ? sticking : sliding);
    }
    EXPECT_GT(sticking, 50);
    EXPECT_GT(sliding, 50);
}

TEST(ContactSolver, AStartAtTheSolutionTakesNoIteration)
{
    RandomContacts problem(2);
    ContactSolver solver;
    for (int k = 0; k < 20; ++k) {
        problem.draw(6);
        Eigen::VectorXd p = Eigen::VectorXd::Zero(problem.q.size());
        if (!solver.solve(problem.w, problem.q, problem.friction, problem.components, p).converged)
            continue;
        const Eigen::VectorXd solution = p;
        const auto again =
            solver.solve(problem.w, problem.q, problem.friction, problem.components, p);
        EXPECT_LE(again.iterations, 1);
        EXPECT_LE((p - solution).norm(), 1e-8 * solution.norm());
    }
}

TEST(ContactSolver, WrongInputIsRefused)
{
    ContactSolver solver;
    Eigen::MatrixXd w = Eigen::MatrixXd::Identity(2, 2);
    Eigen::VectorXd q = Eigen::VectorXd::Zero(2);
    Eigen::VectorXd p = q;
    const std::array negative = {-0.1};
    const std::array fine = {0.1};
    const std::array infinite = {std::numeric_limits<double>::infinity()};
    EXPECT_THROW(solver.solve(w, q, infinite, 2, p), std::invalid_argument);
    EXPECT_THROW(solver.solve(w, q, negative, 2, p), std::invalid_argument);
    EXPECT_THROW(solver.solve(w, q, fine, 3, p), std::invalid_argument);
    EXPECT_THROW(solver.solve(w, q, fine, 4, p), std::invalid_argument);
    q[0] = std::nan("");
    EXPECT_THROW(solver.solve(w, q, fine, 2, p), std::invalid_argument);
}

}  // namespace
}  // namespace ricochet::contacts_test
