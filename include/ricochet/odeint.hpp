// Any one-step method of Boost.Odeint, and steppers that fulfil its concepts, as methods.
//
// Euler, Rk4, CashKarp54, Dopri5 and Fehlberg78 of `methods.hpp` take the steps of odeint's
// steppers, to rounding, and compile without it.
//
// Instead of the state a stepper is given the departure from the tangent at the start of the step,
//
//     w = x - x0 - s x'(t0),    w(0) = 0,    at the offset s from t0
//
// whose rounding is smaller. The step is the same for a Runge-Kutta method in which every stage
// passes its own time to the flow. A stepper that leaves the time out, or that splits or normalises
// the state, takes another step: it is refused when the run is made.
#pragma once

#include <boost/numeric/odeint/algebra/default_operations.hpp>
#include <boost/numeric/odeint/stepper/stepper_categories.hpp>
#include <boost/numeric/odeint/util/is_resizeable.hpp>
#include <boost/numeric/odeint/util/resize.hpp>
#include <boost/numeric/odeint/util/resizer.hpp>
#include <boost/numeric/odeint/util/same_size.hpp>
#include <cstddef>
#include <tuple>
#include <utility>

#include "ricochet/detail/components.hpp"
#include "ricochet/methods.hpp"

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

/// Odeint's Algebra concept for anything with `size()` and `operator[]`. Odeint's own choices
/// differ with the state type, and the one for Eigen vectors reloads as a vector what the flow
/// has just written as scalars, which stalls; a loop over x[i] is right for every state type.
struct Elementwise {
    template <class X, class... Rest>
    static void for_each(X& x, Rest&&... rest)
    {
        // Odeint's convention puts the operation last.
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

/// Any odeint one-step method given by its class template, for example
/// `Odeint<boost::numeric::odeint::runge_kutta_cash_karp54>`; its header is yours to include.
template <template <class...> class Template>
struct Odeint {
    template <class State>
    using Stepper = Template<State, double, State, double, Elementwise,
                             boost::numeric::odeint::default_operations,
                             boost::numeric::odeint::initially_resizer>;
};

}  // namespace ricochet
