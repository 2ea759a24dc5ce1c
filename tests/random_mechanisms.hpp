// Random mechanisms with contacts and friction, and the laws of their motion.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>

#include "law_at_end.hpp"
#include "problems/rolling_ball.hpp"
#include "random_inclusions.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/nonsmooth/time_stepping.hpp"
#include "ricochet/systems/two_contact_block.hpp"
#include "ricochet/systems/woodpecker.hpp"

namespace ricochet::test {

/// Errors of runs, and the number of runs that ended because they could not continue.
struct MechanismTally {
    std::uint64_t runs = 0, steps = 0, impacts = 0, reported = 0;
    std::string fault;   ///< the first
    double largest = 0;  ///< imbalance of the energy of a step, relative to its terms
};

/// Follows a mechanism by time stepping, and checks each step: the laws of Newton and Coulomb on
/// the impulses, and the balance of energy
///
///     T+ - T- = h F (v- + v+) / 2 + p (u- + u+) / 2,
///
/// which holds to rounding for any impulses; the work of contacts without restitution
/// is not positive.
template <class System>
void follow_mechanism(const System& system, const typename TimeStepping<System>::Vector& q,
                      const typename TimeStepping<System>::Vector& v, double t_end, double step,
                      MechanismTally& tally)
{
    using Motion = TimeStepping<System>;
    Motion motion(system, q, v, {.t_end = t_end, .step = step});
    ++tally.runs;
    const auto blame = [&](const char* what, double by) {
        if (!tally.fault.empty()) return;
        tally.fault = fmt::format("{} by {:.3e} in run {} at t = {:.6g}", what, by, tally.runs,
                                  motion.state().t);
    };
    typename Motion::State before = motion.state();
    while (motion.advance() != Outcome::not_converged) {
        const typename Motion::State& now = motion.state();
        const double h = now.t - before.t;
        const typename Motion::Vector middle = before.q + h / 2 * before.v;
        typename Motion::Square mass;
        typename Motion::Vector force;
        typename Motion::Gaps gaps;
        typename Motion::Directions directions;
        system.mass(middle, mass);
        system.force(before.t + h / 2, middle, before.v, force);
        system.gaps(middle, gaps);
        system.directions(middle, directions);
        const typename Motion::Impulses u0 = directions * before.v;
        const typename Motion::Impulses u1 = directions * now.v;
        // The solver's tolerance is far below 1e-8 of these.
        const typename Motion::Vector free = h * mass.llt().solve(force);
        const double speed = std::max({u0.cwiseAbs().maxCoeff(), u1.cwiseAbs().maxCoeff(),
                                       (directions.cwiseAbs() * free.cwiseAbs()).maxCoeff()});
        const double room_u = 1e-8 * speed;
        const double room_p =
            1e-8 * std::max(now.impulse.cwiseAbs().maxCoeff(), h * force.cwiseAbs().maxCoeff());
        bool plastic = true;
        for (int c = 0; c < Motion::C; ++c) {
            const Eigen::Index n = c * Motion::D;
            const double normal = now.impulse[n], along = now.impulse[n + 1];
            const double bound = system.friction(c) * normal;
            const double newton = u1[n] + system.restitution(c) * u0[n];
            plastic = plastic && system.restitution(c) == 0;
            if (normal < -room_p) blame("a contact pulls", normal);
            if (std::abs(along) > bound + room_p) blame("friction passes its bound", along);
            if (!(gaps[c] <= 0)) continue;
            if (newton < -room_u) blame("a contact gives way", newton);
            if (normal > room_p && newton > room_u) blame("a contact acts from afar", newton);
            if (std::abs(along) < bound - room_p && std::abs(u1[n + 1]) > room_u) {
                blame("friction holds what slides", u1[n + 1]);
            }
            if (along * u1[n + 1] > room_p * speed) blame("friction drives", along * u1[n + 1]);
            tally.impacts += normal > 0 && u0[n] < 0;
        }
        const double kinetic = 0.5 * (now.v - before.v).dot(mass * (now.v + before.v));
        const double load = 0.5 * h * force.dot(before.v + now.v);
        const double contacts = 0.5 * now.impulse.dot(u0 + u1);
        // Work of the contacts, less what only returns the work of the load against them.
        const double dissipated = contacts + 0.5 * now.impulse.dot(directions * free);
        const double terms =
            0.5 * (now.v.cwiseAbs() + before.v.cwiseAbs())
                      .dot(mass.cwiseAbs() * (now.v.cwiseAbs() + before.v.cwiseAbs())) +
            0.5 * now.impulse.cwiseAbs().dot(directions.cwiseAbs() *
                                             (now.v.cwiseAbs() + before.v.cwiseAbs()));
        const double off = std::abs(kinetic - load - contacts) / std::max(terms, 1e-300);
        tally.largest = std::max(tally.largest, off);
        // Some hundred operations and a Cholesky solution of condition 1e3 or less.
        if (off > 1e-11) blame("the energy does not balance", off);
        if (plastic && dissipated > room_p * speed) blame("contacts drive", dissipated);
        ++tally.steps;
        before = now;
        if (motion.outcome() != Outcome::running) return;
    }
    ++tally.reported;
}

class MechanismMaker : public Draw {
public:
    explicit MechanismMaker(std::uint64_t seed) : Draw(seed * 2654435761u + 5) {}

    void block(MechanismTally& tally)
    {
        TwoContactBlock system;
        system.mass_of_block = uniform(0.2, 5);
        system.half_width = uniform(0.2, 1);
        system.half_height = uniform(0.1, 1);
        system.coefficient = coin() ? uniform(0, 1.2) : 0.3;
        system.bounce = coin() ? 0 : uniform(0, 0.9);
        const double tilt = coin() ? 0 : uniform(-0.2, 0.2);
        const double height = system.half_width * std::abs(tilt) + (coin() ? 0 : uniform(0, 0.3));
        follow_mechanism(system, {0, height, tilt},
                         {uniform(-4, 4), uniform(-2, 1), coin() ? 0 : uniform(-2, 2)}, 1, 1e-3,
                         tally);
    }
    void woodpecker(MechanismTally& tally)
    {
        Woodpecker system;
        for (double* parameter :
             {&system.sleeve_mass, &system.sleeve_inertia, &system.bird_mass, &system.bird_inertia,
              &system.spring, &system.sleeve_half, &system.coefficient}) {
            *parameter *= uniform(0.7, 1.4);
        }
        system.beak_restitution = uniform(0, 0.9);
        system.sleeve_radius = system.pole_radius + uniform(3e-4, 1e-3);
        const double play = (system.sleeve_radius - system.pole_radius) / system.sleeve_half;
        follow_mechanism(system, {0, -uniform(-1, 1) * play, uniform(-0.4, 0)},
                         {uniform(-0.5, 0.5), 0, uniform(-10, 10)}, 0.2, 1e-4, tally);
    }
};

/// A ball on a plate whose speed changes, and the same in its velocity relative to the plate,
/// as `RandomInclusion` has it for its reference.
struct RandomRollingBall {
    RollingBall::Parameters parameters;
    RollingBall::Vector start;
    double t_end = 0;

    explicit RandomRollingBall(std::uint64_t seed)
    {
        MechanismMaker random(seed + 1'000'000);
        parameters = {.mass = random.uniform(0.05, 2),
                      .radius = random.uniform(0.02, 0.3),
                      .friction = random.uniform(0.05, 0.8),
                      .plate_speed = random.uniform(0, 0.5),
                      .plate_frequency = random.coin() ? 0 : random.uniform(1, 15)};
        parameters.resistance = random.uniform(0.002, 0.2) * parameters.radius;
        start << random.uniform(-2, 2), random.coin() ? 0 : random.uniform(-10, 10);
        t_end = random.uniform(1, 4);
    }

    [[nodiscard]] RandomInclusion<4> relative() const
    {
        const auto& p = parameters;
        const double inertia = 0.4 * p.mass * p.radius * p.radius;
        RandomInclusion<4> same;
        same.lever(0, 0) = 1 / p.mass;
        same.lever(1, 0) = -p.radius / inertia;
        same.lever(1, 1) = 1 / inertia;
        same.seen(0, 0) = same.seen(1, 1) = 1;
        same.seen(0, 1) = -p.radius;
        same.upper.head(2) << p.friction * p.mass * p.gravity, p.resistance * p.mass * p.gravity;
        same.lower = -same.upper;
        same.slow[0] = p.plate_speed * p.plate_frequency;
        same.frequency[0] = p.plate_frequency;
        same.start.head(2) << start[0] - p.plate_speed, start[1];
        same.start[5] = 1;
        for (int i = 2; i < 4; ++i) same.seen(i, 5) = same.lever(5, i) = 1;
        same.reactions = 2;
        same.t_end = t_end;
        return same;
    }
};

/// Runs the ball by hand-over with set-valued steps of three lengths; empty: no fault.
[[nodiscard]] inline std::string follow_ball(std::uint64_t seed, int reference_steps,
                                             std::uint64_t& reported)
{
    constexpr int samples = 8;
    const RandomRollingBall ball(seed);
    const ReferenceMotion reference(ball.relative(), reference_steps, samples);
    if (!reference.solved) return {};
    const RollingBall system(ball.parameters);
    for (const double divisions : {200, 1000, 5000}) {
        HandOverOptions options{.t_end = ball.t_end, .max_steps = 100'000};
        options.sample_times = equal_times(ball.t_end, samples);
        options.set_valued.step = ball.t_end / divisions;
        const auto run = hand_over(system, ball.start, options);
        if (run.outcome != Outcome::reached_end) {
            ++reported;
            continue;
        }
        for (std::size_t i = 0; i < run.trajectory.x.size(); ++i) {
            RollingBall::Vector plate;
            system.offset(run.trajectory.t[i], plate);
            Eigen::Matrix<double, 6, 1> w = Eigen::Matrix<double, 6, 1>::Zero();
            w.head(2) = run.trajectory.x[i] - plate;
            w[5] = 1;
            const double off = reference.error(i, w);
            if (!(off <= reference.allowed(options.set_valued.step))) {
                return fmt::format("off by {:.3e} at t = {:.6g}, T/{}, seed {}", off,
                                   run.trajectory.t[i], divisions, seed);
            }
        }
        // While it rolls by events y drifts by the tolerance of events, for any other steps.
        const double broken = law_violation_at_end(system, run, ball.t_end / 200);
        if (!(broken <= 1e-6)) {
            return fmt::format("breaks the law by {:.3e}, T/{}, seed {}", broken, divisions, seed);
        }
    }
    return {};
}

}  // namespace ricochet::test
