// The problems on which the source trained its actors, and the actors of the library.
#pragma once

#include <string>
#include <string_view>

#include "ricochet/learn_steps/step_environment.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::app {

/// Runs of the source's problem of a system: one element of fault, its sliding mode, its circuit.
/// @throws BadInput naming the systems that have one.
[[nodiscard]] learn::StepEnvironment source_environment(
    const std::string& system, const learn::StepEnvironmentOptions& options);

/// The actor of the library for a system.
/// @throws BadInput or ModelError if it does not exist or is no actor.
[[nodiscard]] Model shipped_actor(std::string_view system);

/// Options for assessing an actor: it takes the steps that it was trained with, until nothing
/// moves.
[[nodiscard]] learn::StepEnvironmentOptions judged(const Model& actor);

}  // namespace ricochet::app
