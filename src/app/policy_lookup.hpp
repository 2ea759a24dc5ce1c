// Networks that choose steps, by name.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "ricochet/nonsmooth/step_policy.hpp"

namespace ricochet::app {

/// Kind and recipe of the actors that a reinforcement learner trained, kept for comparison
/// (docs/trainers.md).
inline constexpr std::string_view step_actor_kind = "step-actor";
inline constexpr std::string_view step_actor_recipe = "step-world-1";

/// The file of the policy that `named_policy` takes.
/// @throws BadInput if it is not there.
[[nodiscard]] std::filesystem::path policy_file(const StepLayout& layout,
                                                const std::optional<std::string>& given);

/// One sentence or two: what policies of a system were trained on, and when not to use the one that
/// comes along. Empty for a system without.
[[nodiscard]] std::string_view policy_advice(std::string_view system);

/// The policy that the user named, or the one that comes along for the system.
/// @throws BadInput or ModelError if it is not there, or not for that system and its inputs.
[[nodiscard]] std::shared_ptr<const StepPolicy> named_policy(
    const StepLayout& layout, const std::optional<std::string>& given);

}  // namespace ricochet::app
