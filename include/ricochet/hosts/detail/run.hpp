// Internal: the declarations of this header may change without notice.
//
// The loop of a host and a monitor, for the adapters in this directory.
//
// A host holds the step that it took last, and is a `HostStep` itself. Besides:
//
//     t(), x(), rate()     where it is: time [s], state and its rate
//     scale()              [s] length of its next step, roughly
//     step(t_stop)         takes a step that does not pass t_stop
//     go_on_from(t, x, changed)
//                          goes to time t in its last step, or after it, with the state x;
//                          `changed`: its motion so far does not lead to x, or the mode is new
//     keep(components)     optional: keeps these components of its state constant, and no others
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "ricochet/monitor.hpp"

namespace ricochet::hosts {

/// Moves `host` from its current time to t_end, through all events; calls `at_cut` with every cut
/// before the host continues from it.
/// @return `stands` at t_end, `rests` there, or `ended`; `monitor.outcome()` says why
/// @throws std::invalid_argument if t_end is not finite, or lies before the time of the host
/// @throws std::logic_error if a rest holds a part of a moving state, and the host has no `keep`
template <class Host, class Monitor, class AtCut>
Verdict run(Host& host, Monitor& monitor, double t_end, const AtCut& at_cut, Mode mode = 0)
{
    const auto settled = [&](Verdict verdict) {
        while (verdict == Verdict::cut) {
            const auto& cut = monitor.cut();
            at_cut(cut);
            host.go_on_from(cut.t.value, cut.after,
                            cut.state_changed || cut.mode_after != cut.mode_before);
            // A host in single precision has rounded the state.
            verdict = std::ranges::equal(host.x(), cut.after)
                          ? monitor.resume(host.rate(), host.scale())
                          : monitor.resume(host.x(), cut.mode_after, host.rate(), host.scale());
        }
        if constexpr (requires { host.keep(monitor.held()); }) {
            host.keep(monitor.held());
        } else if (verdict == Verdict::stands && !monitor.held().empty()) {
            throw std::logic_error(
                "hosts::run: found a rest that holds component " +
                std::to_string(monitor.held().front()) +
                " of a state that moves; expected a host that can keep it, or a rest with a mode");
        }
        return verdict;
    };
    // Nearer to t_end than this a method cannot take a step.
    const double rounding = 8 * std::numeric_limits<double>::epsilon() * std::fabs(t_end);
    if (!std::isfinite(t_end) || host.t() - t_end > rounding) {
        throw std::invalid_argument(
            "hosts::run: t_end must be finite, and not before the host at " +
            std::to_string(host.t()) + ", got " + std::to_string(t_end));
    }
    Verdict verdict = settled(monitor.start({host.t()}, host.x(), host.rate(), host.scale(), mode));
    while (verdict != Verdict::ended && t_end - host.t() > rounding) {
        const double stop = std::min(t_end, monitor.must_stop_at());
        if (verdict == Verdict::rests) {
            verdict = monitor.hold(stop);  // where the flow lifts the motion, less far
            host.go_on_from(monitor.t().value, host.x(), true);
            verdict = settled(verdict);
        } else {
            host.step(stop);
            verdict = settled(monitor.examine(host));
        }
    }
    return verdict;
}

template <class Host, class Monitor>
Verdict run(Host& host, Monitor& monitor, double t_end)
{
    return run(host, monitor, t_end, [](const auto& /*cut*/) {});
}

}  // namespace ricochet::hosts
