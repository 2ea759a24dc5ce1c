// Internal: the declarations of this header may change without notice.
//
// Activation functions after a hidden layer, in registers.
//
// No function of the mathematical library is called: libraries differ in the last bits
// of their results, and g++ would call them lane by lane.
#pragma once

#include "ricochet/nn/detail/simd.hpp"

namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE {

/// max(0, x), and NaN for NaN.
struct Relu {
    template <class T>
    RICOCHET_INLINE static Vector<T> of(Vector<T> x) noexcept
    {
        // Opaque to g++, which for a known zero prefers a comparison and a mask.
        const auto zero = opaque(Vector<T>{});
        return zero > x ? zero : x;
    }
};

/// tanh(x), NaN for NaN.
struct Tanh {
    template <class T>
    RICOCHET_INLINE static Vector<T> of(Vector<T> x) noexcept
    {
        // From `limit` on, 1 is the nearest number in T.
        constexpr T limit = sizeof(T) == 4 ? T(9) : T(20);
        const auto below = x < constant(-limit);
        const auto above = x > constant(limit);
        const Vector<T> bound = below ? constant(T(-1)) : constant(T(1));
        return below | above ? bound : inside(x);
    }

    /// x P(x^2) / Q(x^2), the minimax approximation of its degrees on [-9, 9], found
    /// by the Remez exchange: 2.1e-8 relative, and 4 ulp with rounding.
    RICOCHET_INLINE static Vector<float> inside(Vector<float> x) noexcept
    {
        using V = Vector<float>;
        const V z = x * x;
        const V z2 = z * z;
        const V p01 = product_plus(z, constant(0.133810249682F), constant(0.999999979449F));
        const V p23 = product_plus(z, constant(2.06090715979e-5F), constant(0.00349558737823F));
        const V p = product_plus(z2, product_plus(z2, constant(1.3354649181e-8F), p23), p01);
        const V q01 = product_plus(z, constant(0.467143405586F), constant(1.0F));
        const V q23 = product_plus(z, constant(0.000328563366632F), constant(0.0258769792286F));
        const V q = product_plus(z2, product_plus(z2, constant(7.77655274809e-7F), q23), q01);
        return x * p / q;
    }

    /// With 2x = n ln 2 + r, |r| <= ln 2 / 2, s = 2^n and R = r coth(r / 2),
    ///
    ///     exp(2x) = s (R + r) / (R - r)
    ///     tanh(x) = ((s - 1) R + (s + 1) r) / ((s + 1) R + (s - 1) r)
    ///
    /// with one division and no cancellation: for n = 0 it reduces to r / R. R is even,
    /// 2 + r^2/6 - r^4/360 + ..., and its series converges for |r| < 2 pi: each term is at
    /// most 0.003 times the one before, and the first that is omitted is 1e-17.
    RICOCHET_INLINE static Vector<double> inside(Vector<double> x) noexcept
    {
        using V = Vector<double>;
        using Bits = Simd<double>::Bits;
        // Adding it leaves an integer in the low bits of the sum.
        const V shift = constant(0x1.8p52);
        const V sum = product_plus(x, constant(0x1.71547652b82fep+1), shift);  // 2 / ln 2
        const V n = sum - shift;
        // ln 2 in two pieces, the first short enough for exact multiples.
        const V near = (x + x) - opaque(n * 0x1.62e42fefap-1);
        const V r = near - opaque(n * 0x1.cf79abc9e3b39p-40);
        const V z = opaque(r * r);
        const V z2 = opaque(z * z);
        const V c01 = product_plus(z, constant(1.0 / 6), constant(2.0));
        const V c23 = product_plus(z, constant(1.0 / 15120), constant(-1.0 / 360));
        const V c45 = product_plus(z, constant(1.0 / 23950080), constant(-1.0 / 604800));
        const V c456 = product_plus(z2, constant(-691.0 / 653837184000.0), c45);
        const V c0123 = product_plus(z2, c23, c01);
        const V even = product_plus(opaque(z2 * z2), c456, c0123);

        const V one = constant(1.0);
        const V s =
            reinterpret_cast<V>((reinterpret_cast<Bits>(sum) << 52) + reinterpret_cast<Bits>(one));
        const V more = s + one;
        const V less = s - one;
        return product_plus(less, even, opaque(more * r)) /
               product_plus(more, even, opaque(less * r));
    }
};

struct Linear {
    template <class T>
    RICOCHET_INLINE static Vector<T> of(Vector<T> x) noexcept
    {
        return x;
    }
};

}  // namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE
