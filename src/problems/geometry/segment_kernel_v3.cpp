// For AVX2: compile with -march=x86-64-v3. Nothing of the standard library is called here.
#include "segment_kernel.hpp"

namespace ricochet::geometry::detail {

#if defined(__AVX2__)
namespace {

LeastBlock least_block_avx2(const SegmentColumns& columns, double px, double py,
                            double above) noexcept
{
    return least_block(columns, px, py, above);
}

}  // namespace

const LeastBlockFunction least_block_v3 = least_block_avx2;
#else
const LeastBlockFunction least_block_v3 = nullptr;
#endif

}  // namespace ricochet::geometry::detail
