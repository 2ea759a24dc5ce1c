// ricochet_paths: hot paths of the library, one at a time, for counts of their instructions.
//
//     ricochet_paths                names
//     ricochet_paths <name>         runs it once to warm up and once inside of
//                                   `ricochet_measured_path`, where callgrind counts
//
// bench/instructions.py runs all of them and compares with bench/instructions.json.
#include <fmt/format.h>

#include <array>
#include <cstdio>
#include <exception>
#include <functional>
#include <string_view>
#include <vector>

#include "paths.hpp"
#include "report/ball_scene.hpp"
#include "report/gas.hpp"
#include "report/problems.hpp"
#include "ricochet/bernstein.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/scene/simulate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/thermostat.hpp"
#include "ricochet/taylor/taylor.hpp"
#include "timing.hpp"

extern "C" [[gnu::noinline]] void ricochet_measured_path(const std::function<void()>& path)
{
    path();
}

namespace ricochet::bench {

namespace {

using report::Task;

/// A run whose result is kept.
template <class S, class Stepping = ErrorControlled<Dopri5>, class Detector = Extremum>
Path run(const Task<S>& task, Options options, const Stepping& stepping = {},
         const Detector& detector = {})
{
    options.t_end = task.t_end;
    return [=] {
        auto result = integrate(task.system, task.x0, options, stepping, detector);
        keep(result);
    };
}

const Options loose{.rtol = 1e-8, .atol = 1e-8};
const Options tight{.rtol = 1e-12, .atol = 1e-12};

Task<report::Impacts> twenty_periods()
{
    return report::impact_oscillator(1.2, 20);
}

Path with_dense_output()
{
    Options options = loose;
    options.record_steps = true;
    options.t_end = 20.5;
    return [options] {
        const auto task = report::ball();
        const auto result = integrate(task.system, task.x0, options);
        double sum = 0;
        for (int k = 0; k < 200; ++k) sum += result.solution(0.1 * k)[0];
        keep(sum);
    };
}

Path at_sample_times()
{
    Options options = tight;
    for (int k = 0; k < 200; ++k) options.sample_times.push_back(0.5 * k);
    return run(twenty_periods(), options, ErrorControlled<Fehlberg78>{});
}

Path saved_and_restored()
{
    return [] {
        const auto task = report::ball();
        Options options = loose;
        options.t_end = task.t_end;
        Simulation simulation(task.system, task.x0, options);
        while (simulation.advance()) simulation.restore(simulation.save());
        double t = simulation.t();
        keep(t);
    };
}

Path simulated(const Scene& scene, double t_end)
{
    return [=] {
        auto result = simulate(scene, {.t_end = t_end});
        keep(result);
    };
}

Path ball_as_scene()
{
    const auto task = report::ball();
    return simulated(report::scene_of(task), task.t_end);
}

Path by_network()
{
    const BareNetwork network(load_model(RICOCHET_MODELS "/bouncing-ball-step-0.01.safetensors"));
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    return [=] {
        auto result = integrate(ball, BouncingBall::State{10, 0}, {.t_end = 5, .step = 0.01},
                                FixedStep<Rk4>{}, network);
        keep(result);
    };
}

Path thermostat()
{
    return [] {
        auto result = integrate(Thermostat{}, Thermostat::start, {.t_end = 100, .rtol = 1e-10});
        keep(result);
    };
}

Path circuit()
{
    return [] {
        auto result =
            hand_over(DiodeCircuit{}, DiodeCircuit::start(),
                      {.t_end = 20, .rtol = 1e-8, .atol = 1e-8}, ErrorControlled<Fehlberg78>{});
        keep(result.t);
    };
}

std::vector<Named> paths()
{
    using report::ball;
    std::vector<Named> all{
        {"ball, dopri5", [] { return run(ball(), tight); }},
        {"ball, fehlberg78", [] { return run(ball(), tight, ErrorControlled<Fehlberg78>{}); }},
        {"ball, Taylor", [] { return run(ball(), tight, ErrorControlled<Taylor>{}); }},
        {"ball, rk4, ends", [] { return run(ball(), {.step = 0.01}, FixedStep<Rk4>{}, Ends{}); }},
        {"ball, Bernstein",
         [] { return run(ball(), tight, ErrorControlled<Dopri5>{}, Bernstein{}); }},
        {"ball, network of 5 x 16", by_network},
        {"ball, dense output", with_dense_output},
        {"ball, saved and restored at every event", saved_and_restored},
        {"impacts, dopri5", [] { return run(twenty_periods(), loose); }},
        {"impacts, fehlberg78",
         [] { return run(twenty_periods(), tight, ErrorControlled<Fehlberg78>{}); }},
        {"impacts, Taylor", [] { return run(twenty_periods(), tight, ErrorControlled<Taylor>{}); }},
        {"impacts, 200 sample times", at_sample_times},
        {"Henon-Heiles, fehlberg78",
         [] { return run(report::henon_heiles(), tight, ErrorControlled<Fehlberg78>{}); }},
        {"Arenstorf, Taylor",
         [] { return run(report::arenstorf(), tight, ErrorControlled<Taylor>{}); }},
        {"near-tangent pairs, dopri5", [] { return run(report::near_tangent(1e-8, 2), tight); }},
        {"thermostat, modes", thermostat},
        {"no guard, dopri5", [] { return run(report::pendulum(report::Unwatched{}), loose); }},
        {"idle guard, dopri5",
         [] { return run(report::pendulum(report::Watched{.guards_ = 1}), loose); }},
        {"100 idle guards, dopri5",
         [] { return run(report::pendulum(report::Watched{.guards_ = 100}), loose); }},
        {"10 balls in a vector", [] { return run(report::balls(10), loose); }},
        {"100 balls in a vector", [] { return run(report::balls(100), loose); }},
        {"diode circuit, hand-over", circuit},
        {"ball as a scene", ball_as_scene},
        {"100 discs as a scene",
         [] { return simulated(report::gas_scene(100), report::gas_end(100)); }},
    };
    for (const auto& more : {paths_of_runs(), paths_of_guards(), paths_of_bodies()}) {
        all.insert(all.end(), more.begin(), more.end());
    }
    return all;
}

int main(int argc, char** argv)
{
    if (argc < 2) {
        for (const Named& path : paths()) fmt::print("{}\n", path.name);
        return 0;
    }
    for (const Named& path : paths()) {
        if (path.name != argv[1]) continue;
        const Path ready = path.prepare();
        ready();
        ricochet_measured_path(ready);
        return 0;
    }
    fmt::print(stderr, "ricochet_paths: no path '{}'\n", argv[1]);
    return 2;
}

}  // namespace

}  // namespace ricochet::bench

int main(int argc, char** argv)
{
    try {
        return ricochet::bench::main(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "ricochet_paths: {}\n", error.what());
        return 2;
    }
}
