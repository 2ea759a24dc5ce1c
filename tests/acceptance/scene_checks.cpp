// Scenes of many bodies: the cost of an impact where bodies are alone, in the order of time, and in
// a gas; the cost of sleepers and stiff islands to the others; conserved quantities.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "measure.hpp"
#include "ricochet/scene/simulate.hpp"
#include "scene/gas.hpp"
#include "scene_time.hpp"

namespace ricochet::bench {

namespace {

Scene balls(int count)
{
    Scene scene({.gravity = {0, -9.81}});
    scene.wall({.normal = {0, 1}});
    for (int i = 0; i < count; ++i) {
        scene.disc({.at = {1.0 * i, 1.5 + 9.0 * (i * 37 % 101) / 101}, .radius = 0.25});
    }
    return scene;
}

/// [s] per impact of balls that meet no other.
double time_balls(int count, double t_end, bool recorded)
{
    const Scene scene = balls(count);
    double impacts = 0;
    const double time = least_time([&] {
        const SceneRun run = simulate(scene, {.t_end = t_end, .record_events = recorded});
        impacts = static_cast<double>(run.statistics.events);
    });
    return time / impacts;
}

Measured time_alone_balls()
{
    const double each = time_balls(1, 2e6, false);
    return {.pass = each <= 5e-9, .text = fmt::format("{:.2g} ns", 1e9 * each)};
}

Measured time_ordered_balls()
{
    const double some = time_balls(10'000, 40, true);
    const double many = time_balls(1'000'000, 2, true);
    return {
        .pass = some <= 110e-9 && many <= 200e-9,
        .text = fmt::format("{:.0f} ns at 10 000, {:.0f} ns at 1 000 000", 1e9 * some, 1e9 * many)};
}

Measured time_gases()
{
    struct Row {
        std::size_t count;
        double t_end, limit;
    };
    Measured out{.pass = true, .text = ""};
    for (const Row& row : {Row{100, 50, 1e-6}, Row{1000, 2, 1e-6}, Row{10'000, 0.1, 1.7e-6},
                           Row{100'000, 0.005, 4e-6}}) {
        const Scene scene = test::gas({.count = row.count});
        double impacts = 0;
        const double time = least_time([&] {
            const SceneRun run = simulate(scene, {.t_end = row.t_end, .record_events = false});
            impacts = static_cast<double>(run.statistics.events);
        });
        out.pass = out.pass && time / impacts <= row.limit;
        out.text += fmt::format("{}{:.0f} ns at {}", out.text.empty() ? "" : ", ",
                                1e9 * time / impacts, row.count);
        out.details.push_back(fmt::format("{} discs, {:.0f} collisions, limit {:.0f} ns", row.count,
                                          impacts, 1e9 * row.limit));
    }
    return out;
}

/// One disc between two walls, above `sleepers` that rest on the floor.
Scene above_sleepers(int sleepers)
{
    Scene scene({.gravity = {0, 0}});
    scene.wall({.point = {-2, 0}, .normal = {1, 0}});
    scene.wall({.point = {3002, 0}, .normal = {-1, 0}});
    scene.disc({.at = {0, 4}, .velocity = {1000, 0}});
    for (int i = 0; i < sleepers; ++i) scene.disc({.at = {3.0 * i, 1}});
    return scene;
}

Measured time_sleepers()
{
    const Scene one = above_sleepers(0);
    const Scene many = above_sleepers(1000);
    const auto run = [](const Scene& scene) {
        return least_time(
            [&] { static_cast<void>(simulate(scene, {.t_end = 1e5, .record_events = false})); });
    };
    const double ratio = run(many) / run(one);
    return {.pass = ratio <= 1.1, .text = fmt::format("{:.2f} times", ratio)};
}

/// Dumbbells on a square grid, one of stiffness 1e6, the rest 20.
Scene dumbbells(int count, bool one_island)
{
    Scene scene;
    std::vector<BodyId> ends;
    for (int i = 0; i < count; ++i) {
        const double x = 4.0 * (i % 8);
        const double y = 4.0 * (i / 8);
        ends.push_back(scene.disc({.at = {x, y}, .velocity = {0.1 * (i % 3), 0.2}, .radius = 0.2}));
        ends.push_back(
            scene.disc({.at = {x + 1, y}, .velocity = {0, -0.1 * (i % 5)}, .radius = 0.2}));
        scene.spring({.between = {ends[ends.size() - 2], ends.back()},
                      .rest = 0.9,
                      .stiffness = i == 0 ? 1e6 : 20});
        // A spring without force joins all bodies to one state.
        if (one_island && i > 0) scene.spring({.between = {ends[0], ends.back()}});
    }
    return scene;
}

Measured time_stiff_island()
{
    const auto run = [](const Scene& scene) {
        return least_time(
            [&] { static_cast<void>(simulate(scene, {.t_end = 2, .record_events = false})); });
    };
    const double ratio = run(dumbbells(50, true)) / run(dumbbells(50, false));
    return {.pass = ratio >= 20, .text = fmt::format("{:.0f} times", ratio)};
}

Measured conserve()
{
    Measured out{.pass = true, .text = ""};
    double energy_error = 0;
    double overlap = -1;
    for (const std::size_t count : {10U, 100U, 1000U}) {
        const Scene scene = test::gas({.count = count});
        const double size = std::sqrt(static_cast<double>(count));
        const double t_end = 6e5 / (static_cast<double>(count) * size);
        // The collisions where discs are nearest: at 20 of them, spread over the run.
        SceneOptions options{.t_end = t_end};
        const SceneRun first = simulate(scene, options);
        options.record_events = false;
        for (std::size_t k = 1; k <= 20; ++k) {
            options.sample_times.push_back(first.events[k * (first.events.size() - 1) / 20].t);
        }
        const SceneRun run = simulate(scene, options);
        const double start = energy(scene, test::start_of(scene));
        energy_error = std::max(energy_error, std::fabs(energy(scene, run.bodies) / start - 1));
        const double diameter = 2 * scene.bodies()[0].radius;
        for (const auto& states : run.samples) {
            overlap = std::max(overlap, test::overlap(scene, states) / diameter);
        }
        out.details.push_back(
            fmt::format("{} discs: {} collisions", count, run.statistics.impacts));
    }
    out.pass = energy_error <= 1e-12 && overlap <= 1e-13;
    out.text = fmt::format("energy {:.1e}, overlap {:.1e} of a diameter", energy_error, overlap);
    return out;
}

}  // namespace

std::vector<Check> scene_checks()
{
    return {
        {.topic = "scenes",
         .id = "alone",
         .sentence = "an impact of a ball that meets no other, closed form",
         .target = "<= 5 ns",
         .run = time_alone_balls},
        {.topic = "scenes",
         .id = "in-order",
         .sentence = "an impact of balls that meet no other, all events in the order of time",
         .target = "<= 110 ns at 10 000 balls, <= 200 ns at 1 000 000",
         .run = time_ordered_balls},
        {.topic = "scenes",
         .id = "gas",
         .sentence = "a collision of discs in a box of which they cover 0.3",
         .target = "<= 1 us to 1000, <= 1.7 us at 10 000, <= 4 us at 100 000",
         .run = time_gases},
        {.topic = "scenes",
         .id = "sleepers",
         .sentence = "one disc that moves beside 1000 that sleep, over the one alone",
         .target = "<= 1.1 times",
         .run = time_sleepers},
        {.topic = "scenes",
         .id = "stiff-island",
         .sentence = "50 dumbbells, one of them stiff, in one state over islands with own steps",
         .target = ">= 20 times",
         .run = time_stiff_island},
        {.topic = "scenes",
         .id = "conserved",
         .sentence = "energy and overlap in gases of 10, 100 and 1000 discs",
         .target = "<= 1e-12 and <= 1e-13 of a diameter",
         .run = conserve},
        {.topic = "scenes",
         .id = "dopri5-balls",
         .sentence = "an impact of balls that advance by dopri5",
         .target = "<= 0.4 us for one, <= 0.7 us at 10 000",
         .run = time_slowed_balls},
        {.topic = "scenes",
         .id = "one-state",
         .sentence = "impacts of 1000 balls that advance by dopri5, in one state over in a scene",
         .target = ">= 1000 times",
         .run = compare_one_state},
        {.topic = "scenes",
         .id = "common-step",
         .sentence = "2 to 50 equal dumbbells as islands with own steps, over one state",
         .target = "<= 1.1 times",
         .run = compare_common_steps},
        {.topic = "scenes",
         .id = "plain-run",
         .sentence = "a scene of one body without surfaces, over `integrate`",
         .target = "<= 1.03 times",
         .run = compare_plain_run},
        {.topic = "scenes",
         .id = "labels",
         .sentence = "gases of 100 and 1000 discs whose labels are exchanged",
         .target = "the same bits",
         .run = relabel_bodies},
        {.topic = "scenes",
         .id = "reversal",
         .sentence = "gases after 4 collisions a disc, and back",
         .target = "<= 1e-10",
         .run = reverse_gases},
        {.topic = "scenes",
         .id = "brute-force",
         .sentence = "the first 60 collisions of five gases, beside brute force in long double",
         .target = "<= 1e-12 s in the first 20, <= 1e-6 s in all",
         .run = compare_brute_force},
        {.topic = "scenes",
         .id = "cradles",
         .sentence = "Newton's cradles of 2 to 9 balls",
         .target = "<= 1e-14",
         .run = swing_cradles},
        {.topic = "scenes",
         .id = "rest",
         .sentence = "a stack at rest for 1e4 s",
         .target = "no bit changes",
         .run = rest_for_long},
        {.topic = "scenes",
         .id = "piles",
         .sentence = "2 s of 32 discs that fall into a bin and slide with friction",
         .target = "<= 1 s",
         .run = time_piles},
    };
}

}  // namespace ricochet::bench
