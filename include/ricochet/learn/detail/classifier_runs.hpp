// Internal: the declarations of this header may change without notice.
//
// The runs of a system from which a classifier is trained, and on which it is measured.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/extremum.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/classifier_training.hpp"
#include "ricochet/learn/gate_runs.hpp"
#include "ricochet/learn/surface.hpp"

namespace ricochet::learn::detail {

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

/// The runs from which a classifier is made: they sample the event surface, label states, and
/// compare the network with other detectors.
template <class System, class X, class Method>
class ClassifierRuns {
public:
    using Surface = MetSurface<System, X, Method>;

    /// Keeps references to all but `options`.
    ClassifierRuns(const System& system, const Starts<X>& starts, const Options& options,
                   const ClassifierTraining& training, const ProgressCallback& progress)
        : system_(&system),
          starts_(&starts),
          training_(&training),
          options_(options),
          asked_(progress),
          announces_(static_cast<bool>(progress))
    {
        options_.step = training.step;
        options_.sample_times.clear();
        options_.record_steps = false;
    }

    /// Reports what the runs are going to cost, where there is a callback. The trial follows each
    /// twice.
    void announce()
    {
        if (!announces_) return;
        options_.record_events = true;
        Random random(training_->seed);
        const auto cost = cost_of_runs([&] {
            const RunStart<X> from = start(random);
            return Simulation(*system_, from.x, options_, FixedStep<Method>{});
        });
        asked_.begin("sampling", training_->surface_points);
        asked_.announce(cost.for_events(2 * (training_->surface_points + training_->trial_events),
                                        4 * training_->most_steps));
    }

    /// The events of runs with the starts of `seed`, and the box that the runs have visited.
    /// @throws std::invalid_argument if the runs hold none.
    [[nodiscard]] Surface meet(std::uint64_t seed)
    {
        Surface surface(*system_, training_->step, asked_);
        asked_.begin("sampling", training_->surface_points);
        options_.record_events = true;
        Random random(seed);
        std::uint64_t steps = 0;
        while (surface.size() < training_->surface_points && steps < training_->most_steps) {
            asked_(surface.size());
            steps += follow(start(random), surface) + 1;
            if (surface.size() == 0 && steps > 2'000'000) break;
        }
        if (surface.size() == 0) throw_no_surface(steps);
        surface.widen(training_->widened);
        return surface;
    }

    /// States traced backward from the surface, labelled by one step forward.
    [[nodiscard]] SurfaceSample sample(const Surface& surface, std::size_t states,
                                       std::uint64_t seed, bool keep_band)
    {
        asked_.begin("labelling", 0);
        return sample_surface(surface, surface,
                              {.step = 1,
                               .events = states / 2,
                               .clear = states / 2,
                               .margin = training_->margin,
                               .keep_band = keep_band,
                               .longest = 50,
                               .beyond_share = 0,
                               .seed = seed});
    }

    /// Fills in `trial` from runs with fresh starts.
    void compare(const BareNetwork& network, ClassifierTrial& trial)
    {
        Random random(training_->seed + 2'000'003);
        asked_.begin("comparing", training_->trial_events, 1);
        options_.record_events = false;
        while (trial.events < training_->trial_events && trial.steps < training_->most_steps) {
            asked_(trial.events);
            add(start(random).x, network, trial);
        }
        RivalRuns<System, X, FixedStep<Method>, BareNetwork> rivals(*system_, network);
        while (rivals.events() < std::min<std::uint64_t>(trial.events, 200)) {
            asked_(trial.events);
            const X x0 = start(random).x;
            rivals.add(x0, options_);
        }
        trial.rivals = rivals.rivals();
    }

private:
    /// A start from which a run can begin; the options become those of that run.
    [[nodiscard]] RunStart<X> start(Random& random)
    {
        std::string why = "no start was dealt out";
        for (int attempt = 0; attempt < 1000; ++attempt) {
            const RunStart<X> from = (*starts_)(random);
            options_.t_start = from.t;
            options_.t_end = from.t + training_->run_length;
            options_.mode = from.mode;
            try {
                (void)Simulation(*system_, from.x, options_, FixedStep<Method>{}, Ends{});
                return from;
            } catch (const std::invalid_argument& error) {
                why = error.what();
            }
        }
        throw_no_start(why);
    }

    /// Adds the events of one run to the surface. Returns its steps.
    std::uint64_t follow(const RunStart<X>& from, Surface& surface)
    {
        const auto components = static_cast<std::size_t>(from.x.size());
        if (components > BareNetwork::max_features) {
            throw_too_many_components(components, BareNetwork::max_features);
        }
        Simulation run(*system_, from.x, options_, FixedStep<Method>{});
        double last = from.t;
        std::size_t seen = 0;
        while (run.step()) {
            asked_(surface.size());
            surface.visit(run.x());
            const auto& events = run.run().events;
            for (; seen < events.size(); ++seen) {
                const auto& event = events[seen];
                if (!changes_sign(event.kind)) continue;
                const double back = (event.t - last) / training_->step;
                last = event.t;
                if (!(back > 1e-3)) continue;
                surface.add({.t = event.t,
                             .x = event.before,
                             .mode = event.mode_before,
                             .armed = event.slope > 0 ? -1.0 : 1.0,
                             .back = back});
            }
        }
        return run.run().statistics.steps;
    }

    /// One run, with the exact detector and with the network.
    void add(const X& x0, const BareNetwork& network, ClassifierTrial& trial)
    {
        const auto time = [](double& seconds, const auto& run) {
            const double before = processor_seconds();
            auto result = run();
            seconds += processor_seconds() - before;
            return result;
        };
        const auto exact = time(trial.exact_seconds, [&] {
            return integrate(*system_, x0, options_, FixedStep<Method>{}, Ends{});
        });
        const auto predicted = time(trial.network_seconds, [&] {
            return integrate(*system_, x0, options_, FixedStep<Method>{}, network);
        });
        const Statistics& of_exact = exact.statistics;
        const Statistics& of_network = predicted.statistics;
        trial.events += of_exact.events;
        trial.steps += of_exact.steps + 1;
        trial.exact_calls += of_exact.guard_calls;
        trial.network_calls += of_network.guard_calls;
        const std::uint64_t lost =
            of_exact.events > of_network.events ? of_exact.events - of_network.events : 0;
        trial.missed += std::max(of_network.late_events, lost);
    }

    const System* system_;
    const Starts<X>* starts_;
    const ClassifierTraining* training_;
    Options options_;
    Asked asked_;
    bool announces_;
};

}  // namespace ricochet::learn::detail
