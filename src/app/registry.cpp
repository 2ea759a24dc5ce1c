#include "registry.hpp"

#include <fmt/format.h>

#include "input.hpp"
#include "systems/entries.hpp"

namespace ricochet::app {

bool Range::contains(double value) const noexcept
{
    return (lower_included ? value >= lower : value > lower) &&
           (upper_included ? value <= upper : value < upper);
}

std::string to_string(const Range& range)
{
    return fmt::format("{}{}, {}{}", range.lower_included ? '[' : '(', range.lower, range.upper,
                       range.upper_included ? ']' : ')');
}

namespace {

std::vector<SystemEntry>& entries()
{
    static std::vector<SystemEntry> all{
        bouncing_ball_entry(),
        pendulum_entry(),
        henon_heiles_entry(),
        three_body_entry(),
        hidden_pair_entry(),
        near_tangent_entry(),
        thermostat_entry(),
        grow_decay_entry(),
        impact_oscillator_entry(),
        coulomb_oscillator_entry(),
        stick_slip_entry(),
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
    return all;
}

}  // namespace

const std::vector<SystemEntry>& systems()
{
    return entries();
}

void complete_system(std::string_view name, void (*complete)(SystemEntry& entry))
{
    for (SystemEntry& entry : entries()) {
        if (entry.name == name) complete(entry);
    }
}

const SystemEntry& find_system(std::string_view name)
{
    std::vector<std::string_view> known;
    for (const SystemEntry& system : systems()) {
        if (system.name == name) return system;
        known.push_back(system.name);
    }
    throw unknown("system", name, known);
}

}  // namespace ricochet::app
