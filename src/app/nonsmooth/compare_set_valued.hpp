// `ricochet compare` of differential inclusions, on errors of the state instead of events.
#pragma once

#include "../compare.hpp"

namespace ricochet::app {

struct SystemEntry;

/// Controllers and hand-over on one inclusion: steps, solves, time, true error.
[[nodiscard]] int compare_set_valued(const SystemEntry& system, const CompareRequest& request);

}  // namespace ricochet::app
