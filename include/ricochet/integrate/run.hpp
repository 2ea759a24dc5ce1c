// Result of a run. Everything that was computed is returned: whatever the outcome,
// it holds the time, the state and the events up to the end of the run.
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

/// A guard that violated a bound that its system declares.
template <class State>
struct WrongBound {
    std::size_t guard = no_guard;
    bool lower_bound = false;  ///< the guard lies below it
    bool upper_bound = false;  ///< the guard lies above it; neither: it changed too fast
    double t = 0;              ///< [s] time at which the violation was found
    State x{};                 ///< state at that time
    double value = 0;          ///< value of the guard there
    double since = 0;          ///< [s] time of its last check; t for a bound on the value
    double value_then = 0;     ///< value of the guard at that check
    double allowed = 0;        ///< the bound, or the largest change allowed since that check
};

/// Result of a run: why, when and where it ended, and everything computed until then, whatever the
/// outcome.
template <class State>
struct Run {
    Outcome outcome = Outcome::reached_end;
    double t = 0;  ///< [s] time reached
    State x{};     ///< state at that time
    Mode mode = 0;
    /// The guard that ended the run, or `no_guard` if none did; of two conflicting
    /// resets the first, with the second in `other_guard`, which is `time_event_reset` for a time
    /// event's reset.
    std::size_t guard = no_guard;
    std::size_t other_guard = no_guard;
    std::vector<Event<State>> events;
    Trajectory<State> trajectory;  ///< empty unless `Options::sample_times` were given
    Solution<State> solution;      ///< empty without `Options::record_steps`
    std::optional<WrongBound<State>> wrong_bound;  ///< set with `Outcome::wrong_bound`
    Statistics statistics;
};

}  // namespace ricochet
