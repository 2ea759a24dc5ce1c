#include "gates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numbers>
#include <stdexcept>
#include <string>

#include "any_system.hpp"
#include "input.hpp"
#include "ricochet/learn/train_gate.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/pendulum.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"

namespace ricochet::app {

namespace {

using X = AnySystem::State;
using learn::GateTraining;
using learn::Starts;

/// The values of a system's parameters by their names.
class Values {
public:
    Values(const SystemEntry& system, const std::vector<std::string>& set)
        : system_(&system), values_(parameter_values(system, set))
    {
    }
    [[nodiscard]] double operator()(std::string_view name) const
    {
        for (std::size_t i = 0; i < values_.size(); ++i) {
            if (system_->parameters[i].name == name) return values_[i];
        }
        throw std::logic_error("no parameter " + std::string(name));
    }

private:
    const SystemEntry* system_;
    std::vector<double> values_;
};

/// What is particular to a system.
struct GateSpec {
    AnySystem system;
    std::vector<std::string_view> parameters;  ///< that the gate depends on
    std::string recipe;
    Starts<X> starts;
    double step;        ///< [s] the largest of the fixed ones; the smallest is half of it
    double run_length;  ///< [s]
    std::vector<std::size_t> hidden{16};
    std::size_t events = 3000;  ///< of the training runs
};

GateSpec impact_oscillator(const Values& value)
{
    const double wall = value("wall");
    const double frequency = value("frequency");
    return {
        .system = AnySystem(ImpactOscillator({.frequency = frequency,
                                              .wall = wall,
                                              .restitution = value("restitution"),
                                              .damping = value("damping")})),
        .parameters = {"frequency", "wall", "restitution", "damping"},
        .recipe = fmt::format("state-phase({})", frequency),
        .starts =
            learn::from_box(X{-wall, -1}, X{0.99 * wall, 1}, 0, 2 * std::numbers::pi / frequency),
        .step = 0.02,
        .run_length = 200,
        .hidden = {32, 32},  // impacts that graze the wall are rare, and a small part of the box
        .events = 20'000};
}

GateSpec stick_slip(const Values& value)
{
    const double belt = value("belt-speed");
    const double reach = value("friction") / value("stiffness");
    return {.system = AnySystem(StickSlip({.mass = value("mass"),
                                           .stiffness = value("stiffness"),
                                           .belt_speed = belt,
                                           .friction = value("friction"),
                                           .weakening = value("weakening")})),
            .parameters = {"mass", "stiffness", "belt-speed", "friction", "weakening"},
            .recipe = "state mode(3)",
            .starts = learn::from_box(X{-1.5 * reach, belt - 1.5}, X{1.5 * reach, belt - 0.01}, 0,
                                      0, StickSlip::slip_left),
            .step = 0.02,
            .run_length = 40};
}

GateSpec coulomb_oscillator(const Values& value)
{
    return {.system = AnySystem(CoulombOscillator({.mass = value("mass"),
                                                   .stiffness = value("stiffness"),
                                                   .friction = value("friction"),
                                                   .static_friction = value("static-friction")})),
            .parameters = {"mass", "stiffness", "friction", "static-friction"},
            .recipe = "state mode(3)",
            .starts = learn::from_box(X{-3, -3}, X{3, -0.01}, 0, 0, CoulombOscillator::slip_left),
            .step = 0.02,
            .run_length = 20};
}

GateSpec thermostat(const Values& value)
{
    const double low = value("low");
    const double high = value("high");
    const double edge = 0.001 * (high - low);
    return {.system = AnySystem(Thermostat({.rate = value("rate"),
                                            .ambient = value("ambient"),
                                            .heated = value("heated"),
                                            .low = low,
                                            .high = high})),
            .parameters = {"rate", "ambient", "heated", "low", "high"},
            .recipe = "state mode(2)",
            .starts = learn::from_box(X{low + edge}, X{high - edge}, 0, 0, Thermostat::off),
            .step = 0.02,
            .run_length = 50};
}

GateSpec pendulum(const Values& value)
{
    return {.system = AnySystem(Pendulum({.gravity = value("gravity"), .length = value("length")})),
            .parameters = {"gravity", "length"},
            .recipe = "state",
            .starts = learn::from_box(X{-1.5, -3}, X{1.5, 3}),
            .step = 0.01,
            .run_length = 20};
}

struct Known {
    std::string_view name;
    GateSpec (*make)(const Values& value);
};

constexpr std::array<Known, 5> known{{{"impact-oscillator", impact_oscillator},
                                      {"stick-slip", stick_slip},
                                      {"coulomb-oscillator", coulomb_oscillator},
                                      {"thermostat", thermostat},
                                      {"pendulum", pendulum}}};

/// The mean step [s] that error control takes.
double mean_step(const GateSpec& spec, const Options& tolerances)
{
    learn::Random random(1);
    double time = 0;
    double steps = 0;
    for (int k = 0; k < 20; ++k) {
        const learn::RunStart<X> start = spec.starts(random);
        Options options = tolerances;
        options.t_start = start.t;
        options.t_end = start.t + spec.run_length;
        options.mode = start.mode;
        Simulation<AnySystem, X> run(spec.system, start.x, options);
        const Run<X> done = run.take();
        time += done.t - start.t;
        steps += static_cast<double>(done.statistics.steps);
    }
    return time / steps;
}

GateTraining training_of(const GateSpec& spec, const TrainingRequest& request)
{
    GateTraining training;
    training.recipe = gate_recipe(spec.recipe);
    training.run_length = spec.run_length;
    training.hidden = spec.hidden;
    training.events = spec.events;
    training.validation_events = spec.events / 2;
    training.logit_margin = 1;
    training.states = request.states.value_or(100'000);
    training.iterations = request.iterations.value_or(4000);
    training.fresh_events = request.fresh_events.value_or(30'000);
    training.seed = request.seed.value_or(1);
    training.checkpoint = request.checkpoint;
    training.resume = request.resume;
    return training;
}

}  // namespace

std::vector<std::string_view> gate_kinds(std::string_view system)
{
    const bool found =
        std::any_of(known.begin(), known.end(), [&](const Known& k) { return k.name == system; });
    return found ? std::vector<std::string_view>{"gate", "gate-adaptive"}
                 : std::vector<std::string_view>{};
}

learn::TrainedGate train_system_gate(const SystemEntry& system, const TrainingRequest& request,
                                     const learn::ProgressCallback& progress)
{
    const Values value(system, request.set);
    const auto* const entry = std::find_if(known.begin(), known.end(),
                                           [&](const Known& k) { return k.name == system.name; });
    const GateSpec spec = entry->make(value);
    GateTraining training = training_of(spec, request);
    const Options tolerances{};
    learn::TrainedGate trained;
    if (request.kind == "gate-adaptive") {
        if (request.step) throw BadInput("--step is for --kind gate, whose steps are fixed");
        training.levels = learn::horizons(mean_step(spec, tolerances), {2, 4, 8, 16});
        trained = learn::train_gate(spec.system, spec.starts, ErrorControlled<Dopri5>{}, tolerances,
                                    training, progress);
    } else {
        training.step_max = request.step.value_or(spec.step);
        training.step_min = request.step.value_or(0.5 * spec.step);
        training.levels = learn::horizons(training.step_max, {2, 4, 8, 16, 32, 64});
        trained = learn::train_gate(spec.system, spec.starts, FixedStep<Rk4>{}, tolerances,
                                    training, progress);
    }
    trained.model.system = system.name;
    for (const std::string_view name : spec.parameters) {
        trained.model.parameters[std::string(name)] = value(name);
    }
    return trained;
}

}  // namespace ricochet::app
