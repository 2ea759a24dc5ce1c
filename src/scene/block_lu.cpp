#include "scene/block_lu.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace ricochet::detail {

namespace {

/// A pivot that shrinks below this fraction has lost the digits that the iterations need.
constexpr double least_pivot = 1e-13;

using Block = BlockLu::Block;

[[nodiscard]] Block product(const Block& a, const Block& b) noexcept
{
    return {a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3], a[2] * b[0] + a[3] * b[2],
            a[2] * b[1] + a[3] * b[3]};
}

[[nodiscard]] double largest(const Block& a) noexcept
{
    return std::max({std::abs(a[0]), std::abs(a[1]), std::abs(a[2]), std::abs(a[3])});
}

/// a <- a^-1 by the adjugate, which is as exact as a is well-conditioned.
[[nodiscard]] bool invert(Block& a, double before) noexcept
{
    const double determinant = a[0] * a[3] - a[1] * a[2];
    const double size = largest(a);
    if (!(std::abs(determinant) > least_pivot * size * before)) return false;
    const double inverse = 1 / determinant;
    a = {a[3] * inverse, -a[1] * inverse, -a[2] * inverse, a[0] * inverse};
    return std::isfinite(inverse);
}

}  // namespace

/// Orders rows by least degree; all rows that a row is coupled with become coupled.
void BlockLu::order(int count, const std::vector<std::array<int, 2>>& pairs)
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

void BlockLu::analyze(int count, const std::vector<std::array<int, 2>>& pairs)
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

void BlockLu::clear()
{
    std::ranges::fill(blocks_, Block{});
}

bool BlockLu::factor()
{
    std::vector<double> sizes(later_.size());
    for (std::size_t k = 0; k < sizes.size(); ++k) sizes[k] = largest(blocks_[k]);
    const std::uint32_t* target = targets_.data();
    for (std::size_t k = 0; k < later_.size(); ++k) {
        if (!invert(blocks_[k], sizes[k])) return false;
        const std::size_t count = later_[k].size();
        for (std::size_t a = 0; a < count; ++a) {
            Block& left = blocks_[lower_[k] + a];
            left = product(left, blocks_[k]);
            for (std::size_t b = 0; b < count; ++b) {
                const Block change = product(left, blocks_[upper_[k] + b]);
                Block& at = blocks_[*target++];
                for (std::size_t c = 0; c < 4; ++c) at[c] -= change[c];
            }
        }
    }
    return true;
}

Eigen::VectorXd BlockLu::solve(const Eigen::VectorXd& right) const
{
    Eigen::VectorXd x(right.size());
    for (std::size_t i = 0; i < place_.size(); ++i) {
        x.segment<2>(2 * place_[i]) = right.segment<2>(2 * static_cast<Eigen::Index>(i));
    }
    for (std::size_t k = 0; k < later_.size(); ++k) {
        const double x0 = x[2 * static_cast<Eigen::Index>(k)];
        const double x1 = x[2 * static_cast<Eigen::Index>(k) + 1];
        for (std::size_t a = 0; a < later_[k].size(); ++a) {
            const Block& m = blocks_[lower_[k] + a];
            x[2 * later_[k][a]] -= m[0] * x0 + m[1] * x1;
            x[2 * later_[k][a] + 1] -= m[2] * x0 + m[3] * x1;
        }
    }
    for (std::size_t k = later_.size(); k-- > 0;) {
        double y0 = x[2 * static_cast<Eigen::Index>(k)];
        double y1 = x[2 * static_cast<Eigen::Index>(k) + 1];
        for (std::size_t a = 0; a < later_[k].size(); ++a) {
            const Block& m = blocks_[upper_[k] + a];
            const double x0 = x[2 * later_[k][a]];
            const double x1 = x[2 * later_[k][a] + 1];
            y0 -= m[0] * x0 + m[1] * x1;
            y1 -= m[2] * x0 + m[3] * x1;
        }
        const Block& d = blocks_[k];
        x[2 * static_cast<Eigen::Index>(k)] = d[0] * y0 + d[1] * y1;
        x[2 * static_cast<Eigen::Index>(k) + 1] = d[2] * y0 + d[3] * y1;
    }
    Eigen::VectorXd out(right.size());
    for (std::size_t i = 0; i < place_.size(); ++i) {
        out.segment<2>(2 * static_cast<Eigen::Index>(i)) = x.segment<2>(2 * place_[i]);
    }
    return out;
}

}  // namespace ricochet::detail
