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

/// In the order of `MethodName`.
[[nodiscard]] const std::array<NamedKernel<Large>, 5>& all_kernels() noexcept
{
    static const std::array<NamedKernel<Large>, 5> kernels = {
        {{LargeKernel<EulerTableau>::make()},
         {LargeKernel<Rk4Tableau>::make()},
         {LargeKernel<CashKarp54Tableau>::make()},
         {LargeKernel<Dopri5Tableau>::make()},
         {LargeKernel<Fehlberg78Tableau>::make()}}};
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
