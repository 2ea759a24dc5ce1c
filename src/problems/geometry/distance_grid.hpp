// A table of lower bounds of a distance.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <vector>

#include "box_tree.hpp"

namespace ricochet::geometry {

/// Lower bounds of a function that changes by at most 1 per unit of length, such as a
/// distance, signed or not: its value at the centre of the cell less the distance to there.
template <std::size_t Dim>
class DistanceGrid {
public:
    using Point = std::array<double, Dim>;

    DistanceGrid() = default;

    /// Tabulates `distance` in `cells` cells along each side of `box`; its values may be wrong by
    /// `error`.
    /// @throws std::invalid_argument for 0 cells, or a box without a volume.
    template <class Distance>
    DistanceGrid(const Box<Dim>& box, std::size_t cells, double error, const Distance& distance)
        : box_(box), cells_(cells)
    {
        if (cells == 0) throw std::invalid_argument("DistanceGrid: there must be a cell");
        std::size_t count = 1;
        for (std::size_t k = 0; k < Dim; ++k) {
            side_[k] = (box.upper[k] - box.lower[k]) / static_cast<double>(cells);
            per_length_[k] = 1 / side_[k];
            if (!(side_[k] > 0) || !std::isfinite(per_length_[k])) {
                throw std::invalid_argument("DistanceGrid: the box must have a volume");
            }
            count *= cells;
            half_diagonal_ += 0.25 * side_[k] * side_[k];
        }
        half_diagonal_ = std::sqrt(half_diagonal_) * (1 + 1e-9);  // allows for the rounding of p
        values_.reserve(count);
        for (std::size_t i = 0; i < count; ++i) {
            values_.push_back(rounded_down(distance(centre(i)) - error));
        }
    }

    [[nodiscard]] std::size_t size() const noexcept { return values_.size(); }

    /// A lower bound at p: -infinity outside of the box, and where p is not a number.
    [[nodiscard]] double lower_bound(const Point& p) const noexcept
    {
        std::size_t index = 0;
        double squared = 0;
        for (std::size_t k = Dim; k-- > 0;) {
            const double place = (p[k] - box_.lower[k]) * per_length_[k];
            if (!(place >= 0 && place < static_cast<double>(cells_))) {
                return -std::numeric_limits<double>::infinity();
            }
            const auto cell = static_cast<std::size_t>(place);
            index = index * cells_ + cell;
            const double offset = p[k] - centre(k, cell);
            squared += offset * offset;
        }
        return static_cast<double>(values_[index]) - std::sqrt(squared);
    }

    /// A lower bound for the whole cell of p: less than `lower_bound`, and cheaper by a square
    /// root.
    [[nodiscard]] double lower_bound_of_cell(const Point& p) const noexcept
    {
        std::size_t index = 0;
        for (std::size_t k = Dim; k-- > 0;) {
            const double place = (p[k] - box_.lower[k]) * per_length_[k];
            if (!(place >= 0 && place < static_cast<double>(cells_))) {
                return -std::numeric_limits<double>::infinity();
            }
            index = index * cells_ + static_cast<std::size_t>(place);
        }
        return static_cast<double>(values_[index]) - half_diagonal_;
    }

private:
    [[nodiscard]] double centre(std::size_t axis, std::size_t cell) const noexcept
    {
        return box_.lower[axis] + (static_cast<double>(cell) + 0.5) * side_[axis];
    }
    [[nodiscard]] Point centre(std::size_t index) const noexcept
    {
        Point out{};
        for (std::size_t k = 0; k < Dim; ++k, index /= cells_) out[k] = centre(k, index % cells_);
        return out;
    }
    static float rounded_down(double value) noexcept
    {
        const auto near = static_cast<float>(value);
        return near <= value ? near : std::nextafter(near, -std::numeric_limits<float>::infinity());
    }

    Box<Dim> box_;
    std::size_t cells_ = 0;
    std::array<double, Dim> side_{};
    std::array<double, Dim> per_length_{};
    double half_diagonal_ = 0;
    std::vector<float> values_;
};

}  // namespace ricochet::geometry
