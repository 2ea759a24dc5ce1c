// The entry of a ready system, without its functions, from its descriptor.
#pragma once

#include <cstddef>

#include "../registry.hpp"
#include "has_series.hpp"
#include "labels.hpp"
#include "ricochet/system.hpp"
#include "ricochet/systems/descriptor.hpp"

namespace ricochet::app {

/// The parameters of a descriptor, and those of the start that it offers.
[[nodiscard]] std::vector<Parameter> parameters_with_start(const SystemDescriptor& of);
/// The start for these parameters.
[[nodiscard]] std::vector<double> start_from(const SystemDescriptor& of,
                                             const std::vector<double>& parameters);

template <class System>
[[nodiscard]] SystemEntry described()
{
    const SystemDescriptor& of = System::descriptor();
    SystemEntry entry{
        .name = of.name,
        .description = of.description,
        .source = of.source,
        .equations = of.equations,
        .parameters = parameters_with_start(of),
        .state = of.state,
        .t_end = of.t_end,
        .start = [](const std::vector<double>& p) { return start_from(System::descriptor(), p); },
        .run = nullptr,
        .series = has_series<System>,
        .comparison_step = of.comparison_step,
    };
    const System system;
    for (const std::string_view event : of.events) {
        const GuardInfo info = guard_info_of<typename System::State>(system, entry.guards.size());
        entry.guards.push_back(
            {.name = info.name.empty() ? of.guard_name : info.name, .event = event});
    }
    if constexpr (requires { System::mode_count; }) entry.modes = mode_names<System>();
    return entry;
}

}  // namespace ricochet::app
