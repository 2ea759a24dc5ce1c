// Internal: the declarations of this header may change without notice.
//
// Vector-Jacobian products of a system's functions: by members of the system, by recorded numbers
// where the functions are templates over their scalar, else by differences.
//
//     flow_vjp([mode,] t, x, weights, to)             adds w . (df/dx, df/dt, df/dp)
//     guard_vjp([which,] [mode,] t, x, weight, to)
//     reset_vjp([which,] [mode,] t, x, weights, to)   x: the state before the reset
//     time_reset_vjp([mode,] t, x, weights, to)
//     rest_vjp(which, mode, t, x, weights, to)
//
// Each is optional and const; x and weights are states, `to` is a `Cotangent`.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/dual_derivatives.hpp"
#include "ricochet/sensitivity/detail/dual_parameter.hpp"
#include "ricochet/sensitivity/detail/linearization.hpp"
#include "ricochet/sensitivity/detail/reverse.hpp"
#include "ricochet/sensitivity/family.hpp"
#include "ricochet/sensitivity/pullback.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

namespace detail {

/// A state of the flat numbers x.
template <class X>
[[nodiscard]] X state_of_numbers(std::span<const double> x)
{
    X state = state_of_size<X>(x.size());
    std::size_t k = 0;
    for_each_component(state, [&](auto i) { state[i] = x[k++]; });
    return state;
}

template <class X>
void put_numbers(const X& state, std::span<double> to)
{
    std::size_t k = 0;
    for_each_component(state, [&](auto i) { to[k++] = state[i]; });
}

/// No template over parameters: the system's own functions may be templates over their scalar.
template <class System>
struct ItsOwn {
    const System* system;

    template <class S>
    [[nodiscard]] const System& made(std::span<const S> /*p*/) const
    {
        return *system;
    }
    [[nodiscard]] std::span<const double> values() const noexcept { return {}; }
};

template <class Make>
struct MadeBy {
    const Family<Make>* family;

    template <class S>
    [[nodiscard]] auto made(std::span<const S> p) const
    {
        return family->make(p);
    }
    [[nodiscard]] std::span<const double> values() const noexcept { return family->values; }
};

/// The number of parameters of which the system's own members know the derivatives.
template <class System>
[[nodiscard]] std::size_t parameter_count_of(const System& system)
{
    if constexpr (requires { std::size_t{system.parameter_count()}; }) {
        return system.parameter_count();
    } else if constexpr (requires { std::size_t{System::parameter_count}; }) {
        return System::parameter_count;
    } else {
        return 0;
    }
}

/// @tparam Source  `ItsOwn` or `MadeBy`
template <class System, class X, class Source>
class SystemPullback final : public Pullback {
    using States = WithScalar<X, Reverse>;
    using Made = std::remove_cvref_t<decltype(std::declval<const Source&>().made(
        std::span<const Reverse>()))>;
    static constexpr bool has_family = !std::is_same_v<Source, ItsOwn<System>>;

    static constexpr bool flow_member =
        requires(const System& s, double t, const X& x, const Cotangent& to)
    {
        s.flow_vjp(t, x, x, to);
    }
    || requires(const System& s, Mode mode, double t, const X& x, const Cotangent& to)
    {
        s.flow_vjp(mode, t, x, x, to);
    };
    static constexpr bool flow_recorded = FlowAt<Made, Reverse, States>;
    static constexpr bool guard_recorded = GuardAt<Made, Reverse, States>;

public:
    /// @param by  parameters by differences, in place of a family
    SystemPullback(const System& system, const Source& source, std::vector<Parameter<System>> by,
                   const Differences& differences, std::size_t components)
        : system_(system),
          source_(source),
          count_(!by.empty()  ? by.size()
                 : has_family ? source.values().size()
                              : parameter_count_of(system)),
          by_differences_(!by.empty())
    {
        if constexpr (has_family) {
            if (needs_differences()) by = parameters_of(source);
        }
        linearization_.emplace(system, by, differences, components);
        differences_ = differences;
    }

    [[nodiscard]] std::size_t parameters() const override { return count_; }

    void flow(Mode mode, double t, std::span<const double> x, std::span<double> rate) const override
    {
        const X at = state_of_numbers<X>(x);
        X f = at;
        call_flow(system_, mode, t, at, f);
        put_numbers(f, rate);
    }

    void flow_back(Mode mode, double t, std::span<const double> x, std::span<const double> weights,
                   const Cotangent& to) const override
    {
        if constexpr (flow_member) {
            const X at = state_of_numbers<X>(x);
            const X w = state_of_numbers<X>(weights);
            if constexpr (requires { system_.flow_vjp(mode, t, at, w, to); }) {
                system_.flow_vjp(mode, t, at, w, to);
            } else {
                system_.flow_vjp(t, at, w, to);
            }
        } else if constexpr (flow_recorded) {
            record(
                t, x, to,
                [&](const Made& system, const Reverse& time, States& state) {
                    States rate = state;
                    flow_of_scalar(system, mode, time, std::as_const(state), rate);
                    state = rate;
                    return true;
                },
                weights);
            if (by_differences_) {
                add_parameters(
                    weights, to,
                    [&](std::size_t j, const X& at) {
                        X by = at;
                        linearization_->flow_by(j, mode, t, at, by);
                        return by;
                    },
                    x);
            }
        } else {
            differentiate_flow(mode, t, x, weights, to);
        }
    }

    void guard_back(std::size_t which, Mode mode, double t, std::span<const double> x,
                    double weight, const Cotangent& to) const override
    {
        if constexpr (Guarded<System, X>) {
            const X at = state_of_numbers<X>(x);
            if constexpr (requires { system_.guard_vjp(which, mode, t, at, weight, to); }) {
                system_.guard_vjp(which, mode, t, at, weight, to);
            } else if constexpr (CountsGuards<System> &&
                                 requires { system_.guard_vjp(which, t, at, weight, to); }) {
                system_.guard_vjp(which, t, at, weight, to);
            } else if constexpr (requires { system_.guard_vjp(mode, t, at, weight, to); }) {
                system_.guard_vjp(mode, t, at, weight, to);
            } else if constexpr (requires { system_.guard_vjp(t, at, weight, to); }) {
                system_.guard_vjp(t, at, weight, to);
            } else if constexpr (guard_recorded) {
                const double weights[1] = {weight};
                record(
                    t, x, to,
                    [&](const Made& system, const Reverse& time, States& state) {
                        const Reverse g =
                            guard_of_scalar(system, which, mode, time, std::as_const(state));
                        state[0] = g;
                        return true;
                    },
                    weights);
                if (by_differences_) add_guard_parameters(which, mode, t, at, weight, to);
            } else {
                differentiate_guard(which, mode, t, at, weight, to);
            }
        }
    }

    void reset_back(std::size_t which, Mode mode, double t, std::span<const double> x,
                    std::span<const double> weights, const Cotangent& to) const override
    {
        if (which == no_guard) return time_reset_back(mode, t, x, weights, to);
        if constexpr (Resetting<System, X>) {
            const X at = state_of_numbers<X>(x);
            const X w = state_of_numbers<X>(weights);
            if constexpr (requires { system_.reset_vjp(which, mode, t, at, w, to); }) {
                system_.reset_vjp(which, mode, t, at, w, to);
            } else if constexpr (CountsGuards<System> &&
                                 requires { system_.reset_vjp(which, t, at, w, to); }) {
                system_.reset_vjp(which, t, at, w, to);
            } else if constexpr (requires { system_.reset_vjp(mode, t, at, w, to); }) {
                system_.reset_vjp(mode, t, at, w, to);
            } else if constexpr (requires { system_.reset_vjp(t, at, w, to); }) {
                system_.reset_vjp(t, at, w, to);
            } else {
                back_through(ResetOf{which}, mode, t, x, weights, to);
            }
        }
    }

    void rest_back(std::size_t which, Mode mode, double t, std::span<const double> x,
                   std::span<const double> weights, const Cotangent& to) const override
    {
        if constexpr (Resting<System, X>) {
            const X at = state_of_numbers<X>(x);
            const X w = state_of_numbers<X>(weights);
            if constexpr (requires { system_.rest_vjp(which, mode, t, at, w, to); }) {
                system_.rest_vjp(which, mode, t, at, w, to);
            } else {
                back_through(RestOf{which}, mode, t, x, weights, to);
            }
        }
    }

private:
    void time_reset_back(Mode mode, double t, std::span<const double> x,
                         std::span<const double> weights, const Cotangent& to) const
    {
        const X at = state_of_numbers<X>(x);
        const X w = state_of_numbers<X>(weights);
        if constexpr (requires { system_.time_reset_vjp(mode, t, at, w, to); }) {
            system_.time_reset_vjp(mode, t, at, w, to);
        } else if constexpr (requires { system_.time_reset_vjp(t, at, w, to); }) {
            system_.time_reset_vjp(t, at, w, to);
        } else {
            back_through(TimeReset{}, mode, t, x, weights, to);
        }
    }

    static constexpr bool reset_recorded = !Resetting<System, X> ||
                                           ResetTakes<Made, Reverse, States> ||
                                           ResetTakes<Made, Reverse, States, std::size_t>;

    /// Whether one of the functions of a family may not be a template.
    [[nodiscard]] static constexpr bool needs_differences() noexcept
    {
        return !((flow_member || flow_recorded) &&
                 (guard_recorded || !Guarded<System, X>)&&reset_recorded) ||
               Resting<System, X> || TimeResetting<System, X>;
    }

    /// The parameters of a family one by one, for functions that are no templates.
    [[nodiscard]] static std::vector<Parameter<System>> parameters_of(const Source& source)
    {
        const std::vector<double> values(source.values().begin(), source.values().end());
        std::vector<Parameter<System>> out(values.size());
        for (std::size_t j = 0; j < values.size(); ++j) {
            out[j].nominal = values[j];
            out[j].with = [source, values, j](double value) -> System {
                std::vector<double> p = values;
                p[j] = value;
                return source.made(std::span<const double>(p));
            };
        }
        return out;
    }

    /// Records a function that leaves its results in the state, and goes back from them. False:
    /// there is no such function of recorded numbers.
    template <class Function>
    bool record(double t, std::span<const double> x, const Cotangent& to, const Function& function,
                std::span<const double> weights) const
    {
        thread_local ReverseTape tape;
        thread_local std::vector<Reverse> parameters;
        const ReverseRecording recording(tape);
        tape.shrink(1);
        const auto variable = [](double value) { return Reverse(value, tape.variable()); };
        const std::span<const double> values = source_.values();
        parameters.clear();
        for (const double p : values) parameters.push_back(variable(p));
        const Reverse time = variable(t);
        States state{};
        if constexpr (fixed_size<X>() == 0) state.resize(x.size());
        for (std::size_t i = 0; i < x.size(); ++i) state[i] = variable(x[i]);
        const auto first = static_cast<std::uint32_t>(tape.size() - x.size());
        const auto& system = source_.made(std::span<const Reverse>(parameters));
        if (!function(system, time, state)) return false;
        tape.clear_adjoints();
        for (std::size_t i = 0; i < weights.size(); ++i) {
            if (state[i].entry != 0) tape.adjoint(state[i].entry) += weights[i];
        }
        tape.sweep();
        for (std::size_t j = 0; j < values.size(); ++j) {
            to.p[j] += tape.adjoint(parameters[j].entry);
        }
        to.t += tape.adjoint(time.entry);
        for (std::size_t i = 0; i < x.size(); ++i) {
            to.x[i] += tape.adjoint(first + static_cast<std::uint32_t>(i));
        }
        return true;
    }

    /// Applies a reset of recorded numbers.
    [[nodiscard]] static bool apply(const ResetOf& reset, const Made& system, Mode mode,
                                    const Reverse& t, States& x)
    {
        return reset_of_scalar(system, reset.all(), mode, t, x);
    }
    [[nodiscard]] static bool apply(const RestOf& rest, const Made& system, Mode mode,
                                    const Reverse& t, States& x)
    {
        if constexpr (CountsGuards<Made> && requires { system.rest(rest.which, mode, t, x); }) {
            static_cast<void>(system.rest(rest.which, mode, t, x));
            return true;
        } else if constexpr (CountsGuards<Made> && requires { system.rest(rest.which, t, x); }) {
            static_cast<void>(system.rest(rest.which, t, x));
            return true;
        } else if constexpr (!CountsGuards<Made> && requires { system.rest(mode, t, x); }) {
            static_cast<void>(system.rest(mode, t, x));
            return true;
        } else if constexpr (!CountsGuards<Made> && requires { system.rest(t, x); }) {
            static_cast<void>(system.rest(t, x));
            return true;
        } else {
            return false;
        }
    }
    [[nodiscard]] static bool apply(const TimeReset& /*reset*/, const Made& system, Mode mode,
                                    const Reverse& t, States& x)
    {
        if constexpr (!TimeResetting<System, X>) {
            return true;
        } else if constexpr (requires { system.time_reset(mode, t, x); }) {
            static_cast<void>(system.time_reset(mode, t, x));
            return true;
        } else if constexpr (requires { system.time_reset(t, x); }) {
            system.time_reset(t, x);
            return true;
        } else {
            return false;
        }
    }

    template <class Reset>
    void back_through(const Reset& reset, Mode mode, double t, std::span<const double> x,
                      std::span<const double> weights, const Cotangent& to) const
    {
        bool exact = reset_settles_all(reset);
        if (exact) {
            for (std::size_t i = 0; i < x.size(); ++i) to.x[i] += weights[i];
            return;
        }
        exact = record(
            t, x, to,
            [&](const Made& system, const Reverse& time, States& state) {
                return apply(reset, system, mode, time, state) && state.size() == weights.size();
            },
            weights);
        const X at = state_of_numbers<X>(x);
        if (!exact) {
            const auto along = [&](double dt, const X& s) {
                return linearization_->reset_along(reset, {.mode = mode, .t = t, .dt = dt, .x = at},
                                                   s);
            };
            add_products(at, weights, to, along);
        }
        if (by_differences_ || !exact) {
            add_parameters(
                weights, to,
                [&](std::size_t j, const X& state) {
                    return linearization_->reset_by(j, reset, mode, t, state);
                },
                x);
        }
    }

    template <class Reset>
    [[nodiscard]] static bool reset_settles_all(const Reset& reset) noexcept
    {
        if constexpr (requires { reset.template settles<System>(); }) {
            return reset.template settles<System>();
        } else {
            return false;
        }
    }

    /// Adds the products with derivatives along every component and the time.
    template <class AlongDirection>
    static void add_products(const X& at, std::span<const double> weights, const Cotangent& to,
                             const AlongDirection& along)
    {
        X unit = zeros_shaped_like(at);
        to.t += product(weights, along(1, unit));
        std::size_t k = 0;
        for_each_component(at, [&](auto i) {
            unit[i] = 1;
            to.x[k++] += product(weights, along(0, unit));
            unit[i] = 0;
        });
    }

    template <class By>
    void add_parameters(std::span<const double> weights, const Cotangent& to, const By& by,
                        std::span<const double> x) const
    {
        const X at = state_of_numbers<X>(x);
        for (std::size_t j = 0; j < linearization_->parameters(); ++j) {
            to.p[j] += product(weights, by(j, at));
        }
    }

    void differentiate_flow(Mode mode, double t, std::span<const double> x,
                            std::span<const double> weights, const Cotangent& to) const
    {
        const X at = state_of_numbers<X>(x);
        const auto along = [&](double dt, const X& s) {
            X ds = at;
            if (dt == 0) {
                linearization_->flow_along(mode, t, at, s, ds);
            } else {
                const double h = differences_.step * differences_.time_scale;
                differentiate_into(ds, central_stencil, h, [&](std::size_t k, X& f) {
                    call_flow(system_, mode, t + central_stencil.offset[k] * h, at, f);
                });
            }
            return ds;
        };
        add_products(at, weights, to, along);
        add_parameters(
            weights, to,
            [&](std::size_t j, const X& state) {
                X by = state;
                linearization_->flow_by(j, mode, t, state, by);
                return by;
            },
            x);
    }

    void differentiate_guard(std::size_t which, Mode mode, double t, const X& at, double weight,
                             const Cotangent& to) const
    {
        X unit = zeros_shaped_like(at);
        to.t += weight * linearization_->guard_rate(which, mode, t, at, unit);
        std::size_t k = 0;
        for_each_component(at, [&](auto i) {
            unit[i] = 1;
            to.x[k++] += weight * linearization_->guard_along(which, mode, t, at, unit);
            unit[i] = 0;
        });
        add_guard_parameters(which, mode, t, at, weight, to);
    }
    void add_guard_parameters(std::size_t which, Mode mode, double t, const X& at, double weight,
                              const Cotangent& to) const
    {
        for (std::size_t j = 0; j < linearization_->parameters(); ++j) {
            to.p[j] += weight * linearization_->guard_by(j, which, mode, t, at);
        }
    }

    [[nodiscard]] static double product(std::span<const double> weights, const X& s)
    {
        double sum = 0;
        std::size_t k = 0;
        for_each_component(s, [&](auto i) { sum += weights[k++] * s[i]; });
        return sum;
    }

    const System& system_;
    Source source_;
    std::size_t count_;
    bool by_differences_;
    std::optional<Linearization<System, X>> linearization_;
    Differences differences_;
};

}  // namespace detail

}  // namespace ricochet
