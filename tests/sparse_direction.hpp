// Newton directions from a sparse matrix.
#pragma once

#include <Eigen/SparseLU>

namespace ricochet {

/// d = -V^-1 F for `semismooth_newton`; false where V cannot be factored.
template <class Vector>
[[nodiscard]] bool sparse_direction(const Eigen::SparseMatrix<double>& v,
                                    Eigen::SparseLU<Eigen::SparseMatrix<double>>& lu,
                                    const Vector& f, Vector& d)
{
    lu.compute(v);
    if (lu.info() != Eigen::Success) return false;
    d = -lu.solve(f);
    return lu.info() == Eigen::Success;
}

}  // namespace ricochet
