// Networks that choose steps, by name.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "ricochet/nonsmooth/step_policy.hpp"

namespace ricochet::app {

/// The file of the policy that `named_policy` takes.
/// @throws BadInput if it is not there.
[[nodiscard]] std::filesystem::path policy_file(const StepLayout& layout,
                                                const std::optional<std::string>& given);

/// The policy that the user named, or the one that comes along for the system.
/// @throws BadInput or ModelError if it is not there, or not for that system and its inputs.
[[nodiscard]] std::shared_ptr<const StepPolicy> named_policy(
    const StepLayout& layout, const std::optional<std::string>& given);

}  // namespace ricochet::app
