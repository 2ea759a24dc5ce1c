// Quiet runs: consecutive steps without events.
#pragma once

#include "core/loop.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline bool Loop<X, single>::run_quietly()
{
    return mark_ ? run_quietly_resumably() : run_quietly_from_here();
}

template <class X, bool single>
inline QuietRun Loop<X, single>::quiet_orders() const
{
    const bool time_event_first =
        timed_ && step_.until(time_event()) <= step_.until(options_.t_end);
    QuietRun quiet{
        .end = time_event_first ? time_event() : options_.t_end,
        .rtol = options_.rtol,
        .atol = options_.atol,
        .h_min = options_.h_min,
        .h_max = options_.h_max,
        .checks_inside = guards_.checks_inside() && options_.check_inside && !this->on_series_,
        .most_steps = next_review_ - run_.statistics.steps,
        .cancelled = options_.cancelled,
        .system = system_.operator->(),
        .h_next = h_next_};
    guards_.lend(quiet, step_.time(0));
    return quiet;
}

template <class X, bool single>
inline bool Loop<X, single>::run_quietly_from_here()
{
    QuietRun quiet = quiet_orders();
    run_quietly(quiet);
    return quiet.why != QuietEnd::due;
}

template <class X, bool single>
inline void Loop<X, single>::run_quietly(QuietRun& quiet)
{
    quiet_(system_.adapter(), step_.lend(), quiet);
    take_over(quiet);
    if (quiet.why != QuietEnd::due) end_quiet_run(quiet);
}

template <class X, bool single>
inline bool Loop<X, single>::go_to_quiet_steps(QuietRun& quiet, bool beyond)
{
    for (bool here = !beyond; !ended_; here = true) {
        if (may_run_quietly()) {
            quiet = quiet_orders();
            if (here) return true;
            quiet.most_steps = 1;
            run_quietly(quiet);
            if (quiet.steps > 0 || quiet.why != QuietEnd::due) continue;
        }
        advance_one({});
    }
    return false;
}

template <class X, bool single>
inline void Loop<X, single>::take_over(const QuietRun& quiet)
{
    if (this->on_series_) {
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
    if (guards_.size() > 0) this->add_evidence(this->evidence_of_quiet(), quiet.steps);
}

template <class X, bool single>
inline void Loop<X, single>::end_quiet_run(const QuietRun& quiet)
{
    is_last_ = time_event_due_ = asked_ = false;
    if (quiet.why == QuietEnd::failed) {
        const double h = step_.h();
        const bool taken = error_controlled_
                               ? retry(h, h, quiet.repeated ? 1 : rule_.largest, quiet.error)
                               : take_fixed_step(h, true);
        if (!taken || (guarded_ && handle_events())) return;
    } else if (this->on_series_ && !guards_.on_series()) {
        if (handle_events()) return;
    } else if (this->on_series_ || this->is_suspicious(quiet.why == QuietEnd::moving)) {
        if (search(false)) return;
    } else {
        this->pass_on_clear();
    }
    pass();
}

}  // namespace ricochet::detail
