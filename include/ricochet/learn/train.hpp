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
#include "ricochet/learn/gate_runs.hpp"
#include "ricochet/learn/surface.hpp"

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
    } else if constexpr (BoundedGuards<System, X>) {
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

/// Options of `train_classifier`.
struct ClassifierTraining {
    double step = 0;         ///< [s] fixed step for which the network is made, positive
    double run_length = 10;  ///< [s] length of a run; the next one has a new start

    std::size_t surface_points = 2000;     ///< events of the runs, from which states are taken
    std::size_t states = 100'000;          ///< for training and testing, half of them events
    std::size_t fresh_states = 40'000;     ///< for the report, from other runs
    std::size_t trial_events = 1000;       ///< events of the runs that measure the cost
    std::size_t most_steps = 100'000'000;  ///< largest number in each of these sets of runs
    double margin = 0.05;  ///< clear states nearer to the boundary are not trained on
    double widened = 0.1;  ///< fraction by which the domain exceeds the box of the runs on a side
    std::uint64_t seed = 1;
    TrainingOptions training{};  ///< its seed is replaced by the one above
};

/// Comparison of the exact detector `Ends` and the network on the same runs.
struct ClassifierTrial {
    std::uint64_t events = 0;  ///< of the exact runs
    std::uint64_t missed = 0;  ///< of these, found a step late by the network, or never
    std::uint64_t steps = 0;
    std::uint64_t exact_calls = 0;    ///< guard calls of the exact runs
    std::uint64_t network_calls = 0;  ///< guard calls of the runs with the network
    double exact_seconds = 0;         ///< [s] processor time
    double network_seconds = 0;

    /// Whether runs with the network took less time than exact runs.
    [[nodiscard]] bool pays() const noexcept { return network_seconds < exact_seconds; }

    std::vector<Rival>
        rivals{};  ///< other ways of detection, on some of these runs; the network last

    /// One sentence that says which way of checking is faster, and what the network misses.
    [[nodiscard]] std::string describe() const;
};

/// A trained classifier, its report, and its comparison with other detectors.
struct TrainedClassifier {
    Model model;
    Report report;
    ClassifierTrial trial;

    /// Whether the classifier misses no event of its test set.
    [[nodiscard]] bool misses_none() const noexcept { return Trained{model, report}.misses_none(); }
};

namespace detail {

/// Validates the options. @throws std::invalid_argument naming the option.
void check(const ClassifierTraining& training);
/// @throws std::invalid_argument always: the runs hold no event.
[[noreturn]] void throw_no_surface(std::uint64_t steps);
/// @throws std::invalid_argument always: the state has more components than a network takes.
[[noreturn]] void throw_too_many_components(std::size_t found, std::size_t most);

/// Regular calls of the progress callback before and after the training proper.
class Asked {
public:
    struct Stopped {};

    explicit Asked(const ProgressCallback& progress) : progress_(&progress) {}

    /// @param every  number of steps of work between two calls of the callback
    void begin(std::string_view stage, std::size_t total, std::uint64_t every = 64)
    {
        stage_ = stage;
        total_ = total;
        every_ = every;
        calls_ = 0;
    }
    /// Reports the estimated cost of the runs.
    /// @throws Stopped if the callback returns false
    void announce(const TrainingEstimate& estimate)
    {
        if (!(*progress_)({.total = total_,
                           .loss = std::numeric_limits<double>::quiet_NaN(),
                           .stage = stage_,
                           .estimate = estimate})) {
            throw Stopped{};
        }
    }
    /// @throws Stopped if the callback returns false
    void operator()(std::size_t done)
    {
        if (calls_++ % every_ != 0 || !*progress_) return;
        const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - started_;
        if (!(*progress_)({.iteration = done,
                           .total = total_,
                           .loss = std::numeric_limits<double>::quiet_NaN(),
                           .misses = 0,
                           .seconds = spent.count(),
                           .stage = stage_})) {
            throw Stopped{};
        }
    }

private:
    const ProgressCallback* progress_;
    std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
    std::string_view stage_;
    std::size_t total_ = 0;
    std::uint64_t every_ = 64;
    std::uint64_t calls_ = 0;
};

/// The event surface of a system, sampled by the events of its runs; see `SurfaceProblem`. Times
/// are counted in steps.
template <class System, class X, class Method>
class MetSurface {
public:
    struct State {
        double t;  ///< [s]
        X x;
        Mode mode;
        double armed;  ///< 1 if the guard falls at the event, -1 if it rises
        double back;   ///< [steps] to the event before
    };

    MetSurface(const System& system, double step, Asked& asked)
        : system_(&system), step_(step), asked_(&asked)
    {
    }

    void add(const State& at) { points_.push_back(at); }
    [[nodiscard]] std::size_t size() const noexcept { return points_.size(); }
    void visit(const X& x)
    {
        if (box_.empty()) box_.assign(static_cast<std::size_t>(x.size()), ValueRange{x[0], x[0]});
        for (std::size_t i = 0; i < box_.size(); ++i) {
            const double component = x[static_cast<decltype(x.size())>(i)];
            if (first_) box_[i] = {component, component};
            box_[i].lower = std::min(box_[i].lower, component);
            box_[i].upper = std::max(box_[i].upper, component);
        }
        first_ = false;
    }
    void widen(double share)
    {
        for (ValueRange& side : box_) {
            const double width = side.upper - side.lower;
            side.lower -= share * width;
            side.upper += share * width;
        }
    }
    [[nodiscard]] const std::vector<ValueRange>& box() const noexcept { return box_; }
    void set_box(const std::vector<ValueRange>& box) { box_ = box; }

    // --- the interface `SurfaceProblem` ---

    [[nodiscard]] State surface(Random& random) const
    {
        return points_[random.below(points_.size())];
    }
    [[nodiscard]] double guard(const State& at) const
    {
        return at.armed * ricochet::detail::call_guard(*system_, 0, at.mode, at.t, at.x);
    }
    [[nodiscard]] double horizon(const State& at) const { return at.back; }
    [[nodiscard]] double magnitude(const State& at, double steps) const
    {
        const double here = guard(at);
        return std::fabs(here) + std::fabs(guard((*this)(at, steps)) - here) +
               std::numeric_limits<double>::min();
    }
    [[nodiscard]] bool inside(const State& at) const
    {
        for (std::size_t i = 0; i < box_.size(); ++i) {
            const double component = at.x[static_cast<decltype(at.x.size())>(i)];
            if (!(component >= box_[i].lower && component <= box_[i].upper)) return false;
        }
        return true;
    }
    [[nodiscard]] std::vector<Column> columns() const
    {
        std::vector<Column> out;
        for (std::size_t i = 0; i < box_.size(); ++i) {
            out.push_back({"x[" + std::to_string(i) + "]", "1"});
        }
        return out;
    }
    void features(const State& at, double* out) const
    {
        for (std::size_t i = 0; i < box_.size(); ++i) {
            out[i] = at.x[static_cast<decltype(at.x.size())>(i)];
        }
    }

    /// The method's map over `steps` steps, of either sign, without events.
    [[nodiscard]] State operator()(const State& at, double steps) const
    {
        (*asked_)(0);
        if (steps == 0) return at;
        const double span = steps * step_;
        const double parts = std::ceil(std::fabs(steps) * (1 - 1e-12));
        const FlowOnly<System, X> flow{system_, at.mode};
        const Options options{
            .t_start = at.t, .t_end = at.t + span, .step = std::fabs(span) / std::max(parts, 1.0)};
        State out = at;
        Run<X> run = integrate(flow, at.x, options, FixedStep<Method>{});
        out.t = run.t;
        out.x = std::move(run.x);
        return out;
    }

private:
    const System* system_;
    double step_;
    Asked* asked_;
    std::vector<State> points_;
    std::vector<ValueRange> box_;
    bool first_ = true;
};

}  // namespace detail

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
    using Surface = detail::MetSurface<System, X, Method>;
    detail::check(training);
    detail::Asked asked(progress);
    TrainedClassifier out;
    Options run_options = options;
    run_options.step = training.step;
    run_options.sample_times.clear();
    run_options.record_steps = false;
    run_options.record_events = true;

    const auto start = [&](Random& random) {
        std::string why = "no start was dealt out";
        for (int attempt = 0; attempt < 1000; ++attempt) {
            const RunStart<X> from = starts(random);
            run_options.t_start = from.t;
            run_options.t_end = from.t + training.run_length;
            run_options.mode = from.mode;
            try {
                (void)Simulation(system, from.x, run_options, FixedStep<Method>{}, Ends{});
                return from;
            } catch (const std::invalid_argument& error) {
                why = error.what();
            }
        }
        detail::throw_no_start(why);
    };

    const auto meet = [&](std::uint64_t seed) {
        Surface surface(system, training.step, asked);
        asked.begin("sampling", training.surface_points);
        Random random(seed);
        std::uint64_t steps = 0;
        while (surface.size() < training.surface_points && steps < training.most_steps) {
            asked(surface.size());
            const RunStart<X> from = start(random);
            const std::size_t components = static_cast<std::size_t>(from.x.size());
            if (components > BareNetwork::max_features) {
                detail::throw_too_many_components(components, BareNetwork::max_features);
            }
            Simulation run(system, from.x, run_options, FixedStep<Method>{});
            double last = from.t;
            std::size_t seen = 0;
            while (run.step()) {
                asked(surface.size());
                surface.visit(run.x());
                const auto& events = run.run().events;
                for (; seen < events.size(); ++seen) {
                    const auto& event = events[seen];
                    if (!changes_sign(event.kind)) continue;
                    const double back = (event.t - last) / training.step;
                    last = event.t;
                    if (!(back > 1e-3)) continue;
                    surface.add({.t = event.t,
                                 .x = event.before,
                                 .mode = event.mode_before,
                                 .armed = event.slope > 0 ? -1.0 : 1.0,
                                 .back = back});
                }
            }
            steps += run.run().statistics.steps + 1;
            if (surface.size() == 0 && steps > 2'000'000) break;
        }
        if (surface.size() == 0) detail::throw_no_surface(steps);
        surface.widen(training.widened);
        return surface;
    };
    const auto sample = [&](const Surface& surface, std::size_t states, std::uint64_t seed,
                            bool keep_band) {
        asked.begin("labelling", 0);
        return sample_surface(surface, surface,
                              {.step = 1,
                               .events = states / 2,
                               .clear = states / 2,
                               .margin = training.margin,
                               .keep_band = keep_band,
                               .longest = 50,
                               .beyond_share = 0,
                               .seed = seed});
    };

    try {
        if (progress) {
            Random random(training.seed);
            const auto cost = detail::cost_of_runs([&] {
                const RunStart<X> from = start(random);
                return Simulation(system, from.x, run_options, FixedStep<Method>{});
            });
            // The trial follows each run twice.
            asked.begin("sampling", training.surface_points);
            asked.announce(cost.for_events(2 * (training.surface_points + training.trial_events),
                                           4 * training.most_steps));
        }
        const Surface surface = meet(training.seed);
        const SurfaceSample seen = sample(surface, training.states, training.seed, false);
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

        Surface other = meet(training.seed + 1'000'003);
        other.set_box(surface.box());
        const SurfaceSample fresh =
            sample(other, training.fresh_states, training.seed + 1000, true);
        out.report.fresh = assess(out.model, fresh.data, training.margin);
        if (!out.misses_none() && out.report.outcome == TrainingOutcome::finished) {
            out.report.outcome = TrainingOutcome::misses_remain;
        }

        const BareNetwork network(out.model);
        Random random(training.seed + 2'000'003);
        asked.begin("comparing", training.trial_events, 1);
        const auto time = [](double& seconds, const auto& run) {
            const double before = detail::processor_seconds();
            auto result = run();
            seconds += detail::processor_seconds() - before;
            return result;
        };
        ClassifierTrial& trial = out.trial;
        run_options.record_events = false;
        while (trial.events < training.trial_events && trial.steps < training.most_steps) {
            asked(trial.events);
            const RunStart<X> from = start(random);
            const auto exact = time(trial.exact_seconds, [&] {
                return integrate(system, from.x, run_options, FixedStep<Method>{}, Ends{});
            });
            const auto predicted = time(trial.network_seconds, [&] {
                return integrate(system, from.x, run_options, FixedStep<Method>{}, network);
            });
            trial.events += exact.statistics.events;
            trial.steps += exact.statistics.steps + 1;
            trial.exact_calls += exact.statistics.guard_calls;
            trial.network_calls += predicted.statistics.guard_calls;
            const std::uint64_t late = predicted.statistics.late_events;
            const std::uint64_t lost = exact.statistics.events > predicted.statistics.events
                                           ? exact.statistics.events - predicted.statistics.events
                                           : 0;
            trial.missed += std::max(late, lost);
        }
        detail::RivalRuns<System, X, FixedStep<Method>, BareNetwork> rivals(system, network);
        while (rivals.events() < std::min<std::uint64_t>(trial.events, 200)) {
            asked(trial.events);
            const X x0 = start(random).x;
            rivals.add(x0, run_options);
        }
        trial.rivals = rivals.rivals();
    } catch (const detail::Asked::Stopped&) {
        out.report.outcome = TrainingOutcome::stopped;
    }
    return out;
}

}  // namespace ricochet::learn
