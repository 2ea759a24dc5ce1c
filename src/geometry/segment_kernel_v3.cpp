// For AVX2: compile with -march=x86-64-v3. Nothing of the standard library is called here.
#include "segment_kernel.hpp"

namespace ricochet::geometry::detail {

#if defined(__AVX2__)
namespace {

LeastLook least_look_avx2(const SegmentColumns& columns, double px, double py,
                          double above) noexcept
{
    return least_look(columns, px, py, above);
}

}  // namespace

const LeastLookFunction least_look_v3 = least_look_avx2;
#else
const LeastLookFunction least_look_v3 = nullptr;
#endif

}  // namespace ricochet::geometry::detail
