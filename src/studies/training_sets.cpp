#include "studies/training_sets.hpp"

#include <array>
#include <cmath>
#include <utility>

#include "learn/gate_specs.hpp"
#include "ricochet/faults/friction.hpp"
#include "ricochet/learn/classifier.hpp"

namespace ricochet::studies {

namespace {

using learn::BallModel;
using learn::GateStepping;
using learn::ProgressCallback;

void append(TrainingSet& set, const learn::DataSet& data, double which)
{
    for (std::size_t i = 0; i < data.size(); ++i) {
        const std::span<const double> row = data.row(i);
        set.values.insert(set.values.end(), row.begin(), row.end());
        set.values.insert(set.values.end(),
                          {static_cast<double>(data.labels[i]), data.margins[i], which});
    }
}

/// A set as sampled by `train_bouncing_ball` and split by `train`.
template <BallModel kind>
TrainingSet ball_set(const ProgressCallback& /*progress*/)
{
    const learn::BallTraining training = learn::ball_training(kind);
    const std::size_t half = training.states / 2;
    const learn::SurfaceSample sample =
        learn::sample_ball(kind, training, half, half, training.seed, /*keep_band=*/false);
    const learn::Split outer =
        learn::split(sample.data, training.training.test_share, training.seed);
    const learn::Split inner =
        learn::split(outer.kept, training.training.validation_share, training.seed + 1);
    TrainingSet set{.columns = sample.data.columns};
    set.columns.insert(set.columns.end(), {{"label", "1"}, {"margin", "1"}, {"part", "1"}});
    append(set, inner.kept, part::training);
    append(set, inner.held_out, part::validation);
    append(set, outer.held_out, part::test);
    return set;
}

void append(TrainingSet& set, const learn::GateSamples& samples, double which)
{
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const std::span<const double> row = samples.row(i);
        set.values.insert(set.values.end(), row.begin(), row.end());
        set.values.insert(set.values.end(),
                          {samples.event[i], samples.back[i], samples.weight[i], which});
    }
}

/// A set of the system with its default parameters, as for the shipped gates.
template <class System, GateStepping stepping>
TrainingSet gate_set(const ProgressCallback& progress)
{
    const learn::GateSpec spec = learn::gate_spec(typename System::Parameters{});
    const learn::GateSets sets =
        learn::gate_sets(spec, stepping, learn::gate_training(spec, stepping), progress);
    TrainingSet set{.columns = spec.features};
    set.columns.insert(
        set.columns.end(),
        {{"time to event", "s"}, {"time to return", "s"}, {"weight", "1"}, {"part", "1"}});
    append(set, sets.training, part::training);
    append(set, sets.validation, part::validation);
    return set;
}

/// The histories of `ageing-friction`: 96 for training, and all those from which its errors are
/// computed.
TrainingSet friction_set(const ProgressCallback& /*progress*/)
{
    constexpr std::size_t histories = 96;
    const FrictionData data = make_friction_data(1);
    TrainingSet set{.columns = {{"history", "1"},
                                {"linear", "1"},
                                {"t", "s"},
                                {"V", "m/s"},
                                {"friction", "1"},
                                {"part", "1"}}};
    double number = 0;
    const auto add = [&](const FrictionHistory& history, double which) {
        const bool linear = history.between == FrictionHistory::Between::linear;
        for (std::size_t i = 0; i < history.t.size(); ++i) {
            set.values.insert(set.values.end(), {number, linear ? 1.0 : 0.0, history.t[i],
                                                 history.v[i], history.friction[i], which});
        }
        ++number;
    };
    for (std::size_t i = 0; i < histories; ++i) add(data.training[i], part::training);
    for (const FrictionHistory& history : data.test) add(history, part::test);
    return set;
}

constexpr std::string_view of_ball = "states sampled from the floor backward, learn::sample_ball";
constexpr std::string_view of_gate = "states of runs, learn::gate_sets";
constexpr std::string_view by_evolution =
    "a search by evolution, scored by the work of whole runs of random problems";
constexpr std::string_view by_reward =
    "reinforcement learning, from rewards along runs that its own steps make";

constexpr std::array<ModelData, 20> all{{
    {"ageing-friction", "histories of slip rate and friction, make_friction_data", friction_set},
    {"bouncing-ball", of_ball, ball_set<BallModel::any_step>},
    {"bouncing-ball-step-0.01", of_ball, ball_set<BallModel::fixed_step>},
    {"coulomb-oscillator-gate", of_gate, gate_set<CoulombOscillator, GateStepping::fixed>},
    {"coulomb-oscillator-gate-adaptive", of_gate,
     gate_set<CoulombOscillator, GateStepping::adaptive>},
    {"diode-circuit-step", by_evolution, nullptr},
    {"diode-circuit-tqc", by_reward, nullptr},
    {"eigenvalue-certified",
     "regression on new random states for each batch, a quarter of them where the network "
     "is worst",
     nullptr},
    {"fault-step", by_evolution, nullptr},
    {"fault-tqc", by_reward, nullptr},
    {"impact-oscillator-gate", of_gate, gate_set<ImpactOscillator, GateStepping::fixed>},
    {"impact-oscillator-gate-adaptive", of_gate,
     gate_set<ImpactOscillator, GateStepping::adaptive>},
    {"pendulum-gate", of_gate, gate_set<Pendulum, GateStepping::fixed>},
    {"pendulum-gate-adaptive", of_gate, gate_set<Pendulum, GateStepping::adaptive>},
    {"posts-gate", "states of runs, those of a later round chosen by the network of the last",
     nullptr},
    {"sliding-mode-step", by_evolution, nullptr},
    {"sliding-mode-tqc", by_reward, nullptr},
    {"stick-slip-gate", of_gate, gate_set<StickSlip, GateStepping::fixed>},
    {"stick-slip-gate-adaptive", of_gate, gate_set<StickSlip, GateStepping::adaptive>},
    {"thermostat-gate", of_gate, gate_set<Thermostat, GateStepping::fixed>},
}};

}  // namespace

std::span<const ModelData> model_data() noexcept
{
    return all;
}

TrainingSet elementary_functions()
{
    TrainingSet set{.columns = {{"x", "1"},
                                {"exp(x / 16)", "1"},
                                {"log(x)", "1"},
                                {"sin(x)", "1"},
                                {"cos(x)", "1"},
                                {"x^0.2", "1"}}};
    for (int i = 0; i < 10'000; ++i) {
        const double x = 0.001 + 0.0137 * i;
        set.values.insert(set.values.end(), {x, std::exp(x / 16), std::log(x), std::sin(x),
                                             std::cos(x), std::pow(x, 0.2)});
    }
    return set;
}

}  // namespace ricochet::studies
