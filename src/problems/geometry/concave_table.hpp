// A table of a concave function, which bounds it from both sides everywhere.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "box_tree.hpp"

namespace ricochet::geometry {

/// A concave function f at a point x, and one of its tangents there:
/// f(y) <= value + slope (y - x) for all y.
template <std::size_t Dim>
struct Tangent {
    double value = 0;
    std::array<double, Dim> slope{};
};

/// Bounds of a concave function from its values and tangents at the nodes of a grid.
///
/// *From below.* A point is a convex combination of corners of its cell, and a concave function is
/// at least the same combination of its values there. The corners are those of a simplex: the order
/// of the components of the point within the cell determines in which order to walk from the lowest
/// corner to the highest (Kuhn 1960, "Some combinatorial lemmas in topology").
///
/// *From above.* The tangents at the same corners.
///
/// Both errors are of the order of the squared side of a cell, where f is smooth. The smallest
/// eigenvalue of a symmetric matrix that is affine in x is concave, as is every least of
/// concave functions.
template <std::size_t Dim>
class ConcaveTable {
public:
    using Point = std::array<double, Dim>;
    static constexpr std::size_t most_nodes = std::size_t{1} << 24;

    ConcaveTable() = default;

    /// Asks for tangents of f at the (cells + 1)^Dim nodes in `box`.
    /// @param f      Point -> Tangent<Dim>
    /// @param error  of its values: f lies between value - error and the tangent + error
    /// @throws std::invalid_argument for 0 cells, more than `most_nodes` nodes, a box without a
    ///         volume, or a value or slope that is not finite, naming the node.
    template <class Function>
    ConcaveTable(const Box<Dim>& box, std::size_t cells, double error, const Function& f)
        : box_(box), cells_(cells)
    {
        if (cells == 0) throw std::invalid_argument("ConcaveTable: there must be a cell");
        std::size_t count = 1;
        for (std::size_t k = 0; k < Dim; ++k) {
            side_[k] = (box.upper[k] - box.lower[k]) / static_cast<double>(cells);
            per_length_[k] = 1 / side_[k];
            if (!(side_[k] > 0) || !std::isfinite(per_length_[k])) {
                throw std::invalid_argument("ConcaveTable: the box must have a volume");
            }
            stride_[k] = count;
            if (cells >= most_nodes / count) {
                throw std::invalid_argument("ConcaveTable: more than 2^24 nodes");
            }
            count *= cells + 1;
        }
        nodes_.reserve(count);
        double size = 0;
        for (std::size_t i = 0; i < count; ++i) {
            nodes_.push_back(f(node(i)));
            double here = std::fabs(nodes_.back().value);
            for (std::size_t k = 0; k < Dim; ++k) {
                here += std::fabs(nodes_.back().slope[k]) * (box.upper[k] - box.lower[k]);
            }
            if (!std::isfinite(here)) {
                throw std::invalid_argument("ConcaveTable: the function is not finite at node " +
                                            std::to_string(i));
            }
            size = std::max(size, here);
        }
        // Allows for a few roundings each of place, weights and sums.
        slack_ = error + 64 * std::numeric_limits<double>::epsilon() * size;
    }

    [[nodiscard]] std::size_t size() const noexcept { return nodes_.size(); }

    /// -infinity outside of the box, and where p is not a number.
    [[nodiscard]] double lower_bound(const Point& p) const noexcept
    {
        Walk walk;
        if (!enter(p, walk)) return -std::numeric_limits<double>::infinity();
        double sum = 0;
        double before = 1;
        for (std::size_t k = 0; k < Dim; ++k) {
            const double share = walk.offset[walk.axis[k]];
            sum += (before - share) * nodes_[walk.index].value;
            before = share;
            walk.index += stride_[walk.axis[k]];
        }
        return sum + before * nodes_[walk.index].value - slack_;
    }

    /// +infinity outside of the box, and where p is not a number.
    [[nodiscard]] double upper_bound(const Point& p) const noexcept
    {
        double least = std::numeric_limits<double>::infinity();
        Walk walk;
        if (!enter(p, walk)) return least;
        Point place = walk.offset;  // from the corner, in cells
        for (std::size_t k = 0;; ++k) {
            const Tangent<Dim>& at = nodes_[walk.index];
            double value = at.value;
            for (std::size_t j = 0; j < Dim; ++j) value += at.slope[j] * side_[j] * place[j];
            least = std::min(least, value);
            if (k == Dim) return least + slack_;
            place[walk.axis[k]] -= 1;
            walk.index += stride_[walk.axis[k]];
        }
    }

private:
    /// Order of the axes along which to walk from the lowest corner of a cell: largest offset
    /// first.
    struct Walk {
        std::size_t index = 0;
        Point offset{};  ///< of p, in [0, 1]
        std::array<std::size_t, Dim> axis{};
    };

    [[nodiscard]] bool enter(const Point& p, Walk& walk) const noexcept
    {
        for (std::size_t k = 0; k < Dim; ++k) {
            const double place = (p[k] - box_.lower[k]) * per_length_[k];
            if (!(place >= 0 && place < static_cast<double>(cells_))) return false;
            const auto cell = static_cast<std::size_t>(place);
            walk.offset[k] = place - static_cast<double>(cell);
            walk.index += cell * stride_[k];
            std::size_t j = k;
            for (; j > 0 && walk.offset[k] > walk.offset[walk.axis[j - 1]]; --j) {
                walk.axis[j] = walk.axis[j - 1];
            }
            walk.axis[j] = k;
        }
        return true;
    }

    [[nodiscard]] Point node(std::size_t index) const noexcept
    {
        Point out{};
        for (std::size_t k = 0; k < Dim; ++k, index /= cells_ + 1) {
            out[k] = box_.lower[k] + static_cast<double>(index % (cells_ + 1)) * side_[k];
        }
        return out;
    }

    Box<Dim> box_;
    std::size_t cells_ = 0;
    std::array<std::size_t, Dim> stride_{};
    std::array<double, Dim> side_{};
    std::array<double, Dim> per_length_{};
    double slack_ = 0;
    std::vector<Tangent<Dim>> nodes_;
};

}  // namespace ricochet::geometry
