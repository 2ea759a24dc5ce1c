// The one-step methods, named as types.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include "ricochet/detail/runge_kutta.hpp"

namespace boost::numeric::odeint {
struct error_stepper_tag;
struct explicit_error_stepper_tag;
struct explicit_error_stepper_fsal_tag;
}  // namespace boost::numeric::odeint

namespace ricochet {

/// A one-step method: names the stepper that takes its steps, for each type of state. That is a
/// `detail::RungeKutta` of a tableau, a stepper of odeint, or one with `order()` and odeint's
/// `do_step`. It keeps nothing from one step to the next, since an event may lie between them.
template <class M>
concept Method = requires
{
    typename M::template Stepper<std::array<double, 1>>;
};

/// Method made of a complete stepper type for one state type, odeint's (see `ricochet/odeint.hpp`)
/// or the user's own, with odeint's `do_step`. It must be a one-step method: a multistep method
/// keeps earlier steps, which an event makes invalid. Its form is in `ricochet/odeint.hpp`.
template <class GivenStepper>
struct ThisStepper {
    template <class State>
    using Stepper = GivenStepper;
};

// Explicit Runge-Kutta methods with the bits of Boost.Odeint's steppers.

/// Euler's method, of order 1.
struct Euler {
    static constexpr std::string_view name = "euler";
    template <class State>
    using Stepper = detail::RungeKutta<detail::EulerTableau, State>;
};

/// The classical method of order 4.
struct Rk4 {
    static constexpr std::string_view name = "rk4";
    template <class State>
    using Stepper = detail::RungeKutta<detail::Rk4Tableau, State>;
};

/// Cash and Karp's method of order 5, with an error estimate of order 4.
struct CashKarp54 {
    static constexpr std::string_view name = "cash-karp54";
    template <class State>
    using Stepper = detail::RungeKutta<detail::CashKarp54Tableau, State>;
};

/// Dormand and Prince's method of order 5, with an error estimate, an interpolant of order 4 and
/// the rate at the end of the step at no cost: the default.
struct Dopri5 {
    static constexpr std::string_view name = "dopri5";
    template <class State>
    using Stepper = detail::RungeKutta<detail::Dopri5Tableau, State>;
};

/// Fehlberg's method of order 8, the cheapest for small errors. Its error estimate, a multiple of
/// k1 + k11 - k12 - k13, vanishes for components whose rate depends on time alone: k1 and k12 are
/// taken at the start of the step, k11 and k13 at its end. Where it is zero, the sixth difference
/// of the rates takes its place. Where the rate depends on the state, but very weakly, it is too
/// small: use Dopri5 there, or bound the step by `Options::h_max`.
struct Fehlberg78 {
    static constexpr std::string_view name = "fehlberg78";
    template <class State>
    using Stepper = detail::RungeKutta<detail::Fehlberg78Tableau, State>;
};

/// The methods that `MethodByName` can select. Their values are part of the binary interface: a new
/// one comes last, here and in `detail::NamedMethods`.
enum class MethodName : std::uint8_t { euler, rk4, cash_karp54, dopri5, fehlberg78 };

/// A method selected at run time, with the same bits: for programs that offer all of them. The flow
/// is called through a pointer, which costs small states a few nanoseconds a call.
struct MethodByName {
    MethodName name = MethodName::dopri5;
};

/// Steps of the length `Options::step`; the last one is cut to end at `t_end`, and
/// the sequence starts again at every event.
template <class Method = Rk4>
struct FixedStep {
    using method = Method;
    [[no_unique_address]] Method value{};
};

/// Steps chosen so that the estimated error meets `Options::rtol` and `atol`.
/// The method needs an error estimate.
template <class Method = Dopri5>
struct ErrorControlled {
    using method = Method;
    [[no_unique_address]] Method value{};
};

namespace detail {

namespace odeint = boost::numeric::odeint;

/// A method of this library, which computes steps as departures from the tangent.
template <class Stepper>
concept Departing = requires
{
    Stepper::estimates_error;
};

template <class Stepper, class... Tags>
inline constexpr bool has_category = (std::is_same_v<typename Stepper::stepper_category, Tags> ||
                                      ...);

/// A method with an error estimate, and with the rate at the end for free (first same as last).
template <class Stepper>
inline constexpr bool is_fsal = has_category<Stepper, odeint::explicit_error_stepper_fsal_tag>;
template <Departing Stepper>
inline constexpr bool is_fsal<Stepper> = Stepper::fsal;

template <class Stepper>
inline constexpr bool has_error_estimate =
    is_fsal<Stepper> ||
    has_category<Stepper, odeint::explicit_error_stepper_tag, odeint::error_stepper_tag>;
template <Departing Stepper>
inline constexpr bool has_error_estimate<Stepper> = Stepper::estimates_error;

/// Whether the method comes with an interpolant of its own.
template <class Stepper, class X>
inline constexpr bool has_interpolant = requires(const Stepper& stepper, X& x)
{
    stepper.calc_state(0.0, x, x, x, 0.0, x, x, 0.0);
};
template <Departing Stepper, class X>
inline constexpr bool has_interpolant<Stepper, X> = Stepper::has_dense_output;

template <class... Types>
struct TypeList {
    static constexpr std::size_t size = sizeof...(Types);

    /// The place of a type; `size` if it is not in the list.
    template <class Type>
    [[nodiscard]] static constexpr std::size_t place() noexcept
    {
        std::size_t place = 0;
        (void)((std::is_same_v<Type, Types> || (++place, false)) || ...);
        return place;
    }

    /// An array of what `make.operator()<Type>()` returns.
    template <class Make>
    [[nodiscard]] static constexpr auto each(const Make& make)
    {
        return std::array{make.template operator()<Types>()...};
    }

    /// Calls `use.operator()<Type>()` with the type at a place; false if the list ends before it.
    template <class Use>
    static constexpr bool at(std::size_t place, const Use& use)
    {
        std::size_t i = 0;
        return ((i++ == place && (use.template operator()<Types>(), true)) || ...);
    }
};

/// The methods of `MethodName`, in its order. Every table of methods is made from this list.
using NamedMethods = TypeList<Euler, Rk4, CashKarp54, Dopri5, Fehlberg78>;

/// One of the library's own methods, which is also compiled in the library.
template <class Method>
struct NameOf {
    static constexpr bool known = NamedMethods::place<Method>() < NamedMethods::size;
    static constexpr auto name = static_cast<MethodName>(NamedMethods::place<Method>());
};

/// What is known of a method without its type.
struct NamedMethod {
    MethodName name;
    std::string_view spelled;
    bool estimates_error;
};
inline constexpr auto named_methods = NamedMethods::each([]<class Method>() {
    return NamedMethod{NameOf<Method>::name, Method::name,
                       Method::template Stepper<std::array<double, 1>>::estimates_error};
});

/// The names of the methods, of those with error estimates alone or of all, each between two
/// `quotes`: "a, b or c".
[[nodiscard]] std::string spelled_methods(bool with_error_estimate, std::string_view quotes = "");

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

/// Spells the method as programs and messages do, such as "cash-karp54".
[[nodiscard]] constexpr std::string_view name(MethodName method) noexcept
{
    return detail::named_methods[static_cast<std::size_t>(method)].spelled;
}

/// Whether steps by this method can be chosen by their error.
[[nodiscard]] constexpr bool estimates_error(MethodName method) noexcept
{
    return detail::named_methods[static_cast<std::size_t>(method)].estimates_error;
}

/// The method that is spelled so, if there is one.
[[nodiscard]] constexpr std::optional<MethodName> method_named(std::string_view spelled) noexcept
{
    for (const detail::NamedMethod& method : detail::named_methods) {
        if (method.spelled == spelled) return method.name;
    }
    return std::nullopt;
}

}  // namespace ricochet
