// The state of an interrupted training, as it is kept on disk.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/learn/adam.hpp"

namespace ricochet::learn {

/// Quality of a set of weights on the validation set; smaller is better,
/// compared from the first member to the last.
struct Score {
    std::uint64_t misses = 0;        ///< at the threshold chosen for these weights
    std::uint64_t false_alarms = 0;  ///< at the same threshold
    double loss = 0;                 ///< mean binary cross entropy

    friend bool operator==(const Score&, const Score&) = default;
};

/// Everything that a training needs to continue with the same bits.
struct Checkpoint {
    std::uint64_t fingerprint = 0;  ///< of the data set and the options
    std::uint64_t iteration = 0;    ///< iterations done
    double seconds = 0;             ///< [s] time spent on them
    Random::State random{};
    std::vector<double> parameters;
    Adam::State adam;
    std::vector<std::uint64_t> hard;      ///< training states in rotation as hard ones
    std::vector<double> best_parameters;  ///< as float; empty before the first evaluation
    double best_threshold = 0;
    Score best_score;
};

/// Everything that the training of a gate needs, whose states are drawn again from its seed.
struct GateCheckpoint {
    std::uint64_t fingerprint = 0;  ///< of the options and the states of the first round
    std::uint64_t round = 0;
    std::uint64_t iteration = 0;   ///< iterations done in this round
    std::uint64_t iterations = 0;  ///< iterations of all rounds
    std::uint64_t since_best = 0;  ///< evaluations since the best one
    double seconds = 0;
    Random::State random{};
    std::vector<double> parameters;
    Adam::State adam;
    double best_cost = 0;
    /// The best so far of every round, this one last: weights as float, and thresholds.
    std::vector<std::vector<double>> best_parameters;
    std::vector<std::vector<double>> best_thresholds;
};

/// Saves and loads the checkpoint of a gate, like a `Checkpoint`.
void save_checkpoint(const GateCheckpoint& checkpoint, const std::filesystem::path& file);
[[nodiscard]] GateCheckpoint load_gate_checkpoint(const std::filesystem::path& file);

/// Writes to a neighbouring file and renames it, so that an interruption leaves
/// the old checkpoint or the new one, never half of one. Numbers are stored as
/// their bits, little-endian.
/// @throws std::runtime_error naming the file if it cannot be written.
void save_checkpoint(const Checkpoint& checkpoint, const std::filesystem::path& file);

/// @throws std::runtime_error naming the file if it cannot be read, is not a
///         checkpoint, is cut short or has been altered.
[[nodiscard]] Checkpoint load_checkpoint(const std::filesystem::path& file);

}  // namespace ricochet::learn
