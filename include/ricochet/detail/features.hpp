// Internal: the declarations of this header may change without notice.
//
// The inputs of a network for a state: features computed from (t, x, h) by a recipe
// that a model names.
#pragma once

#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/dual_derivatives.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

namespace detail {

enum class Recipe {
    state,      ///< the components of x, as they are
    ballistic,  ///< the guard's height and rate in units of what its curvature does in one step
};

/// Name in a model file.
[[nodiscard]] constexpr std::string_view name(Recipe recipe) noexcept
{
    return recipe == Recipe::state ? "state" : "ballistic";
}

/// @throws std::invalid_argument naming what was given and what is known.
[[nodiscard]] inline Recipe recipe_named(std::string_view given)
{
    for (const Recipe recipe : {Recipe::state, Recipe::ballistic}) {
        if (given == name(recipe)) return recipe;
    }
    throw std::invalid_argument("unknown feature recipe '" + std::string(given) +
                                "'; known are state, ballistic");
}

/// How many features a recipe makes of a state of `state_size` components.
[[nodiscard]] constexpr std::size_t dimension(Recipe recipe, std::size_t state_size) noexcept
{
    return recipe == Recipe::state ? state_size : 2;
}

template <class System, class X>
concept CurvatureWritten = requires(const System& system, double t, const X& x)
{
    {
        system.guard_curvature(t, x)
        } -> std::convertible_to<double>;
};

/// The curvature of the guard along the flow.
template <class System, class X>
[[nodiscard]] double curvature_of(const System& system, double t, const X& x)
{
    if constexpr (CurvatureWritten<System, X>) {
        return system.guard_curvature(t, x);
    } else {
        return curvature_by_duals(system, t, x);
    }
}
}  // namespace detail

/// The system gives the curvature d2g/dt2 of its guard along the flow, or dual numbers can compute
/// it.
template <class System, class X>
concept CurvedGuard = RatedGuard<System, X> &&
    (detail::CurvatureWritten<System, X> || detail::curvature_takes_duals<System, X>);

namespace detail {

/// Whether `recipe` can be computed for states of type X of a system.
template <class System, class X>
[[nodiscard]] constexpr bool offers(Recipe recipe) noexcept
{
    return recipe == Recipe::state || CurvedGuard<System, X>;
}

/// 1 / x for x >= 0, the largest double instead of infinity; NaN stays NaN.
[[nodiscard]] inline double saturated_reciprocal(double x) noexcept
{
    return least_of(1 / x, std::numeric_limits<double>::max());
}

/// A signed logarithm, sign(a) L(1 + |a| / a0) with a0 = 1/2, where L is log2 at
/// the powers of two and linear between them:
///
///     L(2^e m) = e + m - 1  for m in [1, 2),  within 0.0861 of log2.
///
/// Linear for |a| <= a0 and a logarithm further out, so that equal ratios are
/// nearly equal distances over all decades. A network learns from it as well as
/// from the smooth logarithm, and it is read off the bits of 1 + |a| / a0, in a tenth
/// of the time and with the same result on every machine. Odd, continuous, never
/// decreasing; at most 1024, also for infinite a; NaN stays NaN.
///
/// a0 is the place of the boundary of a ballistic step, see `features`.
[[nodiscard]] inline double slog(double a) noexcept
{
    constexpr double a0 = 0.5;
    constexpr auto one = std::bit_cast<std::int64_t>(1.0);
    const double y = least_of(std::abs(a) * (1 / a0), std::numeric_limits<double>::max());
    const std::int64_t above_one = std::bit_cast<std::int64_t>(1 + y) - one;
    const double if_nan = y - y;
    return std::copysign(static_cast<double>(above_one) * 0x1p-52 + if_nan, a);
}

/// A step that is still to be taken.
template <class X>
struct StepAhead {
    double t;  ///< [s]
    const X& x;
    const X& dxdt;  ///< the flow there
    double h;       ///< [s] length of the step, positive
};

// clang derives it for aggregates from its version 17 on.
template <class X>
StepAhead(double, const X&, const X&, double) -> StepAhead<X>;

/// Computes the features of a step.
///
///     state       x[0], x[1], ...
///     ballistic   slog(g / (|g''| h^2)),  slog(g' / (|g''| h))
///
/// with guard g, rate g' and curvature g'' along the flow. Where g'' is constant
/// and negative, as for a ball in free fall, the end of the step is on or below
/// the surface iff g / (|g''| h^2) + g' / (|g''| h) <= 1/2: one boundary for
/// every gravity and every step.
///
/// @param out  `dimension(recipe, x.size())` numbers, written. Finite for finite
///             arguments: quotients saturate, even where the curvature is zero.
///             NaN for a recipe that the system does not offer.
template <class System, class X>
void features(Recipe recipe, const System& system, const StepAhead<X>& step, double* out) noexcept
{
    const X& x = step.x;
    if (recipe == Recipe::state) {
        const auto n = static_cast<std::size_t>(x.size());
        for (std::size_t i = 0; i < n; ++i) out[i] = x[i];
        return;
    }
    if constexpr (CurvedGuard<System, X>) {
        const double per_step = saturated_reciprocal(step.h);
        const double per_speed =
            saturated_reciprocal(std::abs(curvature_of(system, step.t, x)) * step.h);
        out[0] = slog(system.guard(step.t, x) * per_speed * per_step);
        out[1] = slog(call_rate(system, 0, Along{Mode{0}, step.t, x, step.dxdt}) * per_speed);
    } else {
        out[0] = out[1] = std::numeric_limits<double>::quiet_NaN();
    }
}

/// Computes the features of a step of length h from x at time 0, with the flow evaluated here, into
/// a copy of the state.
template <class System, class X>
void features(Recipe recipe, const System& system, const X& x, double h, double* out) noexcept
{
    X dxdt = x;
    if (recipe != Recipe::state) system.flow(0, x, dxdt);
    features(recipe, system, StepAhead<X>{0, x, dxdt, h}, out);
}

}  // namespace detail

}  // namespace ricochet
