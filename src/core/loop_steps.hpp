// Steps of the loop: their lengths, and the handling of steps that cannot be taken.
#pragma once

#include "core/loop.hpp"
#include "core/tolerances.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool Loop<X, single>::advance()
{
    for (;;) {
        if (show_next()) return true;
        if (ended_) {
            emit_last_samples();
            return show_next();
        }
        if (phases_) shown_step_ = {step_.mode(), step_.start().value, step_.x0()};
        do {
            advance_one({.to_next_sample = true});
        } while (!ended_ && is_tentative());
    }
}

template <class X, bool single>
bool Loop<X, single>::show_next()
{
    const auto& samples = run_.trajectory.t;
    const auto& events = run_.events;
    const bool has_event = shows_events() && shown_records_ < events.size();
    const double t = has_event ? events[shown_records_].t : infinity;
    if (has_event && shown_samples_ == samples.size()) emit_sample_with(t);
    const bool has_sample = shown_samples_ < samples.size();
    const bool together = has_sample && has_event && is_rounding(samples[shown_samples_], t);
    showing_ = Showing::step;
    if (has_event && (together || !has_sample || !lies_before(samples[shown_samples_], t))) {
        while (shown_records_ < events.size() && events[shown_records_].t == t) ++shown_records_;
        if (t != step_.start().value) showing_ = Showing::event;
        if (!together) return true;
    }
    if (has_sample) {
        const double at = samples[shown_samples_];
        while (shown_samples_ < samples.size() && samples[shown_samples_] == at) ++shown_samples_;
        showing_ = Showing::sample;
        return true;
    }
    const std::uint64_t count = run_.statistics.events;
    const bool at_end_of_step = std::exchange(shown_events_, count) != count && !shows_events();
    if (at_end_of_step) shown_records_ = events.size();
    return at_end_of_step;
}

template <class X, bool single>
inline void Loop<X, single>::run_to_end()
{
    const bool starts = !ended_ && next_review_ == 0 && step_.until(options_.t_end) > 0;
    if (starts && !may_take_more_steps()) return;
    while (!ended_) {
        if (may_run_quietly() && run_quietly()) continue;
        advance_one({});
    }
}

template <class X, bool single>
inline Run<X> Loop<X, single>::finish()
{
    if (!ended_) {
        run_.outcome = Outcome::cancelled;
        run_.reaction.clear();
    }
    ended_ = over_ = true;
    showing_ = Showing::step;
    bring_up_to_date();
    return std::move(run_);
}

template <class X, bool single>
inline const Run<X>& Loop<X, single>::bring_up_to_date()
{
    run_.t = step_.start().value;
    run_.x = step_.x0();
    run_.mode = this->shown(step_.mode());
    this->collect_counts();
    this->list_armed_beyond();
    if (phases_ && phases_->complete) phases_->complete(system_.adapter(), run_);
    if (ended_) {
        if (next_sample_ < options_.sample_times.size()) emit_last_samples();
        record_restart();
    }
    return run_;
}

template <class X, bool single>
inline void Loop<X, single>::advance_from_here(const Advance& how)
{
    const double remaining = step_.until(options_.t_end);
    // When the time has reached the end, only a time event can still be due.
    const bool arrived = step_.start().value == options_.t_end &&
                         !(timed_ && step_.until(time_event()) <= remaining);
    if (arrived || !(remaining > 0)) return reach_end();
    if (run_.statistics.steps >= next_review_ && !may_take_more_steps()) return;
    if (options_.cancelled && options_.cancelled->load(std::memory_order_relaxed)) {
        if (is_tentative()) take_back();
        return end(Outcome::cancelled);
    }
    if (defers_) step_.keep_rate();
    if (!holds_.empty()) return advance_held(remaining);
    if (defers_) return advance_by_plan(remaining, how);
    if (!take_step(remaining)) return;
    mark_what_lasts();
    if (guarded_ && handle_events()) return;
    pass();
}

template <class X, bool single>
bool Loop<X, single>::may_take_more_steps()
{
    const bool is_first = next_review_ == 0;
    if (run_.statistics.steps >= options_.max_steps) {
        end(Outcome::step_limit);
    } else if (!is_first && !is_tentative() && stands_still()) {
        end(Outcome::stalled);
    }
    renew(stall_review_, options_.stall_steps, is_first);
    // No more sets than steps.
    renew(set_review_, options_.stall_steps > 0 ? instants_to_stall() : 0, is_first);
    renew(pace_review_, pace_steps(), is_first);
    next_review_ = std::min({stall_review_.due, set_review_.due, pace_review_.due});
    return !ended_;
}

template <class X, bool single>
void Loop<X, single>::renew(Review& review, std::uint64_t stride, bool is_first) noexcept
{
    const Statistics& counts = run_.statistics;
    if (!is_first && counts.steps < review.due) return;
    const bool fits = stride > 0 && options_.max_steps - counts.steps > stride;
    review = {.due = fits ? counts.steps + stride : options_.max_steps,
              .steps = counts.steps,
              .events = counts.events,
              .instants = this->sets_.instants(),
              .t = step_.start().value};
}

template <class X, bool single>
inline void Loop<X, single>::reach_end()
{
    if (defers_ && !newly_armed_ && !holds_.rests()) {
        planner_->check_last(step_, guards_, run_.statistics);
        if (planner_->wrong()) return this->name_wrong_bound();
    }
    // A run without an end that reaches the largest double has not reached an end.
    end(endless_ ? Outcome::stalled : Outcome::reached_end);
}

template <class X, bool single>
inline void Loop<X, single>::accept()
{
    const double end = step_.time(step_.h());
    emit_samples(step_.h(), time_event_due_ ? before_rounding(end) : end);
    record_step(step_.h());
    if (is_last_) {
        step_.accept_at(options_.t_end);
    } else if (time_event_due_) {
        step_.accept_at(time_event());
    } else {
        step_.accept();
    }
    last_h_ = step_.h();
    ++run_.statistics.steps;
}

template <class X, bool single>
inline bool Loop<X, single>::take_step(double remaining)
{
    const double wanted = step_.knows_reach() ? length_within_reach() : h_next_;
    double longest = remaining;
    time_event_due_ = false;
    if (timed_) {
        const double ahead = step_.until(time_event());
        if (ahead <= remaining) {
            longest = ahead;
            // A remainder of a millionth of a step is rounding, not a step.
            time_event_due_ = wanted * (1 + tolerances::of_remainder) >= longest;
        }
    }
    const bool to_the_end = wanted * (1 + tolerances::of_remainder) >= longest;
    is_last_ = to_the_end && longest == remaining;
    const double h = to_the_end ? longest : wanted;
    step_.pin(to_the_end ? h : std::numeric_limits<double>::quiet_NaN(),
              is_last_ ? options_.t_end : time_event());
    const bool taken = error_controlled_ ? take_controlled_step(h, h_next_) : take_fixed_step(h);
    note_change();
    return taken;
}

template <class X, bool single>
double Loop<X, single>::length_within_reach()
{
    // Fixed steps end early at a change alone.
    if (!error_controlled_ && !step_.locates_changes()) return h_next_;
    // The length has a lower limit: a step that cannot be taken at that length is rejected by its
    // error.
    const double reach =
        std::max(step_.reach(h_next_, options_.rtol, options_.atol), smallest_step());
    if (error_controlled_) h_next_ = std::min(h_next_, reach);
    return std::min(h_next_, reach);
}

template <class X, bool single>
inline bool Loop<X, single>::take_fixed_step(double h, bool failed)
{
    for (;;) {
        if (!std::exchange(failed, false)) {
            const bool taken = step_.attempt(h);
            if (jumps_at_end() ? step_.attempt(h) : taken) return true;
        }
        const double ahead = time_to_surface().ahead;
        if (!(ahead <= h)) break;
        if (ahead < smallest_step()) {
            if (happen_where_flow_ends(h)) return false;
            break;
        }
        is_last_ = time_event_due_ = false;
        h = 0.9 * ahead;
    }
    end_step(Outcome::non_finite);
    return false;
}

template <class X, bool single>
inline bool Loop<X, single>::retry(double h, double proposed, double largest, double error)
{
    const int order = step_.error_order() + 1;
    for (;;) {
        const bool accepts = rule_.accepts(error);
        // The steps of a guard with bounds must not depend on whether it is examined.
        const bool rough = accepts && system_->bounded && is_rough(h);
        if (rough) {
            h *= 0.1;
        } else if (accepts) {
            const double next = h * std::min(largest, rule_.factor(error, order));
            const bool cut = largest > 1 && h < proposed;
            h_next_ = std::min(cut ? std::max(next, proposed) : next, options_.h_max);
            return true;
        }
        ++run_.statistics.rejected;
        const bool finite = std::isfinite(error);
        // The interval is rolled back, and its steps are checked one by one: then the surface
        // decides how the step is shortened.
        if (!finite && is_tentative()) {
            end_step(Outcome::non_finite);
            return false;
        }
        if (!rough) h = finite ? h * rule_.factor(error, order) : shorten_to_surface(h);
        is_last_ = false;
        time_event_due_ = false;
        largest = 1;
        if (h < smallest_step()) {
            if (happen_where_flow_ends(h)) return false;
            end_step(finite ? Outcome::step_underflow : Outcome::non_finite);
            return false;
        }
        error = step_.attempt(h, options_.rtol, options_.atol);
    }
}

template <class X, bool single>
inline auto Loop<X, single>::time_to_surface() -> Approach
{
    Approach first;
    if (is_tentative()) return first;
    if (defers_) this->watch_all();
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
inline double Loop<X, single>::approach_rate(std::size_t i)
{
    double rate = guards_.complete_rate0(i, step_, h_next_, calls());
    if (!system_->rated) {
        // Over a short step the rounding of the state may swallow the difference.
        double scale = h_next_;
        for (int k = 0; rate == 0 && k < 12; ++k) rate = this->departure(i, scale *= 16);
    }
    return rate;
}

template <class X, bool single>
inline bool Loop<X, single>::happen_where_flow_ends(double h)
{
    if (is_tentative()) return false;
    mark_everything();
    const Approach approach = time_to_surface();
    const std::size_t i = approach.guard;
    if (!(approach.ahead <= 16 * std::max(h, smallest_step())) || !this->counts_here(i))
        return false;
    if (!guards_[i].acting) {
        this->record_jump(i, guards_[i].side);
        return false;
    }
    this->begin_set();
    guards_[i].tolerance = std::fabs(guards_.g0(i));
    search_.fired().clear();
    search_.fired().push_back(i);
    settle_and_record();
    return true;
}

template <class X, bool single>
void Loop<X, single>::advance_held(double remaining)
{
    if (holds_.rests()) return hold(remaining);
    if (defers_) this->watch_all();  // bounds hold for the flow, not for what a rest leaves of it
    mark_everything();
    if (!take_step(remaining) || !shorten_to_release()) return;
    if (handle_events()) return;
    ends_at_release() ? pass_to_release() : pass();
}

template <class X, bool single>
bool Loop<X, single>::shorten_to_release()
{
    const double h = step_.h();
    const auto release = holds_.first_release(h, [&](double s, X& x) {
        s == 0 ? assign(x, step_.x0()) : s == h ? assign(x, step_.x1()) : step_.interpolate(s, x);
    });
    release_at_ = infinity;
    // Steps are limited so that the lift deviates from a straight line by about a sixteenth of its
    // size.
    constexpr double most = 1.0 / 16;
    if (error_controlled_ && release.bend > 0) {
        const double factor = std::max(0.5, std::sqrt(most / release.bend));
        h_next_ = std::min(h_next_, h * factor);
    }
    if (release.hold == no_guard) {
        const std::size_t left = holds_.guard_left_at(step_.time(h), step_.x1());
        if (left != no_guard) end(Outcome::zeno, left);
        return !ended_;
    }
    if (release.at < h) {
        is_last_ = time_event_due_ = false;
        if (!step_.attempt(release.at)) {
            end_step(Outcome::non_finite);
            return false;
        }
    }
    if (!time_event_due_) {  // a time event comes first, and holds are released after it
        release_at_ = step_.h();
        released_ = release.hold;
    }
    return true;
}

template <class X, bool single>
void Loop<X, single>::pass_to_release()
{
    accept();
    release_at_ = infinity;
    limit_next_step(step_.start().value);
    this->release_here(released_);
    if (error_controlled_ && options_.step == 0 && step_.until(options_.t_end) > 0) {
        h_next_ = std::min(h_next_, initial_step(step_, options_, step_.until(options_.t_end)));
    }
    settle_and_record();
}

template <class X, bool single>
inline void Loop<X, single>::hold(double remaining)
{
    mark_everything();
    double until = options_.t_end;
    time_event_due_ = false;
    if (timed_) {
        time_event_due_ = step_.until(time_event()) <= remaining;
        if (time_event_due_) until = time_event();
    }
    emit_held_samples(time_event_due_ ? before_rounding(until) : until);
    if (options_.record_steps) record_place(step_.until(until));
    step_.hold(until);
    if (time_event_due_) {
        step_.refresh();
        this->apply_time_event();
        settle_and_record();
    }
}

}  // namespace ricochet::detail
