// How Boost.Odeint sees our states: one algebra for all of them.
//
// Odeint's own choices differ with the state type, and the one for Eigen vectors
// reloads as a vector what the flow has just written as scalars, which stalls (7x
// slower than std::array on a two-component state). A loop over x[i] is right for
// every state type, and compilers unroll it where the size is fixed.
#pragma once

#include <boost/numeric/odeint/util/is_resizeable.hpp>
#include <boost/numeric/odeint/util/resize.hpp>
#include <boost/numeric/odeint/util/same_size.hpp>
#include <cstddef>
#include <tuple>
#include <utility>

#include "ricochet/hybrid/components.hpp"

namespace Eigen {
template <typename Scalar, int Rows, int Cols, int Options, int MaxRows, int MaxCols>
class Matrix;
}

namespace boost::numeric::odeint {

template <int Rows, int Options, int MaxRows>
struct is_resizeable<Eigen::Matrix<double, Rows, 1, Options, MaxRows, 1>> : boost::true_type {
};

template <int Rows, int Options, int MaxRows>
struct resize_impl<Eigen::Matrix<double, Rows, 1, Options, MaxRows, 1>,
                   Eigen::Matrix<double, Rows, 1, Options, MaxRows, 1>> {
    template <class Vector>
    static void resize(Vector& x, const Vector& like)
    {
        x.resize(like.size());
    }
};

template <int Rows, int Options, int MaxRows>
struct same_size_impl<Eigen::Matrix<double, Rows, 1, Options, MaxRows, 1>,
                      Eigen::Matrix<double, Rows, 1, Options, MaxRows, 1>> {
    template <class Vector>
    static bool same_size(const Vector& x, const Vector& y)
    {
        return x.size() == y.size();
    }
};

}  // namespace boost::numeric::odeint

namespace ricochet {

/// Odeint's Algebra concept for anything with `size()` and `operator[]`.
struct Elementwise {
    template <class X, class... Rest>
    static void for_each(X& x, Rest&&... rest)
    {
        // Odeint puts the operation last.
        constexpr std::size_t n = sizeof...(Rest);
        apply(x, std::forward_as_tuple(rest...), std::make_index_sequence<n - 1>{});
    }

    // clang-format off
    template <class X, class... R> static void for_each1(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each2(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each3(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each4(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each5(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each6(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each7(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each8(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each9(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each10(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each11(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each12(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each13(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each14(X& x, R&&... r) { for_each(x, r...); }
    template <class X, class... R> static void for_each15(X& x, R&&... r) { for_each(x, r...); }
    // clang-format on

private:
    template <class X, class Tuple, std::size_t... I>
    static void apply(X& x, Tuple rest, std::index_sequence<I...>)
    {
        auto& operation = std::get<sizeof...(I)>(rest);
        detail::for_each_component(
            x, [&](auto i)
                   __attribute__((always_inline)) { operation(x[i], std::get<I>(rest)[i]...); });
    }
};

}  // namespace ricochet
