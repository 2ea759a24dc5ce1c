// Internal: the declarations of this header may change without notice.
//
// Quiet runs: consecutive steps without events.
//
// For a small state with at most one guard the loop calls a function specific to the system, with
// flow and guard inlined, or a function of the library that calls them by pointer. It continues
// until a step needs a check, or the end is near. Bits and counts are those of the loop.
#pragma once

#include <atomic>
#include <cstdint>

#include "ricochet/detail/step_state.hpp"

namespace ricochet::detail {

/// Reason for which the loop must continue.
enum class QuietEnd : std::uint8_t {
    due,     ///< the next step is not a quiet one
    failed,  ///< the current step can neither be accepted nor repeated on account of its error
             ///< alone
    moving,  ///< the state hardly changes in the current step, which has to be examined closely
    doubt,   ///< the guard may have an event in the current step
};

struct QuietRun {
    // --- input ---
    double end = 0;  ///< [s] end of the run, or the next time event: no step reaches it
    double rtol = 0;
    double atol = 0;
    double h_min = 0;            ///< [s]
    double h_max = 0;            ///< [s]
    bool checks_inside = false;  ///< guards are evaluated once inside each step
    bool departs = false;        ///< the guard starts on its surface
    std::uint64_t most_steps = 0;
    const std::atomic<bool>* cancelled = nullptr;
    const void* system = nullptr;  ///< the SystemTable, for kernels that call by pointer

    // --- the guard, and the next step; brought up to date ---
    double sign = 0;
    double g0 = 0, rate0 = 0, g1 = 0, rate1 = 0;
    double inside = 0;  ///< at `CubicCheck::inside`
    double h_next = 0;  ///< [s]

    // --- results ---
    QuietEnd why = QuietEnd::due;
    double error = 0;       ///< error of a failed step
    bool repeated = false;  ///< the failed step was itself a repetition
    std::uint64_t steps = 0;
    std::uint64_t rejected = 0;
    std::uint64_t guard_calls = 0;
};

template <class X>
using QuietKernel = void (*)(void* adapter, StepState<X>& step, QuietRun& run);

}  // namespace ricochet::detail
