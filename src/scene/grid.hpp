// Determines which bodies and surfaces a body can touch before it leaves its cell.
//
// Bodies of ordinary size lie in cells of one grid. Big ones, where there are any, meet each other
// in a second one, and ordinary bodies where their rings lie on the first. The choice of tests
// costs time, and changes no bit.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scene/cells.hpp"
#include "scene/rings.hpp"
#include "scene/world.hpp"

namespace ricochet::detail {

/// Bodies of a group [m]: the box around them, and how large they are.
struct Box {
    Vector2 extent{};
    double largest = 0;  ///< radius
    double count = 0;
};
/// [m] Side of cells for `count` bodies of at most this radius in an area: either that of two
/// bodies, or the side with some 0.4 bodies in each cell. Measured at an area fraction of 0.3, that
/// is 1.2 times as fast as one body in each.
[[nodiscard]] inline double side_of(double area, double count, double radius, double slack)
{
    return std::max(2 * radius * slack, 0.65 * std::sqrt(area / count));
}
/// The radius above which bodies are big: the largest of all where a second grid does not pay.
/// `slack`: the least side of a cell, in diameters.
[[nodiscard]] double largest_ordinary(const World& world, std::span<const std::uint32_t> members,
                                      const Box& box, double slack);

class Grid {
public:
    /// Makes empty grids for these bodies, marking the big ones, and for all faces. `steps`: some
    /// bodies advance by steps, and may lie a tenth of a cell outside theirs.
    void size(World& world, std::span<const std::uint32_t> members, bool steps);

    /// Returns the cell.
    Cells::Cell insert(std::vector<Body>& bodies, std::uint32_t i, const Vector2& p);
    /// Moves a body from its cell to its present place.
    void move(std::vector<Body>& bodies, std::uint32_t i, Cells::Cell& cell, const Vector2& p);
    /// Moves a body from its cell into a neighbour.
    void step(std::vector<Body>& bodies, std::uint32_t i, Cells::Cell& cell, int x, int y)
    {
        cells_.remove(bodies, i);
        cell.x += x;
        cell.y += y;
        cells_.insert(bodies, i, cell);
    }
    /// Lays the ring of a big body at its present place.
    void lay_again(std::vector<Body>& bodies, std::uint32_t i, Cells::Cell& cell, const Vector2& p);

    /// A square that a body must leave before it can touch bodies outside `each_near`.
    struct Square {
        Vector2 low{};
        double side = 0;
    };
    [[nodiscard]] Square square_of(const Body& body, std::uint32_t i,
                                   const Cells::Cell& cell) const noexcept
    {
        if (body.big) {
            const double play = rings_.play();
            return {rings_.middle(ring_of_[i]) - Vector2{play, play}, 2 * play};
        }
        const double side = cells_.side();
        return {{static_cast<double>(cell.x) * side, static_cast<double>(cell.y) * side}, side};
    }
    /// [m] Distance by which bodies that advance by steps may lie outside it.
    [[nodiscard]] double outside() const noexcept { return 0.1 * cells_.side(); }

    /// Visits the bodies that a body can touch, and itself.
    template <class Visit>
    void each_near(const std::vector<Body>& bodies, std::uint32_t i, const Cells::Cell& cell,
                   const Visit& visit) const
    {
        const Cells& own = bodies[i].big ? big_cells_ : cells_;
        own.each_around(cell, bodies, visit);
        if (rings_.empty()) return;
        if (!bodies[i].big) return rings_.each_on(bodies[i].bucket, visit);
        rings_.each_bucket(cells_, ring_of_[i],
                           [&](std::uint32_t bucket) { cells_.each_in(bucket, bodies, visit); });
    }
    /// Visits the bodies that one of ordinary size can touch after entering a cell from a side.
    template <class Visit>
    void each_ahead(const std::vector<Body>& bodies, std::uint32_t i, const Cells::Cell& cell,
                    int x, int y, const Visit& visit) const
    {
        for (int k = -1; k <= 1; ++k) {
            const std::uint32_t bucket = cells_.bucket_of(x != 0 ? cell.x + x : cell.x + k,
                                                          y != 0 ? cell.y + y : cell.y + k);
            cells_.each_in(bucket, bodies, visit);
        }
        if (!rings_.empty()) rings_.each_on(bodies[i].bucket, visit);
    }

    /// Whether no body of ordinary size in this cell can touch a wall. Always false where a wall is
    /// not along an axis.
    [[nodiscard]] bool is_away_from_walls(const Cells::Cell& cell) const noexcept
    {
        const auto& [low, high] = away_;
        return (cell.x >= low.x) & (cell.x <= high.x) & (cell.y >= low.y) & (cell.y <= high.y);
    }
    [[nodiscard]] bool any_faces() const noexcept { return cells_.any_faces(); }
    /// The faces that a body can touch.
    [[nodiscard]] const std::vector<std::uint32_t>& faces(const Body& body) const noexcept
    {
        return (body.big ? big_cells_ : cells_).faces(body.bucket);
    }
    /// Visits the faces that it can touch from the cells around its own, too.
    template <class Visit>
    void each_face_near(const Body& body, const Cells::Cell& cell, const Visit& visit) const
    {
        const Cells& own = body.big ? big_cells_ : cells_;
        own.around(cell, [&](std::uint32_t bucket) {
            for (const std::uint32_t face : own.faces(bucket)) visit(face);
        });
    }

private:
    void size_big(const World& world, std::span<const std::uint32_t> members, const Box& box);
    void find_cells_away(const World& world, double reach);

    struct Range {
        Cells::Cell low, high;  ///< both included
    };
    Cells cells_;
    Range away_;  ///< cells from which no wall can be touched
    Cells big_cells_;
    Rings rings_;
    std::vector<std::uint32_t> ring_of_;  ///< of each body, where there are big ones
};

}  // namespace ricochet::detail
