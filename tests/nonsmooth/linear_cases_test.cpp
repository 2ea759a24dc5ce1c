// Linear variational inequalities of a few unknowns.

#include "ricochet/detail/linear_cases.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <limits>
#include <random>

#include "ricochet/detail/any_inclusion.hpp"

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
