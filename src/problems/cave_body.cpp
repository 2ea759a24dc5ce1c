#include "problems/cave_body.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>

#include "base/require.hpp"
#include "last_answer.hpp"
#include "problems/geometry/distance_grid.hpp"

namespace ricochet {

using Eigen::Vector3d;
using geometry::NearestFaces;
using geometry::Pose;

namespace {

struct Question {
    CaveBody::Attitude at{};
    CaveBody::Search search{};
};
struct Answer {
    std::uint32_t face, other_face;
    double distance;
    double point[3], other_point[3];
};
using Last = detail::LastAnswers<Question, Answer>;

Pose pose_of(const CaveBody::Attitude& at) noexcept
{
    const Eigen::Quaterniond q(at[3], at[4], at[5], at[6]);
    return {q.normalized().toRotationMatrix(), {at[0], at[1], at[2]}};
}

geometry::Mesh bumpy(std::string_view what, int refinements, double size, double height)
{
    detail::require(refinements >= 0 && refinements <= 7, "CaveBody", what, "lie in [0, 7]",
                    refinements);
    return geometry::bumpy_sphere(refinements, [&](const Vector3d& d) {
        const double coarse = std::sin(5 * d.x() + 1) * std::cos(4 * d.y()) + std::sin(7 * d.z());
        const double fine = std::sin(23 * d.x()) * std::cos(19 * d.y() + 2) + std::sin(29 * d.z());
        return size * (1 + height * (coarse + 0.3 * fine));
    });
}

void check(const CaveBody::Parameters& p)
{
    constexpr std::string_view self = "CaveBody";
    detail::require_positive(self, "cave_size", p.cave_size);
    detail::require_positive(self, "body_size", p.body_size);
    detail::require_positive(self, "clearance", p.clearance);
    detail::require_not_negative(self, "gravity", p.gravity);
    detail::require_finite(self, "turn", p.turn);
    detail::require_positive(self, "drag", p.drag);
    detail::require_not_negative(self, "spin_drag", p.spin_drag);
    detail::require_positive(self, "gyration", p.gyration);
    detail::require(p.restitution >= 0 && p.restitution <= 1, self, "restitution", "lie in [0, 1]",
                    p.restitution);
    detail::require_not_negative(self, "kick", p.kick);
    detail::require(p.balls > 0, self, "balls", "be positive", static_cast<double>(p.balls));
}

const CaveBody::Parameters& checked(const CaveBody::Parameters& p)
{
    check(p);
    return p;
}

geometry::Triangles triangles(std::string_view what, const geometry::Mesh& mesh)
{
    try {
        return geometry::Triangles(mesh);
    } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(fmt::format("CaveBody: {}: {}", what, error.what()));
    }
}

}  // namespace

/// Data shared by all copies of a scene.
struct CaveBody::Shapes {
    Shapes(const geometry::Mesh& cave_mesh, const geometry::Mesh& body_mesh, std::size_t most)
        : cave(triangles("cave", cave_mesh)),
          body(triangles("body", body_mesh)),
          balls(body.covering(most))
    {
    }

    geometry::Triangles cave;
    geometry::Triangles body;
    std::vector<geometry::Ball> balls;
    std::optional<geometry::DistanceGrid<3>> table{};
    mutable Last last{};
};

CaveBody::CaveBody(const Parameters& parameters)
    : CaveBody(checked(parameters), cave_of(parameters), body_of(parameters))
{
}

geometry::Mesh CaveBody::cave_of(const Parameters& p)
{
    return bumpy("cave_refinements", p.cave_refinements, p.cave_size, 0.06);
}

geometry::Mesh CaveBody::body_of(const Parameters& p)
{
    return bumpy("body_refinements", p.body_refinements, p.body_size, 0.1);
}

CaveBody::CaveBody(const Parameters& parameters, const geometry::Mesh& cave,
                   const geometry::Mesh& body)
    : p_(checked(parameters))
{
    auto shapes = std::make_shared<Shapes>(cave, body, p_.balls);
    for (const Vector3d& v : body.vertices) farthest_ = std::max(farthest_, v.norm());
    farthest_ *= 1 + 1e-12;
    const NearestFaces found = shapes->cave.nearest(shapes->body, Pose{});
    if (!(found.distance > p_.clearance)) {
        throw std::invalid_argument(fmt::format(
            "CaveBody: face {} of the body must be clear of face {} of the cave at the start by "
            "more than {}, its distance is {}",
            found.other_face, found.face, p_.clearance, found.distance));
    }
    // The surfaces do not cross, so one vertex shows on which side the whole body is.
    if (geometry::winding_number(cave, body.vertices[body.faces[0][0]]) == 0) {
        throw std::invalid_argument(
            "CaveBody: the body must be inside of the cave at the start; face 0 is not");
    }
    if (p_.grid > 0) {
        std::uint32_t hint = 0;
        const geometry::Box<3>& box = shapes->cave.bounds();
        shapes->table.emplace(box, p_.grid, 1e-14 * box.reach(), [&](const auto& at) {
            const auto nearest = shapes->cave.nearest({at[0], at[1], at[2]}, hint);
            hint = nearest.triangle;
            return nearest.distance;
        });
    }
    shapes_ = std::move(shapes);
}

NearestFaces CaveBody::nearest(Search search, const Attitude& at) const noexcept
{
    Last::Loan last(shapes_->last);
    NearestFaces found;
    if (last->known) {
        const Answer& a = last->answer;
        found.face = a.face;
        found.other_face = a.other_face;
        found.distance = a.distance;
        found.point = Vector3d(a.point[0], a.point[1], a.point[2]);
        found.other_point = Vector3d(a.other_point[0], a.other_point[1], a.other_point[2]);
        if (last->question.at == at && last->question.search == search) return found;
    }
    const Pose pose = pose_of(at);
    found = search == Search::tree ? shapes_->cave.nearest(shapes_->body, pose, found)
                                   : shapes_->cave.nearest_brute(shapes_->body, pose);
    last->known = true;
    last->question = {at, search};
    last->answer = {found.face,
                    found.other_face,
                    found.distance,
                    {found.point(0), found.point(1), found.point(2)},
                    {found.other_point(0), found.other_point(1), found.other_point(2)}};
    return found;
}

double CaveBody::clearance(Search search, const Attitude& at) const noexcept
{
    return nearest(search, at).distance - p_.clearance;
}

namespace {

/// Position of the touched point relative to the body, and the direction away from the cave.
struct Lever {
    Vector3d arm, normal;
};

Lever lever(const NearestFaces& found, const CaveBody::Attitude& at) noexcept
{
    const Vector3d gap = found.other_point - found.point;
    const double distance = gap.norm();
    return {found.other_point - Vector3d(at[0], at[1], at[2]),
            distance > 0 ? Vector3d(gap / distance) : Vector3d::UnitZ()};
}

double speed_along(const Lever& at, const std::array<double, 6>& m) noexcept
{
    return at.normal.dot(Vector3d(m[0], m[1], m[2]) + Vector3d(m[3], m[4], m[5]).cross(at.arm));
}

}  // namespace

double CaveBody::parting_speed(const Attitude& at, const Motion& motion) const noexcept
{
    return speed_along(lever(nearest(p_.search, at), at), motion);
}

CaveBody::Motion CaveBody::rebound(const Attitude& at, const Motion& motion) const noexcept
{
    const Lever touch = lever(nearest(p_.search, at), at);
    const double before = speed_along(touch, motion);
    const double after = std::max(-p_.restitution * before, p_.kick);
    const double inertia = p_.gyration * p_.gyration;  // of a body of unit mass
    const Vector3d twist = touch.arm.cross(touch.normal);
    const double impulse = (after - before) / (1 + twist.squaredNorm() / inertia);
    Motion out = motion;
    for (Eigen::Index k = 0; k < 3; ++k) {
        out[static_cast<std::size_t>(k)] += impulse * touch.normal(k);
        out[static_cast<std::size_t>(3 + k)] += impulse * twist(k) / inertia;
    }
    return out;
}

double CaveBody::tabulated(const Attitude& at) const noexcept
{
    if (!shapes_->table) return -std::numeric_limits<double>::infinity();
    const Pose pose = pose_of(at);
    double least = std::numeric_limits<double>::infinity();
    for (const geometry::Ball& ball : shapes_->balls) {
        const Vector3d c = pose.rotation * ball.centre + pose.translation;
        least =
            std::min(least, shapes_->table->lower_bound_of_cell({c(0), c(1), c(2)}) - ball.radius);
    }
    return least - p_.clearance - 1e-13 * p_.cave_size;
}

}  // namespace ricochet
