// Acting, storing and learning in turns: the loop around a learner.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "learn/checkpoint_file.hpp"
#include "ricochet/base/random.hpp"
#include "ricochet/learn_steps/policies.hpp"
#include "transitions.hpp"

namespace ricochet::learn {

struct LearnerLosses {
    double critic = 0;
    double actor = 0;
    double temperature = 0;
};

/// Interface of a learner.
struct Learner {
    std::string name;  ///< for messages, e.g. "train_tqc"
    /// An action for this observation, with noise.
    std::function<void(std::span<const double> observation, std::span<double> action)> explore;
    /// One update; losses are examined after it if `losses`.
    std::function<void(const ReplayBuffer&, bool losses)> update;
    std::function<LearnerLosses()> losses;
    std::function<bool()> finite;
    std::function<std::vector<DenseLayer>()> layers;
    std::function<void(Writer&)> shape;    ///< of the networks
    std::function<void(Writer&)> options;  ///< the other options in which a resumed training must
                                           ///< agree
    std::function<void(Writer&)> save;
    std::function<void(Reader&)> load;
    std::function<void(std::uint64_t seed)> reseed;
};

/// @throws std::invalid_argument naming what is out of range
void check(const std::string& name, const Environment& environment, const PolicyTraining& training);

[[nodiscard]] TrainedPolicy train_policy(const Environment& environment,
                                         const PolicyTraining& training, const Learner& learner,
                                         const PolicyCallback& progress);

}  // namespace ricochet::learn
