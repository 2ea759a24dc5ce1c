// Search for the vector with the least score, from scores alone.
//
// CMA-ES: a population is drawn from a normal distribution, ranked, and the
// distribution moves to the better half and takes its spreads. The covariance is
// kept diagonal, so that memory and time per generation grow with the dimension.
// What does not have one spread per direction is found slowly, but surely.
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

/// The score of x; less is better. Called from several threads at a time, so it
/// must not change what it shares; must return the same for the same x, if the search
/// is to be repeated. Infinity refuses x; NaN does so too, and ranks behind it.
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
    double max_seconds = std::numeric_limits<double>::infinity();  ///< those before a resume count
    double target = -std::numeric_limits<double>::infinity();      ///< score that is good enough
    double least_spread = 1e-12;  ///< in all components, in units of `scales`

    unsigned threads = 2;  ///< 1 to 64; the result does not depend on it

    /// Written at the end of the search, and before that once in a while between two
    /// generations; empty: none.
    std::filesystem::path checkpoint{};
    bool resume = false;  ///< continue from `checkpoint`, to the same bits
};

/// How the search stands after a generation. One after the other they are its curve.
struct EvolutionProgress {
    std::size_t generation = 0;   ///< 1, 2, ...
    std::size_t evaluations = 0;  ///< so far
    double best = 0;              ///< least score so far
    double generation_best = 0;   ///< least score of this generation; NaN: none
    double generation_median = 0;
    double spread = 0;   ///< largest standard deviation, in units of `scales`
    double seconds = 0;  ///< so far
};

/// False stops the search; what was found is kept.
using EvolutionCallback = std::function<bool(const EvolutionProgress&)>;

/// Thrown by a score that is not to be waited for any longer: the search ends as `stopped`, and
/// what was tried of the generation in progress is tried again when it is resumed.
struct SearchStopped {};

/// How a search ended.
enum class EvolutionOutcome {
    max_evaluations,
    max_seconds,
    target,        ///< reached
    converged,     ///< to `least_spread`
    stopped,       ///< by the callback, or by `SearchStopped`
    none_allowed,  ///< no x had a score below infinity in `fruitless_generations` in a row
};

/// One sentence with the remedy.
[[nodiscard]] std::string_view describe(EvolutionOutcome outcome) noexcept;

/// After so many generations without any score below infinity the search gives up. Each of them
/// halves the spread, about where the search has been allowed last.
inline constexpr std::size_t fruitless_generations = 30;

/// Result of a search.
struct EvolutionResult {
    EvolutionOutcome outcome = EvolutionOutcome::max_evaluations;
    std::vector<double> x;  ///< with the least score of all that were tried, the start among them
    double score = 0;       ///< of x; NaN: no x had a score below infinity
    std::vector<double> mean;  ///< of the last distribution: what to take if scores are noisy
    std::size_t evaluations = 0;
    std::size_t generations = 0;
    double seconds = 0;
    /// Why the last checkpoint could not be written; empty: it was, or there is none.
    std::string checkpoint_trouble{};
};

/// Minimises `score`, starting at x0, which is itself tried first.
///
/// On one machine the result follows from score, x0, population, spread, scales and
/// seed, to the bit, however many threads run and however often the search was
/// interrupted and resumed. A search that had ended at a limit continues when it is
/// resumed with a higher one. Any other exception than `SearchStopped` thrown by `score` or
/// `progress` is thrown on.
/// @throws std::invalid_argument if x0 is empty or not finite, or an option is outside its range.
/// @throws std::runtime_error if the checkpoint cannot be written or read, or is of another search.
[[nodiscard]] EvolutionResult evolve(const Objective& score, std::span<const double> x0,
                                     const EvolutionOptions& options = {},
                                     const EvolutionCallback& progress = {});

}  // namespace ricochet::learn
