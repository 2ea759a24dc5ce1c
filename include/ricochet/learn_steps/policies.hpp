// Search without gradients, and learning from rewards: what trains policies.
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

#include "ricochet/nn/model.hpp"

namespace ricochet::learn {

// Minimisation of a score from its values alone.
//
// CMA-ES: a population is drawn from a normal distribution and ranked, and the mean and the
// variances of the distribution are updated from the better half. The covariance is kept diagonal,
// so that memory and time per generation grow linearly with the dimension. Problems whose scales do
// not align with the coordinate axes converge slowly.
//
//   R. Ros and N. Hansen, "A simple modification in CMA-ES achieving linear time
//   and space complexity", PPSN X, 2008;
//   N. Hansen, "The CMA evolution strategy: a tutorial", arXiv:1604.00772, 2016
//   (parameters: its table 1).

/// The score of x; less is better. Called from several threads at a time, so it must not modify
/// shared data. It must return the same value for the same x if the search is to be repeatable.
/// Infinity rejects x; NaN rejects it, too, and ranks last.
using Objective = std::function<double(std::span<const double> x)>;

/// Options of a search.
struct EvolutionOptions {
    std::size_t population = 0;    ///< per generation, at least 4; 0: 4 + floor(3 ln n)
    double spread = 0.5;           ///< standard deviation at the start, positive
    std::vector<double> scales{};  ///< of the spread per component, positive; empty: 1
    std::uint64_t seed = 1;
    /// Name of the problem; a checkpoint of another problem is not resumed.
    std::string problem{};

    /// The search ends after the generation in which one of these is reached.
    std::size_t max_evaluations = 10'000;
    double max_seconds = std::numeric_limits<double>::infinity();  ///< [s] including earlier parts
    double target = -std::numeric_limits<double>::infinity();      ///< score that is good enough
    double least_spread = 1e-12;  ///< in all components, in units of `scales`

    unsigned threads = 2;  ///< 1 to 64; the result does not depend on it

    /// Checkpoint file, written periodically between generations and at the end of the
    /// search; empty: none.
    std::filesystem::path checkpoint{};
    bool resume = false;  ///< continue from `checkpoint`, to the same bits
};

/// State of the search after a generation; the sequence of these is its convergence history.
struct EvolutionProgress {
    std::size_t generation = 0;   ///< 1, 2, ...
    std::size_t evaluations = 0;  ///< so far
    double best = 0;              ///< least score so far
    double generation_best = 0;   ///< least score of this generation; NaN: none
    double generation_median = 0;
    double spread = 0;   ///< largest standard deviation, in units of `scales`
    double seconds = 0;  ///< so far
};

/// Returns false to stop the search; the best point found so far is kept.
using EvolutionCallback = std::function<bool(const EvolutionProgress&)>;

/// Thrown by a score to abort the search, which ends as `stopped`. The generation in progress is
/// evaluated again when the search is resumed.
struct SearchStopped {};

/// How a search ended.
enum class EvolutionOutcome {
    max_evaluations,
    max_seconds,
    target,        ///< the target score was reached
    converged,     ///< the spread fell below `least_spread`
    stopped,       ///< by the callback, or by `SearchStopped`
    none_allowed,  ///< no x had a score below infinity in `stagnant_generations` in a row
};

/// Describes the outcome in one sentence, with a remedy.
[[nodiscard]] std::string_view describe(EvolutionOutcome outcome) noexcept;

/// Number of consecutive generations without a score below infinity after which the search gives
/// up. Each of them halves the spread and moves the mean to the best point so far.
inline constexpr std::size_t stagnant_generations = 30;

/// Result of a search.
struct EvolutionResult {
    EvolutionOutcome outcome = EvolutionOutcome::max_evaluations;
    std::vector<double> x;     ///< point with the least score of all that were evaluated
    double score = 0;          ///< of x; NaN: no x had a score below infinity
    std::vector<double> mean;  ///< mean of the last distribution, better if scores are noisy
    std::size_t evaluations = 0;
    std::size_t generations = 0;
    double seconds = 0;
    /// Reason why the last checkpoint could not be written; empty if it was, or there is none.
    std::string checkpoint_trouble{};
};

/// Minimises `score`, starting at x0, which is itself tried first.
///
/// On one machine the result depends only on score, x0, population, spread, scales and seed, bit
/// for bit, for any number of threads and of interruptions. A search that had ended at a limit
/// continues when it is resumed with a higher one. Any exception other than `SearchStopped` thrown
/// by `score` or `progress` is passed on.
/// @throws std::invalid_argument if x0 is empty or not finite, or an option is outside its range.
/// @throws std::runtime_error if the checkpoint cannot be written or read, or is of another search.
[[nodiscard]] EvolutionResult evolve(const Objective& score, std::span<const double> x0,
                                     const EvolutionOptions& options = {},
                                     const EvolutionCallback& progress = {});

// Reinforcement learning: environments, and the trainers of policies that act in them.

// The environment in which a reinforcement learner acts.

/// Reward of an action, and whether it ends the episode. The observation is returned separately.
struct Reaction {
    double reward = 0;
    bool terminal = false;   ///< the episode is over, and no reward can follow
    bool truncated = false;  ///< the episode is cut here, though rewards would follow
};

/// An environment with episodes, given by its functions.
///
///     reset(seed, o);  while not over: choose a from o;  step(a, o)
///
/// Everything in an episode follows from its seed and the actions, so that a training can be
/// repeated, and resumed: a trainer returns to the middle of an episode by `reset` with its
/// seed and the actions taken. Rewards and observations of order one are learnt best.
/// A trainer calls from one thread at a time.
struct Environment {
    std::size_t observations = 0;  ///< length of an observation
    std::size_t actions = 0;       ///< length of an action, whose components lie in [-1, 1]

    /// Begins an episode; writes the first observation.
    std::function<void(std::uint64_t episode_seed, std::span<double> observation)> reset{};

    /// Acts; writes the observation after. Not called after `terminal` or `truncated`.
    std::function<Reaction(std::span<const double> action, std::span<double> observation)> step{};
};

// Options, progress and result that all trainers of policies share.
//
// A policy is a network from observations to actions, which a reinforcement learner finds by
// acting. The trainer takes one action per step in an `Environment`, stores the transition in a
// buffer, and updates the networks once per step with a batch from that buffer. `train_tqc` and
// `train_td3` do so.

/// Options that all trainers of policies share.
struct PolicyTraining {
    std::size_t steps = 20'000;      ///< number of steps in the environment
    std::size_t random_steps = 100;  ///< number of first steps with uniform actions and no updates
    std::size_t batch = 256;
    std::size_t buffer = 1'000'000;  ///< largest number of transitions kept
    double discount = 0.99;          ///< discount factor per step, in [0, 1]
    double polyak = 0.005;           ///< target += polyak (network - target), in (0, 1]
    std::uint64_t seed = 1;
    unsigned threads = 2;  ///< 1 to 64; the result does not depend on it
    double max_seconds = std::numeric_limits<double>::infinity();  ///< [s] including earlier parts

    /// Number of steps between reports: progress, checkpoint, and a test for weights that are not
    /// finite.
    std::size_t report_every = 1000;
    std::filesystem::path checkpoint{};  ///< empty: none
    bool resume = false;                 ///< continue from `checkpoint`, to the same bits

    /// Checkpoint of an earlier training, in another environment or with other options but with
    /// networks of the same shape. The training starts from its networks and the moments of their
    /// optimiser, with an empty buffer, and uses its policy from the first step. Empty: none.
    std::filesystem::path start_from{};
};

/// State of the training; the sequence of these is its learning curve.
struct PolicyProgress {
    std::size_t step = 0;      ///< done so far
    std::size_t steps = 0;     ///< of the training
    std::size_t episodes = 0;  ///< ended so far
    /// Mean return of the episodes that ended since the last report, undiscounted; NaN: none.
    double mean_return = 0;
    /// Loss of the last batch; NaN if there is none, or no report was due. The same holds for
    /// the next two.
    double critic_loss = 0;
    double actor_loss = 0;
    double temperature = 0;  ///< weight of the entropy; 0 for TD3, which has none
    double seconds = 0;      ///< so far
};

/// Receives the current deterministic policy. Returns false to stop the training; what was learned
/// is kept.
using PolicyCallback = std::function<bool(const PolicyProgress&, const Model& policy)>;

/// How a training of a policy ended.
enum class PolicyOutcome {
    finished,     ///< all steps were taken
    max_seconds,  ///< `max_seconds` was reached
    stopped,      ///< by the callback
    non_finite,   ///< the environment gave a reward or an observation that is not finite
    diverged,     ///< weights are not finite; the policy is that of the last report
};

/// Describes the outcome in one sentence, with a remedy.
[[nodiscard]] std::string_view describe(PolicyOutcome outcome) noexcept;

/// A trained policy and its report.
struct TrainedPolicy {
    PolicyOutcome outcome = PolicyOutcome::finished;
    std::string message;  ///< what was not finite, and where; else empty

    /// The deterministic policy: action = tanh(network(observation)). Its `domain` is the range of
    /// the observations; kind, system, parameters and recipe are left to the caller.
    Model policy;

    std::vector<PolicyProgress> curve;
    std::size_t steps = 0;  ///< number of steps taken
    std::size_t episodes = 0;
    double seconds = 0;
    /// Reason why the last checkpoint could not be written; empty if it was, or there is none.
    std::string checkpoint_trouble{};
};

// TQC: reinforcement learning with truncated quantile critics.
//
// Several critics estimate the distribution of the return by its quantiles. The highest of all
// their quantiles together are dropped in the target, which keeps the critics from overestimating.
// The policy is stochastic, and the reward includes its entropy, with a weight that holds the
// entropy at -1 per action.
//
//   A. Kuznetsov, P. Shvechikov, A. Grishin and D. Vetrov, "Controlling overestimation bias with
//   truncated mixture of continuous distributional quantile critics", ICML 2020;
//   T. Haarnoja et al., "Soft actor-critic algorithms and applications", arXiv:1812.05905, 2018
//   (weight of the entropy: its equation 18);
//   A. Raffin, J. Kober and F. Stulp, "Smooth exploration for robotic reinforcement learning",
//   CoRL 2021 (exploration that depends on the state).

/// Options of `train_tqc`.
struct TqcOptions {
    PolicyTraining training{};
    std::vector<std::size_t> actor{64, 64};       ///< hidden layers, ReLU
    std::vector<std::size_t> critic{64, 64, 64};  ///< hidden layers, ReLU
    std::size_t critics = 5;
    std::size_t quantiles = 25;      ///< number for each critic
    std::size_t dropped = 2;         ///< number per critic; the highest of all are dropped
    double rate = 3e-4;              ///< of Adam, for critics, actor and temperature
    double first_temperature = 1;    ///< weight of the entropy at the start, positive
    std::size_t noise_interval = 1;  ///< steps after which the exploration noise is drawn again
};

/// Trains a policy by TQC. The result depends only on options and environment, bit for bit on one
/// machine, for any number of threads and of interruptions. A training that had ended continues if
/// it is resumed with more steps.
/// @throws std::invalid_argument if an option is outside its range, or the environment is
/// incomplete.
/// @throws std::runtime_error if the checkpoint cannot be written or read, is of another training,
///         or the environment does not repeat the episode that was interrupted.
[[nodiscard]] TrainedPolicy train_tqc(const Environment& environment,
                                      const TqcOptions& options = {},
                                      const PolicyCallback& progress = {});

// TD3: reinforcement learning with twin delayed deterministic policy gradients.
//
// Two critics, of which the lower one counts; targets smoothed by noise on the action; a
// deterministic policy, updated at every second step, that explores by noise on its action.
//
//   S. Fujimoto, H. van Hoof and D. Meger, "Addressing function approximation error in actor-critic
//   methods", ICML 2018.

/// Options of `train_td3`.
struct Td3Options {
    PolicyTraining training{};
    std::vector<std::size_t> actor{64, 64};       ///< hidden layers, ReLU
    std::vector<std::size_t> critic{64, 64, 64};  ///< hidden layers, ReLU
    double rate = 1e-3;                           ///< of Adam, for critics and actor
    double exploration = 0.1;                     ///< standard deviation of the noise on the action
    double smoothing = 0.2;                       ///< the same, on the action of a target
    double smoothing_bound = 0.5;                 ///< bound to which that noise is clamped
    std::size_t delay = 2;  ///< updates of the critics for each of the policy and the targets
};

/// Trains a policy by TD3 (Fujimoto, van Hoof and Meger 2018), with the contract of `train_tqc`.
[[nodiscard]] TrainedPolicy train_td3(const Environment& environment,
                                      const Td3Options& options = {},
                                      const PolicyCallback& progress = {});

}  // namespace ricochet::learn
