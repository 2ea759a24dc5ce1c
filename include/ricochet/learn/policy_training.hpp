// Options, progress and result that all trainers of policies share.
//
// A policy is a network from observations to actions, which a reinforcement learner finds by
// acting. It acts once per step in an `Environment`, keeps what came of it, and learns from a batch
// of what it keeps once per step. `learn/tqc.hpp` and `learn/td3.hpp` do so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/learn/environment.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::learn {

/// Options that all trainers of policies share.
struct PolicyTraining {
    std::size_t steps = 20'000;      ///< in the environment
    std::size_t random_steps = 100;  ///< the first ones: uniform actions, and nothing learnt yet
    std::size_t batch = 256;
    std::size_t buffer = 1'000'000;  ///< transitions kept, at most
    double discount = 0.99;          ///< of the reward per step, in [0, 1]
    double polyak = 0.005;           ///< target += polyak (network - target), in (0, 1]
    std::uint64_t seed = 1;
    unsigned threads = 2;  ///< 1 to 64; the result does not depend on it
    double max_seconds = std::numeric_limits<double>::infinity();  ///< those before a resume count

    /// Every so many steps: progress, checkpoint, and a look for weights that are not finite.
    std::size_t report_every = 1000;
    std::filesystem::path checkpoint{};  ///< empty: none
    bool resume = false;                 ///< continue from `checkpoint`, to the same bits

    /// The checkpoint of an earlier training, in another environment or with other options but with
    /// networks of the same shape: this one starts from its networks and the moments of their
    /// optimiser, with a buffer that is empty, and acts by its policy from the first step. Empty:
    /// none.
    std::filesystem::path start_from{};
};

/// How the training stands. One after the other they are its curve.
struct PolicyProgress {
    std::size_t step = 0;      ///< done so far
    std::size_t steps = 0;     ///< of the training
    std::size_t episodes = 0;  ///< ended so far
    /// Mean return of the episodes that ended since the last report, undiscounted; NaN: none.
    double mean_return = 0;
    /// Loss of the last batch; NaN where there is none, or no report was due. The same holds for
    /// the next two.
    double critic_loss = 0;
    double actor_loss = 0;
    double temperature = 0;  ///< weight of the entropy; 0 for a trainer without
    double seconds = 0;      ///< so far
};

/// Gets the deterministic policy as it is now. False stops the training; what was learnt is kept.
using PolicyCallback = std::function<bool(const PolicyProgress&, const Model& policy)>;

/// How a training of a policy ended.
enum class PolicyOutcome {
    finished,     ///< all steps
    max_seconds,  ///< reached
    stopped,      ///< by the callback
    non_finite,   ///< the environment gave a reward or an observation that is not finite
    diverged,     ///< weights are not finite; the policy is that of the last report
};

/// One sentence with the remedy.
[[nodiscard]] std::string_view describe(PolicyOutcome outcome) noexcept;

/// A trained policy and its report.
struct TrainedPolicy {
    PolicyOutcome outcome = PolicyOutcome::finished;
    std::string message;  ///< what was not finite, and where; else empty

    /// The deterministic policy: action = tanh(network(observation)). Of `domain`, what
    /// was observed; kind, system, parameters and recipe are left to the caller.
    Model policy;

    std::vector<PolicyProgress> curve;
    std::size_t steps = 0;  ///< done
    std::size_t episodes = 0;
    double seconds = 0;
    /// Why the last checkpoint could not be written; empty: it was, or there is none.
    std::string checkpoint_trouble{};
};

}  // namespace ricochet::learn
