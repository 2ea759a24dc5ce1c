// Scenes with expensive guards: a check at every step against the planner of bounds.
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "measure.hpp"
#include "problems/cave_body.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/planar_arm.hpp"
#include "problems/zones.hpp"
#include "scene_rows.hpp"

namespace ricochet::bench {

namespace {

using Fixed = FixedStep<Rk4>;
using Controlled = ErrorControlled<Dopri5>;

template <std::size_t N>
SceneRow arm(std::size_t obstacles)
{
    ArmScene::Parameters parameters{.obstacles = obstacles};
    const PlanarArm<N> built(parameters);
    parameters.search = ArmScene::Search::brute;
    const PlanarArm<N> brute(parameters);
    return compare_scene<Fixed>(fmt::format("{} joints, {} obstacles", N, obstacles), built, &brute,
                                {.t_end = 60, .step = 1e-3}, 0.3);
}

template <class Stepping, class System>
SceneRow one_guard(std::string name, const System& system, const Options& options, double budget)
{
    const System* none = nullptr;
    return compare_scene<Stepping>(std::move(name), system, none, options, budget);
}

}  // namespace

Measured time_cave_body()
{
    const CaveBody body;
    std::vector<SceneRow> rows;
    for (const double step : {2e-3, 1e-3, 5e-4}) {
        rows.push_back(one_guard<Fixed>(fmt::format("rk4 {} ms", 1e3 * step), body,
                                        {.t_end = 1e4 * step, .step = step}, 0.5));
    }
    // Rarer bounces.
    rows.push_back(one_guard<Fixed>("rk4 2 ms, gravity 2 m/s2", CaveBody({.gravity = 2}),
                                    {.t_end = 20, .step = 2e-3}, 0.5));
    rows.push_back(
        one_guard<Controlled>("dopri5 1e-9", body, {.t_end = 20, .rtol = 1e-9, .atol = 1e-9}, 0.5));
    return scene_table(rows, 1, 30, &SceneRow::time_ratio);
}

Measured time_arms()
{
    return scene_table({arm<4>(8), arm<4>(40), arm<6>(8), arm<6>(40)}, 4, 10,
                       &SceneRow::time_ratio);
}

Measured time_zones()
{
    const Zones zones;
    const std::vector<SceneRow> rows{
        one_guard<Fixed>("rk4 1 ms", zones, {.t_end = 60, .step = 1e-3}, 1),
        one_guard<Controlled>("dopri5 1e-9", zones, {.t_end = 60, .rtol = 1e-9, .atol = 1e-9},
                              0.5)};
    return scene_table(rows, 1, 100, &SceneRow::time_ratio);
}

Measured count_eigenvalues()
{
    std::vector<SceneRow> rows;
    for (const double level : {1.3, 1.55}) {
        rows.push_back(one_guard<Fixed>(fmt::format("level {}", level),
                                        LeastEigenvalue({.level = level}),
                                        {.t_end = 40, .step = 1e-3}, 0.1));
    }
    return scene_table(rows, 2, 25, &SceneRow::call_ratio);
}

}  // namespace ricochet::bench
