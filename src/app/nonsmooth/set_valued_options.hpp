// What the integrators of inclusions are told, and what they answer.
#pragma once

#include "../settings.hpp"
#include "ricochet/integrate/outcome.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet::app {

/// Whether errors are measured against the norm of the start.
[[nodiscard]] bool measured_by_norm(const SetValuedSettings& settings) noexcept;

/// The options of Bathe's steps and of time stepping.
[[nodiscard]] SetValuedOptions set_valued_options(const RunSettings& settings);

[[nodiscard]] Outcome as_outcome(HandOverOutcome outcome) noexcept;
[[nodiscard]] Outcome as_outcome(SetValuedOutcome outcome) noexcept;

}  // namespace ricochet::app
