// Internal: the declarations of this header may change without notice.
//
// Whole steps of a method with the flow of a system inlined.
#pragma once

#include <cstdint>
#include <limits>
#include <new>
#include <type_traits>

#include "ricochet/detail/quiet_steps.hpp"
#include "ricochet/detail/step_of.hpp"

namespace ricochet::detail {

template <class System, class X, class Method>
class KernelOf {
    using Of = StepOf<System, X, Method>;
    using C = typename Of::C;
    using Stepper = typename Of::Stepper;
    using State = StepState<C>;

    /// Takes a step. Returns the largest ratio of error to tolerance, 0 without an estimate, which
    /// a negative `rtol` leaves out; NaN if the step is not finite.
    RICOCHET_BY_ONES [[gnu::noinline]] static double attempt(void* adapter, State& step, double h,
                                                             [[maybe_unused]] double rtol,
                                                             [[maybe_unused]] double atol)
    {
        const bool with_error = has_error_estimate<Stepper> && rtol >= 0;
        step.h = h;
        step.has_middle = false;
        step.asked_alone = 0;
        FlowCaller<C> caller(adapter, step);
        typename Of::Stages k;
        typename Of::Values of(step);
        if constexpr (Of::ours) {
            Of::depart(caller, k.data(), h, of, with_error);
        } else {
            Of::depart(caller, Of::at(adapter).advancing, h, of, with_error);
        }
        const bool finite = Of::end(caller, h, of);
        Of::store(step, k, of);
        caller.leave(step);
        if (!finite) return std::numeric_limits<double>::quiet_NaN();
        if constexpr (has_error_estimate<Stepper>) {
            if (with_error) return Of::worst_ratio(step, of, rtol, atol);
        }
        return 0;
    }

    static bool take(void* adapter, State& step, double h)
    {
        const double ratio = attempt(adapter, step, h, -1, 0);
        return ratio == ratio;
    }

    RICOCHET_BY_ONES static void depart_only(void* adapter, State& step, double s, C& w, C& rate)
    {
        FlowCaller<C> caller(adapter, step);
        typename Of::Values of(step);
        if constexpr (Of::ours) {
            typename Of::Stages k;
            Of::depart(caller, k.data(), s, of, false);
            Of::put(of.w, w);
            if constexpr (is_fsal<Stepper>) Of::put(of.w_rate, rate);
        } else {
            Of::depart(caller, Of::at(adapter).probing, s, of, false);
            copy_state(of.w, w);
            if constexpr (is_fsal<Stepper>) copy_state(of.w_rate, rate);
        }
        caller.leave(step);
    }

    static void departure(void* adapter, const State& step, double s, C& w)
    {
        const X zero = Of::own_copy(step.zero);
        X out = zero;
        Of::at(adapter).advancing.calc_state(s, out, zero, zero, 0.0, Of::own_copy(step.w),
                                             Of::own_copy(step.w_rate1), step.h);
        copy_state(out, w);
    }

    static void renew(void* adapter)
    {
        for (Stepper* stepper : {&Of::at(adapter).advancing, &Of::at(adapter).probing}) {
            if constexpr (std::is_trivially_destructible_v<Stepper>) {
                ::new (stepper) Stepper();  // an assignment would copy what is not yet written
            } else {
                *stepper = Stepper();
            }
        }
    }

public:
    /// The quiet runs of a small state in a system with one guard or none, else null.
    /// @tparam Screen  `Ends` or `Extremum`; void without a guard
    template <bool controlled, class Screen>
    [[nodiscard]] static constexpr QuietKernel<C> quiet() noexcept
    {
        if constexpr (fits_registers<X> && fixed_size<C>() > 0) {
            return &QuietSteps<System, X, Method, controlled, Screen>::go;
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
        if constexpr (Of::ours) {
            kernel.is_dopri5 = Stepper::has_dense_output;
        } else {
            kernel.renew = &renew;
            if constexpr (has_interpolant<Stepper, X>) kernel.departure = &departure;
        }
        return kernel;
    }
};

/// The kernel of a built-in method for states of `size` components that calls the flow by pointer,
/// compiled in the library.
template <class X>
[[nodiscard]] const StepKernel<X>& kernel_by_name(MethodName name, std::size_t size) noexcept;
template <>
const StepKernel<SmallState>& kernel_by_name(MethodName name, std::size_t size) noexcept;
template <>
const StepKernel<std::vector<double>>& kernel_by_name(MethodName name, std::size_t size) noexcept;

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
        return kernel_by_name<CoreState<X>>(method.name, fixed_size<X>());
    } else if constexpr (by_pointer) {
        return kernel_by_name<CoreState<X>>(NameOf<Method>::name, fixed_size<X>());
    } else {
        return kernel_of<System, X, Method>;
    }
}

}  // namespace ricochet::detail
