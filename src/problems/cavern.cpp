#include "problems/cavern.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "base/require.hpp"
#include "last_answer.hpp"
#include "problems/geometry/distance_grid.hpp"
#include "problems/geometry/outline.hpp"
#include "ricochet/base/detail/splitmix.hpp"

namespace ricochet {

using geometry::NearestOnSegment;
using geometry::Outline;
using geometry::Point2;

namespace {

struct Question {
    Point2 p{};
    Cavern::Search search{};
};
using Last = detail::LastAnswers<Question, NearestOnSegment>;

constexpr int waves = 24;

/// Distance of the wall from the origin: size (1 + sum of waves), at least 0.4 size before stones
/// are added.
std::vector<Point2> random_wall(const Cavern::Parameters& p)
{
    detail::require(p.segments >= 8, "Cavern", "segments", "be at least 8",
                    static_cast<double>(p.segments));
    detail::require_positive("Cavern", "size", p.size);
    detail::SplitMix random(p.seed);
    std::array<double, waves> height{};
    std::array<double, waves> phase{};
    double sum = 0;
    for (std::size_t k = 0; k < waves; ++k) {
        height[k] = random.uniform(0.3, 1) / (1.0 + static_cast<double>(k));
        phase[k] = random.uniform(0, 2 * std::numbers::pi);
        sum += height[k];
    }
    const double step = 2 * std::numbers::pi / static_cast<double>(p.segments);
    std::vector<Point2> wall(p.segments);
    for (std::size_t i = 0; i < wall.size(); ++i) {
        const double angle = step * static_cast<double>(i);
        double distance = 1;
        for (std::size_t k = 0; k < waves; ++k) {
            distance +=
                0.6 * height[k] / sum * std::cos(static_cast<double>(k + 1) * angle + phase[k]);
        }
        distance += random.uniform(-0.2, 0.2) * std::min(step, 0.5);  // stones
        wall[i] = {p.size * distance * std::cos(angle), p.size * distance * std::sin(angle)};
    }
    return wall;
}

void check(const Cavern::Parameters& p)
{
    detail::require_positive("Cavern", "radius", p.radius);
    detail::require_not_negative("Cavern", "gravity", p.gravity);
    detail::require_finite("Cavern", "turn", p.turn);
    detail::require_positive("Cavern", "drag", p.drag);
    detail::require(p.restitution >= 0 && p.restitution <= 1, "Cavern", "restitution",
                    "lie in [0, 1]", p.restitution);
    detail::require_not_negative("Cavern", "launch_speed", p.launch_speed);
    const double top = std::max(std::sqrt(p.gravity / p.drag), p.launch_speed);
    detail::require(p.kick >= 0 && p.kick <= top, "Cavern", "kick",
                    fmt::format("lie in [0, {}], the top speed", top), p.kick);
}

}  // namespace

/// Data shared by all copies of a cavern.
struct Cavern::Rock {
    explicit Rock(const std::vector<Point2>& vertices) : wall(vertices) {}

    Outline wall;
    std::optional<geometry::DistanceGrid<2>> table{};
    mutable Last last{};
};

Cavern::Cavern(const Parameters& parameters)
    : Cavern(parameters, std::make_shared<Rock>(random_wall(parameters)))
{
}

Cavern::Cavern(const Parameters& parameters, const std::vector<Point2>& wall)
    : Cavern(parameters, std::make_shared<Rock>(wall))
{
    given_ = true;
}

Cavern::Cavern(const Parameters& parameters, std::shared_ptr<const Rock> rock)
    : p_(parameters),
      top_speed_(std::max(std::sqrt(p_.gravity / p_.drag), p_.launch_speed)),
      rock_(std::move(rock))
{
    check(p_);
    const NearestOnSegment found = nearest(p_.search, {0, 0});
    const double room = rock_->wall.signed_distance({0, 0}, found);
    if (!(room > p_.radius)) {
        throw std::invalid_argument(
            fmt::format("Cavern: the ball of radius {} does not fit at the origin, where the wall "
                        "is at distance {} (segment {})",
                        p_.radius, room, found.segment));
    }
    if (p_.grid == 0) return;
    auto with_table = std::make_shared<Rock>(*rock_);
    const geometry::Box<2>& box = rock_->wall.edges().bounds();
    std::uint32_t hint = 0;
    // Rounding of a distance is a few units in the last place of the coordinates.
    with_table->table.emplace(box, p_.grid, 1e-14 * box.reach(), [&](const auto& point) {
        const Point2 p{point[0], point[1]};
        const NearestOnSegment nearest = rock_->wall.edges().nearest(p, hint);
        hint = nearest.segment;
        return rock_->wall.signed_distance(p, nearest);
    });
    rock_ = std::move(with_table);
}

NearestOnSegment Cavern::nearest(Search search, Point2 p) const noexcept
{
    Last::Loan last(rock_->last);
    if (last->known && last->question.p.x == p.x && last->question.p.y == p.y &&
        last->question.search == search) {
        return last->answer;
    }
    const std::uint32_t hint = last->known ? last->answer.segment : 0;
    const geometry::Segments& edges = rock_->wall.edges();
    const NearestOnSegment found =
        search == Search::tree ? edges.nearest(p, hint) : edges.nearest_brute(p);
    *last.operator->() = {true, {p, search}, found};
    return found;
}

double Cavern::clearance(Search search, Point2 p) const noexcept
{
    return rock_->wall.signed_distance(p, nearest(search, p)) - p_.radius;
}

Point2 Cavern::inward(Point2 p) const noexcept
{
    const NearestOnSegment found = nearest(p_.search, p);
    const double distance = rock_->wall.signed_distance(p, found);
    if (distance == 0) return rock_->wall.edge_normal(found.segment);
    return (1 / distance) * (p - found.point);
}

Point2 Cavern::rebound(Point2 normal, Point2 v) const noexcept
{
    const double onto = dot(v, normal);
    const Point2 along = v - onto * normal;
    const double allowed = std::sqrt(std::max(top_speed_ * top_speed_ - dot(along, along), 0.0));
    const double away = std::max(-p_.restitution * onto, std::min(p_.kick, allowed));
    return along + away * normal;
}

double Cavern::rounding() const noexcept
{
    return 1e-13 * rock_->wall.edges().bounds().reach();
}

std::optional<double> Cavern::parameter(std::string_view of) const noexcept
{
    if (of == "radius") return p_.radius;
    if (of == "gravity") return p_.gravity;
    if (of == "turn") return p_.turn;
    if (of == "drag") return p_.drag;
    if (of == "restitution") return p_.restitution;
    if (of == "kick") return p_.kick;
    if (of == "launch") return p_.launch_speed;
    if (given_) return std::nullopt;
    if (of == "segments") return static_cast<double>(p_.segments);
    if (of == "seed") return static_cast<double>(p_.seed);
    if (of == "size") return p_.size;
    return std::nullopt;
}

double Cavern::tabulated(Point2 p) const noexcept
{
    if (!rock_->table) return -std::numeric_limits<double>::infinity();
    return rock_->table->lower_bound({p.x, p.y}) - p_.radius;
}

}  // namespace ricochet
