// `ricochet systems`: the list of systems.
#pragma once

#include <cstdint>

namespace ricochet::app {

enum class ListFormat : std::uint8_t {
    text,
    json,
    markdown,  ///< docs/systems.md
};

/// Prints every system with its parameters.
int list_systems(ListFormat format);

}  // namespace ricochet::app
