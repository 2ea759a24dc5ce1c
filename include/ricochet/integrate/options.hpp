// What a caller can ask of a run.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

namespace ricochet {

/// Options of `integrate`. Times in seconds. Only `t_end` has no default.
struct Options {
    double t_start = 0;
    double t_end = std::numeric_limits<double>::quiet_NaN();

    /// The step of a fixed-step run, where it is required; with error control the
    /// first step tried, estimated from the flow if zero.
    double step = 0;

    /// Error control: a step is accepted where its estimated error in every
    /// component stays below atol + rtol |x|. Ignored by fixed steps.
    double rtol = 1e-8;
    double atol = 1e-10;
    double h_min = 0;  ///< 0: a few units in the last place of the time
    double h_max = std::numeric_limits<double>::infinity();

    /// An event is located to a bracket no wider than
    /// event_tolerance + event_rtol |t|, or to neighbouring doubles where that is
    /// smaller.
    double event_tolerance = 0;
    double event_rtol = 0;

    bool stop_at_event = false;
    bool record_events = true;  ///< off: events are counted, not kept

    /// Times at which the trajectory is wanted, ascending, within the run. A time
    /// that coincides with an event gets the state after it.
    std::vector<double> sample_times{};

    std::uint64_t max_steps = std::numeric_limits<std::uint64_t>::max();
};

/// @throws std::invalid_argument naming the option, what was given and what was
/// expected.
void validate(const Options& options, bool step_required);

}  // namespace ricochet
