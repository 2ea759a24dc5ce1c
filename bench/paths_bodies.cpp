// Paths through scenes, faults and friction.
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <random>
#include <vector>

#include "paths.hpp"
#include "ricochet/faults/friction.hpp"
#include "ricochet/faults/spring_slider.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/scene/simulate.hpp"
#include "timing.hpp"

namespace ricochet::bench {

namespace {

Path simulated(const Scene& scene, double t_end)
{
    return [=] {
        auto result = simulate(scene, {.t_end = t_end});
        keep(result);
    };
}

/// Balls that meet no other, all events in the order of time.
Path ordered_balls()
{
    Scene scene({.gravity = {0, -9.81}});
    scene.wall({.normal = {0, 1}});
    for (int i = 0; i < 1000; ++i) {
        scene.disc({.at = {1.0 * i, 1.5 + 9.0 * (i * 37 % 101) / 101}, .radius = 0.25});
    }
    return simulated(scene, 5);
}

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

/// One body slowed by drag, as a system of the core.
struct SlowedBody {
    using State = std::array<double, 4>;
    double drag = 0.1;  ///< [1/s]
    void flow(double /*t*/, const State& x, State& rate) const
    {
        rate = {x[2], x[3], -drag * x[2], -9.81 - drag * x[3]};
    }
};

Path body_in_a_scene()
{
    Scene scene({.gravity = {0, -9.81}});
    scene.disc({.at = {0, 0}, .velocity = {3, 4}, .drag = 0.1});
    return simulated(scene, 2e4);
}

Path body_alone()
{
    return [] {
        auto result =
            integrate(SlowedBody{}, {0, 0, 3, 4}, {.t_end = 2e4, .rtol = 1e-8, .atol = 1e-10});
        keep(result);
    };
}

/// Discs that fall into a bin and slide with friction.
Path pile()
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
    return [=] {
        auto result =
            simulate(scene, {.t_end = 1, .contacts = scene_contacts(), .record_events = false});
        keep(result);
    };
}

// --- faults and friction ---

Path fault_by_explicit_steps()
{
    const auto fault =
        std::make_shared<const StrikeSlipFault>(StrikeSlipFault::Parameters{.elements = 10});
    return [=] {
        auto result = simulate(*fault, {.t_end = 30});
        keep(result.mean_slip);
    };
}

Path fault_with_rate_and_state()
{
    const auto fault =
        std::make_shared<const StrikeSlipFault>(StrikeSlipFault::Parameters{.elements = 5});
    return [=] {
        auto result =
            simulate(*fault, {.t_end = 1e7, .rtol = 1e-3}, FaultFriction{.overload = 1e-3});
        keep(result.rupture.mean_slip);
    };
}

/// A thousand steps of 2^-11 s.
Path slider(int order)
{
    const SliderCase c = slider_cases(1)[50];
    return [=] {
        const VariationalStep<AgeingLaw<>> step(AgeingLaw<>(c.slider.friction), c.slider.block,
                                                order);
        SliderState s = slider_case_start();
        for (int i = 0; i < 1000; ++i) (void)step.take(s, 0x1p-11, c.slider.load);
        keep(s);
    };
}

Path laws()
{
    const AgeingLaw<DirectEffect::log> log;
    const AgeingLaw<> asinh;
    return [=] {
        double sum = 0;
        for (int i = 0; i < 1000; ++i) {
            const double v = 1e-4 * std::exp(0.009 * i - 7);
            const double xi = 0.009 * i - 2;
            sum += log.evaluate(v, xi).friction + log.gradient(v, xi).rate_xi;
            sum += asinh.evaluate(v, xi).friction + asinh.gradient(v, xi).rate_xi;
        }
        keep(sum);
    };
}

}  // namespace

std::vector<Named> paths_of_bodies()
{
    return {
        {"1000 balls in the order of time", ordered_balls},
        {"a ball with drag as a scene", [] { return simulated(slowed_balls(1), 100); }},
        {"1000 balls with drag as a scene", [] { return simulated(slowed_balls(1000), 2); }},
        {"a disc as a scene", [] { return simulated(above_sleepers(0), 300); }},
        {"a disc beside 1000 that sleep", [] { return simulated(above_sleepers(1000), 300); }},
        {"50 dumbbells, one of them stiff", [] { return simulated(dumbbells(50, false), 0.1); }},
        {"50 dumbbells, in one state", [] { return simulated(dumbbells(50, true), 0.1); }},
        {"a body with drag as a scene", body_in_a_scene},
        {"the same by integrate", body_alone},
        {"32 discs in a bin", pile},
        {"fault of 10 x 10 elements", fault_by_explicit_steps},
        {"fault of 5 x 5, rate and state", fault_with_rate_and_state},
        {"slider, 1000 steps of order 1", [] { return slider(1); }},
        {"slider, 1000 steps of order 2", [] { return slider(2); }},
        {"slider, 1000 steps of order 4", [] { return slider(4); }},
        {"laws of friction, 1000 times", laws},
    };
}

}  // namespace ricochet::bench
