// The systems of the command line: those of the core, and a function for each other one, in a file
// of this directory.
#pragma once

#include "../registry.hpp"

namespace ricochet::app {

/// Those of the core, from their descriptors.
[[nodiscard]] std::vector<SystemEntry> ready_entries();
[[nodiscard]] SystemEntry bouncing_ball_entry();
[[nodiscard]] SystemEntry henon_heiles_entry();
[[nodiscard]] SystemEntry three_body_entry();
[[nodiscard]] SystemEntry hidden_pair_entry();
[[nodiscard]] SystemEntry near_tangent_entry();
[[nodiscard]] SystemEntry grow_decay_entry();
[[nodiscard]] SystemEntry detest_f1_entry();
[[nodiscard]] SystemEntry detest_f2_entry();
[[nodiscard]] SystemEntry detest_f3_entry();
[[nodiscard]] SystemEntry detest_f4_entry();
[[nodiscard]] SystemEntry detest_f5_entry();
[[nodiscard]] SystemEntry cavern_entry();
[[nodiscard]] SystemEntry zones_entry();
[[nodiscard]] SystemEntry eigenvalue_entry();
[[nodiscard]] SystemEntry arm_entry();
[[nodiscard]] SystemEntry sliding_mode_entry();
[[nodiscard]] SystemEntry diode_circuit_entry();
[[nodiscard]] SystemEntry fault_entry();
[[nodiscard]] SystemEntry friction_inclusion_entry();
[[nodiscard]] SystemEntry super_twisting_entry();
[[nodiscard]] SystemEntry rolling_ball_entry();
[[nodiscard]] SystemEntry incline_block_entry();
[[nodiscard]] SystemEntry woodpecker_entry();
[[nodiscard]] SystemEntry two_contact_block_entry();
[[nodiscard]] SystemEntry spring_slider_entry();

}  // namespace ricochet::app
