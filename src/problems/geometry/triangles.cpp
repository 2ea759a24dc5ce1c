#include "triangles.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace ricochet::geometry {

using Eigen::Vector3d;

namespace {

constexpr double largest = 1e200;  ///< of squared distances
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

std::array<double, 3> coordinates(const Vector3d& p) noexcept
{
    return {p.x(), p.y(), p.z()};
}

std::vector<Triangle> triangles_of(const Mesh& mesh)
{
    require_closed(mesh);
    std::vector<Triangle> out;
    for (const auto& [a, b, c] : mesh.faces) {
        out.push_back({mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]});
    }
    return out;
}

BoxTree<3> tree_of(const std::vector<Triangle>& triangles)
{
    std::vector<Box<3>> boxes(triangles.size());
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        for (const Vector3d& v : triangles[i]) boxes[i].add(coordinates(v));
    }
    return BoxTree<3>(std::move(boxes));
}

/// A ball that contains the triangle, around the middle of its box; a little larger than needed.
Ball ball_around(const Triangle& t)
{
    Vector3d lower = t[0], upper = t[0];
    for (const Vector3d& v : t) {
        lower = lower.cwiseMin(v);
        upper = upper.cwiseMax(v);
    }
    Ball out{0.5 * (lower + upper), 0};
    for (const Vector3d& v : t) out.radius = std::max(out.radius, (v - out.centre).norm());
    out.radius *= 1 + 1e-12;
    return out;
}

/// Nearest points of two segments, by their parameters (Ericson, 5.1.9).
std::pair<Vector3d, Vector3d> nearest_of_edges(const Vector3d& p, const Vector3d& d,
                                               const Vector3d& q, const Vector3d& e) noexcept
{
    const auto clamp = [](double t) { return t > 0 ? (t < 1 ? t : 1.0) : 0.0; };
    const Vector3d r = p - q;
    const double a = d.squaredNorm();
    const double f = e.squaredNorm();
    const double b = d.dot(e);
    const double c = d.dot(r);
    const double g = e.dot(r);
    const double denominator = a * f - b * b;
    double s = denominator > 0 ? clamp((b * g - c * f) / denominator) : 0.0;
    double t = (b * s + g) / f;
    if (!(t > 0)) {
        t = 0;
        s = clamp(-c / a);
    } else if (t > 1) {
        t = 1;
        s = clamp((b - c) / a);
    }
    return {p + s * d, q + t * e};
}

/// Whether the segment from p to q passes through the triangle, and where.
bool pierces(const Vector3d& p, const Vector3d& q, const Triangle& t, Vector3d& where) noexcept
{
    const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]);
    const double from = normal.dot(p - t[0]);
    const double to = normal.dot(q - t[0]);
    if (!((from > 0 && to < 0) || (from < 0 && to > 0))) return false;
    where = p + (from / (from - to)) * (q - p);
    for (std::size_t k = 0; k < 3; ++k) {
        const Vector3d& a = t[k];
        const Vector3d& b = t[(k + 1) % 3];
        if (normal.dot((b - a).cross(where - a)) < 0) return false;
    }
    return true;
}

}  // namespace

Vector3d nearest_point(const Triangle& t, const Vector3d& p) noexcept
{
    const Vector3d ab = t[1] - t[0];
    const Vector3d ac = t[2] - t[0];
    const Vector3d ap = p - t[0];
    const double d1 = ab.dot(ap);
    const double d2 = ac.dot(ap);
    if (d1 <= 0 && d2 <= 0) return t[0];
    const Vector3d bp = p - t[1];
    const double d3 = ab.dot(bp);
    const double d4 = ac.dot(bp);
    if (d3 >= 0 && d4 <= d3) return t[1];
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return t[0] + (d1 / (d1 - d3)) * ab;
    const Vector3d cp = p - t[2];
    const double d5 = ab.dot(cp);
    const double d6 = ac.dot(cp);
    if (d6 >= 0 && d5 <= d6) return t[2];
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return t[0] + (d2 / (d2 - d6)) * ac;
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        return t[1] + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (t[2] - t[1]);
    }
    const double scale = 1 / (va + vb + vc);
    return t[0] + (vb * scale) * ab + (vc * scale) * ac;
}

NearestFaces nearest_points(const Triangle& a, const Triangle& b) noexcept
{
    NearestFaces best;
    double least = largest;
    const auto offer = [&](const Vector3d& on_a, const Vector3d& on_b) {
        const double square = (on_a - on_b).squaredNorm();
        if (square >= least) return;
        least = square;
        best.point = on_a;
        best.other_point = on_b;
    };
    for (std::size_t i = 0; i < 3; ++i) {
        offer(nearest_point(a, b[i]), b[i]);
        offer(a[i], nearest_point(b, a[i]));
        for (std::size_t j = 0; j < 3; ++j) {
            const auto [p, q] =
                nearest_of_edges(a[i], a[(i + 1) % 3] - a[i], b[j], b[(j + 1) % 3] - b[j]);
            offer(p, q);
        }
    }
    best.distance = std::sqrt(least);
    // Triangles that cross have an edge through a face.
    Vector3d where;
    for (std::size_t i = 0; i < 3; ++i) {
        if (pierces(a[i], a[(i + 1) % 3], b, where) || pierces(b[i], b[(i + 1) % 3], a, where)) {
            best.distance = 0;
            best.point = best.other_point = where;
            break;
        }
    }
    return best;
}

Triangles::Triangles(const Mesh& mesh) : triangles_(triangles_of(mesh)), tree_(tree_of(triangles_))
{
    for (const Triangle& t : triangles_) balls_.push_back(ball_around(t));
}

NearestOnTriangle Triangles::nearest(const Vector3d& p, std::uint32_t hint) const noexcept
{
    NearestOnTriangle out{.triangle = 0, .distance = nan, .point = Vector3d::Zero()};
    if (!p.allFinite()) return out;
    double best = largest;
    const auto offer = [&](std::uint32_t i) {
        const Vector3d point = nearest_point(triangles_[i], p);
        const double square = (p - point).squaredNorm();
        if (square > best || (square == best && i >= out.triangle)) return;
        best = square;
        out.triangle = i;
        out.point = point;
    };
    out.triangle = static_cast<std::uint32_t>(size());
    offer(hint < size() ? hint : 0);
    const std::array<double, 3> at = coordinates(p);
    tree_.search(
        best, [&](const FourBoxes<3>& boxes) { return squared_distances(boxes, at, at); },
        [&](std::size_t first, std::size_t last) {
            for (std::size_t i = first; i < last; ++i) offer(tree_.order()[i]);
        });
    out.distance = std::sqrt(best);
    return out;
}

NearestOnTriangle Triangles::nearest_brute(const Vector3d& p) const noexcept
{
    NearestOnTriangle out{.triangle = 0, .distance = nan, .point = Vector3d::Zero()};
    if (!p.allFinite()) return out;
    double best = largest;
    out.triangle = static_cast<std::uint32_t>(size());
    for (std::uint32_t i = 0; i < size(); ++i) {
        const Vector3d point = nearest_point(triangles_[i], p);
        const double square = (p - point).squaredNorm();
        if (square >= best) continue;
        best = square;
        out.triangle = i;
        out.point = point;
    }
    out.distance = std::sqrt(best);
    return out;
}

namespace {

Triangle moved(const Triangle& t, const Pose& pose) noexcept
{
    Triangle out;
    for (std::size_t k = 0; k < 3; ++k) out[k] = pose.rotation * t[k] + pose.translation;
    return out;
}

/// The nearest pair of faces of two meshes found so far.
struct BestPair {
    NearestFaces found{.face = std::numeric_limits<std::uint32_t>::max(),
                       .other_face = std::numeric_limits<std::uint32_t>::max(),
                       .distance = 1e100,
                       .point = Vector3d::Zero(),
                       .other_point = Vector3d::Zero()};

    void offer(const Triangle& a, std::uint32_t face, const Triangle& b,
               std::uint32_t other) noexcept
    {
        NearestFaces pair = nearest_points(a, b);
        if (pair.distance > found.distance) return;
        if (pair.distance == found.distance &&
            std::pair(other, face) >= std::pair(found.other_face, found.face)) {
            return;
        }
        pair.face = face;
        pair.other_face = other;
        found = pair;
    }
};

bool finite(const Pose& pose) noexcept
{
    return pose.rotation.allFinite() && pose.translation.allFinite();
}

constexpr int most_turns = 8;

/// The ball around one of four boxes.
Ball ball_of(const FourBoxes<3>& boxes, std::size_t i) noexcept
{
    Vector3d lower, upper;
    for (std::size_t k = 0; k < 3; ++k) {
        lower(static_cast<Eigen::Index>(k)) = boxes.lower[k][i];
        upper(static_cast<Eigen::Index>(k)) = boxes.upper[k][i];
    }
    return {0.5 * (lower + upper), 0.5 * (1 + 1e-12) * (upper - lower).norm()};
}

}  // namespace

/// The search for the nearest faces of a mesh and of a body that is displaced by `pose`.
class Triangles::PairSearch {
public:
    PairSearch(const Triangles& mesh, const Triangles& body, const Pose& pose) noexcept
        : mesh_(mesh), body_(body), pose_(pose)
    {
    }

    [[nodiscard]] const NearestFaces& best() const noexcept { return best_.found; }

    void start_at(const NearestFaces& hint) noexcept;
    void project_by_turns() noexcept;
    void search_trees() noexcept;

private:
    [[nodiscard]] Ball placed(const Ball& ball) const noexcept
    {
        return {pose_.rotation * ball.centre + pose_.translation, ball.radius};
    }
    /// Squared radius around the centre of a ball within which a part of the mesh may be nearer to
    /// the ball's contents than the best pair so far; 1e-12 for rounding.
    [[nodiscard]] double squared_reach(double radius) const noexcept
    {
        const double reach = (best_.found.distance + radius) * (1 + 1e-12);
        return std::min(reach * reach, largest);
    }
    [[nodiscard]] bool comes_near(const Ball& ball) const noexcept;
    void compare(std::uint32_t other) noexcept;

    const Triangles& mesh_;
    const Triangles& body_;
    const Pose& pose_;
    BestPair best_;
};

void Triangles::PairSearch::start_at(const NearestFaces& hint) noexcept
{
    const std::uint32_t face = hint.face < mesh_.size() ? hint.face : 0;
    const std::uint32_t other = hint.other_face < body_.size() ? hint.other_face : 0;
    best_.offer(mesh_[face], face, moved(body_[other], pose_), other);
}

/// Alternating projections between the surfaces soon come near the nearest pair, or a pair that is
/// hardly further apart. The search that follows then has little more to do than to prove it.
void Triangles::PairSearch::project_by_turns() noexcept
{
    Vector3d from = best_.found.other_point;
    for (int turn = 0; turn < most_turns; ++turn) {
        const NearestOnTriangle here = mesh_.nearest(from, best_.found.face);
        const NearestOnTriangle there = body_.nearest(
            pose_.rotation.transpose() * (here.point - pose_.translation), best_.found.other_face);
        const double before = best_.found.distance;
        best_.offer(mesh_[here.triangle], here.triangle, moved(body_[there.triangle], pose_),
                    there.triangle);
        if (!(best_.found.distance < before)) break;
        from = best_.found.other_point;
    }
}

/// Whether the mesh comes near a ball, so that its contents may hold a nearer face.
bool Triangles::PairSearch::comes_near(const Ball& ball) const noexcept
{
    const std::array<double, 3> at = coordinates(ball.centre);
    double reach = squared_reach(ball.radius);
    bool near = false;
    mesh_.tree_.search(
        reach,
        [&](const FourBoxes<3>& boxes) {
            if (near) return std::array{largest, largest, largest, largest};
            return squared_distances(boxes, at, at);
        },
        [&](std::size_t first, std::size_t last) {
            for (std::size_t i = first; i < last && !near; ++i) {
                const Triangle& t = mesh_[mesh_.tree_.order()[i]];
                near = (nearest_point(t, ball.centre) - ball.centre).squaredNorm() <= reach;
            }
            if (near) reach = -1;
        });
    return near;
}

/// Compares the faces of the mesh with a face of the body.
void Triangles::PairSearch::compare(std::uint32_t other) noexcept
{
    const Ball ball = placed(body_.balls_[other]);
    if (!comes_near(ball)) return;
    const Triangle triangle = moved(body_[other], pose_);
    const std::array<double, 3> at = coordinates(ball.centre);
    double reach = squared_reach(ball.radius);
    mesh_.tree_.search(
        reach, [&](const FourBoxes<3>& boxes) { return squared_distances(boxes, at, at); },
        [&](std::size_t first, std::size_t last) {
            for (std::size_t i = first; i < last; ++i) {
                const std::uint32_t face = mesh_.tree_.order()[i];
                const Ball& around = mesh_.balls_[face];
                const double within = best_.found.distance + ball.radius + around.radius;
                if ((around.centre - ball.centre).squaredNorm() > within * within * (1 + 1e-12)) {
                    continue;
                }
                const Vector3d near = nearest_point(mesh_[face], ball.centre);
                if ((near - ball.centre).squaredNorm() > squared_reach(ball.radius)) continue;
                best_.offer(mesh_[face], face, triangle, other);
            }
            reach = squared_reach(ball.radius);
        });
}

/// Opens the parts of the body whose balls the mesh comes near.
void Triangles::PairSearch::search_trees() noexcept
{
    struct Part {
        std::size_t level, index;
    };
    std::array<Part, 64> parts;
    std::size_t count = 0;
    const BoxTree<3>& tree = body_.tree_;
    parts[count++] = {tree.levels(), 0};
    while (count > 0) {
        const Part part = parts[--count];
        if (part.level == 0) {
            const std::size_t last = std::min(4 * part.index + 4, body_.size());
            for (std::size_t i = 4 * part.index; i < last; ++i) compare(tree.order()[i]);
            continue;
        }
        const FourBoxes<3>& boxes = tree.level(part.level - 1)[part.index];
        for (std::size_t i = 0; i < 4; ++i) {
            if (!(boxes.lower[0][i] <= boxes.upper[0][i])) continue;
            if (comes_near(placed(ball_of(boxes, i)))) {
                parts[count++] = {part.level - 1, 4 * part.index + i};
            }
        }
    }
}

NearestFaces Triangles::nearest(const Triangles& body, const Pose& pose,
                                const NearestFaces& hint) const noexcept
{
    if (!finite(pose)) return {.distance = nan};
    PairSearch search(*this, body, pose);
    search.start_at(hint);
    search.project_by_turns();
    search.search_trees();
    return search.best();
}

NearestFaces Triangles::nearest_brute(const Triangles& body, const Pose& pose) const noexcept
{
    BestPair best;
    if (!finite(pose)) {
        best.found = {};
        best.found.distance = nan;
        return best.found;
    }
    for (std::uint32_t other = 0; other < body.size(); ++other) {
        const Triangle triangle = moved(body[other], pose);
        for (std::uint32_t face = 0; face < size(); ++face) {
            best.offer(triangles_[face], face, triangle, other);
        }
    }
    return best.found;
}

std::vector<Ball> Triangles::covering(std::size_t most) const
{
    std::vector<Ball> out;
    for (std::size_t level = 0; level < tree_.levels(); ++level) {
        out.clear();
        for (const FourBoxes<3>& boxes : tree_.level(level)) {
            for (std::size_t i = 0; i < 4; ++i) {
                if (boxes.lower[0][i] <= boxes.upper[0][i]) out.push_back(ball_of(boxes, i));
            }
        }
        if (out.size() <= most) break;
    }
    return out;
}

}  // namespace ricochet::geometry
