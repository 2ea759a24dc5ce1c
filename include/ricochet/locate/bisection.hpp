// Bisection on the step's own map: the plainest location, and the source paper's.
#pragma once

#include <algorithm>
#include <cmath>

#include "ricochet/detect/step_probe.hpp"
#include "ricochet/detail/jump.hpp"

namespace ricochet {

/// Halves the bracket until it is no wider than the tolerance or its ends are
/// neighbouring doubles. Only the side of the guard is used, so any guard will do; its
/// values say at the end whether it has a zero there.
struct Bisection {
    template <class Probe>
    [[nodiscard]] Location locate(Probe& probe, GuardSample lo, GuardSample hi,
                                  double tolerance) const
    {
        const double end = hi.s;
        double size = detail::larger(detail::larger(0, lo.value), hi.value);
        while (hi.s - lo.s > std::max(tolerance, probe.finest(hi.s))) {
            const double middle = lo.s + (hi.s - lo.s) / 2;
            if (middle <= lo.s || middle >= hi.s) break;
            const GuardSample sample = probe.value(middle);
            size = detail::larger(size, sample.value);
            (probe.has_left(sample) ? hi : lo) = sample;
        }
        if (detail::jumps(probe, lo, hi, size)) return detail::jump_at(probe, lo, hi, end);
        return {.lo = lo.s, .hi = hi.s, .root = hi.s, .slope = hi.rate, .error = hi.s - lo.s};
    }
};

}  // namespace ricochet
