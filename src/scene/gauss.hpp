// Impulses of contacts that act together, without friction.
#pragma once

#include <Eigen/Dense>

namespace ricochet::detail {

/// Solves p >= 0, W p + q >= 0, p (W p + q) = 0 with W positive semidefinite, by an active set that
/// grows and shrinks by one contact at a time (C. L. Lawson and R. J. Hanson, Solving Least Squares
/// Problems, 1974, chapter 23). A contact whose row depends on active ones stays out of the set,
/// since they move it. `p` is the start of the set. False where rounding stops it first.
[[nodiscard]] bool solve_together(const Eigen::MatrixXd& w, const Eigen::VectorXd& q,
                                  Eigen::VectorXd& p);

}  // namespace ricochet::detail
