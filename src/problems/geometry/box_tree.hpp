// A tree of boxes around many small items, for nearest-neighbour queries.
//
// The items are ordered so that neighbours are near one another; then four of them make a block,
// four blocks a node, four nodes the node above, and so on. Position alone determines the tree, so
// there are no pointers, and four boxes are compared with a query together.
//
// The nearest item so far bounds the search, so it pays to begin with a good guess: with the answer
// of the previous query, little more than the path to the new answer is opened. The guess decides
// what is opened, never what is found.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace ricochet::geometry {

/// An axis-parallel box; empty until something is put in.
template <std::size_t Dim>
struct Box {
    std::array<double, Dim> lower = filled(std::numeric_limits<double>::infinity());
    std::array<double, Dim> upper = filled(-std::numeric_limits<double>::infinity());

    constexpr void add(const std::array<double, Dim>& point) noexcept
    {
        for (std::size_t k = 0; k < Dim; ++k) {
            lower[k] = std::min(lower[k], point[k]);
            upper[k] = std::max(upper[k], point[k]);
        }
    }
    constexpr void add(const Box& box) noexcept
    {
        for (std::size_t k = 0; k < Dim; ++k) {
            lower[k] = std::min(lower[k], box.lower[k]);
            upper[k] = std::max(upper[k], box.upper[k]);
        }
    }
    constexpr void widen(double by) noexcept
    {
        for (double& value : lower) value -= by;
        for (double& value : upper) value += by;
    }
    /// The largest magnitude of a coordinate.
    [[nodiscard]] constexpr double reach() const noexcept
    {
        double out = 0;
        for (const double value : lower) out = std::max(out, value < 0 ? -value : value);
        for (const double value : upper) out = std::max(out, value < 0 ? -value : value);
        return out;
    }

private:
    static constexpr std::array<double, Dim> filled(double value) noexcept
    {
        std::array<double, Dim> out{};
        out.fill(value);
        return out;
    }
};

/// Four boxes; one coordinate of all of them is contiguous.
template <std::size_t Dim>
struct alignas(32) FourBoxes {
    double lower[Dim][4];
    double upper[Dim][4];
};

/// Squares of distances between a box and four, rounded down a little. In pairs, for which
/// every machine has registers.
template <std::size_t Dim>
[[gnu::always_inline]] inline std::array<double, 4> squared_distances(
    const FourBoxes<Dim>& boxes, const std::array<double, Dim>& lower,
    const std::array<double, Dim>& upper) noexcept
{
    typedef double Pair __attribute__((vector_size(16), may_alias));
    const auto load = [](const double* from) { return *reinterpret_cast<const Pair*>(from); };
    const Pair zero{};
    Pair sum[2]{};
    for (std::size_t k = 0; k < Dim; ++k) {
        for (std::size_t i = 0; i < 2; ++i) {
            const Pair below = load(boxes.lower[k] + 2 * i) - upper[k];
            const Pair above = lower[k] - load(boxes.upper[k] + 2 * i);
            const Pair outside = below > above ? below : above;
            const Pair gap = outside > zero ? outside : zero;
            sum[i] += gap * gap;
        }
    }
    sum[0] *= 1 - 1e-14;
    sum[1] *= 1 - 1e-14;
    return {sum[0][0], sum[0][1], sum[1][0], sum[1][1]};
}

template <std::size_t Dim>
class BoxTree {
public:
    BoxTree() = default;

    /// Builds a tree over boxes, one for each item. They are widened by 1e-14 of the largest
    /// coordinate, so that a distance computed from an item's corners is never, by rounding, less
    /// than the distance to its box.
    explicit BoxTree(std::vector<Box<Dim>> boxes)
    {
        double reach = 0;
        for (const Box<Dim>& box : boxes) reach = std::max(reach, box.reach());
        for (Box<Dim>& box : boxes) box.widen(1e-14 * reach);
        order_.resize(boxes.size());
        for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<std::uint32_t>(i);
        sort(boxes, order_);
        build(boxes);
    }

    /// The items in the order of the tree: block b holds places 4 b to 4 b + 3.
    [[nodiscard]] const std::vector<std::uint32_t>& order() const noexcept { return order_; }

    /// The box around everything.
    [[nodiscard]] const Box<Dim>& bounds() const noexcept { return bounds_; }

    /// Number of levels of nodes: level 0 holds the boxes of the blocks, the last is one node. The
    /// four children of node i are the nodes 4 i to 4 i + 3 on the level below.
    [[nodiscard]] std::size_t levels() const noexcept { return levels_.size(); }
    [[nodiscard]] const std::vector<FourBoxes<Dim>>& level(std::size_t i) const noexcept
    {
        return levels_[i];
    }

    /// Opens all blocks that may hold an item at a squared distance of at most `best`, nearer ones
    /// first. `bound(four)` gives lower bounds for four boxes; `open(first, last)` examines the
    /// places of a block, and lowers `best`. `best` must be finite.
    template <class Bound, class Open>
    void search(double& best, const Bound& bound, const Open& open) const
    {
        if (levels_.empty()) return;
        // Each level leaves at most three nodes waiting, and there are at most 16 levels. Bounds
        // and nodes are separate arrays, because a struct written in parts is slow to read as a
        // whole.
        std::array<double, 64> bounds;
        std::array<std::uint64_t, 64> nodes;  // level and place in it
        constexpr std::uint64_t level_one = std::uint64_t{1} << 32U;
        std::size_t count = 1;
        bounds[0] = 0;
        nodes[0] = level_one * levels_.size();
        while (count > 0) {
            --count;
            if (bounds[count] > best) continue;
            const std::uint64_t node = nodes[count];
            const auto index = static_cast<std::size_t>(node % level_one);
            if (node < level_one) {
                open(4 * index, std::min(4 * index + 4, order_.size()));
                continue;
            }
            const std::array<double, 4> below = bound(levels_[node / level_one - 1][index]);
            const std::uint64_t first = node - level_one + 3 * index;  // a level down, at 4 index
            std::size_t nearest = count;
            for (std::size_t i = 0; i < 4; ++i) {
                bounds[count] = below[i];
                nodes[count] = first + i;
                nearest = below[i] < bounds[nearest] ? count : nearest;
                count += below[i] <= best ? 1 : 0;
            }
            if (nearest + 1 < count) {  // so that it is opened next
                std::swap(bounds[nearest], bounds[count - 1]);
                std::swap(nodes[nearest], nodes[count - 1]);
            }
        }
    }

private:
    /// Splits at multiples of powers of four, so that every block and node is compact.
    static void sort(const std::vector<Box<Dim>>& boxes, std::span<std::uint32_t> range)
    {
        if (range.size() <= 4) return;
        Box<Dim> centres;
        for (const std::uint32_t i : range) centres.add(twice_centre(boxes[i]));
        std::size_t axis = 0;
        for (std::size_t k = 1; k < Dim; ++k) {
            if (centres.upper[k] - centres.lower[k] > centres.upper[axis] - centres.lower[axis]) {
                axis = k;
            }
        }
        std::size_t unit = 4;
        while (4 * unit < range.size()) unit *= 4;
        const std::size_t units = (range.size() + unit - 1) / unit;
        const std::size_t half = (units + 1) / 2 * unit;
        std::nth_element(range.begin(), range.begin() + static_cast<std::ptrdiff_t>(half),
                         range.end(), [&](std::uint32_t a, std::uint32_t b) {
                             const double left = twice_centre(boxes[a])[axis];
                             const double right = twice_centre(boxes[b])[axis];
                             return left < right || (left == right && a < b);
                         });
        sort(boxes, range.first(half));
        sort(boxes, range.subspan(half));
    }

    static std::array<double, Dim> twice_centre(const Box<Dim>& box) noexcept
    {
        std::array<double, Dim> out{};
        for (std::size_t k = 0; k < Dim; ++k) out[k] = box.lower[k] + box.upper[k];
        return out;
    }

    void build(const std::vector<Box<Dim>>& boxes)
    {
        std::vector<Box<Dim>> below;
        for (std::size_t i = 0; i < order_.size(); ++i) {
            if (i % 4 == 0) below.emplace_back();
            below.back().add(boxes[order_[i]]);
            bounds_.add(boxes[order_[i]]);
        }
        while (!below.empty()) {
            std::vector<FourBoxes<Dim>> level;
            std::vector<Box<Dim>> above;
            for (std::size_t i = 0; i < below.size(); i += 4) {
                level.push_back(four(std::span(below).subspan(i)));
                above.emplace_back();
                for (std::size_t j = i; j < std::min(i + 4, below.size()); ++j) {
                    above.back().add(below[j]);
                }
            }
            levels_.push_back(std::move(level));
            if (above.size() == 1) break;
            below = std::move(above);
        }
    }

    /// The first four boxes; missing ones are infinitely far away.
    static FourBoxes<Dim> four(std::span<const Box<Dim>> boxes)
    {
        FourBoxes<Dim> out;
        for (std::size_t i = 0; i < 4; ++i) {
            const Box<Dim> box = i < boxes.size() ? boxes[i] : Box<Dim>{};
            for (std::size_t k = 0; k < Dim; ++k) {
                out.lower[k][i] = box.lower[k];
                out.upper[k][i] = box.upper[k];
            }
        }
        return out;
    }

    std::vector<std::uint32_t> order_;
    std::vector<std::vector<FourBoxes<Dim>>> levels_;  ///< [0] holds the boxes of the blocks
    Box<Dim> bounds_;
};

}  // namespace ricochet::geometry
