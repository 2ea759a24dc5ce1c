// Cost of an event of a scene, over the number of bodies, how densely they fill their box, their
// size, terrain, unequal sizes, and gases that expand and contract.
//
//     ricochet_scene_axes [--best]
//
// --best: also with cells of forced sides, and prints the least cost among them.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "scene/options.hpp"
#include "scene_rows.hpp"

namespace ricochet::bench {

namespace {

using Random = std::mt19937_64;

double uniform(Random& random)
{
    return std::uniform_real_distribution<double>(-1, 1)(random);
}

struct Case {
    std::string axis, value;
    Scene scene;
    double t_end = 1e9;
    std::uint64_t events = 50'000;
    double size = 1;  ///< [m] of the box
};

Scene box(double width = 1, double height = 1)
{
    Scene scene;
    scene.wall({.point = {0, 0}, .normal = {0, 1}});
    scene.wall({.point = {0, 0}, .normal = {1, 0}});
    scene.wall({.point = {width, height}, .normal = {0, -1}});
    scene.wall({.point = {width, height}, .normal = {-1, 0}});
    return scene;
}

/// Discs on a triangular lattice in a box that it fills, of radius `part` of the closest.
Scene lattice(std::size_t columns, std::size_t rows, double part, unsigned seed = 1)
{
    const double pitch = 1.0 / static_cast<double>(columns);
    const double height = std::sqrt(3.0) / 2 * pitch;
    const double radius = part * pitch / 2;
    Scene scene = box((static_cast<double>(columns) + 0.5) * pitch,
                      (static_cast<double>(rows) - 1) * height + pitch);
    Random random(seed);
    for (std::size_t i = 0; i < rows; ++i) {
        for (std::size_t k = 0; k < columns; ++k) {
            const double x = static_cast<double>(k) + (i % 2 == 0 ? 0.5 : 1.0);
            scene.disc({.at = {x * pitch, pitch / 2 + static_cast<double>(i) * height},
                        .velocity = {uniform(random), uniform(random)},
                        .radius = radius});
        }
    }
    return scene;
}

/// N discs that cover a fraction of the unit square, from a square lattice with play.
Scene gas(std::size_t count, double fraction)
{
    const auto columns =
        static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(count)) - 1e-9));
    const double pitch = 1.0 / static_cast<double>(columns);
    const double radius = std::sqrt(fraction / (static_cast<double>(count) * std::numbers::pi));
    const double play = std::max(pitch / 2 - radius, 0.0);
    Scene scene = box();
    Random random(1);
    for (std::size_t i = 0; i < count; ++i) {
        const auto x = static_cast<double>(i % columns) + 0.5;
        const auto y = static_cast<double>(i / columns) + 0.5;
        scene.disc({.at = {x * pitch + play * uniform(random), y * pitch + play * uniform(random)},
                    .velocity = {uniform(random), uniform(random)},
                    .radius = radius});
    }
    return scene;
}

/// Balls inside a polygon of radius 1.
Scene polygon(std::size_t sides, std::size_t balls, double radius)
{
    Scene scene;
    std::vector<Vector2> points;
    for (std::size_t k = 0; k < sides; ++k) {
        const double angle =
            2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(sides);
        points.push_back({std::cos(angle), std::sin(angle)});
    }
    points.push_back(points[0]);
    scene.terrain({.points = points});
    Random random(2);
    const auto columns =
        static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(balls)) - 1e-9));
    for (std::size_t i = 0; i < balls; ++i) {
        const double pitch = 0.9 / static_cast<double>(columns);
        const auto at = [&](std::size_t c) {
            return pitch * (static_cast<double>(c) + 0.5) - 0.45 + 1e-3 * pitch * uniform(random);
        };
        scene.disc({.at = {at(i % columns), at(i / columns)},
                    .velocity = {uniform(random), uniform(random)},
                    .radius = radius});
    }
    return scene;
}

/// A ball that bounces along a floor of many segments under gravity.
Scene ramp(std::size_t segments, double radius)
{
    Scene scene({.gravity = {0, -9.81}});
    std::vector<Vector2> points;
    for (std::size_t k = 0; k <= segments; ++k) {
        const double x = static_cast<double>(k) / static_cast<double>(segments);
        points.push_back({1000 * x, 3 * std::sin(40 * x)});
    }
    scene.terrain({.points = points});
    scene.disc({.at = {500, 5}, .velocity = {0.1, 0}, .radius = radius});
    return scene;
}

/// Pins of short segments, of which balls strike one after the other.
Scene pins(std::size_t rows, std::size_t balls)
{
    Scene scene({.gravity = {0, -1}});
    const MaterialId wood = scene.material({.restitution = 0.8});
    for (std::size_t i = 0; i < rows; ++i) {
        for (std::size_t k = 0; k < rows; ++k) {
            const double x = static_cast<double>(k) + (i % 2 == 0 ? 0.0 : 0.5);
            const double y = static_cast<double>(i);
            scene.terrain({.points = {{x, y}, {x + 0.02, y + 0.02}}, .material = wood});
        }
    }
    Random random(3);
    const auto width = static_cast<double>(rows);
    scene.wall({.point = {-0.2, 0}, .normal = {1, 0}});
    scene.wall({.point = {width + 0.2, 0}, .normal = {-1, 0}});
    scene.wall({.point = {0, -1}, .normal = {0, 1}});
    for (std::size_t i = 0; i < balls; ++i) {
        scene.point({.at = {width * (0.5 + 0.4 * uniform(random)), width + 1},
                     .velocity = {0.1 * uniform(random), 0},
                     .material = wood});
    }
    return scene;
}

/// Discs whose radii are spread evenly by their logarithm between `least` and `ratio` times it.
Scene unequal(std::size_t count, double least, double ratio)
{
    Scene scene = box();
    Random random(4);
    std::vector<double> radii;
    for (std::size_t i = 0; i < count; ++i) {
        radii.push_back(least * std::pow(ratio, 0.5 + 0.5 * uniform(random)));
    }
    std::ranges::sort(radii, std::greater<>{});
    std::vector<Disc> discs;
    for (const double r : radii) {
        for (int attempt = 0; attempt < 100'000; ++attempt) {
            const Vector2 at{0.5 + (0.5 - r) * uniform(random), 0.5 + (0.5 - r) * uniform(random)};
            const bool free = std::ranges::all_of(discs, [&](const Disc& d) {
                return std::hypot(at[0] - d.at[0], at[1] - d.at[1]) > d.radius + r;
            });
            if (!free) continue;
            // Of equal energy.
            const double speed = least / r;
            discs.push_back({.at = at,
                             .velocity = {speed * uniform(random), speed * uniform(random)},
                             .radius = r,
                             .mass = r * r});
            break;
        }
    }
    for (const Disc& disc : discs) scene.disc(disc);
    return scene;
}

/// 2025 discs in a square of 1 in the middle of a box of 100, or all over a box of 100 of which two
/// walls close in on them.
Scene in_void(bool contracts)
{
    Scene scene;
    scene.wall({.point = {0, 0}, .normal = {1, 0}});
    scene.wall({.point = {0, 0}, .normal = {0, 1}});
    const double speed = contracts ? -1 : 0;
    scene.wall({.point = {100, 100}, .normal = {-1, 0}, .motion = ConstantVelocity{{speed, 0}}});
    scene.wall({.point = {100, 100}, .normal = {0, -1}, .motion = ConstantVelocity{{0, speed}}});
    Random random(5);
    for (int i = 0; i < 2025; ++i) {
        const Vector2 at{(i % 45 + 0.5) / 45 - 0.5, (i / 45 + 0.5) / 45 - 0.5};
        const double scale = contracts ? 98 : 1;
        scene.disc({.at = {50 + scale * at[0], 50 + scale * at[1]},
                    .velocity = {uniform(random), uniform(random)},
                    .radius = contracts ? 0.06 : 0.008});
    }
    return scene;
}

/// 2025 discs in a box of terrain, and one far away.
Scene comet()
{
    Scene scene;
    scene.terrain({.points = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}}});
    const Scene others = gas(2025, 0.3);
    for (const Disc& disc : others.bodies()) scene.disc(disc);
    scene.disc({.at = {1e5, 1e5}, .velocity = {0.1, 0}, .radius = 0.01});
    return scene;
}

Scene points(std::size_t count, bool clustered)
{
    Scene scene = box();
    Random random(6);
    for (std::size_t i = 0; i < count; ++i) {
        const Vector2 near{0.1 + 0.1 * (uniform(random) + 1), 0.1 + 0.1 * (uniform(random) + 1)};
        const Vector2 at{0.5 + 0.5 * uniform(random), 0.5 + 0.5 * uniform(random)};
        scene.point({.at = clustered ? near : at, .velocity = {uniform(random), uniform(random)}});
    }
    return scene;
}

/// Few discs among many points.
Scene mixture(std::size_t discs, std::size_t points)
{
    Scene scene = box();
    Random random(7);
    for (std::size_t i = 0; i < discs; ++i) {
        const auto x = static_cast<double>(i % 10);
        const auto y = static_cast<double>(i / 10);
        scene.disc({.at = {0.1 * x + 0.05, 0.1 * y + 0.05},
                    .velocity = {uniform(random), uniform(random)},
                    .radius = 0.01});
    }
    for (std::size_t i = 0; i < points;) {
        const Vector2 at{0.5 + 0.5 * uniform(random), 0.5 + 0.5 * uniform(random)};
        const bool free = std::ranges::all_of(scene.bodies(), [&](const Disc& d) {
            return d.radius == 0 || std::hypot(at[0] - d.at[0], at[1] - d.at[1]) > d.radius;
        });
        if (!free) continue;
        scene.point({.at = at, .velocity = {uniform(random), uniform(random)}, .mass = 0.01});
        ++i;
    }
    return scene;
}

std::vector<Case> cases()
{
    std::vector<Case> all;
    for (const std::size_t n : {1UL, 10UL, 100UL, 1000UL, 10'000UL, 100'000UL}) {
        all.push_back(
            {"discs", fmt::format("{}", n), gas(n, 0.3), 1e9, n < 100'000 ? 50'000U : 200'000U});
    }
    for (const double fraction : {0.01, 0.1, 0.3, 0.6, 0.75}) {
        all.push_back({"filling", fmt::format("{}", fraction), gas(1000, fraction)});
    }
    // 0.9069 of the plane are covered by the closest packing.
    all.push_back({"filling", "0.88", lattice(32, 32, std::sqrt(0.88 / 0.9069))});
    for (const double r : {1e-5, 1e-4, 1e-3, 1e-2}) {
        all.push_back({"radius of 1000 discs", fmt::format("{:g}", r),
                       gas(1000, 1000 * std::numbers::pi * r * r)});
    }
    for (const double r : {1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.3}) {
        all.push_back({"radius in a polygon of 100", fmt::format("{:g}", r), polygon(100, 1, r),
                       1e9, 20'000});
    }
    for (const std::size_t n : {10UL, 100UL, 1000UL, 10'000UL, 100'000UL}) {
        all.push_back(
            {"sides, one ball of 0.01", fmt::format("{}", n), polygon(n, 1, 0.01), 1e9, 20'000});
    }
    for (const std::size_t n : {10UL, 100UL, 1000UL, 10'000UL, 100'000UL}) {
        all.push_back(
            {"sides, 100 balls of 0.01", fmt::format("{}", n), polygon(n, 100, 0.01), 1e9, 20'000});
    }
    for (const std::size_t n : {10UL, 1000UL, 100'000UL}) {
        all.push_back({"segments of a floor", fmt::format("{}", n), ramp(n, 0.0005), 1e9, 10'000});
    }
    for (const std::size_t n : {5UL, 30UL, 100UL}) {
        all.push_back({"pins, 100 points", fmt::format("{}", n * n), pins(n, 100), 1e9, 20'000});
    }
    for (const double ratio : {1.0, 10.0, 100.0, 1000.0}) {
        all.push_back(
            {"ratio of radii", fmt::format("{:g}", ratio), unequal(1000, 0.05 / 1000, ratio)});
    }
    all.push_back({"expands", "100", in_void(false), 1e9, 20'000, 100});
    all.push_back({"contracts", "100", in_void(true), 90, 500'000, 100});
    all.push_back({"comet", "1e5", comet()});
    for (const std::size_t n : {10UL, 100UL, 1000UL, 4000UL}) {
        all.push_back(
            {"points", fmt::format("{}", n), points(n, false), 4e4 / static_cast<double>(n)});
    }
    all.push_back({"points in a corner", "3600", points(3600, true), 20});
    all.push_back({"10 discs and points", "3000", mixture(10, 3000), 1e9, 20'000});
    all.push_back({"100 discs and points", "1000", mixture(100, 1000), 1e9, 20'000});
    return all;
}

struct Cost {
    double each = 0;  ///< [s] an event
    SceneRun run;
};

/// A run that ends after some seconds, whatever it has done by then.
SceneRun limited(const Case& of, SceneOptions options, [[maybe_unused]] double side, double* spent)
{
    std::atomic<bool> stop = false;
    std::atomic<bool> done = false;
    options.cancelled = &stop;
    std::thread watch([&] {
        for (int k = 0; k < 400 && !done; ++k) {
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        stop = true;
    });
    const std::clock_t start = std::clock();
#ifdef RICOCHET_BEFORE
    SceneRun run = simulate(of.scene, options);
#else
    SceneRun run = detail::simulate(of.scene, options, {.cell_side = side});
#endif
    *spent = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    done = true;
    watch.join();
    return run;
}

/// The least of several runs to the time at which the events have happened.
Cost measure(const Case& of, double side)
{
    const auto each = [](const SceneRun& run, double seconds) {
        return seconds / static_cast<double>(std::max<std::uint64_t>(run.statistics.events, 1));
    };
    SceneOptions options{.t_end = of.t_end, .record_events = false};
    const bool points_alone = of.axis.starts_with("points");
    if (!points_alone) options.max_events = of.events;
    double seconds = 0;
    Cost best;
    best.run = limited(of, options, side, &seconds);
    best.each = each(best.run, seconds);
    options = {.t_end = best.run.t, .record_events = false};
    double sum = seconds;
    for (int turn = 0; turn < 3 && sum < 2; ++turn) {
        SceneRun run = limited(of, options, side, &seconds);
        sum += seconds;
        if (turn == 0 || each(run, seconds) < best.each) {
            best.each = each(run, seconds);
            best.run = std::move(run);
        }
    }
    return best;
}

std::uint64_t hash_of(const SceneRun& run)
{
    BitHash hash;
    hash.add(run.t);
    for (const BodyState& body : run.bodies) {
        for (const double x : body.at) hash.add(x);
        for (const double v : body.velocity) hash.add(v);
    }
    return hash.value();
}

void show(const Case& of, [[maybe_unused]] bool with_best)
{
    const Cost cost = measure(of, std::nan(""));
    const SceneStatistics& s = cost.run.statistics;
    const auto events = static_cast<double>(std::max<std::uint64_t>(s.events, 1));
    std::string best;
#ifndef RICOCHET_BEFORE
    if (with_best) {
        double least = cost.each;
        for (double side = of.size; side > 1e-3 * of.size; side /= 2) {
            const Cost forced = measure(of, side);
            if (forced.run.outcome != Outcome::cancelled) least = std::min(least, forced.each);
        }
        best = fmt::format(" {:9.2f} |", 1e6 * least);
    }
    const std::uint64_t layings = s.layings;
#else
    const std::uint64_t layings = 0;
#endif
    fmt::print("| {:26} | {:>7} | {:7} | {:9.2f} |{} {:8.1f} | {:9.1f} | {:3} | {:016x}\n", of.axis,
               of.value, s.events, 1e6 * cost.each, best,
               static_cast<double>(s.predictions) / events,
               static_cast<double>(s.crossings) / events, layings, hash_of(cost.run));
    std::fflush(stdout);
}

}  // namespace

}  // namespace ricochet::bench

int main(int count, char** arguments)
{
    using namespace ricochet::bench;
    const bool best = count > 1 && std::strcmp(arguments[1], "--best") == 0;
    fmt::print("| axis | value | events | us an event |{} tests | crossings | laid again | bits\n",
               best ? " best |" : "");
    for (const Case& of : cases()) show(of, best);
    return 0;
}
