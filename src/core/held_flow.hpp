// A flow in which some components stand still, and the kernels that can follow it.
#pragma once

#include <array>
#include <boost/container/small_vector.hpp>
#include <cstddef>

#include "core/named_kernels.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/detail/system_table.hpp"

namespace ricochet::detail {

/// The flow of a system with some of its components at zero; its own adapter.
template <class X>
struct HeldFlow {
    const SystemTable<X>* system = nullptr;
    void* adapter = nullptr;
    boost::container::small_vector<std::size_t, 8> components{};

    /// Sets the rates of the components to zero.
    void stop(X& dxdt) const noexcept
    {
        for (const std::size_t c : components) {
            if (c < dxdt.size()) dxdt[c] = 0;
        }
    }
    static bool flow(void* adapter, Mode mode, double t, const X& x, X& dxdt)
    {
        const HeldFlow& held = *static_cast<const HeldFlow*>(adapter);
        const bool fits = held.system->flow(held.adapter, mode, t, x, dxdt);
        held.stop(dxdt);
        return fits;
    }
    [[nodiscard]] static constexpr SystemTable<X> make_table() noexcept
    {
        SystemTable<X> table;
        table.flow = &flow;
        return table;
    }
    static const SystemTable<X> table;
};

template <class X>
inline constexpr SystemTable<X> HeldFlow<X>::table = HeldFlow<X>::make_table();

/// The library's kernel of the same method that calls the flow by pointer. A method that is not the
/// library's gets the kernel with the same orders, else Dormand and Prince's, or rk4 for fixed
/// steps. A host's steps stay its own.
template <class X>
[[nodiscard]] const StepKernel<X>& kernel_by_pointer(const StepKernel<X>& kernel, std::size_t size)
{
    if (!kernel.take || named_kernel(&kernel)) return kernel;
    for (const NamedMethod& method : named_methods) {
        const StepKernel<X>& named = kernel_by_name<X>(method.name, size);
        if (named.order == kernel.order && named.error_order == kernel.error_order &&
            named.interpolates() == kernel.interpolates()) {
            return named;
        }
    }
    return kernel_by_name<X>(kernel.error_order > 0 ? MethodName::dopri5 : MethodName::rk4, size);
}

}  // namespace ricochet::detail
