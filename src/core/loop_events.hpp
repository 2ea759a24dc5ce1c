// Events: which a step holds, and what they do.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline void Loop<X, single>::find_time_event(bool at_start)
{
    if (!timed_) return;
    const double t = step_.start().value;
    if (!backward_) {
        time_event_ = system_->next_time_event(system_.door(), t);
    } else if (system_->previous_time_event) {
        time_event_ = system_->previous_time_event(system_.door(), t);
    }
    if (step_.until(time_event_) > 0) return;
    if (at_start) throw_time_event_not_ahead(backward_, t, time_event_);
    end(Outcome::time_event_not_ahead);
}

template <class X, bool single>
inline void Loop<X, single>::apply_time_event()
{
    for (std::size_t i = 0; i < bank_.size(); ++i) bank_[i].band = 0;
    search_.members().clear();
    assign(search_.before(), step_.x0());
    transform(true);
    resting_ =
        resting_ && resets_.mode() == step_.mode() && same_state(resets_.after(), step_.x0());
    fire({.located = false, .on_time = true});
    if (!ended_) find_time_event();
    if (guarded_) cascade();
}

template <class X, bool single>
inline bool Loop<X, single>::handle_events()
{
    bool cleared = false;
    if (predicts_) {
        meter_.look_back(run_.statistics);
        asked_ = meter_.asks();
        if (asked_) cleared = ask_network();
        if (cleared && !finders_.detector.checks_every_step) {
            ++run_.statistics.checks_put_off;
            run_.statistics.evidence.add(Evidence::assumed);
            return false;
        }
    }
    if (bank_.size() == 0) return false;
    bank_.sample_end(step_, calls());
    if (!any_suspicious()) {
        if (asked_ && !cleared) ++run_.statistics.false_alarms;
        run_.statistics.evidence.add(finders_.detector.evidence);
        bank_.pass_on();
        return false;
    }
    return search(cleared);
}

template <class X, bool single>
inline bool Loop<X, single>::deserves_search(bool hardly_moves)
{
    if (!bank_.looked()) return bank_.suspicious(step_.h());
    if (hardly_moves) {
        X& x = search_.space(step_.x0());
        for (const double u : CubicLook::places) {
            step_.peek(u * step_.h(), x);
            bank_.sample_place(step_, u, x, calls());
        }
        return bank_.suspicious(step_.h());
    }
    if (!bank_.doubtful(step_.h())) return false;
    if (bank_.needs_second_look(step_.h())) {
        X& x = search_.space(step_.x0());
        step_.peek(CubicLook::further * step_.h(), x);
        bank_.sample_further(step_, x, calls());
    }
    return bank_.suspicious(step_.h());
}

template <class X, bool single>
inline void Loop<X, single>::look_inside()
{
    if constexpr (is_small<X> && std::is_trivially_copyable_v<X>) {
        // Components that no guard reads are not computed.
        X x{};
        step_.template peek<InsideOf>(x);
        bank_.sample_inside(step_, x, calls());
    } else {
        X& x = search_.space(step_.x0());
        step_.template peek<InsideOf>(x);
        bank_.sample_inside(step_, x, calls());
    }
}

template <class X, bool single>
inline bool Loop<X, single>::hardly_moves() const noexcept
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
inline bool Loop<X, single>::ask_network()
{
    ++run_.statistics.network_calls;
    return meter_.time_network([&] {
        return finders_.detector.clears(finders_.detecting, system_.door(), step_.state(), calls());
    });
}

template <class X, bool single>
bool Loop<X, single>::search(bool cleared)
{
    if (bank_.first_not_finite() != no_guard) {
        if (!return_to_domain()) return true;
        if (!any_suspicious()) {
            run_.statistics.evidence.add(finders_.detector.evidence);
            bank_.pass_on();
            return false;
        }
    }
    search_.begin(step_.x0());
    if (bank_.waiting()) end_plateaus();
    bank_.begin_search(step_.h());
    while (search_.find_set(step_, bank_, resolution_, time_event_due_, calls())) {
        if (predicts_ && (cleared || search_.late())) ++run_.statistics.missed_events;
        if (search_.late()) ++run_.statistics.late_events;
        dismiss_members();
        if (search_.members().empty()) continue;
        const bool on_time = time_event_due_ && search_.at() == step_.h();
        set_instant_ = step_.instant(search_.at(), search_.at_remainder());
        transform(on_time);
        if (!on_time && changes_nothing()) {
            go_on_past_members();
            continue;
        }
        act(on_time);
        return true;
    }
    note_crossings(step_.h());
    if (search_.notes().empty()) {
        if (asked_ && !cleared) ++run_.statistics.false_alarms;
        run_.statistics.evidence.add(search_.evidence());
    } else {
        record_notes(step_.h());
    }
    count_refined();
    bank_.pass_on_after_events();
    return ended_;
}

template <class X, bool single>
inline bool Loop<X, single>::return_to_domain()
{
    bool beyond = true;
    for (;;) {
        const std::size_t broken = bank_.first_not_finite();
        if (broken == no_guard) return true;
        const double h = shorten_into_domain(std::exchange(beyond, false));
        if (is_tentative() || h < smallest_step()) {
            if (!is_tentative() && happen_where_flow_ends(h)) return false;
            end(Outcome::non_finite, broken);
            return false;
        }
        ++run_.statistics.rejected;
        is_last_ = time_event_due_ = false;
        h_next_ = error_controlled_ ? h : h_next_;
        step_.attempt(h);
        bank_.sample_end(step_, calls());
    }
}

template <class X, bool single>
inline double Loop<X, single>::shorten_into_domain(bool beyond)
{
    const double h = step_.h();
    const double ahead = time_to_surface().ahead;
    if (ahead > h) return 0.5 * h;
    const double across = ahead + std::min(0.1 * ahead, 0.5 * (h - ahead));
    return beyond && across < h ? across : 0.9 * ahead;
}

template <class X, bool single>
inline bool Loop<X, single>::counts_here(std::size_t i)
{
    const bool enabled = system_.enabled_at(i, step_.mode(), step_.time(0), step_.x0());
    run_.statistics.disabled += !enabled;
    return enabled;
}

template <class X, bool single>
inline void Loop<X, single>::dismiss_members()
{
    auto& members = search_.members();
    std::size_t kept = 0;
    for (std::size_t k = 0; k < members.size(); ++k) {
        const std::size_t i = members[k];
        const double t = step_.time(search_.at());
        if (!system_.enabled_at(i, step_.mode(), t, search_.before())) {
            ++run_.statistics.disabled;
        } else if (repeats(i, t) && !bank_[i].info.unilateral && !turned_back(i)) {
            ++run_.statistics.suppressed;
        } else {
            bank_[i].again = repeats(i, t) && turned_back(i);
            members[kept++] = i;
            continue;
        }
        search_.pass(step_, bank_, i, calls());
    }
    members.shrink(kept);
}

template <class X, bool single>
inline bool Loop<X, single>::changes_nothing()
{
    if (resets_.mode() != step_.mode() || resets_.conflict().first != no_guard) return false;
    for (const std::size_t i : search_.members()) {
        if (bank_[i].info.unilateral || ends_run(i)) return false;
    }
    return same_state(resets_.after(), search_.before());
}

template <class X, bool single>
inline bool Loop<X, single>::ends_run(std::size_t i) const noexcept
{
    const GuardRecord& record = bank_[i];
    if (options_.stop_at_event) return true;
    return record.info.stop_after > 0 &&
           record.events + search_.noted(i) + 1 >= record.info.stop_after;
}

template <class X, bool single>
inline void Loop<X, single>::go_on_past_members()
{
    for (const std::size_t i : search_.members()) {
        search_.note(i, bank_[i].side);
        search_.pass(step_, bank_, i, calls());
    }
}

template <class X, bool single>
inline void Loop<X, single>::act(bool on_time)
{
    const double s = search_.at();
    const double t = on_time ? time_event_ : time_of_set();
    for (std::size_t i = 0; i < bank_.size(); ++i) bank_[i].band = 0;
    note_crossings_to_set();
    mode_before_ = step_.mode();
    for (const std::size_t i : search_.members()) find_band(i, t);
    ++run_.statistics.steps;
    count_refined();
    emit_samples(s);
    record_step(s);
    record_notes(s);
    limit_next_step(t);
    fire({.located = true, .on_time = on_time});
    if (on_time && !ended_) find_time_event();
    cascade();
}

template <class X, bool single>
inline void Loop<X, single>::limit_next_step(double t) noexcept
{
    if (!error_controlled_) return;
    const double flight = std::fabs(t - flight_start_);
    if (flight > resolution_.window(t)) {
        longest_step_ = std::max(2 * flight, rule_.smallest * longest_step_);
        flight_start_ = t;
    }
    h_next_ = std::min(h_next_, std::max(first_step_, longest_step_));
}

template <class X, bool single>
inline void Loop<X, single>::find_band(std::size_t i, double t)
{
    GuardRecord& record = bank_[i];
    const Location& where = search_.where(i);
    record.jumped = where.jump;
    if (where.jump) {  // the state is beyond, and the guard anything but small
        record.estimated = false;
        record.band = 0;
        return;
    }
    const double residue = 2 * std::fabs(where.slope) * where.error;
    record.estimated = system_->bounded && !record.info.boolean && std::isfinite(residue) &&
                       search_.at() == where.root && !search_.late();
    record.band =
        record.estimated ? std::max(residue, bank_.touch(i, step_.h())) : residue_of(i, t);
}

template <class X, bool single>
inline void Loop<X, single>::fire(const Firing& how)
{
    const Instant at = how.located ? set_instant_ : step_.instant(0, 0);
    const double t = how.on_time ? time_event_ : at.value;
    if (how.on_time) record_time_event(t);
    for (const std::size_t i : search_.members()) record_crossing(i, t, how.located);
    if (!goes_on()) {
        step_.restart(at, search_.before(), step_.mode());
        return;
    }
    step_.restart(at, resets_.after(), resets_.mode());
    if (how.on_time) step_.hold(t);
    if (stops_) return end(Outcome::stopped_by_event, first_member());
    if (!guarded_ || resting_ || accumulates(how.located)) return;
    arm_all();
}

template <class X, bool single>
inline bool Loop<X, single>::goes_on()
{
    const std::size_t modes = system_.modes();
    if (resets_.conflict().first != no_guard) {
        run_.other_guard = resets_.conflict().second;
        end(Outcome::conflicting_resets, resets_.conflict().first);
    } else if (modes > 0 && resets_.mode() >= modes) {
        end(Outcome::unknown_mode, first_member());
    } else if (!fits_dimension(search_.before(), resets_.after(), resets_.mode() == step_.mode())) {
        end(Outcome::wrong_dimension, first_member());
    } else if (!all_finite(resets_.after()) || resets_.after().size() == 0) {
        end(Outcome::non_finite, first_member());
    }
    return !ended_;
}

template <class X, bool single>
inline void Loop<X, single>::cascade()
{
    for (int level = 0; !ended_ && !resting_ && !search_.members().empty(); ++level) {
        if (level == most_levels) {
            return end(Outcome::endless_cascade, search_.members()[0]);
        }
        search_.begin(step_.x0());
        assign(search_.before(), step_.x0());
        search_.stay_at_start();
        set_instant_ = step_.instant(0, 0);
        transform(false);
        const std::size_t stuck = stuck_member();
        if (stuck != no_guard && bank_.g0(stuck) < -bank_[stuck].band) {
            return end(Outcome::outside_mode, stuck);
        }
        if (stuck != no_guard) {
            come_to_rest(stuck, 0, 0);
            if (!ended_ && !resting_) {
                search_.members().clear();
                search_.members().push_back(stuck);
                arm_all();
                if (still_stuck(stuck)) end(Outcome::zeno, stuck);
            }
            continue;
        }
        fire({});
    }
}

template <class X, bool single>
inline std::size_t Loop<X, single>::stuck_member()
{
    if (resets_.mode() != step_.mode() || !same_state(resets_.after(), step_.x0())) return no_guard;
    for (const std::size_t i : search_.members()) {
        if (bank_[i].info.unilateral) return i;
    }
    return no_guard;
}

}  // namespace ricochet::detail
