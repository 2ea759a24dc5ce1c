// Internal: the declarations of this header may change without notice.
//
// Whole steps of a method with the flow of a system inlined.
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

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <type_traits>

#include "ricochet/detail/cubic_check.hpp"
#include "ricochet/detail/flow_caller.hpp"
#include "ricochet/detail/quiet_run.hpp"
#include "ricochet/detail/step_control.hpp"
#include "ricochet/detail/stepper_door.hpp"
#include "ricochet/integrate/methods.hpp"

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

template <class System, class X, class Method>
class KernelOf {
    using C = CoreState<X>;
    using Stepper = typename Method::template Stepper<X>;
    using State = StepState<C>;

    static_assert(!Multistep<Stepper>,
                  "ricochet: a multistep method keeps a memory that an event makes stale; "
                  "use a one-step method");

    static constexpr bool ours = Departing<Stepper>;
    /// The compiler keeps a small state that nothing else refers to in registers from stage to
    /// stage.
    static constexpr bool in_registers = fits_registers<X>;
    static_assert(in_registers || !ours, "the library has the kernels of large states");
    using Y = X;  ///< the type with which a step is computed

    [[nodiscard]] static auto& at(void* door) noexcept
    {
        return *static_cast<StepperDoor<System, X, Method>*>(static_cast<Door<System, X>*>(door));
    }

    using Caller = FlowCaller<C>;

    [[gnu::always_inline]] static bool call(const Caller& caller, double t, const Y& x, Y& dxdt)
    {
        [[maybe_unused]] void* const door = caller.door;
        [[maybe_unused]] const Mode mode = caller.mode;
        if constexpr (std::is_same_v<System, ByPointer>) {
            return caller.flow(door, mode, t, x, dxdt);
        } else {
            return call_flow(at(door).system(), mode, t, x, dxdt);
        }
    }

    /// Start of a step.
    struct Origin {
        const Y& x;
        const Y& rate;
        const Y& zero;
    };

    /// The departure w after a step of length s, with its rate there and the error estimate where
    /// the method has them. `kept` holds the stages, or a user-defined stepper; `room` is scratch.
    template <bool with_error, class Kept>
    [[gnu::always_inline]] static void depart(Caller& caller, Kept&& kept, const Origin& from,
                                              double s, Y& room, Y& w, Y& rate, Y& error)
    {
        const auto flow = [&](const auto& departure, Y& departure_rate, double offset)
            __attribute__((always_inline))
        {
            for_each_component(from.x, [&](auto i) {
                room[i] = from.x[i] + (offset * from.rate[i] + departure[i]);
            });
            ++caller.calls;
            if (caller.backward) {
                caller.fits &= call(caller, caller.start.plus(-offset), room, departure_rate);
                for_each_component(
                    from.x, [&](auto i) { departure_rate[i] = -departure_rate[i] - from.rate[i]; });
            } else {
                caller.fits &= call(caller, caller.start.plus(offset), room, departure_rate);
                for_each_component(from.x, [&](auto i) { departure_rate[i] -= from.rate[i]; });
            }
        };
        if constexpr (ours) {
            RungeKutta<typename Stepper::Coefficients, Y>::template depart<with_error>(
                flow, from.zero, s, kept, w, rate, error);
        } else if constexpr (is_fsal<Stepper> && with_error) {
            kept.do_step(flow, from.zero, from.zero, 0.0, w, rate, s, error);
        } else if constexpr (is_fsal<Stepper>) {
            kept.do_step(flow, from.zero, from.zero, 0.0, w, rate, s);
        } else if constexpr (with_error) {
            kept.do_step(flow, from.zero, from.zero, 0.0, w, s, error);
        } else if constexpr (requires { kept.do_step(flow, w, w, 0.0, w, s); }) {
            kept.do_step(flow, from.zero, from.zero, 0.0, w, s);
        } else if constexpr (requires { kept.do_step(flow, w, 0.0, w, s); }) {
            kept.do_step(flow, from.zero, 0.0, w, s);
        } else {
            w = from.zero;
            kept.do_step(flow, w, 0.0, s);
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
    [[nodiscard, gnu::always_inline]] static X loaded(const C& from)
    {
        X to;
        for_each_component(to, [&](auto i) { to[i] = from[own(i, from)]; });
        return to;
    }

    /// Stores the current step from the registers.
    template <class Stages>
    [[gnu::always_inline]] static void store(State& step, [[maybe_unused]] const Stages& k,
                                             const X& w, [[maybe_unused]] const X& w_rate,
                                             const X& x1, const X& rate1)
    {
        put(w, step.w);
        if constexpr (is_fsal<Stepper>) put(w_rate, step.w_rate1);
        if constexpr (Stepper::has_dense_output) {
            for (std::size_t i = 0; i < kept_stages; ++i) {
                if constexpr (fixed_size<C>() == 0) step.stages[i].resize(fixed_size<X>());
                put(k[i], step.stages[i]);
            }
        }
        put(x1, step.x1);
        put(rate1, step.rate1);
        find_remainder(step, step.h);
    }

    static constexpr std::size_t kept_stages = [] {
        if constexpr (ours) return Stepper::kept_stages;
        return std::size_t{0};
    }();

    /// Computes the end of a step from `w`; false if it is not finite.
    [[gnu::always_inline]] static bool end([[maybe_unused]] Caller& caller, double h, const Y& x0,
                                           const Y& rate0, const Y& remainder, const Y& w,
                                           [[maybe_unused]] const Y& w_rate, Y& x1, Y& rate1)
    {
        for_each_component(x0,
                           [&](auto i) { x1[i] = x0[i] + (h * rate0[i] + (w[i] + remainder[i])); });
        if constexpr (is_fsal<Stepper>) {
            for_each_component(x0, [&](auto i) { rate1[i] = rate0[i] + w_rate[i]; });
        } else {
            ++caller.calls;
            caller.fits &= call(caller, caller.time(h), x1, rate1);
            if (caller.backward) for_each_component(x0, [&](auto i) { rate1[i] = -rate1[i]; });
        }
        return all_finite(x1) && all_finite(rate1);
    }

    [[nodiscard, gnu::always_inline]] static double ratio_of(double error, double x0, double x1,
                                                             double rtol, double atol) noexcept
    {
        const double size = std::max(std::fabs(x0), std::fabs(x1));
        const double ratio = std::fabs(error) / (atol + rtol * size);
        return error == 0 ? 0 : ratio;
    }

    /// @param atol  of a component
    template <class Atol>
    [[gnu::always_inline]] static double worst_ratio(const Y& x0, const Y& x1, const Y& errors,
                                                     double rtol, const Atol& atol) noexcept
    {
        double worst = 0;
        double lost = 0;
        for_each_component(x0, [&](auto i) {
            const double ratio = ratio_of(errors[i], x0[i], x1[i], rtol, atol(i));
            worst = ratio > worst ? ratio : worst;
            lost += 0 * ratio;  // NaN where it is not finite
        });
        return worst + lost;
    }

    [[gnu::always_inline]] static double worst_ratio(const State& step, const Y& x0, const Y& x1,
                                                     const Y& errors, double rtol,
                                                     double atol) noexcept
    {
        if (const double* const each = step.component_atol) {
            return worst_ratio(x0, x1, errors, rtol, [&](auto i) { return each[i]; });
        }
        return worst_ratio(x0, x1, errors, rtol, [&](auto) { return atol; });
    }

    /// Takes a step. Returns the largest ratio of error to tolerance, 0 without an estimate; NaN if
    /// the step is not finite.
    template <bool with_error>
    [[gnu::always_inline]] static double go(void* door, State& step, double h, double rtol,
                                            double atol)
    {
        step.h = h;
        step.has_middle = false;
        step.asked_alone = 0;
        Caller caller(door, step);
        if constexpr (ours) {
            std::array<X, kept_stages + 1> k;
            const X x0 = loaded(step.x0);
            const X rate0 = loaded(step.rate0);
            const X remainder = loaded(step.remainder);
            const X zero = zeros_like(x0);
            X room = zero, w = zero, rate = zero, error = zero, x1 = zero, rate1 = zero;
            depart<with_error>(caller, k.data(), {x0, rate0, zero}, h, room, w, rate, error);
            const bool finite = end(caller, h, x0, rate0, remainder, w, rate, x1, rate1);
            store(step, k, w, rate, x1, rate1);
            caller.leave(step);
            if (!finite) return std::numeric_limits<double>::quiet_NaN();
            return with_error ? worst_ratio(step, x0, x1, error, rtol, atol) : 0;
        } else {
            const X x0 = converted(step.x0);
            const X rate0 = converted(step.rate0);
            const X remainder = converted(step.remainder);
            const X zero = zeros_like(x0);
            X room = zero, w = zero, rate = zero, error = zero, x1 = zero, rate1 = zero;
            depart<with_error>(caller, at(door).advancing, {x0, rate0, zero}, h, room, w, rate,
                               error);
            copy_state(w, step.w);
            copy_state(rate, step.w_rate1);
            const bool finite = end(caller, h, x0, rate0, remainder, w, rate, x1, rate1);
            copy_state(x1, step.x1);
            copy_state(rate1, step.rate1);
            find_remainder(step, h);
            caller.leave(step);
            if (!finite) return std::numeric_limits<double>::quiet_NaN();
            return with_error ? worst_ratio(step, x0, x1, error, rtol, atol) : 0;
        }
    }

    /// Finds the remainder at the end of a step that was computed with other states.
    static void find_remainder([[maybe_unused]] State& step, [[maybe_unused]] double h)
    {
        if constexpr (!is_small<C>) {
            for_each_component(step.x0, [&](auto i) {
                step.large.remainder1[i] =
                    two_sum(step.x0[i], h * step.rate0[i] + (step.w[i] + step.remainder[i]))
                        .remainder;
            });
        }
    }

    [[nodiscard]] static X converted(const C& x)
    {
        X out{};
        copy_state(x, out);
        return out;
    }

    RICOCHET_BY_ONES static bool take(void* door, State& step, double h)
    {
        const double ratio = go<false>(door, step, h, 0, 0);
        return ratio == ratio;
    }

    RICOCHET_BY_ONES static double attempt(void* door, State& step, double h, double rtol,
                                           double atol)
    {
        return go<true>(door, step, h, rtol, atol);
    }

    RICOCHET_BY_ONES static void depart_only(void* door, State& step, double s, C& w, C& rate)
    {
        Caller caller(door, step);
        if constexpr (ours) {
            std::array<X, kept_stages + 1> k;
            const X x0 = loaded(step.x0);
            const X rate0 = loaded(step.rate0);
            const X zero = zeros_like(x0);
            X room = zero, w_own = zero, rate_own = zero, unused = zero;
            depart<false>(caller, k.data(), {x0, rate0, zero}, s, room, w_own, rate_own, unused);
            put(w_own, w);
            if constexpr (is_fsal<Stepper>) put(rate_own, rate);
        } else {
            const X x0 = converted(step.x0);
            const X rate0 = converted(step.rate0);
            const X zero = zeros_like(x0);
            X room = zero, w_own = zero, rate_own = zero, unused = zero;
            depart<false>(caller, at(door).probing, {x0, rate0, zero}, s, room, w_own, rate_own,
                          unused);
            copy_state(w_own, w);
            if constexpr (is_fsal<Stepper>) copy_state(rate_own, rate);
        }
        caller.leave(step);
    }

    static void departure(void* door, const State& step, double s, C& w)
    {
        const X zero = converted(step.zero);
        X out = zero;
        at(door).advancing.calc_state(s, out, zero, zero, 0.0, converted(step.w),
                                      converted(step.w_rate1), step.h);
        copy_state(out, w);
    }

    static void renew(void* door)
    {
        for (Stepper* stepper : {&at(door).advancing, &at(door).probing}) {
            if constexpr (std::is_trivially_destructible_v<Stepper>) {
                std::construct_at(stepper);  // an assignment would copy what is not yet written
            } else {
                *stepper = Stepper();
            }
        }
    }

    // --- quiet runs ---

    /// The state at the fraction `InsideOf::u` of the step, as `Step::peek` computes it.
    template <class Stages>
    [[gnu::always_inline]] static X peeked(double h, const X& x0, const X& rate0,
                                           const X& remainder, [[maybe_unused]] const Stages& k,
                                           const X& w, const X& w_rate,
                                           [[maybe_unused]] const X& rate1)
    {
        X x;
        const double s = InsideOf::u * h;
        if constexpr (Stepper::has_dense_output) {
            using Ours = RungeKutta<typename Stepper::Coefficients, X>;
            const auto weights = Ours::template weights<InsideOf>(h);
            for_each_component(
                x0, [&](auto i) __attribute__((always_inline)) {
                    const double d = Ours::dense(weights, k.data(), w_rate, i);
                    x[i] = x0[i] + (s * rate0[i] + (d + remainder[i]));
                });
        } else {
            const double u = s / h;
            const double value = u * u * (3 - 2 * u);
            const double slope = h * u * u * (u - 1);
            for_each_component(
                x0, [&](auto i) __attribute__((always_inline)) {
                    const double d = value * w[i] + slope * (rate1[i] - rate0[i]);
                    x[i] = x0[i] + (s * rate0[i] + (d + remainder[i]));
                });
        }
        return x;
    }

    [[nodiscard, gnu::always_inline]] static bool hardly_moves(const X& x0, const X& x1) noexcept
    {
        bool still = true;
        for_each_component(
            x0, [&](auto i) { still &= std::fabs(x1[i] - x0[i]) <= 0x1p-10 * std::fabs(x0[i]); });
        return still;
    }

    [[nodiscard]] static double smallest_step(double h_min, double t) noexcept
    {
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(t);
        return std::max(h_min, std::max(4 * ulp, std::numeric_limits<double>::min()));
    }

    [[nodiscard, gnu::always_inline]] static auto guard_of(void* door, QuietRun& run,
                                                           const Caller& caller)
    {
        if constexpr (std::is_same_v<System, ByPointer>) {
            static constexpr GuardInfo unused{};
            const SystemAt<C> system(*static_cast<const SystemTable<C>*>(run.system), door);
            return CoreGuard<C>(system, run.guard_calls, 0, caller.mode, unused, caller.backward);
        } else {
            return GuardView<System, X>(at(door).system(), run.guard_calls, 0, caller.mode,
                                        Crossing::falling, caller.backward);
        }
    }

    /// @tparam Screen  `Ends` or `Extremum`; void without a guard
    template <bool controlled, class Screen>
    RICOCHET_BY_ONES static void run_quietly(void* door, State& step, QuietRun& run)
    {
        constexpr bool guarded = !std::is_void_v<Screen>;
        constexpr bool rates = [] {
            if constexpr (guarded) return Screen::uses_rates;
            return false;
        }();
        constexpr ErrorRule rule;
        constexpr int order = Stepper::error_order_value + 1;
        Caller caller(door, step);
        std::array<X, kept_stages + 1> k;
        X x0 = loaded(step.x0);
        X rate0 = loaded(step.rate0);
        X remainder = loaded(step.remainder);
        const X zero = zeros_like(x0);
        X room = zero, w = zero, w_rate = zero, error = zero, x1 = zero, rate1 = zero;
        [[maybe_unused]] const double sign = run.sign;
        [[maybe_unused]] double g0 = run.g0, g_rate0 = run.rate0, g1 = 0, g_rate1 = 0, inside = 0;
        double h = run.h_next;
        run.why = QuietEnd::due;
        run.repeated = false;
        for (;;) {
            if (run.steps == run.most_steps) break;
            const double until = caller.start.until(run.end);
            if (h * (1 + 1e-6) >= (caller.backward ? -until : until)) break;
            if (run.cancelled && run.cancelled->load(std::memory_order_relaxed)) break;

            double next = h;
            double largest = rule.largest;
            run.repeated = false;
            for (;;) {
                depart<controlled>(caller, k.data(), {x0, rate0, zero}, h, room, w, w_rate, error);
                const bool finite = end(caller, h, x0, rate0, remainder, w, w_rate, x1, rate1);
                if constexpr (!controlled) {
                    if (!finite) run.why = QuietEnd::failed;
                    break;
                }
                run.error = finite ? worst_ratio(step, x0, x1, error, run.rtol, run.atol)
                                   : std::numeric_limits<double>::quiet_NaN();
                if (rule.accepts(run.error)) {
                    next =
                        std::min(h * std::min(largest, rule.factor(run.error, order)), run.h_max);
                    break;
                }
                const double shorter = h * rule.factor(run.error, order);
                if (!std::isfinite(run.error) ||
                    shorter < smallest_step(run.h_min, caller.start.value)) {
                    run.why = QuietEnd::failed;
                    break;
                }
                ++run.rejected;
                h = shorter;
                largest = 1;
                run.repeated = true;
            }
            if (run.why == QuietEnd::failed) {
                leave(step, caller, h, x0, rate0, remainder, k, w, w_rate, x1, rate1);
                run.h_next = h;
                break;
            }
            if constexpr (guarded) {
                const auto guard = guard_of(door, run, caller);
                const double t1 = caller.time(h);
                g1 = guard.value(t1, x1);
                if constexpr (rates) g_rate1 = guard.raw_rate(t1, x1, rate1, h);
                QuietEnd why = QuietEnd::due;
                // The loop replaces a rate that is not finite.
                if (Screen::suspects(sign, g0, g_rate0, g1, g_rate1, h) ||
                    !std::isfinite(g1 + g_rate1)) {
                    why = QuietEnd::doubt;
                }
                if (rates && run.checks_inside) {
                    const X x = peeked(h, x0, rate0, remainder, k, w, w_rate, rate1);
                    inside = guard.value(caller.time(CubicCheck::inside * h), x);
                    const CubicCheck look(g0, g_rate0, g1, g_rate1, h);
                    const double e = look.deviation(CubicCheck::inside, inside);
                    if (!(look.lowest(sign) > CubicCheck::doubt * e)) why = QuietEnd::doubt;
                    if (controlled && hardly_moves(x0, x1)) why = QuietEnd::moving;
                }
                if (why != QuietEnd::due) {
                    run.why = why;
                    leave(step, caller, h, x0, rate0, remainder, k, w, w_rate, x1, rate1);
                    run.h_next = next;
                    break;
                }
                g0 = g1;
                g_rate0 = g_rate1;
            }
            caller.start = caller.start.after(caller.backward ? -h : h);
            for_each_component(
                x0, [&](auto i) __attribute__((always_inline)) {
                    const TwoSum sum = two_sum(x0[i], h * rate0[i] + (w[i] + remainder[i]));
                    x0[i] = sum.value;
                    remainder[i] = sum.remainder;
                    rate0[i] = rate1[i];
                });
            ++run.steps;
            h = next;
        }
        if (run.why == QuietEnd::due) {
            run.h_next = h;
            put_start(step, caller, x0, rate0, remainder);
        }
        caller.leave(step);
        run.g0 = g0;
        run.rate0 = g_rate0;
        run.g1 = g1;
        run.rate1 = g_rate1;
        run.inside = inside;
    }

    [[gnu::always_inline]] static void put_start(State& step, const Caller& caller, const X& x0,
                                                 const X& rate0, const X& remainder)
    {
        step.start = caller.start;
        put(x0, step.x0);
        put(rate0, step.rate0);
        put(remainder, step.remainder);
    }

    /// Leaves the current step where the loop expects it.
    template <class Stages>
    [[gnu::always_inline]] static void leave(State& step, const Caller& caller, double h,
                                             const X& x0, const X& rate0, const X& remainder,
                                             const Stages& k, const X& w, const X& w_rate,
                                             const X& x1, const X& rate1)
    {
        put_start(step, caller, x0, rate0, remainder);
        step.h = h;
        step.has_middle = false;
        step.asked_alone = 0;
        store(step, k, w, w_rate, x1, rate1);
    }

public:
    /// The quiet runs of a small state in a system with one guard or none, else null.
    /// @tparam Screen  `Ends` or `Extremum`; void without a guard
    template <bool controlled, class Screen>
    [[nodiscard]] static constexpr QuietKernel<C> quiet() noexcept
    {
        if constexpr (in_registers && fixed_size<C>() > 0) {
            return &run_quietly<controlled, Screen>;
        } else {
            return nullptr;
        }
    }

    [[nodiscard]] static constexpr StepKernel<C> make()
    {
        StepKernel<C> kernel;
        kernel.order = order_of<Stepper>();
        kernel.end_rate = is_fsal<Stepper>;
        kernel.take = &take;
        kernel.depart = &depart_only;
        if constexpr (has_error_estimate<Stepper>) {
            kernel.error_order = static_cast<int>(Stepper::error_order_value);
            kernel.attempt = &attempt;
        }
        if constexpr (ours) {
            kernel.is_dopri5 = Stepper::has_dense_output;
        } else {
            kernel.renew = &renew;
            if constexpr (has_interpolant<Stepper, X>) kernel.departure = &departure;
        }
        return kernel;
    }
};

/// The kernel of a built-in method that calls the flow by pointer, compiled in the library.
template <class X>
[[nodiscard]] const StepKernel<X>& kernel_by_name(MethodName name) noexcept;

template <class System, class X, class Method>
inline const StepKernel<CoreState<X>> kernel_of = KernelOf<System, X, Method>::make();
template <class System, class X, class Method>
requires(
    NameOf<Method>::known) inline constexpr StepKernel<CoreState<X>> kernel_of<System, X, Method> =
    KernelOf<System, X, Method>::make();

/// The kernel of a method for a system: the library's own where the flow takes a large part of
/// a step, or nothing is inlined.
template <class System, class X, class Method>
[[nodiscard]] const StepKernel<CoreState<X>>& kernel_for([[maybe_unused]] const Method& method)
{
#if RICOCHET_INLINES_FLOWS
    constexpr bool by_pointer = NameOf<Method>::known && !fits_registers<X>;
#else
    constexpr bool by_pointer = NameOf<Method>::known;
#endif
    if constexpr (std::is_same_v<Method, MethodByName>) {
        return kernel_by_name<CoreState<X>>(method.name);
    } else if constexpr (by_pointer) {
        return kernel_by_name<CoreState<X>>(NameOf<Method>::name);
    } else {
        return kernel_of<System, X, Method>;
    }
}

}  // namespace ricochet::detail
