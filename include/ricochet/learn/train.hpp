// Training of gates and classifiers for a system from its own runs.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/extremum.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/detail/classifier_runs.hpp"
#include "ricochet/learn/gate_runs.hpp"

namespace ricochet::learn {

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

namespace detail {

/// States that the next round learns, too, chosen by the gate of this one.
template <class Runs>
[[nodiscard]] GateSamples more_states(Runs& runs, const GateTraining& training, const Model& model,
                                      std::size_t round)
{
    const std::size_t events = training.hard_events > 0 ? training.hard_events : training.events;
    const std::uint64_t seed = training.seed + 2'000'003 * (round + 2);
    if (training.logarithmic) return runs.sample_with(model, events, seed);
    return runs.hard(gates::Gate(model), events, seed);
}

/// Lowers the thresholds of a gate until its misses, on runs that trained nothing, are as rare as
/// demanded.
template <class System, class X, class Stepping>
void calibrate(GateRuns<System, X, Stepping>& runs, const GateTraining& training,
               TrainedGate& trained)
{
    GateWalks walks(trained.model, calibration_shifts());
    runs.calibrate(walks, calibration_events(training), training.seed + 4'000'003);
    if (runs.stopped()) return;
    trained.report.calibration = lower_thresholds(trained.model, walks, training.miss_rate);
}

/// Measures the misses of a gate on fresh runs, and the cost of its rivals there.
template <class System, class X, class Stepping>
void try_out(GateRuns<System, X, Stepping>& runs, const GateTraining& training,
             TrainedGate& trained)
{
    const std::uint64_t fresh = training.seed + 7'000'003;
    GateTrial& trial = trained.report.trial;
    const gates::Gate gate(trained.model);
    const auto compare = [&](const auto& detector) {
        trial = runs.compare(detector, training.fresh_events, fresh);
        constexpr std::size_t enough = 200;
        trial.rivals = runs.rivals(detector, std::min(enough, training.fresh_events), fresh + 1);
    };
    if (training.kind == GateKind::horizon) {
        compare(Calibrated(gate));
    } else if constexpr (BoundedGuards<System, X>) {
        compare(CalibratedBounds(gate));
    }
    if (runs.stopped()) {
        trained.report.outcome = TrainingOutcome::stopped;
        return;
    }
    if (trial.events > 0) {
        trained.model.calibration = {.events = trial.events,
                                     .misses = trial.misses,
                                     .miss_bound = trial.miss_bound(),
                                     .steps = trial.steps,
                                     .seed = fresh};
    }
    const double allowed = training.miss_rate * static_cast<double>(trial.events);
    if (static_cast<double>(trial.misses) > allowed &&
        trained.report.outcome == TrainingOutcome::finished) {
        trained.report.outcome = TrainingOutcome::misses_remain;
    }
}

}  // namespace detail

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
        if constexpr (BoundedGuards<System, X>) {
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
        const GateSamples hard = detail::more_states(runs, training, complete(), round);
        if (runs.stopped()) break;
        trainer.add(hard);
    }
    trained = {.model = complete(), .report = trainer.report()};
    // Weights that are not finite cannot be tried out.
    const bool usable = trained.report.outcome != TrainingOutcome::stopped &&
                        trained.report.outcome != TrainingOutcome::diverged;
    if (usable && training.miss_rate > 0 && training.kind == GateKind::horizon) {
        detail::calibrate(runs, training, trained);
    }
    trained.report.guard_calls = runs.guard_calls();
    trained.report.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (runs.stopped()) return stop();
    if (training.fresh_events > 0 && usable) detail::try_out(runs, training, trained);
    return trained;
}

/// First runs of `system` and the training that follows from them for this aim; see `choose`.
///
/// @throws std::invalid_argument if the aim is outside its range, or the runs hold no event.
template <class System, class X, class Stepping>
[[nodiscard]] std::pair<GateTraining, GateSurvey> survey_gate(
    const System& system, const Starts<X>& starts, const Stepping& /*stepping*/,
    const Options& options, const GateAim& aim, const ProgressCallback& progress = {})
{
    const GateTraining first = detail::surveying(aim);
    GateRuns<System, X, Stepping> runs(system, starts, options, first, progress);
    const GateSurvey survey = runs.survey(first.events, aim.seed + 9'000'003);
    if (runs.stopped()) return {first, survey};
    return {choose(aim, survey), survey};
}

/// Surveys first runs, chooses horizons, width, states and events for the aim, and trains; see
/// `choose` and the other `train_gate`.
template <class System, class X, class Stepping>
[[nodiscard]] TrainedGate train_gate(const System& system, const Starts<X>& starts,
                                     const Stepping& stepping, const Options& options,
                                     const GateAim& aim, const ProgressCallback& progress = {})
{
    const auto [training, survey] = survey_gate(system, starts, stepping, options, aim, progress);
    if (survey.intervals.empty()) return interrupted_gate();
    TrainedGate trained = train_gate(system, starts, stepping, options, training, progress);
    trained.report.add(survey, aim);
    return trained;
}

// Training of a network that predicts the events of any system with one guard, from its own runs.
//
//     ClassifierTraining training;
//     training.step = 0.01;
//     const auto starts = learn::from_box(State{-1, -2}, State{0.5, 2});
//     const TrainedClassifier trained =
//         learn::train_classifier(system, starts, FixedStep<Rk4>{}, {}, training);
//     if (trained.misses_none()) store_model(path, trained.model);
//     std::puts(trained.trial.describe().c_str());
//     integrate(system, x0, options, FixedStep<Rk4>{}, BareNetwork(trained.model));
//
// Saunders, Steyer and Kuether (SAND2023-06682C, eqs. 4 to 6) sample a known event surface; here it
// is sampled by the events of runs. From these, states are traced backward in time and labelled by
// one step of the method forward. The network sees the state alone, so flow and guard must not
// depend on anything else.

/// A trained classifier, its report, and its comparison with other detectors.
struct TrainedClassifier {
    Model model;
    Report report;
    ClassifierTrial trial;

    /// Whether the classifier misses no event of its test set.
    [[nodiscard]] bool misses_none() const noexcept { return Trained{model, report}.misses_none(); }
};

/// Samples runs of `system`, trains a network on them, assesses it on states of other runs, and
/// compares its cost with that of the exact detector, on runs with the same starts. The callback is
/// that of `train`, and is also called before and after the training proper. If it stops the work,
/// what was computed so far is returned as `stopped`, with an empty model if the training had not
/// started.
///
/// @param options  event settings of the runs; times and the step come from `training`
/// @throws std::invalid_argument if an option is outside its range, no run can be started, or the
///         runs hold no event; and as `train`.
template <class System, class X, class Method>
requires(fixed_guard_count<System, X>() == 1) [[nodiscard]] TrainedClassifier
    train_classifier(const System& system, const Starts<X>& starts,
                     const FixedStep<Method>& /*stepping*/, const Options& options,
                     const ClassifierTraining& training, const ProgressCallback& progress = {})
{
    detail::check(training);
    detail::ClassifierRuns<System, X, Method> runs(system, starts, options, training, progress);
    TrainedClassifier out;
    try {
        runs.announce();
        const auto surface = runs.meet(training.seed);
        const SurfaceSample seen = runs.sample(surface, training.states, training.seed, false);
        TrainingOptions how = training.training;
        how.seed = training.seed;
        Trained trained = train(seen.data, how, progress);
        out.model = std::move(trained.model);
        out.report = trained.report;
        if constexpr (requires { std::string_view(system.name); }) out.model.system = system.name;
        out.model.recipe = name(ricochet::detail::Recipe::state);
        out.model.domain = surface.box();
        out.model.step_min = out.model.step_max = training.step;
        out.report.band = seen.band;
        const TrainingOutcome ended = out.report.outcome;
        if (ended == TrainingOutcome::diverged || ended == TrainingOutcome::stopped) return out;

        auto other = runs.meet(training.seed + 1'000'003);
        other.set_box(surface.box());
        const SurfaceSample fresh =
            runs.sample(other, training.fresh_states, training.seed + 1000, true);
        out.report.fresh = assess(out.model, fresh.data, training.margin);
        if (!out.misses_none() && out.report.outcome == TrainingOutcome::finished) {
            out.report.outcome = TrainingOutcome::misses_remain;
        }
        runs.compare(BareNetwork(out.model), out.trial);
    } catch (const detail::Asked::Stopped&) {
        out.report.outcome = TrainingOutcome::stopped;
    }
    return out;
}

}  // namespace ricochet::learn
