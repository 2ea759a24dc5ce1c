#include "ricochet/nonsmooth/detail/branch_kernels.hpp"

#include "ricochet/detail/kernels.hpp"

namespace ricochet::detail {

template <int N>
const StepKernel<SmallState>& branch_kernel(MethodName name) noexcept
{
    using X = typename FlowInMode<N>::State;
    // In the order of `MethodName`.
    static constexpr std::array kernels{
        KernelOf<FlowInMode<N>, X, Euler>::make(), KernelOf<FlowInMode<N>, X, Rk4>::make(),
        KernelOf<FlowInMode<N>, X, CashKarp54>::make(), KernelOf<FlowInMode<N>, X, Dopri5>::make(),
        KernelOf<FlowInMode<N>, X, Fehlberg78>::make()};
    return kernels[static_cast<std::size_t>(name)];
}

template const StepKernel<SmallState>& branch_kernel<1>(MethodName name) noexcept;
template const StepKernel<SmallState>& branch_kernel<2>(MethodName name) noexcept;
template const StepKernel<SmallState>& branch_kernel<3>(MethodName name) noexcept;
template const StepKernel<SmallState>& branch_kernel<4>(MethodName name) noexcept;

}  // namespace ricochet::detail
