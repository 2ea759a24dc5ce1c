// Chains of segments from surfaces that end where others begin. A body that touches a corner passes
// it by the same rules, whether the two sides of the corner belong to one surface or each is a
// surface of its own.
#include <map>

#include "scene/motion.hpp"
#include "scene/world.hpp"

namespace ricochet::detail {

namespace {

/// Open terrain as it is stored among the faces: segments at every second place from `first`.
struct Chain {
    const std::vector<Vector2>* points = nullptr;
    std::uint32_t first = 0;
    bool reversed = false;
    bool oriented = false;

    [[nodiscard]] std::uint32_t segments() const
    {
        return static_cast<std::uint32_t>(points->size() - 1);
    }
    /// The segment at its start (0) or end (1), in the order of its points.
    [[nodiscard]] std::uint32_t at_end(int end) const
    {
        return first + (end == 0 ? 0 : 2 * (segments() - 1));
    }
    /// Direction from that end to the adjacent point.
    [[nodiscard]] Vector2 into(int end) const
    {
        const std::size_t last = points->size() - 1;
        return end == 0 ? (*points)[1] - (*points)[0] : (*points)[last - 1] - (*points)[last];
    }
};

struct End {
    std::size_t chain = 0;
    int end = 0;
};

class Joiner {
public:
    Joiner(const Scene& scene, std::uint32_t wall_count, std::vector<Face>& faces) : faces_(faces)
    {
        std::uint32_t first = wall_count;
        for (const Scene::Surface& surface : scene.surfaces()) {
            if (surface.is_wall || surface.is_arc() || moves(surface.motion)) continue;
            const auto count = static_cast<std::uint32_t>(surface.points.size());
            const bool closed = surface.points.front() == surface.points.back();
            if (!closed) chains_.push_back({.points = &surface.points, .first = first});
            first += closed ? 2 * (count - 1) : 2 * count - 1;
        }
    }

    void join()
    {
        std::map<Vector2, std::vector<End>> places;
        for (std::size_t k = 0; k < chains_.size(); ++k) {
            places[chains_[k].points->front()].push_back({k, 0});
            places[chains_[k].points->back()].push_back({k, 1});
        }
        partners_.assign(chains_.size(), {none_, none_});
        for (const auto& [point, ends] : places) {
            // Where three meet, none of them continues in a single other one.
            if (ends.size() != 2 || folds_back(ends[0], ends[1])) continue;
            for (const int side : {0, 1}) {
                const auto& [chain, end] = ends[static_cast<std::size_t>(side)];
                partners_[chain][static_cast<std::size_t>(end)] =
                    ends[static_cast<std::size_t>(1 - side)];
            }
        }
        for (std::size_t k = 0; k < chains_.size(); ++k) orient_from(k);
        for (Chain& chain : chains_) {
            if (chain.reversed) reverse(chain);
        }
        for (std::size_t k = 0; k < chains_.size(); ++k) link(k);
    }

private:
    /// Two segments that lie upon each other have no corner.
    [[nodiscard]] bool folds_back(const End& a, const End& b) const
    {
        const Vector2 first = chains_[a.chain].into(a.end);
        const Vector2 second = chains_[b.chain].into(b.end);
        const double sizes = norm(first) * norm(second);
        return dot(first, second) > 0 && std::fabs(dot(turned(first), second)) <= 1e-12 * sizes;
    }

    /// Orients all chains joined with it so that the end of each is the start of the next.
    void orient_from(std::size_t start)
    {
        std::vector<std::size_t> reached;
        const auto reach = [&](std::size_t chain, bool reversed) {
            if (chains_[chain].oriented) return;
            chains_[chain].oriented = true;
            chains_[chain].reversed = reversed;
            reached.push_back(chain);
        };
        reach(start, false);
        while (!reached.empty()) {
            const std::size_t chain = reached.back();
            reached.pop_back();
            for (const int end : {0, 1}) {
                const End& other = partners_[chain][static_cast<std::size_t>(end)];
                if (other.chain == nowhere) continue;
                const bool leads_out = (end == 1) != chains_[chain].reversed;
                reach(other.chain, (other.end == 0) != leads_out);
            }
        }
    }

    void reverse(const Chain& chain)
    {
        for (std::uint32_t k = 0; k < chain.segments(); ++k) {
            Face& face = faces_[chain.first + 2 * k];
            face.at = (*chain.points)[k + 1];
            face.normal = -1.0 * face.normal;
            std::swap(face.previous, face.next);
        }
    }

    void link(std::size_t chain)
    {
        for (const int end : {0, 1}) {
            const End& other = partners_[chain][static_cast<std::size_t>(end)];
            if (other.chain == nowhere) continue;
            Face& face = faces_[chains_[chain].at_end(end)];
            const bool leads_out = (end == 1) != chains_[chain].reversed;
            (leads_out ? face.next : face.previous) = chains_[other.chain].at_end(other.end);
        }
    }

    static constexpr std::size_t nowhere = ~std::size_t{0};
    static constexpr End none_{nowhere, 0};
    std::vector<Face>& faces_;
    std::vector<Chain> chains_;
    std::vector<std::array<End, 2>> partners_;
};

}  // namespace

void join_chains(const Scene& scene, std::uint32_t wall_count, std::vector<Face>& faces)
{
    Joiner(scene, wall_count, faces).join();
}

}  // namespace ricochet::detail
