// One function for each system of this directory, which completes its entry in systems/.
#pragma once

#include "../registry.hpp"

namespace ricochet::app {

void complete_coulomb_oscillator(SystemEntry& entry);
void complete_diode_circuit(SystemEntry& entry);
void complete_friction_inclusion(SystemEntry& entry);
void complete_incline_block(SystemEntry& entry);
void complete_rolling_ball(SystemEntry& entry);
void complete_sliding_mode(SystemEntry& entry);
void complete_stick_slip(SystemEntry& entry);
void complete_super_twisting(SystemEntry& entry);
void complete_two_contact_block(SystemEntry& entry);
void complete_woodpecker(SystemEntry& entry);

/// Completes all of them, with their integrators.
void complete_set_valued_systems();

}  // namespace ricochet::app
