// The environment in which a reinforcement learner acts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

namespace ricochet::learn {

/// Reward and end of an action; the observation after it is returned apart.
struct Reaction {
    double reward = 0;
    bool terminal = false;   ///< the episode is over, and no reward can follow
    bool truncated = false;  ///< the episode is cut here, though rewards would follow
};

/// A world in episodes, as its functions.
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

}  // namespace ricochet::learn
