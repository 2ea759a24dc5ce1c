// The kernels for AVX2 and FMA: compile with -march=x86-64-v3.
// On processors without these instructions the library has no such kernels.
#define RICOCHET_DENSE_NAMESPACE dense_library_v3
#define RICOCHET_DENSE_REGISTER 32
#include "dense.hpp"

#if defined(__AVX2__)
#include "dense_kernels.hpp"
constexpr ricochet::learn::DenseTable ricochet::learn::dense_v3 =
    ricochet::learn::dense_library_v3::table;
#else
constexpr ricochet::learn::DenseTable ricochet::learn::dense_v3;
#endif
