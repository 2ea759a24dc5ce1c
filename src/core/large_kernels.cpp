// The kernels of the library's methods for states of any number of components.
#include <array>
#include <cstddef>
#include <vector>

#include "core/large_kernel.hpp"
#include "core/named_kernels.hpp"
#include "ricochet/detail/kernels.hpp"

namespace ricochet::detail {

namespace {

using Large = std::vector<double>;

using Kernels = std::array<NamedKernel<Large>, NamedMethods::size>;

[[nodiscard]] const Kernels& all_kernels() noexcept
{
    static const Kernels kernels = NamedMethods::each([]<class Method>() {
        using Tableau = typename Method::template Stepper<Large>::Coefficients;
        return NamedKernel<Large>{LargeKernel<Tableau>::make()};
    });
    return kernels;
}

}  // namespace

template <>
const StepKernel<Large>& kernel_by_name(MethodName name, std::size_t /*size*/) noexcept
{
    return all_kernels()[static_cast<std::size_t>(name)].step;
}

template <>
const NamedKernel<Large>* named_kernel(const StepKernel<Large>* step) noexcept
{
    for (const auto& kernel : all_kernels()) {
        if (&kernel.step == step) return &kernel;
    }
    return nullptr;
}

}  // namespace ricochet::detail
