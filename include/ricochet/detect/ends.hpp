// The simple approach: which side is the guard on after the step?
//
// One guard call a step. Two crossings within one step cancel and are not seen,
// so "no event" is only assumed.
#pragma once

#include "ricochet/detect/step_probe.hpp"

namespace ricochet {

/// Detector that compares the signs of a guard at both ends of a step, at one guard call a step.
/// Two crossings within one step cancel and are not found.
struct Ends {
    static constexpr bool uses_rates = false;
    static constexpr Screening screening = Screening::ends;
    static constexpr Evidence evidence = Evidence::assumed;  ///< of a step not suspected

    /// Whether a step needs a check, in the guard times `sign`, positive on its
    /// armed side.
    [[nodiscard]] static constexpr bool suspects(double sign, double /*g0*/, double /*rate0*/,
                                                 double g1, double /*rate1*/, double /*h*/) noexcept
    {
        return !(sign * g1 > 0);
    }

    /// Whether the interval holds one crossing and nothing else, as far as its ends tell.
    [[nodiscard]] static bool leaves_plainly(double sign, const GuardSample& /*start*/,
                                             const GuardSample& end, double /*touch*/) noexcept
    {
        return sign * end.value < 0;
    }

    [[nodiscard]] Finding examine(GuardPath& probe, Watch& watch) const
    {
        const bool left = has_left(watch.side, watch.end.value);
        watch.side_after = left ? opposite(watch.side) : watch.side;
        if (left && counts(watch.side, probe.crossing())) {
            return Finding::leaving(watch.side, watch.start, watch.end);
        }
        return Finding::clear(Evidence::assumed);
    }
};

}  // namespace ricochet
