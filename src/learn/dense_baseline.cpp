// The kernels for the instruction set of the whole library.
#define RICOCHET_DENSE_NAMESPACE dense_library_baseline
#define RICOCHET_DENSE_REGISTER 16
#include "dense_kernels.hpp"

constexpr ricochet::learn::DenseTable ricochet::learn::dense_baseline =
    ricochet::learn::dense_library_baseline::table;
