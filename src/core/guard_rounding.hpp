// What rounding alone may change in a guard.
#pragma once

#include <cmath>

#include "core/step.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/system_table.hpp"

namespace ricochet::detail {

/// Change of a guard at time t [s] and state x that may come from rounding of the time and of the
/// state, by 8 units in the last place of each component.
template <class X>
[[nodiscard]] inline double rounding_of(const CoreGuard<X>& guard, const Step<X>& step, double t,
                                        const X& x)
{
    constexpr double nudge = tolerances::of_state;
    const double g = guard.value(t, x);
    double beside = t * (1 + nudge);
    if (step.inside(beside) != beside) beside = step.inside(t * (1 - nudge));
    double rounding = std::fabs(guard.value(beside, x) - g);
    X near = x;
    for_each_component(near, [&](auto c) {
        const double kept = near[c];
        if (kept == 0) return;
        near[c] = kept * (1 + nudge);
        rounding += std::fabs(guard.value(t, near) - g);
        near[c] = kept;
    });
    return rounding;
}

}  // namespace ricochet::detail
