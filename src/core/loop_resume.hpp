// Return to the start of the current step after an exception from a function of the system.
//
// Until a step is accepted it changes only its own length and its records; where it may hold
// events, or ends at a time event, it changes nearly everything. Therefore length and records are
// kept at every step, and the rest only where a search starts.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
void Loop<X, single>::advance_resumably(const Advance& how)
{
    mark_step();
    if (phases_) mark_phases();
    const std::uint64_t steps = run_.statistics.steps;
    try {
        advance_from_here(how);
        if (phases_) review_phase(run_.statistics.steps != steps);
    } catch (...) {
        go_back_to_mark();
        throw;
    }
}

template <class X, bool single>
bool Loop<X, single>::run_quietly_resumably()
{
    mark_step();
    mark_everything();
    try {
        return run_quietly_from_here();
    } catch (...) {
        go_back_to_mark();
        throw;
    }
}

template <class X, bool single>
inline void Loop<X, single>::mark_step() noexcept
{
    mark_->everything = false;
    mark_->h_next = h_next_;
    if (defers_) {
        mark_->counts = run_.statistics;
    } else {
        mark_->counts.rejected = run_.statistics.rejected;
    }
    mark_->disabled = search_.disabled;
    mark_->events = run_.events.size();
    mark_->samples = run_.trajectory.t.size();
    mark_->pieces = run_.solution.size();
    mark_->next_sample = next_sample_;
    mark_->tentative = defers_ ? planner_->steps().size() : 0;
    mark_->planned = defers_ && !watching_;
    mark_->newly_armed = newly_armed_;
}

/// The phases decide after the step, too, so that everything is kept at its start.
template <class X, bool single>
void Loop<X, single>::mark_phases()
{
    mark_everything();
    phases_->save(phases_->adapter, mark_->phases);
}

template <class X, bool single>
void Loop<X, single>::copy_to_mark()
{
    if (!defers_) {
        const std::uint64_t rejected = mark_->counts.rejected;
        mark_->counts = run_.statistics;
        mark_->counts.rejected = rejected;
    }
    if (defers_) {
        step_.store_as_kept(mark_->start);
    } else {
        step_.store(mark_->start);
    }
    mark_->guards = guards_;
    mark_->flight_start = flight_start_;
    mark_->longest_step = longest_step_;
    mark_->last_h = last_h_;
    mark_->time_event = time_event();
    mark_->holds = holds_.keep();
    mark_->watching = watching_;
    mark_->everything = true;
}

/// Takes back all counts since the mark but those of calls, which have been made.
template <class X, bool single>
void Loop<X, single>::rewind_counts(const Mark& mark, std::uint64_t steps, std::uint64_t rejected)
{
    if (mark.everything || defers_) {
        const Statistics seen = std::exchange(run_.statistics, mark.counts);
        run_.statistics.guard_calls = seen.guard_calls;
        run_.statistics.network_calls = seen.network_calls;
        run_.statistics.bound_calls = seen.bound_calls;
    }
    run_.statistics.rejected = rejected;
    run_.statistics.steps = steps;
    search_.disabled = mark.disabled;
}

/// Puts back what a search for events, or a time event, changes.
template <class X, bool single>
void Loop<X, single>::put_back_everything(const Mark& mark)
{
    step_.restart(mark.start);
    guards_ = mark.guards;
    flight_start_ = mark.flight_start;
    longest_step_ = mark.longest_step;
    last_h_ = mark.last_h;
    time_events_.put_back(mark.time_event);
    holds_.put_back(mark.holds);
    this->heed_holds();
    watching_ = mark.watching;
}

/// Drops what has been recorded since the mark.
template <class X, bool single>
void Loop<X, single>::cut_records(const Mark& mark, std::size_t samples, std::size_t pieces)
{
    run_.events.resize(mark.events);
    run_.trajectory.t.resize(samples);
    run_.trajectory.x.resize(samples);
    if (run_.reactions.size() > samples) run_.reactions.resize(samples);
    run_.solution.shrink(pieces);
    next_sample_ = mark.next_sample;
}

template <class X, bool single>
void Loop<X, single>::go_back_to_mark()
{
    Mark& mark = *mark_;
    std::size_t samples = mark.samples;
    std::size_t pieces = mark.pieces;
    std::uint64_t rejected = mark.counts.rejected;
    std::uint64_t steps = defers_ ? mark.counts.steps : run_.statistics.steps;
    if (mark.everything) {
        steps = mark.counts.steps;
        put_back_everything(mark);
    } else if (defers_) {
        step_.put_back_rate();
    }
    h_next_ = mark.h_next;
    if (phases_) phases_->restore(phases_->adapter, mark.phases);
    newly_armed_ = mark.newly_armed;
    if (mark.tentative > 0) {
        const auto& first = planner_->steps()[0];
        step_.restart(first.start);
        h_next_ = first.h_next;
        last_h_ = first.last_h;
        samples -= mark.next_sample - first.samples;
        pieces = first.pieces;
        rejected = first.rejected;
        steps -= mark.tentative;
        mark.next_sample = first.samples;
    }
    if (defers_) {
        planner_->steps().clear();
        planner_->forget_wrong();
    }
    if (mark.planned) {
        // Deadlines may be half renewed: they are found again at the start of the step.
        replans_ = true;
        watching_ = false;
    }
    rewind_counts(mark, steps, rejected);
    cut_records(mark, samples, pieces);
    run_.outcome = Outcome::reached_end;
    this->forget_cause();
    ended_ = false;
    pending_ = Engine::Pending::nothing;
    change_due_ = on_change_ = false;
    time_events_.forget_here();
    if (guarded_) {
        search_.fired().clear();
        search_.begin(step_.x0());
    }
}

}  // namespace ricochet::detail
