// Counts over a run.
#pragma once

#include <cstdint>

namespace ricochet {

/// Reason for which a step was taken to hold no event.
enum class Evidence : std::uint8_t {
    proved,   ///< a bound or polynomial excludes a root
    checked,  ///< evaluated at the ends and at the interior extremum
    gated,    ///< a calibrated network skipped the check, within its miss rate
    assumed,  ///< evaluated at the ends only, or predicted by a bare network
};

/// How many steps were taken to be free of events, and on what evidence.
struct EvidenceCounts {
    std::uint64_t proved = 0;
    std::uint64_t checked = 0;
    std::uint64_t gated = 0;
    std::uint64_t assumed = 0;

    constexpr void add(Evidence evidence) noexcept
    {
        switch (evidence) {
            case Evidence::proved: ++proved; return;
            case Evidence::checked: ++checked; return;
            case Evidence::gated: ++gated; return;
            case Evidence::assumed: ++assumed; return;
        }
    }
};

/// Counts over one run.
struct Statistics {
    std::uint64_t steps = 0;             ///< accepted steps, including those cut short by an event
    std::uint64_t rejected = 0;          ///< steps that failed the error test
    std::uint64_t refined_steps = 0;     ///< steps divided for a guard that they did not resolve
    std::uint64_t unresolved_steps = 0;  ///< refined steps that the finest division did not resolve
    std::uint64_t resteps = 0;           ///< steps repeated from their start to locate an event
    std::uint64_t flow_calls = 0;        ///< evaluations of the flow, for all purposes
    std::uint64_t guard_calls = 0;       ///< evaluations of the guard, for all purposes
    std::uint64_t network_calls = 0;     ///< evaluations of a network
    std::uint64_t false_alarms = 0;      ///< a network predicted an event and there was none
    std::uint64_t missed_events = 0;     ///< events in a step that a network had cleared
    std::uint64_t late_events = 0;       ///< missed events that only a later step found
    std::uint64_t checks_deferred =
        0;  ///< steps whose exact check a network or a plan deferred for good
    std::uint64_t outside_domain = 0;  ///< states outside the box of a gate: checked exactly
    std::uint64_t bound_calls = 0;     ///< evaluations of `lower_bound`, `upper_bound`
    std::uint64_t rollbacks = 0;       ///< returns to the start of a step that could not be closed
    std::uint64_t repeated_steps = 0;  ///< steps taken again because of that
    std::uint64_t events = 0;
    std::uint64_t suppressed = 0;  ///< repeats of an event inside its own window
    std::uint64_t disabled = 0;    ///< crossings that `enabled` rejected
    EvidenceCounts evidence;
};

}  // namespace ricochet
