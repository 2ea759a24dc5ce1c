// Table of the kernels of each instruction set.
#pragma once

#include "ricochet/nn/mlp.hpp"

namespace ricochet::detail {

/// The kernel for a network: its widths, whether it has ReLU or tanh, and whether
/// instances for common shapes are wanted.
template <class T>
using ChooseKernel = Kernel<T> (*)(const Network<T>&, bool relu, bool common_shapes) noexcept;

struct KernelTable {
    ChooseKernel<float> single = nullptr;  ///< null if this build has none
    ChooseKernel<double> double_ = nullptr;
};

extern const KernelTable kernels_baseline;
extern const KernelTable kernels_v3;
extern const KernelTable kernels_v4;

}  // namespace ricochet::detail
