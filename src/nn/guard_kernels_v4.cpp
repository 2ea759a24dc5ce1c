// The kernels of guards that are networks, for AVX-512: compile with -march=x86-64-v4.
// On processors without these instructions the library has no such kernels.
#define RICOCHET_KERNEL_NAMESPACE library_v4
#include "guard_kernels.hpp"

#if defined(__AVX512VL__)
constexpr ricochet::detail::ChooseGuardKernels ricochet::detail::guard_kernels_v4 =
    ricochet::detail::library_v4::choose_guard_kernels;
#else
constexpr ricochet::detail::ChooseGuardKernels ricochet::detail::guard_kernels_v4 = nullptr;
#endif
