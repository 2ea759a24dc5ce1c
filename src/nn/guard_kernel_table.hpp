// Table of the kernels of guards that are networks, of each instruction set.
#pragma once

#include "ricochet/nn/guard_network.hpp"

namespace ricochet::detail {

struct GuardKernels {
    double (*value)(const GuardLayers&, const double* x) noexcept = nullptr;
    /// The value, and into `rate` the derivative along dx.
    double (*value_and_rate)(const GuardLayers&, const double* x, const double* dx,
                             double* rate) noexcept = nullptr;
    /// The value, and its derivatives by the inputs.
    double (*value_and_gradient)(const GuardLayers&, const double* x,
                                 double* gradient) noexcept = nullptr;
    /// Range of the value for inputs centre + slope tau +- radius.
    GuardRange (*along)(const GuardLayers&, const double* centre, const double* slope,
                        const double* radius) noexcept = nullptr;
};

/// The kernels for an activation; null pointers if this build has none.
using ChooseGuardKernels = GuardKernels (*)(Activation) noexcept;

extern const ChooseGuardKernels guard_kernels_baseline;
extern const ChooseGuardKernels guard_kernels_v3;
extern const ChooseGuardKernels guard_kernels_v4;

}  // namespace ricochet::detail
