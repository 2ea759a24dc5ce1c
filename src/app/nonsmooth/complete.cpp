#include "complete.hpp"

#include "set_valued_options.hpp"

namespace ricochet::app {

void complete_set_valued_systems()
{
    complete_system("coulomb-oscillator", complete_coulomb_oscillator);
    complete_system("diode-circuit", complete_diode_circuit);
    complete_system("friction-inclusion", complete_friction_inclusion);
    complete_system("incline-block", complete_incline_block);
    complete_system("rolling-ball", complete_rolling_ball);
    complete_system("sliding-mode", complete_sliding_mode);
    complete_system("stick-slip", complete_stick_slip);
    complete_system("super-twisting", complete_super_twisting);
    complete_system("two-contact-block", complete_two_contact_block);
    complete_system("woodpecker", complete_woodpecker);
    for (const SystemEntry& system : systems()) {
        if (system.integrators.empty()) continue;
        complete_system(system.name,
                        [](SystemEntry& entry) { entry.choose_integrator = choose_set_valued; });
    }
}

}  // namespace ricochet::app
