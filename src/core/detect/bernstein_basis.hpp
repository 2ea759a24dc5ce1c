// Polynomials on [0, 1] in Bernstein form, on plain arrays.
//
//     p(u) = sum_i c_i C(n, i) u^i (1 - u)^(n - i)
//
// p lies between the least and the greatest coefficient, takes the first and the last
// at its ends, and has no more roots than its coefficients have changes of sign
// (R. T. Farouki, The Bernstein polynomial basis: a centennial retrospective, Computer
// Aided Geometric Design 29, 2012, pages 379 to 419).
#pragma once

#include <array>
#include <cstddef>

#include "ricochet/bernstein.hpp"

namespace ricochet::detail {

using Coefficients = std::array<double, most_bernstein_degree + 1>;

/// Conversion from samples at nodes to Bernstein coefficients of one degree.
struct BernsteinBasis {
    int degree = 0;
    Coefficients nodes{};  ///< extrema of the Chebyshev polynomial of that degree on [0, 1]
    /// Row by row; the coefficients that belong to sample j alone begin at j (degree + 1).
    std::array<double, (most_bernstein_degree + 1) * (most_bernstein_degree + 1)> matrix{};
    double norm = 0;      ///< largest |coefficient| over all samples in [-1, 1]
    double rounding = 0;  ///< largest error of a coefficient for such samples, where the
                          ///< samples themselves are rounded to four units in the last place

    /// c = matrix * values.
    void convert(const double* values, double* c) const noexcept;
};

/// @param degree in [1, most_bernstein_degree]
[[nodiscard]] const BernsteinBasis& bernstein_basis(int degree) noexcept;

/// p(u), by the algorithm of de Casteljau.
[[nodiscard]] double bernstein_value(const double* c, int n, double u) noexcept;

/// p'(u).
[[nodiscard]] double bernstein_slope(const double* c, int n, double u) noexcept;

/// Splits p at 1/2: its coefficients on [0, 1/2] replace c, those on [1/2, 1] go to `right`.
void halve(double* c, int n, double* right) noexcept;

}  // namespace ricochet::detail
