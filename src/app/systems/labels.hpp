// The names of guards and modes, as declared by systems.
#pragma once

#include <initializer_list>
#include <string_view>
#include <vector>

#include "../registry.hpp"

namespace ricochet::app {

/// The guards of a system by their own names, with the events on their surfaces.
template <class System>
[[nodiscard]] std::vector<GuardLabel> labels(const System& system,
                                             std::initializer_list<std::string_view> events)
{
    std::vector<GuardLabel> out;
    for (const std::string_view event : events) {
        out.push_back({.name = system.guard_info(out.size()).name, .event = event});
    }
    return out;
}

/// The modes of a system by their own names.
template <class System>
[[nodiscard]] std::vector<std::string_view> mode_names()
{
    std::vector<std::string_view> out;
    for (Mode mode = 0; mode < System::mode_count; ++mode) out.push_back(System::mode_name(mode));
    return out;
}

}  // namespace ricochet::app
