// What a monitor decides about a step, and the set of events that ends it.
#pragma once

#include <cstddef>
#include <vector>

#include "ricochet/guard.hpp"
#include "ricochet/instant.hpp"

namespace ricochet {

/// Decision of a monitor about a step.
enum class Verdict {
    stands,  ///< the step stands: continue from its end
    cut,     ///< the step ends at a set of events: continue from `cut().after`, and `resume`
    rests,   ///< the motion has come to rest: keep the state until `must_stop_at`, then `hold`
    ended,   ///< the run is over; `outcome` says why
};

/// A set of events that ends a step, at the same instant for the whole set.
template <class X>
struct Cut {
    double s = 0;  ///< [s] offset in the last step shown; 0 where the set follows another at the
                   ///< same instant
    Instant t;     ///< [s]
    X before{};    ///< x⁻
    X after{};     ///< x⁺
    Mode mode_before = 0;
    Mode mode_after = 0;
    /// The guards that fired, in ascending order; for an accumulation the guard that came to rest.
    std::vector<std::size_t> fired;
    bool on_time = false;        ///< the set includes a time event
    bool accumulation = false;   ///< `after` is the state that `rest` gives for the limit, `t` its
                                 ///< time
    bool state_changed = false;  ///< false: the host need not restart
};

}  // namespace ricochet
