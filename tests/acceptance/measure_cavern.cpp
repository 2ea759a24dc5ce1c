// A ball in a cavern: a check at every step against the planner of bounds.
#include <fmt/format.h>

#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "measure.hpp"
#include "problems/cavern.hpp"
#include "scene_rows.hpp"

namespace ricochet::bench {

namespace {

using Fixed = FixedStep<Rk4>;
using Controlled = ErrorControlled<Dopri5>;

constexpr double tolerance = 1e-9;

Cavern cavern(std::size_t segments, bool skims, Cavern::Search search)
{
    Cavern::Parameters p = skims ? Cavern::skimming() : Cavern::Parameters{};
    p.segments = segments;
    p.search = search;
    return Cavern(p);
}

std::string_view manner(bool skims)
{
    return skims ? "skims" : "flies";
}

template <class Stepping>
SceneRow row(std::string_view method, std::size_t segments, bool skims, const Options& options)
{
    const Cavern brute = cavern(segments, skims, Cavern::Search::brute);
    return compare_scene<Stepping>(fmt::format("{}, {}, {}", segments, manner(skims), method),
                                   cavern(segments, skims, Cavern::Search::tree), &brute, options,
                                   0.3);
}

Options every_ms(double t_end)
{
    return {.t_end = t_end, .step = 1e-3};
}
Options dense(double t_end, double h_max)
{
    return {.t_end = t_end, .rtol = tolerance, .atol = tolerance, .h_max = h_max};
}

}  // namespace

Measured time_cavern()
{
    std::vector<SceneRow> rows;
    for (const std::size_t segments : {10'000U, 100U, 100'000U}) {
        for (const bool skims : {false, true}) {
            rows.push_back(
                row<Fixed>("rk4 1 ms", segments, skims, every_ms(segments > 10'000 ? 5 : 20)));
        }
    }
    return scene_table(rows, 2, 50, &SceneRow::time_ratio);
}

Measured time_cavern_dopri5()
{
    constexpr double any = std::numeric_limits<double>::infinity();
    std::vector<SceneRow> rows;
    for (const bool skims : {false, true}) {
        rows.push_back(row<Controlled>("dopri5 up to 1 ms", 10'000, skims, dense(20, 1e-3)));
    }
    for (const std::size_t segments : {10'000U, 100'000U}) {
        for (const bool skims : {false, true}) {
            rows.push_back(row<Controlled>("dopri5", segments, skims, dense(100, any)));
        }
    }
    return scene_table(rows, 2, 50, &SceneRow::time_ratio);
}

}  // namespace ricochet::bench
