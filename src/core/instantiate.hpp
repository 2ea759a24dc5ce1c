// The loop for one type of state.
#pragma once

#include "core/large_kernel.hpp"
#include "core/loop_arming.hpp"
#include "core/loop_events.hpp"
#include "core/loop_output.hpp"
#include "core/loop_planned.hpp"
#include "core/loop_quiet.hpp"
#include "core/loop_rest.hpp"
#include "core/loop_saving.hpp"
#include "core/loop_setup.hpp"
#include "core/loop_steps.hpp"
#include "ricochet/detail/kernels.hpp"

namespace ricochet::detail {

/// Whether the run of a system is one of a loop for a single guard.
template <class X>
[[nodiscard]] bool has_single_guard(const RunSetup<X>& setup)
{
    return fixed_size<X>() > 0 && setup.system->guard_count(setup.door) == 1;
}

/// A loop with its setup.
template <class X>
struct KeptSetup {
    RunSetup<X> kept;
};
template <class X, bool single>
struct KeptLoop final : KeptSetup<X>, Loop<X, single> {
    KeptLoop(const RunSetup<X>& setup, const X& x0, const Options& options)
        : KeptSetup<X>{setup}, Loop<X, single>(this->kept, x0, options)
    {
    }
};

template <class X>
Core<X>::Core(const RunSetup<X>& setup, const X& x0, const Options& options)
{
    if constexpr (fixed_size<X>() > 0) {
        if (has_single_guard(setup)) {
            loop_ = std::make_unique<KeptLoop<X, true>>(setup, x0, options);
            return;
        }
    }
    loop_ = std::make_unique<KeptLoop<X, false>>(setup, x0, options);
}

template <class X>
Core<X>::~Core() = default;
template <class X>
Core<X>::Core(Core&&) noexcept = default;
template <class X>
Core<X>& Core<X>::operator=(Core&&) noexcept = default;

template <class X>
double Core<X>::t() const noexcept
{
    return loop_->t();
}
template <class X>
const X& Core<X>::x() const noexcept
{
    return loop_->x();
}
template <class X>
Mode Core<X>::mode() const noexcept
{
    return loop_->mode();
}
template <class X>
bool Core<X>::ended() const noexcept
{
    return loop_->ended();
}
template <class X>
const Run<X>& Core<X>::run() const noexcept
{
    return loop_->run();
}
template <class X>
MeterReading Core<X>::meter() const
{
    return loop_->meter();
}
template <class X>
bool Core<X>::step()
{
    return loop_->step();
}
template <class X>
bool Core<X>::advance()
{
    return loop_->advance();
}
template <class X>
void Core<X>::show_all()
{
    loop_->show_all();
}
template <class X>
void Core<X>::advance_once(bool look_ahead)
{
    loop_->advance_once(look_ahead);
}
template <class X>
Run<X> Core<X>::take()
{
    return loop_->take();
}
template <class X>
Run<X> Core<X>::finish()
{
    return loop_->finish();
}
template <class X>
Snapshot Core<X>::save()
{
    return loop_->save();
}
template <class X>
void Core<X>::restore(const Snapshot& snapshot)
{
    loop_->restore(snapshot);
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
    template class Core<CoreStateHere>;                                                           \
    template Run<CoreStateHere> run_whole(const RunSetup<CoreStateHere>&, const CoreStateHere&,   \
                                          const Options&);                                        \
    template const StepKernel<CoreStateHere>& kernel_by_name<CoreStateHere>(MethodName) noexcept; \
    }
