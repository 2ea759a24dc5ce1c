// Internal: the declarations of this header may change without notice.
//
// Sums of products of Taylor coefficients.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

namespace ricochet::detail {

/// Term i of a sum from `lo` to `hi`, from the middle outward.
[[nodiscard]] constexpr int outward(int lo, int hi, int i) noexcept
{
    const int middle = (lo + hi) / 2;
    const bool above = i % 2 == 1;
    // The middle lies below the half for an even number of terms, and on it for an odd one.
    return above ? middle + (i + 1) / 2 : middle - i / 2;
}

/// Sums of products of coefficients, for an order k known to the compiler.
template <int k>
struct AtOrder {
    static constexpr int value = k;

    /// sum of a_j b_{k-j} for j from lo to hi
    template <int lo, int hi, class S>
    [[nodiscard, gnu::always_inline]] static S convolve(const S* a, const S* b)
    {
        if constexpr (lo > hi) {
            return S(0.0);
        } else {
            return [&]<int... i>(std::integer_sequence<int, i...>) __attribute__((always_inline))
            {
                return (... + (a[outward(lo, hi, i)] * b[k - outward(lo, hi, i)]));
            }
            (std::make_integer_sequence<int, hi - lo + 1>{});
        }
    }
    /// sum of ((exponent + 1) j / k - 1) a_j p_{k-j} for j from 1 to hi
    template <int hi, class S>
    [[nodiscard, gnu::always_inline]] static S power(double exponent, const S* a, const S* p)
    {
        return [&]<int... i>(std::integer_sequence<int, i...>) __attribute__((always_inline))
        {
            return (... + (((exponent + 1) * outward(1, hi, i) / k - 1) * a[outward(1, hi, i)] *
                           p[k - outward(1, hi, i)]));
        }
        (std::make_integer_sequence<int, hi>{});
    }
};

/// sum of a_j b_{-j} for j from 0 to `last`. A loop of so few terms costs as much for the
/// mispredicted branch at its end as for its terms; a call to the same target as the last one has
/// no such cost.
template <int last>
[[nodiscard]] double reversed_product(const double* a, const double* b)
{
    return [&]<int... i>(std::integer_sequence<int, i...>)
    {
        return (... + (a[outward(0, last, i)] * b[-outward(0, last, i)]));
    }
    (std::make_integer_sequence<int, last + 1>{});
}
inline constexpr auto reversed_products = []<int... last>(std::integer_sequence<int, last...>)
{
    return std::array{&reversed_product<last>...};
}
(std::make_integer_sequence<int, 21>{});

}  // namespace ricochet::detail
