// Internal: the declarations of this header may change without notice.
//
// One step of a method with the flow of a system inlined, while it is computed.
//
// With f0 = f(t0, x0), a method integrates
//
//     w' = f(t0 + s, x0 + s f0 + w) - f0,    w(0) = 0,    x(t0 + s) = x0 + s f0 + w(s)
//
// which is the same Runge-Kutta step, since the rows of a tableau sum to its nodes, but w is of
// second order in the step: the tableau's coefficients, which are rounded and reach 11.6 in Dormand
// and Prince's, multiply only the departure from the tangent. The state is carried as x0 +
// remainder, so that the rounding of the final addition is not lost but enters the next increment,
// and errors of rounding do not grow with the number of steps.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <type_traits>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/flow_caller.hpp"
#include "ricochet/detail/stepper_adapter.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/step_control.hpp"

// Components of a small state are computed one by one: as pairs, which g++ would form, they take
// 1.3 times as long (rk4 on the ball), because of the shuffles between flow and sums.
#if defined(__GNUC__) && !defined(__clang__)
#define RICOCHET_BY_ONES [[gnu::optimize("no-tree-slp-vectorize")]]
#else
#define RICOCHET_BY_ONES
#endif

namespace ricochet::detail {

/// Whether steps of such states are computed in registers.
template <class X>
inline constexpr bool fits_registers = is_small<X>&& std::is_trivially_copyable_v<X>;

/// A step that is computed in the variables of its caller: in registers, where the state is small.
template <class System, class X, class Method>
struct StepOf {
    using C = CoreState<X>;
    using Stepper = typename Method::template Stepper<X>;
    using State = StepState<C>;

    static_assert(!Multistep<Stepper>,
                  "ricochet: a multistep method keeps a memory that an event makes stale; "
                  "use a one-step method");

    static constexpr bool ours = Departing<Stepper>;
    static_assert(fits_registers<X> || !ours, "the library has the kernels of large states");

    [[nodiscard]] static auto& at(void* adapter) noexcept
    {
        return *static_cast<StepperAdapter<System, X, Method>*>(
            static_cast<SystemAdapter<System, X>*>(adapter));
    }

    using Caller = FlowCaller<C>;

    /// The flow at (t, x). Registers hold what no call can reach: it gets copies.
    [[gnu::always_inline]] static bool call(const Caller& caller, double t, const X& x, X& dxdt)
    {
        if constexpr (ours) {
            const X there = x;
            X rate = x;
            const bool fits = call_by_reference(caller, t, there, rate);
            dxdt = rate;
            return fits;
        } else {
            return call_by_reference(caller, t, x, dxdt);
        }
    }
    [[gnu::always_inline]] static bool call_by_reference(const Caller& caller, double t, const X& x,
                                                         X& dxdt)
    {
        [[maybe_unused]] void* const adapter = caller.adapter;
        [[maybe_unused]] const Mode mode = caller.mode;
        if constexpr (std::is_same_v<System, ByPointer>) {
            C there = as_core(x);
            C rate(fixed_size<X>());
            const bool fits = caller.flow(adapter, mode, t, there, rate);
            put(rate, dxdt);
            return fits;
        } else {
            return call_flow(at(adapter).system(), mode, t, x, dxdt);
        }
    }

    static constexpr std::size_t kept_stages = [] {
        if constexpr (ours) return Stepper::kept_stages;
        return std::size_t{0};
    }();
    using Stages = std::array<X, kept_stages + 1>;

    /// A step while it is computed; see `StepState` for the members. `room` is scratch.
    struct Values {
        explicit Values(const State& step)
            : x0(own_copy(step.x0)),
              rate0(own_copy(step.rate0)),
              remainder(own_copy(step.remainder)),
              zero(zeros_like(x0)),
              room(zero),
              w(zero),
              w_rate(zero),
              error(zero),
              x1(zero),
              rate1(zero)
        {
        }
        X x0, rate0, remainder, zero;
        X room, newest = zero, w, w_rate, error, x1, rate1;  ///< newest: of the flow itself
    };

    /// Computes the departure w after a step of length s, with its rate there and the error
    /// estimate where the method has them. `kept` holds the stages, or a user-defined stepper.
    template <class Kept>
    [[gnu::always_inline]] static void depart(Caller& caller, Kept&& kept, double s, Values& of,
                                              [[maybe_unused]] bool with_error)
    {
        X& w = of.w;
        X& rate = of.w_rate;
        X& error = of.error;
        const auto flow = [&](const auto& departure, X& departure_rate, auto offset)
            __attribute__((always_inline))
        {
            if constexpr (requires { departure.state(0, {}, offset, 0.0); }) {
                for_each_component(
                    of.x0, [&](auto i) __attribute__((always_inline)) {
                        of.room[i] =
                            departure.state(i, {of.x0[i], of.rate0[i]}, offset, of.newest[i]);
                    });
            } else {
                for_each_component(
                    of.x0, [&](auto i) __attribute__((always_inline)) {
                        of.room[i] = of.x0[i] + (offset * of.rate0[i] + departure[i]);
                    });
            }
            ++caller.calls;
            if (caller.backward) {
                const double t = caller.stage_time(caller.start.plus(-offset), offset);
                caller.fits &= call(caller, t, of.room, departure_rate);
                for_each_component(
                    of.x0, [&](auto i) __attribute__((always_inline)) {
                        of.newest[i] = -departure_rate[i];
                        departure_rate[i] = of.newest[i] - of.rate0[i];
                    });
            } else {
                const double t = caller.stage_time(caller.start.plus(offset), offset);
                caller.fits &= call(caller, t, of.room, departure_rate);
                for_each_component(
                    of.x0, [&](auto i) __attribute__((always_inline)) {
                        of.newest[i] = departure_rate[i];
                        departure_rate[i] = of.newest[i] - of.rate0[i];
                    });
            }
        };
        if constexpr (ours) {
            using Ours = RungeKutta<typename Stepper::Coefficients, X>;
            Ours::depart(flow, of.zero, s, kept, {w, rate, error}, with_error, Ours::inner_stages);
        } else {
            depart_by_stepper(kept, flow, s, of, with_error);
        }
    }

    template <class Flow>
    [[gnu::always_inline]] static void depart_by_stepper(Stepper& stepper, const Flow& flow,
                                                         double s, Values& of,
                                                         [[maybe_unused]] bool with_error)
    {
        X& w = of.w;
        const X& zero = of.zero;
        if constexpr (has_error_estimate<Stepper>) {
            if (with_error) {
                if constexpr (is_fsal<Stepper>) {
                    stepper.do_step(flow, zero, zero, 0.0, w, of.w_rate, s, of.error);
                } else {
                    stepper.do_step(flow, zero, zero, 0.0, w, s, of.error);
                }
                return;
            }
        }
        if constexpr (is_fsal<Stepper>) {
            stepper.do_step(flow, zero, zero, 0.0, w, of.w_rate, s);
        } else if constexpr (requires { stepper.do_step(flow, w, w, 0.0, w, s); }) {
            stepper.do_step(flow, zero, zero, 0.0, w, s);
        } else if constexpr (requires { stepper.do_step(flow, w, 0.0, w, s); }) {
            stepper.do_step(flow, zero, 0.0, w, s);
        } else {
            w = zero;
            stepper.do_step(flow, w, 0.0, s);
        }
    }

    /// to = from, which may be of another type.
    template <class From, class To>
    [[gnu::always_inline]] static void put(const From& from, To& to)
    {
        [&]<std::size_t... I>(std::index_sequence<I...>) __attribute__((always_inline))
        {
            ((to[own(I, to)] = from[own(I, from)]), ...);
        }
        (std::make_index_sequence<fixed_size<X>()>{});
    }
    /// A state as the functions of a `SystemTable` take it.
    [[nodiscard, gnu::always_inline]] static C as_core(const X& x)
    {
        C there(fixed_size<X>());
        put(x, there);
        return there;
    }
    [[nodiscard, gnu::always_inline]] static X own_copy(const C& from)
    {
        X to{};
        if constexpr (ours) {
            for_each_component(
                to, [&](auto i) __attribute__((always_inline)) { to[i] = from[own(i, from)]; });
        } else {
            copy_state(from, to);
        }
        return to;
    }

    /// Stores the current step from the registers.
    [[gnu::always_inline]] static void store(State& step, [[maybe_unused]] const Stages& k,
                                             const Values& of)
    {
        if constexpr (ours) {
            put(of.w, step.w);
            if constexpr (is_fsal<Stepper>) put(of.w_rate, step.w_rate1);
            if constexpr (Stepper::has_dense_output) {
                for (std::size_t i = 0; i < kept_stages; ++i) {
                    if constexpr (fixed_size<C>() == 0) step.stages[i].resize(fixed_size<X>());
                    put(k[i], step.stages[i]);
                }
            }
            put(of.x1, step.x1);
            put(of.rate1, step.rate1);
        } else {
            copy_state(of.w, step.w);
            copy_state(of.w_rate, step.w_rate1);
            copy_state(of.x1, step.x1);
            copy_state(of.rate1, step.rate1);
        }
        find_remainder(step, step.h);
    }

    /// Computes the end of a step from its departure; false if it is not finite.
    [[gnu::always_inline]] static bool end([[maybe_unused]] Caller& caller, double h, Values& of)
    {
        for_each_component(
            of.x0, [&](auto i) __attribute__((always_inline)) {
                of.x1[i] = of.x0[i] + (h * of.rate0[i] + (of.w[i] + of.remainder[i]));
            });
        if constexpr (is_fsal<Stepper>) {
            for_each_component(
                of.x0, [&](auto i) __attribute__((always_inline)) {
                    of.rate1[i] = of.rate0[i] + of.w_rate[i];
                });
        } else {
            ++caller.calls;
            caller.fits &= call(caller, caller.stage_time(caller.time(h), h), of.x1, of.rate1);
            if (caller.backward) {
                for_each_component(
                    of.x0, [&](auto i)
                               __attribute__((always_inline)) { of.rate1[i] = -of.rate1[i]; });
            }
        }
        return all_finite(of.x1) && all_finite(of.rate1);
    }

    /// By the reciprocal of the tolerance, which does not wait for the error.
    [[nodiscard, gnu::always_inline]] static double ratio_of(double error, double x0, double x1,
                                                             double rtol, double atol) noexcept
    {
        const double size = greatest_of(std::fabs(x0), std::fabs(x1));
        return std::fabs(error) * (1 / greatest_of(atol + rtol * size, least_tolerance));
    }

    /// @param atol  of a component
    template <class Atol>
    [[gnu::always_inline]] static double worst_ratio(const Values& of, double rtol,
                                                     const Atol& atol) noexcept
    {
        double worst = 0;
        double lost = 0;
        for_each_component(
            of.x0, [&](auto i) __attribute__((always_inline)) {
                const double ratio = ratio_of(of.error[i], of.x0[i], of.x1[i], rtol, atol(i));
                worst = ratio > worst ? ratio : worst;
                lost += 0 * ratio;  // NaN where it is not finite
            });
        return worst + lost;
    }

    [[gnu::always_inline]] static double worst_ratio(const State& step, const Values& of,
                                                     double rtol, double atol) noexcept
    {
        if (const double* const each = step.component_atol) {
            return worst_ratio(
                of, rtol, [&](auto i) __attribute__((always_inline)) { return each[i]; });
        }
        return worst_ratio(
            of, rtol, [&](auto) __attribute__((always_inline)) { return atol; });
    }

    /// Finds the remainder at the end of a step that was computed with other states.
    static void find_remainder([[maybe_unused]] State& step, [[maybe_unused]] double h)
    {
        if constexpr (!is_small<C>) {
            for_each_component(
                step.x0, [&](auto i) __attribute__((always_inline)) {
                    step.large.remainder1[i] =
                        two_sum(step.x0[i], h * step.rate0[i] + (step.w[i] + step.remainder[i]))
                            .remainder;
                });
        }
    }
};

}  // namespace ricochet::detail
