#include "problems/planar_arm.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
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

using geometry::NearestPair;
using geometry::Outline;
using geometry::Point2;
using geometry::Segment2;

namespace {

constexpr std::size_t most = ArmScene::most_joints;
constexpr double infinity = std::numeric_limits<double>::infinity();

struct Question {
    std::array<double, most> angles{};
    ArmScene::Search search{};
};
struct Answer {
    ArmScene::Contact contact{};
    std::array<std::uint32_t, most> edges{};  ///< hints: the edge nearest to each link
};
using Last = detail::LastAnswers<Question, Answer>;
using LastTorques = detail::LastAnswers<double, std::array<double, most>>;

/// The ends of the links; the first is the base.
std::array<Point2, most + 1> ends(const double* angles, std::size_t n, double length) noexcept
{
    std::array<Point2, most + 1> out{};
    double absolute = 0;
    for (std::size_t i = 0; i < n; ++i) {
        absolute += angles[i];
        out[i + 1] = out[i] + length * Point2{std::cos(absolute), std::sin(absolute)};
    }
    return out;
}

std::vector<Point2> octagon(Point2 centre, double radius, double turn)
{
    std::vector<Point2> out;
    for (int k = 0; k < 8; ++k) {
        const double angle = turn + k * std::numbers::pi / 4;
        out.push_back(centre + radius * Point2{std::cos(angle), std::sin(angle)});
    }
    return out;
}

/// The distance between a link and one polygon; 0 if it lies within.
double distance_to(const Outline& polygon, const Segment2& link)
{
    const double between = polygon.edges().nearest_brute(link, infinity).distance;
    const auto found = polygon.edges().nearest_brute(link.a);
    return polygon.signed_distance(link.a, found) > 0 ? 0 : between;
}

}  // namespace

/// Data shared by all copies of an arm.
struct ArmScene::Place {
    explicit Place(const std::vector<Segment2>& all) : edges(all) {}

    geometry::Segments edges;
    std::optional<geometry::DistanceGrid<2>> table{};
    mutable Last last{};
    mutable LastTorques last_torques{};
};

ArmScene::ArmScene(const Parameters& parameters, std::size_t joints)
    : p_(parameters), n_(joints), link_(p_.reach / static_cast<double>(joints))
{
    check();
    detail::require(p_.obstacles >= 1 && p_.obstacles <= 1000, "PlanarArm", "obstacles",
                    "lie in [1, 1000]", static_cast<double>(p_.obstacles));
    choose_joints();
    // Octagons between a quarter and the whole of the reach, not around the arm at its start.
    detail::SplitMix random(p_.seed + 1000);
    const double largest =
        0.6 * p_.reach / std::sqrt(static_cast<double>(std::max<std::size_t>(p_.obstacles, 8)));
    std::array<double, most> folded{};
    for (std::size_t i = 0; i < n_; ++i) folded[i] = start_angle(i);
    const auto at_start = ends(folded.data(), n_, link_);
    std::vector<std::vector<Point2>> octagons;
    for (std::size_t tries = 0; octagons.size() < p_.obstacles; ++tries) {
        if (tries > 1000 * p_.obstacles) {
            throw std::invalid_argument("PlanarArm: there is no room for so many obstacles");
        }
        const double distance = p_.reach * std::sqrt(random.uniform(0.06, 1.2));
        const double angle = random.uniform(0, 2 * std::numbers::pi);
        const double radius = largest * random.uniform(0.25, 0.6);
        const Point2 centre = distance * Point2{std::cos(angle), std::sin(angle)};
        const double turn = random.uniform(0, 1);
        bool free = true;
        for (std::size_t i = 0; i < n_; ++i) {
            const Segment2 here{centre, centre + Point2{1e-9 * radius, 0}};
            const double gap =
                geometry::nearest_points({at_start[i], at_start[i + 1]}, here).distance;
            free = free && gap > radius + 2 * p_.clearance;
        }
        if (free) octagons.push_back(octagon(centre, radius, turn));
    }
    place(octagons);
}

ArmScene::ArmScene(const Parameters& parameters, std::size_t joints,
                   const std::vector<std::vector<Point2>>& obstacles)
    : p_(parameters), n_(joints), link_(p_.reach / static_cast<double>(joints))
{
    check();
    choose_joints();
    place(obstacles);
    given_ = true;
}

void ArmScene::check() const
{
    constexpr std::string_view self = "PlanarArm";
    detail::require(n_ >= 1 && n_ <= most, self, "joints", "lie in [1, 8]",
                    static_cast<double>(n_));
    detail::require_positive(self, "reach", p_.reach);
    detail::require_positive(self, "clearance", p_.clearance);
    detail::require_positive(self, "drive", p_.drive);
    detail::require_positive(self, "damping", p_.damping);
    detail::require(p_.restitution >= 0 && p_.restitution <= 1, self, "restitution",
                    "lie in [0, 1]", p_.restitution);
    const double top = 0.8 * p_.drive / p_.damping;
    detail::require(p_.least_rate > 0 && p_.least_rate <= top, self, "least_rate",
                    fmt::format("be positive and at most {}", top), p_.least_rate);
    detail::require(p_.discs >= 1 && p_.discs <= 64, self, "discs", "lie in [1, 64]",
                    static_cast<double>(p_.discs));
}

void ArmScene::choose_joints()
{
    detail::SplitMix random(p_.seed);
    for (std::size_t i = 0; i < n_; ++i) {
        Joint& joint = joints_[i];
        joint.middle = i == 0 ? 0.4 : (i % 2 == 0 ? -1.0 : 1.0) * random.uniform(0.6, 1.2);
        joint.drive = 0.7 * p_.drive * random.uniform(0.8, 1);
        joint.spring = 0.3 * p_.drive * random.uniform(0.8, 1);
        joint.frequency = random.uniform(0.3, 1.1);
        joint.phase = random.uniform(0, 2 * std::numbers::pi);
    }
}

void ArmScene::place(const std::vector<std::vector<Point2>>& obstacles)
{
    if (obstacles.empty()) throw std::invalid_argument("PlanarArm: there is no obstacle");
    std::array<double, most> angles{};
    for (std::size_t i = 0; i < n_; ++i) angles[i] = start_angle(i);
    const auto joints = ends(angles.data(), n_, link_);

    std::vector<Segment2> edges;
    std::vector<Outline> outlines;
    for (std::size_t k = 0; k < obstacles.size(); ++k) {
        try {
            outlines.emplace_back(obstacles[k]);
        } catch (const std::invalid_argument& error) {
            throw std::invalid_argument(fmt::format("PlanarArm: obstacle {}: {}", k, error.what()));
        }
        for (std::size_t i = 0; i < n_; ++i) {
            const double gap = distance_to(outlines[k], {joints[i], joints[i + 1]});
            if (gap > p_.clearance) continue;
            throw std::invalid_argument(
                fmt::format("PlanarArm: obstacle {} must leave link {} free at the start, with a "
                            "clearance of {}; it is at distance {}",
                            k, i, p_.clearance, gap));
        }
        for (std::size_t i = 0; i < outlines[k].edges().size(); ++i) {
            edges.push_back(outlines[k].edges()[i]);
        }
    }

    auto place = std::make_shared<Place>(edges);
    if (p_.grid > 0) {
        geometry::Box<2> box;
        box.add(std::array{-p_.reach, -p_.reach});
        box.add(std::array{p_.reach, p_.reach});
        box.widen(1e-9 * p_.reach);
        // Distances to the edges, whichever side: 1-Lipschitz, and what the guard examines.
        place->table.emplace(box, p_.grid, 1e-14 * p_.reach, [&](const auto& at) {
            return place->edges.nearest({at[0], at[1]}).distance;
        });
    }
    place_ = std::move(place);
}

std::array<double, ArmScene::most_joints> ArmScene::torques(double t) const noexcept
{
    LastTorques::Loan last(place_->last_torques);
    if (!last->known || last->question != t) {
        for (std::size_t i = 0; i < n_; ++i) {
            const Joint& j = joints_[i];
            last->answer[i] = j.drive * std::sin(j.frequency * t + j.phase);
        }
        last->known = true;
        last->question = t;
    }
    return last->answer;
}

ArmScene::Contact ArmScene::contact(Search search, const double* angles) const noexcept
{
    Last::Loan last(place_->last);
    if (last->known && last->question.search == search &&
        std::equal(angles, angles + n_, last->question.angles.begin())) {
        return last->answer.contact;
    }
    const auto joints = ends(angles, n_, link_);
    Contact best{.distance = infinity, .link = 0, .point = {}, .normal = {}};
    NearestPair nearest;
    // The link that was nearest before goes first, so that it bounds the search for the others.
    const std::uint32_t first = last->answer.contact.link < n_ ? last->answer.contact.link : 0;
    for (std::uint32_t k = 0; k < n_; ++k) {
        const std::uint32_t link = k == 0 ? first : k <= first ? k - 1 : k;
        const Segment2 s{joints[link], joints[link + 1]};
        std::uint32_t& hint = last->answer.edges[link];
        // Slightly above the smallest distance so far, so that of equally near links the first is
        // kept.
        const double limit = best.distance * (1 + 1e-15);
        if (search == Search::tree && k > 0 && lower_bound_of(s) > limit) continue;
        const NearestPair found = search == Search::tree ? place_->edges.nearest(s, limit, hint)
                                                         : place_->edges.nearest_brute(s, limit);
        if (std::isnan(found.distance)) {
            best.distance = found.distance;
            break;
        }
        if (found.distance >= limit) continue;
        hint = found.segment;
        if (found.distance < best.distance ||
            (found.distance == best.distance && link < best.link)) {
            best = {.distance = found.distance, .link = link, .point = found.point, .normal = {}};
            nearest = found;
        }
    }
    if (best.distance > 0) {
        best.normal = (1 / best.distance) * (nearest.point - nearest.other);
    } else {
        best.normal = {1, 0};
    }
    last->known = true;
    std::copy(angles, angles + n_, last->question.angles.begin());
    last->question.search = search;
    last->answer.contact = best;
    return best;
}

Point2 ArmScene::velocity(const double* angles, const double* rates, std::uint32_t link,
                          Point2 point) const noexcept
{
    const auto joints = ends(angles, n_, link_);
    Point2 v{};
    for (std::uint32_t i = 0; i <= link; ++i) {  // each joint turns all links beyond it
        const Point2 arm = point - joints[i];
        v = v + rates[i] * Point2{-arm.y, arm.x};
    }
    return v;
}

double ArmScene::largest_speed(const double* angles, const double* rates) const noexcept
{
    double absolute = 0;
    double turning = 0;
    double largest = 0;
    Point2 v{};
    for (std::size_t i = 0; i < n_; ++i) {
        absolute += angles[i];
        turning += rates[i];
        v = v + link_ * turning * Point2{-std::sin(absolute), std::cos(absolute)};
        largest = std::max(largest, dot(v, v));
    }
    return std::sqrt(largest);
}

double ArmScene::largest_acceleration(const double* rates) const noexcept
{
    double turning = 0;
    double spin_up = 0;
    double sum = 0;
    for (std::size_t i = 0; i < n_; ++i) {
        const double reach = joints_[i].drive + joints_[i].spring;
        const double top = std::max(std::fabs(rates[i]), reach / p_.damping);
        turning += top;
        spin_up += reach + p_.damping * top;
        const double square = turning * turning;
        sum += link_ * std::sqrt(spin_up * spin_up + square * square);
    }
    return sum;
}

double ArmScene::lower_bound(const double* angles) const noexcept
{
    const auto joints = ends(angles, n_, link_);
    double least = infinity;
    for (std::size_t i = 0; i < n_; ++i) {
        least = std::min(least, lower_bound_of({joints[i], joints[i + 1]}));
    }
    return least - p_.clearance;
}

double ArmScene::slack(const double* half_widths) const noexcept
{
    double way = 0;
    for (std::size_t i = 0; i < n_; ++i) {
        way += half_widths[i] * link_ * static_cast<double>(n_ - i);
    }
    return way * (1 + 1e-14) + 1e-12 * p_.reach;
}

std::optional<double> ArmScene::parameter(std::string_view of) const noexcept
{
    if (of == "reach") return p_.reach;
    if (of == "clearance") return p_.clearance;
    if (of == "drive") return p_.drive;
    if (of == "damping") return p_.damping;
    if (of == "restitution") return p_.restitution;
    if (of == "least_rate") return p_.least_rate;
    if (of == "seed") return static_cast<double>(p_.seed);  // also the seed of the torques
    if (of == "obstacles" && !given_) return static_cast<double>(p_.obstacles);
    return std::nullopt;
}

double ArmScene::lower_bound_of(const Segment2& link) const noexcept
{
    if (!place_->table) return -infinity;
    const auto discs = static_cast<double>(p_.discs);
    const Point2 d = link.b - link.a;
    double least = infinity;
    for (std::size_t k = 0; k < p_.discs; ++k) {
        const Point2 c = link.a + ((static_cast<double>(k) + 0.5) / discs) * d;
        least = std::min(least, place_->table->lower_bound_of_cell({c.x, c.y}));
    }
    return least - 0.5 * link_ / discs - 1e-14 * p_.reach;
}

double ArmScene::reversal(const double* rates) const noexcept
{
    double fastest = 0;
    for (std::size_t i = 0; i < n_; ++i) fastest = std::max(fastest, std::fabs(rates[i]));
    if (!(fastest > 0)) return 1;
    return -std::max(p_.restitution, p_.least_rate / fastest);
}

}  // namespace ricochet
