// Newton's method for equations that are only piecewise smooth.
//
// The problem provides its own linear algebra: `residual(x, F)` writes F(x), and
// `direction(x, F, d)` solves V d = -F for an element V of the generalised Jacobian at
// x, dense, sparse or by products alone, and returns false if it cannot. `dense_direction`
// does so from a matrix, as does `sparse_direction` in a header of its own.
//
// (L. Qi and J. Sun, A nonsmooth version of Newton's method, Mathematical Programming 58,
// 1993.)
#pragma once

#include <Eigen/Dense>

#include <cmath>
#include <concepts>

#include "ricochet/nonsmooth/detail/ordered_products.hpp"

namespace ricochet {

template <class Problem, class Vector>
concept NewtonProblem = requires(Problem& problem, const Vector& x, Vector& out)
{
    problem.residual(x, out);
    {
        problem.direction(x, out, out)
        } -> std::convertible_to<bool>;
};

/// Tolerance and limits of the method.
struct NewtonOptions {
    double tolerance = 1e-12;  ///< of the largest component of F
    int max_iterations = 50;
    bool line_search = true;  ///< Armijo's rule on |F|^2 / 2, halving
    int max_halvings = 25;
};

/// How an iteration ended.
struct NewtonReport {
    bool converged = false;
    double residual = 0;  ///< the largest component of F at the end
    int iterations = 0;
};

/// Memory of the method, to be kept by callers that must not allocate.
template <class Vector>
struct NewtonScratch {
    Vector f, direction, trial, f_trial;
};

/// Improves x until F(x) vanishes. A direction that does not exist, a value that is not
/// finite, or a search that finds no decrease ends it without convergence; x is then the
/// best point that was reached.
template <class Vector, NewtonProblem<Vector> Problem>
[[nodiscard]] NewtonReport semismooth_newton(Problem& problem, Vector& x,
                                             const NewtonOptions& options,
                                             NewtonScratch<Vector>& scratch)
{
    auto& [f, direction, trial, f_trial] = scratch;
    f.resize(x.size());
    direction.resize(x.size());
    f_trial.resize(x.size());
    NewtonReport report;
    problem.residual(x, f);
    for (;; ++report.iterations) {
        report.residual = f.template lpNorm<Eigen::Infinity>();
        report.converged = report.residual <= options.tolerance;
        if (report.converged || !std::isfinite(report.residual) ||
            report.iterations == options.max_iterations || !problem.direction(x, f, direction) ||
            !direction.allFinite()) {
            return report;
        }
        // Armijo's constant 1e-4; along a Newton direction |F|^2 / 2 has the slope -|F|^2.
        const double merit = detail::squared_norm(f);
        double share = 1;
        for (int halving = 0;; ++halving, share /= 2) {
            trial = x + share * direction;
            problem.residual(trial, f_trial);
            if (detail::squared_norm(f_trial) <= (1 - 2e-4 * share) * merit) break;
            if (!options.line_search && f_trial.allFinite()) break;
            if (halving == options.max_halvings) return report;
        }
        x.swap(trial);
        f.swap(f_trial);
    }
}

template <class Vector, NewtonProblem<Vector> Problem>
[[nodiscard]] NewtonReport semismooth_newton(Problem& problem, Vector& x,
                                             const NewtonOptions& options = {})
{
    NewtonScratch<Vector> scratch;
    return semismooth_newton(problem, x, options, scratch);
}

/// d = -V^-1 F; false where V is singular to working precision.
template <class Matrix, class Vector>
[[nodiscard]] bool dense_direction(const Matrix& v, Eigen::PartialPivLU<Matrix>& lu,
                                   const Vector& f, Vector& d)
{
    lu.compute(v);
    d = -detail::solve_by(lu, f);
    return d.allFinite();
}

}  // namespace ricochet
