// Networks that choose steps, by name.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet::app {

/// The file of the policy that `named_policy` loads.
/// @throws BadInput if it does not exist.
[[nodiscard]] std::filesystem::path policy_file(const StepLayout& layout,
                                                const std::optional<std::string>& given);

/// The policy that the user named, or the policy of the library for the system.
/// @throws BadInput or ModelError if it does not exist, or is not for that system and its inputs.
[[nodiscard]] std::shared_ptr<const StepPolicy> named_policy(
    const StepLayout& layout, const std::optional<std::string>& given);

}  // namespace ricochet::app
