// The cells from which ordinary bodies can touch a big one: a ring around its edge, since no body
// is inside it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "scene/cells.hpp"

namespace ricochet::detail {

class Rings {
public:
    /// Starts without rings, in the cells of that grid. A ring holds while its body is within
    /// `play` [m] along each axis of the place where the ring was laid; ordinary bodies are no
    /// larger than `radius`, and no farther than `outside` [m] from their cell along each axis.
    void size(const Cells& cells, double radius, double play, double outside)
    {
        rings_.clear();
        nodes_.clear();
        free_ = none;
        heads_.clear();
        radius_ = radius;
        play_ = play;
        // Includes the diagonals, and the rounding of both.
        reach_ = 1.5 * (play + outside) + 1e-3 * cells.side();
    }

    [[nodiscard]] bool empty() const noexcept { return rings_.empty(); }
    [[nodiscard]] double play() const noexcept { return play_; }

    /// Number of cells across the ring of a body.
    [[nodiscard]] double across(const Cells& cells, double radius) const noexcept
    {
        return 2 * outer(radius) / cells.side() + 2;
    }
    /// Adds a ring that is not laid yet. Returns its number.
    std::uint32_t add(double radius)
    {
        rings_.push_back({{}, outer(radius), 0.999 * radius - reach_});
        return static_cast<std::uint32_t>(rings_.size() - 1);
    }
    [[nodiscard]] const Vector2& middle(std::uint32_t ring) const noexcept
    {
        return rings_[ring].at;
    }
    [[nodiscard]] bool holds(std::uint32_t ring, const Vector2& p) const noexcept
    {
        const Vector2 moved = p - rings_[ring].at;
        return std::fabs(moved[0]) <= play_ && std::fabs(moved[1]) <= play_;
    }

    void lay(const Cells& cells, std::uint32_t ring, std::uint32_t body, const Vector2& at)
    {
        if (heads_.empty()) heads_.assign(cells.buckets(), none);
        rings_[ring].at = at;
        each_bucket(cells, ring, [&](std::uint32_t bucket) {
            std::uint32_t node = free_;
            if (node == none) {
                node = static_cast<std::uint32_t>(nodes_.size());
                nodes_.emplace_back();
            } else {
                free_ = nodes_[node].next;
            }
            nodes_[node] = {body, heads_[bucket]};
            heads_[bucket] = node;
        });
    }
    void lift(const Cells& cells, std::uint32_t ring, std::uint32_t body)
    {
        each_bucket(cells, ring, [&](std::uint32_t bucket) {
            std::uint32_t* link = &heads_[bucket];
            while (nodes_[*link].body != body) link = &nodes_[*link].next;
            const std::uint32_t node = *link;
            *link = nodes_[node].next;
            nodes_[node].next = free_;
            free_ = node;
        });
    }

    /// Visits the big bodies whose rings lie on a bucket.
    template <class Visit>
    void each_on(std::uint32_t bucket, const Visit& visit) const
    {
        for (std::uint32_t n = heads_[bucket]; n != none; n = nodes_[n].next) visit(nodes_[n].body);
    }

    /// Visits the buckets of the cells of a ring, which depend only on the place where it was laid.
    /// No bucket comes twice on a torus of at least `across` cells a side.
    template <class Visit>
    void each_bucket(const Cells& cells, std::uint32_t ring, const Visit& visit) const
    {
        const auto& [at, outer, inner] = rings_[ring];
        const double side = cells.side();
        const auto low = cells.cell_of({at[0], at[1] - outer}).y;
        const auto high = cells.cell_of({at[0], at[1] + outer}).y;
        for (std::int64_t y = low; y <= high; ++y) {
            const double below = static_cast<double>(y) * side - at[1];
            const double above = below + side;
            const double near = below > 0 ? below : above < 0 ? -above : 0;
            const double far = std::max(std::fabs(below), std::fabs(above));
            const double wide = std::sqrt(std::max(outer * outer - near * near, 0.0));
            const std::int64_t from = cells.cell_of({at[0] - wide, at[1]}).x;
            const std::int64_t to = cells.cell_of({at[0] + wide, at[1]}).x;
            // Cells with all corners inside are left out.
            std::int64_t hole = to + 1;
            std::int64_t resume = to + 1;
            if (inner > far) {
                const double open = std::sqrt(inner * inner - far * far);
                hole = cells.cell_of({at[0] - open, at[1]}).x + 1;
                resume = std::max(hole, cells.cell_of({at[0] + open, at[1]}).x);
            }
            for (std::int64_t x = from; x < hole; ++x) visit(cells.bucket_of(x, y));
            for (std::int64_t x = resume; x <= to; ++x) visit(cells.bucket_of(x, y));
        }
    }

private:
    [[nodiscard]] double outer(double radius) const noexcept
    {
        return 1.001 * (radius + radius_) + reach_;
    }

    struct Ring {
        Vector2 at{};
        double outer = 0, inner = 0;  ///< [m]
    };
    struct Node {
        std::uint32_t body = none;
        std::uint32_t next = none;
    };
    std::vector<Ring> rings_;
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> heads_;  ///< of each bucket, where there are rings
    std::uint32_t free_ = none;
    double radius_ = 0, play_ = 0, reach_ = 0;
};

}  // namespace ricochet::detail
