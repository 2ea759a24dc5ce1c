#include "outline.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace ricochet::geometry {

namespace {

std::vector<Segment2> closed(const std::vector<Point2>& vertices)
{
    const std::size_t n = vertices.size();
    if (n < 3) {
        throw std::invalid_argument(
            fmt::format("Outline: a polygon needs at least 3 vertices, got {}", n));
    }
    for (std::size_t i = 0; i < n; ++i) {
        const auto [x, y] = vertices[i];
        if (!std::isfinite(x) || !std::isfinite(y)) {
            throw std::invalid_argument(
                fmt::format("Outline: vertex {} must be finite, got ({}, {})", i, x, y));
        }
        const Point2 before = vertices[(i + n - 1) % n];
        if (before.x == x && before.y == y) {
            throw std::invalid_argument(fmt::format(
                "Outline: vertex {} must differ from the one before it, both are ({}, {})", i, x,
                y));
        }
    }
    std::vector<Segment2> edges(n);
    for (std::size_t i = 0; i < n; ++i) edges[i] = {vertices[i], vertices[(i + 1) % n]};
    return edges;
}

/// Twice the area, positive for vertices in counterclockwise order.
double twice_area(const std::vector<Point2>& vertices)
{
    double sum = 0;
    const Point2 origin = vertices[0];
    for (std::size_t i = 1; i + 1 < vertices.size(); ++i) {
        sum += cross(vertices[i] - origin, vertices[i + 1] - origin);
    }
    return sum;
}

}  // namespace

Outline::Outline(const std::vector<Point2>& vertices) : edges_(closed(vertices))
{
    const double area = twice_area(vertices);
    if (!(area > 0) && !(area < 0)) {
        throw std::invalid_argument(
            fmt::format("Outline: the polygon must enclose an area, got {}", area / 2));
    }
    const double turn = area > 0 ? 1 : -1;
    const std::size_t n = vertices.size();
    for (std::size_t i = 0; i < n; ++i) {
        const Point2 d = edges_[i].b - edges_[i].a;
        const double length = std::hypot(d.x, d.y);
        edge_normals_.push_back({-turn * d.y / length, turn * d.x / length});
    }
    for (std::size_t i = 0; i < n; ++i) {
        vertex_normals_.push_back(edge_normals_[i] + edge_normals_[(i + n - 1) % n]);
    }
}

Outline Outline::from_segments(const std::vector<Segment2>& chain)
{
    std::vector<Point2> vertices;
    for (std::size_t i = 0; i < chain.size(); ++i) {
        const std::size_t before = (i + chain.size() - 1) % chain.size();
        const Point2 end = chain[before].b;
        const Point2 start = chain[i].a;
        if (end.x != start.x || end.y != start.y) {
            throw std::invalid_argument(fmt::format(
                "Outline: the polygon is open; segment {} starts at ({}, {}), but segment {} ends "
                "at ({}, {})",
                i, start.x, start.y, before, end.x, end.y));
        }
        vertices.push_back(start);
    }
    return Outline(vertices);
}

}  // namespace ricochet::geometry
