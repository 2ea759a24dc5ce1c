#include "gates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string>

#include "input.hpp"
#include "learn/gate_specs.hpp"

namespace ricochet::app {

namespace {

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

learn::GateSpec impact_oscillator(const Values& value)
{
    return learn::gate_spec(ImpactOscillator::Parameters{.frequency = value("frequency"),
                                                         .wall = value("wall"),
                                                         .restitution = value("restitution"),
                                                         .damping = value("damping")});
}

learn::GateSpec stick_slip(const Values& value)
{
    return learn::gate_spec(StickSlip::Parameters{.mass = value("mass"),
                                                  .stiffness = value("stiffness"),
                                                  .belt_speed = value("belt-speed"),
                                                  .friction = value("friction"),
                                                  .weakening = value("weakening")});
}

learn::GateSpec coulomb_oscillator(const Values& value)
{
    return learn::gate_spec(
        CoulombOscillator::Parameters{.mass = value("mass"),
                                      .stiffness = value("stiffness"),
                                      .friction = value("friction"),
                                      .static_friction = value("static-friction")});
}

learn::GateSpec thermostat(const Values& value)
{
    return learn::gate_spec(Thermostat::Parameters{.rate = value("rate"),
                                                   .ambient = value("ambient"),
                                                   .heated = value("heated"),
                                                   .low = value("low"),
                                                   .high = value("high")});
}

learn::GateSpec pendulum(const Values& value)
{
    return learn::gate_spec(
        Pendulum::Parameters{.gravity = value("gravity"), .length = value("length")});
}

struct Known {
    std::string_view name;
    std::vector<std::string_view> parameters;  ///< parameters on which the gate depends
    learn::GateSpec (*make)(const Values& value);
};

const std::vector<Known>& known()
{
    static const std::vector<Known> all{
        {"impact-oscillator", {"frequency", "wall", "restitution", "damping"}, impact_oscillator},
        {"stick-slip", {"mass", "stiffness", "belt-speed", "friction", "weakening"}, stick_slip},
        {"coulomb-oscillator",
         {"mass", "stiffness", "friction", "static-friction"},
         coulomb_oscillator},
        {"thermostat", {"rate", "ambient", "heated", "low", "high"}, thermostat},
        {"pendulum", {"gravity", "length"}, pendulum}};
    return all;
}

}  // namespace

std::vector<std::string_view> gate_kinds(std::string_view system)
{
    const bool found = std::any_of(known().begin(), known().end(),
                                   [&](const Known& k) { return k.name == system; });
    return found ? std::vector<std::string_view>{"gate", "gate-adaptive"}
                 : std::vector<std::string_view>{};
}

learn::TrainedGate train_system_gate(const SystemEntry& system, const TrainingRequest& request,
                                     const learn::ProgressCallback& progress)
{
    const Values value(system, request.set);
    const auto entry = std::find_if(known().begin(), known().end(),
                                    [&](const Known& k) { return k.name == system.name; });
    const learn::GateSpec spec = entry->make(value);
    const bool adaptive = request.kind == "gate-adaptive";
    learn::GateTraining training = learn::gate_training(
        spec, adaptive ? learn::GateStepping::adaptive : learn::GateStepping::fixed);
    training.states = request.states.value_or(training.states);
    training.iterations = request.iterations.value_or(training.iterations);
    training.fresh_events = request.fresh_events.value_or(training.fresh_events);
    training.seed = request.seed.value_or(training.seed);
    training.checkpoint = request.checkpoint;
    training.resume = request.resume;
    const Options tolerances{};
    learn::TrainedGate trained;
    if (adaptive) {
        if (request.step) throw BadInput("--step is for --kind gate, whose steps are fixed");
        trained = learn::train_gate(spec.system, spec.starts, ErrorControlled<Dopri5>{}, tolerances,
                                    training, progress);
    } else {
        if (request.step) {
            training.step_max = training.step_min = *request.step;
            training.levels = learn::horizons(*request.step, {2, 4, 8, 16, 32, 64});
        }
        trained = learn::train_gate(spec.system, spec.starts, FixedStep<Rk4>{}, tolerances,
                                    training, progress);
    }
    trained.model.system = system.name;
    for (const std::string_view name : entry->parameters) {
        trained.model.parameters[std::string(name)] = value(name);
    }
    return trained;
}

}  // namespace ricochet::app
