// Linear variational inequalities of a few unknowns.

#include "ricochet/nonsmooth/linear_cases.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "ricochet/nonsmooth/detail/any_inclusion.hpp"

namespace ricochet::linear_cases_test {
namespace {

template <int M>
void check_random_inequalities(Confines confines)
{
    std::mt19937 random(M);
    std::normal_distribution<double> normal;
    using Problem = LinearInequality<M>;
    for (int trial = 0; trial < 2000; ++trial) {
        Problem p;
        p.confines = confines;
        const typename Problem::Matrix a =
            Problem::Matrix::NullaryExpr([&] { return normal(random); });
        p.w = a * a.transpose() + 0.1 * Problem::Matrix::Identity();
        p.y0 = Problem::Vector::NullaryExpr([&] { return 3 * normal(random); });
        p.lower = Problem::Vector::NullaryExpr([&] { return -std::abs(normal(random)); });
        p.upper = Problem::Vector::NullaryExpr([&] { return std::abs(normal(random)); });
        typename Problem::Branches branches;
        branches.setConstant(Branch::inside);
        typename Problem::Vector r, y;
        ASSERT_TRUE(p.solve(r, y, branches));
        EXPECT_LT((p.w * r + p.y0 - y).norm(), 1e-11 * (1 + p.y0.norm()) * (1 + p.w.norm()));
        for (int i = 0; i < M; ++i) {
            // The natural map of the law, for the restricted variable.
            const double confined = confines == Confines::reaction ? r[i] : y[i];
            const double other = confines == Confines::reaction ? y[i] : r[i];
            const double image = std::clamp(confined - other, p.lower[i], p.upper[i]);
            EXPECT_NEAR(image, confined, 1e-11 * (1 + p.y0.norm()));
        }
    }
}

TEST(LinearInequality, CasesSolveRandomOnes)
{
    for (const Confines confines : {Confines::reaction, Confines::state}) {
        check_random_inequalities<1>(confines);
        check_random_inequalities<2>(confines);
        check_random_inequalities<3>(confines);
        check_random_inequalities<4>(confines);
    }
}

TEST(LinearInequality, ReactionsThatDependOnOneAnotherUpToRoundingAreNotHeldByHugeOnes)
{
    // Two stops on both sides of a direction of three components, both open: no reaction acts. To
    // rounding W is regular, and huge reactions that cancel would hold both.
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(0.3, 2);
    for (int trial = 0; trial < 2000; ++trial) {
        const Eigen::Vector3d along(uniform(random), -uniform(random), uniform(random));
        const double one = uniform(random), other = -uniform(random);
        Eigen::Matrix<double, 2, 3> e;
        e << one * along.transpose(), other * along.transpose();
        LinearInequality<2> p;
        p.w = uniform(random) * e * e.transpose();
        p.y0 << uniform(random), uniform(random);
        p.lower.setZero();
        p.upper.setConstant(std::numeric_limits<double>::infinity());
        LinearInequality<2>::Branches branches;
        branches.setConstant(Branch::inside);
        Eigen::Vector2d r, y;
        ASSERT_TRUE(p.solve(r, y, branches));
        EXPECT_EQ(r, Eigen::Vector2d(0, 0));
        EXPECT_EQ(y, p.y0);
    }
}

TEST(LinearInequality, PivotsSettleWhereDependentRowsDifferInSizeByManyOrders)
{
    // More unilateral contacts than directions, whose rows are in units from 1/1000 to 1000: where
    // the steps had not settled, y was wrong by up to the size of its terms.
    constexpr double infinity = std::numeric_limits<double>::infinity();
    std::uniform_real_distribution<double> uniform(-1, 1);
    int unsolved = 0;
    for (unsigned seed = 0; seed < 4000; ++seed) {
        SCOPED_TRACE(seed);
        std::mt19937 random(seed);
        const Eigen::Index m = 5 + seed % 8, n = 2 + seed % 5;
        Eigen::MatrixXd e =
            Eigen::MatrixXd::NullaryExpr(m, n, [&](auto, auto) { return uniform(random); });
        for (Eigen::Index i = 0; i < m; ++i) {
            if (i > 0 && i % 3 == 0) e.row(i) = -2 * e.row(i - 1);
            e.row(i) *= std::pow(10, 3 * uniform(random));
        }
        const Eigen::VectorXd along = Eigen::VectorXd::NullaryExpr(
            n, [&](auto) { return std::pow(10, 2 * uniform(random)) * uniform(random); });
        LinearInequality<Eigen::Dynamic> p;
        p.w = e * e.transpose();
        p.y0 = e * along;
        p.lower = Eigen::VectorXd::Zero(m);
        p.upper = Eigen::VectorXd::Constant(m, infinity);
        Eigen::VectorXd r = p.lower, y = p.lower;
        LinearInequality<Eigen::Dynamic>::Branches branches;
        branches.setConstant(m, Branch::inside);
        if (!p.solve(r, y, branches)) {
            ++unsolved;
            continue;
        }
        for (Eigen::Index i = 0; i < m; ++i) {
            const double terms = std::abs(p.y0[i]) + p.w.row(i).cwiseAbs().dot(r.cwiseAbs());
            const double there = p.y0[i] + p.w.row(i).dot(r);
            EXPECT_GE(r[i] * p.w(i, i), -1e-9 * terms);
            EXPECT_GE(there, -1e-9 * terms);
            if (r[i] * p.w(i, i) > 1e-9 * terms) {
                EXPECT_LE(there, 1e-9 * terms);
            }
        }
    }
    EXPECT_LT(unsolved, 400);
}

TEST(Invert, GivesDiagonalMatricesTheBitsOfElimination)
{
    const Eigen::MatrixXd a = Eigen::Vector4d(1.0 / 9, 1, 1.0 / 7, 1e6).asDiagonal();
    Eigen::MatrixXd inverse;
    EXPECT_EQ(detail::invert(a, inverse), 4);
    EXPECT_EQ(inverse, Eigen::MatrixXd(a.fullPivLu().inverse()));
}

TEST(Invert, FindsTheRankOfDiagonalMatricesAsOfOthers)
{
    Eigen::MatrixXd inverse;
    const Eigen::MatrixXd singular = Eigen::Vector3d(2, 0, 1).asDiagonal();
    EXPECT_EQ(detail::invert(singular, inverse), 2);
    const Eigen::MatrixXd negative = Eigen::Vector3d(2, -4, 1).asDiagonal();
    EXPECT_EQ(detail::invert(negative, inverse), 3);
    EXPECT_EQ(inverse, Eigen::MatrixXd(Eigen::Vector3d(0.5, -0.25, 1).asDiagonal()));
}

}  // namespace
}  // namespace ricochet::linear_cases_test
