// The kernels, compiled with the flags of the whole library.
#define RICOCHET_KERNEL_NAMESPACE library_baseline
#include "kernels.hpp"

constexpr ricochet::detail::KernelTable ricochet::detail::kernels_baseline =
    ricochet::detail::library_baseline::table;
