#include "core/wide.hpp"

#include "ricochet/detail/components.hpp"

namespace ricochet::detail {

RICOCHET_WIDE void move_many(double* to, const double* from, double factor, const double* direction,
                             std::size_t count) noexcept
{
    RICOCHET_NO_DEPENDENCE
    for (std::size_t i = 0; i < count; ++i) to[i] = from[i] + factor * direction[i];
}

}  // namespace ricochet::detail
