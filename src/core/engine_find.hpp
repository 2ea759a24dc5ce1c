// Search for the first set of events in the current step.
#pragma once

#include <algorithm>

#include "core/engine.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool EventEngine<X, single>::deserves_search(bool& cleared)
{
    cleared = false;
    if (predicts_ && !holds_.empty()) {
        asked_ = false;  // a network predicts the flow, and not what a rest leaves of it
    } else if (predicts_) {
        costs_.review(run_.statistics);
        asked_ = costs_.asks();
        if (asked_) cleared = ask_network();
        if (cleared && !finders_.detector.checks_every_step) {
            ++run_.statistics.checks_deferred;
            run_.statistics.evidence.add(Evidence::assumed);
            return false;
        }
    }
    if (guards_.size() == 0 || (phases_ && guards_.is_idle())) return false;
    sample_end();
    const bool dips = !single && defers_ && bounds_show_event();
    if (any_suspicious() || dips || has_ties()) return true;
    if (!single && defers_) count_covered();
    if (asked_ && !cleared) ++run_.statistics.false_alarms;
    pass_on_clear();
    return false;
}

template <class X, bool single>
inline bool EventEngine<X, single>::is_suspicious(bool everywhere)
{
    if (!guards_.checked()) return guards_.suspicious(step_.h());
    const bool stands = everywhere && step_.stands();
    if (everywhere && !(stands && guards_.are_cubics_of_time())) {
        X& x = search_->space(step_.x0());
        if (stands) assign(x, step_.x0());
        for (const double u : CubicCheck::places) {
            if (!stands) step_.peek(u * step_.h(), x);
            guards_.sample_place(step_, u, x, calls());
        }
        return guards_.suspicious(step_.h());
    }
    if (!guards_.doubtful(step_.h())) return false;
    if (guards_.needs_second_check(step_.h()) && !guards_.sample_doubtful_further(step_, calls())) {
        X& x = search_->space(step_.x0());
        step_.peek(CubicCheck::further * step_.h(), x);
        guards_.sample_further(step_, x, calls());
    }
    return guards_.suspicious(step_.h());
}

template <class X, bool single>
inline void EventEngine<X, single>::check_inside()
{
    if constexpr (is_small<X> && std::is_trivially_copyable_v<X>) {
        // Components that no guard reads are not computed.
        X x(step_.x0().size());
        step_.template peek<InsideOf>(x);
        guards_.sample_inside(step_, x, calls());
    } else {
        X& x = search_->space(step_.x0());
        step_.template peek<InsideOf>(x);
        guards_.sample_inside(step_, x, calls());
    }
}

template <class X, bool single>
inline bool EventEngine<X, single>::hardly_moves() const noexcept
{
    const X& x0 = step_.x0();
    const X& x1 = step_.x1();
    const auto is_still = [&](auto i) {
        return std::fabs(x1[i] - x0[i]) <= 0x1p-10 * std::fabs(x0[i]);
    };
    if constexpr (is_small<X>) {
        bool still = true;
        for_each_component(x0, [&](auto i) { still &= is_still(i); });
        return still;
    } else {
        for (decltype(x0.size()) i = 0; i < x0.size(); ++i) {
            if (!is_still(i)) return false;
        }
        return true;
    }
}

template <class X, bool single>
inline bool EventEngine<X, single>::ask_network()
{
    ++run_.statistics.network_calls;
    return costs_.time_network([&] {
        return finders_.detector.clears(finders_.detecting, system_.adapter(), step_.state(),
                                        calls());
    });
}

template <class X, bool single>
template <class Before>
inline bool EventEngine<X, single>::find(bool cleared, const Before& before_resets)
{
    search_->begin(step_.x0());
    if (guards_.waiting()) end_plateaus();
    guards_.begin_search(step_.h());
    for (bool may_tie = true;;) {
        const bool found = search_->find_set(step_, guards_, ends_at_.time_event, calls());
        if (!single && cuts_before_windows_ && found && may_tie && ends_inside_window())
            return false;
        const bool tied = may_tie && add_ties(found);
        if (!found && !tied) break;
        may_tie = may_tie && !tied;
        if (found && predicts_ && (cleared || search_->late())) ++run_.statistics.missed_events;
        if (search_->late()) ++run_.statistics.late_events;
        dismiss_members();
        on_time_ = ends_at_.time_event && search_->at() == step_.h();
        on_change_ = ends_at_.change && search_->at() == step_.h();
        if (search_->fired().empty() && !(tied && on_time_)) continue;
        const bool met =
            tied ? search_->meet_conditions_on_time(step_, guards_, calls())
                 : on_time_ || on_change_ || search_->meet_conditions(step_, guards_, calls());
        run_.statistics.unmet_conditions += !met;
        left_known_ = system_->moded || any_stands();
        if (left_known_) {
            assign(left_rate_, search_->before());
            step_.flow(search_->at(), search_->before(), left_rate_);
            assign(left_start_, step_.rate0());
            left_after_ = search_->at();
        }
        place_set(step_.instant(search_->at(), search_->at_remainder()));
        before_resets();
        note_set();
        transform(on_time_, true);
        if (on_time_ || !changes_nothing() ||
            (resets_any_ && (changed_elsewhere() || acts_beyond()))) {
            note_left_alone(true);
            return true;
        }
        put_suspects_back();
        go_on_past_members();
    }
    note_crossings(step_.h());
    veto_touches(step_.h());
    if (search_->notes().empty()) {
        if (asked_ && !cleared) ++run_.statistics.false_alarms;
        run_.statistics.evidence.add(search_->evidence());
    } else {
        record_notes(step_.h());
    }
    count_refined();
    guards_.pass_on_after_events();
    return false;
}

template <class X, bool single>
bool EventEngine<X, single>::ends_inside_window()
{
    if (ends_on_time() || ends_at_.change) return false;
    const double first = search_->first_root();
    const double t = step_.time(first);
    const double window = resolution_.window(t), before = window / 16;
    if (window == resolution_.blur(t) || first + window <= step_.h()) return false;
    if (first <= 2 * before || before + window > h_next_) return false;
    before_window_ = first - before;
    return true;
}

template <class X, bool single>
inline bool EventEngine<X, single>::counts_here(std::size_t i)
{
    const bool enabled = system_.enabled_at(i, step_.mode(), step_.time(0), step_.x0());
    run_.statistics.disabled += !enabled;
    return enabled;
}

template <class X, bool single>
inline void EventEngine<X, single>::dismiss_members()
{
    auto& fired = search_->fired();
    std::size_t kept = 0;
    for (std::size_t k = 0; k < fired.size(); ++k) {
        const std::size_t i = fired[k];
        const double t = step_.time(search_->at());
        const Side side = search_->side_left(i);
        if (guards_[i].side != side) guards_.arm(i, side);
        if (!system_.enabled_at(i, step_.mode(), t, search_->before())) {
            ++run_.statistics.disabled;
        } else if (repeats(i, t) && !guards_[i].info.unilateral && !turned_back(i)) {
            ++run_.statistics.suppressed;
        } else {
            guards_[i].again = repeats(i, t) && turned_back(i);
            fired[kept++] = i;
            continue;
        }
        search_->pass(step_, guards_, i, calls());
    }
    fired.shrink(kept);
}

template <class X, bool single>
inline bool EventEngine<X, single>::changes_nothing()
{
    if (cuts_at_all_ || resets_.stops()) return false;
    if (resets_.mode() != step_.mode() || resets_.conflict().first != no_guard) return false;
    for (const std::size_t i : search_->fired()) {
        // The phases may have decided that a reaction at its bound is held on, from where it is
        // now.
        if (guards_[i].info.unilateral || is_of_phases(i) || ends_run(i)) return false;
    }
    return same_state(resets_.after(), search_->before());
}

template <class X, bool single>
bool EventEngine<X, single>::changed_elsewhere()
{
    if (step_.is_hosts()) return false;
    const auto fired = search_->fired().span();
    const auto resets = [&](std::size_t i) { return guards_[i].info.resets; };
    if (std::none_of(fired.begin(), fired.end(), resets)) return false;
    if (!step_.flow_ends_alike(resets_.scratch())) return true;
    return !guards_.end_alike(step_, calls());
}

template <class X, bool single>
bool EventEngine<X, single>::acts_beyond()
{
    std::uint64_t& count = run_.statistics.ineffective_resets;
    const auto fired = search_->fired().span();
    // A reset that is told the direction of its crossing may be meant for one direction alone.
    const auto is_meant = [this](std::size_t i) {
        const GuardInfo& info = guards_[i].info;
        return info.resets && !(system_->tell_direction && info.crossing == Crossing::either);
    };
    for (const std::size_t i : fired) count += is_meant(i);
    const std::size_t i = fired[0];
    const bool asks = system_->moded && system_->reset && !system_->after_set;
    if (!asks || fired.size() > 1 || !guards_[i].info.resets) return false;
    X& x = resets_.scratch();
    if (kept_.uses_space) search_->put_space_back();
    const double t = search_->go_beyond(step_, guards_, i, x, calls());
    if (t == t && resets_.ask_again(system_, i, step_.mode(), t, x, search_->before())) {
        count -= is_meant(i);
        return true;
    }
    if (is_meant(i)) run_.statistics.declined_guard = i;
    return false;
}

template <class X, bool single>
inline bool EventEngine<X, single>::ends_run(std::size_t i) const noexcept
{
    const GuardRecord& record = guards_[i];
    if (is_of_phases(i)) return false;
    if (options_.stop_at_event) return true;
    return record.info.stop_after > 0 &&
           record.events + search_->noted(i) + 1 >= record.info.stop_after;
}

template <class X, bool single>
inline void EventEngine<X, single>::go_on_past_members()
{
    for (const std::size_t i : search_->fired()) {
        // A crossing that was joined to the end of the run is left to a run that starts there,
        // whose state lies before it.
        if (!ends_at_.time_event && search_->was_joined(step_, i)) continue;
        search_->note(i, guards_[i].side, records_states());
        search_->pass(step_, guards_, i, calls());
    }
}

template <class X, bool single>
inline bool EventEngine<X, single>::bounds_show_event()
{
    search_->cover().begin();
    guards_.forget_dips();
    bool any = false;
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        const GuardRecord& record = std::as_const(guards_)[i];
        if (!record.enabled || record.deferred) continue;
        const bool dips = search_->bounds_show_event(step_, guards_, i, calls());
        guards_.note_dip(i, dips);
        any = any || dips;
    }
    return any;
}

template <class X, bool single>
inline bool EventEngine<X, single>::doubts_remain()
{
    search_->cover().begin();
    guards_.forget_dips();
    planner_->close_inside(step_, guards_, *search_, run_.statistics);
    if (planner_->judged().empty()) {
        count_covered();
        count_deferred(1);
        return false;
    }
    planner_->wake(step_, guards_, run_.statistics, last_h_);
    for (const std::size_t i : planner_->judged()) {
        const bool open =
            guards_.starts_at_event(i, step_) || std::as_const(guards_)[i].info.boolean;
        if (!open) continue;
        guards_.note_dip(i, search_->bounds_show_event(step_, guards_, i, calls()));
    }
    for (const std::size_t i : planner_->judged()) {
        if (guards_.leaves_plateau(i) || guards_.suspicious(i, step_.h())) return true;
    }
    if (has_ties()) return true;
    count_covered();
    run_.statistics.evidence.add(finders_.detector.evidence);
    for (const std::size_t i : planner_->judged()) guards_.leave_plateau(i);
    return false;
}

template <class X, bool single>
auto EventEngine<X, single>::first_approach() -> Approach
{
    Approach first;
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        const GuardRecord& record = guards_[i];
        if (!record.enabled || record.info.boolean) continue;
        if (!counts(record.side, record.info.crossing)) continue;
        const double g = guards_.g0(i);
        const double rate = approach_rate(i);
        const double ahead = g * rate < 0 && std::isfinite(rate) ? -g / rate : infinity;
        if (ahead < first.ahead) first = {i, ahead};
    }
    return first;
}

template <class X, bool single>
double EventEngine<X, single>::approach_rate(std::size_t i)
{
    double rate = guards_.complete_rate0(i, step_, h_next_, calls());
    if (!system_->rated) {
        // Over a short step the rounding of the state may swallow the difference.
        double scale = h_next_;
        for (int k = 0; rate == 0 && k < 12; ++k) rate = departure(i, scale *= 16);
    }
    return rate;
}

template <class X, bool single>
inline void EventEngine<X, single>::take_back(const QuietRun& quiet)
{
    if (on_series()) {
        guards_.take_back_on_series(quiet, step_);
    } else {
        guards_.take_back(quiet, step_, calls());
    }
    h_next_ = error_controlled_ || quiet.why == QuietEnd::due ? quiet.h_next : h_next_;
    Statistics& counts = run_.statistics;
    counts.rejected += quiet.rejected;
    counts.guard_calls += quiet.guard_calls;
    if (quiet.steps == 0) return;
    last_h_ = step_.h();
    counts.steps += quiet.steps;
    if (guards_.size() > 0) add_evidence(evidence_of_quiet(), quiet.steps);
}

}  // namespace ricochet::detail
