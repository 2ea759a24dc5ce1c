// Advice on networks that choose steps.
#pragma once

#include <string_view>

namespace ricochet::app {

/// Kind and recipe of the actors that a reinforcement learner trained, kept for comparison
/// (docs/trainers.md).
inline constexpr std::string_view step_actor_kind = "step-actor";
inline constexpr std::string_view step_actor_recipe = "step-world-1";

/// One sentence or two on the training of a system's policies, and on when not to use the policy of
/// the library. Empty for a system without.
[[nodiscard]] std::string_view policy_advice(std::string_view system);

}  // namespace ricochet::app
