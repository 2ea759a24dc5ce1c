// Newton's method for equations that are piecewise smooth.

#include "ricochet/nonsmooth/semismooth_newton.hpp"

#include <gtest/gtest.h>

#include <Eigen/Sparse>

#include <random>

#include "sparse_direction.hpp"

namespace ricochet::semismooth_newton_test {
namespace {

// y + c y^3 = 0 in every component.
struct Cubic {
    double c = 0.1;
    void residual(const Eigen::VectorXd& x, Eigen::VectorXd& f) const
    {
        f = x.array() + c * x.array().cube();
    }
    [[nodiscard]] bool direction(const Eigen::VectorXd& x, const Eigen::VectorXd& f,
                                 Eigen::VectorXd& d) const
    {
        d = -(f.array() / (1 + 3 * c * x.array().square()));
        return true;
    }
};

TEST(SemismoothNewton, SolvesACubicWithAndWithoutLineSearch)
{
    for (const bool search : {true, false}) {
        Eigen::VectorXd x(2);
        x << 5, -3;
        Cubic cubic;
        const auto report = semismooth_newton(cubic, x, {.line_search = search});
        EXPECT_TRUE(report.converged);
        EXPECT_LT(x.norm(), 1e-12);
        EXPECT_LE(report.iterations, 10);
    }
}

// max(x, 2 x) - 1 and |x| type kinks: M x + min(x, 0) = b with random positive M.
struct Kinked {
    Eigen::MatrixXd m;
    Eigen::VectorXd b;
    void residual(const Eigen::VectorXd& x, Eigen::VectorXd& f) const
    {
        f = m * x + x.cwiseMin(0.0) - b;
    }
    [[nodiscard]] bool direction(const Eigen::VectorXd& x, const Eigen::VectorXd& f,
                                 Eigen::VectorXd& d) const
    {
        Eigen::MatrixXd v = m;
        v.diagonal() += (x.array() < 0).select(Eigen::VectorXd::Ones(x.size()), 0.0);
        Eigen::PartialPivLU<Eigen::MatrixXd> lu;
        return dense_direction(v, lu, f, d);
    }
};

TEST(SemismoothNewton, EndsInAFewIterationsOnPiecewiseLinearEquations)
{
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    for (int trial = 0; trial < 50; ++trial) {
        const Eigen::MatrixXd a =
            Eigen::MatrixXd::NullaryExpr(8, 8, [&] { return normal(random); });
        Kinked problem{a * a.transpose() + Eigen::MatrixXd::Identity(8, 8),
                       Eigen::VectorXd::NullaryExpr(8, [&] { return 10 * normal(random); })};
        Eigen::VectorXd x = Eigen::VectorXd::Zero(8);
        const auto report = semismooth_newton(problem, x, {.tolerance = 1e-10});
        EXPECT_TRUE(report.converged);
        EXPECT_LE(report.iterations, 12);
    }
}

// x + e^x - 2 + neighbours, sparse and by products alone.
struct Chain {
    Eigen::Index n;
    bool matrix_free;
    Eigen::SparseLU<Eigen::SparseMatrix<double>> lu{};

    void residual(const Eigen::VectorXd& x, Eigen::VectorXd& f) const
    {
        f = 2.5 * x + 0.1 * x.cwiseMax(0.0);
        f.head(n - 1) -= x.tail(n - 1);
        f.tail(n - 1) -= x.head(n - 1);
        f.array() -= 1;
    }
    [[nodiscard]] Eigen::VectorXd product(const Eigen::VectorXd& x, const Eigen::VectorXd& d) const
    {
        Eigen::VectorXd p = 2.5 * d;
        p.array() += (x.array() > 0).select(0.1 * d.array(), 0.0);
        p.head(n - 1) -= d.tail(n - 1);
        p.tail(n - 1) -= d.head(n - 1);
        return p;
    }
    [[nodiscard]] bool direction(const Eigen::VectorXd& x, const Eigen::VectorXd& f,
                                 Eigen::VectorXd& d)
    {
        if (!matrix_free) {
            Eigen::SparseMatrix<double> v(n, n);
            std::vector<Eigen::Triplet<double>> entries;
            for (Eigen::Index i = 0; i < n; ++i) {
                entries.emplace_back(i, i, 2.5 + (x[i] > 0 ? 0.1 : 0.0));
                if (i > 0)
                    entries.emplace_back(i, i - 1, -1.0), entries.emplace_back(i - 1, i, -1.0);
            }
            v.setFromTriplets(entries.begin(), entries.end());
            return sparse_direction(v, lu, f, d);
        }
        // Conjugate gradients: the matrix is symmetric and positive definite.
        d.setZero(n);
        Eigen::VectorXd r = -f;
        Eigen::VectorXd p = r;
        for (int i = 0; i < 500 && r.norm() > 1e-13 * f.norm(); ++i) {
            const Eigen::VectorXd vp = product(x, p);
            const double alpha = r.squaredNorm() / p.dot(vp);
            d += alpha * p;
            const double before = r.squaredNorm();
            r -= alpha * vp;
            p = r + (r.squaredNorm() / before) * p;
        }
        return true;
    }
};

TEST(SemismoothNewton, TakesSparseAndMatrixFreeDirections)
{
    Eigen::VectorXd solutions[2];
    for (const bool matrix_free : {false, true}) {
        Chain chain{.n = 300, .matrix_free = matrix_free};
        Eigen::VectorXd& x = solutions[matrix_free];
        x = Eigen::VectorXd::Constant(300, -1);
        const auto report = semismooth_newton(chain, x);
        EXPECT_TRUE(report.converged);
        EXPECT_LE(report.iterations, 4);
    }
    EXPECT_LT((solutions[0] - solutions[1]).norm(), 1e-10);
}

struct Rootless {
    static void residual(const Eigen::VectorXd& x, Eigen::VectorXd& f)
    {
        f = x.array().square() + 1;
    }
    static bool direction(const Eigen::VectorXd& x, const Eigen::VectorXd& f, Eigen::VectorXd& d)
    {
        d = -f.array() / (2 * x.array());
        return true;
    }
};

TEST(SemismoothNewton, ReportsWhatHasNoSolution)
{
    Eigen::VectorXd x = Eigen::VectorXd::Constant(1, 0.7);
    Rootless rootless;
    const auto report = semismooth_newton(rootless, x);
    EXPECT_FALSE(report.converged);
    EXPECT_GE(report.residual, 1);
    EXPECT_LE(report.iterations, 50);
}

}  // namespace
}  // namespace ricochet::semismooth_newton_test
