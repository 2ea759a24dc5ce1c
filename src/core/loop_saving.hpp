// Saving and restoring of a run.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline Snapshot Loop<X, single>::save()
{
    engine_.plan_again();
    Snapshot snapshot;
    snapshot.run = properties();
    visit_state(SnapshotWriter(snapshot));
    return snapshot;
}

template <class X, bool single>
inline void Loop<X, single>::restore(const Snapshot& snapshot)
{
    // Not by `save`, which may have to evaluate guards.
    Snapshot old;
    old.run = properties();
    require_same_run(snapshot.run, old.run);
    visit_state(SnapshotWriter(old));
    std::vector<MotionPhase> phases = result().phases;
    try {
        SnapshotReader reader(snapshot);
        visit_state(reader);
        reader.finish();
        reopen();
        refuse_bad_place();
    } catch (const std::invalid_argument&) {
        visit_state(SnapshotReader(old));
        result().phases = std::move(phases);
        throw;
    }
    go_on_from_place();
    show_all();
    if (has_ended() && phases_ && phases_->reaction) result().reaction = reaction_here();
}

template <class X, bool single>
inline void Loop<X, single>::go_on_from_place()
{
    engine_.go_on_from(place_);
    if (timed_) engine_.keep_before(last_of_flow_);
    next_review_ = 0;
}

template <class X, bool single>
template <class Visitor>
inline void Loop<X, single>::visit_state(Visitor&& visit)
{
    if constexpr (std::remove_cvref_t<Visitor>::saves) place_ = now().place();
    visit(place_.t.value);
    visit(place_.t.remainder);
    visit(place_.mode);
    for (X* x : {&place_.x, &place_.remainder, &place_.rate}) visit.state(*x);
    visit(h_next());
    visit(first_step_);
    visit(flight_start_);
    visit(longest_step_);
    engine_.visit_time_event(visit);
    if (timed_) visit(place_.is_beyond);
    if constexpr (std::remove_cvref_t<Visitor>::saves) last_of_flow_ = now().last_of_flow();
    if (timed_) visit(last_of_flow_);
    engine_.holds().visit(visit);
    engine_.visit_ended(visit);
    visit(result().outcome);
    visit_cause(visit);
    visit_samples(visit);
    engine_.visit_guards(visit);
    if (phases_) visit_phases(visit);
    engine_.visit_planner(visit);
}

template <class X, bool single>
template <class Visitor>
void Loop<X, single>::visit_phases(Visitor&& visit)
{
    std::vector<double> memory;
    phases_->save(phases_->adapter, memory);
    for (double& number : memory) visit(number);
    if constexpr (!std::remove_cvref_t<Visitor>::saves) {
        phases_->restore(phases_->adapter, memory);
    }
}

template <class X, bool single>
inline void Loop<X, single>::reopen() noexcept
{
    const auto ended_by = [this](Outcome outcome) { return result().outcome == outcome; };
    const bool short_of_end = lies_before(place_.t.value, options().t_end);
    const bool has_steps = result().statistics.steps < options().max_steps;
    if (ended_by(Outcome::cancelled) || (ended_by(Outcome::reached_end) && short_of_end) ||
        (ended_by(Outcome::step_limit) && has_steps) || ended_by(Outcome::stalled)) {
        engine_.reopen();
    }
}

template <class X, bool single>
template <class Visitor>
inline void Loop<X, single>::visit_cause(Visitor&& visit)
{
    constexpr bool saves = std::remove_cvref_t<Visitor>::saves;
    if constexpr (!saves) engine_.forget_cause();
    if (!has_ended()) return;
    visit(result().guard);
    visit(result().other_guard);
    if (result().outcome != Outcome::wrong_bound) return;
    if constexpr (!saves) result().wrong_bound.emplace().x = place_.x;
    WrongBound<X>& wrong = *result().wrong_bound;
    visit(wrong.guard);
    visit(wrong.lower_bound);
    visit(wrong.upper_bound);
    for (double* number :
         {&wrong.t, &wrong.value, &wrong.since, &wrong.value_then, &wrong.allowed}) {
        visit(*number);
    }
    visit.state(wrong.x);
}

template <class X, bool single>
template <class Visitor>
inline void Loop<X, single>::visit_samples(Visitor&& visit)
{
    const auto& times = options().sample_times;
    double written = next_sample_ > 0 ? times[next_sample_ - 1] : -infinity;
    if (backward_ && next_sample_ == 0) written = infinity;
    visit(written);
    if constexpr (!std::remove_cvref_t<Visitor>::saves) {
        next_sample_ = 0;
        while (next_sample_ < times.size() && (lies_before(times[next_sample_], place_.t.value) ||
                                               !lies_before(written, times[next_sample_]))) {
            ++next_sample_;
        }
    }
}

}  // namespace ricochet::detail
