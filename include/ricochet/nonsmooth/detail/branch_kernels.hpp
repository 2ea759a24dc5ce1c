// Internal: the declarations of this header may change without notice.
//
// The kernels of the library's methods for the flow of a mode of branches, which is called with its
// components in registers.
#pragma once

#include <array>
#include <cstddef>

#include "ricochet/detail/small_state.hpp"
#include "ricochet/detail/system_adapter.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/nonsmooth/detail/branch_terms.hpp"

namespace ricochet::detail {

template <class X>
struct StepKernel;

/// The flow of a mode as a system of N components.
template <int N>
struct FlowInMode {
    using State = std::array<double, static_cast<std::size_t>(N)>;

    BranchFlow<N> of{};
    Mode mode = 0;

    [[gnu::always_inline]] void flow(double t, const State& x, State& dxdt) const
    {
        of(mode, t, x, dxdt);
    }
};

/// Sizes for which the library has compiled them.
template <int N>
inline constexpr bool has_branch_kernel = N >= 1 && N <= static_cast<int>(SmallState::room);

/// Its functions take the `SystemAdapter` of a `FlowInMode<N>`.
template <int N>
[[nodiscard]] const StepKernel<SmallState>& branch_kernel(MethodName name) noexcept;
extern template const StepKernel<SmallState>& branch_kernel<1>(MethodName name) noexcept;
extern template const StepKernel<SmallState>& branch_kernel<2>(MethodName name) noexcept;
extern template const StepKernel<SmallState>& branch_kernel<3>(MethodName name) noexcept;
extern template const StepKernel<SmallState>& branch_kernel<4>(MethodName name) noexcept;

}  // namespace ricochet::detail
