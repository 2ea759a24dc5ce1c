// A whole run in one call.
#pragma once

#include "ricochet/detail/refused_calls.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet {

/// Integrates `system` from x0 at `options.t_start` to `options.t_end`.
///
/// @param system   declares its functions (see system.hpp); not copied, not
///                 changed
/// @param x0       initial state; its type is the state type of the run
/// @param options  only `t_end` is required
/// @param stepping `ErrorControlled<Method>` or `FixedStep<Method>`
/// @param detector `Extremum`, `Ends`, `Bernstein`, a `BareNetwork`, or a detector that
///                 wraps one of the exact ones, such as `Planned` or `Verified`
/// @param locator  `Newton`, `Bisection` or `Toms748`
/// @throws std::invalid_argument for invalid options, start or guards.
///         What happens during the run is returned as `Run::outcome`.
template <class System, class X = typename System::State, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] Run<X> integrate(const System& system, const X& x0, const Options& options,
                               const Stepping& stepping = {}, const Detector& detector = {},
                               const Locator& locator = {})
{
    static_assert(detail::has_flow_alone<System>());
    detail::RunComponents<System, X, Stepping, Detector, Locator> parts(system, x0, stepping,
                                                                        detector, locator);
    return detail::run_for_caller(parts.setup(), x0, options);
}

/// A system without a flow for such a state.
template <class System, class X>
concept NotIntegrable = !(Flowing<System, X> && StateVector<X>);

/// Rejects at compile time a system that cannot be integrated, with a sentence instead of a list of
/// concepts.
template <class System, class X = typename System::State, class... Choices>
requires NotIntegrable<System, X> Run<X> integrate(const System&, const X&, const Options&,
                                                   const Choices&...)
{
    static_assert(detail::check_system<System, X>());
    return {};
}

}  // namespace ricochet
