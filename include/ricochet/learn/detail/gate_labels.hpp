// Internal: the declarations of this header may change without notice.
//
// Labels of states: how long a guard stays beyond its surface after an event.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "ricochet/gates.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::learn::detail {

/// The flow of a system in one mode, without its guards.
template <class System, class X>
struct FlowOnly {
    const System* system;
    Mode mode;
    void flow(double t, const X& x, X& dxdt) const
    {
        ricochet::detail::call_flow(*system, mode, t, x, dxdt);
    }
};

/// How the time at which a guard returns is looked for.
struct Labelling {
    Options options{};        ///< of the steps; they start at the state before the event
    double reach = 0;         ///< [s] after the event
    std::uint64_t calls = 0;  ///< of the guard, that were made
};

/// Time [s] at which a guard is first seen on its side again after its event, at the end of a step,
/// if the flow continues without the reset. Infinite: not within reach.
template <class System, class X, class Stepping, class E>
[[nodiscard]] double time_of_return(const System& system, const E& event, const X& from,
                                    Labelling& how)
{
    const double infinity = std::numeric_limits<double>::infinity();
    if (event.guard == no_guard) return infinity;
    const auto side = [&](double t, const X& x) {
        ++how.calls;
        return ricochet::detail::call_guard(system, event.guard, event.mode_before, t, x);
    };
    const GuardInfo info = guard_info_of<X>(system, event.guard);
    const double armed = info.crossing == Crossing::falling ? 1
                         : info.crossing == Crossing::rising
                             ? -1
                             : std::copysign(1.0, side(how.options.t_start, from));
    Options options = how.options;
    options.t_end = event.t + how.reach + options.step;
    options.mode = 0;
    const FlowOnly<System, X> flow{&system, event.mode_before};
    Simulation<FlowOnly<System, X>, X, Stepping> on(flow, from, options);
    while (on.step()) {
        if (on.t() <= event.t) continue;
        if (armed * side(on.t(), on.x()) > 0) return on.t();
        if (on.t() > event.t + how.reach) break;
    }
    return infinity;
}

}  // namespace ricochet::learn::detail
