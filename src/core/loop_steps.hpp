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
        if (has_ended()) {
            emit_last_samples();
            return show_next();
        }
        if (phases_) shown_step_ = {now().mode(), now().start().value, now().x0()};
        do {
            advance_one({.to_next_sample = true});
        } while (!has_ended() && is_tentative());
    }
}

template <class X, bool single>
bool Loop<X, single>::show_next()
{
    const auto& samples = result().trajectory.t;
    const auto& events = result().events;
    const bool has_event = shows_events() && shown_records_ < events.size();
    const double t = has_event ? events[shown_records_].t : infinity;
    if (has_event && shown_samples_ == samples.size()) emit_sample_with(t);
    const bool has_sample = shown_samples_ < samples.size();
    const bool together = has_sample && has_event && is_rounding(samples[shown_samples_], t);
    showing_ = Showing::step;
    if (has_event && (together || !has_sample || !lies_before(samples[shown_samples_], t))) {
        while (shown_records_ < events.size() && events[shown_records_].t == t) ++shown_records_;
        if (t != now().start().value) showing_ = Showing::event;
        if (!together) return true;
    }
    if (has_sample) {
        const double at = samples[shown_samples_];
        while (shown_samples_ < samples.size() && samples[shown_samples_] == at) ++shown_samples_;
        showing_ = Showing::sample;
        return true;
    }
    const std::uint64_t count = result().statistics.events;
    const bool at_end_of_step = std::exchange(shown_events_, count) != count && !shows_events();
    if (at_end_of_step) shown_records_ = events.size();
    return at_end_of_step;
}

template <class X, bool single>
inline void Loop<X, single>::run_to_end()
{
    const bool starts = !has_ended() && next_review_ == 0 && now().until(options().t_end) > 0;
    if (starts && !may_take_more_steps()) return;
    while (!has_ended()) {
        if (may_run_quietly() && run_quietly()) continue;
        advance_one({});
    }
}

template <class X, bool single>
inline Run<X> Loop<X, single>::finish()
{
    if (!has_ended()) {
        result().outcome = Outcome::cancelled;
        result().reaction.clear();
    }
    engine_.end(result().outcome, result().guard);
    over_ = true;
    showing_ = Showing::step;
    bring_up_to_date();
    return std::move(result());
}

template <class X, bool single>
inline const Run<X>& Loop<X, single>::bring_up_to_date()
{
    result().t = now().start().value;
    result().x = now().x0();
    result().mode = engine_.shown(now().mode());
    engine_.bring_up_to_date();
    if (phases_ && phases_->complete) phases_->complete(system().adapter(), result());
    if (has_ended()) {
        if (next_sample_ < options().sample_times.size()) emit_last_samples();
        record_restart();
    }
    return result();
}

template <class X, bool single>
inline void Loop<X, single>::advance_from_here(const Advance& how)
{
    const double remaining = now().until(options().t_end);
    // When the time has reached the end, only a time event can still be due.
    const bool arrived = now().start().value == options().t_end &&
                         !(timed_ && now().until(time_event()) <= remaining);
    if (arrived || !(remaining > 0)) return reach_end();
    if (result().statistics.steps >= next_review_ && !may_take_more_steps()) return;
    if (options().cancelled && options().cancelled->load(std::memory_order_relaxed)) {
        if (is_tentative()) take_back();
        return engine_.end(Outcome::cancelled);
    }
    if (defers_) now().keep_rate();
    if (!engine_.holds().empty()) return advance_held(remaining);
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
    if (result().statistics.steps >= options().max_steps) {
        engine_.end(Outcome::step_limit);
    } else if (!is_first && !is_tentative() && stands_still()) {
        engine_.end(Outcome::stalled);
    }
    renew(stall_review_, options().stall_steps, is_first);
    // No more sets than steps.
    renew(set_review_, options().stall_steps > 0 ? instants_to_stall() : 0, is_first);
    renew(pace_review_, pace_steps(), is_first);
    next_review_ = std::min({stall_review_.due, set_review_.due, pace_review_.due});
    return !has_ended();
}

template <class X, bool single>
void Loop<X, single>::renew(Review& review, std::uint64_t stride, bool is_first) noexcept
{
    const Statistics& counts = result().statistics;
    if (!is_first && counts.steps < review.due) return;
    const bool fits = stride > 0 && options().max_steps - counts.steps > stride;
    review = {.due = fits ? counts.steps + stride : options().max_steps,
              .steps = counts.steps,
              .events = counts.events,
              .instants = engine_.instants(),
              .t = now().start().value};
}

template <class X, bool single>
inline void Loop<X, single>::reach_end()
{
    const bool plans = defers_ && !engine_.newly_armed() && !engine_.holds().rests();
    if (plans && engine_.check_last()) return;
    // A run without an end that reaches the largest double has not reached an end.
    engine_.end(engine_.is_endless() ? Outcome::stalled : Outcome::reached_end);
}

template <class X, bool single>
inline void Loop<X, single>::accept()
{
    const double end = now().time(now().h());
    emit_samples(now().h(), engine_.ends_at().time_event ? before_rounding(end) : end);
    record_step(now().h());
    if (is_last_) {
        now().accept_at(options().t_end);
    } else if (engine_.ends_at().time_event) {
        now().accept_at(time_event());
    } else {
        now().accept();
    }
    engine_.last_h() = now().h();
    ++result().statistics.steps;
}

template <class X, bool single>
inline bool Loop<X, single>::take_step(double remaining)
{
    const double wanted = now().knows_reach() ? length_within_reach() : h_next();
    double longest = remaining;
    engine_.ends_at().time_event = false;
    if (timed_) {
        const double ahead = now().until(time_event());
        if (ahead <= remaining) {
            longest = ahead;
            // A remainder of a millionth of a step is rounding, not a step.
            engine_.ends_at().time_event = wanted * (1 + tolerances::of_remainder) >= longest;
        }
    }
    const bool to_the_end = wanted * (1 + tolerances::of_remainder) >= longest;
    is_last_ = to_the_end && longest == remaining;
    const double h = to_the_end ? longest : wanted;
    now().pin(to_the_end ? h : std::numeric_limits<double>::quiet_NaN(),
              is_last_ ? options().t_end : time_event());
    const bool taken = error_controlled_ ? take_controlled_step(h, h_next()) : take_fixed_step(h);
    note_change();
    return taken;
}

template <class X, bool single>
double Loop<X, single>::length_within_reach()
{
    // Fixed steps end early at a change alone.
    if (!error_controlled_ && !now().locates_changes()) return h_next();
    // The length has a lower limit: a step that cannot be taken at that length is rejected by its
    // error.
    const double reach =
        std::max(now().reach(h_next(), options().rtol, options().atol), smallest_step());
    if (error_controlled_) h_next() = std::min(h_next(), reach);
    return std::min(h_next(), reach);
}

template <class X, bool single>
inline bool Loop<X, single>::take_fixed_step(double h, bool failed)
{
    for (;;) {
        if (!std::exchange(failed, false)) {
            const bool taken = now().attempt(h);
            if (jumps_at_end() ? now().attempt(h) : taken) return true;
        }
        const double ahead = time_to_surface().ahead;
        if (!(ahead <= h)) break;
        if (ahead < smallest_step()) {
            if (happen_where_flow_ends(h)) return false;
            break;
        }
        end_early();
        h = 0.9 * ahead;
    }
    end_step(Outcome::non_finite);
    return false;
}

template <class X, bool single>
inline bool Loop<X, single>::retry(double h, double proposed, double largest, double error)
{
    const int order = now().error_order() + 1;
    for (;;) {
        const bool accepts = rule_.accepts(error);
        // The steps of a guard with bounds must not depend on whether it is examined.
        const bool rough = accepts && system()->bounded && is_rough(h);
        if (rough) {
            h *= 0.1;
        } else if (accepts) {
            const double next = h * std::min(largest, rule_.factor(error, order));
            const bool cut = largest > 1 && h < proposed;
            h_next() = std::min(cut ? std::max(next, proposed) : next, options().h_max);
            return true;
        }
        ++result().statistics.rejected;
        const bool finite = std::isfinite(error);
        // The interval is rolled back, and its steps are checked one by one: then the surface
        // decides how the step is shortened.
        if (!finite && is_tentative()) {
            end_step(Outcome::non_finite);
            return false;
        }
        if (!rough) h = finite ? h * rule_.factor(error, order) : shorten_to_surface(h);
        is_last_ = false;
        engine_.ends_at().time_event = false;
        largest = 1;
        if (h < smallest_step()) {
            if (happen_where_flow_ends(h)) return false;
            end_step(finite ? Outcome::step_underflow : Outcome::non_finite);
            return false;
        }
        error = now().attempt(h, options().rtol, options().atol);
    }
}

template <class X, bool single>
inline auto Loop<X, single>::time_to_surface() -> typename Engine::Approach
{
    if (is_tentative()) return {};
    if (defers_) engine_.watch_all();
    return engine_.first_approach();
}

template <class X, bool single>
inline bool Loop<X, single>::happen_where_flow_ends(double h)
{
    if (is_tentative()) return false;
    mark_everything();
    const auto approach = time_to_surface();
    const bool is_near = approach.ahead <= 16 * std::max(h, smallest_step());
    if (!is_near || !engine_.fire_here(approach.guard)) return false;
    settle_and_record();
    return true;
}

template <class X, bool single>
void Loop<X, single>::advance_held(double remaining)
{
    if (engine_.holds().rests()) return hold(remaining);
    if (defers_) engine_.watch_all();  // bounds hold for the flow, not for what a rest leaves of it
    mark_everything();
    if (!take_step(remaining) || !shorten_to_release()) return;
    if (handle_events()) return;
    ends_at_release() ? pass_to_release() : pass();
}

template <class X, bool single>
bool Loop<X, single>::shorten_to_release()
{
    const double h = now().h();
    const auto release = engine_.holds().first_release(h, [&](double s, X& x) {
        s == 0 ? assign(x, now().x0()) : s == h ? assign(x, now().x1()) : now().interpolate(s, x);
    });
    release_at_ = infinity;
    // Steps are limited so that the lift deviates from a straight line by about a sixteenth of its
    // size.
    constexpr double most = 1.0 / 16;
    if (error_controlled_ && release.bend > 0) {
        const double factor = std::max(0.5, std::sqrt(most / release.bend));
        h_next() = std::min(h_next(), h * factor);
    }
    if (release.hold == no_guard) {
        const std::size_t left = engine_.holds().guard_left_at(now().time(h), now().x1());
        if (left != no_guard) engine_.end(Outcome::zeno, left);
        return !has_ended();
    }
    if (release.at < h) {
        end_early();
        if (!now().attempt(release.at)) {
            end_step(Outcome::non_finite);
            return false;
        }
    }
    // A time event comes first, and holds are released after it.
    if (!engine_.ends_at().time_event) {
        release_at_ = now().h();
        released_ = release.hold;
    }
    return true;
}

template <class X, bool single>
void Loop<X, single>::pass_to_release()
{
    accept();
    release_at_ = infinity;
    limit_next_step(now().start().value);
    engine_.release_here(released_);
    if (error_controlled_ && options().step == 0 && now().until(options().t_end) > 0) {
        h_next() = std::min(h_next(), initial_step(now(), options(), now().until(options().t_end)));
    }
    settle_and_record();
}

template <class X, bool single>
inline void Loop<X, single>::hold(double remaining)
{
    mark_everything();
    double until = options().t_end;
    engine_.ends_at().time_event = false;
    if (timed_) {
        engine_.ends_at().time_event = now().until(time_event()) <= remaining;
        if (engine_.ends_at().time_event) until = time_event();
    }
    emit_held_samples(engine_.ends_at().time_event ? before_rounding(until) : until);
    if (options().record_steps) record_place(now().until(until));
    now().hold(until);
    if (engine_.ends_at().time_event) {
        now().refresh();
        engine_.apply_time_event();
        settle_and_record();
    }
}

}  // namespace ricochet::detail
