// TQC: reinforcement learning with truncated quantile critics.
//
// Several critics estimate the distribution of the return by its quantiles; of all their quantiles
// together the highest are left out where the target is formed, which keeps the critics from
// overestimating. The policy is stochastic and is paid for its entropy, with a weight that
// holds the entropy at -1 per action.
//
//   A. Kuznetsov, P. Shvechikov, A. Grishin and D. Vetrov, "Controlling overestimation bias with
//   truncated mixture of continuous distributional quantile critics", ICML 2020;
//   T. Haarnoja et al., "Soft actor-critic algorithms and applications", arXiv:1812.05905, 2018
//   (weight of the entropy: its equation 18);
//   A. Raffin, J. Kober and F. Stulp, "Smooth exploration for robotic reinforcement learning",
//   CoRL 2021 (exploration that depends on the state).
#pragma once

#include <cstddef>
#include <vector>

#include "ricochet/learn/environment.hpp"
#include "ricochet/learn/policy_training.hpp"

namespace ricochet::learn {

/// Options of `train_tqc`.
struct TqcOptions {
    PolicyTraining training{};
    std::vector<std::size_t> actor{64, 64};       ///< hidden layers, ReLU
    std::vector<std::size_t> critic{64, 64, 64};  ///< hidden layers, ReLU
    std::size_t critics = 5;
    std::size_t quantiles = 25;      ///< of each critic
    std::size_t dropped = 2;         ///< of each critic, counted; the highest of all go
    double rate = 3e-4;              ///< of Adam, for critics, actor and temperature
    double first_temperature = 1;    ///< weight of the entropy at the start, positive
    std::size_t noise_interval = 1;  ///< steps after which the noise of the exploration is redrawn
};

/// Trains a policy. Everything follows from options and environment, to the bit on one machine,
/// however many threads run and however often it was interrupted and resumed. A training that had
/// ended continues if it is resumed with more steps.
/// @throws std::invalid_argument if an option is outside its range, or the environment is
/// incomplete.
/// @throws std::runtime_error if the checkpoint cannot be written or read, is of another training,
///         or the environment does not repeat the episode that was interrupted.
[[nodiscard]] TrainedPolicy train_tqc(const Environment& environment,
                                      const TqcOptions& options = {},
                                      const PolicyCallback& progress = {});

}  // namespace ricochet::learn
