// Options of a run.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <string_view>
#include <vector>

#include "ricochet/guard.hpp"

namespace ricochet {

/// Options of `integrate`. Times are in seconds. Only `t_end` has no default. A run backward
/// in time applies resets as they are, not inverted.
struct Options {
    double t_start = 0;
    /// Before t_start: runs backward. Infinite where something else ends the run: a guard with
    /// `stop_after`, `stop_at_event`, `max_steps` or `cancelled`.
    double t_end = std::numeric_limits<double>::quiet_NaN();
    Mode mode = 0;  ///< mode at the start
    /// The run goes on where another has ended: t_start belongs to that one, so that nothing
    /// happens there by `Times` of the system or by `GuardInfo::at_start`, and what a rest held is
    /// held again. A timer of `next_time_event(t, x)` that is due there has its event: one that has
    /// happened has moved it on.
    bool continues = false;

    /// [s] Length of the steps of a fixed-step run, where it is required; with error control the
    /// length of the first step tried, estimated from the flow if zero.
    double step = 0;

    /// Error control: a step is accepted if its estimated error in every
    /// component stays below atol + rtol |x|. Ignored by fixed steps.
    double rtol = 1e-8;
    double atol = 1e-10;
    /// Absolute tolerances, one for each component of the start, instead of `atol`, which then
    /// applies to components that a reset adds.
    std::vector<double> component_atol{};
    double h_min = 0;  ///< [s] 0: a few units in the last place of the time
    double h_max = std::numeric_limits<double>::infinity();

    /// [s] An event is located to a bracket no wider than
    /// event_tolerance + event_rtol |t|, or to neighbouring doubles if these are further
    /// apart.
    double event_tolerance = 0;
    double event_rtol = 0;

    /// [s] Guards that fire within max(event_window, event tolerance, 4 ulp of t) of the first form
    /// one set, applied once. A time event joins those before it in this time, not those after it.
    double event_window = 0;

    /// Whether detectors that can (`ChecksInside`) evaluate every guard once inside each step as
    /// well, and divide a step if the cubic through its ends does not describe what the guard
    /// does. Without it a guard that moves faster than the state may be lost. Guards that
    /// declare bounds, and may be expensive, are never examined inside.
    bool check_inside = true;

    bool stop_at_event = false;
    bool record_events = true;  ///< off: events are counted, not kept
    bool event_states = true;   ///< off: recorded events without their states, if sized at run time
    bool record_steps = false;  ///< keep every step, for `Run::solution`

    /// Times [s] at which the trajectory is recorded, in the order in which the run reaches
    /// them. A time that coincides with an event gets the state after it.
    std::vector<double> sample_times{};

    std::uint64_t max_steps = std::numeric_limits<std::uint64_t>::max();

    /// Number of consecutive steps, ten for an instant with events, that have to advance the time
    /// by 1e-9 of the span; else the run ends as `Outcome::stalled`. With `max_steps`, 20 000 steps
    /// (or `stall_steps`, if less) without an event also have to go at a pace at which a hundred
    /// times `max_steps` would reach t_end. Not while the pace is that of the run so far. 0: no
    /// limit.
    std::uint64_t stall_steps = 1'000'000;

    /// Flag, set from another thread or a signal handler, that ends the run after the step in
    /// progress; results so far are kept.
    const std::atomic<bool>* cancelled = nullptr;
};

/// @throws std::invalid_argument beginning with `who` and naming the option, what was given and
/// what was expected.
void validate(const Options& options, bool step_required, std::string_view who = "integrate");

namespace detail {

/// The same, where an infinite t_end is examined later.
void validate_but_for_end(const Options& options, bool step_required, std::string_view who);

}  // namespace detail

}  // namespace ricochet
