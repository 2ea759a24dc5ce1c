// The runs on which the gates of the library are trained.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "ricochet/learn/data_set.hpp"
#include "ricochet/learn/train.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/pendulum.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"

namespace ricochet::learn {

/// A system for which the library has a gate, with vectors as states, so that runs are compiled
/// once for all of them.
class GateSystem {
public:
    using State = std::vector<double>;
    using Held = std::variant<ImpactOscillator, StickSlip, CoulombOscillator, Thermostat, Pendulum>;

    explicit GateSystem(Held system) : held_(std::move(system)) {}

    void flow(Mode mode, double t, const State& x, State& dxdt) const;
    [[nodiscard]] std::size_t guard_count() const;
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const;
    [[nodiscard]] bool enabled(std::size_t which, Mode mode) const;
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const State& x) const;
    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const State& x,
                                    const State& dxdt) const;
    [[nodiscard]] Mode reset(std::size_t which, Mode mode, double t, State& x) const;
    [[nodiscard]] std::size_t mode_count() const;

private:
    Held held_;
};

/// Properties of the runs of a system: where they start, and how long they and their steps are.
struct GateSpec {
    GateSystem system;
    std::string recipe;            ///< of the features
    std::vector<Column> features;  ///< what the recipe makes
    Starts<GateSystem::State> starts;
    double step;        ///< [s] the largest of the fixed ones; the smallest is half of it
    double run_length;  ///< [s]
    std::vector<std::size_t> hidden{16};
    std::size_t events = 3000;  ///< of the training runs
};

/// The specification for a system with these parameters.
/// @throws std::invalid_argument if a parameter is outside its range.
[[nodiscard]] GateSpec gate_spec(const ImpactOscillator::Parameters& p);
[[nodiscard]] GateSpec gate_spec(const StickSlip::Parameters& p);
[[nodiscard]] GateSpec gate_spec(const CoulombOscillator::Parameters& p);
[[nodiscard]] GateSpec gate_spec(const Thermostat::Parameters& p);
[[nodiscard]] GateSpec gate_spec(const Pendulum::Parameters& p);

enum class GateStepping {
    fixed,     ///< RK4, each run with a step of its own in [step / 2, step]
    adaptive,  ///< DOPRI5 under error control with the default tolerances
};

/// The training of the shipped gate, horizons included: 100 000 states, seed 1.
[[nodiscard]] GateTraining gate_training(const GateSpec& spec, GateStepping stepping);

/// The states with which the training begins, and those that choose weights and thresholds, as
/// `train_gate` draws them. Between its rounds it adds states on which the network of the round is
/// wrong; they follow from the network.
struct GateSets {
    GateSamples training;
    GateSamples validation;
};
/// @param progress  as `train_gate`; where it stops the runs, the sets are not complete
[[nodiscard]] GateSets gate_sets(const GateSpec& spec, GateStepping stepping,
                                 const GateTraining& training,
                                 const ProgressCallback& progress = {});

}  // namespace ricochet::learn
