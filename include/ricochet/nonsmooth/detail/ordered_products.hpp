// Internal: the declarations of this header may change without notice.
//
// Products of small matrices, and norms, whose terms are added in order.
//
// Eigen adds the terms of a row in an order that depends on its length. Here they are added from
// the first to the last, so that zeros behind the last component of a system change no bit: an
// inclusion has the same motion in every compiled size that holds it (inclusion_sizes.hpp).
#pragma once

#include <Eigen/Dense>

#include <cmath>

namespace ricochet::detail {

template <class... Matrices>
inline constexpr bool have_fixed_sizes = ((Matrices::SizeAtCompileTime != Eigen::Dynamic) && ...);

/// a b; an expression of Eigen's where a size is known only at run time.
template <class A, class B>
[[nodiscard]] auto times(const A& a, const B& b)
{
    if constexpr (have_fixed_sizes<A, B>) {
        constexpr int rows = A::RowsAtCompileTime;
        constexpr int columns = B::ColsAtCompileTime;
        constexpr int order = rows == 1 && columns != 1 ? Eigen::RowMajor : Eigen::ColMajor;
        Eigen::Matrix<double, rows, columns, order> out;
        for (Eigen::Index j = 0; j < columns; ++j) {
            out.col(j) = a.col(0) * b.coeff(0, j);
            for (Eigen::Index k = 1; k < A::ColsAtCompileTime; ++k) {
                out.col(j) += a.col(k) * b.coeff(k, j);
            }
        }
        return out;
    } else {
        return a * b;
    }
}

template <class V>
[[nodiscard]] double squared_norm(const V& v)
{
    if constexpr (have_fixed_sizes<V>) {
        double sum = 0;
        for (Eigen::Index j = 0; j < V::ColsAtCompileTime; ++j) {
            for (Eigen::Index i = 0; i < V::RowsAtCompileTime; ++i) {
                sum += v.coeff(i, j) * v.coeff(i, j);
            }
        }
        return sum;
    } else {
        return v.squaredNorm();
    }
}

template <class V>
[[nodiscard]] double norm(const V& v)
{
    return std::sqrt(squared_norm(v));
}

/// Norm of `count` components of v from `first` on.
template <class V>
[[nodiscard]] double norm_of_segment(const V& v, Eigen::Index first, Eigen::Index count)
{
    if constexpr (have_fixed_sizes<V>) {
        double sum = 0;
        for (Eigen::Index i = first; i < first + count; ++i) sum += v[i] * v[i];
        return std::sqrt(sum);
    } else {
        return v.segment(first, count).norm();
    }
}

/// The solution of a linear system by its factors.
template <class Square, class Right>
[[nodiscard]] auto solve_by(const Eigen::PartialPivLU<Square>& lu, const Right& right)
{
    if constexpr (have_fixed_sizes<Square, Right>) {
        const Square& factors = lu.matrixLU();
        typename Right::PlainObject x = lu.permutationP() * right;
        constexpr Eigen::Index n = Square::RowsAtCompileTime;
        for (Eigen::Index j = 0; j < Right::ColsAtCompileTime; ++j) {
            for (Eigen::Index k = 0; k < n; ++k) {
                for (Eigen::Index i = k + 1; i < n; ++i) x(i, j) -= factors(i, k) * x(k, j);
            }
            for (Eigen::Index k = n; k-- > 0;) {
                x(k, j) /= factors(k, k);
                for (Eigen::Index i = 0; i < k; ++i) x(i, j) -= factors(i, k) * x(k, j);
            }
        }
        return x;
    } else {
        return lu.solve(right);
    }
}

}  // namespace ricochet::detail
