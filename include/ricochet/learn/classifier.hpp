// Training of a classifier that predicts whether a step meets an event surface.
//
// Binary cross entropy on logits, Adam, mini-batches, everything from one seed:
// the same options and data give the same weights to the bit on one machine,
// for any number of threads. A missed event is worse than a false alarm, so the
// decision threshold is put below the logit of every event of a validation set.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/detail/adam.hpp"
#include "ricochet/detail/assessment.hpp"
#include "ricochet/detail/data_set.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::learn {

/// How a classifier is trained.
struct TrainingOptions {
    std::vector<std::size_t> hidden{16, 16};  ///< widths of the hidden layers
    Activation activation = Activation::relu;
    std::vector<double> offset{};  ///< per feature; empty: the mean of the training states
    std::vector<double> scale{};   ///< per feature; empty: one over their standard deviation

    std::size_t iterations = 20'000;
    std::size_t batch = 256;   ///< states an iteration, half of them events
    double rate = 3e-3;        ///< learning rate at the start, [1/iteration]
    double final_rate = 1e-5;  ///< the same at the end; half a cosine in between
    Adam::Options adam{};

    double hard_share = 0.5;        ///< fraction of a batch drawn from the hardest states
    double hard_pool = 0.05;        ///< fraction of the training states counted as hardest
    std::size_t hard_every = 1000;  ///< iterations between two searches for them

    double test_share = 0.1;           ///< fraction held out and never examined in training
    double validation_share = 0.1;     ///< fraction of the rest, to choose weights and threshold
    std::size_t evaluate_every = 500;  ///< iterations between two checks at the validation set
    double logit_margin = 1;           ///< least distance of the threshold below any event's logit
    double gap_share = 0.5;  ///< the same as a fraction of the gap to the highest clear state
    double cleared_at_least = 0.5;  ///< fraction of clear states that the threshold must clear

    std::uint64_t seed = 1;
    std::filesystem::path checkpoint{};   ///< written periodically and on stopping; empty: none
    std::size_t checkpoint_every = 5000;  ///< iterations
    bool resume = false;                  ///< continue from `checkpoint`
    /// Read before every iteration; true stops the training, as the callback does. May be null.
    const std::atomic<bool>* cancelled = nullptr;
};

/// Cost of the runs that a training needs, extrapolated from a few of them. If these have no
/// event, it is the cost of the largest number of steps that the training may take.
struct TrainingEstimate {
    std::uint64_t guard_calls = 0;
    double seconds = 0;        ///< [s] processor time
    std::uint64_t events = 0;  ///< number of events that the training needs
    std::uint64_t seen = 0;    ///< events in the few runs
};

/// One sentence with the estimate.
[[nodiscard]] std::string describe(const TrainingEstimate& estimate);

/// Progress of a training, passed to its callback at every evaluation on the validation set.
struct Progress {
    std::size_t iteration = 0;
    std::size_t total = 0;
    double loss = 0;         ///< mean binary cross entropy on the validation set
    std::size_t misses = 0;  ///< validation events with a negative logit
    double seconds = 0;      ///< elapsed, earlier parts of a resumed training included
    /// "training", or the work before or after it, in which `iteration` counts events.
    std::string_view stage = "training";
    /// Set in the first report of a training whose states come from runs.
    std::optional<TrainingEstimate> estimate{};
};

/// Cost and result of one way of detecting events.
struct Rival {
    std::string name;  ///< "every step", "every 4 steps", ...
    std::uint64_t guard_calls = 0;
    double seconds = 0;        ///< [s] processor time
    std::uint64_t events = 0;  ///< number of events found
};

/// One sentence that names the fastest rival and the cost of the last one, the network; empty
/// without rivals. The first rival is `Extremum` at every step.
[[nodiscard]] std::string describe(const std::vector<Rival>& rivals);

/// Receives the progress; returns false to stop the training, whose best weights are kept.
using ProgressCallback = std::function<bool(const Progress&)>;

/// How a training ended.
enum class TrainingOutcome {
    finished,       ///< all iterations; no event of the validation or test set is missed
    stopped,        ///< by the callback; the best weights so far miss no event of these sets
    misses_remain,  ///< no threshold catches every event and still clears enough states
    diverged,       ///< the loss is not finite; the best before that is kept
};

/// Describes the outcome in one sentence, with a remedy.
[[nodiscard]] std::string_view describe(TrainingOutcome outcome) noexcept;

/// Result of a training. All figures are those of the stored weights, rounded to float.
struct Report {
    TrainingOutcome outcome = TrainingOutcome::finished;
    std::size_t iterations = 0;  ///< done
    double seconds = 0;          ///< [s] time of training
    std::size_t training_states = 0;
    std::size_t band = 0;             ///< clear states drawn inside the margin and not trained on
    Assessment validation;            ///< the set the threshold was chosen on
    Assessment held_out;              ///< the test set
    std::optional<Assessment> fresh;  ///< new balanced states, band included
    /// Reason why the last checkpoint could not be written; empty if it was, or there is none.
    std::string checkpoint_trouble{};
};

/// A trained classifier and its report.
struct Trained {
    Model model;
    Report report;

    /// Whether no event was missed on any set of the report, so that the model may be stored.
    [[nodiscard]] bool misses_none() const noexcept;
};

/// Trains a classifier on `data`.
///
/// The test set is held out first, then the validation set. The weights kept are
/// those with the best score (misses, false alarms, loss) on the validation set
/// at the threshold
///
///     lowest event - max(logit_margin, gap_share (lowest event - highest clear state)),
///
/// with the logits of the validation set. It is raised if necessary until `cleared_at_least` of the
/// clear states are cleared: a network that always predicts an event misses nothing but is useless.
/// Events that are missed because of this are reported as misses.
///
/// The model's domain is the range of the features in `data`. Entries that the data do not
/// determine (system, parameters, recipe, step range) are left to the caller.
///
/// @throws std::invalid_argument if the data are inconsistent or lack a class, or
///         an option is outside its range.
/// @throws std::runtime_error if the checkpoint cannot be written or read, or
///         belongs to other data or options.
[[nodiscard]] Trained train(const DataSet& data, const TrainingOptions& options,
                            const ProgressCallback& progress = {});

/// The report as a JSON object.
[[nodiscard]] std::string to_json(const Report& report);

}  // namespace ricochet::learn
