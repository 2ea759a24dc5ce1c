#pragma once

#include "ricochet/scene/simulate.hpp"

namespace ricochet::detail {

/// @throws std::invalid_argument naming the option, what was given and what was expected.
void validate(const SceneOptions& options);

}  // namespace ricochet::detail
