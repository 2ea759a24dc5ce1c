// Record of events.
#pragma once

#include "core/engine.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline void EventEngine<X, single>::note_crossings(double s)
{
    if (!guards_.suspects().empty()) guards_.complete_rates(step_, calls());
    for (const std::size_t i : guards_.suspects()) {
        if (guards_[i].acting || !guards_.suspicious(i, step_.h())) continue;
        search_->note_crossings(step_, guards_, i, guards_.end(i, s), calls());
    }
}

template <class X, bool single>
inline void EventEngine<X, single>::note_set()
{
    const double t = on_time_ ? time_event() : time_of_set();
    mode_before_ = step_.mode();
    keep_suspects();
    note_crossings_to_set();
    if (on_time_) {
        note_ties();
        note_vetoes();
    }
    for (const std::size_t i : search_->fired()) find_tolerance(i, t);
    if (guards_.keeps_rows()) note_excursions();
    veto_touches(search_->at());
    if (search_->shows_polynomial() && records_states()) step_.prepare_polynomial();
}

template <class X, bool single>
inline void EventEngine<X, single>::keep_suspects()
{
    kept_.disabled = run_.statistics.disabled;
    kept_.disabled_in_search = search_->disabled;
    kept_.uses_space = false;
    kept_.guards.clear();
    kept_.notes.clear();
    if (single && !search_->fired().empty() && search_->notes().empty()) return;
    for (const std::size_t i : guards_.suspects()) {
        if (!is_member(i)) kept_.guards.push_back(guards_.keep(i));
    }
    if (!search_->notes().empty()) kept_.notes = search_->notes();
    kept_.uses_space = !kept_.guards.empty() || (system_->enabled_at && !kept_.notes.empty());
    if (!kept_.uses_space) return;
    search_->keep_lost(step_);
    search_->keep_space();
}

template <class X, bool single>
inline void EventEngine<X, single>::put_suspects_back()
{
    for (const std::size_t i : search_->fired()) guards_[i].noted.tolerance = 0;
    for (const auto& guard : kept_.guards) guards_.put_back(guard);
    search_->notes() = kept_.notes;
    run_.statistics.disabled = kept_.disabled;
    search_->disabled = kept_.disabled_in_search;
}

template <class X, bool single>
inline void EventEngine<X, single>::note_vetoes()
{
    if (!system_->enabled_at) return;
    const double t = time_event();
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        const GuardRecord& record = std::as_const(guards_)[i];
        if (!record.acting || !record.enabled || record.info.boolean) continue;
        const bool vetoed = !system_.enabled_at(i, step_.mode(), t, search_->before());
        if (vetoed != record.noted.vetoed) guards_[i].noted.vetoed = vetoed;
    }
}

template <class X, bool single>
inline void EventEngine<X, single>::note_crossings_to_set()
{
    if (search_->fired().size() == guards_.size()) return;
    guards_.complete_rates(step_, calls());
    for (const std::size_t i : guards_.suspects()) {
        GuardRecord& record = guards_[i];
        if (record.examined.from == 0 && search_->comes_later(step_, guards_, i)) continue;
        if (!guards_.suspicious(i, step_.h()) || is_member(i)) continue;
        const GuardSample at = search_->sample_at_set(step_, guards_, i, calls());
        constexpr double epsilon = std::numeric_limits<double>::epsilon();
        const double ulp = epsilon * std::fabs(step_.time(at.s));
        const double rounded = std::fabs(at.value) + std::fabs(at.rate) * ulp;
        const double close = 8 * finest_bracket(at.s, step_.h());
        // Events that were found behind the set do not happen.
        if (record.examined.from > at.s + close) {
            if (at.value != 0) guards_.arm(i, side_of(at.value));
            continue;
        }
        // It has crossed together with the set, without effect: rounding does not take the crossing
        // back.
        if (record.examined.from > 0 && at.s - record.examined.from <= close) {
            if (!record.info.boolean) record.noted.tolerance = rounded;
            continue;
        }
        const bool rests = at.value == 0 && at.rate == 0;  // on its surface, and stays there
        const bool may_cross = !record.info.boolean && !rests && at.s > record.examined.from;
        const bool with_set = may_cross && (search_->crosses_with_set(step_, guards_, i, at) ||
                                            is_rounding_at_set(i, at));
        GuardSample last = at;
        // Until it crosses, a guard that crosses with the set is on the side from which it comes,
        // whatever its value is: the time of the set is rounded to a double.
        if (with_set) record.noted.tolerance = rounded;
        if (with_set) last.value = -std::copysign(std::numeric_limits<double>::min(), at.rate);
        if (!record.acting) {
            search_->note_crossings(step_, guards_, i, last, calls());
        }
        // An acting guard that has left its side, but was located behind the set, has left it by
        // rounding of its value only: its own event is still to come.
        const bool to_come = record.acting && counts(record.side, record.info.crossing);
        if (!to_come && has_left(record.side, last.value)) guards_.arm(i, opposite(record.side));
        const Side side = record.side;
        if (!with_set || side_of(last.value) != side) continue;
        if (!counts(side, record.info.crossing)) {
            guards_.arm(i, opposite(side));
        } else if (!record.acting) {
            if (counts_at_set(i)) {
                search_->note_at_set(guards_, i, side, at.rate);
            } else {
                guards_.arm(i, opposite(side));
            }
        }  // else its own event is still to come
    }
}

template <class X, bool single>
inline bool EventEngine<X, single>::is_rounding_at_set(std::size_t i, const GuardSample& at)
{
    const double size = std::fabs(at.value);
    const double moves = std::fabs(at.rate) * std::fabs(step_.time(at.s));
    if (guards_[i].acting || has_left(guards_[i].side, at.value)) return false;
    if (!(size <= tolerances::by_rounding * std::max(guards_.scale(i, step_.h()), moves)))
        return false;
    return size <= rounding_of(i, step_.mode(), step_.time(at.s), search_->before());
}

template <class X, bool single>
inline bool EventEngine<X, single>::counts_at_set(std::size_t i)
{
    const bool enabled =
        system_.enabled_at(i, step_.mode(), step_.time(search_->at()), search_->before());
    run_.statistics.disabled += !enabled;
    return enabled;
}

template <class X, bool single>
inline void EventEngine<X, single>::count_event(std::size_t i, double t, Side side)
{
    GuardRecord& record = guards_[i];
    run_.statistics.events += !is_of_phases(i);
    ++record.events;
    record.last.t = t;
    record.last.side = side;
    record.last.returned = false;
}

template <class X, bool single>
inline void EventEngine<X, single>::record_time_event(double t)
{
    stops_ = options_.stop_at_event;
    stopper_ = no_guard;
    ++run_.statistics.events;
    record({.t = t,
            .kind = EventKind::time,
            .guard = no_guard,
            .mode_before = step_.mode(),
            .mode_after = resets_.mode(),
            .before = search_->before(),
            .after = resets_.after(),
            .bracket = {t, t},
            .slope = 0});
}

template <class X, bool single>
inline Bracket EventEngine<X, single>::bracket_of(const Location& where, double t) const noexcept
{
    // The condition of an event may hold only some roundings beyond the bracket of its guard.
    const double lo = step_.time(where.lo), hi = step_.time(where.hi);
    const bool is_beyond = backward_ ? t < hi : t > hi;
    const double roundings = tolerances::of_sum * std::fabs(t);
    return {lo, is_beyond && std::fabs(t - hi) <= roundings ? t : hi};
}

template <class X, bool single>
inline void EventEngine<X, single>::record_crossing(std::size_t i, double t, bool located)
{
    const bool stops = stops_ && i != first_fired();
    if (!stops) stopper_ = i;
    stops_ = stops || ends_run(i);
    // At the start of a step the guard has been armed on the side to which it has been carried.
    const Side side = guards_[i].side;
    count_event(i, t, located ? side : opposite(side));
    const ReactionChange* const change = phases_ ? change_under(i) : nullptr;
    if (phases_ && !phases_->records(phases_->adapter, i)) {
        run_.statistics.events -= !is_of_phases(i);
        return;
    }
    if (!options_.record_events) return;
    static constexpr Location here{};
    const Location& where = located ? search_->where(i) : here;
    record({.t = t,
            .kind = change ? change->kind : kind_of(where),
            .guard = i,
            .mode_before = step_.mode(),
            .mode_after = resets_.mode(),
            .before = search_->before(),
            .after = resets_.after(),
            .bracket = bracket_of(where, t),
            .slope = where.slope,
            .error = where.error,
            .late = located && search_->late(),
            .reaction = change ? change->reaction : no_reaction});
}

template <class X, bool single>
const ReactionChange* EventEngine<X, single>::change_under(std::size_t guard)
{
    for (const ReactionChange& change : phases_->changes(phases_->adapter)) {
        if (change.guard == guard) return &change;
    }
    return nullptr;
}

template <class X, bool single>
void EventEngine<X, single>::record_changes(double t, bool located)
{
    const bool led = !search_->fired().empty() || on_time_;
    for (const ReactionChange& change : phases_->changes(phases_->adapter)) {
        if (change.guard != no_guard) continue;
        ++run_.statistics.events;
        if (options_.stop_at_event) {
            stops_ = true;
            if (!led) stopper_ = no_guard;
        }
        const bool found = located && change.fired != no_guard;
        const Location where = found ? search_->where(change.fired) : Location{};
        record({.t = t,
                .kind = change.kind,
                .guard = no_guard,
                .mode_before = step_.mode(),
                .mode_after = resets_.mode(),
                .before = search_->before(),
                .after = resets_.after(),
                .bracket = found ? bracket_of(where, t) : Bracket{t, t},
                .slope = where.slope,
                .error = where.error,
                .reaction = change.reaction});
    }
    if (is_of_phases(stopper_)) stopper_ = no_guard;
}

template <class X, bool single>
inline void EventEngine<X, single>::record_jump(std::size_t i, Side before)
{
    const double t = step_.time(0);
    guards_[i].last.recorded_in = armings_;
    count_event(i, t, before);
    record({.t = t,
            .guard = i,
            .mode_before = step_.mode(),
            .mode_after = step_.mode(),
            .before = step_.x0(),
            .after = step_.x0(),
            .bracket = {t, t}});
}

template <class X, bool single>
inline void EventEngine<X, single>::assign_state_of(const Note& note, double s, double t, X& x)
{
    if (note.where.root == s && s == search_->at()) {
        x = search_->before();
    } else if (options_.record_steps && note.state == Note{}.state) {
        // The state as the recorded solution has it there.
        x = step_.x0();
        const double from = step_.time(0);
        const DenseView<X, false> view(step_.dense(), backward_ ? from - t : t - from);
        for_each_component(x, [&](auto i) { x[i] = view[i]; });
    } else {
        x = search_->state_at(step_, note);
    }
}

template <class X, bool single>
inline double EventEngine<X, single>::time_of(const Note& note, double s) const noexcept
{
    const double remainder = s == search_->at() ? search_->at_remainder() : 0;
    const double latest = step_.instant(s, remainder).value;
    const double t = step_.time(note.where.root);
    return backward_ ? std::max(t, latest) : std::min(t, latest);
}

template <class X, bool single>
inline void EventEngine<X, single>::veto_touches(double s)
{
    if (!system_->enabled_at) return;
    const auto vetoed = [&](const Note& note) {
        if (note.kind != EventKind::touch || note.where.root > s) return false;
        return !system_.enabled_at(note.guard, step_.mode(), time_of(note, s),
                                   search_->state_at(step_, note));
    };
    run_.statistics.disabled += std::erase_if(search_->notes(), vetoed);
}

template <class X, bool single>
inline void EventEngine<X, single>::record_notes(double s)
{
    if (search_->notes().empty()) return;
    search_->keep_notes_until(s);
    for (const Note& note : search_->notes()) {
        const double t = time_of(note, s);
        count_event(note.guard, t, note.side);
        if (is_of_phases(note.guard)) continue;
        guards_[note.guard].last.returned = note.kind == EventKind::touch;
        if (!options_.record_events) continue;
        Event<X> event{.t = t,
                       .kind = note.kind,
                       .guard = note.guard,
                       .mode_before = step_.mode(),
                       .mode_after = step_.mode(),
                       .bracket = {step_.time(note.where.lo), step_.time(note.where.hi)},
                       .slope = note.where.slope,
                       .error = note.where.error};
        if (records_states()) {
            assign_state_of(note, s, t, event.before);
            event.after = event.before;
        }
        record(std::move(event));
    }
}

template <class X, bool single>
inline void EventEngine<X, single>::bring_up_to_date()
{
    run_.statistics.flow_calls = step_.flow_calls();
    run_.statistics.resteps = step_.resteps();
    if (defers_) planner_->add_counts(run_.statistics);
    if (search_) run_.statistics.disabled += std::exchange(search_->disabled, 0);
    run_.armed_beyond.clear();
    run_.armed_on_surface.clear();
    for (std::size_t i = 0; i < std::min(guards_.size(), own_guards_); ++i) {
        if (std::as_const(guards_)[i].armed_on) note_left_start(i);
        const GuardRecord& record = std::as_const(guards_)[i];
        if (!record.armed_beyond) continue;
        run_.armed_beyond.push_back(i);
        if (record.armed_on) run_.armed_on_surface.push_back(i);
    }
}

template <class X, bool single>
inline void EventEngine<X, single>::add_evidence(Evidence evidence, std::uint64_t steps) noexcept
{
    EvidenceCounts& counts = run_.statistics.evidence;
    switch (evidence) {
        case Evidence::proved: counts.proved += steps; return;
        case Evidence::checked: counts.checked += steps; return;
        case Evidence::gated: counts.gated += steps; return;
        case Evidence::assumed: counts.assumed += steps; return;
    }
}

}  // namespace ricochet::detail
