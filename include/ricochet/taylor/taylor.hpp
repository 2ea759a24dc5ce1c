// Taylor series as a method: of high order, without stages, each step a polynomial in time.
//
//     #include "ricochet/taylor/taylor.hpp"
//     integrate(system, x0, {.t_end = 100, .rtol = 1e-12}, ErrorControlled<Taylor>{});
//
// The flow is a template over its scalar that a constant expression can evaluate, with the state as
// an array, and functions called by their bare names:
//
//     template <class S>
//     constexpr void flow(const S& t, const std::array<S, 2>& x, std::array<S, 2>& dxdt) const
//     {
//         using std::cos;
//         dxdt[0] = x[1];
//         dxdt[1] = cos(frequency * t) - x[0];
//     }
//
// It may use + - * / sqrt cbrt pow exp log sin cos tan asin acos atan atan2 sinh cosh tanh hypot,
// and must perform the same operations whatever the state is: no comparisons, no kinks. A system
// with modes takes the mode first, and its `mode_count` is a constant. The system has a constexpr
// default constructor; the parameters of the object are those of the run.
//
// Where the compiler cannot know the operations, or there are more than 200, they are recorded at
// the start of a run and executed then, those of one kind side by side, which takes about four
// times as long where they are few. This concerns states in vectors (const std::vector<S>& x), a
// flow that is not constexpr, a system that cannot be constructed by default, and parameters that
// decide which operations are performed.
#pragma once

#include <cstddef>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/detail/stepper_adapter.hpp"
#include "ricochet/taylor/detail/taylor_adapter.hpp"
#include "ricochet/taylor/detail/taylor_kernel.hpp"

namespace ricochet {

/// Taylor's method. The length of a step is known before it is taken, from its last two
/// coefficients (Jorba and Zou, Experimental Mathematics 14, 2005, section 3.2). Where one of them
/// vanishes, the flow at the end of the step decides whether the step is repeated with a shorter
/// length. The polynomial is the dense output and, at other lengths, the step itself.
struct Taylor {
    /// 12, 16 or 20. 0: by `Options::rtol`, 12 from 1e-8 upward, 16 from 1e-11, else 20; with fixed
    /// steps 20.
    int order = 0;

    template <class State>
    struct Stepper {
        static constexpr bool estimates_error = true;
        static constexpr bool fsal = true;
        static constexpr bool has_dense_output = true;
    };
};

/// Whether the compiler unrolls the series of the flow, as long as parameters only change its
/// constants.
template <class System, class X = typename System::State>
concept UnrolledSeries = detail::ConstantFlow < System,
        detail::fixed_size<X>()
> ;

namespace detail {

template <class System, class X>
struct StepperAdapter<System, X, Taylor> : TaylorAdapter<System, X, fixed_size<X>()> {
    using TaylorAdapter<System, X, fixed_size<X>()>::TaylorAdapter;

    void prepare(const Taylor& method) { this->prepare_order(method.order); }
};
template <class System, class X>
class KernelOf<System, X, Taylor> : public TaylorKernel<System, X, fixed_size<X>()> {
};

/// Taylor's method for states X of n components whose type does not fix n, where the flow takes
/// arrays of n: for programs that keep states of all systems in one type.
template <std::size_t n>
struct TaylorOf {
    static constexpr std::size_t components = n;
    int order = 0;

    template <class State>
    using Stepper = Taylor::Stepper<State>;
};
template <class System, class X, std::size_t n>
struct StepperAdapter<System, X, TaylorOf<n>> : TaylorAdapter<System, X, n> {
    using TaylorAdapter<System, X, n>::TaylorAdapter;

    void prepare(const TaylorOf<n>& method) { this->prepare_order(method.order); }
};
template <class System, class X, std::size_t n>
class KernelOf<System, X, TaylorOf<n>> : public TaylorKernel<System, X, n> {
};

/// Lets a run whose adapter is a `TaylorAdapter`, and whose detector is known, take its steps by
/// power series. Quiet runs are of one guard at most, which the detector would check at every step.
template <class System, class X, std::size_t n>
void step_by_series(RunBindings<CoreState<X>>& setup)
{
    using Method = TaylorOf<n>;
    using Kernel = KernelOf<System, X, Method>;
    setup.kernel = &kernel_of<System, X, Method>;
    setup.quiet_on_series = true;
    setup.quiet = nullptr;
    const auto& detector = setup.detector;
    const bool proves = detector.screening == detail::Screening::extremum ||
                        detector.screening == detail::Screening::every;
    const bool alone = Kernel::on_series && proves && !detector.clears && !detector.defers &&
                       setup.system->guard_count(setup.adapter) == 1;
    if (!setup.system->guarded || alone) {
        setup.quiet = setup.error_controlled ? Kernel::template quiet<true>()
                                             : Kernel::template quiet<false>();
    }
}

}  // namespace detail

}  // namespace ricochet
