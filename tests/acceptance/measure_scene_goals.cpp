// Promises of scenes about their answers: labels, reversal, collisions of brute force, cradles,
// rest; and about their cost beside plain runs and common steps.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "measure.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/scene/simulate.hpp"
#include "scene/brute_force.hpp"
#include "scene/gas.hpp"
#include "scene_time.hpp"

namespace ricochet::bench {

namespace {

/// Balls above a floor that are hardly slowed by drag: they advance by steps of dopri5.
Scene slowed_balls(int count)
{
    Scene scene({.gravity = {0, -9.81}});
    scene.wall({.normal = {0, 1}});
    for (int i = 0; i < count; ++i) {
        const double height = 1.5 + 9.0 * (i * 37 % 101) / 101;
        scene.disc({.at = {1.0 * i, height}, .radius = 0.25, .drag = 1e-6});
    }
    return scene;
}

/// One body slowed by drag, as a system of the core.
struct SlowedBody {
    using State = std::array<double, 4>;
    double drag = 0.1;  ///< [1/s]
    void flow(double /*t*/, const State& x, State& rate) const
    {
        rate = {x[2], x[3], -drag * x[2], -9.81 - drag * x[3]};
    }
};

/// The balls of a scene in one state of `integrate`: heights, then velocities.
struct BallsInOneState {
    using State = std::vector<double>;
    std::size_t count;
    double radius = 0.25, drag = 1e-6;

    [[nodiscard]] std::size_t guard_count() const { return count; }
    void flow(double /*t*/, const State& x, State& rate) const
    {
        for (std::size_t i = 0; i < count; ++i) {
            rate[i] = x[count + i];
            rate[count + i] = -9.81 - drag * x[count + i];
        }
    }
    [[nodiscard]] double guard(std::size_t i, double /*t*/, const State& x) const
    {
        return x[i] - radius;
    }
    [[nodiscard]] double guard_rate(std::size_t i, double /*t*/, const State& /*x*/,
                                    const State& rate) const
    {
        return rate[i];
    }
    void reset(std::size_t i, double /*t*/, State& x) const
    {
        x[i] = radius;
        x[count + i] = -x[count + i];
    }
};

/// Equal dumbbells, separate or joined to one state by springs without force.
Scene equal_dumbbells(int count, bool joined)
{
    Scene scene;
    std::vector<BodyId> ends;
    for (int i = 0; i < count; ++i) {
        const double y = 4.0 * i;
        const auto a = scene.disc({.at = {0, y}, .velocity = {0, 0.01}, .radius = 0.2});
        const auto b = scene.disc({.at = {1 + 0.01 * i, y}, .radius = 0.2});
        scene.spring({.between = {a, b}, .rest = 0.9, .stiffness = 20});
        if (joined && i > 0) scene.spring({.between = {ends[0], a}});
        ends.push_back(a);
    }
    return scene;
}

/// Whether two runs of the same bodies in another order have the same bits.
bool same_bits(const SceneRun& one, const SceneRun& two, const std::vector<std::size_t>& order)
{
    const auto same = [](const Vector2& a, const Vector2& b) {
        return std::bit_cast<std::array<std::uint64_t, 2>>(a) ==
               std::bit_cast<std::array<std::uint64_t, 2>>(b);
    };
    bool all = one.events.size() == two.events.size();
    for (std::size_t k = 0; all && k < order.size(); ++k) {
        const BodyState& a = one.bodies[order[k]];
        all = same(a.at, two.bodies[k].at) && same(a.velocity, two.bodies[k].velocity);
    }
    return all;
}

double lead_back(std::size_t count)
{
    const Scene scene = test::gas({.count = count});
    // The number of events of four collisions per disc; those of two discs count for both.
    const SceneRun longer = simulate(scene, {.t_end = 1e3, .max_events = 4 * count});
    std::size_t collisions = 0;
    std::uint64_t events = 0;
    for (; collisions < 4 * count; ++events) {
        collisions += longer.events[events].other.is_surface ? 1 : 2;
    }
    const SceneRun there = simulate(scene, {.t_end = 1e3, .max_events = events});
    Scene turned;
    for (const Scene::Surface& s : scene.surfaces()) {
        turned.wall({.point = s.points[0], .normal = s.normal});
    }
    for (std::size_t i = 0; i < count; ++i) {
        Disc disc = scene.bodies()[i];
        disc.material = {};
        disc.at = there.bodies[i].at;
        disc.velocity = {-there.bodies[i].velocity[0], -there.bodies[i].velocity[1]};
        turned.disc(disc);
    }
    const SceneRun back = simulate(turned, {.t_end = there.t});
    double worst = 0;
    for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t c = 0; c < 2; ++c) {
            worst = std::max(worst, std::fabs(back.bodies[i].at[c] - scene.bodies()[i].at[c]));
        }
    }
    return worst;
}

/// A stack of ten discs in a slot, and three on the floor beside it, dropped from a little above.
Scene stack()
{
    Scene scene({.gravity = {0, -9.81}});
    const auto clay = scene.material({.restitution = 0.3, .friction = 0.5});
    scene.wall({.normal = {0, 1}, .material = clay});
    scene.wall({.normal = {1, 0}, .material = clay});
    scene.wall({.point = {0.9, 0}, .normal = {-1, 0}, .material = clay});
    for (int i = 0; i < 12; ++i) {
        const double radius = 0.11 + 0.01 * (i % 3);
        scene.disc({.at = {0.15 + 0.29 * (i % 3), 0.2 + 0.28 * (i / 3)},
                    .radius = radius,
                    .mass = 50 * radius * radius,
                    .material = clay});
    }
    return scene;
}

}  // namespace

Measured time_slowed_balls()
{
    const auto each = [](int count, double t_end) {
        const Scene scene = slowed_balls(count);
        double impacts = 0;
        const double time = least_time([&] {
            const SceneRun run = simulate(scene, {.t_end = t_end, .record_events = false});
            impacts = static_cast<double>(run.statistics.events);
        });
        return time / impacts;
    };
    const double one = each(1, 2e4);
    const double many = each(10'000, 10);
    return {.pass = one <= 0.4e-6 && many <= 0.7e-6,
            .text = fmt::format("{:.2f} us for one, {:.2f} us at 10 000", 1e6 * one, 1e6 * many)};
}

Measured compare_one_state()
{
    constexpr std::size_t count = 1000;
    constexpr double t_end = 10;
    const BallsInOneState balls{count};
    std::vector<double> start(2 * count);
    Scene scene({.gravity = {0, -9.81}});
    scene.wall({.normal = {0, 1}});
    for (std::size_t i = 0; i < count; ++i) {
        start[i] = 1.5 + 9.0 * static_cast<double>(i) / count;
        scene.disc({.at = {1.0 * static_cast<double>(i), start[i]},
                    .radius = balls.radius,
                    .drag = balls.drag});
    }
    SceneRun of_scene;
    const double time = least_time([&] { of_scene = simulate(scene, {.t_end = t_end}); });
    std::vector<double> impacts;
    const double in_one = least_time([&] {
        const auto run = integrate(balls, start, {.t_end = t_end, .rtol = 1e-8, .atol = 1e-10});
        impacts.clear();
        for (const auto& event : run.events) impacts.push_back(event.t);
    });
    double apart = impacts.size() == of_scene.events.size() ? 0 : 1;
    for (std::size_t k = 0; apart < 1 && k < impacts.size(); ++k) {
        apart = std::max(apart, std::fabs(impacts[k] - of_scene.events[k].t));
    }
    const double each = 1e6 / static_cast<double>(impacts.size());
    return {
        .pass = in_one >= 1000 * time && apart <= 1e-6,
        .text = fmt::format("{:.0f} times", in_one / time),
        .details = {fmt::format("{} impacts, {:.2f} us each in the scene, {:.0f} us each in one "
                                "state, {:.1e} s apart",
                                impacts.size(), time * each, in_one * each, apart)}};
}

Measured compare_common_steps()
{
    Measured out{.pass = true, .text = ""};
    double worst = 0;
    for (const int count : {2, 5, 10, 50}) {
        const auto run = [](const Scene& scene) {
            return [&scene] {
                static_cast<void>(simulate(scene, {.t_end = 50, .record_events = false}));
            };
        };
        const Scene own = equal_dumbbells(count, false);
        const Scene common = equal_dumbbells(count, true);
        const double ratio = time_ratio(run(own), run(common), 5);
        worst = std::max(worst, ratio);
        out.details.push_back(fmt::format("{} dumbbells: {:.2f} times", count, ratio));
    }
    out.pass = worst <= 1.1;
    out.text = fmt::format("{:.2f} times", worst);
    return out;
}

Measured compare_plain_run()
{
    Scene scene({.gravity = {0, -9.81}});
    scene.disc({.at = {0, 0}, .velocity = {3, 4}, .drag = 0.1});
    const SlowedBody body;
    SceneRun of_scene;
    SlowedBody::State x{};
    std::uint64_t steps = 0;
    const auto in_scene = [&] { of_scene = simulate(scene, {.t_end = 2e5}); };
    const auto plain = [&] {
        const auto run = integrate(body, {0, 0, 3, 4}, {.t_end = 2e5, .rtol = 1e-8, .atol = 1e-10});
        x = run.x;
        steps = run.statistics.steps;
    };
    const double ratio = time_ratio(in_scene, plain, 7);
    const double per_step =
        ratio * static_cast<double>(steps) / static_cast<double>(of_scene.statistics.steps);
    const double apart = std::fabs(of_scene.bodies[0].at[0] - x[0]);
    return {.pass = ratio <= 1.03 && apart <= 1e-6,
            .text = fmt::format("{:.3f} times", ratio),
            .details = {fmt::format("{} steps and {}, {:.3f} times a step, {:.1e} m apart",
                                    of_scene.statistics.steps, steps, per_step, apart)}};
}

Measured relabel_bodies()
{
    Measured out{.pass = true, .text = "the same bits"};
    for (const std::size_t count : {100U, 1000U}) {
        for (const unsigned seed : {7U, 8U, 9U}) {
            std::vector<std::size_t> order(count);
            std::iota(order.begin(), order.end(), 0U);
            std::shuffle(order.begin(), order.end(), std::mt19937(seed));
            const test::Gas wanted{
                .count = count, .restitution = 0.99, .gravity = {0.1, -1}, .spread = 0.2};
            const SceneOptions options{.t_end = count == 100 ? 20.0 : 0.5};
            const SceneRun one = simulate(test::gas(wanted), options);
            const SceneRun two = simulate(test::gas(wanted, order), options);
            out.pass = out.pass && same_bits(one, two, order);
            out.details.push_back(fmt::format("{} discs, {} events", count, one.events.size()));
        }
    }
    if (!out.pass) out.text = "other bits";
    return out;
}

Measured reverse_gases()
{
    Measured out{.pass = true, .text = ""};
    for (const std::size_t count : {10U, 100U, 1000U}) {
        const double apart = lead_back(count);
        out.pass = out.pass && apart <= 1e-10;
        out.text += fmt::format("{}{:.1e} at {}", out.text.empty() ? "" : ", ", apart, count);
    }
    return out;
}

Measured compare_brute_force()
{
    double first = 0;
    double all = 0;
    for (unsigned seed = 1; seed <= 5; ++seed) {
        const Scene scene = test::gas({.count = 10, .fraction = 0.2, .spread = 0.3, .seed = seed});
        const SceneRun run = simulate(scene, {.t_end = 100, .max_events = 60});
        test::BruteForce exact(scene);
        for (std::size_t k = 0; k < run.events.size(); ++k) {
            const double apart = std::fabs(run.events[k].t - static_cast<double>(exact.next()));
            all = std::max(all, apart);
            if (k < 20) first = std::max(first, apart);
        }
    }
    return {.pass = first <= 1e-12 && all <= 1e-6,
            .text = fmt::format("{:.1e} s in the first 20, {:.1e} s in all 60", first, all)};
}

Measured swing_cradles()
{
    double velocity = 0;
    double momentum = 0;
    double energies = 0;
    for (int balls = 2; balls <= 9; ++balls) {
        Scene scene;
        scene.disc({.at = {-3, 0}, .velocity = {1, 0}, .radius = 0.5});
        for (int i = 1; i < balls; ++i) scene.disc({.at = {1.0 * i, 0}, .radius = 0.5});
        const SceneRun run = simulate(scene, {.t_end = 4});
        double sum = 0;
        for (int i = 0; i < balls; ++i) {
            const double v = run.bodies[static_cast<std::size_t>(i)].velocity[0];
            velocity = std::max(velocity, std::fabs(v - (i == balls - 1 ? 1 : 0)));
            sum += v;
        }
        momentum = std::max(momentum, std::fabs(sum - 1));
        energies = std::max(energies, std::fabs(2 * energy(scene, run.bodies) - 1));
    }
    return {.pass = std::max({velocity, momentum, energies}) <= 1e-14,
            .text = fmt::format("velocities {:.1e}, momentum {:.1e}, energy {:.1e}", velocity,
                                momentum, energies)};
}

Measured rest_for_long()
{
    const Scene scene = stack();
    const SceneRun run = simulate(
        scene,
        {.t_end = 1.002e4, .contacts = scene_contacts(), .sample_times = {20, 1e3, 5e3, 1.002e4}});
    std::size_t changed = 0;
    std::size_t awake = 0;
    for (const auto& row : run.samples) {
        for (std::size_t i = 0; i < row.size(); ++i) {
            changed += row[i].at != run.samples[0][i].at;
            awake += !row[i].asleep;
        }
    }
    const bool whole = run.outcome == Outcome::reached_end && run.samples.size() == 4;
    return {.pass = whole && changed == 0 && awake == 0,
            .text = fmt::format("{} places changed, {} bodies awake", changed, awake)};
}

Measured time_piles()
{
    // Unequal discs, so that they slide off each other for a second.
    std::mt19937_64 random(1);
    const auto part = [&random] { return std::uniform_real_distribution<double>(0, 1)(random); };
    Scene scene({.gravity = {0, -9.81}});
    const auto clay = scene.material({.restitution = 0.5, .friction = 0.3});
    scene.wall({.normal = {0, 1}, .material = clay});
    scene.wall({.normal = {1, 0}, .material = clay});
    scene.wall({.point = {3.6, 0}, .normal = {-1, 0}, .material = clay});
    for (int i = 0; i < 32; ++i) {
        const double radius = 0.12 + 0.08 * part();
        const double shift = 0.01 * part();
        scene.disc({.at = {0.225 + 0.45 * (i % 7) + shift, 0.3 + 0.45 * (i / 7)},
                    .velocity = {0.5 * (part() - 0.5), 0},
                    .radius = radius,
                    .mass = 50 * radius * radius,
                    .material = clay});
    }
    SceneRun run;
    const double time = least_time([&] {
        run = simulate(scene, {.t_end = 2, .contacts = scene_contacts(), .record_events = false});
    });
    return {.pass = run.outcome == Outcome::reached_end && time <= 1,
            .text = fmt::format("{:.2f} s", time),
            .details = {fmt::format("{} steps of lasting contact, largest defect {:.1e}",
                                    run.statistics.contact_steps, run.statistics.contact_defect)}};
}

}  // namespace ricochet::bench
