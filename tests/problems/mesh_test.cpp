// Meshes: reading and refusing them, distances from trees against an exhaustive check, and
// the scene made of two meshes.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "problems/cave_body.hpp"
#include "problems/geometry/mesh.hpp"
#include "problems/geometry/triangles.hpp"
#include "ricochet/base/random.hpp"
#include "scene_bounds.hpp"

namespace ricochet::geometry::mesh_test {
namespace {

using Eigen::Vector3d;
using learn::Random;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

const char* const tetrahedron =
    "OFF  # four faces\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
    "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

Vector3d random_point(Random& random, double size)
{
    return {random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
}

Mesh potato(int refinements, double size)
{
    return bumpy_sphere(refinements, [&](const Vector3d& d) {
        return size * (1 + 0.2 * std::sin(4 * d.x()) * std::cos(3 * d.y() + 1));
    });
}

Pose random_pose(Random& random, double way)
{
    const Vector3d axis = random_point(random, 1);
    return {Eigen::AngleAxisd(random.uniform(0, 6), axis.normalized()).toRotationMatrix(),
            random_point(random, way)};
}

TEST(Mesh, ReadsOffAndObj)
{
    const Mesh off = read_mesh(tetrahedron);
    EXPECT_EQ(off.vertices.size(), 4U);
    EXPECT_EQ(off.faces.size(), 4U);
    require_closed(off);
    // A cube of quadrilaterals, with normals, comments and indices from the end.
    const Mesh obj = read_mesh(
        "# cube\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
        "vn 0 0 1\nf 1//1 4//1 3//1 2//1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 "
        "-1\n");
    EXPECT_EQ(obj.vertices.size(), 8U);
    EXPECT_EQ(obj.faces.size(), 12U);
    require_closed(obj);
    EXPECT_EQ(Triangles(obj).nearest({0.5, 0.5, 3}).distance, 2);
}

TEST(Mesh, BadOnesAreRefusedByFace)
{
    const auto sentence = [](const Mesh& mesh) { return refusal([&] { require_closed(mesh); }); };
    const auto text = [](const char* t) { return refusal([&] { (void)read_mesh(t); }); };
    const Mesh good = read_mesh(tetrahedron);
    Mesh mesh = good;
    mesh.faces.pop_back();
    EXPECT_NE(sentence(mesh).find("open; face"), std::string::npos) << sentence(mesh);
    mesh = good;
    mesh.vertices[3].y() = nan;
    EXPECT_NE(sentence(mesh).find("face 1 has vertex 3, which is not finite"), std::string::npos);
    mesh = good;
    mesh.vertices[3] = {0.5, 0, 0};
    EXPECT_NE(sentence(mesh).find("area of face 1"), std::string::npos) << sentence(mesh);
    mesh = good;
    std::swap(mesh.faces[2][0], mesh.faces[2][1]);
    EXPECT_NE(sentence(mesh).find("the same way"), std::string::npos) << sentence(mesh);
    mesh = good;
    mesh.faces[2][0] = 9;
    EXPECT_NE(sentence(mesh).find("face 2 has vertex 9"), std::string::npos);
    EXPECT_NE(sentence({}).find("there is no face"), std::string::npos);
    EXPECT_NE(sentence(read_mesh("")).find("there is no face"), std::string::npos);

    EXPECT_NE(text("v 0 0\n").find("line 1: a vertex needs three"), std::string::npos);
    EXPECT_NE(text("v 0 0 x\n").find("'x' is not a number"), std::string::npos);
    EXPECT_NE(text("v 0 0 0\nf 1 2 3\n").find("face 0 has a vertex that does not exist"),
              std::string::npos);
    EXPECT_NE(text("OFF\n3 1 0\n0 0 0\n").find("ends among the vertices"), std::string::npos);
    EXPECT_NE(text("OFF\n").find("numbers of vertices"), std::string::npos);
    EXPECT_NE(text("OFF\n1 1 0\n0 0 0\n3 0 0\n").find("all its vertices"), std::string::npos);
    // A coordinate that is not a number is read, and refused by the face that has it.
    EXPECT_NE(sentence(read_mesh("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")).find("face 0"),
              std::string::npos);
}

TEST(Mesh, BumpySpheresAreClosed)
{
    for (int n = 0; n <= 4; ++n) {
        const Mesh mesh = potato(n, 1);
        EXPECT_EQ(mesh.faces.size(), 20U << (2 * n));
        require_closed(mesh);
    }
}

TEST(Mesh, WindsAroundWhatIsInside)
{
    Mesh mesh = potato(2, 1.5);
    Random random(8);
    int inside = 0;
    for (int i = 0; i < 500; ++i) {
        const Vector3d p(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2));
        // A ray from the origin leaves once a surface that is entirely visible from there, so a
        // point is inside if no face lies between.
        const double r = p.norm();
        if (r > 1 && r < 2.3) continue;  // radii of the potato
        EXPECT_EQ(winding_number(mesh, p), r <= 1 ? 1 : 0);
        inside += r <= 1 ? 1 : 0;
    }
    EXPECT_GT(inside, 10);
    for (auto& face : mesh.faces) std::swap(face[0], face[1]);
    EXPECT_EQ(winding_number(mesh, {0.1, 0.2, 0}), -1);
}

TEST(Triangles, TheTreeFindsTheNearestFaceOfAPoint)
{
    Random random(1);
    const Triangles mesh(potato(3, 1));
    for (int i = 0; i < 2000; ++i) {
        const Vector3d p = i % 5 == 0   ? mesh[random.below(mesh.size())][i % 3]
                           : i % 7 == 0 ? random_point(random, 1e6)
                                        : random_point(random, 1.5);
        const NearestOnTriangle brute = mesh.nearest_brute(p);
        const NearestOnTriangle tree =
            mesh.nearest(p, static_cast<std::uint32_t>(random.below(mesh.size())));
        EXPECT_EQ(tree.distance, brute.distance);
        EXPECT_EQ(tree.triangle, brute.triangle);
        EXPECT_EQ(tree.point, brute.point);
        EXPECT_TRUE(i % 5 != 0 || brute.distance == 0);
    }
    EXPECT_TRUE(std::isnan(mesh.nearest({nan, 0, 0}).distance));
    EXPECT_TRUE(std::isnan(mesh.nearest_brute({0, 0, nan}).distance));
}

TEST(Triangles, PairsAreNearestAmongTheirPoints)
{
    // Compared with points of a fine grid on both triangles: no two of them are nearer, and some
    // are nearly as near.
    Random random(2);
    for (int i = 0; i < 200; ++i) {
        Triangle a, b;
        for (int k = 0; k < 3; ++k) {
            a[static_cast<std::size_t>(k)] = random_point(random, 1);
            b[static_cast<std::size_t>(k)] = random_point(random, 1) + Vector3d(0.7, 0, 0);
        }
        const NearestFaces pair = nearest_points(a, b);
        const double gap = (pair.point - pair.other_point).norm();
        EXPECT_NEAR(pair.distance, gap, 1e-12);
        double least = 1e9;
        const int n = 24;
        for (int u = 0; u <= n; ++u) {
            for (int v = 0; u + v <= n; ++v) {
                const Vector3d p =
                    a[0] + double(u) / n * (a[1] - a[0]) + double(v) / n * (a[2] - a[0]);
                least = std::min(least, (nearest_point(b, p) - p).norm());
            }
        }
        EXPECT_LE(pair.distance, least + 1e-12);
        // Sides are at most 2 sqrt(3) long: a point of a is within 0.15 of the grid.
        EXPECT_GE(pair.distance, least - 0.15);
    }
}

TEST(Triangles, TheTreesFindTheNearestFacesOfTwoMeshes)
{
    Random random(3);
    const Triangles cave(potato(3, 2));
    const Triangles body(potato(1, 0.5));
    NearestFaces hint;
    std::size_t crossing = 0;
    for (int i = 0; i < 60; ++i) {
        const Pose pose = random_pose(random, i % 10 == 0 ? 20 : 1.5);
        const NearestFaces brute = cave.nearest_brute(body, pose);
        const NearestFaces tree = cave.nearest(body, pose, hint);
        EXPECT_EQ(tree.distance, brute.distance);
        if (brute.distance == 0) ++crossing;  // many pairs do, and the first of them is named
        EXPECT_EQ(tree.face, brute.face);
        EXPECT_EQ(tree.other_face, brute.other_face);
        hint = tree;
    }
    EXPECT_GT(crossing, 3U);
    Pose pose;
    pose.translation.x() = nan;
    EXPECT_TRUE(std::isnan(cave.nearest(body, pose).distance));
    EXPECT_TRUE(std::isnan(cave.nearest_brute(body, pose).distance));
}

TEST(Triangles, BallsCoverTheSurface)
{
    Random random(4);
    const Triangles body(potato(3, 0.5));
    const std::vector<Ball> balls = body.covering(96);
    EXPECT_LE(balls.size(), 96U);
    EXPECT_GE(balls.size(), 20U);
    for (int i = 0; i < 5000; ++i) {
        const Triangle& t = body[random.below(body.size())];
        double u = random.uniform(), v = random.uniform();
        if (u + v > 1) u = 1 - u, v = 1 - v;
        const Vector3d p = t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]);
        EXPECT_TRUE(std::any_of(balls.begin(), balls.end(), [&](const Ball& ball) {
            return (p - ball.centre).norm() <= ball.radius;
        }));
    }
}

// --- the scene ---

CaveBody::Parameters small_scene()
{
    return {.cave_refinements = 2, .body_refinements = 1, .grid = 48};
}

TEST(CaveBody, BoundsHoldAndTheBodyStaysInside)
{
    const CaveBody system(small_scene());
    const auto run = sampled_run(system, CaveBody::start(), 25, 2e-3, 60'000);
    EXPECT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_GT(run.events.size(), 10U);
    expect_bounds_hold(sample_bounds(system, run, 0), 100'000, 0.3);
    for (std::size_t i = 0; i < run.trajectory.t.size(); i += 10) {
        ASSERT_GT(system.guard(run.trajectory.t[i], run.trajectory.x[i]), -1e-9);
    }
}

TEST(CaveBody, TreesAndBruteForceAgreeAlongARun)
{
    const CaveBody system(small_scene());
    const auto run = sampled_run(system, CaveBody::start(), 3, 2e-3, 20);
    for (const auto& x : run.trajectory.x) {
        const CaveBody::Attitude at{x[0], x[1], x[2], x[3], x[4], x[5], x[6]};
        EXPECT_EQ(system.clearance(CaveBody::Search::tree, at),
                  system.clearance(CaveBody::Search::brute, at));
    }
}

TEST(CaveBody, TheRateIsTheDerivativeAndAnImpactParts)
{
    const CaveBody system(small_scene());
    const auto run = sampled_run(system, CaveBody::start(), 5, 2e-3, 300);
    std::size_t compared = 0;
    for (std::size_t i = 0; i < run.trajectory.t.size(); ++i) {
        const auto& x = run.trajectory.x[i];
        CaveBody::State dxdt{};
        system.flow(run.trajectory.t[i], x, dxdt);
        const auto moved = [&](double by) {
            auto at = x;
            for (std::size_t k = 0; k < 7; ++k) at[k] += by * dxdt[k];
            return system.guard(0, at);
        };
        const double h = 1e-6;
        const double forward = (moved(h) - moved(0)) / h;
        const double backward = (moved(0) - moved(-h)) / h;
        if (std::fabs(forward - backward) > 1e-2) continue;  // a kink
        ++compared;
        EXPECT_NEAR(system.guard_rate(0, x, dxdt), (forward + backward) / 2, 1e-2);
    }
    EXPECT_GT(compared, 280U);
    for (const auto& event : run.events) {
        CaveBody::State dxdt{};
        system.flow(event.t, event.after, dxdt);
        EXPECT_GE(system.guard_rate(event.t, event.after, dxdt), 4 * (1 - 1e-9));  // the kick
    }
}

TEST(CaveBody, BadMeshesAreRefused)
{
    Mesh open = potato(1, 5);
    open.faces.pop_back();
    const auto sentence = [](const Mesh& cave, const Mesh& body) {
        return refusal([&] { CaveBody(CaveBody::Parameters{.grid = 0}, cave, body); });
    };
    EXPECT_EQ(sentence(potato(1, 5), potato(1, 0.5)), "accepted");
    EXPECT_NE(sentence(open, potato(1, 0.5)).find("CaveBody: cave: mesh: it is open; face"),
              std::string::npos);
    EXPECT_NE(sentence(potato(1, 5), {}).find("body: mesh: there is no face"), std::string::npos);
    Mesh undefined = potato(1, 0.5);
    undefined.vertices[0].x() = nan;
    EXPECT_NE(sentence(potato(1, 5), undefined).find("is not finite"), std::string::npos);
    EXPECT_NE(sentence(potato(1, 1), potato(1, 1)).find("must be clear of face"),
              std::string::npos);
    Mesh beside = potato(1, 0.5);
    for (Vector3d& v : beside.vertices) v.x() += 20;
    EXPECT_NE(sentence(potato(1, 5), beside).find("inside of the cave"), std::string::npos);
    EXPECT_NE(sentence(potato(1, 0.5), potato(1, 5)).find("inside of the cave"),
              std::string::npos);  // the body around the cave
    EXPECT_NE(refusal([] { CaveBody({.cave_refinements = 9}); }).find("cave_refinements"),
              std::string::npos);
    EXPECT_NE(refusal([] { CaveBody({.drag = 0}); }).find("drag"), std::string::npos);
}

}  // namespace
}  // namespace ricochet::geometry::mesh_test
