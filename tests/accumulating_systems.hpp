// Balls on floors at any height, fixed, moving or vibrating, whose impacts accumulate: for the
// tests and the measurements.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "ricochet/integrate.hpp"

namespace ricochet::test {

/// A floor and the ball on it.
struct Floor {
    double height = 0;     ///< [m]
    double velocity = 0;   ///< [m/s]
    double amplitude = 0;  ///< [m]
    double frequency = 1;  ///< [rad/s]
    double restitution = 0.8;
    bool projects = true;  ///< the reset puts the ball on the floor
    bool unilateral = false;

    static constexpr double gravity = 9.81;  ///< [m/s²]

    [[nodiscard]] double at(double t) const
    {
        return height + velocity * t + amplitude * std::sin(frequency * t);
    }
    [[nodiscard]] double velocity_at(double t) const
    {
        return velocity + amplitude * frequency * std::cos(frequency * t);
    }
    [[nodiscard]] double acceleration_at(double t) const
    {
        return -amplitude * frequency * frequency * std::sin(frequency * t);
    }
    void bounce(double t, std::array<double, 2>& x) const
    {
        const double own = velocity_at(t);
        if (projects) x[0] = at(t);
        x[1] = own - restitution * (x[1] - own);
    }
};

/// Without a rest rule: accumulation ends the run.
struct BallOnFloor {
    using State = std::array<double, 2>;  ///< height [m], velocity [m/s]
    Floor floor{};

    [[nodiscard]] GuardInfo guard_info(std::size_t /*which*/) const
    {
        return {.name = "floor", .unilateral = floor.unilateral};
    }
    void flow(double, const State& x, State& dxdt) const { dxdt = {x[1], -Floor::gravity}; }
    [[nodiscard]] double guard(double t, const State& x) const { return x[0] - floor.at(t); }
    void reset(double t, State& x) const { floor.bounce(t, x); }
};

/// With a rest rule, which holds on a floor that does not move.
struct RestingBall : BallOnFloor {
    void rest(double t, State& x) const { x = {floor.at(t), floor.velocity_at(t)}; }
};

/// Rests in a mode of its own, until the floor falls away faster than the ball would.
struct LiftedBall {
    using State = BallOnFloor::State;
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;
    Floor floor{};

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        if (which == 1) return {.name = "lift"};
        return {.name = "floor", .unilateral = floor.unilateral};
    }
    void flow(Mode mode, double t, const State& x, State& dxdt) const
    {
        if (mode == 0) {
            dxdt = {x[1], -Floor::gravity};
        } else {
            dxdt = {floor.velocity_at(t), floor.acceleration_at(t)};
        }
    }
    [[nodiscard]] double guard(std::size_t which, Mode, double t, const State& x) const
    {
        return which == 0 ? x[0] - floor.at(t) : floor.acceleration_at(t) + Floor::gravity;
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const { return which == mode; }
    Mode reset(std::size_t which, Mode mode, double t, State& x) const
    {
        if (which == 1) {
            x = {floor.at(t), floor.velocity_at(t)};
            return 0;
        }
        floor.bounce(t, x);
        return mode;
    }
    Mode rest(std::size_t, Mode, double t, State& x) const
    {
        x = {floor.at(t), floor.velocity_at(t)};
        return 1;
    }
};

/// A random case, with its results in exact arithmetic.
struct RandomBall {
    Floor floor{};
    double drop = 1;       ///< [m] above the floor
    double speed = 0;      ///< [m/s] at the start
    double tolerance = 0;  ///< [s] of event location
    int kind = 0;          ///< 0: no rest rule, 1: with one, 2: with a mode of rest
    bool vibrates = false;

    explicit RandomBall(std::uint32_t seed)
    {
        std::mt19937 random(seed);
        const auto uniform = [&](double a, double b) {
            return std::uniform_real_distribution<double>(a, b)(random);
        };
        const auto one_of = [&](std::uint32_t n) {
            return static_cast<std::uint32_t>(random() % n);
        };
        floor.height = std::array{0.0, 1.0, -3.7, 1000.0}[one_of(4)];
        const std::uint32_t moves = one_of(4);
        vibrates = moves == 3;
        if (moves == 2) floor.velocity = one_of(2) ? 0.5 : -0.5;
        if (vibrates) {
            floor.amplitude = uniform(1e-3, 0.05);
            floor.frequency = uniform(5, 60);
        }
        floor.restitution = one_of(3) ? uniform(0.1, 0.97) : uniform(0.05, 0.99);
        floor.projects = one_of(2);
        floor.unilateral = one_of(2);
        tolerance = std::array{0.0, 0.0, 1e-9, 1e-6, 1e-3}[one_of(5)];
        drop = uniform(0.2, 3);
        speed = uniform(-1, 1);
        kind = static_cast<int>(one_of(3));
    }

    /// Speed at the first impact [m/s], relative to a floor that does not vibrate.
    [[nodiscard]] double first_speed() const
    {
        const double relative = speed - floor.velocity;
        return std::sqrt(relative * relative + 2 * Floor::gravity * drop);
    }
    [[nodiscard]] double first_impact() const  ///< [s]
    {
        return (speed - floor.velocity + first_speed()) / Floor::gravity;
    }
    /// Time at which the impacts accumulate [s].
    [[nodiscard]] double limit() const
    {
        const double e = floor.restitution;
        return first_impact() + 2 * e * first_speed() / (Floor::gravity * (1 - e));
    }
    [[nodiscard]] double end() const { return vibrates ? 20 : 1.3 * limit() + 1; }  ///< [s]

    /// Number of impacts in exact arithmetic until an excursion v² / 2g is less than a unit in the
    /// last place of the height, or the remaining time is less than one of the time or the
    /// tolerance.
    [[nodiscard]] int impacts() const
    {
        constexpr double ulp = 2.2e-16;
        const double e = floor.restitution;
        const double size = std::fabs(floor.height) + std::fabs(floor.velocity) * limit();
        double v = first_speed();
        for (int n = 0;; ++n) {
            v *= e;
            const double left = 2 * v / (Floor::gravity * (1 - e));
            if (v * v / (2 * Floor::gravity) < ulp * size / 8) return n;
            if (left < ulp * limit() || left < tolerance / 4) return n;
        }
    }

    /// Accuracy with which the limit can be known [s]. Excursions may linger within 32 times the
    /// rounding of 8 units in the last place, from where the remaining impacts take 2v / g(1 - e);
    /// an event that is off by the tolerance shifts all later ones as much, again and again.
    [[nodiscard]] double accuracy() const
    {
        const double e = floor.restitution;
        const double size = std::fabs(floor.height) + std::fabs(floor.velocity) * limit() + 1e-3;
        const double v = std::sqrt(2 * Floor::gravity * 256 * 2.2e-16 * size);
        return 2 * v / (Floor::gravity * (1 - e)) + (tolerance + 1e-8) * 4 / ((1 - e) * (1 - e));
    }
};

/// Description of an error; empty if there is none.
template <class Ball>
[[nodiscard]] std::string fault_of(const RandomBall& ball, const Ball& system)
{
    Options options{.t_end = ball.end(), .max_steps = 100'000};
    options.event_tolerance = ball.tolerance;
    constexpr int samples = 400;
    for (int i = 1; i <= samples; ++i) {
        options.sample_times.push_back(i == samples ? ball.end() : ball.end() * i / samples);
    }
    const auto run =
        integrate(system, typename Ball::State{ball.floor.at(0) + ball.drop, ball.speed}, options);

    if (run.outcome != Outcome::reached_end && run.outcome != Outcome::zeno) {
        return std::string(name(run.outcome));
    }
    double limit = run.t;
    double moved = 0;
    std::size_t accumulations = 0;
    for (const auto& event : run.events) {
        if (event.kind != EventKind::accumulation) continue;
        if (accumulations++ == 0) limit = event.t;
        moved = event.error;
    }
    // Where a run ends at an accumulation, samples before it are those at the limit.
    const double deepest = 1e-7 + 20 * ball.tolerance + moved * std::fabs(ball.floor.velocity);
    for (std::size_t i = 0; i < run.trajectory.t.size(); ++i) {
        const double above = run.trajectory.x[i][0] - ball.floor.at(run.trajectory.t[i]);
        if (above < -deepest) return "below the floor";
    }
    if (ball.vibrates) return run.statistics.events > 20'000 ? "flutters" : "";
    const bool accumulated = accumulations > 0 || run.outcome == Outcome::zeno;
    if (!accumulated) return "does not accumulate";
    if (run.outcome == Outcome::zeno && ball.kind == 2) return "zeno in spite of its rest rule";
    if (static_cast<double>(run.events.size()) > 1.2 * (ball.impacts() + 1) + 6) {
        return "flutters";
    }
    return std::fabs(limit - ball.limit()) <= ball.accuracy() ? "" : "accumulates elsewhere";
}

[[nodiscard]] inline std::string fault_of(std::uint32_t seed)
{
    const RandomBall ball(seed);
    if (ball.kind == 2) return fault_of(ball, LiftedBall{.floor = ball.floor});
    if (ball.kind == 1) return fault_of(ball, RestingBall{{.floor = ball.floor}});
    return fault_of(ball, BallOnFloor{.floor = ball.floor});
}

}  // namespace ricochet::test
