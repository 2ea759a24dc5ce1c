// The kernels of the library's methods for states of one to four components.
#include "core/named_kernels.hpp"

#include <array>
#include <cstddef>

#include "ricochet/detail/kernels.hpp"
#include "ricochet/extremum.hpp"

namespace ricochet::detail {

namespace {

using Kernels = std::array<NamedKernel<SmallState>, NamedMethods::size>;

template <std::size_t n, class Method>
[[nodiscard]] NamedKernel<SmallState> named()
{
    using Kernel = KernelOf<ByPointer, std::array<double, n>, Method>;
    NamedKernel<SmallState> named{.step = Kernel::make()};
    if constexpr (has_error_estimate<typename Method::template Stepper<std::array<double, n>>>) {
        named.unguarded = Kernel::template quiet<true, void>();
        named.screened = Kernel::template quiet<true, Extremum>();
    }
    return named;
}

template <std::size_t n>
[[nodiscard]] Kernels all_of_size()
{
    return NamedMethods::each([]<class Method>() { return named<n, Method>(); });
}

[[nodiscard]] const std::array<Kernels, SmallState::room>& all_kernels() noexcept
{
    static const std::array<Kernels, SmallState::room> kernels = {
        all_of_size<1>(), all_of_size<2>(), all_of_size<3>(), all_of_size<4>()};
    return kernels;
}

}  // namespace

template <>
const StepKernel<SmallState>& kernel_by_name(MethodName name, std::size_t size) noexcept
{
    return all_kernels()[size - 1][static_cast<std::size_t>(name)].step;
}

template <>
const NamedKernel<SmallState>* named_kernel(const StepKernel<SmallState>* step) noexcept
{
    for (const Kernels& kernels : all_kernels()) {
        for (const auto& kernel : kernels) {
            if (&kernel.step == step) return &kernel;
        }
    }
    return nullptr;
}

}  // namespace ricochet::detail
