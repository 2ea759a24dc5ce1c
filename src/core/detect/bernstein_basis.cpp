#include "bernstein_basis.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>

namespace ricochet::detail {

namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

using Square = std::array<Coefficients, most_bernstein_degree + 1>;

[[nodiscard]] constexpr std::size_t at(int i) noexcept
{
    return static_cast<std::size_t>(i);
}

/// C(n, k), up to C(64, 32) = 1.8e18.
[[nodiscard]] std::int64_t binomial(int n, int k) noexcept
{
    if (k < 0 || k > n) return 0;
    std::int64_t result = 1;
    for (int i = 1; i <= k; ++i) {
        // result * (n - k + i) / i, exactly, without passing 2^63
        const std::int64_t whole = result / i;
        const std::int64_t rest = result % i;
        result = whole * (n - k + i) + rest * (n - k + i) / i;
    }
    return result;
}

/// Coefficient i of the Chebyshev polynomial T_k(2 u - 1) in Bernstein form of degree n.
/// In degree k it is (-1)^(k - i) C(2k, 2i) / C(k, i) (A. Rababah, Transformation of
/// Chebyshev-Bernstein polynomial basis, Computational Methods in Applied Mathematics 3,
/// 2003); raising the degree leaves a sum of integers below 2^63.
[[nodiscard]] double chebyshev_coefficient(int n, int k, int i) noexcept
{
    std::int64_t sum = 0;
    for (int j = std::max(0, i - (n - k)); j <= std::min(i, k); ++j) {
        const std::int64_t term = binomial(n - k, i - j) * binomial(2 * k, 2 * j);
        sum += (k - j) % 2 == 0 ? term : -term;
    }
    return static_cast<double>(sum) / static_cast<double>(binomial(n, i));
}

/// Coefficient k of the sum of Chebyshev polynomials through a 1 at node j and 0 at the
/// other nodes: the discrete cosine transform.
[[nodiscard]] double transform(int n, int k, int j) noexcept
{
    const double ends = (k == 0 || k == n ? 0.5 : 1.0) * (j == 0 || j == n ? 0.5 : 1.0);
    const double angle = std::numbers::pi * (k * j % (2 * n)) / n;
    return (k % 2 == 0 ? 2 : -2) * ends * std::cos(angle) / n;
}

[[nodiscard]] BernsteinBasis make_basis(int n) noexcept
{
    BernsteinBasis basis;
    basis.degree = n;
    for (int j = 0; j <= n; ++j) {
        const double root = std::sin(std::numbers::pi * j / (2 * n));
        basis.nodes[at(j)] = root * root;
    }
    Square chebyshev{};
    for (int k = 0; k <= n; ++k) {
        for (int i = 0; i <= n; ++i) chebyshev[at(k)][at(i)] = chebyshev_coefficient(n, k, i);
    }
    double work = 0;  // largest sum over a row of the sizes of its terms
    for (int i = 0; i <= n; ++i) {
        double row = 0;
        double row_work = 0;
        for (int j = 0; j <= n; ++j) {
            double sum = 0;
            for (int k = 0; k <= n; ++k) {
                const double term = chebyshev[at(k)][at(i)] * transform(n, k, j);
                sum += term;
                row_work += std::fabs(term);
            }
            if (i == 0 || i == n) sum = i == j ? 1 : 0;
            basis.matrix[at(j * (n + 1) + i)] = sum;
            row += std::fabs(sum);
        }
        basis.norm = std::max(basis.norm, row);
        work = std::max(work, row_work);
    }
    // Rounding comes from the samples, from n + 1 products and sums in each row, and from as many
    // again, with four roundings per term, in the matrix.
    basis.rounding =
        epsilon * ((4 + 0.5 * (n + 2)) * basis.norm + 0.5 * (n + 5) * work) * (1 + 1e-9);
    return basis;
}

template <int n>
[[nodiscard]] const BernsteinBasis& basis_of() noexcept
{
    static const BernsteinBasis basis = make_basis(n);
    return basis;
}

template <int... n>
[[nodiscard]] constexpr auto all_bases(std::integer_sequence<int, n...> /*degrees*/) noexcept
{
    return std::array{&basis_of<n + 1>...};
}

constexpr auto bases = all_bases(std::make_integer_sequence<int, most_bernstein_degree>());

[[gnu::always_inline]] inline void multiply(const double* column, int n, const double* values,
                                            double* c) noexcept
{
    for (int i = 0; i <= n; ++i) c[i] = column[i] * values[0];
    for (int j = 1; j <= n; ++j) {
        column += n + 1;
        for (int i = 0; i <= n; ++i) c[i] += column[i] * values[j];
    }
}

/// Conversion for the degrees of guards that are linear in the state, unrolled.
template <int n>
void multiply(const double* matrix, const double* values, double* c) noexcept
{
    std::array<double, n + 1> sum;
    multiply(matrix, n, values, sum.data());
    std::copy(sum.begin(), sum.end(), c);
}

}  // namespace

const BernsteinBasis& bernstein_basis(int degree) noexcept
{
    return bases[at(degree - 1)]();
}

const double* bernstein_nodes(int degree) noexcept
{
    return bernstein_basis(degree).nodes.data();
}

void BernsteinBasis::convert(const double* values, double* c) const noexcept
{
    switch (degree) {
        case 3: return multiply<3>(matrix.data(), values, c);
        case 4: return multiply<4>(matrix.data(), values, c);
        case 5: return multiply<5>(matrix.data(), values, c);
        case 7: return multiply<7>(matrix.data(), values, c);
        default: return multiply(matrix.data(), degree, values, c);
    }
}

double bernstein_value(const double* c, int n, double u) noexcept
{
    Coefficients p;
    std::copy(c, c + n + 1, p.begin());
    for (int level = n; level > 0; --level) {
        for (std::size_t i = 0; i < at(level); ++i) p[i] = (1 - u) * p[i] + u * p[i + 1];
    }
    return p[0];
}

double bernstein_slope(const double* c, int n, double u) noexcept
{
    Coefficients p;
    for (int i = 0; i < n; ++i) p[at(i)] = n * (c[i + 1] - c[i]);
    return bernstein_value(p.data(), n - 1, u);
}

void halve(double* c, int n, double* right) noexcept
{
    right[n] = c[n];
    for (int level = 1; level <= n; ++level) {
        for (int i = n; i >= level; --i) c[i] = 0.5 * (c[i - 1] + c[i]);
        right[n - level] = c[n];
    }
}

}  // namespace ricochet::detail
