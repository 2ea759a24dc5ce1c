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

namespace ricochet::learn {

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

}  // namespace ricochet::learn
