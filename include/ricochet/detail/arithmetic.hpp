// Internal: the declarations of this header may change without notice.
//
// The arithmetic that the library relies on: IEEE 754, with NaN and infinity.
//
// A guard or a step that is not finite ends a run, carried remainders depend on the order
// of two additions, and "never" is an infinite time. Under -ffinite-math-only the compiler
// decides every such test without evaluating it.
#pragma once

#if ((defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0) || defined(__FAST_MATH__)) && \
    !defined(RICOCHET_ALLOW_FINITE_MATH)
#error \
    "ricochet: compiled with -ffast-math or -ffinite-math-only, under which NaN and infinity are not recognised and runs continue with them; leave the flag out here, or define RICOCHET_ALLOW_FINITE_MATH if you know what you lose"
#endif

namespace ricochet::detail {

// std::min and std::max, whose header takes a twentieth of the time in which a short program
// compiles.

/// The smaller of two values, the first where they do not differ or one is NaN.
template <class T>
[[nodiscard]] constexpr T least_of(T a, T b) noexcept
{
    return b < a ? b : a;
}

/// The larger of two values, the first where they do not differ or one is NaN.
template <class T>
[[nodiscard]] constexpr T greatest_of(T a, T b) noexcept
{
    return a < b ? b : a;
}

}  // namespace ricochet::detail
