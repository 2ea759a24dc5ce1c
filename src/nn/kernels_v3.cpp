// The kernels for AVX2: compile with -march=x86-64-v3.
// On processors without these instructions the library has no such kernels.
#define RICOCHET_KERNEL_NAMESPACE library_v3
#include "kernels.hpp"

#if defined(__AVX2__)
constexpr ricochet::detail::KernelTable ricochet::detail::kernels_v3 =
    ricochet::detail::library_v3::table;
#else
constexpr ricochet::detail::KernelTable ricochet::detail::kernels_v3;
#endif
