// The scalar of a system's functions as a template parameter.
//
// One template of a flow, a guard or a reset serves numbers, dual numbers (dual.hpp) and power
// series (taylor.hpp), if the time and the state have one scalar type, whatever it is. On arrays:
//
//     template <class S>
//     constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
//
// On states of any type, and on views of them:
//
//     template <class X>
//     constexpr void flow(const ScalarOf<X>& t, const X& x, X& dxdt) const
//     template <class X>
//     constexpr ScalarOf<X> guard(const ScalarOf<X>& t, const X& x) const
//     template <class X>
//     void reset(const ScalarOf<X>& t, X& x) const
//
// Functions are called by their bare names, `using std::cos; cos(x[0])`.
#pragma once

#include <type_traits>
#include <utility>

namespace ricochet {

/// Type of the components of X.
template <class X>
using ScalarOf = std::remove_cvref_t<decltype(std::declval<const X&>()[0])>;

}  // namespace ricochet
