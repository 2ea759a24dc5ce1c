// Settings of differential inclusions: from requests to settings, from settings to the
// options of the integrators, and their outcomes.
#pragma once

#include "../settings.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/run.hpp"

namespace ricochet::app {

/// `SystemEntry::choose_integrator` of a differential inclusion. False: by events alone, like any
/// other system.
/// @throws BadInput for options that do not fit the system or the integrator.
[[nodiscard]] bool choose_set_valued(const SystemEntry& system, const RunRequest& request,
                                     RunSettings& settings);

/// Whether errors are measured against the norm of the start.
[[nodiscard]] bool measured_by_norm(const SetValuedSettings& settings) noexcept;

/// The options of Bathe's steps and of time stepping.
[[nodiscard]] SetValuedOptions set_valued_options(const RunSettings& settings);

}  // namespace ricochet::app
