// The loop for one type of state.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/engine_apply.hpp"
#include "core/engine_find.hpp"
#include "core/engine_record.hpp"
#include "core/engine_rest.hpp"
#include "core/engine_saving.hpp"
#include "core/engine_settle.hpp"
#include "core/engine_ties.hpp"
#include "core/event_notes.hpp"
#include "core/event_series.hpp"
#include "core/event_sets.hpp"
#include "core/loop_events.hpp"
#include "core/loop_output.hpp"
#include "core/loop_phases.hpp"
#include "core/loop_planned.hpp"
#include "core/loop_quiet.hpp"
#include "core/loop_restart.hpp"
#include "core/loop_resume.hpp"
#include "core/loop_saving.hpp"
#include "core/loop_setup.hpp"
#include "core/loop_steps.hpp"
#include "core/monitor_loop.hpp"
#include "core/named_kernels.hpp"
#include "core/planner_checks.hpp"
#include "core/planner_close.hpp"
#include "ricochet/detail/kernels.hpp"

namespace ricochet::detail {

/// Whether the run of a system uses the loop for a single guard whose checks are never
/// deferred.
template <class X>
[[nodiscard]] bool has_single_guard(const RunBindings<X>& setup)
{
    return fixed_size<X>() > 0 && !defers(setup.detector, *setup.system) &&
           setup.system->guard_count(setup.adapter) == 1;
}

/// A loop together with its setup; it continues after exceptions from the system.
template <class X>
struct KeptSetup {
    RunBindings<X> kept;
};
template <class X, bool single>
struct KeptLoop final : KeptSetup<X>, Loop<X, single> {
    KeptLoop(const RunBindings<X>& setup, const X& x0, const Options& options, bool resumable)
        : KeptSetup<X>{setup}, Loop<X, single>(this->kept, x0, options)
    {
        if (resumable) this->keep_resumable();
    }
};

template <class X>
std::unique_ptr<LendingLoop<X>> make_kept_loop(const RunBindings<X>& setup, const X& x0,
                                               const Options& options, bool resumable)
{
    if constexpr (fixed_size<X>() > 0) {
        if (has_single_guard(setup)) {
            return std::make_unique<KeptLoop<X, true>>(setup, x0, options, resumable);
        }
    }
    return std::make_unique<KeptLoop<X, false>>(setup, x0, options, resumable);
}

template <class X>
Owner<AnyLoop<X>> make_loop(const RunBindings<X>& setup, const X& x0, const Options& options)
{
    return Owner<AnyLoop<X>>(make_kept_loop(setup, x0, options, true).release());
}

template <class X>
std::unique_ptr<LendingLoop<X>> make_lending_loop(const RunBindings<X>& setup, const X& x0,
                                                  const Options& options)
{
    return make_kept_loop(setup, x0, options, false);
}

template <class X, bool single>
struct KeptMonitor final : KeptSetup<X>, MonitorLoop<X, single> {
    KeptMonitor(const RunBindings<X>& setup, const X& like, const Options& options,
                bool cuts_at_all)
        : KeptSetup<X>{setup}, MonitorLoop<X, single>(this->kept, like, options, cuts_at_all)
    {
    }
};

template <class X>
Owner<AnyMonitor<X>> make_monitor(const RunBindings<X>& setup, const X& like,
                                  const Options& options, bool cuts_at_all)
{
    RunBindings<X> shown = setup;
    shown.kernel = &host_kernel<X>;
    if constexpr (fixed_size<X>() > 0) {
        if (has_single_guard(setup)) {
            return Owner<AnyMonitor<X>>(
                new KeptMonitor<X, true>(shown, like, options, cuts_at_all));
        }
    }
    return Owner<AnyMonitor<X>>(new KeptMonitor<X, false>(shown, like, options, cuts_at_all));
}

template <class X>
Run<X> run_whole(const RunBindings<X>& setup, const X& x0, const Options& options)
{
    if constexpr (fixed_size<X>() > 0) {
        if (has_single_guard(setup)) return Loop<X, true>(setup, x0, options).take();
    }
    return Loop<X, false>(setup, x0, options).take();
}

template <class X>
void run_whole(const RunBindings<X>& setup, const X& x0, const Options& options,
               void (*take)(void* out, const Run<X>& run), void* out)
{
    if constexpr (fixed_size<X>() > 0) {
        if (has_single_guard(setup)) {
            return take(out, Loop<X, true>(setup, x0, options).complete());
        }
    }
    take(out, Loop<X, false>(setup, x0, options).complete());
}

/// Kernel of the quiet runs of a set-up: its own, or that of one of the library's methods.
template <class X>
QuietKernel<X> quiet_kernel(const RunBindings<X>& setup) noexcept
{
    const SystemTable<X>& system = *setup.system;
    if (system.phases) return nullptr;
    if (setup.quiet || !setup.error_controlled) return setup.quiet;
    const NamedKernel<X>* const named = named_kernel(setup.kernel);
    if (!named) return nullptr;
    if (!system.guarded) return named->unguarded;
    const DetectorTable<X>& detector = setup.detector;
    const bool alone = system.guard_alone && system.point;
    const bool screened =
        detector.screening == Screening::extremum && !detector.clears && !defers(detector, system);
    return alone && screened && has_single_guard(setup) ? named->screened : nullptr;
}

}  // namespace ricochet::detail

#define RICOCHET_CORE(...)                                                                         \
    namespace ricochet::detail {                                                                   \
    using CoreStateHere = __VA_ARGS__;                                                             \
    template Owner<AnyLoop<CoreStateHere>> make_loop(const RunBindings<CoreStateHere>&,            \
                                                     const CoreStateHere&, const Options&);        \
    template std::unique_ptr<LendingLoop<CoreStateHere>> make_lending_loop(                        \
        const RunBindings<CoreStateHere>&, const CoreStateHere&, const Options&);                  \
    template Owner<AnyMonitor<CoreStateHere>> make_monitor(const RunBindings<CoreStateHere>&,      \
                                                           const CoreStateHere&, const Options&,   \
                                                           bool);                                  \
    template Run<CoreStateHere> run_whole(const RunBindings<CoreStateHere>&, const CoreStateHere&, \
                                          const Options&);                                         \
    template void run_whole(const RunBindings<CoreStateHere>&, const CoreStateHere&,               \
                            const Options&, void (*)(void*, const Run<CoreStateHere>&), void*);    \
    }
