#include "entries.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace ricochet::app {

std::vector<SystemEntry> all_entries()
{
    std::vector<SystemEntry> all = ready_entries();
    std::vector<SystemEntry> others{
        henon_heiles_entry(),
        three_body_entry(),
        hidden_pair_entry(),
        near_tangent_entry(),
        grow_decay_entry(),
        detest_f1_entry(),
        detest_f2_entry(),
        detest_f3_entry(),
        detest_f4_entry(),
        detest_f5_entry(),
        cavern_entry(),
        zones_entry(),
        eigenvalue_entry(),
        arm_entry(),
        sliding_mode_entry(),
        diode_circuit_entry(),
        fault_entry(),
        friction_inclusion_entry(),
        super_twisting_entry(),
        rolling_ball_entry(),
        incline_block_entry(),
        woodpecker_entry(),
        two_contact_block_entry(),
        spring_slider_entry(),
    };
    std::move(others.begin(), others.end(), std::back_inserter(all));
    return all;
}

}  // namespace ricochet::app
