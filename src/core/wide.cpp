#include "base/wide.hpp"

#include "ricochet/detail/components.hpp"

namespace ricochet::detail {

RICOCHET_WIDE void move_many(double* to, const double* from, double factor, const double* direction,
                             std::size_t count) noexcept
{
    RICOCHET_NO_DEPENDENCE
    for (std::size_t i = 0; i < count; ++i) to[i] = from[i] + factor * direction[i];
}

RICOCHET_WIDE void add_tangent_many(double* w, const double* x0, double s, const double* rate0,
                                    const double* remainder, std::size_t count) noexcept
{
    RICOCHET_NO_DEPENDENCE
    for (std::size_t i = 0; i < count; ++i) w[i] = x0[i] + (s * rate0[i] + (w[i] + remainder[i]));
}

}  // namespace ricochet::detail
