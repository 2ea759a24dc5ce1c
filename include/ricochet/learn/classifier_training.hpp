// Options of the training of a classifier for a system, and its comparison with other detectors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "ricochet/learn/classifier.hpp"
#include "ricochet/learn/detail/rivals.hpp"

namespace ricochet::learn {

/// Options of `train_classifier`.
struct ClassifierTraining {
    double step = 0;         ///< [s] fixed step for which the network is made, positive
    double run_length = 10;  ///< [s] length of a run; the next one has a new start

    std::size_t surface_points = 2000;     ///< events of the runs, from which states are taken
    std::size_t states = 100'000;          ///< for training and testing, half of them events
    std::size_t fresh_states = 40'000;     ///< for the report, from other runs
    std::size_t trial_events = 1000;       ///< events of the runs that measure the cost
    std::size_t most_steps = 100'000'000;  ///< largest number in each of these sets of runs
    double margin = 0.05;  ///< clear states nearer to the boundary are not trained on
    double widened = 0.1;  ///< fraction by which the domain exceeds the box of the runs on a side
    std::uint64_t seed = 1;
    TrainingOptions training{};  ///< its seed is replaced by the one above
};

/// Comparison of the exact detector `Ends` and the network on the same runs.
struct ClassifierTrial {
    std::uint64_t events = 0;  ///< of the exact runs
    std::uint64_t missed = 0;  ///< of these, found a step late by the network, or never
    std::uint64_t steps = 0;
    std::uint64_t exact_calls = 0;    ///< guard calls of the exact runs
    std::uint64_t network_calls = 0;  ///< guard calls of the runs with the network
    double exact_seconds = 0;         ///< [s] processor time
    double network_seconds = 0;

    /// Whether runs with the network took less time than exact runs.
    [[nodiscard]] bool pays() const noexcept { return network_seconds < exact_seconds; }

    std::vector<Rival>
        rivals{};  ///< other ways of detection, on some of these runs; the network last

    /// One sentence that says which way of checking is faster, and what the network misses.
    [[nodiscard]] std::string describe() const;
};

}  // namespace ricochet::learn
