// The kernels of the library's methods that call flow and guard by pointer.
#pragma once

#include <vector>

#include "ricochet/detail/quiet_run.hpp"
#include "ricochet/detail/step_state.hpp"

namespace ricochet::detail {

/// A kernel that calls by pointer, with the quiet runs of systems without guards and of systems
/// with one guard that `Extremum` screens.
template <class X>
struct NamedKernel {
    StepKernel<X> step;
    QuietKernel<X> unguarded = nullptr;
    QuietKernel<X> screened = nullptr;
};

/// The named kernel whose step is `*step`, or null if it is none of them.
template <class X>
[[nodiscard]] const NamedKernel<X>* named_kernel(const StepKernel<X>* step) noexcept;
template <>
const NamedKernel<SmallState>* named_kernel(const StepKernel<SmallState>* step) noexcept;
template <>
const NamedKernel<std::vector<double>>* named_kernel(
    const StepKernel<std::vector<double>>* step) noexcept;

}  // namespace ricochet::detail
