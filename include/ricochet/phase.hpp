// Phases of a run whose motion is set-valued at times (nonsmooth/hand_over.hpp): what a run lists,
// and what its implicit steps report.
#pragma once

#include <cstdint>
#include <limits>
#include <string_view>

namespace ricochet {

/// Reason for which a phase began.
enum class PhaseCause {
    start,
    no_modes,       ///< the set is no box, or has more than four reactions
    no_flow,        ///< y' = 0 does not determine the held reactions
    several,        ///< changes coincide, and rates do not tell what follows
    accumulation,   ///< infinitely many switchings in finite time
    chattering,     ///< more switchings in a short time than can be worth locating
    stuck,          ///< the event-driven loop could not continue
    contradiction,  ///< an event-driven step contradicted the law of a reaction
    released,       ///< event-driven again: every branch is plain
    held,           ///< a y arrived at zero, and its reaction holds it
};

/// The enumerator's name.
[[nodiscard]] std::string_view name(PhaseCause cause) noexcept;

/// Start of a phase, until the next one or the end of the run.
struct MotionPhase {
    double from = 0;  ///< [s]
    bool set_valued = false;
    PhaseCause cause = PhaseCause::start;
};

/// Result of an implicit stage with a reaction (nonsmooth/detail/inclusion_stage.hpp).
struct StageReport {
    bool converged = false;
    double residual = std::numeric_limits<double>::infinity();  ///< relative to the forces involved
    int iterations = 0;
    int set = -1;  ///< the component of the reaction whose law failed; -1: the equation
};

/// Counts over the implicit steps of a set-valued motion.
struct SetValuedStatistics {
    std::uint64_t attempted = 0;
    std::uint64_t accepted = 0;
    std::uint64_t rejected = 0;    ///< steps rejected by the controller
    std::uint64_t unsolved = 0;    ///< attempts whose stages did not converge
    std::uint64_t stages = 0;      ///< stages solved, whether or not their step was accepted
    std::uint64_t iterations = 0;  ///< iterations of the stages' solvers
    std::uint64_t switches = 0;    ///< changes of branch that were located
};

}  // namespace ricochet
