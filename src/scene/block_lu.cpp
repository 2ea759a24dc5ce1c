#include "scene/block_lu.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace ricochet::detail {

namespace {

/// A pivot that shrinks below this fraction has lost the digits that the iterations need.
constexpr double least_pivot = 1e-13;

template <std::size_t N>
using Block = std::array<double, N * N>;

template <std::size_t N>
[[nodiscard]] Block<N> product(const Block<N>& a, const Block<N>& b) noexcept
{
    Block<N> out;
    for (std::size_t row = 0; row < N; ++row) {
        for (std::size_t column = 0; column < N; ++column) {
            double sum = a[N * row] * b[column];
            for (std::size_t k = 1; k < N; ++k) sum += a[N * row + k] * b[N * k + column];
            out[N * row + column] = sum;
        }
    }
    return out;
}

template <std::size_t N>
[[nodiscard]] double largest(const Block<N>& a) noexcept
{
    double most = 0;
    for (const double x : a) most = std::max(most, std::abs(x));
    return most;
}

/// a <- a^-1 by the adjugate, which is as exact as a is well-conditioned.
[[nodiscard]] bool invert(Block<2>& a, double before) noexcept
{
    const double determinant = a[0] * a[3] - a[1] * a[2];
    const double size = largest<2>(a);
    if (!(std::abs(determinant) > least_pivot * size * before)) return false;
    const double inverse = 1 / determinant;
    a = {a[3] * inverse, -a[1] * inverse, -a[2] * inverse, a[0] * inverse};
    return std::isfinite(inverse);
}

/// The same with pivots: two of three directions may be soft beside a stiff one, and the adjugate
/// then loses the square of their ratio.
[[nodiscard]] bool invert(Block<3>& a, double before)
{
    using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    Eigen::Map<Matrix> matrix(a.data());
    const Eigen::PartialPivLU<Matrix> factors(matrix);
    const double pivot = factors.matrixLU().diagonal().cwiseAbs().minCoeff();
    if (!(pivot > least_pivot * before)) return false;
    matrix = factors.inverse();
    return matrix.allFinite();
}

/// x -= m y
template <std::size_t N>
void subtract_product(std::array<double, N>& x, const Block<N>& m,
                      const std::array<double, N>& y) noexcept
{
    for (std::size_t row = 0; row < N; ++row) {
        double sum = m[N * row] * y[0];
        for (std::size_t k = 1; k < N; ++k) sum += m[N * row + k] * y[k];
        x[row] -= sum;
    }
}

}  // namespace

/// Orders rows by least degree; all rows that a row is coupled with become coupled.
template <std::size_t N>
void BlockLu<N>::order(int count, const std::vector<std::array<int, 2>>& pairs)
{
    std::vector<std::set<int>> near(static_cast<std::size_t>(count));
    for (const auto& [i, j] : pairs) {
        near[static_cast<std::size_t>(i)].insert(j);
        near[static_cast<std::size_t>(j)].insert(i);
    }
    std::set<std::array<std::size_t, 2>> waiting;  // degree and row
    for (std::size_t i = 0; i < near.size(); ++i) waiting.insert({near[i].size(), i});
    place_.assign(near.size(), 0);
    std::vector<std::vector<int>> coupled;
    while (!waiting.empty()) {
        const std::size_t row = (*waiting.begin())[1];
        waiting.erase(waiting.begin());
        place_[row] = static_cast<int>(coupled.size());
        coupled.emplace_back(near[row].begin(), near[row].end());
        for (const int i : coupled.back()) {
            auto& its = near[static_cast<std::size_t>(i)];
            waiting.erase({its.size(), static_cast<std::size_t>(i)});
            its.erase(static_cast<int>(row));
            its.insert(coupled.back().begin(), coupled.back().end());
            its.erase(i);
            waiting.insert({its.size(), static_cast<std::size_t>(i)});
        }
    }
    later_.assign(coupled.size(), {});
    for (std::size_t k = 0; k < coupled.size(); ++k) {
        for (const int i : coupled[k]) later_[k].push_back(place_[static_cast<std::size_t>(i)]);
        std::ranges::sort(later_[k]);
    }
}

template <std::size_t N>
void BlockLu<N>::analyze(int count, const std::vector<std::array<int, 2>>& pairs)
{
    order(count, pairs);
    upper_.assign(later_.size(), 0);
    lower_.assign(later_.size(), 0);
    std::size_t size = later_.size();
    for (std::size_t k = 0; k < later_.size(); ++k) {
        upper_[k] = size;
        lower_[k] = size + later_[k].size();
        size += 2 * later_[k].size();
    }
    blocks_.assign(size, Block{});
    const auto find = [this](int row, int column) {
        if (row == column) return static_cast<std::size_t>(row);
        const auto k = static_cast<std::size_t>(std::min(row, column));
        const auto& list = later_[k];
        const auto at = std::ranges::lower_bound(list, std::max(row, column)) - list.begin();
        return (row < column ? upper_[k] : lower_[k]) + static_cast<std::size_t>(at);
    };
    pairs_.clear();
    for (const auto& [i, j] : pairs) {
        const int row = place_[static_cast<std::size_t>(i)];
        const int column = place_[static_cast<std::size_t>(j)];
        pairs_.push_back({find(row, column), find(column, row)});
    }
    targets_.clear();
    for (const auto& list : later_) {
        for (const int row : list) {
            for (const int column : list) {
                targets_.push_back(static_cast<std::uint32_t>(find(row, column)));
            }
        }
    }
}

template <std::size_t N>
void BlockLu<N>::clear()
{
    std::ranges::fill(blocks_, Block{});
}

template <std::size_t N>
bool BlockLu<N>::factor()
{
    std::vector<double> sizes(later_.size());
    for (std::size_t k = 0; k < sizes.size(); ++k) sizes[k] = largest<N>(blocks_[k]);
    const std::uint32_t* target = targets_.data();
    for (std::size_t k = 0; k < later_.size(); ++k) {
        if (!invert(blocks_[k], sizes[k])) return false;
        const std::size_t count = later_[k].size();
        for (std::size_t a = 0; a < count; ++a) {
            Block& left = blocks_[lower_[k] + a];
            left = product<N>(left, blocks_[k]);
            for (std::size_t b = 0; b < count; ++b) {
                const Block change = product<N>(left, blocks_[upper_[k] + b]);
                Block& at = blocks_[*target++];
                for (std::size_t c = 0; c < N * N; ++c) at[c] -= change[c];
            }
        }
    }
    return true;
}

template <std::size_t N>
std::array<Eigen::Index, N> BlockLu<N>::coordinates(std::size_t i) const
{
    const auto k = static_cast<Eigen::Index>(i);
    if constexpr (N == 2) {
        return {2 * k, 2 * k + 1};
    } else {
        return {2 * k, 2 * k + 1, 2 * static_cast<Eigen::Index>(place_.size()) + k};
    }
}

template <std::size_t N>
Eigen::VectorXd BlockLu<N>::solve(const Eigen::VectorXd& right) const
{
    std::vector<std::array<double, N>> x(place_.size());
    for (std::size_t i = 0; i < place_.size(); ++i) {
        const auto from = coordinates(i);
        auto& to = x[static_cast<std::size_t>(place_[i])];
        for (std::size_t c = 0; c < N; ++c) to[c] = right[from[c]];
    }
    for (std::size_t k = 0; k < later_.size(); ++k) {
        const std::array<double, N> own = x[k];
        for (std::size_t a = 0; a < later_[k].size(); ++a) {
            subtract_product<N>(x[static_cast<std::size_t>(later_[k][a])], blocks_[lower_[k] + a],
                                own);
        }
    }
    for (std::size_t k = later_.size(); k-- > 0;) {
        std::array<double, N> y = x[k];
        for (std::size_t a = 0; a < later_[k].size(); ++a) {
            subtract_product<N>(y, blocks_[upper_[k] + a],
                                x[static_cast<std::size_t>(later_[k][a])]);
        }
        const Block& d = blocks_[k];
        for (std::size_t row = 0; row < N; ++row) {
            double sum = d[N * row] * y[0];
            for (std::size_t c = 1; c < N; ++c) sum += d[N * row + c] * y[c];
            x[k][row] = sum;
        }
    }
    Eigen::VectorXd out(right.size());
    for (std::size_t i = 0; i < place_.size(); ++i) {
        const auto to = coordinates(i);
        const auto& from = x[static_cast<std::size_t>(place_[i])];
        for (std::size_t c = 0; c < N; ++c) out[to[c]] = from[c];
    }
    return out;
}

template class BlockLu<2>;
template class BlockLu<3>;

}  // namespace ricochet::detail
