// Internal: the declarations of this header may change without notice.
//
// Registers of several floats or doubles, and sums whose bits do not depend on their width.
//
// The functions live in a namespace named after the target, so that translation
// units built for different machines can be linked together. No function of the
// standard library is called here: its inline functions carry no such name, and
// the linker could choose a copy that an older machine cannot run.
#pragma once

#include <cstddef>
#include <cstdint>

#ifndef RICOCHET_KERNEL_NAMESPACE
#if defined(__AVX512VL__)
#define RICOCHET_KERNEL_NAMESPACE kernel_avx512
#elif defined(__AVX2__)
#define RICOCHET_KERNEL_NAMESPACE kernel_avx2
#elif defined(__AVX__)
#define RICOCHET_KERNEL_NAMESPACE kernel_avx
#else
#define RICOCHET_KERNEL_NAMESPACE kernel_baseline
#endif
#endif

// Loops over registers must be unrolled completely, also at -O2, for the arrays to be kept in
// registers. Loops over inputs must not be: g++ spills when it unrolls them
// (2 x 16 float: 33 ns against 26).
#if defined(__clang__)
#define RICOCHET_UNROLL _Pragma("clang loop unroll(full)")
#define RICOCHET_KEEP_LOOP
#else
#define RICOCHET_UNROLL _Pragma("GCC unroll 16")
#define RICOCHET_KEEP_LOOP _Pragma("GCC unroll 1")
#endif
#define RICOCHET_INLINE [[gnu::always_inline]] inline
#define RICOCHET_INLINE_LAMBDA __attribute__((always_inline))

namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE {

/// Bytes in one block of outputs, the unit to which rows of weights are padded.
inline constexpr std::size_t block_bytes = 32;

/// Values in one block.
template <class T>
inline constexpr std::size_t block = block_bytes / sizeof(T);

#if defined(__AVX__)
inline constexpr std::size_t register_bytes = 32;
#else
inline constexpr std::size_t register_bytes = 16;
#endif

template <class T>
struct Simd;

template <>
struct Simd<float> {
    typedef float Vector __attribute__((vector_size(register_bytes), may_alias));
    typedef std::uint32_t Bits __attribute__((vector_size(register_bytes), may_alias));
};

template <>
struct Simd<double> {
    typedef double Vector __attribute__((vector_size(register_bytes), may_alias));
    typedef std::uint64_t Bits __attribute__((vector_size(register_bytes), may_alias));
};

template <class T>
using Vector = typename Simd<T>::Vector;

template <class T>
inline constexpr std::size_t lanes = register_bytes / sizeof(T);

// The constraint of an operand in a vector register.
#if defined(__AVX512VL__)
#define RICOCHET_VECTOR_REGISTER "+v"
#elif defined(__SSE2__)
#define RICOCHET_VECTOR_REGISTER "+x"
#elif defined(__aarch64__)
#define RICOCHET_VECTOR_REGISTER "+w"
#else
#define RICOCHET_VECTOR_REGISTER "+m"
#endif

/// `value`, hidden from the optimiser.
template <class V>
RICOCHET_INLINE V opaque(V value) noexcept
{
    asm("" : RICOCHET_VECTOR_REGISTER(value));
    return value;
}

/// a b + c, with the product rounded.
template <class V>
RICOCHET_INLINE V product_plus(V a, V b, V c) noexcept
{
    return opaque(a * b) + c;
}

/// Adds a rounded product. The sum passes through the assembler too, because g++
/// would otherwise defer long chains of sums and spill their products meanwhile.
template <class V>
RICOCHET_INLINE void accumulate(V& sum, V product) noexcept
{
    asm("" : RICOCHET_VECTOR_REGISTER(product), RICOCHET_VECTOR_REGISTER(sum));
    sum += product;
}

template <class T>
RICOCHET_INLINE Vector<T> load(const T* from) noexcept
{
    return *reinterpret_cast<const Vector<T>*>(from);
}

template <class T>
RICOCHET_INLINE void store(T* to, Vector<T> value) noexcept
{
    *reinterpret_cast<Vector<T>*>(to) = value;
}

template <class T>
RICOCHET_INLINE Vector<T> constant(T value) noexcept
{
    return value - Vector<T>{};
}

/// The sum of the lanes of a block, whose halves are added until one is left.
template <class T>
RICOCHET_INLINE T sum_of_lanes(const Vector<T> (&part)[block<T> / lanes<T>]) noexcept
{
    typedef T Half __attribute__((vector_size(block_bytes / 2)));
    Half half;
    if constexpr (lanes<T> == block<T>) {
        if constexpr (sizeof(T) == 4) {
            half = __builtin_shufflevector(part[0], part[0], 0, 1, 2, 3) +
                   __builtin_shufflevector(part[0], part[0], 4, 5, 6, 7);
        } else {
            half = __builtin_shufflevector(part[0], part[0], 0, 1) +
                   __builtin_shufflevector(part[0], part[0], 2, 3);
        }
    } else {
        half = part[0] + part[1];
    }
    if constexpr (sizeof(T) == 4) half += __builtin_shufflevector(half, half, 2, 3, 2, 3);
    return half[0] + half[1];
}

}  // namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE
