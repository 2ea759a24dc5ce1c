// Linear variational inequalities of a few unknowns.

#include "ricochet/detail/linear_cases.hpp"

#include <gtest/gtest.h>

#include <random>

namespace ricochet {
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
            // The natural map of the law, of the confined variable.
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

}  // namespace
}  // namespace ricochet
