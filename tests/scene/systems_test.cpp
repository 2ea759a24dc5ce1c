// Systems as bodies: effects of discs that strike them, against runs of both as one state.
#include "ricochet/scene/system.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "refusal.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/scene/simulate.hpp"

namespace ricochet::systems_test {
namespace {

constexpr double g = 9.81;
constexpr double length = 1.2;
constexpr double bob_mass = 2;
constexpr double bob_radius = 0.15;

/// A pendulum from the origin: x = (angle, rate), and its bob.
struct Bob {
    using State = std::array<double, 2>;
    std::size_t shape_count = 1;
    double bound = 1;  ///< factor of the true bound
    double sign = 1;   ///< of the effect of a push

    void flow(double, const State& x, State& dxdt) const
    {
        dxdt = {x[1], -g / length * std::sin(x[0])};
    }
    double shape_radius(std::size_t) const { return bob_radius; }
    SystemDisc shape(std::size_t, double, const State& x) const
    {
        const double s = std::sin(x[0]);
        const double c = std::cos(x[0]);
        return {{length * s, -length * c}, {length * x[1] * c, length * x[1] * s}};
    }
    /// Energy bounds the rate: w^2 <= w0^2 + 2 g/l (1 - cos a0).
    double shape_acceleration(std::size_t, double, const State& x) const
    {
        return bound * (length * x[1] * x[1] + 2 * g * (1 - std::cos(x[0])) + g);
    }
    void push(std::size_t, double, State& x, const Vector2& p) const
    {
        x[1] += sign * (p[0] * std::cos(x[0]) + p[1] * std::sin(x[0])) / (bob_mass * length);
    }
};

/// The same with a stop at angle 0, from which it rebounds with 0.9.
struct StoppedBob : Bob {
    double guard(double, const State& x) const { return x[0]; }
    void reset(double, State& x) const { x[1] *= -0.9; }
};

double energy_of(const Bob::State& x)
{
    return bob_mass * (0.5 * length * length * x[1] * x[1] - g * length * std::cos(x[0]));
}

struct Ball {
    Vector2 at{}, velocity{};
    double radius = 0.1, mass = 0.5;
};

/// Bob and ball as one state (a, w, x, y, x', y') that meet at a guard of their own.
struct Together {
    using State = std::array<double, 6>;
    Ball ball;
    double restitution = 1;

    void flow(double, const State& x, State& dxdt) const
    {
        dxdt = {x[1], -g / length * std::sin(x[0]), x[4], x[5], 0, -g};
    }
    double guard(double, const State& x) const
    {
        const auto bob = Bob{}.shape(0, 0, {x[0], x[1]});
        return std::hypot(x[2] - bob.at[0], x[3] - bob.at[1]) - bob_radius - ball.radius;
    }
    void reset(double, State& x) const
    {
        const auto bob = Bob{}.shape(0, 0, {x[0], x[1]});
        const Vector2 apart{x[2] - bob.at[0], x[3] - bob.at[1]};
        const double distance = std::hypot(apart[0], apart[1]);
        const Vector2 n{apart[0] / distance, apart[1] / distance};
        const double along = n[0] * std::cos(x[0]) + n[1] * std::sin(x[0]);
        const double approach = n[0] * (bob.velocity[0] - x[4]) + n[1] * (bob.velocity[1] - x[5]);
        const double p = (1 + restitution) * approach / (1 / ball.mass + along * along / bob_mass);
        x[4] += p * n[0] / ball.mass;
        x[5] += p * n[1] / ball.mass;
        x[1] -= p * along / (bob_mass * length);
    }
};

Scene scene_of(const Ball& ball, const Bob& bob, const Bob::State& x0, double restitution = 1)
{
    Scene scene({.gravity = {0, -g}});
    const MaterialId material = scene.material({.restitution = restitution});
    scene.disc({.name = "ball",
                .at = ball.at,
                .velocity = ball.velocity,
                .radius = ball.radius,
                .mass = ball.mass,
                .material = material});
    scene.system({.name = "bob", .motion = system_body(bob, x0), .material = material});
    return scene;
}

TEST(SceneSystems, ADiscThatStrikesAPendulumIsTheRunOfBothAsOneState)
{
    // Thrown up under the bob, the ball strikes it several times. Both runs have errors of some
    // 1e-12, which an impact between round bodies multiplies, here by less than 20.
    const Ball ball{.at = {0.35, -2.1}, .velocity = {0, 6}};
    const Bob::State x0{0.5, 0};
    for (const double restitution : {1.0, 0.6}) {
        const Scene scene = scene_of(ball, Bob{}, x0, restitution);
        const SceneRun run = simulate(scene, {.t_end = 1.2, .rtol = 1e-12, .atol = 1e-13});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        const Together both{ball, restitution};
        const auto reference = integrate(
            both, Together::State{x0[0], x0[1], ball.at[0], ball.at[1], 0, ball.velocity[1]},
            {.t_end = 1.2, .rtol = 1e-13, .atol = 1e-14});
        ASSERT_GE(run.events.size(), 1u);
        ASSERT_EQ(run.events.size(), reference.events.size());
        for (std::size_t k = 0; k < run.events.size(); ++k) {
            EXPECT_NEAR(run.events[k].t, reference.events[k].t, 1e-11 * std::pow(20, k));
        }
        const double tolerance = 1e-9;
        ASSERT_EQ(run.systems.size(), 1u);
        EXPECT_NEAR(run.systems[0][0], reference.x[0], tolerance);
        EXPECT_NEAR(run.systems[0][1], reference.x[1], tolerance);
        EXPECT_NEAR(run.bodies[0].at[0], reference.x[2], tolerance);
        EXPECT_NEAR(run.bodies[0].velocity[1], reference.x[5], tolerance);
    }
}

TEST(SceneSystems, AnElasticImpactKeepsEnergyAndMomentumAboutThePivot)
{
    const Ball ball{.at = {-0.9, -1.1}, .velocity = {4, 1}};
    const Bob::State x0{0.3, 0};
    const Scene scene = scene_of(ball, Bob{}, x0);
    const SceneRun run = simulate(scene, {.t_end = 0.6, .rtol = 1e-13, .atol = 1e-14});
    ASSERT_EQ(run.events.size(), 1u);
    const SceneEvent& event = run.events[0];
    // Of the ball: m (x vy - y vx), of the bob m l^2 w; the impulse goes through both centres.
    const double energy_before =
        0.5 * ball.mass * (16 + 1) + ball.mass * g * ball.at[1] + energy_of(x0);
    const BodyState& after = run.bodies[0];
    const double energy_after =
        0.5 * ball.mass *
            (after.velocity[0] * after.velocity[0] + after.velocity[1] * after.velocity[1]) +
        ball.mass * g * after.at[1] + energy_of({run.systems[0][0], run.systems[0][1]});
    EXPECT_NEAR(energy_after, energy_before, 1e-12 * std::fabs(energy_before) * 10);
    const double bob_energy = 0.5 * bob_mass;
    const auto square = [](const Vector2& v) { return v[0] * v[0] + v[1] * v[1]; };
    EXPECT_NEAR(0.5 * ball.mass * square(event.before[0]) + bob_energy * square(event.before[1]),
                0.5 * ball.mass * square(event.after[0]) + bob_energy * square(event.after[1]),
                1e-13 * 10);
    // Momentum along the path of the bob, where the rod does not push.
    const Vector2 t{event.before[1][0] / std::sqrt(square(event.before[1])),
                    event.before[1][1] / std::sqrt(square(event.before[1]))};
    const auto along = [&](const Vector2& v) { return v[0] * t[0] + v[1] * t[1]; };
    EXPECT_NEAR(along(event.impulse) / ball.mass, along(event.after[0]) - along(event.before[0]),
                1e-14 * 10);
    EXPECT_NEAR(bob_mass * (along(event.after[1]) - along(event.before[1])), -along(event.impulse),
                1e-13);
}

TEST(SceneSystems, GuardsAndResetsGoOnAsInAPlainRun)
{
    const Bob::State x0{0.8, 0};
    const Scene scene = scene_of({.at = {5, 0}}, StoppedBob{}, x0);
    static_cast<void>(scene);
    Scene stopped({.gravity = {0, -g}});
    stopped.system({.name = "bob", .motion = system_body(StoppedBob{}, x0)});
    std::vector<double> times;
    for (int k = 1; k <= 60; ++k) times.push_back(0.1 * k);
    const SceneRun run =
        simulate(stopped, {.t_end = 6, .rtol = 1e-12, .atol = 1e-13, .sample_times = times});
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    const auto plain = integrate(StoppedBob{}, x0,
                                 {.t_end = 6, .rtol = 1e-12, .atol = 1e-13, .sample_times = times});
    ASSERT_GE(plain.events.size(), 5u);
    for (std::size_t k = 0; k < times.size(); ++k) {
        const SystemDisc disc = Bob{}.shape(0, 0, plain.trajectory.x[k]);
        EXPECT_NEAR(run.samples[k][0].at[0], disc.at[0], 1e-9);
        EXPECT_NEAR(run.samples[k][0].velocity[0], disc.velocity[0], 1e-8);
    }
}

/// A rotor: x = (angle, rate) with two discs at its ends, of moment of inertia 2.
struct Rotor {
    using State = std::array<double, 2>;
    static constexpr std::size_t shape_count = 2;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], 0}; }
    double shape_radius(std::size_t) const { return 0.2; }
    SystemDisc shape(std::size_t k, double, const State& x) const
    {
        const double side = k == 0 ? 1 : -1;
        const Vector2 arm{side * std::cos(x[0]), side * std::sin(x[0])};
        return {arm, {-x[1] * arm[1], x[1] * arm[0]}};
    }
    double shape_acceleration(std::size_t, double, const State& x) const { return x[1] * x[1]; }
    void push(std::size_t k, double, State& x, const Vector2& p) const
    {
        const double side = k == 0 ? 1 : -1;
        x[1] += side * (std::cos(x[0]) * p[1] - std::sin(x[0]) * p[0]) / 2;
    }
};

/// A disc of 1 kg without forces: x = (x, y, x', y').
struct Drifter {
    using State = std::array<double, 4>;
    static constexpr std::size_t shape_count = 1;
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[2], x[3], 0, 0}; }
    double shape_radius(std::size_t) const { return 0.25; }
    SystemDisc shape(std::size_t, double, const State& x) const
    {
        return {{x[0], x[1]}, {x[2], x[3]}};
    }
    double shape_acceleration(std::size_t, double, const State&) const { return 0; }
    void push(std::size_t, double, State& x, const Vector2& p) const
    {
        x[2] += p[0];
        x[3] += p[1];
    }
};

TEST(SceneSystems, AnElasticImpactOnADiscAtRestIsElasticWithFriction)
{
    // Head on, equal masses exchange their velocities and friction has nothing to do.
    for (int k = 0; k < 100; ++k) {
        const Vector2 way{std::cos(0.1 * k), std::sin(0.1 * k)};
        Scene scene;
        const MaterialId rubber = scene.material({.restitution = 1, .friction = 0.5});
        scene.disc({.at = {2 * way[0], 2 * way[1]}, .radius = 0.25, .material = rubber});
        scene.system({.motion = system_body(Drifter{}, Drifter::State{0, 0, way[0], way[1]}),
                      .material = rubber});
        const SceneRun run = simulate(scene, {.t_end = 2});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        for (std::size_t c = 0; c < 2; ++c) {
            EXPECT_NEAR(run.bodies[0].velocity[c], way[c], 1e-9) << k;
            EXPECT_NEAR(run.systems[0][2 + c], 0, 1e-9) << k;
        }
    }
}

/// It is kicked by 1 m/s across at a time, and rebounds elastically from y = 0.
struct EventfulDrifter : Drifter {
    double kick_at = std::numeric_limits<double>::infinity();
    double guard(double, const State& x) const { return x[1]; }
    void reset(double, State& x) const { x[3] = -x[3]; }
    double next_time_event(double t) const
    {
        return t < kick_at ? kick_at : std::numeric_limits<double>::infinity();
    }
    void time_reset(double, State& x) const { x[3] += 1; }
};

TEST(SceneSystems, EventsAtTheInstantOfAnImpactAreNotLost)
{
    // The impact along x and the events along y do not affect each other.
    for (int k = 1; k <= 64; ++k) {
        const double time = k / 16.0;
        const auto run = [&](const Drifter::State& x0, double kick_at, double t_end) {
            Scene scene;
            scene.disc({.at = {time + 0.5, x0[1] + time * x0[3]}, .radius = 0.25});
            EventfulDrifter drifter;
            drifter.kick_at = kick_at;
            scene.system({.motion = system_body(drifter, x0)});
            return simulate(scene, {.t_end = t_end});
        };
        const double never = std::numeric_limits<double>::infinity();
        const SceneRun kicked = run({0, 3, 1, 0}, time, time + 1);
        const SceneRun rebounds = run({0, time, 1, -1}, never, time + 1);
        for (const SceneRun* of : {&kicked, &rebounds}) {
            ASSERT_EQ(of->outcome, Outcome::reached_end) << of->message;
            EXPECT_NEAR(of->bodies[0].velocity[0], 1, 1e-9) << time;
            EXPECT_NEAR(of->systems[0][2], 0, 1e-9) << time;
            EXPECT_NEAR(of->systems[0][3], 1, 1e-9) << time;
        }
        // An impact at the end of the run.
        EXPECT_EQ(run({0, 3, 1, 0}, never, time).outcome, Outcome::reached_end);
    }
}

TEST(SceneSystems, EventsAtTheEndOfTheRunHappenAsInAPlainRun)
{
    const auto expect = [](const EventfulDrifter& drifter, const Drifter::State& x0, double t_end) {
        Scene scene;
        scene.system({.motion = system_body(drifter, x0)});
        const SceneRun run = simulate(scene, {.t_end = t_end, .sample_times = {t_end}});
        const auto plain = integrate(drifter, x0, {.t_end = t_end});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        ASSERT_EQ(plain.x[3], 1);
        EXPECT_EQ(run.systems[0][3], 1) << t_end;
        EXPECT_EQ(run.bodies[0].velocity[1], 1) << t_end;
        EXPECT_EQ(run.samples[0][0].velocity[1], 1) << t_end;
    };
    for (const double t_end : {0.7, 1.0, 2.0, 3.5}) {
        EventfulDrifter kicked;
        kicked.kick_at = t_end;
        expect(kicked, {0, 3, 1, 0}, t_end);
    }
    expect({}, {0, 2, 0, -1}, 2);  // the guard is zero exactly at the end
}

TEST(SceneSystems, BothEndsOfARotorAreStruckTogether)
{
    // Discs of mass 1 come down and up at 1 m/s onto the ends, which have 2 / 2 kg each: equal
    // masses exchange velocities, whatever the labels.
    for (const bool swapped : {false, true}) {
        Scene scene;
        if (swapped)
            scene.system({.name = "rotor", .motion = system_body(Rotor{}, Rotor::State{})});
        scene.disc({.at = {1, 2}, .velocity = {0, -1}, .radius = 0.3});
        scene.disc({.at = {-1, -2}, .velocity = {0, 1}, .radius = 0.3});
        if (!swapped)
            scene.system({.name = "rotor", .motion = system_body(Rotor{}, Rotor::State{})});
        const SceneRun run = simulate(scene, {.t_end = 1.6});
        ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
        ASSERT_EQ(run.events.size(), 2u);
        EXPECT_EQ(run.events[0].number, run.events[1].number);
        EXPECT_NEAR(run.events[0].t, 1.5, 1e-15);
        const std::size_t first = swapped ? 2 : 0;
        EXPECT_NEAR(run.bodies[first].velocity[1], 0, 1e-14);
        EXPECT_NEAR(run.bodies[first + 1].velocity[1], 0, 1e-14);
        EXPECT_NEAR(run.systems[0][1], -1, 1e-14);
    }
}

TEST(SceneSystems, ACrowdMissesNoPendulum)
{
    // Forty discs through cells, without an overlap with the bob at any of 2000 times.
    const auto crowd = [](bool reversed) {
        Scene scene;
        for (const auto& [at, normal] : std::vector<std::pair<Vector2, Vector2>>{
                 {{-3, 0}, {1, 0}}, {{3, 0}, {-1, 0}}, {{0, -3}, {0, 1}}, {{0, 3}, {0, -1}}}) {
            scene.wall({.point = at, .normal = normal});
        }
        for (int n = 0; n < 40; ++n) {
            const int k = reversed ? 39 - n : n;
            scene.disc({.at = {-2.6 + 0.55 * (k % 10), -2.4 + 1.5 * (k / 10) + 0.02 * (k % 7)},
                        .velocity = {3 * std::cos(1.0 * k), 3 * std::sin(1.7 * k)},
                        .radius = 0.1,
                        .mass = 1});
        }
        scene.system({.name = "bob", .motion = system_body(Bob{}, Bob::State{1.5, 0})});
        return scene;
    };
    std::vector<double> times;
    for (int k = 0; k <= 2000; ++k) times.push_back(2e-3 * k);
    const SceneOptions options{.t_end = 4, .rtol = 1e-10, .sample_times = times};
    const SceneRun run = simulate(crowd(false), options);
    ASSERT_EQ(run.outcome, Outcome::reached_end) << run.message;
    std::size_t struck = 0;
    for (const SceneEvent& event : run.events) struck += event.other == Partner{false, 40};
    EXPECT_GT(struck, 5u);
    for (std::size_t k = 0; k < times.size(); ++k) {
        const Vector2& bob = run.samples[k][40].at;
        for (std::size_t i = 0; i < 40; ++i) {
            const Vector2& at = run.samples[k][i].at;
            ASSERT_GE(std::hypot(at[0] - bob[0], at[1] - bob[1]) - 0.1 - bob_radius, -1e-12);
        }
    }
    const SceneRun turned = simulate(crowd(true), options);
    EXPECT_EQ(turned.systems, run.systems);
    for (std::size_t i = 0; i < 40; ++i) EXPECT_EQ(turned.bodies[39 - i].at, run.bodies[i].at);
}

TEST(SceneSystems, WhatIsNoBodyIsNamed)
{
    const Ball ball{.at = {0.35, -2.1}, .velocity = {0, 6}};
    const Bob::State x0{0.5, 0};
    const auto refused = [&](const Bob& bob) {
        return refusal([&] { static_cast<void>(simulate(scene_of(ball, bob, x0), {.t_end = 1})); });
    };
    EXPECT_NE(refused(Bob{.sign = -1}).find("push of bob changes its velocity by"),
              std::string::npos);
    const SceneRun lied = simulate(scene_of(ball, Bob{.bound = 0.01}, x0), {.t_end = 1});
    EXPECT_EQ(lied.outcome, Outcome::wrong_bound);
    EXPECT_EQ(lied.message.find("bob has changed its velocity by"), 0u) << lied.message;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const SceneRun unbound = simulate(scene_of(ball, Bob{.bound = nan}, x0), {.t_end = 1});
    EXPECT_EQ(unbound.message, "bob declares nan m/s^2 as bound of an acceleration");
    EXPECT_EQ(refusal([&] {
                  scene_of(ball, Bob{}, {nan, 0});
              }),
              "Scene: bob: state must be finite, got nan");
    EXPECT_EQ(refusal([] { Scene().system({.name = "bob"}); }),
              "Scene: bob has no motion; expected system_body(...)");
    EXPECT_EQ(refusal([&] {
                  scene_of({.at = {0.6, -1}}, Bob{}, x0).check();
              }).find("Scene: ball and bob overlap by"),
              0u);
}

/// A disc that a clock carries along: its place is that of the time.
struct Carried {
    using State = std::array<double, 1>;
    std::size_t shape_count = 2;

    void flow(double, const State&, State& dxdt) const { dxdt = {0}; }
    double shape_radius(std::size_t) const { return 0.1; }
    SystemDisc shape(std::size_t k, double t, const State&) const
    {
        return {{t, 3.0 * static_cast<double>(k)}, {1, 0}};
    }
    double shape_acceleration(std::size_t, double, const State&) const { return 0; }
    void push(std::size_t, double, State&, const Vector2&) const {}
};

TEST(SceneSystems, AreWhereTheTimeOfTheStartHasThem)
{
    Scene scene;
    scene.system({.name = "carried", .motion = system_body(Carried{}, Carried::State{})});
    scene.disc({.name = "still", .at = {5, 0}, .radius = 0.1});
    EXPECT_EQ(refusal([&] { scene.check(0); }), "accepted");
    EXPECT_NE(refusal([&] { scene.check(5); }).find("carried 0 and still overlap by 0.2"),
              std::string::npos);
}

TEST(SceneSystems, ThatAreRefusedLeaveNoDiscsBehind)
{
    Scene scene;
    scene.disc({.name = "arm 1", .at = {5, 0}, .radius = 0.1});
    const auto add = [&](const std::string& name) {
        scene.system({.name = name, .motion = system_body(Carried{}, Carried::State{})});
    };
    EXPECT_EQ(refusal([&] { add("arm"); }), "Scene: the name \"arm 1\" is given twice");
    EXPECT_EQ(scene.bodies().size(), 1u);
    add("leg");
    EXPECT_EQ(scene.bodies().size(), 3u);
    EXPECT_EQ(scene.body("leg 1").index, 2u);
    EXPECT_NE(refusal([&] { static_cast<void>(scene.body("arm 0")); }), "accepted");
}

}  // namespace
}  // namespace ricochet::systems_test
