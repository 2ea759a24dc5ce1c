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
    const auto recorded = static_cast<std::ptrdiff_t>(run_.events.size());
    const Statistics counted = run_.statistics;
    Snapshot old;
    visit_state(SnapshotWriter(old));
    std::vector<MotionPhase> phases = run_.phases;
    try {
        this->who_ = "restart";
        start_at(t, x, mode);
        this->who_ = "integrate";
    } catch (...) {
        this->who_ = "integrate";
        visit_state(SnapshotReader(old));
        run_.events.erase(run_.events.begin() + recorded, run_.events.end());
        run_.statistics = counted;
        run_.phases = std::move(phases);
        go_on_from_place();
        throw;
    }
    show_from_restart(t, recorded, run_.statistics.events - counted.events);
    record_restart();
}

template <class X, bool single>
void Loop<X, single>::show_from_restart(double t, std::ptrdiff_t recorded, std::uint64_t count)
{
    auto& events = run_.events;
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
    ended_ = this->stops_ = replans_ = false;
    this->forget_holds();
    run_.outcome = Outcome::reached_end;
    this->forget_cause();
    pending_ = Engine::Pending::nothing;
    search_.fired().clear();
    if (defers_) {
        planner_->steps().clear();
        planner_->forget_wrong();
    }
    change_due_ = on_change_ = false;
    if (phases_) {
        X start = x;
        mode = phases_->enter(phases_->adapter, mode, t, start);
        step_.restart(Instant{t, 0}, start, mode);
    } else {
        step_.restart(Instant{t, 0}, x, mode);
    }
    if (!step_.flow_fits()) throw_flow_does_not_fit("restart", static_cast<std::size_t>(x.size()));
    if (error_controlled_ && options_.step == 0) {
        h_next_ = initial_step(step_, options_, step_.until(options_.t_end));
    } else {
        h_next_ = options_.step;
    }
    if (error_controlled_) h_next_ = std::min(h_next_, options_.h_max);
    first_step_ = h_next_;
    flight_start_ = t;
    longest_step_ = 0;
    careful_steps_ = 0;
    next_review_ = 0;
    time_events_.forget();
    if (timed_) this->find_time_event(Engine::After::restart);
    guards_.forget();
    if (guarded_) {
        search_.begin(step_.x0());
        this->arm_at_start(false);
    }
    if (guarded_ || timed_) this->settle_all();
    if (phases_) review_phase(false);
}

template <class X, bool single>
void Loop<X, single>::drop_from(double t)
{
    auto& events = run_.events;
    while (!events.empty() && lies_before(t, events.back().t)) {
        const Event<X>& event = events.back();
        --run_.statistics.events;
        const bool fired = event.kind != EventKind::accumulation && event.kind != EventKind::mode;
        if (event.guard != no_guard && fired) {
            --guards_[event.guard].events;
        }
        events.pop_back();
    }
    auto& samples = run_.trajectory;
    const auto& times = options_.sample_times;
    while (next_sample_ > 0 && lies_before(t, times[next_sample_ - 1])) --next_sample_;
    while (!samples.t.empty() && lies_before(t, samples.t.back())) {
        samples.t.pop_back();
        samples.x.pop_back();
        if (!run_.reactions.empty()) run_.reactions.pop_back();
    }
    while (next_sample_ < times.size() && lies_before(times[next_sample_], t)) ++next_sample_;
    run_.solution.cut(t);
}

template <class X, bool single>
void Loop<X, single>::refuse_bad_restart(double t, const X& x, Mode mode) const
{
    if (over_) throw_run_is_over("restart");
    const bool inside = !lies_before(t, options_.t_start) && lies_before(t, options_.t_end);
    if (!std::isfinite(t) || !inside) {
        throw_restart_outside(t, options_.t_start, options_.t_end);
    }
    if (x.size() == 0) throw_start_empty("restart");
    if (!system_.fits_dimension(step_.x0(), x, mode == step_.mode()) ||
        (system_->fixed_dimension && x.size() != step_.x0().size())) {
        throw_restart_does_not_fit(static_cast<std::size_t>(step_.x0().size()),
                                   static_cast<std::size_t>(x.size()));
    }
    for_each_component(x, [&](auto i) {
        if (!std::isfinite(x[i])) {
            throw_start_not_finite("restart", static_cast<std::size_t>(i), x[i]);
        }
    });
    const std::size_t modes = this->modes();
    if (modes > 0 && mode >= modes) throw_unknown_mode("restart", mode, modes);
}

template <class X, bool single>
void Loop<X, single>::extend(double t_end)
{
    if (over_) throw_run_is_over("extend");
    const double now = step_.start().value;
    const bool ahead = backward_ ? t_end < now : t_end > now;
    if (std::isnan(t_end) || !ahead) throw_end_not_ahead(now, t_end);
    const bool is_endless = std::isinf(t_end);
    if (is_endless && !this->may_end()) throw_endless(t_end);
    if (is_tentative()) take_back();
    endless_ = is_endless;
    options_.t_end = endless_ ? std::copysign(std::numeric_limits<double>::max(), t_end) : t_end;
    (backward_ ? this->span_.from : this->span_.to) = options_.t_end;
    step_.renew_span();
    place_ = step_.place();
    if (!(h_next_ > 0)) {  // the run had no length
        h_next_ = initial_step(step_, options_, step_.until(options_.t_end));
        first_step_ = h_next_ = std::min(h_next_, options_.h_max);
    }
    reopen();
    next_review_ = 0;
}

}  // namespace ricochet::detail
