// Policies that choose steps, by name: training them and finding them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "ricochet/learn/step_control.hpp"

namespace ricochet::app {

/// What `ricochet train` is told to train one.
inline constexpr std::string_view step_policy_name = "step-policy";

struct TrainPolicyRequest {
    std::string system{};
    std::filesystem::path out{};
    std::filesystem::path checkpoint{};  ///< empty: beside the model
    std::optional<std::uint64_t> seed{}, evaluations{};
    std::optional<double> seconds{};
    std::optional<unsigned> threads{};
    std::string trainer{};          ///< "evolution" if empty, "tqc" or "td3"
    std::optional<double> alpha{};  ///< of the reward of the latter two
    bool resume = false;
    bool json = false;
};

/// Trains, shows progress on standard error, prints the gains on problems held out and writes the
/// model. @return as `train`.
/// @throws BadInput, ModelError, std::invalid_argument or std::runtime_error.
int train_policy(const TrainPolicyRequest& request);

/// Where a training is kept that is interrupted.
/// @throws BadInput if files cannot be what they are to be.
[[nodiscard]] std::filesystem::path checked_checkpoint(const TrainPolicyRequest& request);

/// Random problems of that system, for training or held out.
/// @throws BadInput naming the systems that have some.
[[nodiscard]] learn::StepFamily step_family(const std::string& system, std::uint64_t seed);

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
