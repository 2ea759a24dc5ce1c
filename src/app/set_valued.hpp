// Reports on differential inclusions.
#pragma once

#include <string>

#include "json_text.hpp"
#include "registry.hpp"
#include "settings.hpp"

namespace ricochet::app {

/// "handover: dopri5, rtol 1e-10, atol 1e-12"; for other systems `describe_stepping`.
[[nodiscard]] std::string describe_integration(const RunSettings& settings);
[[nodiscard]] std::string set_valued_text(const TimedRun& timed);
void add_set_valued(Json& out, const RunSettings& settings, const TimedRun& timed);

}  // namespace ricochet::app
