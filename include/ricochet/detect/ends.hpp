// The simple approach: which side is the guard on after the step?
//
// One guard call a step. Two crossings within one step cancel and are not seen,
// so "no event" is only assumed.
#pragma once

#include "ricochet/detect/finding.hpp"

namespace ricochet {

struct Ends {
    static constexpr bool uses_rates = false;

    template <class Guard, class Step>
    [[nodiscard]] Finding confirm(const Guard& guard, const Step& step, Watch& watch) const
    {
        watch.end = {.s = step.h(), .value = guard.value(step.time(step.h()), step.x1())};
        if (triggers(watch.side, watch.end.value, guard.crossing())) {
            return Finding::leaving(watch.side, watch.start, watch.end);
        }
        return Finding::clear(Evidence::assumed);
    }
};

}  // namespace ricochet
