// Training policies that choose steps.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "ricochet/learn_steps/step_control.hpp"

namespace ricochet::app {

/// Request of `ricochet train` for a step policy.
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

/// The checkpoint of a training that is interrupted.
/// @throws BadInput if files cannot be used in their roles.
[[nodiscard]] std::filesystem::path checked_checkpoint(const TrainPolicyRequest& request);

/// Random problems of that system, for training or held out.
/// @throws BadInput naming the systems that have such problems.
[[nodiscard]] learn::StepFamily step_family(const std::string& system, std::uint64_t seed);

/// `train_policy` by TQC or TD3 on the source's problem of the system; prints its run there.
int train_actor(const TrainPolicyRequest& request);

}  // namespace ricochet::app
