// Converts settings to the integrators of mechanical systems with contacts. Included once per
// system.
#pragma once

#include <chrono>
#include <utility>
#include <vector>

#include "../input.hpp"
#include "../registry.hpp"
#include "ricochet/nonsmooth/contact_motion.hpp"
#include "set_valued_options.hpp"

namespace ricochet::app {

namespace detail {

[[nodiscard]] inline SetValuedSteps shown(const TimeSteppingStatistics& s)
{
    SetValuedSteps out;
    out.attempted = s.steps + s.unsolved;
    out.accepted = s.steps;
    out.unsolved = s.unsolved;
    out.solves = s.problems;
    out.iterations = s.iterations + s.sweeps;
    return out;
}

template <class X>
[[nodiscard]] std::vector<double> as_vector(const X& x)
{
    return {x.begin(), x.end()};
}

}  // namespace detail

template <class System, class Vector>
[[nodiscard]] TimedRun fly_and_touch(const System& system, const Vector& q, const Vector& v,
                                     const RunSettings& settings)
{
    const Options& o = settings.options;
    HandOverOptions options = hand_over_options(o);
    options.set_valued.step = settings.set_valued->step;
    const auto run = hand_over(system, q, v, options);
    TimedRun out;
    out.run.outcome = run.outcome;
    out.run.t = run.t;
    out.run.x = detail::as_vector(run.x);
    for (const auto& event : run.events) {
        Event<std::vector<double>> impact;
        impact.t = event.t;
        impact.kind = event.kind;
        impact.guard = event.guard;
        impact.before = detail::as_vector(event.before);
        impact.after = detail::as_vector(event.after);
        impact.bracket = event.bracket;
        impact.slope = event.slope;
        impact.error = event.error;
        out.run.events.push_back(std::move(impact));
    }
    out.run.trajectory.t = run.trajectory.t;
    for (const auto& x : run.trajectory.x) {
        out.run.trajectory.x.push_back(detail::as_vector(x));
    }
    out.run.statistics = run.statistics.event_driven;
    out.run.statistics.events = run.events.size();
    if (run.statistics.to_contact > 0) out.steps = detail::shown(run.statistics.time_stepping);
    for (const MotionPhase& phase : run.phases) {
        out.phases.push_back({phase.from, phase.set_valued, name(phase.cause)});
    }
    return out;
}

/// Events are the steps in which a contact closes.
template <class System, class Vector>
[[nodiscard]] TimedRun step_in_time(const System& system, const Vector& q, const Vector& v,
                                    const RunSettings& settings)
{
    using Flight = ricochet::detail::FreeFlight<System>;
    const Options& o = settings.options;
    TimeStepping<System> motion(
        system, q, v, {.t_start = o.t_start, .t_end = o.t_end, .step = settings.set_valued->step});
    TimedRun out;
    double t = o.t_start;
    auto x = Flight::state(q, v);
    auto impulse = motion.state().impulse;
    std::size_t next = 0;
    const auto look = [&](const auto& now) {
        const auto after = Flight::state(now.q, now.v);
        for (; next < o.sample_times.size() && o.sample_times[next] <= now.t; ++next) {
            const double share = now.t > t ? (o.sample_times[next] - t) / (now.t - t) : 1;
            std::vector<double> between;
            for (std::size_t i = 0; i < x.size(); ++i) {
                between.push_back(x[i] + share * (after[i] - x[i]));
            }
            out.run.trajectory.t.push_back(o.sample_times[next]);
            out.run.trajectory.x.push_back(std::move(between));
        }
        for (Eigen::Index c = 0; c < Flight::C; ++c) {
            const Eigen::Index normal = c * Flight::D;
            if (!(now.impulse[normal] > 0) || impulse[normal] > 0) continue;
            Event<std::vector<double>> impact;
            impact.t = now.t;
            impact.guard = static_cast<std::size_t>(c);
            impact.before = detail::as_vector(x);
            impact.after = detail::as_vector(after);
            impact.bracket = {t, now.t};
            impact.slope = std::numeric_limits<double>::quiet_NaN();
            impact.error = now.t - t;
            out.run.events.push_back(std::move(impact));
        }
        t = now.t;
        x = after;
        impulse = now.impulse;
    };
    look(motion.state());
    auto outcome = Outcome::running;
    while (outcome == Outcome::running && !o.cancelled->load(std::memory_order_relaxed)) {
        outcome = motion.statistics().steps < o.max_steps ? motion.advance() : Outcome::step_limit;
        if (outcome != Outcome::not_converged) look(motion.state());
    }
    out.run.outcome = outcome == Outcome::running ? Outcome::cancelled : outcome;
    out.run.t = t;
    out.run.x = detail::as_vector(x);
    out.run.statistics.events = out.run.events.size();
    out.steps = detail::shown(motion.statistics());
    return out;
}

template <class System, class Vector>
[[nodiscard]] TimedRun run_contact(const System& system, Vector q, Vector v,
                                   const RunSettings& settings, int repeats)
{
    if (settings.stepper == MethodName::fehlberg78) {
        throw BadInput("--stepper of this system can only be dopri5");
    }
    for (std::size_t i = 0; i < settings.start.size(); ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        (k < q.size() ? q[k] : v[k - q.size()]) = settings.start[i];
    }
    TimedRun out;
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < repeats; ++i) {
        out = settings.set_valued->integrator == "handover" ? fly_and_touch(system, q, v, settings)
                                                            : step_in_time(system, q, v, settings);
    }
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    out.seconds = spent.count() / repeats;
    return out;
}

}  // namespace ricochet::app
