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
