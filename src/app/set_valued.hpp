// Systems that are differential inclusions, on the command line.
#pragma once

#include <string>

#include "compare.hpp"
#include "json_text.hpp"
#include "registry.hpp"
#include "settings.hpp"

namespace ricochet::app {

/// Fills in how a set-valued system is integrated. False: it is none.
/// @throws BadInput for what does not fit the system or the integrator.
[[nodiscard]] bool choose_set_valued(const SystemEntry& system, const RunRequest& request,
                                     RunSettings& settings);

/// "handover: dopri5, rtol 1e-10, atol 1e-12"; of other systems `describe_stepping`.
[[nodiscard]] std::string describe_integration(const RunSettings& settings);
[[nodiscard]] std::string set_valued_text(const TimedRun& timed);
void add_set_valued(Json& out, const RunSettings& settings, const TimedRun& timed);

/// Controllers and hand-over on one inclusion: steps, solves, time, true error.
[[nodiscard]] int compare_set_valued(const SystemEntry& system, const CompareRequest& request);

}  // namespace ricochet::app
