// The arithmetic of training: products of small matrices, and operations on long vectors.
//
// Matrices are stored row by row, and every row fills whole cache lines; the elements beyond the
// last column are zero. Sums are taken in one fixed order, so that on one instruction set the
// bits never change; between instruction sets they do.
#pragma once

#include <cstddef>

#include "ricochet/nn/mlp.hpp"

namespace ricochet::learn {

/// Function of a sum before it is stored.
enum class After {
    nothing,
    relu,
    mask,  ///< it becomes zero where the mask is not positive
};

/// c = a b, with a of rows x inner and b of inner x columns.
template <class T>
struct Product {
    const T* a;
    std::size_t a_stride;
    const T* b;
    std::size_t b_stride;
    T* c;
    std::size_t c_stride;
    std::size_t rows;
    std::size_t inner;
    std::size_t columns;      ///< whole cache lines
    const T* bias = nullptr;  ///< added to every row of c; null: none
    const T* mask = nullptr;  ///< laid out as c
};

/// c = a^T b, with a of rows x left and b of rows x columns; sums = 1^T b.
template <class T>
struct OuterProduct {
    const T* a;
    std::size_t a_stride;
    const T* b;
    std::size_t b_stride;
    T* c;
    std::size_t c_stride;
    std::size_t rows;
    std::size_t left;
    std::size_t columns;  ///< whole cache lines
    T* sums = nullptr;    ///< null: none
};

/// One step of Adam (learn/adam.hpp) for n parameters, n whole cache lines. The gradient is
/// the sum of `parts`, one after the other `part_stride` apart. Then, if there is a target,
/// target += polyak (parameter - target).
template <class T>
struct AdamStep {
    T* parameters;
    const T* gradient;
    std::size_t parts;
    std::size_t part_stride;
    T* first;
    T* second;
    T* target;  ///< null: none
    std::size_t n;
    T beta1, beta2, epsilon;
    T rate;         ///< over 1 - beta1^k
    T root_second;  ///< 1 / sqrt(1 - beta2^k)
    T polyak;
};

/// The quantile Huber loss, with kappa = 1, of n quantiles against m targets (W. Dabney et al.,
/// "Distributional reinforcement learning with quantile regression", AAAI 2018,
/// equation 10):
///
///     L = scale sum_ij w_ij huber(d_ij),  d_ij = target_j - quantile_i,
///     w_ij = above_i for d_ij > 0, below_i for d_ij < 0
///
/// and its derivatives by the quantiles. n: whole cache lines.
template <class T>
struct QuantileHuber {
    const T* quantiles;
    const T* targets;
    const T* above;
    const T* below;
    T* slopes;
    std::size_t n;
    std::size_t m;
    T scale;
};

template <class T>
struct DenseKernels {
    void (*product)(const Product<T>&, After) noexcept = nullptr;  ///< null: not in this build
    void (*outer_product)(const OuterProduct<T>&) noexcept = nullptr;
    void (*adam)(const AdamStep<T>&) noexcept = nullptr;
    void (*quantile_slopes)(const QuantileHuber<T>&) noexcept = nullptr;
    double (*quantile_loss)(const QuantileHuber<T>&) noexcept = nullptr;  ///< the loss alone
};

struct DenseTable {
    DenseKernels<float> single;
    DenseKernels<double> double_;
};

extern const DenseTable dense_baseline;
extern const DenseTable dense_v3;
extern const DenseTable dense_v4;

/// The kernels of one instruction set, or of the best that the library and the processor support.
template <class T>
[[nodiscard]] const DenseKernels<T>& dense_kernels(
    InstructionSet set = best_instruction_set()) noexcept;

}  // namespace ricochet::learn
