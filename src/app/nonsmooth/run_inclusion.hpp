// Converts settings to the integrators of inclusions. Included once per system.
#pragma once

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "../input.hpp"
#include "../registry.hpp"
#include "set_valued_options.hpp"

namespace ricochet::app {

template <class V>
[[nodiscard]] std::vector<double> plain(const V& v)
{
    std::vector<double> out;
    for (std::size_t i = 0; i < static_cast<std::size_t>(v.size()); ++i) {
        out.push_back(v[static_cast<decltype(v.size())>(i)]);
    }
    return out;
}

/// Modes are those of `BranchModes`, and one for set-valued steps; without branches there is
/// only that one.
template <class System>
[[nodiscard]] Mode shown_mode(Mode mode)
{
    if constexpr (Branching<System>) return std::min<Mode>(mode, BranchModes<System>::branch_modes);
    return 0;
}

template <class System, class Branches>
[[nodiscard]] Mode branch_mode([[maybe_unused]] const Branches& branches)
{
    if constexpr (Branching<System>) return BranchModes<System>::mode_of(branches);
    return 0;
}

template <class System, class V>
[[nodiscard]] Event<std::vector<double>> shown(const Event<V>& event)
{
    Event<std::vector<double>> out;
    out.t = event.t;
    out.kind = event.kind;
    out.guard = event.guard;
    out.mode_before = shown_mode<System>(event.mode_before);
    out.mode_after = shown_mode<System>(event.mode_after);
    out.before = plain(event.before);
    out.after = plain(event.after);
    out.bracket = event.bracket;
    out.slope = event.slope;
    out.error = event.error;
    return out;
}

[[nodiscard]] inline SetValuedSteps shown(const SetValuedStatistics& s)
{
    return {.attempted = s.attempted,
            .accepted = s.accepted,
            .rejected = s.rejected,
            .unsolved = s.unsolved,
            .solves = s.stages,
            .iterations = s.iterations,
            .switches = s.switches};
}

/// The steps of `statistics` are those between implicit ones.
template <class System>
[[nodiscard]] TimedRun shown(const Run<StateOf<System>>& run)
{
    TimedRun out;
    out.run.outcome = run.outcome;
    out.run.t = run.t;
    out.run.x = plain(run.x);
    out.run.mode = shown_mode<System>(run.mode);
    for (const auto& event : run.events) out.run.events.push_back(shown<System>(event));
    out.run.trajectory.t = run.trajectory.t;
    for (const auto& w : run.trajectory.x) out.run.trajectory.x.push_back(plain(w));
    out.run.statistics = run.statistics;
    out.run.statistics.steps -= std::min(run.set_valued.accepted, run.statistics.steps);
    out.run.statistics.events = run.events.size();
    for (const MotionPhase& phase : run.phases) {
        if (phase.set_valued) out.steps = shown(run.set_valued);
        out.phases.push_back({phase.from, phase.set_valued, name(phase.cause)});
    }
    return out;
}

template <class System, class Stepping>
[[nodiscard]] TimedRun run_by_hand_over(const System& system, const StateOf<System>& w0,
                                        const RunSettings& settings)
{
    const Options& o = settings.options;
    HandOverOptions options = hand_over_options(o);
    options.events_only = settings.set_valued->integrator == "event";
    options.set_valued.step = settings.set_valued->step;
    return shown<System>(HandOver<System, Stepping>(system, w0, options).take());
}

/// Runs the motion like `motion.run`. @return `running` if it was cancelled
template <class Motion, class Observer>
[[nodiscard]] Outcome run_until_cancelled(const Options& options, Motion& motion,
                                          const Observer& observer)
{
    observer(motion.state());
    for (;;) {
        const Outcome outcome = motion.advance();
        const bool goes_on = outcome == Outcome::running;
        if (goes_on || outcome == Outcome::reached_end) observer(motion.state());
        if (!goes_on) return outcome;
        if (options.cancelled->load(std::memory_order_relaxed)) return Outcome::cancelled;
    }
}

/// Bathe's steps, or backward Euler's; samples lie on straight lines between nodes.
template <class System>
[[nodiscard]] TimedRun run_by_steps(const System& system, const StateOf<System>& w0,
                                    const RunSettings& settings)
{
    SetValuedOptions options = set_valued_options(settings);
    if (measured_by_norm(*settings.set_valued)) {
        options.fields = {
            {.first = 0, .count = w0.size(), .rtol = options.rtol, .floor = w0.norm()}};
    }
    SetValuedMotion<System> motion(system, w0, options);
    TimedRun out;
    const auto& times = settings.options.sample_times;
    std::size_t next = 0;
    using Branches = std::remove_cvref_t<decltype(motion.branches())>;
    const auto branches_at = [&]([[maybe_unused]] const SetValuedState<System>& now) {
        Branches at = motion.branches();
        if constexpr (Branching<System>) motion.stepper().branches_of(now, at);
        return at;
    };
    Branches branches = branches_at(motion.state());
    const auto look = [&](const SetValuedState<System>& now) {
        const auto& before = motion.before();
        for (; next < times.size() && times[next] <= now.t; ++next) {
            const double span = now.t - before.t;
            const double share = span > 0 ? (times[next] - before.t) / span : 1;
            out.run.trajectory.t.push_back(times[next]);
            out.run.trajectory.x.push_back(
                plain(StateOf<System>(before.w + share * (now.w - before.w))));
        }
        const Branches after = branches_at(now);
        for (Eigen::Index i = 0; i < after.size(); ++i) {
            if (after[i] == branches[i]) continue;
            Event<std::vector<double>> event;
            event.t = now.t;
            event.kind = after[i] == Branch::inside      ? EventKind::stick
                         : branches[i] == Branch::inside ? EventKind::slip
                                                         : EventKind::mode;
            event.guard = static_cast<std::size_t>(i);
            event.mode_before = branch_mode<System>(branches);
            event.mode_after = branch_mode<System>(after);
            event.before = event.after = plain(now.w);
            event.bracket = {before.t, now.t};
            event.slope = std::numeric_limits<double>::quiet_NaN();
            event.error = now.t - before.t;
            out.run.events.push_back(std::move(event));
        }
        branches = after;
    };
    out.run.outcome = run_until_cancelled(settings.options, motion, look);
    out.run.t = motion.state().t;
    out.run.x = plain(motion.state().w);
    out.run.mode = branch_mode<System>(branches);
    out.run.statistics.events = out.run.events.size();
    out.steps = shown(motion.statistics());
    return out;
}

/// `Steppers` that the event-driven phases may have besides dopri5: `Fehlberg78` or none.
template <class... Steppers, class System>
[[nodiscard]] TimedRun run_inclusion(const System& system, const StateOf<System>& w0,
                                     const RunSettings& settings, int repeats)
{
    const std::string& integrator = settings.set_valued->integrator;
    const bool steps = integrator == "bathe" || integrator == "time-stepping";
    TimedRun out;
    const StateOf<System> from = chosen_start(w0, settings);
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < repeats; ++i) {
        if (steps) {
            out = run_by_steps(system, from, settings);
        } else if (settings.stepper == MethodName::fehlberg78) {
            if constexpr (sizeof...(Steppers) > 0) {
                out =
                    run_by_hand_over<System, ErrorControlled<Steppers>...>(system, from, settings);
            } else {
                throw BadInput("--stepper of this system can only be dopri5");
            }
        } else {
            out = run_by_hand_over<System, ErrorControlled<Dopri5>>(system, from, settings);
        }
    }
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    out.seconds = spent.count() / repeats;
    return out;
}

}  // namespace ricochet::app
