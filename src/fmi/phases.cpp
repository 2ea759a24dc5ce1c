// Model exchange: a run of its own from each event mode to the next, which assumes nothing of the
// one before. At an event anything may change: the states, the flow, what indicators mean, the time
// of the next time event, the nominal values.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "fmi/parts.hpp"
#include "ricochet/rosenbrock.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::fmi {

namespace {

// Bouncing to rest or chattering: a ball with restitution 0.9 has 350 impacts until its flights are
// below the rounding of the time.
constexpr std::size_t most_events_without_progress = 1000;
constexpr double progress = 1e-9;  // as a fraction of the span
// Jacobians are dense: beyond, a step of rosenbrock4 costs more than it saves.
constexpr std::size_t most_states_of_rosenbrock = 50;
constexpr std::size_t most_reviews = 20;
// Of directional derivatives, as a fraction of the largest entry of the row: forward differences of
// smooth functions are right to 1e-7, and wrong derivatives are wrong in the first digit.
constexpr double derivative_tolerance = 1e-3;

}  // namespace

Phases::Phases(const Fmu& fmu, const Options& given)
    : Parts(fmu, given, Kind::model_exchange), phase_(instance, inputs)
{
    x.assign(std::max<std::size_t>(instance.states(), 1), 0);
    rate_ = x;
    sides_.resize(instance.indicators());
    z_ = sides_;
    initialize();
    progress_ = t;
    try {
        info_ = instance.iterate();
        if (info_.terminate) {
            end(End::terminated);
            return;
        }
        instance.enter_continuous_time_mode();
        read_states();
        read_nominals();
        phase_.start(t, t_end);
        choose_method();
        if (sample_is_due(t, true)) {
            if (phase_.at(t, x)) record(Row::Place::sample);
            skip_samples(t);
        }
    } catch (const CallError& error) {
        throw Error(fmt::format("{} at the start", error.what()));
    }
    if (t == t_end) end(End::reached_end);
}

void Phases::read_states()
{
    if (instance.states() > 0) instance.read_states(x);
    show_state();
}

void Phases::show_state()
{
    run.t = t;
    run.x.assign(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(instance.states()));
}

void Phases::read_nominals()
{
    phase_.nominals.assign(x.size(), 1);
    if (instance.states() == 0) return;
    instance.read_nominals(phase_.nominals);
    for (std::size_t i = 0; i < instance.states(); ++i) {
        double& nominal = phase_.nominals[i];
        if (nominal > 0 && std::isfinite(nominal)) continue;
        if (!warned_) {
            run.warnings.push_back(
                fmt::format("the nominal value of '{}' is {}; its size is taken, or 1",
                            instance.description().state_names()[i], nominal));
        }
        warned_ = true;
        nominal = nominal < 0 && std::isfinite(nominal) ? -nominal : 1;
    }
}

// --- methods ---

void Phases::choose_method()
{
    run.method = options.method;
    const bool offered = instance.interface().directional_derivatives && instance.states() > 0;
    const bool wanted =
        options.method == Method::rosenbrock4 ||
        (options.method == Method::automatic && instance.states() <= most_states_of_rosenbrock);
    phase_.by_differences = !(offered && wanted && derivatives_agree());
    if (options.method == Method::automatic) {
        run.method = phase_.by_differences ? Method::dopri5 : Method::rosenbrock4;
    }
}

bool Phases::derivatives_agree()
{
    const std::size_t n = x.size();
    std::vector<double> given(n * n), expected(n * n);
    if (!phase_.by_derivatives(t, x, given)) return true;
    phase_.differences(t, x, expected);
    const auto& nominals = phase_.nominals;
    for (std::size_t i = 0; i < n; ++i) {
        double largest = 0;
        for (std::size_t j = 0; j < n; ++j) {
            largest = std::max(largest, std::fabs(expected[i * n + j]) * nominals[j]);
        }
        for (std::size_t j = 0; j < n; ++j) {
            const double off = std::fabs(given[i * n + j] - expected[i * n + j]) * nominals[j];
            if (!(off > derivative_tolerance * largest)) continue;  // NaN: no answer there
            const auto names = instance.description().state_names();
            run.warnings.push_back(fmt::format(
                "the derivative of '{}' by '{}' is {:.6g}, by differences {:.6g}; differences are "
                "used",
                fmt::format("der({})", names[i]), names[j], given[i * n + j], expected[i * n + j]));
            return false;
        }
    }
    return true;
}

/// Derivatives are compared again after steps 1, 2, 4, ..., 64 of a phase, until they have been
/// often enough.
void Phases::review_derivatives(std::uint64_t step)
{
    if (phase_.by_differences || reviews_ == most_reviews) return;
    if ((step & (step - 1)) != 0 || step > 64) return;
    ++reviews_;
    phase_.by_differences = !derivatives_agree();
}

ricochet::Options Phases::options_of_phase(double until) const
{
    ricochet::Options o;
    o.t_start = t;
    o.t_end = until;
    o.rtol = options.rtol;
    o.component_atol = phase_.nominals;
    for (double& tolerance : o.component_atol) tolerance *= options.rtol;
    o.h_max = options.h_max;
    o.max_steps = options.max_steps - std::min(options.max_steps, run.steps);
    o.stop_at_event = true;
    o.cancelled = options.cancelled;
    const auto& samples = options.sample_times;
    const auto first = samples.begin() + static_cast<std::ptrdiff_t>(next_sample);
    o.sample_times.assign(first, std::lower_bound(first, samples.end(), until));
    return o;
}

Causes Phases::move(double until, std::size_t& indicator)
{
    switch (run.method) {
        case Method::rosenbrock4: return move_by(ErrorControlled<Rosenbrock4>{}, until, indicator);
        case Method::fehlberg78:
            return move_by(ErrorControlled<MethodByName>{{MethodName::fehlberg78}}, until,
                           indicator);
        default:
            return move_by(ErrorControlled<MethodByName>{{MethodName::dopri5}}, until, indicator);
    }
}

void Phases::take_samples(const Trajectory<std::vector<double>>& samples, std::size_t& taken,
                          double end)
{
    for (; taken < samples.t.size() && samples.t[taken] < end; ++taken) {
        ++next_sample;
        t = samples.t[taken];
        if (phase_.at(t, samples.x[taken])) record(Row::Place::sample);
    }
    t = end;
}

template <class Stepping>
Causes Phases::move_by(Stepping stepping, double until, std::size_t& indicator)
{
    ricochet::Simulation running(phase_, x, options_of_phase(until), stepping);
    Causes causes;
    bool terminate = false;
    std::size_t taken = 0;
    const auto take_over = [&] {
        t = running.t();
        x = running.x();
    };
    try {
        while (!causes.any() && !terminate && !running.ended()) {
            running.step();
            const auto& so_far = running.run();
            causes.state = running.ended() && so_far.outcome == Outcome::stopped_by_event;
            if (causes.state) indicator = so_far.guard;
            take_samples(so_far.trajectory, taken, running.t());
            take_over();
            review_derivatives(so_far.statistics.steps);
            if (causes.state || !instance.interface().needs_completed_step) continue;
            if (phase_.at(t, x)) causes.step = instance.completed_step(terminate);
        }
    } catch (const CallError&) {
        take_over();
        throw;
    }
    const auto result = running.finish();
    take_samples(result.trajectory, taken, t);
    run.steps += result.statistics.steps;
    run.rejected += result.statistics.rejected;
    run.integration = causes.any() || terminate ? Outcome::reached_end : result.outcome;
    if (terminate) end(End::terminated);
    return causes;
}

// --- events ---

void Phases::go_to_far_side(std::size_t indicator)
{
    const auto changed = [&](double at, const std::vector<double>& state) {
        return !phase_.at(at, state) || !instance.indicator_values(z_) ||
               (z_[indicator] > 0) != (sides_[indicator] > 0);
    };
    if (changed(t, x)) return;
    phase_.flow(t, x, rate_);
    const double ulp = std::nextafter(std::fabs(t), HUGE_VAL) - std::fabs(t);
    std::vector<double> there = x;
    // The first length is below the rounding of any state; the last is what a double cannot hide.
    for (double ulps = 0x1p-60; ulps <= 0x1p20; ulps *= 2) {
        const double s = ulps * ulp;
        for (std::size_t i = 0; i < instance.states(); ++i) there[i] = x[i] + s * rate_[i];
        if (!changed(t + s, there)) continue;
        t += s;
        x = there;
        return;
    }
}

template <class Set>
void Phases::handle(const Causes& causes, std::size_t indicator, const Set& set)
{
    Event event{.t = t, .causes = causes, .indicator = indicator, .before = run.x, .after = {}};
    if (causes.state) go_to_far_side(indicator);
    event.t = t;
    (void)phase_.at(t, x);
    record(Row::Place::before_event);
    bool terminate = false;
    if (!causes.step && instance.interface().needs_completed_step) {
        (void)instance.completed_step(terminate);
    }
    instance.enter_event_mode();
    inputs.set_all(instance, t);
    set();
    info_ = instance.iterate();
    if (info_.terminate || terminate) {
        if (info_.states_changed) read_states();
        record(Row::Place::after_event);
        end(End::terminated);
    } else {
        instance.enter_continuous_time_mode();
        if (info_.states_changed) read_states();
        if (info_.nominals_changed) read_nominals();
        phase_.start(t, t_end);
        record(Row::Place::after_event);
    }
    skip_samples(t);
    show_state();
    event.after = run.x;
    run.events.push_back(std::move(event));
}

bool Phases::is_stuck(std::size_t indicator)
{
    const double span = t_end - t_start;
    if (t - progress_ > progress * span) {
        progress_ = t;
        events_without_progress_ = 0;
    }
    if (++events_without_progress_ <= most_events_without_progress) return false;
    run.indicator = indicator;
    const std::string by = indicator == no_indicator
                               ? "time events"
                               : instance.description().indicator_name(indicator);
    end(End::chattering,
        fmt::format("{} events of {} have not advanced the time beyond t = {} s: the model needs "
                    "a rule for where it comes to rest, or slides",
                    events_without_progress_, by, t));
    return true;
}

void Phases::advance()
{
    const double until = std::min({t_end, info_.next_time, inputs.next_break(t)});
    phase_.start(t, until);
    std::size_t indicator = no_indicator;
    Causes causes;
    if (until > t) {
        if (run.steps >= options.max_steps) run.integration = Outcome::step_limit;
        if (!sides_.empty() && !(phase_.at(t, x) && instance.indicator_values(sides_))) {
            run.integration = Outcome::non_finite;
        }
        if (run.integration == Outcome::reached_end) causes = move(until, indicator);
        show_state();
        if (ended) return;
        if (run.integration != Outcome::reached_end) {
            return end(End::not_integrated, std::string(ricochet::describe(run.integration)));
        }
        causes.input = inputs.jumps_at(t);
    }
    causes.time = t >= info_.next_time;
    if (causes.any()) {
        handle(causes, indicator, [] {});
        if (!ended && is_stuck(indicator)) return;
    } else if (sample_is_due(t, true)) {
        if (phase_.at(t, x)) record(Row::Place::sample);
        skip_samples(t);
    }
    if (!ended && t >= t_end) end(End::reached_end);
}

std::function<void()> Phases::keep()
{
    return [this, phase = phase_, info = info_, reviews = reviews_, progress = progress_,
            events = events_without_progress_] {
        phase_ = phase;
        phase_.start(t, t_end);
        info_ = info;
        reviews_ = reviews;
        progress_ = progress;
        events_without_progress_ = events;
    };
}

void Phases::answer(const Element& element, double value)
{
    phase_.start(t, t_end);
    (void)phase_.at(t, x);
    handle({.input = true}, no_indicator, [&] { instance.set(element, value); });
}

}  // namespace ricochet::fmi
