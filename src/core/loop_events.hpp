// Events in the steps of the loop.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool Loop<X, single>::handle_events()
{
    bool cleared = false;
    return engine_.deserves_search(cleared) && search(cleared);
}

template <class X, bool single>
bool Loop<X, single>::search(bool cleared)
{
    mark_everything();
    if (engine_.guards().first_not_finite() != no_guard) {
        if (!return_to_domain()) return true;
        if (!engine_.any_suspicious()) {
            engine_.pass_on_clear();
            return false;
        }
    }
    if (error_controlled_ && now().may_be_rough() && !smooth_step()) return true;
    const auto find = [&](bool clears) {
        return engine_.find(clears, [&] { show_before_resets(); });
    };
    bool found = find(cleared);
    if (!found && engine_.is_before_window()) {
        stop_before_window();
        if (!engine_.any_suspicious()) {
            engine_.pass_on_clear();
            return false;
        }
        found = find(false);
    }
    if (!found) return has_ended();
    const double t = engine_.set_time();
    record_step_to_set(engine_.set_offset(), t);
    limit_next_step(t);
    engine_.apply_found();
    settle_and_record();
    return true;
}

template <class X, bool single>
void Loop<X, single>::stop_before_window()
{
    end_early();
    now().attempt(engine_.take_before_window());
    note_change();
    engine_.sample_end();
}

template <class X, bool single>
inline void Loop<X, single>::show_before_resets()
{
    if (options().record_steps) static_cast<void>(now().dense());
    const double t = before_rounding(engine_.set_time());
    if (next_sample_ == options().sample_times.size()) return;
    if (!lies_before(options().sample_times[next_sample_], t)) return;
    engine_.keep_lost();
    emit_more_samples(engine_.set_offset(), t);
}

template <class X, bool single>
inline bool Loop<X, single>::return_to_domain()
{
    bool beyond = true;
    for (;;) {
        const std::size_t broken = engine_.guards().first_not_finite();
        if (broken == no_guard) return true;
        const double h = shorten_into_domain(std::exchange(beyond, false));
        if (is_tentative() || h < smallest_step()) {
            if (!is_tentative() && happen_where_flow_ends(h)) return false;
            engine_.end_not_finite("", broken);
            return false;
        }
        ++result().statistics.rejected;
        end_early();
        h_next() = error_controlled_ ? h : h_next();
        now().attempt(h);
        note_change();
        engine_.sample_end();
    }
}

template <class X, bool single>
bool Loop<X, single>::is_rough(double h) const
{
    // Errors of the state may be as large as the tolerance, and the inside need not be better.
    constexpr double most = 4;
    return now().may_be_rough() && now().roughness(options().rtol, options().atol) > most &&
           0.1 * h >= smallest_step();
}

template <class X, bool single>
bool Loop<X, single>::smooth_step()
{
    while (is_rough(now().h())) {
        const double h = 0.1 * now().h();
        if (is_tentative()) return true;
        ++result().statistics.rejected;
        end_early();
        if (!take_controlled_step(h, h)) return false;
        note_change();
        engine_.sample_end();
        if (engine_.guards().first_not_finite() != no_guard) return return_to_domain();
        if (!engine_.any_suspicious()) return true;
    }
    return true;
}

template <class X, bool single>
inline double Loop<X, single>::shorten_into_domain(bool beyond)
{
    const double h = now().h();
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
    if (flight > engine_.resolution().window(t)) {
        longest_step_ = std::max(2 * flight, rule_.smallest * longest_step_);
        flight_start_ = t;
    }
    h_next() = std::min(h_next(), std::max(first_step_, longest_step_));
}

}  // namespace ricochet::detail
