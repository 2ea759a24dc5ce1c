// What a run returns. Nothing that was computed is lost: whatever the outcome,
// the time, the state and the events up to there are here.
#pragma once

#include <vector>

#include "ricochet/hybrid/event.hpp"
#include "ricochet/hybrid/statistics.hpp"
#include "ricochet/integrate/outcome.hpp"

namespace ricochet {

/// States at chosen times.
template <class State>
struct Trajectory {
    std::vector<double> t;  ///< [s]
    std::vector<State> x;
};

template <class State>
struct Run {
    Outcome outcome = Outcome::reached_end;
    double t = 0;  ///< [s] time reached
    State x{};     ///< state at that time
    std::vector<Event<State>> events;
    Trajectory<State> trajectory;  ///< empty unless `Options::sample_times` were given
    Statistics statistics;
};

}  // namespace ricochet
