// What detection adds to a step: time per step, and the error of the events that
// the same run finds on the ball of the source paper.
//
//     step/<system>/<method>/<state type, of rk4>/<detector>
//
//     scene/<system>/<search>/<detector>      expensive guards: 2 s of rk4 at 1 ms
//
// Networks are named by their hidden layers: 1x16 is the any-step model of the ball,
// 5x16 the one for steps of 0.01 s. `line` is the rival that knows the boundary.
#include <benchmark/benchmark.h>

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "app/ballistic_line.hpp"
#include "problems.hpp"
#include "problems/cavern.hpp"
#include "problems/planar_arm.hpp"
#include "problems/zones.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/planned.hpp"
#include "score.hpp"
#include "timing.hpp"

namespace {

using namespace ricochet;
using bench::Problem;

using Array = std::array<double, 2>;

Eigen::VectorXd dynamic(double a, double b)
{
    Eigen::VectorXd x(2);
    x << a, b;
    return x;
}

BareNetwork stored(const char* file)
{
    return BareNetwork(load_model(std::filesystem::path(RICOCHET_MODELS) / file));
}

/// Times a run without events, and reports the cost of one step and its counts.
template <class System, class X, class Stepping, class Detector>
void per_step(benchmark::State& state, const System& system, const X& x0, const Options& options,
              const Stepping& stepping, const Detector& detector)
{
    const auto check = integrate(system, x0, options, stepping, detector);
    if (check.outcome != Outcome::reached_end || check.statistics.events != 0) {
        state.SkipWithError("the run met an event, or did not reach its end");
        return;
    }
    for (auto _ : state) {
        auto run = integrate(system, x0, options, stepping, detector);
        bench::keep(run);
    }
    using benchmark::Counter;
    const auto steps = static_cast<double>(check.statistics.steps);
    state.counters["steps"] = steps;
    state.counters["flow/step"] = static_cast<double>(check.statistics.flow_calls) / steps;
    state.counters["guard/step"] = static_cast<double>(check.statistics.guard_calls) / steps;
    state.counters["time/step"] =
        Counter(steps, Counter::kIsIterationInvariantRate | Counter::kInvert);
}

/// Largest error [s] of the 13 impacts at step 0.01 with this detector.
template <class X, class Detector>
double event_error(const X& x0, const Detector& detector)
{
    const bench::BallProblem problem = bench::b1();
    const auto run = integrate(problem.system, x0, {.t_end = problem.t_end, .step = 0.01},
                               FixedStep<Rk4>{}, detector);
    std::vector<double> times;
    for (const auto& event : run.events) times.push_back(event.t);
    const bench::Score score = bench::score(times, problem.events);
    return score.complete() ? score.error : std::numeric_limits<double>::infinity();
}

/// A flight of 305 steps of 0.01 s, launched at 15 m/s, inside the network's box.
const Options flight{.t_end = 3.05, .step = 0.01, .record_events = false};

template <class X, class Detector>
void ball_rk4(benchmark::State& state, const X& launch, const X& drop, const Detector& detector)
{
    const double error = event_error(drop, detector);
    per_step(state, BouncingBall(), launch, flight, FixedStep<Rk4>{}, detector);
    state.counters["event_error_s"] = error;
}

template <class X>
void ball_rk4_unguarded(benchmark::State& state, const X& launch)
{
    const bench::Unguarded<BouncingBall> system{BouncingBall()};
    per_step(state, system, launch, flight, FixedStep<Rk4>{}, Ends{});
}

/// Error control from far above the floor; the parabola itself needs no small
/// steps, so the step is held to 0.1 s.
template <class System, class Detector>
void controlled(benchmark::State& state, const System& system, const Array& x0, double h_max,
                const Detector& detector)
{
    const Options options{
        .t_end = 20, .rtol = 1e-8, .atol = 1e-8, .h_max = h_max, .record_events = false};
    per_step(state, system, x0, options, ErrorControlled<Dopri5>{}, detector);
}

/// Times a run through a scene with an expensive guard.
template <class System, class Detector>
void scene(benchmark::State& state, const System& system, const Detector& detector)
{
    const Options options{.t_end = 2, .step = 1e-3, .record_events = false};
    const auto start = system.start();
    const auto once = [&] { return integrate(system, start, options, FixedStep<Rk4>{}, detector); };
    const auto check = once();
    for (auto _ : state) {
        auto run = once();
        bench::keep(run);
    }
    using benchmark::Counter;
    const auto steps = static_cast<double>(check.statistics.steps);
    state.counters["steps"] = steps;
    state.counters["events"] = static_cast<double>(check.statistics.events);
    state.counters["guard/step"] = static_cast<double>(check.statistics.guard_calls) / steps;
    state.counters["bound/step"] = static_cast<double>(check.statistics.bound_calls) / steps;
    state.counters["time/step"] =
        Counter(steps, Counter::kIsIterationInvariantRate | Counter::kInvert);
}

/// Registers three detectors: every step, planned, and every tenth step.
template <class System>
void register_scene(const std::string& name, const System& system)
{
    const auto add = [&](const char* how, const auto& detector) {
        benchmark::RegisterBenchmark(("scene/" + name + "/" + how).c_str(),
                                     [=](benchmark::State& s) { scene(s, system, detector); });
    };
    const PlannerOptions trusting{.check_bounds = false};
    add("every_step", Extremum{});
    add("planned", Planned<>(trusting));
    add("every_10", EveryK<>(10));
}

void register_scenes()
{
    for (const std::size_t segments : {100U, 10'000U}) {
        const std::string name = "cavern_" + std::to_string(segments);
        register_scene(name + "/tree", Cavern({.segments = segments}));
        register_scene(name + "/brute",
                       Cavern({.segments = segments, .search = Cavern::Search::brute}));
    }
    register_scene("arm_4_joints/tree", PlanarArm<4>());
    register_scene("arm_4_joints/brute", PlanarArm<4>({.search = ArmScene::Search::brute}));
    register_scene("zones_256/closed_form", Zones());
}

void register_all()
{
    const auto add = [](const char* name, auto body) { benchmark::RegisterBenchmark(name, body); };
    using S = benchmark::State;
    const Array launch{0, 15};
    const Array drop{10, 0};

    add("odeint_step/ball/rk4", [](S& state) {
        const bench::Work work = bench::yardstick();
        constexpr std::size_t batch = 1000;
        for (auto _ : state) work(batch);
        state.counters["time/step"] = benchmark::Counter(
            batch, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
    });
    const BareNetwork any_step = stored("bouncing-ball.safetensors");
    const BareNetwork fixed_step = stored("bouncing-ball-step-0.01.safetensors");
    const Verified<Extremum> gate_1x16(any_step);
    const Verified<Extremum> gate_5x16(fixed_step);

    add("step/ball/rk4/array/none", [=](S& s) { ball_rk4_unguarded(s, launch); });
    add("step/ball/rk4/array/ends", [=](S& s) { ball_rk4(s, launch, drop, Ends{}); });
    add("step/ball/rk4/array/extremum", [=](S& s) { ball_rk4(s, launch, drop, Extremum{}); });
    add("step/ball/rk4/array/line", [=](S& s) { ball_rk4(s, launch, drop, BallisticLine{}); });
    add("step/ball/rk4/array/network_1x16", [=](S& s) { ball_rk4(s, launch, drop, any_step); });
    add("step/ball/rk4/array/network_5x16", [=](S& s) { ball_rk4(s, launch, drop, fixed_step); });
    add("step/ball/rk4/array/verified_1x16", [=](S& s) { ball_rk4(s, launch, drop, gate_1x16); });
    add("step/ball/rk4/array/verified_5x16", [=](S& s) { ball_rk4(s, launch, drop, gate_5x16); });

    const Eigen::VectorXd vector_launch = dynamic(0, 15);
    const Eigen::VectorXd vector_drop = dynamic(10, 0);
    add("step/ball/rk4/vectorxd/none", [=](S& s) { ball_rk4_unguarded(s, vector_launch); });
    add("step/ball/rk4/vectorxd/ends",
        [=](S& s) { ball_rk4(s, vector_launch, vector_drop, Ends{}); });
    add("step/ball/rk4/vectorxd/extremum",
        [=](S& s) { ball_rk4(s, vector_launch, vector_drop, Extremum{}); });
    add("step/ball/rk4/vectorxd/network_5x16",
        [=](S& s) { ball_rk4(s, vector_launch, vector_drop, fixed_step); });

    const Array high{1e6, 0};
    const BouncingBall ball;
    const bench::Unguarded<BouncingBall> free_fall{ball};
    add("step/ball/dopri5/none", [=](S& s) { controlled(s, free_fall, high, 0.1, Ends{}); });
    add("step/ball/dopri5/ends", [=](S& s) { controlled(s, ball, high, 0.1, Ends{}); });
    add("step/ball/dopri5/extremum", [=](S& s) { controlled(s, ball, high, 0.1, Extremum{}); });
    add("step/ball/dopri5/line", [=](S& s) { controlled(s, ball, high, 0.1, BallisticLine{}); });
    add("step/ball/dopri5/network_1x16", [=](S& s) { controlled(s, ball, high, 0.1, any_step); });
    add("step/ball/dopri5/verified_1x16", [=](S& s) { controlled(s, ball, high, 0.1, gate_1x16); });

    const Array swing{1, 0};
    constexpr double any = std::numeric_limits<double>::infinity();
    const bench::WatchedPendulum watched;
    const bench::Unguarded<bench::WatchedPendulum> pendulum{watched};
    add("step/pendulum/dopri5/none", [=](S& s) { controlled(s, pendulum, swing, any, Ends{}); });
    add("step/pendulum/dopri5/ends", [=](S& s) { controlled(s, watched, swing, any, Ends{}); });
    add("step/pendulum/dopri5/extremum",
        [=](S& s) { controlled(s, watched, swing, any, Extremum{}); });
}

}  // namespace

int main(int argc, char** argv)
{
    register_all();
    register_scenes();
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    benchmark::Shutdown();
    return 0;
}
