#include "gate_specs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>
#include <utility>

namespace ricochet::learn {

namespace {

using X = GateSystem::State;

/// u and v of a mass on a spring, and its three modes one by one.
std::vector<Column> friction_features()
{
    return {{"u", "m"}, {"v", "m/s"}, {"mode 0", "1"}, {"mode 1", "1"}, {"mode 2", "1"}};
}

/// Mean step [s] under error control.
double mean_step(const GateSpec& spec)
{
    Random random(1);
    double time = 0;
    double steps = 0;
    for (int k = 0; k < 20; ++k) {
        const RunStart<X> start = spec.starts(random);
        const Options options{
            .t_start = start.t, .t_end = start.t + spec.run_length, .mode = start.mode};
        Simulation<GateSystem, X> run(spec.system, start.x, options);
        const Run<X> done = run.take();
        time += done.t - start.t;
        steps += static_cast<double>(done.statistics.steps);
    }
    return time / steps;
}

template <class Stepping>
GateSets sets_of(const GateSpec& spec, const GateTraining& training,
                 const ProgressCallback& progress)
{
    GateRuns<GateSystem, X, Stepping> runs(spec.system, spec.starts, {}, training, progress);
    // A named variable, since the order of the two draws is that of `train_gate`.
    GateSamples first = runs.sample(training.events, training.states, training.seed);
    GateSamples second =
        runs.sample(training.validation_events, training.states / 4, training.seed + 1'000'003);
    return {.training = std::move(first), .validation = std::move(second)};
}

}  // namespace

void GateSystem::flow(Mode mode, double t, const State& x, State& dxdt) const
{
    std::visit([&](const auto& system) { ricochet::detail::call_flow(system, mode, t, x, dxdt); },
               held_);
}

std::size_t GateSystem::guard_count() const
{
    return std::visit([](const auto& system) { return guard_count_of<State>(system); }, held_);
}

GuardInfo GateSystem::guard_info(std::size_t which) const
{
    return std::visit(
        [&]<class System>(const System& system) {
            GuardInfo info = guard_info_of<State>(system, which);
            info.resets = info.resets && Resetting<System, State>;
            return info;
        },
        held_);
}

bool GateSystem::enabled(std::size_t which, Mode mode) const
{
    return std::visit(
        [&](const auto& system) { return ricochet::detail::call_enabled_in(system, which, mode); },
        held_);
}

double GateSystem::guard(std::size_t which, Mode mode, double t, const State& x) const
{
    return std::visit(
        [&](const auto& system) { return ricochet::detail::call_guard(system, which, mode, t, x); },
        held_);
}

double GateSystem::guard_rate(std::size_t which, Mode mode, double t, const State& x,
                              const State& dxdt) const
{
    return std::visit(
        [&](const auto& system) {
            return ricochet::detail::call_rate(system, which,
                                               ricochet::detail::Along{mode, t, x, dxdt});
        },
        held_);
}

Mode GateSystem::reset(std::size_t which, Mode mode, double t, State& x) const
{
    return std::visit(
        [&]<class System>(const System& system) {
            if constexpr (Resetting<System, State>) {
                return ricochet::detail::call_reset(system, which, mode, t, x);
            }
            return mode;
        },
        held_);
}

std::size_t GateSystem::mode_count() const
{
    const std::size_t declared =
        std::visit([](const auto& system) { return mode_count_of(system); }, held_);
    return std::max<std::size_t>(declared, 1);
}

GateSpec gate_spec(const ImpactOscillator::Parameters& p)
{
    return {.system = GateSystem(ImpactOscillator(p)),
            .recipe = fmt::format("state-phase({})", p.frequency),
            .features = {{"u", "1"}, {"v", "1"}, {"sin(phase)", "1"}, {"cos(phase)", "1"}},
            .starts = from_box(X{-p.wall, -1}, X{0.99 * p.wall, 1}, 0,
                               2 * std::numbers::pi / p.frequency),
            .step = 0.02,
            .run_length = 200,
            .hidden = {32, 32},  // impacts that graze the wall are rare, a small part of the box
            .events = 20'000};
}

GateSpec gate_spec(const StickSlip::Parameters& p)
{
    const double reach = p.friction / p.stiffness;
    return {.system = GateSystem(StickSlip(p)),
            .recipe = "state mode(3)",
            .features = friction_features(),
            .starts = from_box(X{-1.5 * reach, p.belt_speed - 1.5},
                               X{1.5 * reach, p.belt_speed - 0.01}, 0, 0, StickSlip::slip_left),
            .step = 0.02,
            .run_length = 40};
}

GateSpec gate_spec(const CoulombOscillator::Parameters& p)
{
    return {.system = GateSystem(CoulombOscillator(p)),
            .recipe = "state mode(3)",
            .features = friction_features(),
            .starts = from_box(X{-3, -3}, X{3, -0.01}, 0, 0, CoulombOscillator::slip_left),
            .step = 0.02,
            .run_length = 20};
}

GateSpec gate_spec(const Thermostat::Parameters& p)
{
    const double edge = 0.001 * (p.high - p.low);
    return {.system = GateSystem(Thermostat(p)),
            .recipe = "state mode(2)",
            .features = {{"temperature", "degrees"}, {"mode 0", "1"}, {"mode 1", "1"}},
            .starts = from_box(X{p.low + edge}, X{p.high - edge}, 0, 0, Thermostat::off),
            .step = 0.02,
            .run_length = 50};
}

GateSpec gate_spec(const Pendulum::Parameters& p)
{
    return {.system = GateSystem(Pendulum(p)),
            .recipe = "state",
            .features = {{"angle", "rad"}, {"angular velocity", "rad/s"}},
            .starts = from_box(X{-1.5, -3}, X{1.5, 3}),
            .step = 0.01,
            .run_length = 20};
}

GateTraining gate_training(const GateSpec& spec, GateStepping stepping)
{
    GateTraining training;
    training.recipe = gate_recipe(spec.recipe);
    training.run_length = spec.run_length;
    training.hidden = spec.hidden;
    training.events = spec.events;
    training.validation_events = spec.events / 2;
    training.logit_margin = 1;
    training.states = 100'000;
    if (stepping == GateStepping::adaptive) {
        training.levels = horizons(mean_step(spec), {2, 4, 8, 16});
    } else {
        training.step_max = spec.step;
        training.step_min = 0.5 * spec.step;
        training.levels = horizons(training.step_max, {2, 4, 8, 16, 32, 64});
    }
    return training;
}

GateSets gate_sets(const GateSpec& spec, GateStepping stepping, const GateTraining& training,
                   const ProgressCallback& progress)
{
    if (stepping == GateStepping::adaptive) {
        return sets_of<ErrorControlled<Dopri5>>(spec, training, progress);
    }
    return sets_of<FixedStep<Rk4>>(spec, training, progress);
}

}  // namespace ricochet::learn
