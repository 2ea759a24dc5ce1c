// Application of a set of events to the state.
#pragma once

#include "core/engine.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline void EventEngine<X, single>::apply_found()
{
    begin_set();
    ++run_.statistics.steps;
    count_refined();
    record_notes(search_->at());
    apply(true, on_time_);
}

template <class X, bool single>
inline void EventEngine<X, single>::apply(bool located, bool on_time)
{
    assert(pending_ == Pending::nothing);
    const Instant at = located ? Instant{set_time_, set_remainder_} : step_.instant(0, 0);
    const double t = on_time ? time_event() : at.value;
    located_ = located;
    on_time_ = on_time;
    mode_before_ = step_.mode();
    if (on_time) {
        record_time_event(t);
        if (located && !left_known_) leave_from_end();
    }
    for (const std::size_t i : search_->fired()) record_crossing(i, t, located);
    if (phases_) record_changes(t, located);
    if (!goes_on()) {
        step_.restart(at, search_->before(), step_.mode());
        return;
    }
    if (resets_.stops()) note_stop();
    changed_mode_ = resets_.mode() != step_.mode();
    enters_mode_ = shown(resets_.mode()) != shown(step_.mode());
    if (system_->next_time_event_at) {
        const bool changes = changed_mode_ || !same_state(resets_.after(), search_->before());
        time_events_.see_set(changes, on_time, located);
    }
    leaves_phase_ = true;
    if (!holds_.empty()) holds_.release_changed(search_->before(), resets_.after(), changed_mode_);
    step_.restart(at, resets_.after(), resets_.mode());
    for (const auto& [component, lost] : left_alone_) step_.set_remainder(component, lost);
    if (on_time) {
        time_events_.pass(t);
        step_.hold(t);
    }
    start_beyond_time_event();
    if (stops_) return end(Outcome::stopped_by_event, stopper_);
    pending_ = Pending::settle;
}

template <class X, bool single>
inline void EventEngine<X, single>::note_left_alone(bool located)
{
    left_alone_.clear();
    const X& before = search_->before();
    const X& after = resets_.after();
    if (before.size() != after.size() || before.size() > tolerances::remembered_components) return;
    bool any = false;
    for_each_component(
        after, [&](auto i) __attribute__((always_inline)) {
            any = any | ((after[i] == before[i]) & (after[i] != 0));
        });
    if (any) note_lost(before, after, located);
}

template <class X, bool single>
void EventEngine<X, single>::note_lost(const X& before, const X& after, bool located)
{
    for (std::size_t c = 0; c < static_cast<std::size_t>(before.size()); ++c) {
        const auto i = static_cast<decltype(before.size())>(c);
        // A component that is zero may have been set to zero.
        if (after[i] != before[i] || after[i] == 0) continue;
        const double lost = located ? search_->lost_at_set(step_, c) : step_.remainder()[i];
        if (lost != 0) left_alone_.emplace_back(c, lost);
    }
}

template <class X, bool single>
inline void EventEngine<X, single>::find_tolerance(std::size_t i, double t)
{
    GuardRecord& record = guards_[i];
    const Location& where = search_->where(i);
    record.last.jumped = where.jump;
    if (where.jump) {  // the state is beyond the jump, and the guard is not small there
        record.estimated = false;
        record.noted.tolerance = 0;
        return;
    }
    const double residue = system_->bounded ? 2 * std::fabs(where.slope) * where.error : infinity;
    record.estimated = std::isfinite(residue) && !record.info.boolean &&
                       search_->at() == where.root && !search_->late();
    const double known = search_->value_at_set(i);
    record.noted.value = known == known ? known : value_at_set(i, t);
    record.noted.tolerance =
        record.estimated ? std::max(residue, guards_.touch(i, step_.h())) : record.noted.value;
}

template <class X, bool single>
inline bool EventEngine<X, single>::goes_on()
{
    const std::size_t modes = system_.modes();
    if (resets_.conflict().first != no_guard) {
        run_.other_guard = resets_.conflict().second;
        end(Outcome::conflicting_resets, resets_.conflict().first);
    } else if (modes > 0 && resets_.mode() >= modes) {
        end(Outcome::unknown_mode, first_fired());
    } else if (!fits_dimension(search_->before(), resets_.after(),
                               resets_.mode() == step_.mode())) {
        end(Outcome::wrong_dimension, first_fired());
    } else if (!all_finite(resets_.after())) {
        end_not_finite("reset", first_fired());
    }
    return !ended_;
}

template <class X, bool single>
inline void EventEngine<X, single>::note_stop()
{
    stops_ = true;
    stopper_ = resets_.stopper() == time_event_reset ? no_guard : resets_.stopper();
    run_.reason = resets_.reason();
}

template <class X, bool single>
inline void EventEngine<X, single>::find_time_event(After what)
{
    const double t = step_.start().value;
    if (time_events_.find(what, step_, resolution_.window(t))) return;
    if (what == After::start || what == After::restart) {
        throw_time_event_not_ahead(who_, backward_, system_->next_time_event_at, t, time_event());
    }
    end(Outcome::time_event_not_ahead);
}

template <class X, bool single>
inline bool EventEngine<X, single>::apply_due_time_event()
{
    if (system_->time_event_count) {  // each entry of a list happens, whatever it changes
        sets_.begin_instant();
    } else if (sets_.exceeds(timer_) || sets_.repeats(step_.x0(), step_.mode(), {})) {
        end(Outcome::endless_cascade);
        return false;
    }
    search_->begin(step_.x0());
    search_->stay_at_start();
    place_set(step_.instant(0, 0));
    apply_at_start(true);
    return !ended_;
}

template <class X, bool single>
inline void EventEngine<X, single>::apply_at_start(bool on_time, double taken)
{
    search_->fired().clear();
    assign(search_->before(), step_.x0());
    leave_from_start(taken);
    if (on_time) note_vetoes();
    if (phases_) place_set(step_.instant(0, 0));
    transform(on_time, false);
    note_left_alone(false);
    apply(false, on_time);
}

template <class X, bool single>
inline bool EventEngine<X, single>::fire_here(std::size_t i)
{
    if (!counts_here(i)) return false;
    if (!guards_[i].acting) {
        record_jump(i, guards_[i].side);
        return false;
    }
    begin_set();
    guards_[i].tolerance = std::fabs(guards_.g0(i));
    search_->fired().clear();
    search_->fired().push_back(i);
    return true;
}

template <class X, bool single>
void EventEngine<X, single>::change_phase(const X& x, Mode mode)
{
    reopen();
    stops_ = false;
    holds_.wake();
    forget_cause();
    search_->fired().clear();
    leave_from_start(0);
    assign(search_->before(), step_.x0());
    mode_before_ = step_.mode();
    changed_mode_ = mode != step_.mode();
    enters_mode_ = shown(mode) != shown(step_.mode());
    leaves_phase_ = true;
    on_time_ = located_ = on_change_ = ends_at_.change = false;
    const X from = step_.x0(), remainder = step_.remainder();
    step_.restart(step_.start(), x, mode);
    for (std::size_t c = 0; c < static_cast<std::size_t>(from.size()); ++c) {
        if (from[c] == x[c]) step_.set_remainder(c, remainder[c]);
    }
    pending_ = Pending::settle;
}

}  // namespace ricochet::detail
