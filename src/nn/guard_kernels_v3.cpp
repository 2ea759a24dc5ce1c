// The kernels of guards that are networks, for AVX2: compile with -march=x86-64-v3.
// On processors without these instructions the library has no such kernels.
#define RICOCHET_KERNEL_NAMESPACE library_v3
#include "guard_kernels.hpp"

#if defined(__AVX2__)
constexpr ricochet::detail::ChooseGuardKernels ricochet::detail::guard_kernels_v3 =
    ricochet::detail::library_v3::choose_guard_kernels;
#else
constexpr ricochet::detail::ChooseGuardKernels ricochet::detail::guard_kernels_v3 = nullptr;
#endif
