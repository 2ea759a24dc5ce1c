#pragma once

#include <stdexcept>

#include "ricochet/scene/simulate.hpp"

namespace ricochet::detail {

/// @throws std::invalid_argument naming the option, what was given and what was expected.
void validate(const SceneOptions& options);

/// What `Scene::check` throws for a body that lies where it must not.
struct Misplaced : std::invalid_argument {
    Misplaced(const std::string& what, std::uint32_t which)
        : std::invalid_argument(what), body(which)
    {
    }
    std::uint32_t body;
};

}  // namespace ricochet::detail
