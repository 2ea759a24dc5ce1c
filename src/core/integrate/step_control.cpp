#include "ricochet/step_control.hpp"

namespace ricochet::detail {

namespace {

/// x^(1/n) for 1/2 <= x <= 2, by Newton's iteration, which has converged long before its end.
[[nodiscard]] constexpr double root(double x, int n)
{
    double y = 1;
    for (int k = 0; k < 50; ++k) {
        double power = 1;
        for (int i = 1; i < n; ++i) power *= y;
        y += (x / power - y) / n;
    }
    return y;
}

}  // namespace

constexpr InverseRoots::InverseRoots(int order)
{
    // 2^(-e/n) by steps of one in e, from e = 0.
    constexpr auto one = static_cast<std::size_t>(1023 - lowest);
    const double down = root(0.5, order);
    scale_[one] = 1;
    for (std::size_t row = one; row + 1 < rows; ++row) scale_[row + 1] = scale_[row] * down;
    for (std::size_t row = one; row > 0; --row) scale_[row - 1] = scale_[row] / down;
    // Newton's form of the interpolant at the nodes of Chebyshev's polynomial in [1, 2], then its
    // coefficients.
    constexpr std::array<double, 4> m = {1.0380602337443566, 1.3086582838174552, 1.6913417161825448,
                                         1.9619397662556434};
    std::array<double, 4> d{};
    for (std::size_t i = 0; i < 4; ++i) d[i] = root(1 / m[i], order);
    for (std::size_t n = 1; n < 4; ++n) {
        for (std::size_t i = 3; i >= n; --i) d[i] = (d[i] - d[i - 1]) / (m[i] - m[i - n]);
    }
    c_[0] = d[3];
    for (std::size_t n = 3, degree = 1; n-- > 0; ++degree) {
        c_[degree] = d[n] - m[n] * c_[degree - 1];
        for (std::size_t i = degree - 1; i > 0; --i) c_[i] -= m[n] * c_[i - 1];
    }
}

constinit const std::array<InverseRoots, InverseRoots::most_order + 1> inverse_roots = [] {
    std::array<InverseRoots, InverseRoots::most_order + 1> all;
    for (int order = 1; order <= InverseRoots::most_order; ++order) {
        all[static_cast<std::size_t>(order)] = InverseRoots(order);
    }
    return all;
}();

}  // namespace ricochet::detail
