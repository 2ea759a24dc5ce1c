// Accumulating events, and the motion after them.
#pragma once

#include "core/engine.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool EventEngine<X, single>::rest_fired()
{
    bool rested = false;
    const bool in_row = guards_.keeps_rows() && prolongs_row();
    for (const std::size_t i : search_->fired()) {
        ShrinkingIntervals& intervals = guards_[i].intervals;
        const bool again = std::exchange(guards_[i].again, false);
        bool stalls = intervals.stalls(step_.start(), h_next_);
        if (stalls && comes_from_afar(i)) {
            stalls = false;
            intervals.forget_stall();
        }
        stalls = stalls || again;
        const double tolerance = resolution_.tolerance(step_.start().value);
        const bool resetting = resets_any_ && guards_[i].info.resets;
        if (resetting && located_) {
            const Location& where = search_->where(i);
            intervals.blame(std::isfinite(where.error) ? where.error : where.hi - where.lo);
        }
        if (stalls || (resetting && (fades(i) || intervals.accumulate(tolerance)))) {
            come_to_rest(i, stalls ? 0 : intervals.remainder(), intervals.error());
            rested = true;
        } else if (in_row && guards_.row().ends_with(guards_[i].excursions)) {
            come_to_rest(i, 0, intervals.error());
            rested = true;
        }
    }
    if (rested && !ended_) pending_ = Pending::arm;
    return rested;
}

template <class X, bool single>
bool EventEngine<X, single>::comes_from_afar(std::size_t i)
{
    const bool on_time = timed_ && time_events_.was_at(step_.start().value);
    if (located_ || !guards_.keeps_armed() || (sets_.level() <= 1 && !on_time)) return false;
    if (std::as_const(guards_)[i].excursions.has_fallen()) return false;
    return std::fabs(guards_.armed_value(i)) > tolerances::of_fading * rounding_of(i);
}

template <class X, bool single>
bool EventEngine<X, single>::prolongs_row()
{
    if (!located_) return prolongs_row_at_instant();
    LostRow& row = guards_.row();
    const bool soon = row.follows_soon(step_.start());
    bool falls = soon && !on_time_ && !search_->fired().empty();
    for (const std::size_t i : search_->fired()) falls &= this->falls(i, soon);
    if (!falls) {
        row.clear();
        return false;
    }
    for (const std::size_t i : search_->fired()) row.add(guards_[i].excursions);
    return true;
}

template <class X, bool single>
bool EventEngine<X, single>::prolongs_row_at_instant()
{
    LostRow& row = guards_.row();
    if (row.is_empty() || on_time_) return false;
    for (const std::size_t i : search_->fired()) {
        const Excursions& excursions = std::as_const(guards_)[i].excursions;
        // A guard that a reset has carried across its surface has had no excursion to lose.
        const bool stood = std::fabs(guards_.armed_value(i)) <= excursions.rounding();
        const bool has_had_some = excursions.has_fallen() && std::isfinite(excursions.end());
        if (!has_excursions(i) || !has_had_some || !stood) return false;
    }
    for (const std::size_t i : search_->fired()) {
        guards_[i].excursions.vanish(step_.start().value);
        row.add(guards_[i].excursions);
    }
    return !search_->fired().empty();
}

template <class X, bool single>
bool EventEngine<X, single>::falls(std::size_t i, bool soon)
{
    GuardRecord& record = guards_[i];
    if (!has_excursions(i)) return false;
    Excursions& excursions = record.excursions;
    const double interval = guards_.row().interval();
    if (!soon) {
        excursions.pass(size_of_excursion(i, search_->where(i).slope, interval));
        return false;
    }
    if (excursions.wants_rounding(size_of_excursion(i, search_->where(i).slope, interval))) {
        excursions.set_rounding(record.noted.rounding);
    } else {
        excursions.keep_rounding();
    }
    const double size = size_of_excursion(i, record.noted.slope, interval);
    const bool falls = excursions.fall(size);
    const double t = step_.start().value;
    excursions.loss().see(t, interval, size, record.noted.rounding);
    excursions.end(t, record.noted.slope);
    return falls;
}

template <class X, bool single>
void EventEngine<X, single>::note_excursions()
{
    const Instant at = on_time_ ? Instant{time_event(), 0} : Instant{set_time_, set_remainder_};
    if (!guards_.row().would_follow_soon(at)) return;
    const X& x = search_->before();
    const double interval = guards_.row().interval_to(at);
    for (const std::size_t i : search_->fired()) {
        if (!has_excursions(i)) continue;
        GuardRecord& record = guards_[i];
        double& slope = record.noted.slope = search_->where(i).slope;
        const double size = size_of_excursion(i, slope, interval);
        Excursions& excursions = record.excursions;
        const bool wants = excursions.wants_rounding(size);
        // The rounding of a single guard may depend on the mode.
        const bool known = wants || single;
        record.noted.rounding = known ? rounding_of(i, step_.mode(), at.value, x) : stale;
        const double rounding = wants ? record.noted.rounding : excursions.rounding();
        // A slow guard is differenced over a longer time: over a part of a step it moves by its
        // rounding.
        if (size > tolerances::of_drift * rounding || system_->rated || !system_->flow) continue;
        X rate = x;
        step_.flow_in(step_.mode(), at.value, x, rate);
        const double scale = tolerances::per_difference * low_part * interval;
        slope = guards_.view(i, step_.mode(), calls()).rate(at.value, x, rate, scale);
    }
}

template <class X, bool single>
inline double EventEngine<X, single>::size_of_excursion(std::size_t i, double slope,
                                                        double interval) const noexcept
{
    return std::fmax(std::fabs(guards_.armed_value(i)), std::fabs(slope) * interval / 4);
}

template <class X, bool single>
inline bool EventEngine<X, single>::fades(std::size_t i)
{
    GuardRecord& record = guards_[i];
    record.departure.turned = false;
    record.departure.over = stale;
    record.intervals.depart(infinity, false);
    if (record.info.boolean || !system_.enabled_in(i, step_.mode())) {
        return false;
    }
    double rate = departure(i, h_next_);
    const bool low = record.intervals.is_low_at(rate);
    const double rounding = low ? rounding_of(i) : 0;
    bool jump_lost = false;
    if (low) {
        const double away = distance_put_back(i);
        // A crossing so soon after this one would be taken for its repetition.
        const double soon = 2 * std::fabs(rate) * resolution_.window(step_.start().value);
        jump_lost = record.intervals.jump_is_lost(away, std::max(rounding, soon));
        // A guard farther away than an error of location explains does not fade, whether it rises
        // or falls. An event without a location may be due to the reset of another guard, which has
        // carried this one across its surface.
        const double beyond = located_ ? -away - 2 * record.tolerance : -away;
        if (std::max(away, beyond) > tolerances::of_fading * rounding) {
            record.departure.turned = away > 0;
            return false;
        }
    } else {
        record.intervals.forget_jumps();
    }
    // Excursions are not lost in rounding where the guard came from far away, for example from
    // where a time event had put it.
    const bool came_far = low && std::fabs(guards_.g0(i)) > tolerances::of_fading * rounding;
    bool lost = false;
    if (!system_->rated) {
        if (low) {
            double part = tolerances::of_difference * h_next_;
            if (std::fabs(rate) * part <= rounding) {
                part = std::max(part, low_part * record.intervals.interval());
                rate = departure(i, tolerances::per_difference * part);
            }
            // A difference of a unit in the last place does not determine the direction.
            lost = std::fabs(rate) * part <= rounding / 8;
            // The guard stays where its reset has put it: its rate is lost in rounding, and remains
            // so a short time later.
            if (lost && came_far && !jump_lost &&
                std::fabs(rate_ahead(i, part, tolerances::per_difference * part)) * part <=
                    rounding / 8) {
                return false;
            }
            if (lost) rate = 0;
        }
    }
    record.departure.rate = rate;
    record.departure.over = low ? stale : h_next_;
    record.departure.turned = lost || sign_of(record.last.side) * rate > 0;
    if (record.departure.turned) record.intervals.depart(rate, low);
    if (jump_lost && located_ && (lost || !record.departure.turned)) return true;
    return low && !came_far && record.intervals.fades(rounding);
}

template <class X, bool single>
std::size_t EventEngine<X, single>::other_of_cycle(std::size_t i)
{
    std::size_t other = no_guard;
    if (!guards_.keeps_rows()) return other;
    double last = 2 * guards_[i].intervals.interval();
    for (std::size_t k = 0; k < guards_.size(); ++k) {
        const double ago =
            std::fabs(step_.start().value - std::as_const(guards_)[k].excursions.end());
        if (k == i || !(ago <= last)) continue;
        last = ago;
        other = k;
    }
    return other;
}

template <class X, bool single>
inline std::size_t EventEngine<X, single>::resting_of_cycle(std::size_t i)
{
    if (!system_->rest) return no_guard;
    if (!system_->rests) return i;
    const std::size_t other = other_of_cycle(i);
    if (system_->rests(system_.adapter(), i, other)) return i;
    const bool rests = other != no_guard && system_->rests(system_.adapter(), other, i);
    return rests ? other : no_guard;
}

template <class X, bool single>
double EventEngine<X, single>::error_by_rounding(double round)
{
    double error = 0;
    const double t = step_.start().value;
    for (std::size_t i = 0; i < guards_.size(); ++i) {
        const Excursions& excursions = std::as_const(guards_)[i].excursions;
        if (std::fabs(t - excursions.end()) <= 2 * round) error += excursions.error(t);
    }
    return error;
}

template <class X, bool single>
inline double EventEngine<X, single>::distance_put_back(std::size_t i)
{
    const double g = guards_.view(i, step_.mode(), calls()).value(step_.time(0), step_.x0());
    return sign_of(guards_[i].last.side) * g;
}

template <class X, bool single>
inline void EventEngine<X, single>::come_to_rest(std::size_t i, double ahead, double error)
{
    const std::size_t resting = resting_of_cycle(i);
    if (resting == no_guard || is_of_phases(i) || guards_[i].intervals.outlast_rest()) {
        end(Outcome::zeno, i);
        run_.other_guard = other_of_cycle(i);
        return;
    }
    if (ended_) return;
    if (resting != i) guards_[std::exchange(i, resting)].intervals.come_to_rest();
    const X before = step_.x0();
    const Mode mode = step_.mode();
    ahead = std::min(ahead, step_.until(options_.t_end));
    if (timed_) ahead = std::min(ahead, step_.until(time_event()));
    // The rest of the state stands still while the time jumps to the limit of the events: a moving
    // floor would separate from the other bodies, or pass through them.
    if (guards_.size() > 1 && ahead > tolerances::of_time * std::fabs(step_.start().value)) {
        error += std::exchange(ahead, 0);
    }
    if (guards_.keeps_rows()) error += error_by_rounding(guards_[i].intervals.interval());
    const double t = step_.time(ahead);
    X after = before;
    const Mode mode_after = system_->rest(system_.adapter(), i, mode, t, after);
    ++run_.statistics.events;
    record({.t = t,
            .kind = EventKind::accumulation,
            .guard = i,
            .mode_before = mode,
            .mode_after = mode_after,
            .before = before,
            .after = after,
            .bracket = {step_.time(0), t},
            .slope = 0,
            .error = error});
    const std::size_t modes = system_.modes();
    if (modes > 0 && mode_after >= modes) return end(Outcome::unknown_mode, i);
    if (!fits_dimension(before, after, mode_after == mode)) {
        return end(Outcome::wrong_dimension, i);
    }
    if (!all_finite(after)) {
        return end_not_finite("rest", i);
    }
    leaves_phase_ = false;
    enters_mode_ = shown(mode_after) != shown(mode);
    if (!holds_.empty()) holds_.release_changed(before, after, enters_mode_);
    step_.restart(ahead, 0, after, mode_after);
    start_beyond_time_event();
    for (const std::size_t k : search_->fired()) {
        guards_[k].departure.over = stale;
    }
    guards_[i].intervals.come_to_rest();
    guards_.row().clear();
    const double tolerance = std::exchange(guards_[i].tolerance, 0);
    if (!enters_mode_) holds_.add({i, tolerance, ahead});
}

template <class X, bool single>
bool EventEngine<X, single>::release_lifted()
{
    const std::size_t k = holds_.lifted();
    if (k != no_guard) release_here(k);
    return k != no_guard;
}

template <class X, bool single>
void EventEngine<X, single>::release_here(std::size_t k)
{
    const double t = step_.time(0);
    ++run_.statistics.events;
    record({.t = t,
            .kind = EventKind::mode,
            .guard = holds_.guard(k),
            .mode_before = step_.mode(),
            .mode_after = step_.mode(),
            .before = step_.x0(),
            .after = step_.x0(),
            .bracket = {t, t},
            .slope = 0});
    guards_.take_tolerances();
    holds_.release(k);
    leaves_phase_ = changed_mode_ = enters_mode_ = false;
    if (!step_.is_of_host()) step_.refresh();
    search_->fired().clear();
    pending_ = Pending::arm_released;
}

}  // namespace ricochet::detail
