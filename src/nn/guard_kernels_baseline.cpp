// The kernels of guards that are networks, compiled with the flags of the whole library.
#define RICOCHET_KERNEL_NAMESPACE library_baseline
#include "guard_kernels.hpp"

constexpr ricochet::detail::ChooseGuardKernels ricochet::detail::guard_kernels_baseline =
    ricochet::detail::library_baseline::choose_guard_kernels;
