// Events in the steps of the loop.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool Loop<X, single>::handle_events()
{
    bool cleared = false;
    return this->deserves_search(cleared) && search(cleared);
}

template <class X, bool single>
bool Loop<X, single>::search(bool cleared)
{
    mark_everything();
    if (guards_.first_not_finite() != no_guard) {
        if (!return_to_domain()) return true;
        if (!this->any_suspicious()) {
            this->pass_on_clear();
            return false;
        }
    }
    if (error_controlled_ && step_.may_be_rough() && !smooth_step()) return true;
    const auto find = [&](bool clears) {
        return this->find(clears, [&] { show_before_resets(); });
    };
    bool found = find(cleared);
    if (!found && this->before_window_ > 0) {
        stop_before_window();
        if (!this->any_suspicious()) {
            this->pass_on_clear();
            return false;
        }
        found = find(false);
    }
    if (!found) return ended_;
    const double t = on_time_ ? time_event() : this->time_of_set();
    record_step_to_set(search_.at(), t);
    limit_next_step(t);
    this->cut_short();
    settle_and_record();
    return true;
}

template <class X, bool single>
void Loop<X, single>::stop_before_window()
{
    is_last_ = time_event_due_ = false;
    step_.attempt(std::exchange(this->before_window_, 0));
    note_change();
    this->sample_end();
}

template <class X, bool single>
inline void Loop<X, single>::show_before_resets()
{
    if (options_.record_steps) static_cast<void>(step_.dense());
    const double t = before_rounding(on_time_ ? time_event() : this->time_of_set());
    if (next_sample_ == options_.sample_times.size()) return;
    if (!lies_before(options_.sample_times[next_sample_], t)) return;
    search_.keep_lost(step_);
    emit_more_samples(search_.at(), t);
}

template <class X, bool single>
inline bool Loop<X, single>::return_to_domain()
{
    bool beyond = true;
    for (;;) {
        const std::size_t broken = guards_.first_not_finite();
        if (broken == no_guard) return true;
        const double h = shorten_into_domain(std::exchange(beyond, false));
        if (is_tentative() || h < smallest_step()) {
            if (!is_tentative() && happen_where_flow_ends(h)) return false;
            this->end_not_finite("", broken);
            return false;
        }
        ++run_.statistics.rejected;
        is_last_ = time_event_due_ = false;
        h_next_ = error_controlled_ ? h : h_next_;
        step_.attempt(h);
        note_change();
        this->sample_end();
    }
}

template <class X, bool single>
bool Loop<X, single>::is_rough(double h) const
{
    // Errors of the state may be as large as the tolerance, and the inside need not be better.
    constexpr double most = 4;
    return step_.may_be_rough() && step_.roughness(options_.rtol, options_.atol) > most &&
           0.1 * h >= smallest_step();
}

template <class X, bool single>
bool Loop<X, single>::smooth_step()
{
    while (is_rough(step_.h())) {
        const double h = 0.1 * step_.h();
        if (is_tentative()) return true;
        ++run_.statistics.rejected;
        is_last_ = time_event_due_ = false;
        if (!take_controlled_step(h, h)) return false;
        note_change();
        this->sample_end();
        if (guards_.first_not_finite() != no_guard) return return_to_domain();
        if (!this->any_suspicious()) return true;
    }
    return true;
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

}  // namespace ricochet::detail
