// Internal: the declarations of this header may change without notice.
//
// Classes with Eigen's small matrices as members, which are laid out by the instruction set.
//
// The library is compiled for SSE2, where Eigen aligns to 16 bytes. A file that is compiled for
// AVX or AVX-512 has classes of another layout, under names of their own, and compiles the
// functions that it uses of these classes itself.
#pragma once

#include <Eigen/Core>

#if EIGEN_MAX_STATIC_ALIGN_BYTES == 16
#define RICOCHET_ALIGNED_AS_LIBRARY 1
#define RICOCHET_ALIGNED
#elif EIGEN_MAX_STATIC_ALIGN_BYTES == 32
#define RICOCHET_ALIGNED_AS_LIBRARY 0
#define RICOCHET_ALIGNED [[gnu::abi_tag("aligned_32")]]
#elif EIGEN_MAX_STATIC_ALIGN_BYTES == 64
#define RICOCHET_ALIGNED_AS_LIBRARY 0
#define RICOCHET_ALIGNED [[gnu::abi_tag("aligned_64")]]
#else
#define RICOCHET_ALIGNED_AS_LIBRARY 0
#define RICOCHET_ALIGNED [[gnu::abi_tag("aligned_as_doubles")]]
#endif
