// The one-step methods: Boost.Odeint's steppers, named as types.
//
// Only the headers of these steppers are included, since odeint's collective
// header costs seconds of compile time in every file.
#pragma once

#include <boost/numeric/odeint/algebra/default_operations.hpp>
#include <boost/numeric/odeint/stepper/euler.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4_classic.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_cash_karp54_classic.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <boost/numeric/odeint/stepper/stepper_categories.hpp>
#include <boost/numeric/odeint/util/resizer.hpp>
#include <type_traits>

#include "ricochet/integrate/odeint_support.hpp"

namespace ricochet {

/// Any odeint one-step method given by its class template, for example
/// `Odeint<boost::numeric::odeint::runge_kutta_cash_karp54>`.
template <template <class...> class Template>
struct Odeint {
    template <class State>
    using Stepper = Template<State, double, State, double, Elementwise,
                             boost::numeric::odeint::default_operations,
                             boost::numeric::odeint::initially_resizer>;
};

/// A complete stepper type, odeint's or the user's own, for its one state type.
/// It must be a one-step method: a multistep method has a memory that an event
/// makes stale.
template <class GivenStepper>
struct ThisStepper {
    template <class State>
    using Stepper = GivenStepper;
};

using Euler = Odeint<boost::numeric::odeint::euler>;
using Rk4 = Odeint<boost::numeric::odeint::runge_kutta4_classic>;
using CashKarp54 = Odeint<boost::numeric::odeint::runge_kutta_cash_karp54_classic>;
using Dopri5 = Odeint<boost::numeric::odeint::runge_kutta_dopri5>;
/// Of order 8, the cheapest for small errors. Its error estimate, a multiple of
/// k1 + k11 - k12 - k13, is blind to components whose rate depends on time alone: k1 and
/// k12 are taken at the start of the step, k11 and k13 at its end. Where such quadratures
/// stand alone, use Dopri5, or bound the step by `Options::h_max`.
using Fehlberg78 = Odeint<boost::numeric::odeint::runge_kutta_fehlberg78>;

/// Steps of the size `Options::step`; the last one is cut to end at `t_end`, and
/// the grid starts anew at every event.
template <class Method = Rk4>
struct FixedStep {
    using method = Method;
};

/// Steps chosen so that the estimated error meets `Options::rtol` and `atol`.
/// The method needs an error estimate: odeint's error steppers.
template <class Method = Dopri5>
struct ErrorControlled {
    using method = Method;
};

namespace detail {

namespace odeint = boost::numeric::odeint;

template <class Stepper, class Tag>
inline constexpr bool has_category = std::is_same_v<typename Stepper::stepper_category, Tag>;

/// Error estimate, and the rate at the end for free (first same as last).
template <class Stepper>
inline constexpr bool is_fsal = has_category<Stepper, odeint::explicit_error_stepper_fsal_tag>;

template <class Stepper>
inline constexpr bool has_error_estimate =
    is_fsal<Stepper> || has_category<Stepper, odeint::explicit_error_stepper_tag> ||
    has_category<Stepper, odeint::error_stepper_tag>;

template <class Stepper>
concept Multistep = requires
{
    Stepper::steps;
};

template <class Stepper>
[[nodiscard]] constexpr int order_of() noexcept
{
    if constexpr (requires { Stepper::order_value; }) {
        return static_cast<int>(Stepper::order_value);
    } else {
        return static_cast<int>(Stepper().order());
    }
}

}  // namespace detail

}  // namespace ricochet
