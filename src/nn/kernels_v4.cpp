// The kernels for AVX-512: compile with -march=x86-64-v4.
// On processors without these instructions the library has no such kernels.
#define RICOCHET_KERNEL_NAMESPACE library_v4
#include "kernels.hpp"

#if defined(__AVX512VL__)
constexpr ricochet::detail::KernelTable ricochet::detail::kernels_v4 =
    ricochet::detail::library_v4::table;
#else
constexpr ricochet::detail::KernelTable ricochet::detail::kernels_v4;
#endif
