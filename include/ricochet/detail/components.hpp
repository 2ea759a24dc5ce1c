// Internal: the declarations of this header may change without notice.
//
// Loops over the components of a state.
//
// States of a fixed, small size are unrolled by hand. Left to itself the compiler
// turns a loop of two iterations into one 16-byte access, and such a load right
// after the 8-byte stores of a flow waits until they have reached the cache: on the
// bouncing ball that is a third of the time of a step.
#pragma once

#include <concepts>
#include <cstddef>
#include <tuple>
#include <type_traits>
#include <utility>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/small_state.hpp"

/// Precedes a loop whose iterations do not depend on one another. (For clang the equivalent is a
/// command, whose failure would be a warning in the user's code.)
#ifdef __clang__
#define RICOCHET_NO_DEPENDENCE
#else
#define RICOCHET_NO_DEPENDENCE _Pragma("GCC ivdep")
#endif

namespace ricochet::detail {

/// Number of components where the type fixes it, else 0. Of a `SmallState` it is the room.
template <class X>
[[nodiscard]] constexpr std::size_t fixed_size() noexcept
{
    if constexpr (std::is_same_v<X, SmallState>) {
        return SmallState::room;
    } else if constexpr (requires { std::tuple_size<X>::value; }) {
        return std::tuple_size<X>::value;
    } else if constexpr (requires { X::SizeAtCompileTime; }) {
        return X::SizeAtCompileTime > 0 ? static_cast<std::size_t>(X::SizeAtCompileTime) : 0;
    } else {
        return 0;
    }
}

template <class X>
inline constexpr bool is_small = fixed_size<X>() > 0 && fixed_size<X>() <= 8;

/// Calls `function(i)` for i = 0, ..., n - 1.
template <std::size_t n, class Index = std::size_t, class Function>
[[gnu::always_inline]] inline void for_each_index(const Function& function)
{
    [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline))
    {
        (function(static_cast<Index>(I)), ...);
    }
    (std::make_index_sequence<n>{});
}

/// Calls `function(i)` for every component of x, with i of the state's own index
/// type.
template <class X, class Function>
[[gnu::always_inline]] inline void for_each_component(const X& x, const Function& function)
{
    using Index = decltype(x.size());
    constexpr std::size_t fixed = fixed_size<X>();
    if constexpr (is_small<X> && fixed <= 4) {  // an index sequence takes three functions a loop
        function(Index{0});
        if constexpr (fixed > 1) function(Index{1});
        if constexpr (fixed > 2) function(Index{2});
        if constexpr (fixed > 3) function(Index{3});
    } else if constexpr (is_small<X>) {
        for_each_index<fixed, Index>(function);
    } else {
        const Index n = x.size();
        // No component depends on another: the output does not overlap the input with a shift.
        RICOCHET_NO_DEPENDENCE
        for (Index i = 0; i < n; ++i) {
            function(i);
        }
    }
}

/// to = from.
template <class X>
[[gnu::always_inline]] inline void assign(X& to, const X& from)
{
    if constexpr (is_small<X>) {
        if constexpr (std::is_same_v<X, SmallState>) to.resize_like(from);
        for_each_component(
            from, [&](auto i) __attribute__((always_inline)) { to[i] = from[i]; });
    } else {
        to = from;
    }
}

/// As `move`, for components that lie side by side, in registers as wide as there are.
void move_many(double* to, const double* from, double factor, const double* direction,
               std::size_t count) noexcept;

/// w = x0 + (s rate0 + (w + remainder)), component by component, likewise.
void add_tangent_many(double* w, const double* x0, double s, const double* rate0,
                      const double* remainder, std::size_t count) noexcept;

/// A state of doubles side by side, whose number is not small. (Eigen's may be rows of a matrix.)
template <class X>
concept LongArray = !is_small<X> && !requires
{
    X::SizeAtCompileTime;
}
&&requires(X& x)
{
    {
        x.data()
        } -> std::same_as<double*>;
};

/// to = from + factor * direction.
template <class X>
[[gnu::always_inline]] inline void move(X& to, const X& from, double factor, const X& direction)
{
    if constexpr (LongArray<X>) {
        if (from.size() > 8) {
            return move_many(to.data(), from.data(), factor, direction.data(), from.size());
        }
    }
    for_each_component(
        from, [&](auto i)
                  __attribute__((always_inline)) { to[i] = from[i] + factor * direction[i]; });
}

/// Whether every component is finite.
template <class X>
[[nodiscard]] bool all_finite(const X& x) noexcept
{
    double sum = 0;  // 0 * x is NaN where x is not finite
    for_each_component(
        x, [&](auto i) __attribute__((always_inline)) { sum += 0 * x[i]; });
    return sum == 0;
}

/// Whether two states are equal, component by component.
template <class X>
[[nodiscard]] bool same_state(const X& a, const X& b)
{
    if (a.size() != b.size()) return false;
    if constexpr (LongArray<X>) {
        double differs = 0;  // a double, so that the loop is vectorised
        for (decltype(a.size()) i = 0; i < a.size(); ++i) differs = a[i] == b[i] ? differs : 1.0;
        return differs == 0;
    }
    bool equal = true;
    for_each_component(
        a, [&](auto c) __attribute__((always_inline)) { equal = equal && a[c] == b[c]; });
    return equal;
}

}  // namespace ricochet::detail
