// An ensemble of 1e5 balls: the same results for any number of threads, and the gain of two cores.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <limits>
#include <string>
#include <vector>

#include "measure.hpp"
#include "ricochet/detail/splitmix.hpp"
#include "ricochet/ensemble.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::bench {

namespace {

constexpr std::size_t rows = 100'000;

struct End {
    BouncingBall::State x;
    std::size_t impacts = 0;
};

End fall(const EnsembleRow& row)
{
    detail::SplitMix random(row.seed);
    const double height = random.uniform(1, 10);  // [m]
    const BouncingBall ball({.gravity = 9.81, .restitution = random.uniform(0.7, 0.9)});
    const auto run = integrate(ball, {height, 0}, {.t_end = 20.5});
    return {.x = run.x, .impacts = run.events.size()};
}

struct Timed {
    double wall = std::numeric_limits<double>::infinity();       ///< [s] the least
    double processor = std::numeric_limits<double>::infinity();  ///< [s] of all threads, the least
    std::uint64_t hash = 0;
    std::size_t impacts = 0;
};

/// Runs all rows once more.
void run_on(unsigned threads, Timed& out)
{
    const auto start = std::chrono::steady_clock::now();
    const std::clock_t busy = std::clock();
    const auto all = ensemble(rows, fall, {.threads = threads, .seed = 1});
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - start;
    out.processor = std::min(out.processor, static_cast<double>(std::clock() - busy) /
                                                static_cast<double>(CLOCKS_PER_SEC));
    out.wall = std::min(out.wall, wall.count());
    out.hash = 0;
    out.impacts = 0;
    for (const auto& row : all.rows) {
        for (const double x : row.value().x) {
            out.hash = detail::SplitMix(out.hash ^ std::bit_cast<std::uint64_t>(x)).bits();
        }
        out.impacts += row->impacts;
    }
}

}  // namespace

Measured run_ensemble_of_balls()
{
    constexpr std::array<unsigned, 3> threads{1, 2, 4};
    std::array<Timed, 3> timed{};
    for (int round = 0; round < 3; ++round) {
        for (std::size_t i = 0; i < threads.size(); ++i) run_on(threads[i], timed[i]);
    }
    Measured out;
    bool same = true;
    for (std::size_t i = 0; i < threads.size(); ++i) {
        same = same && timed[i].hash == timed[0].hash;
        out.details.push_back(fmt::format(
            "{} threads: {:.2f} s, processor time {:.2f} s ({:.2f} us an impact), hash {:016x}",
            threads[i], timed[i].wall, timed[i].processor,
            1e6 * timed[i].processor / static_cast<double>(timed[i].impacts), timed[i].hash));
    }
    const double gain = timed[0].wall / timed[1].wall;
    const double cost = timed[1].processor / timed[0].processor;
    out.pass = same && gain >= 1.8;
    out.text = fmt::format("{:.2f} times faster, {:.2f} of the processor time, {}", gain, cost,
                           same ? "the same bits" : "OTHER BITS");
    return out;
}

}  // namespace ricochet::bench
