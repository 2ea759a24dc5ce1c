// Internal: what it declares may change without notice.
//
// Four doubles side by side, one for each of four motions, with the operations of one.
//
// Every lane has the bits of the same operation on a double: sums, products and quotients are the
// processor's, functions are those of the standard library, lane by lane. A function that is
// compiled for another machine than its file has them inlined.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace ricochet::detail {

inline constexpr std::size_t lane_count = 4;

/// A truth for each lane.
struct LaneMask {
    typedef std::int64_t Vector __attribute__((vector_size(8 * lane_count)));
    Vector v;  ///< 0 or -1

    [[nodiscard, gnu::always_inline]] bool operator[](std::size_t lane) const noexcept
    {
        return v[lane] != 0;
    }
    [[gnu::always_inline]] void set(std::size_t lane, bool value) noexcept
    {
        v[lane] = value ? -1 : 0;
    }
    [[nodiscard, gnu::always_inline]] bool any() const noexcept
    {
        return ((v[0] | v[1]) | (v[2] | v[3])) != 0;
    }
    [[gnu::always_inline]] friend LaneMask operator&(const LaneMask& a, const LaneMask& b) noexcept
    {
        return {a.v & b.v};
    }
    [[gnu::always_inline]] friend LaneMask operator|(const LaneMask& a, const LaneMask& b) noexcept
    {
        return {a.v | b.v};
    }
    [[gnu::always_inline]] friend LaneMask operator!(const LaneMask& a) noexcept { return {~a.v}; }
};

/// A double for each lane.
struct LanePack {
    typedef double Vector __attribute__((vector_size(8 * lane_count)));
    Vector v;

    LanePack() = default;
    // NOLINTNEXTLINE(google-explicit-constructor): numbers enter expressions as they are
    [[gnu::always_inline]] LanePack(double a) noexcept : v(a - Vector{}) {}
    [[gnu::always_inline]] explicit LanePack(const Vector& a) noexcept : v(a) {}

    [[nodiscard, gnu::always_inline]] double operator[](std::size_t lane) const noexcept
    {
        return v[lane];
    }
    [[gnu::always_inline]] void set(std::size_t lane, double value) noexcept { v[lane] = value; }

#define RICOCHET_LANES(op)                                                           \
    [[gnu::always_inline]] friend LanePack operator op(const LanePack& a,            \
                                                       const LanePack& b) noexcept   \
    {                                                                                \
        return LanePack(a.v op b.v);                                                 \
    }
    RICOCHET_LANES(+)
    RICOCHET_LANES(-)
    RICOCHET_LANES(*)
    RICOCHET_LANES(/)
#undef RICOCHET_LANES
#define RICOCHET_LANES(op)                                                           \
    [[gnu::always_inline]] friend LaneMask operator op(const LanePack& a,            \
                                                       const LanePack& b) noexcept   \
    {                                                                                \
        return {a.v op b.v};                                                         \
    }
    RICOCHET_LANES(<)
    RICOCHET_LANES(<=)
    RICOCHET_LANES(>)
    RICOCHET_LANES(>=)
    RICOCHET_LANES(==)
#undef RICOCHET_LANES
    [[gnu::always_inline]] friend LanePack operator-(const LanePack& a) noexcept
    {
        return LanePack(-a.v);
    }
    [[gnu::always_inline]] LanePack& operator+=(const LanePack& a) noexcept
    {
        v += a.v;
        return *this;
    }
    [[gnu::always_inline]] LanePack& operator*=(const LanePack& a) noexcept
    {
        v *= a.v;
        return *this;
    }
};

/// f(a), lane by lane.
template <class F>
[[nodiscard, gnu::always_inline]] inline LanePack map_lanes(const LanePack& a, const F& f)
{
    LanePack out;
    for (std::size_t lane = 0; lane < lane_count; ++lane) out.v[lane] = f(a.v[lane]);
    return out;
}
template <class F>
[[nodiscard, gnu::always_inline]] inline LanePack map_lanes(const LanePack& a, const LanePack& b,
                                                            const F& f)
{
    LanePack out;
    for (std::size_t lane = 0; lane < lane_count; ++lane) out.v[lane] = f(a.v[lane], b.v[lane]);
    return out;
}

[[nodiscard, gnu::always_inline]] inline LanePack select(const LaneMask& which, const LanePack& a,
                                                         const LanePack& b) noexcept
{
    return LanePack(which.v ? a.v : b.v);
}

/// As std::max and std::min, where one of both is no number, too.
[[nodiscard, gnu::always_inline]] inline LanePack larger_of(const LanePack& a,
                                                            const LanePack& b) noexcept
{
    return select(a < b, b, a);
}
[[nodiscard, gnu::always_inline]] inline LanePack smaller_of(const LanePack& a,
                                                             const LanePack& b) noexcept
{
    return select(b < a, b, a);
}

[[nodiscard, gnu::always_inline]] inline LaneMask bits_of(const LanePack& a) noexcept
{
    return {reinterpret_cast<LaneMask::Vector>(a.v)};
}
[[nodiscard, gnu::always_inline]] inline LanePack of_bits(const LaneMask::Vector& bits) noexcept
{
    return LanePack(reinterpret_cast<LanePack::Vector>(bits));
}

[[nodiscard, gnu::always_inline]] inline LanePack size_of(const LanePack& a) noexcept
{
    return of_bits(bits_of(a).v & std::numeric_limits<std::int64_t>::max());
}

/// As `rough_log2`.
[[nodiscard, gnu::always_inline]] inline LanePack rough_log2(const LanePack& x) noexcept
{
    const LaneMask::Vector bits = bits_of(x).v;  // of positive numbers
    // A whole number below 2^52 in the last bits of 2^52 plus it.
    const LanePack exponent =
        (of_bits((bits >> 52) | 0x4330000000000000) - LanePack(0x1p52)) - LanePack(1023);
    const LanePack m = of_bits((bits & 0xfffffffffffff) | 0x3ff0000000000000);
    return (exponent - 2.1362320654130670) +
           m * ((3.0111621508367876 - 1.0268049073983060 * m) + 0.1527002847975194 * (m * m));
}

/// As `rough_exp2`.
[[nodiscard, gnu::always_inline]] inline LanePack rough_exp2(const LanePack& x) noexcept
{
    constexpr double shift = 0x1.8p52;
    const LanePack shifted = x + shift;
    const LanePack whole = shifted - shift;
    const LanePack y = x - whole;
    const LanePack part = (0.9999245569508709 + 0.6931367338836214 * y) +
                          y * y * (0.2426394785462585 + 0.0558382829462201 * y);
    // The whole number is in the last bits.
    return part * of_bits((bits_of(shifted).v + 1023) << 52);
}

}  // namespace ricochet::detail
