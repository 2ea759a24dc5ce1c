// The runs of a system on which a gate is trained and measured.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <deque>
#include <functional>
#include <initializer_list>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/detail/components.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/detail/gate_labels.hpp"
#include "ricochet/learn/detail/gate_walks.hpp"
#include "ricochet/learn/detail/rivals.hpp"
#include "ricochet/learn/detail/side_by_side.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::learn {

namespace detail {

/// @throws std::invalid_argument: no run can be started.
[[noreturn]] void throw_no_start(const std::string& why);
/// @throws std::invalid_argument: the recipe makes nothing of these states.
[[noreturn]] void throw_no_features(const std::string& recipe, std::size_t components);
/// @throws std::invalid_argument: the runs hold fewer events than requested.
[[noreturn]] void throw_no_events(std::uint64_t steps);

/// @throws std::invalid_argument: a level gate of a system without bounds.
[[noreturn]] void throw_no_bounds();
/// @throws std::invalid_argument: a guard has broken a bound; see `WrongBound`.
[[noreturn]] void throw_wrong_bound(std::size_t guard, double since, double then, double t,
                                    double value, double allowed);

}  // namespace detail

/// Runs of a system, and the samples taken from them.
template <class System, class X, class Stepping>
class GateRuns {
    using Exact = Simulation<System, X, Stepping>;
    static constexpr double infinity = std::numeric_limits<double>::infinity();
    static constexpr bool fixed_step =
        !std::is_same_v<Stepping, ErrorControlled<typename Stepping::method>>;

public:
    /// Keeps a reference to the system. `options`: tolerances and event settings; times, step
    /// and recording are set here. `progress` is called every few steps, and may stop the runs.
    GateRuns(const System& system, Starts<X> starts, const Options& options,
             const GateTraining& training, ProgressCallback progress = {})
        : system_(&system),
          starts_(std::move(starts)),
          options_(options),
          training_(training),
          progress_(std::move(progress))
    {
        check(training, fixed_step);
        options_.sample_times.clear();
        options_.record_steps = false;
        options_.record_events = true;
        options_.stop_at_event = false;
    }

    /// Whether the callback stopped the runs; the result is then not complete.
    [[nodiscard]] bool stopped() const noexcept { return stopped_; }

    /// Tells the callback what the runs will cost. Runs for tests are computed twice, and once more
    /// for each rival.
    void announce()
    {
        if (!progress_) return;
        Random random(training_.seed);
        const detail::RunCost cost = detail::cost_of_runs([&] { return start(random); });
        const GateTraining& t = training_;
        const std::size_t hard = t.hard_events > 0 ? t.hard_events : t.events;
        const std::size_t sets = 2 + (t.rounds - 1) + 2;
        std::uint64_t most = sets * t.most_steps;
        if (t.kind == GateKind::level) most = (sets - 1) * 2 * t.states + 2 * t.most_steps;
        const TrainingEstimate estimate = cost.for_events(
            t.events + t.validation_events + (t.rounds - 1) * hard + 2 * t.fresh_events, most);
        stopped_ = !progress_({.total = t.events,
                               .loss = std::numeric_limits<double>::quiet_NaN(),
                               .stage = "sampling",
                               .estimate = estimate});
    }

    /// Runs that show how often events come, how long a guard stays beyond its surface, at most for
    /// the longest horizon, and what a call of it costs.
    [[nodiscard]] GateSurvey survey(std::size_t events, std::uint64_t seed)
    {
        Random random(seed);
        GateSurvey seen;
        GateSamples nowhere;
        survey_ = &seen;
        const std::uint64_t before = guard_calls_;
        begin_stage("surveying", events);
        while (nowhere.events < events && nowhere.steps < training_.most_steps && !stopped_) {
            Exact run = start(random);
            follow(run, {nowhere, 0, random});
            if (nowhere.events == 0 && nowhere.steps > 2'000'000) break;  // there are none
        }
        survey_ = nullptr;
        seen.guard_calls = guard_calls_ - before;
        std::vector<RunStart<X>> states;
        for (int i = 0; i < 64 && !stopped_; ++i) states.push_back(starts_(random));
        const auto [seconds, calls] = detail::price_of_guard(*system_, states);
        seen.guard_seconds = seconds;
        guard_calls_ += calls;
        return seen;
    }

    /// Calls of the guard so far, without those of `compare` and `rivals`.
    [[nodiscard]] std::uint64_t guard_calls() const noexcept { return guard_calls_; }

    /// Samples states from runs with `events` events in total. Of the states without an event in
    /// reach, a fraction is kept that gives about `states` in total, each with its weight.
    [[nodiscard]] GateSamples sample(std::size_t events, std::size_t states, std::uint64_t seed)
    {
        Random random(seed);
        GateSamples out;
        double share = training_.kind == GateKind::level ? 0.5 : 1;
        // A level gate learns from any state.
        const std::size_t most = training_.kind == GateKind::horizon
                                     ? training_.most_steps
                                     : std::min(training_.most_steps, 2 * states);
        near_.clear();
        begin_stage("sampling", events);
        while (out.events < events && out.steps < most && !stopped_) {
            Exact run = start(random);
            if (walks_ != nullptr) walks_->restart();
            follow(run, {out, share, random});
            if (out.events == 0 && out.steps > 2'000'000) break;  // there are none
            // As many clear states are kept as there is room for.
            const double expected =
                training_.kind == GateKind::level
                    ? static_cast<double>(most)
                    : static_cast<double>(out.steps) *
                          std::max(1.0, static_cast<double>(events) /
                                            static_cast<double>(out.events + 1));
            share = std::clamp(static_cast<double>(states) / expected, 1e-4, 1.0);
        }
        if (out.events == 0 && training_.kind == GateKind::horizon && !stopped_) {
            detail::throw_no_events(out.steps);
        }
        return out;
    }

    /// Counts checks and misses of the gate with each of these thresholds, on runs with `events`
    /// events in total that are checked at every step.
    void calibrate(detail::GateWalks& walks, std::size_t events, std::uint64_t seed)
    {
        Random random(seed);
        GateSamples nowhere;
        walks_ = &walks;
        begin_stage("calibrating", events);
        while (nowhere.events < events && nowhere.steps < training_.most_steps && !stopped_) {
            walks.restart();
            Exact run = start(random);
            follow(run, {nowhere, 0, random});
        }
        walks_ = nullptr;
    }

    /// Samples states of new runs, and those at which the gate is asked along them, with weight 0.
    [[nodiscard]] GateSamples sample_with(const Model& gate, std::size_t events, std::uint64_t seed)
    {
        detail::GateWalks walks(gate, {0.0});
        walks_ = &walks;
        GateSamples out = sample(events, training_.states, seed);
        walks_ = nullptr;
        return out;
    }

    /// Samples new states on which the gate is wrong or nearly so, and states near them.
    [[nodiscard]] GateSamples hard(const gates::Gate& gate, std::size_t events, std::uint64_t seed)
    {
        const GateSamples fresh = sample(events, training_.states / 4, seed);
        Random random(seed ^ 0x9e3779b9U);
        GateSamples out;
        out.box = fresh.box;
        out.events = fresh.events;
        out.steps = fresh.steps;
        out.width = fresh.width;
        std::size_t k = 0;
        for (std::size_t i = 0; i < fresh.size(); ++i) {
            const double said = gate.cleared(fresh.row(i).data());
            const bool horizon = training_.kind == GateKind::horizon;
            const double truth = horizon ? fresh.back[i] : fresh.value[i];
            const bool critical = truth <= training_.levels.back();
            if (!critical && !(said >= (horizon ? fresh.event[i] : truth))) continue;
            out.append(fresh.row(i), fresh.event[i], fresh.back[i], fresh.value[i], 0);
            if (++k > training_.states / 4) break;
        }
        add_neighbours(out, random);
        return out;
    }

    /// Compares the declared bounds with the guard along runs of `steps` steps in total.
    /// @throws std::invalid_argument naming a bound that is broken.
    void check_bounds(std::size_t steps, std::uint64_t seed)
    {
        Random random(seed);
        const Planned<> planned({.longest_interval = 16, .check_bounds = true});
        begin_stage("checking bounds", 0);
        for (std::size_t done = 0; done < steps && goes_on(0);) {
            const Exact exact = start(random);
            Simulation<System, X, Stepping, Planned<>> run(*system_, exact.x(), options_used_,
                                                           Stepping{}, planned);
            while (run.advance() && goes_on(0)) {
            }
            const Run<X> followed = run.finish();
            done += static_cast<std::size_t>(followed.statistics.steps) + 1;
            if (const auto& wrong = followed.wrong_bound) {
                detail::throw_wrong_bound(wrong->guard, wrong->since, wrong->value_then, wrong->t,
                                          wrong->value, wrong->allowed);
            }
        }
    }

    /// Runs the exact detector and the gated one side by side, until `events` events are found.
    template <class Detector>
    [[nodiscard]] GateTrial compare(const Detector& detector, std::size_t events,
                                    std::uint64_t seed)
    {
        Random random(seed);
        GateTrial trial;
        const double before = detail::processor_seconds();
        begin_stage("testing", events);
        while (trial.events < events && trial.steps < training_.most_steps &&
               goes_on(trial.events)) {
            Exact exact = start(random);
            detail::SideBySide<System, X, Stepping, Detector> runs(*system_, detector,
                                                                   std::move(exact), options_used_);
            compare(runs, events, trial);
        }
        trial.seconds = detail::processor_seconds() - before;
        return trial;
    }

    /// Finds the first events of `events` runs with every other method of detection, and with the
    /// detector last.
    template <class Detector>
    [[nodiscard]] std::vector<Rival> rivals(const Detector& detector, std::size_t events,
                                            std::uint64_t seed)
    {
        Random random(seed);
        detail::RivalRuns<System, X, Stepping, Detector> runs(*system_, detector);
        begin_stage("comparing", events);
        std::uint64_t rounds = 0;
        while (runs.events() < events && rounds++ < 2 * events && goes_on(runs.events())) {
            const X x0 = start(random).x();
            runs.add_flight(x0, options_used_);
        }
        return runs.rivals();
    }

private:
    /// A state of a run, until its future is known.
    struct Pending {
        double t;
        X x;
        Mode mode;
        std::array<double, GateRecipe::most> features;
        double value;
        bool asked;  ///< a run with the gate asks it here
    };

    /// Where states are kept, and how many of those without an event in reach.
    struct Sampling {
        GateSamples& out;
        double share;  ///< of the states, in [0, 1]; 0: none of any kind
        Random& random;
    };

    /// Sets what is reported to the callback about the runs to come.
    void begin_stage(std::string_view stage, std::size_t events)
    {
        stage_ = stage;
        wanted_ = events;
    }

    /// Asks the callback, at every 64th call. False: the runs must stop.
    [[nodiscard]] bool goes_on(std::uint64_t events)
    {
        if (!progress_ || stopped_ || ++asked_ % 64 != 1) return !stopped_;
        const auto done = static_cast<std::size_t>(events);
        const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - started_;
        stopped_ = !progress_({.iteration = std::min(done, wanted_),
                               .total = wanted_,
                               .loss = std::numeric_limits<double>::quiet_NaN(),
                               .misses = 0,
                               .seconds = spent.count(),
                               .stage = stage_});
        return !stopped_;
    }

    [[nodiscard]] Exact start(Random& random)
    {
        std::string why = "no start was dealt out";
        for (int attempt = 0; attempt < 1000; ++attempt) {
            const RunStart<X> from = starts_(random);
            options_used_ = options_;
            options_used_.t_start = from.t;
            options_used_.t_end = from.t + training_.run_length;
            options_used_.mode = from.mode;
            if (fixed_step)
                options_used_.step = random.log_uniform(training_.step_min, training_.step_max);
            try {
                width_ = feature_count(training_.recipe, *system_, from.x);
                if (width_ == 0 || width_ > GateRecipe::most) {
                    detail::throw_no_features(to_string(training_.recipe),
                                              static_cast<std::size_t>(from.x.size()));
                }
                return Exact(*system_, from.x, options_used_);
            } catch (const std::invalid_argument& error) {
                why = error.what();
            }
        }
        detail::throw_no_start(why);
    }

    [[nodiscard]] double reach() const noexcept
    {
        return training_.kind == GateKind::horizon ? training_.levels.back() : 0;
    }

    /// Advances a run to its end and keeps its states.
    void follow(Exact& run, const Sampling& to)
    {
        GateSamples& out = to.out;
        out.width = width_;
        pending_.clear();
        take_off(run);
        std::size_t seen = run.run().events.size();
        while (!run.ended() && goes_on(out.events)) {
            remember(run, out);
            if (!run.step()) break;
            ++out.steps;
            ++steps_since_event_;
            const auto& events = run.run().events;
            for (; seen < events.size(); ++seen) {
                if (events[seen].kind == EventKind::touch || events[seen].kind == EventKind::time) {
                    continue;
                }
                ++out.events;
                settle(events[seen], to);
                take_off(run);
            }
            while (!pending_.empty() && run.t() - pending_.front().t > reach()) {
                keep(pending_.front(), infinity, infinity, to);
                pending_.pop_front();
            }
        }
        pending_.clear();
        guard_calls_ += run.run().statistics.guard_calls;
    }

    /// Begins a flight from the start or an event to the next one.
    void take_off(const Exact& run)
    {
        left_ = run.t();
        steps_since_event_ = 0;
    }

    void remember(const Exact& run, GateSamples& out)
    {
        Pending state{run.t(), run.x(), run.mode(), {}, 0, false};
        training_.recipe.write(*system_, state.mode, state.t, state.x, state.features.data());
        out.visit({state.features.data(), width_});
        if (walks_ != nullptr) state.asked = walks_->visit(state.t, state.features.data());
        if (training_.kind == GateKind::level) {
            state.value = ricochet::detail::call_guard(*system_, 0, state.mode, state.t, state.x);
        }
        pending_.push_back(std::move(state));
    }

    /// Labels the states that led to an event with it.
    template <class E>
    void settle(const E& event, const Sampling& to)
    {
        if (pending_.empty()) return;
        const double back = training_.kind == GateKind::horizon ? time_of_return(event) : infinity;
        if (walks_ != nullptr) walks_->meet(event.t, back);
        if (survey_ != nullptr) {
            const double step =
                fixed_step ? options_used_.step
                           : (event.t - left_) / static_cast<double>(1 + steps_since_event_);
            survey_->step = step;
            survey_->intervals.push_back((event.t - left_) / step);
            survey_->dwells.push_back(std::min(back - event.t, reach()) / step);
        }
        const bool fatal = back - event.t <= reach();
        for (const Pending& state : pending_) {
            if (state.t > event.t) break;
            const bool chosen = to.random.chance(fatal ? 0.25 : 0.005);
            if (chosen && near_.size() < training_.states) {
                near_.push_back({.t = state.t, .x = state.x, .mode = state.mode});
            }
            keep(state, event.t - state.t, back - state.t, to);
        }
        pending_.clear();
    }

    void keep(const Pending& state, double event, double back, const Sampling& to)
    {
        if (to.share <= 0) return;
        if (training_.logarithmic) {
            keep_by_logarithm(state, event, back, to);
            return;
        }
        const bool near = training_.kind == GateKind::horizon
                              ? event <= 2 * reach()
                              : state.value <= training_.levels.back();
        const double kept = near ? std::max(to.share, std::min(1.0, 4 * to.share)) : to.share;
        const bool fatal = back <= reach();
        if (!fatal && !to.random.chance(kept)) return;
        to.out.append({state.features.data(), width_}, event, back, state.value,
                      fatal ? 1 : 1 / kept);
    }

    /// Keeps a state with a probability that falls with the time to its event, but never below the
    /// share of clear states.
    void keep_by_logarithm(const Pending& state, double event, double back, const Sampling& to)
    {
        if (state.asked) {
            to.out.append({state.features.data(), width_}, event, back, state.value, 0);
            return;
        }
        const double shortest = training_.levels.front();
        const double octaves = 1 + std::log2(training_.levels.back() / shortest);
        // Half of the states are drawn from the octaves: `each` from every one of them.
        const double each = 0.5 * static_cast<double>(training_.states) /
                            (static_cast<double>(training_.events) * octaves);
        const double near = std::min(1.0, each * shortest / std::max(event, shortest));
        const double kept = std::max(near, std::min(1.0, 0.5 * to.share));
        if (!to.random.chance(kept)) return;
        to.out.append({state.features.data(), width_}, event, back, state.value, 1 / kept);
    }

    /// Time [s] at which the guard of an event is first seen on its side again.
    template <class E>
    [[nodiscard]] double time_of_return(const E& event)
    {
        using detail::Labelling;
        const Pending& from = pending_.back();
        Labelling how{.options = options_used_, .reach = reach()};
        how.options.t_start = from.t;
        const double back =
            detail::time_of_return<System, X, Stepping>(*system_, event, from.x, how);
        guard_calls_ += how.calls;
        return back;
    }

    /// Adds short runs from states that differ a little from those in `out`: the gate must be right
    /// beyond the states that the runs happen to meet.
    void add_neighbours(GateSamples& out, Random& random)
    {
        if (near_.empty() || training_.neighbours == 0) return;
        const std::size_t wanted = std::min(near_.size(), training_.states / 8);
        for (std::size_t n = 0; n < wanted * training_.neighbours; ++n) {
            if (!goes_on(wanted_)) return;
            const RunStart<X>& from = near_[random.below(near_.size())];
            RunStart<X> moved = from;
            const double size = random.log_uniform(1e-4, 3e-2);
            for (std::size_t i = 0; i < static_cast<std::size_t>(moved.x.size()); ++i) {
                moved.x[i] += size * (1 + std::fabs(moved.x[i])) * random.uniform(-1, 1);
            }
            follow_shortly(moved, out, random);
        }
    }

    void follow_shortly(const RunStart<X>& from, GateSamples& out, Random& random)
    {
        Options options = options_;
        options.t_start = from.t;
        options.mode = from.mode;
        if (fixed_step) options.step = random.log_uniform(training_.step_min, training_.step_max);
        options.t_end = from.t + 2 * reach() + 2 * options.step;
        options_used_ = options;
        try {
            Exact run(*system_, from.x, options);
            pending_.clear();
            remember_only(run);
            while (run.run().events.empty() && run.step()) {
            }
            if (run.run().events.empty()) return;
            const auto& event = run.run().events.front();
            if (!changes_sign(event.kind) || !(event.t > from.t)) return;
            const double back = time_of_return(event);
            const Pending& state = pending_.front();
            out.append({state.features.data(), width_}, event.t - state.t, back - state.t,
                       state.value, 0);
        } catch (const std::invalid_argument&) {
            // A system may refuse the start.
        }
    }

    void remember_only(const Exact& run)
    {
        GateSamples nowhere;
        remember(run, nowhere);
    }

    /// Follows both runs to their end, from the exact one wherever they differ.
    template <class Runs>
    void compare(Runs& runs, std::size_t events, GateTrial& trial)
    {
        for (;;) {
            const detail::Agreement next = runs.take_next_event(
                [&](std::uint64_t seen) { return goes_on(trial.events + seen); });
            if (stopped_) return;
            const bool ended = runs.exact().ended();
            const double t = runs.exact().t();
            const X x = runs.exact().x();
            const Mode mode = runs.exact().mode();
            if (next == detail::Agreement::to_the_bit && !ended) continue;
            runs.finish(trial);
            trial.misses += next == detail::Agreement::none ? 1 : 0;
            if (ended || trial.events >= events || !(runs.options().t_end > t)) return;
            if (!runs.restart(t, mode, x)) return;
        }
    }

    const System* system_;
    Starts<X> starts_;
    Options options_;
    Options options_used_;
    GateTraining training_;
    std::size_t width_ = 0;
    std::deque<Pending> pending_;
    std::vector<RunStart<X>> near_;       ///< states shortly before fatal events
    detail::GateWalks* walks_ = nullptr;  ///< of a gate along the exact runs; null: none
    GateSurvey* survey_ = nullptr;        ///< of the present runs; null: none
    double left_ = 0;                     ///< [s] start of the present flight
    std::uint64_t steps_since_event_ = 0;
    std::uint64_t guard_calls_ = 0;
    ProgressCallback progress_;
    std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
    std::string_view stage_;
    std::size_t wanted_ = 0;  ///< events of this stage
    std::uint64_t asked_ = 0;
    bool stopped_ = false;
};

}  // namespace ricochet::learn
