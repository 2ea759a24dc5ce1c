// The kernels for AVX-512: compile with -march=x86-64-v4.
// On processors without these instructions the library has no such kernels.
#define RICOCHET_DENSE_NAMESPACE dense_library_v4
#define RICOCHET_DENSE_REGISTER 64
#include "dense.hpp"

#if defined(__AVX512F__)
#include "dense_kernels.hpp"
constexpr ricochet::learn::DenseTable ricochet::learn::dense_v4 =
    ricochet::learn::dense_library_v4::table;
#else
constexpr ricochet::learn::DenseTable ricochet::learn::dense_v4;
#endif
