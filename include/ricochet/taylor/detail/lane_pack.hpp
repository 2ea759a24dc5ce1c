// Internal: the declarations of this header may change without notice.
//
// Four doubles side by side, one for each of four motions, with the operations of one double.
//
// Every lane has the bits of the same operation on a double: sums, products and quotients are the
// processor's, and other functions are those of the standard library, called for each lane. In a
// function that is compiled for another machine than its file they are inlined.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace ricochet::detail {

inline constexpr std::size_t lane_count = 4;

/// Numbers T of 8 bytes for all lanes: in one register where it is `wide`, else in two.
template <class T, bool wide>
struct LaneParts {
    typedef T Vector __attribute__((vector_size(32)));
    Vector low;

    [[nodiscard, gnu::always_inline]] T at(std::size_t lane) const noexcept { return low[lane]; }
    [[gnu::always_inline]] void put(std::size_t lane, T value) noexcept { low[lane] = value; }
};
template <class T>
struct LaneParts<T, false> {
    typedef T Vector __attribute__((vector_size(16)));
    Vector low, high;

    [[nodiscard, gnu::always_inline]] T at(std::size_t lane) const noexcept
    {
        return lane < 2 ? low[lane] : high[lane - 2];
    }
    [[gnu::always_inline]] void put(std::size_t lane, T value) noexcept
    {
        (lane < 2 ? low : high)[lane % 2] = value;
    }
};

// Evaluates an expression of a and b, the parts of x and y, for each part.
#define RICOCHET_BOTH(Result, expression)                \
    Result out;                                          \
    {                                                    \
        const auto &a = x.parts.low, &b = y.parts.low;   \
        out.parts.low = expression;                      \
    }                                                    \
    if constexpr (!wide) {                               \
        const auto &a = x.parts.high, &b = y.parts.high; \
        out.parts.high = expression;                     \
    }                                                    \
    return out
#define RICOCHET_LANES(Result, T, op)                                                            \
    [[nodiscard, gnu::always_inline]] friend Result operator op(const T& x, const T& y) noexcept \
    {                                                                                            \
        RICOCHET_BOTH(Result, a op b);                                                           \
    }

/// A truth value for each lane.
template <bool wide>
struct LaneMask {
    LaneParts<std::int64_t, wide> parts;  ///< 0 or -1

    [[nodiscard, gnu::always_inline]] bool operator[](std::size_t lane) const noexcept
    {
        return parts.at(lane) != 0;
    }
    [[gnu::always_inline]] void set(std::size_t lane, bool value) noexcept
    {
        parts.put(lane, value ? -1 : 0);
    }
    [[nodiscard, gnu::always_inline]] bool any() const noexcept
    {
        return ((parts.at(0) | parts.at(1)) | (parts.at(2) | parts.at(3))) != 0;
    }
    RICOCHET_LANES(LaneMask, LaneMask, &)
    RICOCHET_LANES(LaneMask, LaneMask, |)
    [[nodiscard, gnu::always_inline]] friend LaneMask operator~(const LaneMask& x) noexcept
    {
        LaneMask out;
        out.parts.low = ~x.parts.low;
        if constexpr (!wide) out.parts.high = ~x.parts.high;
        return out;
    }
};

/// A double for each lane.
template <bool wide>
struct LanePack {
    using Mask = LaneMask<wide>;
    LaneParts<double, wide> parts;

    LanePack() = default;
    // NOLINTNEXTLINE(google-explicit-constructor): numbers enter expressions as they are
    [[gnu::always_inline]] LanePack(double a) noexcept
    {
        using Vector = typename LaneParts<double, wide>::Vector;
        parts.low = a - Vector{};
        if constexpr (!wide) parts.high = a - Vector{};
    }

    /// f(lane) in each lane.
    template <class F>
    [[nodiscard, gnu::always_inline]] static LanePack of_lanes(const F& f)
    {
        using Vector = typename LaneParts<double, wide>::Vector;
        LanePack out;
        if constexpr (wide) {
            out.parts.low = Vector{f(0), f(1), f(2), f(3)};
        } else {
            out.parts.low = Vector{f(0), f(1)};
            out.parts.high = Vector{f(2), f(3)};
        }
        return out;
    }

    [[nodiscard, gnu::always_inline]] double operator[](std::size_t lane) const noexcept
    {
        return parts.at(lane);
    }
    [[gnu::always_inline]] void set(std::size_t lane, double value) noexcept
    {
        parts.put(lane, value);
    }

    RICOCHET_LANES(LanePack, LanePack, +)
    RICOCHET_LANES(LanePack, LanePack, -)
    RICOCHET_LANES(LanePack, LanePack, *)
    RICOCHET_LANES(LanePack, LanePack, /)
    RICOCHET_LANES(Mask, LanePack, <)
    RICOCHET_LANES(Mask, LanePack, <=)
    RICOCHET_LANES(Mask, LanePack, >)
    RICOCHET_LANES(Mask, LanePack, >=)
    RICOCHET_LANES(Mask, LanePack, ==)
    [[nodiscard, gnu::always_inline]] friend LanePack operator-(const LanePack& x) noexcept
    {
        LanePack out;
        out.parts.low = -x.parts.low;
        if constexpr (!wide) out.parts.high = -x.parts.high;
        return out;
    }
    [[gnu::always_inline]] LanePack& operator+=(const LanePack& x) noexcept
    {
        return *this = *this + x;
    }
    [[gnu::always_inline]] LanePack& operator*=(const LanePack& x) noexcept
    {
        return *this = *this * x;
    }

    [[nodiscard, gnu::always_inline]] friend LanePack select(const Mask& which, const LanePack& x,
                                                             const LanePack& y) noexcept
    {
        LanePack out;
        out.parts.low = which.parts.low ? x.parts.low : y.parts.low;
        if constexpr (!wide) out.parts.high = which.parts.high ? x.parts.high : y.parts.high;
        return out;
    }
    /// As std::max and std::min, also where one of them is NaN.
    [[nodiscard, gnu::always_inline]] friend LanePack larger_of(const LanePack& x,
                                                                const LanePack& y) noexcept
    {
        RICOCHET_BOTH(LanePack, a < b ? b : a);
    }
    [[nodiscard, gnu::always_inline]] friend LanePack smaller_of(const LanePack& x,
                                                                 const LanePack& y) noexcept
    {
        RICOCHET_BOTH(LanePack, b < a ? b : a);
    }

    /// The numbers whose bits `change` computes from the bits of x.
    template <class Change>
    [[nodiscard, gnu::always_inline]] static LanePack change_bits(const LanePack& x,
                                                                  const Change& change)
    {
        using Bits = typename LaneParts<std::int64_t, wide>::Vector;
        using Numbers = typename LaneParts<double, wide>::Vector;
        LanePack out;
        Bits low = reinterpret_cast<Bits>(x.parts.low);
        change(low);
        out.parts.low = reinterpret_cast<Numbers>(low);
        if constexpr (!wide) {
            Bits high = reinterpret_cast<Bits>(x.parts.high);
            change(high);
            out.parts.high = reinterpret_cast<Numbers>(high);
        }
        return out;
    }
};

#undef RICOCHET_LANES
#undef RICOCHET_BOTH

/// f(x), lane by lane.
template <bool wide, class F>
[[nodiscard, gnu::always_inline]] inline LanePack<wide> map_lanes(const LanePack<wide>& x,
                                                                  const F& f)
{
    return LanePack<wide>::of_lanes([&](std::size_t lane) { return f(x[lane]); });
}
template <bool wide, class F>
[[nodiscard, gnu::always_inline]] inline LanePack<wide> map_lanes(const LanePack<wide>& x,
                                                                  const LanePack<wide>& y,
                                                                  const F& f)
{
    return LanePack<wide>::of_lanes([&](std::size_t lane) { return f(x[lane], y[lane]); });
}

/// sin(x) and cos(x), lane by lane: one call for both.
template <bool wide>
[[gnu::always_inline]] inline void map_circle(const LanePack<wide>& x, LanePack<wide>& sine,
                                              LanePack<wide>& cosine)
{
    std::array<double, lane_count> sines, cosines;
    for (std::size_t lane = 0; lane < lane_count; ++lane) {
        const double angle = x[lane];
        sines[lane] = std::sin(angle);
        cosines[lane] = std::cos(angle);
    }
    sine = LanePack<wide>::of_lanes([&](std::size_t lane) { return sines[lane]; });
    cosine = LanePack<wide>::of_lanes([&](std::size_t lane) { return cosines[lane]; });
}

/// |x|
template <bool wide>
[[nodiscard, gnu::always_inline]] inline LanePack<wide> size_of(const LanePack<wide>& x) noexcept
{
    const auto drop_sign = [](auto& bits) __attribute__((always_inline))
    {
        bits &= std::numeric_limits<std::int64_t>::max();
    };
    return LanePack<wide>::change_bits(x, drop_sign);
}

/// As `rough_log2` for doubles.
template <bool wide>
[[nodiscard, gnu::always_inline]] inline LanePack<wide> rough_log2(const LanePack<wide>& x) noexcept
{
    using Pack = LanePack<wide>;
    // The last bits of 2^52 + n are the whole number n, if it is below 2^52.
    const auto to_exponent = [](auto& bits) __attribute__((always_inline))
    {
        bits = (bits >> 52) | 0x4330000000000000;
    };
    const auto to_mantissa = [](auto& bits) __attribute__((always_inline))
    {
        bits = (bits & 0xfffffffffffff) | 0x3ff0000000000000;
    };
    const Pack exponent = (Pack::change_bits(x, to_exponent) - 0x1p52) - 1023.0;
    const Pack m = Pack::change_bits(x, to_mantissa);
    return (exponent - 2.1362320654130670) +
           m * ((3.0111621508367876 - 1.0268049073983060 * m) + 0.1527002847975194 * (m * m));
}

/// As `rough_exp2` for doubles.
template <bool wide>
[[nodiscard, gnu::always_inline]] inline LanePack<wide> rough_exp2(const LanePack<wide>& x) noexcept
{
    using Pack = LanePack<wide>;
    constexpr double shift = 0x1.8p52;
    const Pack shifted = x + shift;
    const Pack y = x - (shifted - shift);
    const Pack part = (0.9999245569508709 + 0.6931367338836214 * y) +
                      y * y * (0.2426394785462585 + 0.0558382829462201 * y);
    // The whole number is in the last bits.
    const auto to_power = [](auto& bits) __attribute__((always_inline))
    {
        bits = (bits + 1023) << 52;
    };
    return part * Pack::change_bits(shifted, to_power);
}

}  // namespace ricochet::detail
