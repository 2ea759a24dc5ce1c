// Result of a run. Nothing that was computed is lost: whatever the outcome,
// the time, the state and the events up to there are here.
#pragma once

#include <optional>
#include <vector>

#include "ricochet/hybrid/event.hpp"
#include "ricochet/hybrid/statistics.hpp"
#include "ricochet/integrate/outcome.hpp"
#include "ricochet/integrate/solution.hpp"

namespace ricochet {

/// States at chosen times.
template <class State>
struct Trajectory {
    std::vector<double> t;  ///< [s]
    std::vector<State> x;
};

/// A guard that has broken a bound that its system declares.
template <class State>
struct WrongBound {
    std::size_t guard = no_guard;
    bool lower_bound = false;  ///< the guard lies below it
    bool upper_bound = false;  ///< the guard lies above it; neither: it changed too fast
    double t = 0;              ///< [s]
    State x{};                 ///< where it was seen
    double value = 0;          ///< of the guard there
    double since = 0;          ///< [s] when it was last examined; t for a bound of the value
    double value_then = 0;     ///< of the guard then
    double allowed = 0;        ///< the bound, or the largest change since then
};

/// Result of a run: why, when and where it ended, and everything computed until then, whatever the
/// outcome.
template <class State>
struct Run {
    Outcome outcome = Outcome::reached_end;
    double t = 0;  ///< [s] time reached
    State x{};     ///< state at that time
    Mode mode = 0;
    /// The guard that ended the run where one did, else `no_guard`; of two conflicting
    /// resets the first, and the second in `other_guard`, `time_event_reset` if it is a time
    /// event's.
    std::size_t guard = no_guard;
    std::size_t other_guard = no_guard;
    std::vector<Event<State>> events;
    Trajectory<State> trajectory;  ///< empty unless `Options::sample_times` were given
    Solution<State> solution;      ///< empty unless `Options::record_steps`
    std::optional<WrongBound<State>> wrong_bound;  ///< with `Outcome::wrong_bound`
    Statistics statistics;
};

}  // namespace ricochet
