// Nonlinear least squares.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <functional>

namespace ricochet::learn {

/// A sum of squares: returns |r(p)|^2 and, where they are requested, J^T J and J^T r.
using SumOfSquares = std::function<double(const Eigen::VectorXd& p, Eigen::MatrixXd* normal,
                                          Eigen::VectorXd* gradient)>;

/// Limits and tolerances of `levenberg_marquardt`.
struct LevenbergMarquardtOptions {
    int iterations = 100;
    double seconds = 1e9;           ///< of processor time of this process
    double target = 0;              ///< stop at this sum of squares
    double step_tolerance = 1e-14;  ///< stop when no parameter moves by more, relative to its size
    double damping = 1e-2;          ///< at the start, relative to the diagonal of J^T J
    const std::atomic<bool>* cancelled = nullptr;  ///< true ends it after the sum in progress
};

/// How a minimisation ended.
struct LevenbergMarquardtReport {
    int iterations = 0;      ///< accepted steps
    int trials = 0;          ///< sums of squares evaluated
    double sum = 0;          ///< of squares, at the end
    bool converged = false;  ///< no parameter moves, or the target is met
};

/// Minimises the sum of squares from `p`, in place (J. J. More, The Levenberg-Marquardt
/// algorithm, Lecture Notes in Mathematics 630, 1978; the damping follows H. B. Nielsen,
/// Damping parameter in Marquardt's method, 1999).
LevenbergMarquardtReport levenberg_marquardt(const SumOfSquares& problem, Eigen::VectorXd& p,
                                             const LevenbergMarquardtOptions& options = {});

}  // namespace ricochet::learn
