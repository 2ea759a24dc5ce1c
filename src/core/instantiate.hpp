// The loop for one type of state.
#pragma once

#include "core/engine_apply.hpp"
#include "core/engine_find.hpp"
#include "core/engine_record.hpp"
#include "core/engine_rest.hpp"
#include "core/engine_settle.hpp"
#include "core/event_sets.hpp"
#include "core/large_kernel.hpp"
#include "core/loop_events.hpp"
#include "core/loop_output.hpp"
#include "core/loop_planned.hpp"
#include "core/loop_quiet.hpp"
#include "core/loop_resume.hpp"
#include "core/loop_saving.hpp"
#include "core/loop_setup.hpp"
#include "core/loop_steps.hpp"
#include "core/monitor_loop.hpp"
#include "core/planner_checks.hpp"
#include "core/planner_close.hpp"
#include "ricochet/detail/kernels.hpp"

namespace ricochet::detail {

/// Whether the run of a system is one of the loop for a single guard whose checks are never
/// deferred.
template <class X>
[[nodiscard]] bool has_single_guard(const RunSetup<X>& setup)
{
    return fixed_size<X>() > 0 && !puts_off(setup.detector, *setup.system) &&
           setup.system->guard_count(setup.door) == 1;
}

/// A loop with its setup, which goes on after exceptions from the system.
template <class X>
struct KeptSetup {
    RunSetup<X> kept;
};
template <class X, bool single>
struct KeptLoop final : KeptSetup<X>, Loop<X, single> {
    KeptLoop(const RunSetup<X>& setup, const X& x0, const Options& options)
        : KeptSetup<X>{setup}, Loop<X, single>(this->kept, x0, options)
    {
        this->keep_resumable();
    }
};

template <class X>
std::unique_ptr<AnyLoop<X>> make_loop(const RunSetup<X>& setup, const X& x0, const Options& options)
{
    if constexpr (fixed_size<X>() > 0) {
        if (has_single_guard(setup)) {
            return std::make_unique<KeptLoop<X, true>>(setup, x0, options);
        }
    }
    return std::make_unique<KeptLoop<X, false>>(setup, x0, options);
}

template <class X, bool single>
struct KeptMonitor final : KeptSetup<X>, MonitorLoop<X, single> {
    KeptMonitor(const RunSetup<X>& setup, const X& like, const Options& options, bool cuts_at_all)
        : KeptSetup<X>{setup}, MonitorLoop<X, single>(this->kept, like, options, cuts_at_all)
    {
    }
};

template <class X>
std::unique_ptr<AnyMonitor<X>> make_monitor(const RunSetup<X>& setup, const X& like,
                                            const Options& options, bool cuts_at_all)
{
    RunSetup<X> shown = setup;
    shown.kernel = &host_kernel<X>;
    if constexpr (fixed_size<X>() > 0) {
        if (has_single_guard(setup)) {
            return std::make_unique<KeptMonitor<X, true>>(shown, like, options, cuts_at_all);
        }
    }
    return std::make_unique<KeptMonitor<X, false>>(shown, like, options, cuts_at_all);
}

template <class X>
Run<X> run_whole(const RunSetup<X>& setup, const X& x0, const Options& options)
{
    if constexpr (fixed_size<X>() > 0) {
        if (has_single_guard(setup)) return Loop<X, true>(setup, x0, options).take();
    }
    return Loop<X, false>(setup, x0, options).take();
}

template <class X>
const StepKernel<X>& kernel_by_name(MethodName name) noexcept
{
    static const std::array<StepKernel<X>, 5> kernels = [] {
        if constexpr (fixed_size<X>() > 0) {
            return std::array<StepKernel<X>, 5>{
                KernelOf<ByPointer, X, Euler>::make(), KernelOf<ByPointer, X, Rk4>::make(),
                KernelOf<ByPointer, X, CashKarp54>::make(), KernelOf<ByPointer, X, Dopri5>::make(),
                KernelOf<ByPointer, X, Fehlberg78>::make()};
        } else {
            return std::array<StepKernel<X>, 5>{
                LargeKernel<EulerTableau>::make(), LargeKernel<Rk4Tableau>::make(),
                LargeKernel<CashKarp54Tableau>::make(), LargeKernel<Dopri5Tableau>::make(),
                LargeKernel<Fehlberg78Tableau>::make()};
        }
    }();
    return kernels[static_cast<std::size_t>(name)];
}

}  // namespace ricochet::detail

#define RICOCHET_CORE(...)                                                                        \
    namespace ricochet::detail {                                                                  \
    using CoreStateHere = __VA_ARGS__;                                                            \
    template std::unique_ptr<AnyLoop<CoreStateHere>> make_loop(const RunSetup<CoreStateHere>&,    \
                                                               const CoreStateHere&,              \
                                                               const Options&);                   \
    template std::unique_ptr<AnyMonitor<CoreStateHere>> make_monitor(                             \
        const RunSetup<CoreStateHere>&, const CoreStateHere&, const Options&, bool);              \
    template Run<CoreStateHere> run_whole(const RunSetup<CoreStateHere>&, const CoreStateHere&,   \
                                          const Options&);                                        \
    template const StepKernel<CoreStateHere>& kernel_by_name<CoreStateHere>(MethodName) noexcept; \
    }
