// Derivatives along a direction by differences, for functions without a closed form.
//
// The five-point formula is of fourth order:
//
//     F'(x) s = (F(x - 2hs) - 8 F(x - hs) + 8 F(x + hs) - F(x + 2hs)) / 12h + O(h^4)
//
// (B. Fornberg, Generation of finite difference formulas on arbitrarily spaced grids,
// Mathematics of Computation 51, 1988, tables 1 and 3.) It is exact for polynomials up to
// degree four. With a step of 1e-3 of the scale on which F varies its error is h^4 / 30
// of the fifth derivative, 3e-14, and rounding in F adds about as much: 1e-16 / 1e-3.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/scratch.hpp"

namespace ricochet {

/// Step sizes of differences. The scale of a component is the change over which the
/// functions of the system become nonlinear; its default suits states of size one or more in
/// their units, so a system in micrometres should set it.
struct Differences {
    double step = 1e-3;           ///< of the scale, positive
    std::vector<double> scale{};  ///< of each component, positive; empty: max(1, |x_i|)
    double time_scale = 1;        ///< [s] the same for resets that depend on time
};

/// @throws std::invalid_argument unless step and scales are positive and finite, and there are
/// as many scales as components of the state, or none.
void validate(const Differences& differences, std::size_t components);

namespace detail {

/// Weights of a difference formula for the first derivative, of fourth order. They sum
/// to zero, so only differences to the first value are added up, and a function that does
/// not change has exactly the derivative zero.
struct Stencil {
    std::size_t points;
    std::array<double, 5> offset;
    std::array<double, 5> weight;
};

inline constexpr Stencil central_stencil{
    4, {-2, -1, 1, 2, 0}, {1.0 / 12, -8.0 / 12, 8.0 / 12, -1.0 / 12, 0}};

/// A formula for the edge of a range: all points on one side, `direction` 1 or -1.
[[nodiscard]] constexpr Stencil one_sided_stencil(double direction) noexcept
{
    const double d = direction;
    return {5,
            {0, d, 2 * d, 3 * d, 4 * d},
            {-25 * d / 12, 48 * d / 12, -36 * d / 12, 16 * d / 12, -3 * d / 12}};
}

[[nodiscard]] inline double zeros_shaped_like(double) noexcept
{
    return 0;
}

template <class X>
[[nodiscard]] X zeros_shaped_like(X x)
{
    for_each_component(x, [&](auto i) { x[i] = 0; });
    return x;
}

inline void add_difference(double& sum, double factor, double a, double b) noexcept
{
    sum += factor * (a - b);
}

template <class X>
void add_difference(X& sum, double factor, const X& a, const X& b)
{
    for_each_component(sum, [&](auto i) { sum[i] += factor * (a[i] - b[i]); });
}

/// The derivative of a function given as `at(k)`, its value at `stencil.offset[k] * h`:
/// a double or a vector.
template <class At>
[[nodiscard]] auto differentiate(const Stencil& stencil, double h, const At& at)
{
    const auto first = at(std::size_t{0});
    auto sum = zeros_shaped_like(first);
    for (std::size_t k = 1; k < stencil.points; ++k) {
        add_difference(sum, stencil.weight[k] / h, at(k), first);
    }
    return sum;
}

/// The same for a function `at(k, value)` that fills a vector, without allocating.
template <class X, class At>
void differentiate_into(X& sum, const Stencil& stencil, double h, const At& at)
{
    Scratch<X, 2> room(sum);
    X& first = room[0];
    X& value = room[1];
    at(std::size_t{0}, first);
    for_each_component(sum, [&](auto i) { sum[i] = 0; });
    for (std::size_t k = 1; k < stencil.points; ++k) {
        at(k, value);
        add_difference(sum, stencil.weight[k] / h, value, first);
    }
}

/// The factor h for which h s is a step of the wanted size at x; infinite for s = 0.
template <class X>
[[nodiscard]] double step_along(const Differences& differences, const X& x, const X& s)
{
    const std::vector<double>& scale = differences.scale;
    double longest = 0;
    for_each_component(x, [&](auto i) {
        const auto k = static_cast<std::size_t>(i);
        const double size = k < scale.size() ? scale[k] : std::max(1.0, std::fabs(x[i]));
        longest = std::max(longest, std::fabs(s[i]) / size);
    });
    return differences.step / longest;
}

/// x + factor s.
template <class X>
[[nodiscard]] X moved_along(const X& x, double factor, const X& s)
{
    X to = x;
    move(to, x, factor, s);
    return to;
}

}  // namespace detail

}  // namespace ricochet
