// The systems of the playground, as functions that a page in a browser calls: numbers go in and out
// by arrays that the page sees.
//
// Times of events are compared with closed forms, those of ready systems or the ones below.
#include "play.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "diode_reference.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/scene/simulate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/friction_oscillator.hpp"
#include "ricochet/systems/thermostat.hpp"

namespace playground {
namespace {

using namespace ricochet;
using Parameters = std::span<const double>;

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double tolerance = 1e-13;  // of every run by events

struct Results {
    std::array<double, most_parameters> parameters{};
    std::vector<PlayEvent> events;
    std::vector<double> path;  ///< rows of `path_columns`
    std::array<double, 3> counts{};
    std::string message;

    void add_event(PlayEvent event)
    {
        if (events.size() < most_events) events.push_back(event);
    }
};
Results results;

void report(std::string_view outcome, std::size_t events, const Statistics& statistics)
{
    results.message = outcome;
    results.counts = {static_cast<double>(events), static_cast<double>(statistics.steps),
                      static_cast<double>(statistics.flow_calls)};
}

/// Time of point k of `points`, two or more, on the path up to `t_end`.
double path_time(int k, int points, double t_end)
{
    return t_end * k / (points - 1);
}

/// Runs a system by events; `event` makes a row of number k and of what happened.
template <class System, class MakeEvent>
void run(const System& system, const typename System::State& x0, double t_end, Mode mode,
         int points, const MakeEvent& make_event)
{
    const auto run = integrate(system, x0,
                               {.t_end = t_end,
                                .mode = mode,
                                .rtol = tolerance,
                                .atol = tolerance,
                                .record_steps = points > 1,
                                .max_steps = 100'000},
                               ErrorControlled<Fehlberg78>{});
    for (std::size_t k = 0; k < run.events.size(); ++k) {
        results.add_event(make_event(k, run.events[k]));
    }
    for (int k = 0; k < points && points > 1; ++k) {
        const double t = path_time(k, points, t_end);
        const auto x = run.solution(std::min(t, run.t));
        results.path.insert(results.path.end(), {t, x[0], none});
    }
    report(describe(run.outcome), run.events.size(), run.statistics);
}

// gravity, restitution, height, velocity, t_end
void bouncing_ball(Parameters p, int points)
{
    const BouncingBall ball({.gravity = p[0], .restitution = p[1]});
    // As `impact_time` of the ball, which adds the flights up again for each impact.
    const long double speed = std::sqrt(static_cast<long double>(p[3]) * p[3] + 2.0L * p[0] * p[2]);
    long double flight = 2 * speed / p[0];
    long double t = p[3] >= 0 ? (p[3] + speed) / p[0] : 2 * p[2] / (speed - p[3]);
    run(ball, {p[2], p[3]}, p[4], 0, points, [&](std::size_t /*k*/, const auto& event) {
        const bool rests = event.kind == EventKind::accumulation;
        const double exact = rests ? ball.zeno_time(p[2], p[3]) : static_cast<double>(t);
        flight *= p[1];
        t += flight;
        return PlayEvent{event.t, rests ? 1. : 0., exact, 0, event.before[1], event.after[1]};
    });
}

// belt speed, static friction, kinetic friction, t_end; unit mass and stiffness, carried from 0
void belt(Parameters p, int points)
{
    const FrictionOscillator oscillator(
        {.belt_speed = p[0], .friction = p[2], .static_friction = p[1]});
    // While it slips it oscillates around u = kinetic friction, and returns to the speed of the
    // belt as far on the other side; then the belt carries it back.
    const long double lag = static_cast<long double>(p[1]) - p[2];
    const long double slip =
        2 * (std::numbers::pi_v<long double> - std::atan2(lag, static_cast<long double>(p[0])));
    const long double stick = 2 * lag / p[0];
    run(oscillator, {0, p[0]}, p[3], FrictionOscillator::stick, points,
        [&](std::size_t k, const auto& event) {
            const long double t = static_cast<long double>(p[1]) / p[0] +
                                  static_cast<long double>((k + 1) / 2) * slip +
                                  static_cast<long double>(k / 2) * stick;
            return PlayEvent{event.t,
                             event.mode_after == FrictionOscillator::stick ? 1. : 0.,
                             lag > 0 && p[0] > 0 ? static_cast<double>(t) : none,
                             event.after[0],
                             event.before[0],
                             event.after[0]};
        });
}

/// A pendulum whose bob hits a wall below its pivot: x = (angle, rate).
struct WalledPendulum {
    using State = std::array<double, 2>;
    static constexpr bool unilateral = true;
    double stiffness, restitution;  ///< gravity / length [1/s²], Newton's coefficient

    void flow(double /*t*/, const State& x, State& dxdt) const
    {
        dxdt = {x[1], -stiffness * std::sin(x[0])};
    }
    [[nodiscard]] double guard(double /*t*/, const State& x) const { return x[0]; }
    void reset(double /*t*/, State& x) const { x = {0, -restitution * x[1]}; }
};

/// Period of a pendulum of this stiffness whose amplitude a has sin(a / 2) = `modulus` in [0, 1):
/// 2 pi / (sqrt(stiffness) agm(1, cos(a / 2))).
long double period(long double stiffness, long double modulus)
{
    long double a = 1;
    long double b = std::sqrt(1 - modulus * modulus);
    for (int k = 0; k < 8; ++k) {  // the digits that are right double with each
        const long double mean = (a + b) / 2;
        b = std::sqrt(a * b);
        a = mean;
    }
    return 2 * std::numbers::pi_v<long double> / (std::sqrt(stiffness) * a);
}

// gravity / length, restitution, angle, t_end
void walled_pendulum(Parameters p, int points)
{
    const WalledPendulum pendulum{p[0], p[1]};
    // The speed at the wall is proportional to sin(amplitude / 2).
    long double modulus = std::sin(static_cast<long double>(p[2]) / 2);
    long double t = period(p[0], modulus) / 4;
    run(pendulum, {p[2], 0}, p[3], 0, points, [&](std::size_t k, const auto& event) {
        if (k > 0) {
            modulus *= p[1];
            t += period(p[0], modulus) / 2;
        }
        return PlayEvent{event.t, 0, static_cast<double>(t), 0, event.before[1], event.after[1]};
    });
}

// rate, ambient, heated, low, high, start, t_end
void thermostat(Parameters p, int points)
{
    const Thermostat thermostat(
        {.rate = p[0], .ambient = p[1], .heated = p[2], .low = p[3], .high = p[4]});
    run(thermostat, {p[5]}, p[6], Thermostat::off, points, [&](std::size_t k, const auto& event) {
        return PlayEvent{event.t,
                         static_cast<double>(event.guard),
                         thermostat.switch_time(static_cast<int>(k), p[5]),
                         event.before[0],
                         event.before[0],
                         event.after[0]};
    });
}

// current, resistance, V1 at the start, t_end
void diode_circuit(Parameters p, int points)
{
    const DiodeCircuit circuit({.resistance = p[1], .current = p[0]});
    DiodeCircuit::Vector start = DiodeCircuit::start();
    start[0] = p[2];
    HandOverOptions options{
        .t_end = p[3], .rtol = tolerance, .atol = tolerance, .max_steps = 100'000};
    for (int k = 0; k < points; ++k) options.sample_times.push_back(path_time(k, points, p[3]));
    const auto run = hand_over(circuit, start, options);
    const auto exact =
        DiodeReference(circuit.parameters()).changes({start[0], start[1], start[2]}, p[3]);
    for (std::size_t k = 0; k < run.events.size(); ++k) {
        const auto& event = run.events[k];
        const double label = event.kind == EventKind::stick  ? 0
                             : event.kind == EventKind::slip ? 1
                                                             : 2;
        results.add_event({event.t, label, k < exact.size() ? exact[k] : none, event.after[0],
                           event.before[1], event.after[1]});
    }
    for (std::size_t k = 0; k < run.trajectory.t.size(); ++k) {
        const auto& w = run.trajectory.x[k];
        results.path.insert(results.path.end(), {run.trajectory.t[k], w[0], w[1]});
    }
    report(describe(run.outcome), run.events.size(), run.statistics);
}

/// The motion of two elastic bodies and a wall, unfolded: in the coordinates sqrt(mass) times
/// position it is a straight line across rays at multiples of `angle`.
/// (G. Galperin, Playing pool with pi, Regular and Chaotic Dynamics 8, 2003.)
class Unfolded {
public:
    Unfolded(long double ratio, long double light, long double heavy, long double speed)
        : angle_(std::atan(1 / std::sqrt(ratio))),
          ratio_(ratio),
          light_(light),
          heavy_(heavy),
          speed_(speed)
    {
    }

    /// Number of impacts: of multiples of `angle` below pi.
    [[nodiscard]] int impacts() const
    {
        return static_cast<int>(std::ceil(std::numbers::pi_v<long double> / angle_)) - 1;
    }
    /// Time [s] of impact n = 1, 2, ...: odd ones are of the bodies, even ones with the wall.
    [[nodiscard]] long double time(int n) const
    {
        return (heavy_ - light_ / (std::sqrt(ratio_) * std::tan(n * angle_))) / speed_;
    }

private:
    long double angle_, ratio_, light_, heavy_, speed_;
};

// mass ratio, distance of the light body, speed of the heavy one
void two_discs(Parameters p, int points)
{
    constexpr double radius = 0.05;  // [m]
    constexpr double gap = 1;        // [m] between the discs
    const Unfolded exact(p[0], p[1], static_cast<long double>(p[1]) + gap, p[2]);
    const double t_end = 1.25 * static_cast<double>(exact.time(exact.impacts()));
    Scene scene;
    scene.wall({.name = "wall", .point = {0, 0}, .normal = {1, 0}});
    const BodyId light = scene.disc({.at = {p[1] + 0.05, 0}, .radius = radius});
    const BodyId heavy = scene.disc(
        {.at = {p[1] + 1.15, 0}, .velocity = {-p[2], 0}, .radius = radius, .mass = p[0]});
    SceneOptions options{.t_end = t_end, .max_events = most_events};
    for (int k = 0; k < points; ++k) options.sample_times.push_back(path_time(k, points, t_end));
    const SceneRun run = simulate(scene, options);
    for (std::size_t k = 0; k < run.events.size(); ++k) {
        const SceneEvent& event = run.events[k];
        const int n = static_cast<int>(k) + 1;
        results.add_event({event.t, event.other.is_surface ? 1. : 0.,
                           n <= exact.impacts() ? static_cast<double>(exact.time(n)) : none,
                           event.at[0], event.before[0][0], event.after[0][0]});
    }
    for (std::size_t k = 0; k < run.sample_times.size(); ++k) {
        const auto& bodies = run.samples[k];
        results.path.insert(results.path.end(), {run.sample_times[k], bodies[light.index].at[0],
                                                 bodies[heavy.index].at[0]});
    }
    results.message = run.message.empty() ? std::string(describe(run.outcome)) : run.message;
    results.counts = {static_cast<double>(run.events.size()),
                      static_cast<double>(run.statistics.predictions), 0};
}

struct Entry {
    std::size_t parameters;
    void (*run)(Parameters, int points);
};
constexpr std::array<Entry, 6> systems{{{5, bouncing_ball},
                                        {4, belt},
                                        {4, walled_pendulum},
                                        {7, thermostat},
                                        {4, diode_circuit},
                                        {3, two_discs}}};

}  // namespace
}  // namespace playground

using namespace playground;

double* play_parameters()
{
    return results.parameters.data();
}

int play_run(int system, int points)
{
    results.events.clear();
    results.path.clear();
    results.counts = {};
    try {
        if (system < 0 || static_cast<std::size_t>(system) >= systems.size()) {
            throw std::invalid_argument("play_run: system must be 0 to " +
                                        std::to_string(systems.size() - 1) + ", got " +
                                        std::to_string(system));
        }
        const Entry& entry = systems[static_cast<std::size_t>(system)];
        entry.run(std::span(results.parameters).first(entry.parameters), points);
    } catch (const std::exception& error) {
        results.message = error.what();
        return -1;
    }
    return static_cast<int>(results.events.size());
}

const double* play_events()
{
    return reinterpret_cast<const double*>(results.events.data());
}

const double* play_path()
{
    return results.path.data();
}

int play_path_rows()
{
    return static_cast<int>(results.path.size() / path_columns);
}

const double* play_counts()
{
    return results.counts.data();
}

const char* play_message()
{
    return results.message.c_str();
}

double play_time_of_runs(int system, int runs)
{
    double last = 0;
    for (int k = 0; k < runs; ++k) last += play_run(system, 0);
    return last;
}
