// One function for each file in this directory.
#pragma once

#include "../registry.hpp"

namespace ricochet::app {

[[nodiscard]] SystemEntry bouncing_ball_entry();

}  // namespace ricochet::app
