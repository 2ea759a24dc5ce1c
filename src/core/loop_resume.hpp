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
    const std::uint64_t steps = result().statistics.steps;
    try {
        advance_from_here(how);
        if (phases_) review_phase(result().statistics.steps != steps);
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
    mark_->h_next = h_next();
    if (defers_) {
        mark_->counts = result().statistics;
    } else {
        mark_->counts.rejected = result().statistics.rejected;
    }
    mark_->disabled = engine_.disabled();
    mark_->events = result().events.size();
    mark_->samples = result().trajectory.t.size();
    mark_->pieces = result().solution.size();
    mark_->next_sample = next_sample_;
    mark_->tentative = defers_ ? planner().steps().size() : 0;
    mark_->planned = defers_ && !engine_.watching();
    mark_->newly_armed = engine_.newly_armed();
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
        mark_->counts = result().statistics;
        mark_->counts.rejected = rejected;
    }
    engine_.keep(mark_->at);
    mark_->flight_start = flight_start_;
    mark_->longest_step = longest_step_;
    mark_->everything = true;
}

/// Takes back all counts since the mark but those of calls, which have been made.
template <class X, bool single>
void Loop<X, single>::rewind_counts(const Mark& mark, std::uint64_t steps, std::uint64_t rejected)
{
    if (mark.everything || defers_) {
        const Statistics seen = std::exchange(result().statistics, mark.counts);
        result().statistics.guard_calls = seen.guard_calls;
        result().statistics.network_calls = seen.network_calls;
        result().statistics.bound_calls = seen.bound_calls;
    }
    result().statistics.rejected = rejected;
    result().statistics.steps = steps;
    engine_.set_disabled(mark.disabled);
}

/// Drops what has been recorded since the mark.
template <class X, bool single>
void Loop<X, single>::cut_records(const Mark& mark, std::size_t samples, std::size_t pieces)
{
    result().events.resize(mark.events);
    result().trajectory.t.resize(samples);
    result().trajectory.x.resize(samples);
    if (result().reactions.size() > samples) result().reactions.resize(samples);
    result().solution.shrink(pieces);
    next_sample_ = mark.next_sample;
}

template <class X, bool single>
void Loop<X, single>::go_back_to_mark()
{
    Mark& mark = *mark_;
    std::size_t samples = mark.samples;
    std::size_t pieces = mark.pieces;
    std::uint64_t rejected = mark.counts.rejected;
    std::uint64_t steps = defers_ ? mark.counts.steps : result().statistics.steps;
    if (mark.everything) {
        steps = mark.counts.steps;
        engine_.put_back(mark.at);
        flight_start_ = mark.flight_start;
        longest_step_ = mark.longest_step;
    } else if (defers_) {
        now().put_back_rate();
    }
    h_next() = mark.h_next;
    if (phases_) phases_->restore(phases_->adapter, mark.phases);
    if (mark.tentative > 0) {
        const auto& first = planner().steps()[0];
        now().restart(first.start);
        h_next() = first.h_next;
        engine_.last_h() = first.last_h;
        samples -= mark.next_sample - first.samples;
        pieces = first.pieces;
        rejected = first.rejected;
        steps -= mark.tentative;
        mark.next_sample = first.samples;
    }
    if (defers_) {
        planner().steps().clear();
        planner().forget_wrong();
    }
    rewind_counts(mark, steps, rejected);
    cut_records(mark, samples, pieces);
    engine_.forget_exception(mark.newly_armed, mark.planned);
}

}  // namespace ricochet::detail
