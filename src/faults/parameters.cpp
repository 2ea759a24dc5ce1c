#include "ricochet/faults/parameters.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "base/require.hpp"

namespace ricochet {

void validate(const RateStateParameters& p)
{
    constexpr std::string_view name = "rate-and-state friction";
    detail::require_positive(name, "a", p.a);
    detail::require_positive(name, "b", p.b);
    detail::require_positive(name, "f*", p.f_star);
    detail::require_positive(name, "V*", p.v_star);
    detail::require_positive(name, "D_RS", p.d_rs);
}

namespace detail {

void refuse_slip_rate(double v)
{
    throw std::invalid_argument(
        fmt::format("rate-and-state friction: a log(V/V*) needs a positive slip rate, got V = {} "
                    "m/s; the asinh form (DirectEffect::asinh) takes any",
                    v));
}

void refuse_theta(double theta)
{
    throw std::invalid_argument(
        fmt::format("rate-and-state friction: the state theta must be positive, got {} s", theta));
}

}  // namespace detail

}  // namespace ricochet
