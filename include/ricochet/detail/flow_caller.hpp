// Internal: the declarations of this header may change without notice.
//
// How a step calls the flow: by pointer, or inlined.
#pragma once

#include <cstdint>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/step_state.hpp"

// A program of many small systems that take few steps compiles in half the time with flows called
// by pointer: it defines RICOCHET_CALLS_FLOWS_BY_POINTER. The bits of a run are the same.
#if defined(__OPTIMIZE__) && !defined(RICOCHET_CALLS_FLOWS_BY_POINTER)
#define RICOCHET_INLINES_FLOWS 1
#else
#define RICOCHET_INLINES_FLOWS 0
#endif

namespace ricochet::detail {

/// Stands for a system whose flow is called by pointer.
struct ByPointer {};

/// The flow of a step by pointer, when and in which mode it is called, and how often it was.
template <class C>
struct FlowCaller {
    void* adapter;
    bool (*flow)(void* adapter, Mode mode, double t, const C& x, C& dxdt);
    Instant start;
    Mode mode;
    bool backward;
    double flow_from, flow_to;  ///< as in `StepState`
    std::uint64_t calls = 0;
    bool fits = true;

    FlowCaller(void* adapter_, const StepState<C>& step)
        : adapter(adapter_),
          flow(step.flow),
          start(step.start),
          mode(step.mode),
          backward(step.backward),
          flow_from(step.flow_from),
          flow_to(step.flow_to)
    {
    }
    [[nodiscard]] double time(double s) const noexcept { return start.plus(backward ? -s : s); }
    /// The time at which the flow is evaluated for a stage at the time t.
    [[nodiscard]] double stage_time(double t, double) const noexcept
    {
        return least_of(greatest_of(t, flow_from), flow_to);
    }
    template <bool is_end>
    [[nodiscard]] double stage_time(double t, StageOffset<is_end> s) const noexcept
    {
        if constexpr (is_end) return stage_time(t, s.s);
        return t;
    }
    void leave(StepState<C>& step) const noexcept
    {
        step.flow_calls += calls;
        step.flow_fits &= fits;
    }
};

}  // namespace ricochet::detail
