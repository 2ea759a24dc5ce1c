// The ready systems of the core. The command line, Python and ensembles have those of this list.
#pragma once

#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/buck_converter.hpp"
#include "ricochet/systems/coulomb_oscillator.hpp"
#include "ricochet/systems/descriptor.hpp"
#include "ricochet/systems/impact_oscillator.hpp"
#include "ricochet/systems/pendulum.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "ricochet/systems/thermostat.hpp"

namespace ricochet {

/// Types of systems.
template <class... Systems>
struct SystemList {
    /// Calls `visit.template operator()<System>()` for each of them.
    template <class Visit>
    static constexpr void for_each(Visit&& visit)
    {
        (visit.template operator()<Systems>(), ...);
    }
};

/// In the order of the lists.
using ReadySystems = SystemList<BouncingBall, Pendulum, Thermostat, ImpactOscillator,
                                CoulombOscillator, StickSlip, BuckConverter>;

}  // namespace ricochet
