// What the descriptors of systems with a mass on a spring have in common.
#pragma once

#include <array>
#include <vector>

#include "ricochet/systems/descriptor.hpp"

namespace ricochet::detail {

[[nodiscard]] inline ParameterInfo mass_of_oscillator(double initial)
{
    return {.name = "mass",
            .initial = initial,
            .unit = "kg",
            .range = {.lower = 0},
            .meaning = "of the oscillator"};
}

[[nodiscard]] inline ParameterInfo stiffness_of_spring(double initial)
{
    return {.name = "stiffness",
            .initial = initial,
            .unit = "N/m",
            .range = {.lower = 0},
            .meaning = "of the spring"};
}

/// The state (u, v), where both may be chosen at the start.
[[nodiscard]] inline std::vector<ComponentInfo> position_and_velocity(
    const std::array<double, 2>& start)
{
    const auto component = [](std::string_view symbol, std::string_view unit,
                              std::string_view title, double at_start) {
        return ComponentInfo{.name = symbol,
                             .unit = unit,
                             .meaning = title,
                             .title = title,
                             .start = at_start,
                             .start_meaning = "at the start"};
    };
    return {component("u", "m", "position", start[0]), component("v", "m/s", "velocity", start[1])};
}

}  // namespace ricochet::detail
