// Choice of the length of the next step.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "ricochet/detail/arithmetic.hpp"

namespace ricochet {

namespace detail {

/// x^(-1/n), within 1.8e-3 of it for n = 1 and 2.1e-4 from n = 4 on: a table over the exponent of x
/// times a cubic in its mantissa. The length of the next step waits for this number, for which a
/// power takes three times as long; and sums and products have the same bits with every
/// mathematical library.
class InverseRoots {
public:
    static constexpr int most_order = 16;

    InverseRoots() = default;
    /// Fills the tables for n = `order`.
    constexpr explicit InverseRoots(int order);

    [[nodiscard, gnu::always_inline]] double operator()(double x) const noexcept
    {
        const auto bits = std::bit_cast<std::uint64_t>(x);
        const std::uint64_t row = (bits >> 52) - lowest;
        if (row >= rows) [[unlikely]]
            return x < 1 ? scale_.front() : scale_.back();
        constexpr std::uint64_t mantissa = (std::uint64_t{1} << 52) - 1;
        const double m =
            std::bit_cast<double>((bits & mantissa) | std::bit_cast<std::uint64_t>(1.0));
        return scale_[row] * ((c_[0] * m + c_[1]) * (m * m) + (c_[2] * m + c_[3]));
    }

private:
    /// Biased exponents of the table, 2^-58 ... 2^38. Numbers beyond count as these: up to
    /// `most_order` the factors of the steps are at their limits there.
    static constexpr std::uint64_t lowest = 1023 - 58, rows = 96;

    std::array<double, rows> scale_{};
    std::array<double, 4> c_{};  ///< highest power first
};

/// One for each order; the first is not used.
extern const std::array<InverseRoots, InverseRoots::most_order + 1> inverse_roots;

}  // namespace detail

/// The step-size rule of error control: with the error scaled so that 1 is just
/// acceptable, and proportional to h^order, the next step is
///
///     h_new = h min(10, max(1/5, 0.9 error^(-1/order)))
///
/// (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I,
/// eq. II.4.13), with the root to three digits. It is a value, so that other rules can take its
/// place.
struct ErrorRule {
    double safety = 0.9;
    double smallest = 0.2;
    double largest = 10;

    /// Whether a step with this error, in units of its tolerance, is accepted.
    [[nodiscard]] static constexpr bool accepts(double error) noexcept { return error <= 1; }

    /// h_new / h for a finite `error` >= 0.
    [[nodiscard, gnu::always_inline]] double factor(double error, int order) const noexcept
    {
        const double root = order <= detail::InverseRoots::most_order
                                ? detail::inverse_roots[static_cast<std::size_t>(order)](error)
                                : std::pow(error, -1.0 / order);
        return detail::least_of(largest, detail::greatest_of(smallest, safety * root));
    }
};

}  // namespace ricochet
