// Side on which every guard is armed after a set, and the guards that fire at the same instant.
#pragma once

#include <bit>

#include "core/engine.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool EventEngine<X, single>::settle()
{
    const Pending due = std::exchange(pending_, Pending::nothing);
    const bool at_start = due == Pending::nothing;
    switch (due) {
        case Pending::nothing: break;
        case Pending::settle:
            if (guarded_ && !rest_fired()) arm_all();
            if (on_time_ && !ended_) {
                find_time_event(After::time_event);
            } else {
                ask_timer();
            }
            break;
        case Pending::arm_stuck:
            arm_after_rest();
            if (!ended_ && still_stuck(stuck_)) end(Outcome::zeno, stuck_);
            ask_timer();
            break;
        case Pending::arm:
            arm_after_rest();
            ask_timer();
            break;
        case Pending::arm_released:
            arm_all();
            ask_timer();
            break;
    }
    if (ended_) return false;
    if (pending_ != Pending::nothing) return true;
    const bool is_due = time_events_.is_due_here();
    if (!search_->fired().empty()) return apply_next_set(is_due && at_start);
    if (!holds_.empty() && release_lifted()) return true;
    if (is_due) return apply_due_time_event();
    if (!holds_.empty()) holds_.review(span_of_rest());
    assert(search_->fired().empty() && pending_ == Pending::nothing);
    return false;
}

template <class X, bool single>
inline void EventEngine<X, single>::arm_after_rest()
{
    if (ended_) return;
    const std::size_t loose = holds_.hold_rested(h_next_);
    if (loose != no_guard) return end(Outcome::zeno, loose);
    arm_all();
}

template <class X, bool single>
inline bool EventEngine<X, single>::apply_next_set(bool on_time)
{
    if (const std::size_t guard = endless_guard(); guard != no_guard) {
        end(Outcome::endless_cascade, guard);
        return false;
    }
    search_->begin(step_.x0());
    assign(search_->before(), step_.x0());
    search_->stay_at_start();
    place_set(step_.instant(0, 0));
    leave_from_start(0);
    if (on_time) note_vetoes();
    transform(on_time, false);
    stuck_ = on_time ? no_guard : stuck_guard();
    if (stuck_ == no_guard) {
        note_left_alone(false);
        apply(false, on_time);
        return !ended_;
    }
    if (guards_.g0(stuck_) < -guards_[stuck_].tolerance) {
        end(Outcome::outside_mode, stuck_);
        return false;
    }
    come_to_rest(stuck_, 0, 0);
    if (ended_) return false;
    search_->fired().clear();
    search_->fired().push_back(stuck_);
    pending_ = Pending::arm_stuck;
    return true;
}

template <class X, bool single>
inline std::size_t EventEngine<X, single>::endless_guard()
{
    const std::span<const std::size_t> fired = search_->fired().span();
    for (const std::size_t i : fired) {
        if (sets_.exceeds(guards_[i].here)) return i;
    }
    return sets_.repeats(step_.x0(), step_.mode(), fired) ? fired[0] : no_guard;
}

template <class X, bool single>
inline std::size_t EventEngine<X, single>::stuck_guard()
{
    if (resets_.mode() != step_.mode() || !same_state(resets_.after(), step_.x0())) return no_guard;
    for (const std::size_t i : search_->fired()) {
        if (guards_[i].info.unilateral) return i;
    }
    return no_guard;
}

template <class X, bool single>
inline void EventEngine<X, single>::arm_at_start(bool begins)
{
    enters_mode_ = false;
    if (!begins) {
        holds_.hold_again(h_next_, [this](std::size_t i) {
            return !is_of_phases(i) && resets_any_ && std::as_const(guards_)[i].info.resets;
        });
    }
    enable_guards();
    newly_armed_ = true;
    watching_ = false;
    last_h_ = h_next_;
    began_at_ = step_.time(0);
    guards_.begin_phase(began_at_);
    guards_.sample_start(step_, calls(), h_next_);
    guards_.keep_armed_values();
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        if (std::as_const(guards_)[i].enabled) arm_one_at_start(i, begins);
    }
}

template <class X, bool single>
inline void EventEngine<X, single>::arm_one_at_start(std::size_t i, bool begins)
{
    GuardRecord& record = guards_[i];
    const GuardInfo& info = record.info;
    const double g = guards_.g0(i);
    if (!std::isfinite(g)) throw_start_guard_not_finite(who_, i, info.name, options_.t_start, g);
    // A restart may leave the guard on the side on which it was before its event at this time.
    const bool had_event = !begins && !record.acting && has_event_at(i, began_at_);
    const bool on =
        g == 0 || ((info.unilateral ? g < 0 : had_event) && std::fabs(g) <= rounding_of(i));
    if (on) record.tolerance = std::fabs(g);
    record.departs = on;
    const Side side = on ? heading(i) : side_of(g);
    const bool asks = begins && info.at_start && !counts(side, info.crossing);
    const life::Arming arming = life::arming_of(
        life::Cause::start, facts_of(record, Side::plateau, {side, on}) | (asks ? life::asks : 0u));
    if (arming == life::Arming::outside && is_enabled_here(i)) {
        throw_start_outside_mode(who_, i, info.name, options_.t_start, g);
    }
    guards_.arm(i, side);
    if (side == Side::plateau) guards_.await(i, life::awaited_side(life::Cause::start, info, side));
    if (arming == life::Arming::waits) {
        // A guard with `at_start` has already fired in the run that this one continues.
        const bool is_known = !begins && info.at_start && options_.continues;
        if (!record.acting || is_known) return;
        if (is_beyond(side, info.crossing)) count_armed_beyond(i, on);
        if (side == Side::plateau) guards_[i].armed_on = true;
    } else if (arming != life::Arming::outside && counts_here(i)) {
        have_event(i, arming, side);
    }
}

template <class X, bool single>
inline bool EventEngine<X, single>::has_event_at(std::size_t i, double t) const
{
    return std::any_of(run_.events.begin(), run_.events.end(),
                       [=](const Event<X>& event) { return event.guard == i && event.t == t; });
}

template <class X, bool single>
inline void EventEngine<X, single>::forget_armed_beyond()
{
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        const GuardRecord& record = std::as_const(guards_)[i];
        if (!record.armed_beyond || is_beyond(record.side, record.info.crossing)) continue;
        guards_[i].armed_beyond = guards_[i].armed_on = false;
        --run_.statistics.armed_beyond;
    }
}

template <class X, bool single>
inline void EventEngine<X, single>::note_left_start(std::size_t i)
{
    const GuardRecord& record = std::as_const(guards_)[i];
    if (record.armed_beyond || !std::isnan(record.last.t) || !record.enabled) return;
    if (!is_beyond(record.side, record.info.crossing)) return;
    const double g = guards_.view(i, step_.mode(), calls()).value(step_.time(0), step_.x0());
    if (side_of(g) != record.side || std::fabs(g) <= rounding_of(i)) return;
    count_armed_beyond(i, true);
}

template <class X, bool single>
inline void EventEngine<X, single>::have_event(std::size_t i, life::Arming arming, Side from)
{
    if (arming == life::Arming::by_condition) {
        fire_by_condition(i);
    } else if (std::as_const(guards_)[i].acting) {
        search_->fired().push_back(i);
    } else {
        record_jump(i, from);
    }
}

template <class X, bool single>
inline void EventEngine<X, single>::fire_by_condition(std::size_t i)
{
    const Side inside = guards_[i].info.crossing == Crossing::falling ? Side::above : Side::below;
    if (guards_[i].acting) {
        guards_.arm(i, opposite(inside));
        search_->fired().push_back(i);
    } else {
        record_jump(i, inside);
    }
}

template <class X, bool single>
inline bool EventEngine<X, single>::fires_at_entry(std::size_t i) noexcept
{
    const GuardRecord& record = std::as_const(guards_)[i];
    return record.info.at_entry && enters_mode_ && !counts(record.side, record.info.crossing);
}

template <class X, bool single>
inline void EventEngine<X, single>::enable_guards()
{
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        const bool enabled = system_.enabled_in(i, step_.mode()) && !holds_.is_held(i);
        const GuardRecord& now = std::as_const(guards_)[i];
        const bool enters = enters_mode_ && now.info.at_entry;
        if (enabled == now.enabled && !now.newly_enabled && !enters) continue;
        GuardRecord& record = guards_[i];
        record.newly_enabled = enabled && (enters || !record.enabled);
        if (record.newly_enabled) record.last.t = std::numeric_limits<double>::quiet_NaN();
        record.enabled = enabled;
    }
    guards_.heed_enabled();
    holds_.see_enabled();
}

template <class X, bool single>
inline void EventEngine<X, single>::arm_all()
{
    double widest = 0;
    ++armings_;
    guards_.forget_fired();
    for (const std::size_t i : search_->fired()) {
        guards_[i].fired = true;
        widest = std::max(widest, guards_[i].tolerance);
    }
    search_->fired().clear();
    if (system_->moded || holds_.has_changed()) enable_guards();
    guards_.await_none();
    newly_armed_ = true;
    watching_ = false;
    last_h_ = h_next_;
    guards_.begin_phase(step_.time(0));
    guards_.sample_start(step_, calls(), h_next_);
    guards_.keep_armed_values();
    bool goes_on = true;
    guards_.for_each_to_arm([&](std::size_t i) {
        if (!goes_on) return;
        if (!guards_[i].enabled) {
            guards_.arm(i, Side::plateau);
        } else if (const bool opens = ends_veto(i); opens || single || !guards_.stays_armed(i)) {
            goes_on = arm_one(i, widest, opens);
        }
    });
    first_set_ = false;
    // Guards that the events at the start have moved back are not beyond their surfaces any more.
    if (run_.statistics.armed_beyond > 0 && step_.time(0) == began_at_) forget_armed_beyond();
}

template <class X, bool single>
inline bool EventEngine<X, single>::arm_one(std::size_t i, double widest, bool opens)
{
    GuardRecord& record = guards_[i];
    const double g = guards_.g0(i);
    if (!std::isfinite(g)) {
        end_not_finite("", i);
        return false;
    }
    const Crossing crossing = record.info.crossing;
    const Side before = record.side != Side::plateau ? record.side : record.awaited;
    const Seen seen = see(i, before, widest, opens);
    const Side side = seen.side;
    const life::Cause cause = record.fired || is_recorded_with_set(i) ? life::Cause::fired
                              : record.newly_enabled                  ? life::Cause::enabled
                              : opens                                 ? life::Cause::opened
                                                                      : life::Cause::stood;
    record.departs = seen.on || record.fired || record.newly_enabled;
    guards_.arm(i, side);
    record.examined.from = 0;
    if (side == Side::plateau) {
        guards_.await(i, life::awaited_side(cause, record.info, before));
    }
    if (changed_mode_ && located_ && crossing == Crossing::either && record.fired &&
        record.acting && side == before && side != Side::plateau) {
        ++run_.statistics.either_relays;
        run_.statistics.relay_guard = i;
    }
    // At its own event inside a step the guard was armed on the side that it has left.
    const Side from = record.fired && located_ ? opposite(before) : before;
    const bool asks = record.newly_enabled && fires_at_entry(i);
    const life::Arming arming =
        life::arming_of(cause, facts_of(record, from, seen) | (asks ? life::asks : 0u));
    const bool has_event = arming == life::Arming::fires || arming == life::Arming::by_condition;
    if (has_event && counts_here(i)) {
        have_event(i, arming, before);
    } else if (record.newly_enabled && record.acting && is_beyond(side, crossing)) {
        count_armed_beyond(i, seen.on);
    }
    const bool outside = arming == life::Arming::outside && is_enabled_here(i);
    if (outside) end(Outcome::outside_mode, i);
    return !outside;
}

template <class X, bool single>
inline auto EventEngine<X, single>::see(std::size_t i, Side before, double widest, bool opens)
    -> Seen
{
    GuardRecord& record = guards_[i];
    const double g = guards_.g0(i);
    if (record.fired && record.estimated && std::fabs(g) > record.tolerance) {
        record.tolerance = record.noted.value;
    }
    record.estimated = false;
    const double tolerance =
        record.newly_enabled ? std::max(widest, record.tolerance) : record.tolerance;
    const bool rounded = std::fabs(g) > tolerance && is_flipped_by_rounding(i, before);
    if (rounded || opens) record.tolerance = std::fabs(g);
    if (rounded || opens || std::fabs(g) <= tolerance) {
        const Side head = heading(i);
        return {head, true, is_now_set_off(i, head)};
    }
    if (changed_mode_ && stays_within_rounding(i)) {
        const Side head = heading(i);
        if (is_now_set_off(i, head)) {
            record.tolerance = std::fabs(g);
            return {head, true, true};
        }
    }
    return {side_of(g), false, false};
}

template <class X, bool single>
bool EventEngine<X, single>::ends_veto(std::size_t i)
{
    if (!system_->enabled_at || !leaves_phase_ || !on_time_) return false;
    const GuardRecord& record = std::as_const(guards_)[i];
    if (!record.acting || record.fired || record.newly_enabled || record.info.boolean) return false;
    return record.noted.vetoed && lies_within_rounding(i) && is_enabled_here(i);
}

template <class X, bool single>
bool EventEngine<X, single>::leaves_here(std::size_t i, Side side)
{
    const GuardRecord& record = guards_[i];
    if (!leaves_phase_ || record.newly_enabled || side == Side::plateau) return false;
    const bool either = record.info.crossing == Crossing::either;
    if (record.info.boolean || (either && record.fired)) return false;
    const bool is_member = record.fired && resets_any_ && record.info.resets;
    if (!changed_mode_ && !is_member && !is_set_in_motion(i)) return false;
    const X& left = search_->before();
    if (left.size() != step_.x0().size()) return false;
    const double t = step_.time(0);
    if (!left_known_) {
        assign(left_rate_, left);
        step_.flow_in(mode_before_, t, left, left_rate_);
    }
    left_known_ = true;
    const auto guard = guards_.view(i, step_.mode(), calls());
    const double moved = guard.rate(t, step_.x0(), left_rate_, h_next_);
    // Along the flow that was left it stood, or moved the other way, by more than rounding.
    const double noise =
        tolerances::of_location * std::fabs(guards_.complete_rate0(i, step_, h_next_, calls()));
    if (sign_of(side) * moved > noise) return false;
    if (either && sign_of(side) * moved < -noise) return false;  // a motion that turns back
    if (sign_of(side) * moved >= -noise) {  // a vanishing rate has the sign that it has later
        const double ahead = tolerances::of_heading * h_next_;
        const double then = step_.inside(step_.time(ahead));
        X rate = left_rate_;
        X later = step_.x0();
        if (changed_mode_ || !is_member) {
            // The flow of a mode that has been left is not called any more; nor is one that the set
            // may have changed.
            const double part = left_after_ > 0 ? ahead / left_after_ : 0;
            for_each_component(rate,
                               [&](auto c) { rate[c] += part * (left_rate_[c] - left_start_[c]); });
        } else {
            move(later, left, ahead, left_rate_);
            step_.flow_in(mode_before_, then, later, rate);
        }
        move(later, step_.x0(), ahead, left_rate_);
        const double moves = sign_of(side) * guard.rate(then, later, rate, h_next_);
        if (moves > noise || (either && moves < -noise)) return false;
    }
    return record.fired || std::fabs(guard.value(t, left)) <= rounding_of(i, step_.mode(), t, left);
}

template <class X, bool single>
bool EventEngine<X, single>::is_set_in_motion(std::size_t i)
{
    if (!left_known_) return false;
    if (!on_time_) {
        // A guard that has had its event at this instant does not have it again because a reset of
        // another guard lets its crossing go on.
        const double t = step_.time(0);
        const double ago = std::fabs(t - std::as_const(guards_)[i].last.t);
        if (!stands(i) || ago <= resolution_.blur(t)) return false;
    }
    return !(same_state(search_->before(), step_.x0()) && same_state(left_rate_, step_.rate0()));
}

template <class X, bool single>
bool EventEngine<X, single>::stays_within_rounding(std::size_t i)
{
    const GuardRecord& record = guards_[i];
    if (record.fired || record.newly_enabled || record.info.boolean) return false;
    return lies_within_rounding(i);
}

template <class X, bool single>
inline bool EventEngine<X, single>::is_flipped_by_rounding(std::size_t i, Side before)
{
    const GuardRecord& record = guards_[i];
    const double g = guards_.g0(i);
    if (record.fired || record.newly_enabled || record.info.boolean) return false;
    if (before == Side::plateau || side_of(g) != opposite(before)) return false;
    // If it is farther away, the reset of another guard has carried it across.
    return lies_within_rounding(i);
}

template <class X, bool single>
inline bool EventEngine<X, single>::lies_within_rounding(std::size_t i)
{
    const double g = guards_.g0(i);
    const double rate = system_->bounded ? guards_.complete_rate0(i, step_, h_next_, calls())
                                         : guards_.rate0(i);  // with bounds it may not be known
    const double moves = std::fabs(rate) * (std::fabs(step_.time(0)) + h_next_);
    if (!(std::fabs(g) <=
          tolerances::by_rounding * std::max(guards_.armed_scale(i, h_next_), moves)))
        return false;
    return std::fabs(g) <= rounding_of(i);
}

template <class X, bool single>
inline Side EventEngine<X, single>::heading(std::size_t i)
{
    const bool known = guards_[i].fired && guards_[i].departure.over == h_next_;
    double rate =
        known ? guards_[i].departure.rate : guards_.complete_rate0(i, step_, h_next_, calls());
    if (known) guards_.set_rate0(i, rate);
    guards_[i].departure.over = stale;
    if (!system_->rated) {
        if (guards_[i].fired && guards_[i].departure.turned && guards_[i].intervals.is_low()) {
            rate = guards_[i].departure.rate;
            if (rate == 0) {
                // The guard is too slow for its rate to be known: its reset has sent it back,
                // and its next event comes when it returns to the surface.
                const Side back = guards_[i].last.side;
                guards_.set_rate0(i, sign_of(back) * std::numeric_limits<double>::min());
                return back;
            }
            guards_.set_rate0(i, rate);
        }
    }
    if (guards_[i].info.boolean) return side_of(rate != 0 ? rate : guards_.g0(i));
    if (!std::isfinite(rate)) {
        end_not_finite(all_finite(step_.rate0()) ? "rate" : "flow", i);
        return Side::plateau;
    }
    if (rate != 0 && guards_[i].fired) return side_of(rate);
    // The second derivative has the sign that the rate will have a little later. A rate that it
    // cancels within the rounding of the time counts as zero, as does a rate that is only rounding.
    const double delta = tolerances::of_heading * h_next_;
    const double next = rate_ahead(i, delta, h_next_);
    const double moment = tolerances::of_location * (std::fabs(step_.time(0)) + h_next_);
    double noise = std::fabs(next - rate) * std::min(moment / delta, 0.5);
    if (!system_->rated) {
        if (!guards_[i].fired)
            noise = std::max(noise, rounding_of(i) / (tolerances::of_difference * h_next_));
    }
    if (std::fabs(rate) > noise) return side_of(rate);
    // A guard of the position whose force is zero, too, leaves by its jerk.
    const double later = step_.is_hosts() ? next : rate_ahead(i, delta, h_next_, 2);
    const Side side = std::fabs(later) > noise ? side_of(later) : Side::plateau;
    guards_.set_rate0(i, sign_of(side) * std::numeric_limits<double>::min());
    return side;
}

template <class X, bool single>
inline double EventEngine<X, single>::rate_ahead(std::size_t i, double ahead, double scale,
                                                 int order)
{
    X& later = resets_.after();
    X& rate_later = resets_.scratch();
    assign(later, step_.x0());
    assign(rate_later, step_.x0());
    move(later, step_.x0(), ahead, step_.rate0());
    step_.flow(ahead, later, rate_later);
    if (order == 2) {  // Heun's step
        move(later, step_.x0(), ahead / 2, step_.rate0());
        move(later, later, ahead / 2, rate_later);
        step_.flow(ahead, later, rate_later);
    }
    return guards_.view(i, step_.mode(), calls())
        .rate(step_.inside(step_.time(ahead)), later, rate_later, scale);
}

template <class X, bool single>
inline bool EventEngine<X, single>::may_end() const noexcept
{
    if (options_.max_steps < std::numeric_limits<std::uint64_t>::max()) return true;
    if (options_.cancelled && !setup_.cancels_by_itself) return true;
    if (options_.stop_at_event) return guards_.size() > 0 || timed_;
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        if (guards_[i].info.stop_after > 0) return true;
    }
    return false;
}

template <class X, bool single>
inline void EventEngine<X, single>::refuse_bad_guards()
{
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        GuardRecord& record = guards_[i];
        const GuardInfo& info = record.info;
        record.acting = (resets_any_ && info.resets) || info.stop_after > 0 ||
                        options_.stop_at_event || cuts_at_all_;
        if (info.unilateral && !(resets_any_ && info.resets)) {
            throw_no_reset(who_, i, info.name);
        }
        if (info.unilateral && info.crossing != Crossing::falling) {
            throw_unilateral_not_falling(who_, i, info.name);
        }
        if ((info.at_start || info.at_entry) &&
            (info.unilateral || info.crossing == Crossing::either)) {
            throw_no_condition(who_, i, info.name, info.at_start ? "at_start" : "at_entry",
                               info.unilateral ? "unilateral" : "Crossing::either");
        }
        if (!(info.touch >= 0 && std::isfinite(info.touch))) {
            throw_bad_touch(who_, i, info.name, info.touch);
        }
    }
}

}  // namespace ricochet::detail
