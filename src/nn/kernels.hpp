// The kernels of `Mlp` for one instruction set.
//
// Included by one file per instruction set, which is compiled with the flags of that set and
// defines RICOCHET_KERNEL_NAMESPACE. Only functions in that namespace may be called here: see
// nn/detail/kernel.hpp.
#pragma once

#include "kernel_table.hpp"
#include "ricochet/nn/detail/kernel.hpp"
#include "ricochet/nn/mlp.hpp"

#include <cstddef>
#include <cstdint>

namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE {

/// Kernel for any shape.
template <class T, class Activation>
void run(const Network<T>& net, const T* in, T* out, std::size_t samples) noexcept
{
    const std::size_t inputs = net.widths[0];
    const std::size_t outputs = net.widths[net.layers];
    for (; samples > 0; --samples, in += inputs, out += outputs) {
        network<T, Activation>(net.parameters, net.widths, net.layers, in, out);
    }
}

/// Few inputs, and the given widths after them.
template <class T, class Activation, std::size_t... Widths>
void run_common(const Network<T>& net, const T* in, T* out, std::size_t samples) noexcept
{
    const std::size_t inputs = net.widths[0];
    for (; samples > 0; --samples, in += inputs, ++out) {
        network<T, Activation, Widths...>(net.parameters, in, inputs, out);
    }
}

template <class T, std::size_t... Widths>
bool has_widths(const Network<T>& net) noexcept
{
    if (net.layers != sizeof...(Widths)) return false;
    std::size_t k = 0;
    return ((net.widths[++k] == Widths) && ...);
}

template <class T, class Activation>
Kernel<T> choose(const Network<T>& net, bool common_shapes) noexcept
{
    if (common_shapes) {
        if (has_widths<T, 8, 1>(net)) return run_common<T, Activation, 8, 1>;
        if (has_widths<T, 16, 1>(net)) return run_common<T, Activation, 16, 1>;
        if (has_widths<T, 16, 16, 1>(net)) return run_common<T, Activation, 16, 16, 1>;
        if (has_widths<T, 16, 16, 16, 16, 16, 1>(net)) {
            return run_common<T, Activation, 16, 16, 16, 16, 16, 1>;
        }
        if (has_widths<T, 64, 64, 1>(net)) return run_common<T, Activation, 64, 64, 1>;
    }
    return run<T, Activation>;
}

template <class T>
Kernel<T> choose(const Network<T>& net, bool relu, bool common_shapes) noexcept
{
    return relu ? choose<T, Relu>(net, common_shapes) : choose<T, Tanh>(net, common_shapes);
}

inline constexpr KernelTable table{choose<float>, choose<double>};

}  // namespace ricochet::detail::RICOCHET_KERNEL_NAMESPACE
