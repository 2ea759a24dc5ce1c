// TD3: reinforcement learning with twin delayed deterministic policy gradients.
//
// Two critics, of which the lower one counts; targets smoothed by noise on the action; a
// deterministic policy, updated at every second step, that explores by noise on its action.
//
//   S. Fujimoto, H. van Hoof and D. Meger, "Addressing function approximation error in actor-critic
//   methods", ICML 2018.
#pragma once

#include <cstddef>
#include <vector>

#include "ricochet/learn/environment.hpp"
#include "ricochet/learn/policy_training.hpp"

namespace ricochet::learn {

/// Options of `train_td3`.
struct Td3Options {
    PolicyTraining training{};
    std::vector<std::size_t> actor{64, 64};       ///< hidden layers, ReLU
    std::vector<std::size_t> critic{64, 64, 64};  ///< hidden layers, ReLU
    double rate = 1e-3;                           ///< of Adam, for critics and actor
    double exploration = 0.1;                     ///< standard deviation of the noise on the action
    double smoothing = 0.2;                       ///< the same, on the action of a target
    double smoothing_bound = 0.5;                 ///< that noise is clamped to +- this
    std::size_t delay = 2;  ///< the policy and the targets move at every so many-th update
};

/// Trains a policy by TD3 (Fujimoto, van Hoof and Meger 2018), with the contract of `train_tqc`.
[[nodiscard]] TrainedPolicy train_td3(const Environment& environment,
                                      const Td3Options& options = {},
                                      const PolicyCallback& progress = {});

}  // namespace ricochet::learn
