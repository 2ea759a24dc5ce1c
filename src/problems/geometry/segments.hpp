// Nearest-neighbour queries among segments in the plane, for a point or another segment.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "box_tree.hpp"

namespace ricochet::geometry {

struct Point2 {
    double x = 0;
    double y = 0;
};

[[nodiscard]] constexpr Point2 operator-(Point2 a, Point2 b) noexcept
{
    return {a.x - b.x, a.y - b.y};
}
[[nodiscard]] constexpr Point2 operator+(Point2 a, Point2 b) noexcept
{
    return {a.x + b.x, a.y + b.y};
}
[[nodiscard]] constexpr Point2 operator*(double s, Point2 a) noexcept
{
    return {s * a.x, s * a.y};
}
[[nodiscard]] constexpr double dot(Point2 a, Point2 b) noexcept
{
    return a.x * b.x + a.y * b.y;
}
/// The third component of the cross product.
[[nodiscard]] constexpr double cross(Point2 a, Point2 b) noexcept
{
    return a.x * b.y - a.y * b.x;
}

struct Segment2 {
    Point2 a;
    Point2 b;
};

/// The point of a segment that is nearest to another point.
struct NearestOnSegment {
    std::uint32_t segment = 0;  ///< index of the segment
    double distance = 0;
    double along = 0;  ///< 0 at its first end, 1 at its second
    Point2 point;
};

/// The nearest points of two segments, one of them out of many.
struct NearestPair {
    std::uint32_t segment = 0;  ///< index of the other segment
    double distance = 0;        ///< 0 where they cross
    Point2 point;               ///< on the query segment
    Point2 other;               ///< on the other segment
};

/// Fixed segments of positive length.
///
/// `nearest` searches the tree, `nearest_brute` examines every segment; both return the same bits.
/// Of several segments at the same distance, both return the first.
class Segments {
public:
    /// @throws std::invalid_argument if there is none, or naming the segment that has no
    /// length, an end that is not finite or a length that is not.
    explicit Segments(const std::vector<Segment2>& segments);

    [[nodiscard]] std::size_t size() const noexcept { return segments_.size(); }
    [[nodiscard]] const Segment2& operator[](std::size_t i) const noexcept { return segments_[i]; }
    [[nodiscard]] const Box<2>& bounds() const noexcept { return tree_.bounds(); }

    /// The nearest segment to p. `hint` is a segment that may be near. A point that is not a number
    /// has distance NaN from segment 0; a point so far away that squares overflow has distance
    /// infinity.
    [[nodiscard]] NearestOnSegment nearest(Point2 p, std::uint32_t hint = 0) const noexcept;
    [[nodiscard]] NearestOnSegment nearest_brute(Point2 p) const noexcept;

    /// The nearest segment to s, if it is nearer than `limit`; otherwise only the distance is set,
    /// to `limit`.
    [[nodiscard]] NearestPair nearest(const Segment2& s, double limit,
                                      std::uint32_t hint = 0) const noexcept;
    [[nodiscard]] NearestPair nearest_brute(const Segment2& s, double limit) const noexcept;

private:
    /// Ends, directions and 1 / length², in separate arrays, padded with copies of the last
    /// segment.
    struct Columns {
        std::vector<double> ax, ay, dx, dy, inverse;
        void append(const Segment2& s);
        [[nodiscard]] double squared_distance(std::size_t i, Point2 p) const noexcept;
        [[nodiscard]] std::array<double, 4> four_squared_distances(
            std::size_t first, const Segment2& s) const noexcept;
        [[nodiscard]] std::array<double, 4> four_squared_distances(std::size_t first,
                                                                   Point2 p) const noexcept;
    };

    [[nodiscard]] NearestOnSegment at(std::uint32_t segment, double squared,
                                      Point2 p) const noexcept;

    [[nodiscard]] NearestPair pair_at(std::uint32_t segment, double squared,
                                      const Segment2& s) const noexcept;

    std::vector<Segment2> segments_;
    Columns given_;   ///< in the order given
    Columns sorted_;  ///< in the order of the tree
    BoxTree<2> tree_;
};

/// The nearest points of two segments; where they cross, a common point at distance 0.
[[nodiscard]] NearestPair nearest_points(const Segment2& s, const Segment2& other) noexcept;

}  // namespace ricochet::geometry
