// Determines which bodies and surfaces a body can touch before it leaves its cell.
//
// Bodies of ordinary size lie in cells of one grid. Big ones, where there are any, meet each other
// in a second one, and ordinary bodies where their rings lie on the first. Terrain has squares of
// its own, whose sizes follow the terrain. The choice of tests costs time, and changes no bit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "scene/cells.hpp"
#include "scene/face_tree.hpp"
#include "scene/rings.hpp"
#include "scene/world.hpp"

namespace ricochet::detail {

/// Up to this number of bodies there are no cells: testing all pairs costs less than the crossings
/// from cell to cell.
inline constexpr std::size_t few_bodies = 16;

/// Cost of a crossing from cell to cell, without the tests in the new cells, relative to a test for
/// a first contact. Measured: 60 ns and 20 ns.
inline constexpr double crossing_cost = 3;

/// The fewest cells along a period: two bodies in neighbouring cells are then nearer to each other
/// than to any image.
inline constexpr std::uint32_t fewest_periodic = 4;

/// Bodies of a group [m]: the box around them, and how large they are.
struct Box {
    Vector2 extent{};
    double largest = 0;  ///< radius
    double count = 0;
    double area = 0;      ///< [m^2] of the box or, where most of it is empty, as if the bodies were
                          ///< everywhere as dense as they find it around them
    bool uneven = false;  ///< the second
};
[[nodiscard]] Box box_of(const World& world, std::span<const std::uint32_t> members,
                         std::span<const Vector2> places);
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
    /// Makes empty grids for these bodies at these places, marking the big ones. `steps`: some
    /// bodies advance by steps, and may lie a tenth of a cell outside theirs.
    void size(World& world, std::span<const std::uint32_t> members, std::span<const Vector2> places,
              bool steps);
    /// Lays the squares of terrain, for the same bodies.
    void lay_terrain(const World& world, std::span<const std::uint32_t> members);

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
    [[nodiscard]] Square square_of(const Body& body, std::uint32_t i,
                                   const Cells::Cell& cell) const noexcept
    {
        if (body.big) {
            const Vector2 play{rings_.play(), rings_.play()};
            const Vector2& middle = rings_.middle(ring_of_[i]);
            return {middle - play, middle + play};
        }
        const Vector2& sides = cells_.sides();
        const Vector2 low{static_cast<double>(cell.x) * sides[0],
                          static_cast<double>(cell.y) * sides[1]};
        return {low, low + sides};
    }
    /// [m] Side of the cells of ordinary bodies.
    [[nodiscard]] double side() const noexcept { return cells_.side(); }
    /// [m] Distance by which bodies that advance by steps may lie outside it.
    [[nodiscard]] double outside() const noexcept { return 0.1 * cells_.side(); }

    /// Visits the bodies that a body can touch, and itself.
    template <class Visit>
    void each_near(const std::vector<Body>& bodies, std::uint32_t i, const Cells::Cell& cell,
                   const Visit& visit) const
    {
        const Cells& own = bodies[i].big ? big_cells_ : cells_;
        own.each_around(cell, bodies, bodies[i].radius > 0, visit);
        if (rings_.empty()) return;
        if (!bodies[i].big) return rings_.each_on(bodies[i].bucket, visit);
        rings_.each_bucket(cells_, ring_of_[i], [&](std::uint32_t bucket) {
            cells_.each_in(bucket, bodies, true, visit);
        });
    }
    /// Visits the bodies that one of ordinary size can touch after entering a cell from a side.
    template <class Visit>
    void each_ahead(const std::vector<Body>& bodies, std::uint32_t i, const Cells::Cell& cell,
                    int x, int y, const Visit& visit) const
    {
        for (int k = -1; k <= 1; ++k) {
            const std::uint32_t bucket = cells_.bucket_of(x != 0 ? cell.x + x : cell.x + k,
                                                          y != 0 ? cell.y + y : cell.y + k);
            cells_.each_in(bucket, bodies, bodies[i].radius > 0, visit);
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
    /// The squares of terrain for a body.
    [[nodiscard]] FaceTree& terrain(const Body& body) noexcept
    {
        return body.big ? terrain_of_big_ : terrain_;
    }
    [[nodiscard]] const FaceTree& terrain(const Body& body) const noexcept
    {
        return body.big ? terrain_of_big_ : terrain_;
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
    FaceTree terrain_, terrain_of_big_;
};

}  // namespace ricochet::detail
