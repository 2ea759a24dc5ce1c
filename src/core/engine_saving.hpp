// What is forgotten, kept and put back of the events of a run.
#pragma once

#include "core/engine.hpp"

namespace ricochet::detail {

template <class X, bool single>
void EventEngine<X, single>::forget_run()
{
    reopen();
    stops_ = on_change_ = replans_ = false;
    ends_at_ = {};
    forget_cause();
    holds_.forget();
    time_events_.forget();
    guards_.forget();
    if (search_) search_->fired().clear();
    pending_ = Pending::nothing;
    sets_.begin_instant();
    if (!defers_) return;
    planner_->steps().clear();
    planner_->forget_wrong();
}

template <class X, bool single>
void EventEngine<X, single>::go_on_from(const StepStart<X>& place)
{
    holds_.resume();
    step_.restart(place);
    watching_ = on_change_ = replans_ = false;
    ends_at_ = {};
    time_events_.forget_here();
    pending_ = Pending::nothing;
    if (guarded_) search_->begin(step_.x0());
    if (defers_) planner_->restore(guards_);
}

template <class X, bool single>
void EventEngine<X, single>::keep(Checkpoint& at) const
{
    if (defers_) {
        step_.store_as_kept(at.start);
    } else {
        step_.store(at.start);
    }
    at.guards = guards_;
    at.last_h = last_h_;
    at.time_event = time_event();
    at.watching = watching_;
    at.holds = holds_.keep();
}

template <class X, bool single>
void EventEngine<X, single>::put_back(const Checkpoint& at)
{
    step_.restart(at.start);
    guards_ = at.guards;
    last_h_ = at.last_h;
    time_events_.put_back(at.time_event);
    watching_ = at.watching;
    holds_.put_back(at.holds);
}

template <class X, bool single>
void EventEngine<X, single>::forget_exception(bool newly_armed, bool planned)
{
    if (planned) {
        replans_ = true;
        watching_ = false;
    }
    reopen();
    forget_cause();
    newly_armed_ = newly_armed;
    pending_ = Pending::nothing;
    on_change_ = false;
    ends_at_ = {};
    time_events_.forget_here();
    if (!guarded_) return;
    search_->fired().clear();
    search_->begin(step_.x0());
}

}  // namespace ricochet::detail
