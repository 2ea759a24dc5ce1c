// A closed polygon as the wall of a room or the edge of an obstacle.
#pragma once

#include <cstdint>
#include <vector>

#include "segments.hpp"

namespace ricochet::geometry {

/// The edges of a polygon that does not cross itself, with the side that each point is on.
///
/// Edge i goes from vertex i to the next, the last back to the first. Distances are
/// positive inside. Near a vertex the side is that of the sum of the normals of its two edges,
/// which is right wherever the vertex is the nearest point (Baerentzen and Aanaes 2005, in
/// the plane).
class Outline {
public:
    /// The vertices in turn, either way round. Whether edges cross is not examined.
    /// @throws std::invalid_argument for fewer than three vertices, for none that enclose
    /// an area, or naming the vertex that is not finite or the same as the one before.
    explicit Outline(const std::vector<Point2>& vertices);

    /// A chain of segments that returns to its start.
    /// @throws std::invalid_argument as above, or naming the segment that does not start where
    /// the one before it ends: the polygon is open there.
    [[nodiscard]] static Outline from_segments(const std::vector<Segment2>& chain);

    [[nodiscard]] const Segments& edges() const noexcept { return edges_; }

    /// `found.distance` with the sign of the side that p is on; `found` is the nearest to p.
    [[nodiscard]] double signed_distance(Point2 p, const NearestOnSegment& found) const noexcept
    {
        const bool at_first = found.along <= 0;
        const bool at_second = found.along >= 1;
        const Point2 normal = at_first    ? vertex_normals_[found.segment]
                              : at_second ? vertex_normals_[next(found.segment)]
                                          : edge_normals_[found.segment];
        return dot(p - found.point, normal) < 0 ? -found.distance : found.distance;
    }

    /// Normal of an edge, into the polygon, of unit length.
    [[nodiscard]] Point2 edge_normal(std::uint32_t edge) const noexcept
    {
        return edge_normals_[edge];
    }

private:
    [[nodiscard]] std::size_t next(std::uint32_t edge) const noexcept
    {
        return edge + 1 < vertex_normals_.size() ? edge + 1 : 0;
    }

    Segments edges_;
    std::vector<Point2> edge_normals_;
    std::vector<Point2> vertex_normals_;  ///< at the first end of each edge; of any length
};

}  // namespace ricochet::geometry
