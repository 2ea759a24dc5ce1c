// Training of a gate for any system, from its own runs.
//
//     learn::GateTraining training;
//     training.recipe = gate_recipe("state");
//     training.levels = learn::horizons(0.001, {2, 4, 8, 16});
//     training.step_min = training.step_max = 0.001;
//     const learn::TrainedGate trained = learn::train_gate(
//         system, learn::from_box<State>(lower, upper), FixedStep<Rk4>{}, {}, training);
//     integrate(system, x0, {.t_end = 20, .step = 0.001}, FixedStep<Rk4>{},
//               Calibrated(gates::Gate(trained.model)));
//
// All names are in the namespace `ricochet`; link `ricochet::learn`. A whole program is in
// docs/expensive-guards.md. Runs with the exact detector provide the states. If the guard is
// expensive, train with a cheap version of it, for example where a waiting time is a parameter.
// The same seed gives the same gate, bit for bit on one machine.
#pragma once

#include <string_view>
#include <utility>

#include "ricochet/detail/gate_runs.hpp"
#include "ricochet/learn/gate.hpp"

namespace ricochet::learn {

/// Trains a gate on runs of `system` and, unless the training was stopped, measures its miss rate
/// on fresh runs. With a checkpoint, a training that was stopped is resumed to the same bits. The
/// callback is also called while states are sampled and events compared; if it stops the work
/// before the first iteration, the model is empty.
///
/// @param options  tolerances of the runs; times and steps come from `training`
/// @throws std::invalid_argument if an option is outside its range, if the recipe does not fit the
/// states, if the runs hold only events, or no event (for a level gate: no guard near its surface),
/// or if a bound that a level gate would rely on is violated.
/// @throws std::runtime_error if the checkpoint cannot be written or read, or is of another
///         training.
template <class System, class X, class Stepping>
[[nodiscard]] TrainedGate train_gate(const System& system, const Starts<X>& starts,
                                     const Stepping& /*stepping*/, const Options& options,
                                     const GateTraining& training,
                                     const ProgressCallback& progress = {})
{
    const auto begin = std::chrono::steady_clock::now();
    GateRuns<System, X, Stepping> runs(system, starts, options, training, progress);
    TrainedGate trained;
    const auto stop = [&] {
        trained.report.outcome = TrainingOutcome::stopped;
        return trained;
    };
    runs.announce();
    if (runs.stopped()) return stop();
    if (training.kind == GateKind::level) {
        if constexpr (Bounded<System, X>) {
            runs.check_bounds(20'000, training.seed + 5'000'003);
        } else {
            detail::throw_no_bounds();
        }
    }
    GateSamples first = runs.sample(training.events, training.states, training.seed);
    GateSamples second =
        runs.sample(training.validation_events, training.states / 4, training.seed + 1'000'003);
    if (runs.stopped()) return stop();
    GateTrainer trainer(training, std::move(first), std::move(second));
    const auto complete = [&] {
        Model model = trainer.model();
        if constexpr (requires { std::string_view(system.name); }) model.system = system.name;
        constexpr bool fixed =
            !std::is_same_v<Stepping, ErrorControlled<typename Stepping::method>>;
        model.step_min = fixed ? training.step_min : 0;
        model.step_max = fixed ? training.step_max : std::numeric_limits<double>::max();
        return model;
    };
    for (std::size_t round = 0; round < training.rounds; ++round) {
        if (!trainer.run(round, progress)) break;
        if (round + 1 == training.rounds) break;
        const std::size_t events =
            training.hard_events > 0 ? training.hard_events : training.events;
        const GateSamples hard =
            runs.hard(gates::Gate(complete()), events, training.seed + 2'000'003 * (round + 2));
        if (runs.stopped()) break;
        trainer.add(hard);
    }
    trained = {.model = complete(), .report = trainer.report()};
    trained.report.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (runs.stopped()) return stop();
    // Weights that are not finite cannot be tried out.
    const bool usable = trained.report.outcome != TrainingOutcome::stopped &&
                        trained.report.outcome != TrainingOutcome::diverged;
    if (training.fresh_events == 0 || !usable) return trained;
    const std::uint64_t fresh = training.seed + 7'000'003;
    GateTrial& trial = trained.report.trial;
    const gates::Gate gate(trained.model);
    const auto try_out = [&](const auto& detector) {
        trial = runs.compare(detector, training.fresh_events, fresh);
        constexpr std::size_t enough = 200;
        trial.rivals = runs.rivals(detector, std::min(enough, training.fresh_events), fresh + 1);
    };
    if (training.kind == GateKind::horizon) {
        try_out(Calibrated(gate));
    } else if constexpr (Bounded<System, X>) {
        try_out(CalibratedBounds(gate));
    }
    if (runs.stopped()) return stop();
    if (trial.events > 0) {
        trained.model.calibration = {.events = trial.events,
                                     .misses = trial.misses,
                                     .miss_bound = trial.miss_bound(),
                                     .steps = trial.steps,
                                     .seed = fresh};
    }
    if (trial.misses > 0 && trained.report.outcome == TrainingOutcome::finished) {
        trained.report.outcome = TrainingOutcome::misses_remain;
    }
    return trained;
}

}  // namespace ricochet::learn
