// A grid of cells over the whole plane, folded onto a torus: a body far away may share its bucket
// with one that is near, which costs a test but changes no result. Points have lists of their own,
// since they do not meet each other.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "scene/world.hpp"

namespace ricochet::detail {

class Cells {
public:
    Cells() = default;

    /// Makes empty cells with this side. The numbers of buckets are powers of two. `points`:
    /// whether there are any.
    void size(double side, std::uint32_t buckets_x, std::uint32_t buckets_y, bool points)
    {
        size({side, side}, buckets_x, buckets_y, points);
    }
    /// The same with other sides along x and y.
    void size(const Vector2& sides, std::uint32_t buckets_x, std::uint32_t buckets_y, bool points)
    {
        sides_ = sides;
        inverse_ = {1 / sides[0], 1 / sides[1]};
        mask_x_ = buckets_x - 1;
        mask_y_ = buckets_y - 1;
        width_ = buckets_x;
        heads_.assign(static_cast<std::size_t>(buckets_x) * buckets_y, none);
        point_heads_.assign(points ? heads_.size() : 0, none);
    }

    struct Cell {
        std::int64_t x = 0, y = 0;
        friend bool operator==(const Cell&, const Cell&) = default;
    };
    [[nodiscard]] Cell cell_of(const Vector2& p) const noexcept
    {
        return {static_cast<std::int64_t>(std::floor(p[0] * inverse_[0])),
                static_cast<std::int64_t>(std::floor(p[1] * inverse_[1]))};
    }
    [[nodiscard]] std::uint32_t bucket_of(std::int64_t x, std::int64_t y) const noexcept
    {
        return (static_cast<std::uint32_t>(x) & mask_x_) +
               width_ * (static_cast<std::uint32_t>(y) & mask_y_);
    }
    [[nodiscard]] double side() const noexcept { return sides_[0]; }
    [[nodiscard]] const Vector2& sides() const noexcept { return sides_; }

    void insert(std::vector<Body>& bodies, std::uint32_t i, const Cell& cell)
    {
        const std::uint32_t bucket = bucket_of(cell.x, cell.y);
        Body& body = bodies[i];
        body.bucket = bucket;
        body.previous = none;
        std::uint32_t& head = heads_of(body)[bucket];
        body.next = head;
        if (body.next != none) bodies[body.next].previous = i;
        head = i;
    }
    void remove(std::vector<Body>& bodies, std::uint32_t i)
    {
        Body& body = bodies[i];
        std::uint32_t& link =
            body.previous == none ? heads_of(body)[body.bucket] : bodies[body.previous].next;
        link = body.next;
        if (body.next != none) bodies[body.next].previous = body.previous;
    }
    [[nodiscard]] std::size_t buckets() const noexcept { return heads_.size(); }

    /// Visits the cell and its neighbours.
    template <class Visit>
    void around(const Cell& cell, const Visit& visit) const
    {
        const auto column = static_cast<std::uint32_t>(cell.x);
        const auto row = static_cast<std::uint32_t>(cell.y);
        const std::array<std::uint32_t, 3> rows{width_ * ((row - 1) & mask_y_),
                                                width_ * (row & mask_y_),
                                                width_ * ((row + 1) & mask_y_)};
        for (std::uint32_t x = column - 1; x != column + 2; ++x) {
            for (const std::uint32_t y : rows) visit((x & mask_x_) + y);
        }
    }
    /// Visits the bodies in the cell and its neighbours: the first of each, then the second of
    /// each, and so on. The ends of short lists are branches that cannot be predicted, and this
    /// order has the fewest. `points`: whether points are visited, too.
    template <class Visit>
    void each_around(const Cell& cell, const std::vector<Body>& bodies, bool points,
                     const Visit& visit) const
    {
        each_of(heads_, cell, bodies, visit);
        if (points && !point_heads_.empty()) each_of(point_heads_, cell, bodies, visit);
    }
    /// Visits the bodies in a bucket.
    template <class Visit>
    void each_in(std::uint32_t bucket, const std::vector<Body>& bodies, bool points,
                 const Visit& visit) const
    {
        for (std::uint32_t j = heads_[bucket]; j != none; j = bodies[j].next) visit(j);
        if (!points || point_heads_.empty()) return;
        for (std::uint32_t j = point_heads_[bucket]; j != none; j = bodies[j].next) visit(j);
    }

private:
    using Heads = std::vector<std::uint32_t>;  ///< the first body of each bucket

    [[nodiscard]] Heads& heads_of(const Body& body) noexcept
    {
        return body.radius == 0 ? point_heads_ : heads_;
    }
    template <class Visit>
    void each_of(const Heads& heads, const Cell& cell, const std::vector<Body>& bodies,
                 const Visit& visit) const
    {
        std::array<std::uint32_t, 9> layer;
        std::size_t count = 0;
        around(cell, [&](std::uint32_t bucket) {
            layer[count] = heads[bucket];
            count += layer[count] != none ? 1 : 0;
        });
        while (count > 0) {
            std::size_t deeper = 0;
            for (std::size_t k = 0; k < count; ++k) {
                const std::uint32_t j = layer[k];
                layer[deeper] = bodies[j].next;
                deeper += layer[deeper] != none ? 1 : 0;
                visit(j);
            }
            count = deeper;
        }
    }
    Vector2 sides_{1, 1};
    Vector2 inverse_{1, 1};
    std::uint32_t mask_x_ = 0, mask_y_ = 0, width_ = 1;
    Heads heads_, point_heads_;
};

}  // namespace ricochet::detail
