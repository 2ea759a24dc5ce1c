// Actors that a reinforcement learner trained to choose steps, by the reward of the publication
// that learned steps come from: made and kept for comparison (docs/trainers.md).
#pragma once

#include <string>
#include <string_view>

#include "ricochet/detail/step_environment.hpp"
#include "ricochet/nn/model.hpp"
#include "step_policy.hpp"

namespace ricochet::app {

inline constexpr std::string_view step_actor_kind = "step-actor";
inline constexpr std::string_view step_actor_recipe = "step-world-1";

/// Runs of the source's problem of a system: one element of fault, its sliding mode, its circuit.
/// @throws BadInput naming the systems that have one.
[[nodiscard]] learn::StepWorld source_world(const std::string& system,
                                            const learn::StepWorldOptions& options);

/// Trains one by TQC or TD3 on the source's problem of that system, prints its run there and
/// writes the model. @return as `train`.
/// @throws BadInput, ModelError, std::invalid_argument or std::runtime_error.
int train_actor(const TrainPolicyRequest& request);

/// The one that comes along for a system.
/// @throws BadInput or ModelError if it is not there or something else.
[[nodiscard]] Model shipped_actor(std::string_view system);

/// How an actor is judged: it takes the steps that it was trained with, until nothing moves.
[[nodiscard]] learn::StepWorldOptions judged(const Model& actor);

}  // namespace ricochet::app
