#include "ricochet/nonsmooth/detail/branch_kernels.hpp"

#include "ricochet/detail/kernels.hpp"

namespace ricochet::detail {

template <int N>
const StepKernel<SmallState>& branch_kernel(MethodName name) noexcept
{
    using X = typename FlowInMode<N>::State;
    static constexpr auto kernels = NamedMethods::each(
        []<class Method>() { return KernelOf<FlowInMode<N>, X, Method>::make(); });
    return kernels[static_cast<std::size_t>(name)];
}

template const StepKernel<SmallState>& branch_kernel<1>(MethodName name) noexcept;
template const StepKernel<SmallState>& branch_kernel<2>(MethodName name) noexcept;
template const StepKernel<SmallState>& branch_kernel<3>(MethodName name) noexcept;
template const StepKernel<SmallState>& branch_kernel<4>(MethodName name) noexcept;

}  // namespace ricochet::detail
