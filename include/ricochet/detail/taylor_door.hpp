// Internal: what it declares may change without notice.
//
// What a run by Taylor's method keeps beside the system: the constants of its flow, and the current
// step.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "ricochet/detail/door.hpp"
#include "ricochet/detail/scalar_probe.hpp"
#include "ricochet/detail/taylor_series.hpp"
#include "ricochet/detail/taylor_step.hpp"
#include "ricochet/detail/taylor_tape.hpp"
#include "ricochet/hybrid/system.hpp"

namespace ricochet::detail {

[[noreturn]] inline void throw_structure_differs(const std::string& name)
{
    throw std::invalid_argument(
        name +
        ": the operations of the flow differ from those of an object that is constructed by "
        "default; write them so that they do not depend on parameters, or use another "
        "method, such as Fehlberg78");
}
[[noreturn]] inline void throw_constant_not_finite(const std::string& name)
{
    throw std::invalid_argument(name + ": a constant of the flow is not finite");
}
[[noreturn]] inline void throw_bad_taylor_order(int order)
{
    throw std::invalid_argument("Taylor: order must be 12, 16 or 20, or 0, got " +
                                std::to_string(order));
}

/// How many tapes a flow has: one for each mode.
template <class System, std::size_t n>
[[nodiscard]] constexpr std::size_t tape_count() noexcept
{
    if constexpr (ModedScalarFlow<System, n>) {
        static_assert(
            requires { std::integral_constant<std::size_t, System::mode_count>{}; },
            "ricochet: found a flow with modes for Taylor, and no constant number of them; "
            "expected static constexpr std::size_t mode_count");
        return System::mode_count;
    } else {
        return 1;
    }
}

/// Whether the flow of a system can be a power series in arrays of n: a template over its scalar
/// that a constant expression evaluates.
template <class System, std::size_t n>
concept HasSeries = n >
0 && FlowOfScalars<System, ArraysOf<n>::template Of>&& std::is_default_constructible_v<System>&&
         RecordableFlow<System, n>;

/// A door with the constants of the flow and the current step, for states of n components.
template <class System, class X, std::size_t n>
struct TaylorDoor : Door<System, X> {
    /// Guards with series of their own.
    static constexpr std::size_t m = series_guards<System, n>();
    static constexpr bool takes_series = [] {
        static_assert(n > 0,
                      "ricochet: found a state sized at run time for Taylor; expected "
                      "std::array");
        constexpr bool callable = ScalarFlow<System, n> || ModedScalarFlow<System, n>;
        static_assert(
            callable,
            "ricochet: found no flow that takes Taylor series; expected template <class S> "
            "constexpr void flow([Mode,] const S& t, const std::array<S, n>& x, "
            "std::array<S, n>& dxdt) const");
        if constexpr (callable) {
            static_assert(std::is_default_constructible_v<System>,
                          "ricochet: found a system without a default constructor for Taylor; "
                          "expected a constexpr one, from which the operations of the flow are "
                          "read");
            static_assert(RecordableFlow<System, n>,
                          "ricochet: found a flow that no constant expression can evaluate; "
                          "expected constexpr on the flow template, on what it calls and on the "
                          "default constructor of the system");
            return RecordableFlow<System, n>;
        }
        return callable;
    }();

    TaylorDoor(const System& system, const X& like) : Door<System, X>(system, like)
    {
        if constexpr (takes_series) {
            read_all(system, std::make_index_sequence<tape_count<System, n>()>{});
        }
    }

    /// @throws std::invalid_argument if there is no such order
    void prepare_order(int order)
    {
        if (order != 0 && order != 12 && order != 16 && order != 20) throw_bad_taylor_order(order);
        given_order = order;
    }

    /// The coefficients up to `order`, or all of them where these are fewer; returns how many.
    int compute(Mode mode, double t, const double* x, int order, double* out, double* guards)
    {
        int computed = order;
        if constexpr (takes_series) {
            dispatch(mode, t, x, computed, out, guards,
                     std::make_index_sequence<tape_count<System, n>()>{});
        }
        return computed;
    }

    /// Whether the motion in a mode is a polynomial, of which `compute` has all coefficients.
    [[nodiscard]] bool is_polynomial(Mode mode) const noexcept
    {
        return polynomial_[mode < polynomial_.size() ? mode : 0];
    }

    int given_order = 0;
    TaylorStep<n, m> step;

private:
    static constexpr std::size_t most_constants = [] {
        if constexpr (!takes_series) {
            return std::size_t{0};
        } else {
            return []<std::size_t... mode>(std::index_sequence<mode...>)
            {
                return std::max({std::size_t{0},
                                 taylor_tape<System, n, static_cast<Mode>(mode)>.ops.size()...});
            }
            (std::make_index_sequence<tape_count<System, n>()>{});
        }
    }();

    static constexpr auto polynomial_ = []<std::size_t... mode>(std::index_sequence<mode...>)
    {
        if constexpr (takes_series) {
            return std::array{polynomial_order(taylor_tape<System, n, static_cast<Mode>(mode)>) <=
                              least_taylor_order...};
        } else {
            return std::array<bool, 1>{};
        }
    }
    (std::make_index_sequence<takes_series ? tape_count<System, n>() : 1>{});

    template <std::size_t... mode>
    void read_all(const System& system, std::index_sequence<mode...>)
    {
        (read<mode>(system), ...);
    }
    template <std::size_t mode>
    void read(const System& system)
    {
        const auto match =
            read_constants<System, n, static_cast<Mode>(mode)>(system, constants_[mode]);
        if (match == TapeMatch::differs) throw_structure_differs(name_of_system(system));
        if (match == TapeMatch::not_finite) throw_constant_not_finite(name_of_system(system));
    }

    template <std::size_t... mode>
    void dispatch(Mode at, double t, const double* x, int& order, double* out, double* guards,
                  std::index_sequence<mode...>)
    {
        constexpr bool one = sizeof...(mode) == 1;
        static_cast<void>((... || ((one || at == static_cast<Mode>(mode)) &&
                                   compute_in<static_cast<Mode>(mode)>(t, x, order, out, guards))));
    }
    template <Mode mode>
    bool compute_in(double t, const double* x, int& order, double* out, double* guards)
    {
        constexpr int degree = polynomial_order(taylor_tape<System, n, mode>);
        constexpr bool is_polynomial = degree <= least_taylor_order;
        if (is_polynomial) order = degree;
        using Series =
            TaylorSeries<taylor_tape<System, n, mode>, is_polynomial ? degree : most_taylor_order>;
        Series::compute(constants_[static_cast<std::size_t>(mode)].data(), t, x, order, out,
                        guards);
        return true;
    }

    std::array<std::array<double, most_constants>, tape_count<System, n>()> constants_{};
};

}  // namespace ricochet::detail
