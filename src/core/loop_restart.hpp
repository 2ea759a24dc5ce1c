// Interventions: a run that goes on from another place, or to another end.
#pragma once

#include <iterator>

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
void Loop<X, single>::restart(double t, const X& x, Mode mode)
{
    refuse_bad_restart(t, x, mode);
    if (is_tentative()) take_back();
    const auto recorded = static_cast<std::ptrdiff_t>(result().events.size());
    const Statistics counted = result().statistics;
    Snapshot old;
    visit_state(SnapshotWriter(old));
    std::vector<MotionPhase> phases = result().phases;
    try {
        engine_.speak_as("restart");
        start_at(t, x, mode);
        engine_.speak_as("integrate");
    } catch (...) {
        engine_.speak_as("integrate");
        visit_state(SnapshotReader(old));
        result().events.erase(result().events.begin() + recorded, result().events.end());
        result().statistics = counted;
        result().phases = std::move(phases);
        go_on_from_place();
        throw;
    }
    show_from_restart(t, recorded, result().statistics.events - counted.events);
    record_restart();
}

template <class X, bool single>
void Loop<X, single>::show_from_restart(double t, std::ptrdiff_t recorded, std::uint64_t count)
{
    auto& events = result().events;
    const auto first = std::make_move_iterator(events.begin() + recorded);
    std::vector<Event<X>> here(first, std::make_move_iterator(events.end()));
    events.erase(events.begin() + recorded, events.end());
    drop_from(t);
    show_all();
    shown_events_ -= count;
    events.insert(events.end(), std::make_move_iterator(here.begin()),
                  std::make_move_iterator(here.end()));
}

template <class X, bool single>
void Loop<X, single>::start_at(double t, const X& x, Mode mode)
{
    engine_.forget_run();
    if (phases_) {
        X start = x;
        mode = phases_->enter(phases_->adapter, mode, t, start);
        now().restart(Instant{t, 0}, start, mode);
    } else {
        now().restart(Instant{t, 0}, x, mode);
    }
    if (!now().flow_fits()) throw_flow_does_not_fit("restart", static_cast<std::size_t>(x.size()));
    if (error_controlled_ && options().step == 0) {
        h_next() = initial_step(now(), options(), now().until(options().t_end));
    } else {
        h_next() = options().step;
    }
    if (error_controlled_) h_next() = std::min(h_next(), options().h_max);
    first_step_ = h_next();
    flight_start_ = t;
    longest_step_ = 0;
    careful_steps_ = 0;
    next_review_ = 0;
    if (timed_) engine_.find_time_event(Engine::After::restart);
    if (guarded_) engine_.arm_at_start(false);
    if (guarded_ || timed_) engine_.settle_all();
    if (phases_) review_phase(false);
}

template <class X, bool single>
void Loop<X, single>::drop_from(double t)
{
    auto& events = result().events;
    while (!events.empty() && lies_before(t, events.back().t)) {
        const Event<X>& event = events.back();
        --result().statistics.events;
        const bool fired = event.kind != EventKind::accumulation && event.kind != EventKind::mode;
        if (event.guard != no_guard && fired) {
            engine_.forget_event(event.guard);
        }
        events.pop_back();
    }
    auto& samples = result().trajectory;
    const auto& times = options().sample_times;
    while (next_sample_ > 0 && lies_before(t, times[next_sample_ - 1])) --next_sample_;
    while (!samples.t.empty() && lies_before(t, samples.t.back())) {
        samples.t.pop_back();
        samples.x.pop_back();
        if (!result().reactions.empty()) result().reactions.pop_back();
    }
    while (next_sample_ < times.size() && lies_before(times[next_sample_], t)) ++next_sample_;
    result().solution.cut(t);
}

template <class X, bool single>
void Loop<X, single>::refuse_bad_restart(double t, const X& x, Mode mode) const
{
    if (over_) throw_run_is_over("restart");
    const bool inside = !lies_before(t, options().t_start) && lies_before(t, options().t_end);
    if (!std::isfinite(t) || !inside) {
        throw_restart_outside(t, options().t_start, options().t_end);
    }
    if (x.size() == 0) throw_start_empty("restart");
    if (!system().fits_dimension(now().x0(), x, mode == now().mode()) ||
        (system()->fixed_dimension && x.size() != now().x0().size())) {
        throw_restart_does_not_fit(static_cast<std::size_t>(now().x0().size()),
                                   static_cast<std::size_t>(x.size()));
    }
    for_each_component(x, [&](auto i) {
        if (!std::isfinite(x[i])) {
            throw_start_not_finite("restart", static_cast<std::size_t>(i), x[i]);
        }
    });
    const std::size_t modes = engine_.modes();
    if (modes > 0 && mode >= modes) throw_unknown_mode("restart", mode, modes);
}

template <class X, bool single>
void Loop<X, single>::extend(double t_end)
{
    if (over_) throw_run_is_over("extend");
    const double here = now().start().value;
    const bool ahead = backward_ ? t_end < here : t_end > here;
    if (std::isnan(t_end) || !ahead) throw_end_not_ahead(here, t_end);
    if (std::isinf(t_end) && !engine_.may_end()) throw_endless(t_end);
    if (is_tentative()) take_back();
    engine_.end_at(t_end);
    place_ = now().place();
    if (!(h_next() > 0)) {  // the run had no length
        h_next() = initial_step(now(), options(), now().until(options().t_end));
        first_step_ = h_next() = std::min(h_next(), options().h_max);
    }
    reopen();
    next_review_ = 0;
}

}  // namespace ricochet::detail
