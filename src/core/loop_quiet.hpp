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
        timed_ && now().until(time_event()) <= now().until(options().t_end);
    QuietRun quiet{.end = time_event_first ? time_event() : options().t_end,
                   .rtol = options().rtol,
                   .atol = options().atol,
                   .h_min = options().h_min,
                   .h_max = options().h_max,
                   .most_steps = next_review_ - result().statistics.steps,
                   .cancelled = options().cancelled,
                   .system = system().operator->(),
                   .h_next = h_next()};
    engine_.lend(quiet);
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
    quiet_(system().adapter(), now().lend(), quiet);
    engine_.take_back(quiet);
    if (quiet.why != QuietEnd::due) end_quiet_run(quiet);
}

template <class X, bool single>
inline bool Loop<X, single>::go_to_quiet_steps(QuietRun& quiet, bool beyond)
{
    for (bool here = !beyond; !has_ended(); here = true) {
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
inline void Loop<X, single>::end_quiet_run(const QuietRun& quiet)
{
    end_early();
    if (quiet.why == QuietEnd::failed) {
        const double h = now().h();
        const bool taken = error_controlled_
                               ? retry(h, h, quiet.repeated ? 1 : rule_.largest, quiet.error)
                               : take_fixed_step(h, true);
        if (!taken || (guarded_ && handle_events())) return;
    } else if (engine_.on_series() && !engine_.guards().on_series()) {
        if (handle_events()) return;
    } else if (engine_.on_series() || engine_.is_suspicious(quiet.why == QuietEnd::moving)) {
        if (search(false)) return;
    } else {
        engine_.pass_on_clear();
    }
    pass();
}

}  // namespace ricochet::detail
