// A run of callbacks with set-valued motion.
#pragma once

#include <memory>
#include <utility>

#include "bindings/c/callback_table.hpp"
#include "bindings/c/inclusion.hpp"
#include "bindings/c/options.hpp"
#include "bindings/c/results.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/nonsmooth/detail/phased_run.hpp"

namespace ricochet::c {

#ifdef RICOCHET_WITH_NONSMOOTH

/// @param user  of the system without its inclusion
template <class X>
[[nodiscard]] detail::Owner<detail::PhasedRun<X>> make_phased(
    const std::shared_ptr<const CallbackSystem>& system, const detail::RunBindings<X>& user,
    const X& x0, const RunOptions& options)
{
    require_options_of_phases(options);
    const InclusionCallbacks& of = *system->inclusion();
    detail::PhasedSetup<X> setup;
    setup.user = user;
    setup.by_mode = system->callbacks().mode_count > 0;
    setup.method = method_of(options.method);
    const detail::BranchPhasesOptions solving = detail::branch_options(options.options);
    for (std::size_t mode = 0; mode < system->mode_count(); ++mode) {
        detail::Owner<detail::BranchPhases> phases;
        if (of.is_in(mode)) {
            const auto in = inclusion_in(system, static_cast<Mode>(mode));
            phases = detail::make_branch_phases(in, solving);
        }
        setup.inclusions.push_back(std::move(phases));
    }
    using D = detail::SystemAdapter<CallbackSystem, X>;
    if (of.callbacks().start_mode) {
        setup.start_mode = [](void* adapter, Mode mode, double t, const X& x) {
            return static_cast<D*>(adapter)->system().start_mode(mode, t, x);
        };
    }
    if (of.callbacks().change) {
        setup.change = [](void* adapter, std::size_t reaction, EventKind kind, Mode mode, double t,
                          X& x) {
            return static_cast<D*>(adapter)->system().change(reaction, kind, mode, t, x);
        };
    }
    return detail::make_phased_run(std::move(setup), x0, options.options);
}

#else

template <class X>
[[nodiscard]] detail::Owner<detail::PhasedRun<X>> make_phased(
    const std::shared_ptr<const CallbackSystem>&, const detail::RunBindings<X>&, const X&,
    const RunOptions&)
{
    throw Refusal(RC_INVALID,
                  "rc_callbacks: found set_valued, and a library that was built without "
                  "set-valued motion; expected RICOCHET_NONSMOOTH=ON");
}

#endif

}  // namespace ricochet::c
