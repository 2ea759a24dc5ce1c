// Mesh against mesh: the trees of this library, checked against brute force and, where FCL is
// found (Debian: libfcl-dev), against that library, and timed beside it.
//
// The cave and the body are those of `CaveBody`. The poses come from one of its runs: far apart in
// time (each a new query), and step by step (where the last result is a hint).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "problems/cave_body.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/planned.hpp"
#include "timing.hpp"
#ifdef RICOCHET_BENCH_FCL
#include "peers/fcl.hpp"
#endif

namespace {

using namespace ricochet;
using geometry::Mesh;
using geometry::NearestFaces;
using geometry::Pose;
using geometry::Triangles;

Pose pose_of(const CaveBody::State& x)
{
    const Eigen::Quaterniond q(x[3], x[4], x[5], x[6]);
    return {q.normalized().toRotationMatrix(), {x[0], x[1], x[2]}};
}

/// States of a run, 2 ms apart.
std::vector<CaveBody::State> states_of(const CaveBody& body, std::size_t count)
{
    Options options{.t_end = 2e-3 * static_cast<double>(count), .step = 2e-3};
    for (std::size_t i = 0; i < count; ++i) {
        options.sample_times.push_back(2e-3 * static_cast<double>(i));
    }
    return integrate(body, body.start(), options, FixedStep<Rk4>{}, Planned{}).trajectory.x;
}

/// Median time of a query [s].
double time_of(const std::vector<Pose>& poses, const std::function<double(const Pose&)>& ask)
{
    double sink = 0;
    const bench::Work work = bench::repeated([&] {
        for (const Pose& pose : poses) sink += ask(pose);
        return sink;
    });
    const bench::Timing timing = bench::time_alone(work, {.budget = 1, .fewest = 3});
    return timing.median / static_cast<double>(poses.size());
}

}  // namespace

int main(int count, char** arguments)
{
    CLI::App app("Distances of meshes", "ricochet_meshes");
    std::size_t questions = 400;
    std::size_t brute = 2;
    app.add_option("--poses", questions, "default 400");
    app.add_option("--brute", brute, "of these also by brute force, default 2");
    CLI11_PARSE(app, count, arguments);

    const CaveBody scene;
    const Mesh cave_mesh = CaveBody::cave_of({});
    const Mesh body_mesh = CaveBody::body_of({});
    const Triangles cave(cave_mesh);
    const Triangles body(body_mesh);
    const std::vector<CaveBody::State> states = states_of(scene, 10 * questions);
    std::vector<Pose> apart;
    std::vector<Pose> along;
    for (std::size_t i = 0; i < questions; ++i) {
        apart.push_back(pose_of(states[(7919 * i) % states.size()]));
    }
    for (const CaveBody::State& x : states) along.push_back(pose_of(x));

    bool good = true;
    for (std::size_t i = 0; i < std::min(brute, questions); ++i) {
        const double tree = cave.nearest(body, apart[i]).distance;
        const double all = cave.nearest_brute(body, apart[i]).distance;
        good = good && tree == all;
        fmt::print("pose {}: {} by trees, {} by {} pairs\n", i, tree, all,
                   cave.size() * body.size());
    }
    fmt::print("{} faces against {}, {} poses apart, {} along a run, 2 ms apart\n", cave.size(),
               body.size(), apart.size(), along.size());
    fmt::print("trees, no hint             {:9.1f} us\n",
               1e6 * time_of(apart, [&](const Pose& p) { return cave.nearest(body, p).distance; }));
    NearestFaces hint;
    fmt::print("trees, hint, along a run   {:9.1f} us\n", 1e6 * time_of(along, [&](const Pose& p) {
                                                              hint = cave.nearest(body, p, hint);
                                                              return hint.distance;
                                                          }));
#ifdef RICOCHET_BENCH_FCL
    const bench::FclMeshes fcl(cave_mesh, body_mesh);
    double furthest = 0;
    for (const Pose& pose : apart) {
        const double ours = cave.nearest(body, pose).distance;
        furthest = std::max(furthest, std::fabs(ours - fcl.distance(pose)));
    }
    fmt::print("FCL {}, OBBRSS       {:9.1f} us\n", bench::FclMeshes::version(),
               1e6 * time_of(apart, [&](const Pose& p) { return fcl.distance(p); }));
    fmt::print("the same, along a run      {:9.1f} us\n",
               1e6 * time_of(along, [&](const Pose& p) { return fcl.distance(p); }));
    fmt::print("largest difference {:.2e} m\n", furthest);
    // Both work in double precision on coordinates of some 5 m; FCL's triangle distance stops
    // at its own tolerance of 1e-6.
    good = good && furthest < 1e-6;
#else
    fmt::print("built without FCL\n");
#endif
    return good ? 0 : 1;
}
