// The kernels as the whole library is compiled.
#define RICOCHET_DENSE_NAMESPACE dense_library_baseline
#define RICOCHET_DENSE_REGISTER 16
#include "dense_kernels.hpp"

constexpr ricochet::learn::DenseTable ricochet::learn::dense_baseline =
    ricochet::learn::dense_library_baseline::table;
