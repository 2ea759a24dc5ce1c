// The kernels of dense.hpp for one instruction set.
//
// One file per instruction set includes this header. It is compiled with the flags of that set and
// defines RICOCHET_DENSE_NAMESPACE and RICOCHET_DENSE_REGISTER, the bytes of a register. No
// function of the standard library is called here: the linker might take an instance from another
// file.
#pragma once

#include <cstddef>

#include "dense.hpp"

namespace ricochet::learn::RICOCHET_DENSE_NAMESPACE {

inline constexpr std::size_t register_bytes = RICOCHET_DENSE_REGISTER;
inline constexpr std::size_t line_bytes = 64;
inline constexpr std::size_t per_line = line_bytes / register_bytes;  ///< registers

template <class T>
struct Simd {
    typedef T Vector __attribute__((vector_size(register_bytes), may_alias));
};
template <class T>
using Vector = typename Simd<T>::Vector;

template <class T>
inline constexpr std::size_t lanes = register_bytes / sizeof(T);
template <class T>
inline constexpr std::size_t line = line_bytes / sizeof(T);

#define RICOCHET_ALWAYS [[gnu::always_inline]] static inline

template <class T>
RICOCHET_ALWAYS Vector<T> load(const T* from) noexcept
{
    return *reinterpret_cast<const Vector<T>*>(from);
}

template <class T>
RICOCHET_ALWAYS void store(T* to, Vector<T> value) noexcept
{
    *reinterpret_cast<Vector<T>*>(to) = value;
}

template <class T>
RICOCHET_ALWAYS Vector<T> all(T value) noexcept
{
    return value - Vector<T>{};
}

// The constraint of an operand in a vector register.
#if defined(__AVX512VL__)
#define RICOCHET_DENSE_OPERAND "+v"
#elif defined(__SSE2__)
#define RICOCHET_DENSE_OPERAND "+x"
#elif defined(__aarch64__)
#define RICOCHET_DENSE_OPERAND "+w"
#else
#define RICOCHET_DENSE_OPERAND "+m"
#endif

/// A zero that is opaque to the compiler: for a known zero g++ makes a comparison and a mask
/// where one instruction suffices.
template <class T>
RICOCHET_ALWAYS Vector<T> unknown_zero() noexcept
{
    Vector<T> zero{};
    asm("" : RICOCHET_DENSE_OPERAND(zero));
    return zero;
}

/// The larger or smaller of two; a NaN in b stays.
template <class V>
RICOCHET_ALWAYS V larger(V a, V b) noexcept
{
    return a > b ? a : b;
}

template <class V>
RICOCHET_ALWAYS V smaller(V a, V b) noexcept
{
    return a < b ? a : b;
}

template <class T>
RICOCHET_ALWAYS Vector<T> finish(Vector<T> sum, After after, const T* mask) noexcept
{
    const Vector<T> zero = unknown_zero<T>();
    if (after == After::relu) return zero > sum ? zero : sum;  // NaN stays
    if (after == After::mask) return load(mask) > zero ? sum : zero;
    return sum;
}

/// A block of `Rows` rows and one cache line of columns of a product.
template <class T, int Rows>
RICOCHET_ALWAYS void product_block(const Product<T>& p, After after, std::size_t row,
                                   std::size_t column) noexcept
{
    Vector<T> sum[Rows][per_line];
    const T* a = p.a + row * p.a_stride;
    const T* b = p.b + column;
#pragma GCC unroll 8
    for (std::size_t v = 0; v < per_line; ++v) {
        const Vector<T> start = p.bias ? load(p.bias + column + v * lanes<T>) : Vector<T>{};
#pragma GCC unroll 8
        for (int r = 0; r < Rows; ++r) sum[r][v] = start;
    }
    for (std::size_t k = 0; k < p.inner; ++k, b += p.b_stride) {
        Vector<T> right[per_line];
#pragma GCC unroll 8
        for (std::size_t v = 0; v < per_line; ++v) right[v] = load(b + v * lanes<T>);
#pragma GCC unroll 8
        for (int r = 0; r < Rows; ++r) {
            const Vector<T> left = all(a[static_cast<std::size_t>(r) * p.a_stride + k]);
#pragma GCC unroll 8
            for (std::size_t v = 0; v < per_line; ++v) sum[r][v] += left * right[v];
        }
    }
#pragma GCC unroll 8
    for (int r = 0; r < Rows; ++r) {
        const std::size_t place = (row + static_cast<std::size_t>(r)) * p.c_stride + column;
#pragma GCC unroll 8
        for (std::size_t v = 0; v < per_line; ++v) {
            const std::size_t at = place + v * lanes<T>;
            store<T>(p.c + at, finish<T>(sum[r][v], after, p.mask + (p.mask ? at : 0)));
        }
    }
}

// As many rows as fill the registers and hide the latency of a sum.
inline constexpr int block_rows = register_bytes == 64 ? 8 : register_bytes == 32 ? 4 : 2;

template <class T>
void product(const Product<T>& p, After after) noexcept
{
    for (std::size_t column = 0; column < p.columns; column += line<T>) {
        std::size_t row = 0;
        for (; row + block_rows <= p.rows; row += block_rows) {
            product_block<T, block_rows>(p, after, row, column);
        }
        for (; row < p.rows; ++row) product_block<T, 1>(p, after, row, column);
    }
}

template <class T, int Rows>
RICOCHET_ALWAYS void outer_block(const OuterProduct<T>& p, std::size_t row,
                                 std::size_t column) noexcept
{
    Vector<T> sum[Rows][per_line] = {};
    const T* a = p.a + row;
    const T* b = p.b + column;
    for (std::size_t k = 0; k < p.rows; ++k, a += p.a_stride, b += p.b_stride) {
        Vector<T> right[per_line];
#pragma GCC unroll 8
        for (std::size_t v = 0; v < per_line; ++v) right[v] = load(b + v * lanes<T>);
#pragma GCC unroll 8
        for (int r = 0; r < Rows; ++r) {
            const Vector<T> left = all(a[r]);
#pragma GCC unroll 8
            for (std::size_t v = 0; v < per_line; ++v) sum[r][v] += left * right[v];
        }
    }
#pragma GCC unroll 8
    for (int r = 0; r < Rows; ++r) {
#pragma GCC unroll 8
        for (std::size_t v = 0; v < per_line; ++v) {
            store<T>(p.c + (row + static_cast<std::size_t>(r)) * p.c_stride + column + v * lanes<T>,
                     sum[r][v]);
        }
    }
}

template <class T>
void outer_product(const OuterProduct<T>& p) noexcept
{
    for (std::size_t column = 0; column < p.columns; column += line<T>) {
        std::size_t row = 0;
        for (; row + block_rows <= p.left; row += block_rows) {
            outer_block<T, block_rows>(p, row, column);
        }
        for (; row < p.left; ++row) outer_block<T, 1>(p, row, column);
    }
    if (!p.sums) return;
    for (std::size_t column = 0; column < p.columns; column += lanes<T>) {
        Vector<T> sum{};
        for (std::size_t k = 0; k < p.rows; ++k) sum += load(p.b + k * p.b_stride + column);
        store<T>(p.sums + column, sum);
    }
}

RICOCHET_ALWAYS float root(float x) noexcept
{
    return __builtin_sqrtf(x);
}
RICOCHET_ALWAYS double root(double x) noexcept
{
    return __builtin_sqrt(x);
}

template <class T>
RICOCHET_ALWAYS Vector<T> roots(Vector<T> x) noexcept
{
    Vector<T> y;
#pragma GCC unroll 16
    for (std::size_t i = 0; i < lanes<T>; ++i) y[i] = root(x[i]);
    return y;
}

template <class T>
void adam(const AdamStep<T>& s) noexcept
{
    const Vector<T> beta1 = all(s.beta1);
    const Vector<T> beta2 = all(s.beta2);
    const Vector<T> other1 = all(T(1) - s.beta1);
    const Vector<T> other2 = all(T(1) - s.beta2);
    for (std::size_t i = 0; i < s.n; i += lanes<T>) {
        Vector<T> gradient = load(s.gradient + i);
        for (std::size_t k = 1; k < s.parts; ++k)
            gradient += load(s.gradient + k * s.part_stride + i);
        const Vector<T> first = beta1 * load(s.first + i) + other1 * gradient;
        const Vector<T> second = beta2 * load(s.second + i) + other2 * gradient * gradient;
        store<T>(s.first + i, first);
        store<T>(s.second + i, second);
        const Vector<T> length = roots<T>(second) * all(s.root_second) + all(s.epsilon);
        const Vector<T> moved = load(s.parameters + i) - all(s.rate) * first / length;
        store<T>(s.parameters + i, moved);
        if (s.target) {
            const Vector<T> old = load(s.target + i);
            store<T>(s.target + i, old + all(s.polyak) * (moved - old));
        }
    }
}

/// Evaluates a few registers of quantiles against all targets: writes the slopes, or returns the
/// loss. With c = d clipped to [0, 1] or to [-1, 0], the slope is -w c and the loss
/// w c (d - c / 2).
template <class T, std::size_t Registers, bool Loss>
RICOCHET_ALWAYS Vector<T> quantile_block(const QuantileHuber<T>& q, std::size_t i) noexcept
{
    const Vector<T> zero = unknown_zero<T>();
    const Vector<T> one = all(T(1));
    const Vector<T> half = all(T(0.5));
    Vector<T> quantile[Registers], up[Registers], down[Registers], cost_up[Registers],
        cost_down[Registers];
#pragma GCC unroll 8
    for (std::size_t v = 0; v < Registers; ++v) {
        quantile[v] = load(q.quantiles + i + v * lanes<T>);
        up[v] = down[v] = cost_up[v] = cost_down[v] = zero;
    }
    for (std::size_t j = 0; j < q.m; ++j) {
        const Vector<T> target = all(q.targets[j]);
#pragma GCC unroll 8
        for (std::size_t v = 0; v < Registers; ++v) {
            const Vector<T> d = target - quantile[v];
            const Vector<T> above = smaller(one, larger(zero, d));
            const Vector<T> below = larger(-one, smaller(zero, d));
            up[v] += above;
            down[v] += below;
            if constexpr (Loss) {
                cost_up[v] += above * (d - half * above);
                cost_down[v] += below * (d - half * below);
            }
        }
    }
    Vector<T> cost{};
#pragma GCC unroll 8
    for (std::size_t v = 0; v < Registers; ++v) {
        const std::size_t at = i + v * lanes<T>;
        const Vector<T> above = load(q.above + at);
        const Vector<T> below = load(q.below + at);
        if constexpr (!Loss) {
            store<T>(q.slopes + at, -all(q.scale) * (above * up[v] + below * down[v]));
        }
        cost += above * cost_up[v] + below * cost_down[v];
    }
    return cost;
}

template <class T>
void quantile_slopes(const QuantileHuber<T>& q) noexcept
{
    for (std::size_t i = 0; i < q.n; i += line<T>) (void)quantile_block<T, per_line, false>(q, i);
}

template <class T>
double quantile_loss(const QuantileHuber<T>& q) noexcept
{
    double sum = 0;
    for (std::size_t i = 0; i < q.n; i += line<T>) {
        const Vector<T> cost = quantile_block<T, per_line, true>(q, i);
        for (std::size_t l = 0; l < lanes<T>; ++l) sum += static_cast<double>(cost[l]);
    }
    return sum * static_cast<double>(q.scale);
}

template <class T>
inline constexpr DenseKernels<T> kernels{product<T>, outer_product<T>, adam<T>, quantile_slopes<T>,
                                         quantile_loss<T>};

inline constexpr DenseTable table{kernels<float>, kernels<double>};

}  // namespace ricochet::learn::RICOCHET_DENSE_NAMESPACE
