// Training of classifiers and gates from samples: options, results, and the models of the ball.
#pragma once

#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/gate.hpp"
#include "ricochet/learn/adam.hpp"
#include "ricochet/learn/assessment.hpp"
#include "ricochet/learn/data_set.hpp"
#include "ricochet/learn/surface.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/system.hpp"

namespace ricochet::learn {

// Training of a classifier that predicts whether a step meets an event surface.
//
// Binary cross entropy on logits, Adam, mini-batches, everything from one seed:
// the same options and data give the same weights to the bit on one machine,
// for any number of threads. A missed event is worse than a false alarm, so the
// decision threshold is put below the logit of every event of a validation set.

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

/// One sentence that says whether the network, the last rival, is the fastest of those that lose no
/// more events than the network, and else from which price of a guard call on; empty without
/// rivals. The first rival is `Extremum` at every step.
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

// Gates for a user's system: training, thresholds, and measured miss rates.
//
// A *horizon* gate is for guards of which only the value or the sign is known. States come from
// runs; each is labelled with the time to the next event. Since a gated run examines the guard at
// the end of every horizon, it still finds an event that was cleared, unless the guard, without its
// reset, has changed sign again by then. Such states are *fatal*. The threshold of each horizon
// lies below the logit of every fatal state that was seen, and low enough that rolling back does
// not cost more than the skipped checks save.
//
// A *level* gate is for a guard with a value and a bound. Its network estimates the guard from
// below; each level's threshold is below the logit of every state whose guard is not above it.
//
// `learn/train.hpp` samples the runs and trains a gate in one call.

/// Where a run starts.
template <class X>
struct RunStart {
    double t = 0;  ///< [s]
    X x{};
    Mode mode = 0;
};

/// Generator of starts. A start that the system rejects (behind a unilateral guard) is redrawn.
template <class X>
using Starts = std::function<RunStart<X>(Random&)>;

/// Starts that are uniform in a box of states, and in time.
/// @throws std::invalid_argument if a side of the box is negative or not finite.
template <class X>
[[nodiscard]] Starts<X> from_box(const X& lower, const X& upper, double t_lower = 0,
                                 double t_upper = 0, Mode mode = 0)
{
    const auto n = static_cast<std::size_t>(lower.size());
    for (std::size_t i = 0; i < n; ++i) {
        if (!(lower[i] <= upper[i]) || !std::isfinite(upper[i] - lower[i])) {
            throw std::invalid_argument("from_box: component " + std::to_string(i) +
                                        " of the box runs from " + std::to_string(lower[i]) +
                                        " to " + std::to_string(upper[i]));
        }
    }
    return [=](Random& random) {
        RunStart<X> start{.t = random.uniform(t_lower, t_upper), .x = lower, .mode = mode};
        for (std::size_t i = 0; i < n; ++i) start.x[i] = random.uniform(lower[i], upper[i]);
        return start;
    };
}

/// Returns the horizons [s] that span the given numbers of steps of length `step` [s].
[[nodiscard]] inline std::vector<double> horizons(double step,
                                                  std::initializer_list<std::size_t> steps)
{
    std::vector<double> out;
    for (const std::size_t n : steps) out.push_back(static_cast<double>(n) * step);
    return out;
}

/// Whether a gate predicts horizons [s], or levels of the guard.
enum class GateKind { horizon, level };

/// "gate-horizon" or "gate-level", as a model spells it.
[[nodiscard]] std::string_view name(GateKind kind) noexcept;

/// Purpose and options of a training of a gate.
struct GateTraining {
    GateKind kind = GateKind::horizon;
    GateRecipe recipe{};
    /// Horizons [s], or levels in units of the guard; positive, rising. A horizon of k steps
    /// saves k - 1 checks.
    std::vector<double> levels{};

    /// Fixed steps [s] are drawn from this range, run by run; ignored with error control.
    double step_min = 0;
    double step_max = 0;
    double run_length = 10;  ///< [s] length of a run; the next one has a new start

    std::size_t events = 3000;             ///< of the training runs
    std::size_t states = 200'000;          ///< largest number kept for training
    std::size_t validation_events = 1000;  ///< number of events that choose weights and thresholds
    std::size_t fresh_events = 30'000;     ///< to measure the miss rate; 0: not measured
    std::size_t most_steps = 100'000'000;  ///< largest number in each of these sets of runs
    /// Whether states are drawn by the logarithm of the time to their event, so that every horizon
    /// is learned from as many states; for horizon gates that span more than a few octaves.
    bool logarithmic = false;
    /// Largest fraction of events that may be missed, with 95 % confidence; 0: as few as possible,
    /// by thresholds that clear no state that is known to be fatal.
    double miss_rate = 0;
    std::size_t calibration_events = 0;  ///< that choose thresholds for `miss_rate`; 0: enough

    std::vector<std::size_t> hidden{16, 16};
    std::size_t iterations = 4000;  ///< iterations in a round
    std::size_t rounds = 2;         ///< hard states are added after each round except the last
    std::size_t hard_events = 0;    ///< events of the runs searched for hard states; 0: as `events`
    std::size_t neighbours = 2;     ///< states sampled near each hard one
    std::size_t batch = 256;
    double rate = 3e-3;  ///< learning rate at the start of a round
    double final_rate = 3e-5;
    std::size_t evaluate_every = 250;
    std::size_t patience = 8;    ///< evaluations without improvement after which a round ends
    double fatal_weight = 4;     ///< weight of a fatal state in the loss
    double quantile = 0.98;      ///< fraction of guards that a level gate underestimates
    double logit_margin = 0.25;  ///< distance of a threshold below the lowest fatal logit
    std::uint64_t seed = 1;

    std::filesystem::path checkpoint{};  ///< written at every evaluation; empty: none
    bool resume = false;                 ///< continue from `checkpoint`, to the same bits
    /// Read before every iteration; true stops the training, as the callback does. May be null.
    const std::atomic<bool>* cancelled = nullptr;
};

/// Purpose of a gate, for a trainer that chooses the rest: see `choose`. Horizon gates only.
struct GateAim {
    GateRecipe recipe{};
    double step = 0;         ///< [s] fixed; not used with error control
    double run_length = 10;  ///< [s] length of a run
    double miss_rate =
        2e-4;  ///< largest fraction of events that may be missed, with 95 % confidence
    /// Price [s] of a call of the guard where the gate is to be used; 0: as measured here.
    double guard_seconds = 0;
    std::uint64_t seed = 1;

    std::filesystem::path checkpoint{};  ///< as in `GateTraining`
    bool resume = false;
    const std::atomic<bool>* cancelled = nullptr;
};

/// First runs of a system, from which a training is chosen.
struct GateSurvey {
    double step = 0;                  ///< [s] fixed, or the mean
    std::vector<double> intervals{};  ///< [steps] between events
    std::vector<double>
        dwells{};  ///< [steps] beyond the surface, if the flow goes on without reset
    std::uint64_t guard_calls = 0;
    double guard_seconds = 0;  ///< [s] of a call

    [[nodiscard]] double interval() const;  ///< [steps] median between events
    [[nodiscard]] double dwell() const;     ///< [steps] median beyond the surface
};

/// The training of a gate for this aim: horizons of 2, 4, 8, ... steps up to the median interval
/// between events; three layers whose width is the largest of 16, 32 and 64 with which the network
/// is no more expensive than the guard; states by the logarithm of the time to their event; as many
/// events as the rate of misses demands. It depends on nothing but its arguments.
/// @throws std::invalid_argument if the rate is not in (0, 0.1], or no interval was seen.
[[nodiscard]] GateTraining choose(const GateAim& aim, const GateSurvey& survey);

/// One sentence that says what was seen and chosen.
[[nodiscard]] std::string describe(const GateSurvey& survey, const GateTraining& chosen);

/// States of runs, with the events that followed them.
struct GateSamples {
    std::size_t width = 0;         ///< features of a state
    std::vector<double> features;  ///< row by row
    std::vector<double> event;     ///< [s] to the next event; infinite: beyond all horizons
    std::vector<double> back;      ///< [s] until the guard is back on its armed side, without reset
    std::vector<double> value;     ///< of the guard, on the side on which it is armed
    std::vector<double> weight;    ///< number of states of the runs that the row represents
    std::uint64_t events = 0;      ///< number of events of the runs
    std::uint64_t steps = 0;
    std::vector<ValueRange> box;  ///< box of all states of the runs

    [[nodiscard]] std::size_t size() const noexcept { return event.size(); }
    /// Features of state i.
    [[nodiscard]] std::span<const double> row(std::size_t i) const noexcept
    {
        return {features.data() + i * width, width};
    }
    /// Appends one state.
    void append(std::span<const double> row, double event, double back, double value,
                double weight);
    /// Appends all states of `other`, which must have the same number of features.
    void append(const GateSamples& other);
    /// Widens `box` to contain the features `row`.
    void visit(std::span<const double> row);
};

/// Comparison of a gate with the exact detector on the same runs.
struct GateTrial {
    std::uint64_t events = 0;       ///< of the exact runs
    std::uint64_t misses = 0;       ///< of these, missed, or found at a time off by more than error
    std::uint64_t steps = 0;        ///< of the exact runs
    std::uint64_t exact_calls = 0;  ///< guard calls if every step is checked
    std::uint64_t gated_calls = 0;  ///< guard calls with the gate
    std::uint64_t network_calls = 0;  ///< of the gate
    std::uint64_t outside = 0;        ///< states outside the domain of the gate
    std::uint64_t repeated = 0;       ///< steps taken again
    double seconds = 0;               ///< [s] processor time of both
    std::vector<Rival> rivals{};  ///< other ways of detection, on some of these runs; the gate last

    [[nodiscard]] double miss_bound() const;  ///< at 95 % confidence
    /// Guard calls if every step is checked, divided by guard calls with the gate.
    [[nodiscard]] double gain() const noexcept
    {
        return static_cast<double>(exact_calls) /
               static_cast<double>(gated_calls > 0 ? gated_calls : 1);
    }
};

/// Choice of thresholds by their misses on runs that trained nothing.
struct GateCalibration {
    std::uint64_t events = 0;
    std::uint64_t misses = 0;
    double checks_per_event = 0;  ///< of the guard, without those inside the step of an event
    double shift = 0;             ///< by which all thresholds were lowered

    [[nodiscard]] double miss_bound() const;  ///< at 95 % confidence
};

/// Result and cost of a training of a gate.
struct GateReport {
    TrainingOutcome outcome = TrainingOutcome::finished;
    std::size_t iterations = 0;
    double seconds = 0;               ///< [s] of training and sampling, without the trial
    std::size_t training_states = 0;  ///< training states, including those added after rounds
    std::size_t fatal_states = 0;     ///< of these, fatal
    std::uint64_t events = 0;         ///< in all runs before the trial
    double looks = 1;                 ///< exact checks per step, as estimated on the validation set
    std::uint64_t guard_calls = 0;    ///< before the trial
    double guard_seconds = 0;         ///< [s] of a call of the guard, as measured; 0: not known
    double price = 0;                 ///< [s] of a call where the gate is to be used; 0: the same
    GateCalibration calibration;      ///< without events: thresholds were not calibrated
    GateTrial trial;
    /// Reason why the last checkpoint could not be written; empty if it was, or there is none.
    std::string checkpoint_trouble{};

    /// Says whether the network is the fastest of the ways that lose no more events, from which
    /// price of a guard call on it is, and after how many steps it has saved the guard calls of its
    /// training.
    [[nodiscard]] std::string describe() const;

    /// Adds the calls of a survey, and the prices of a call.
    void add(const GateSurvey& survey, const GateAim& aim);
};

/// A trained gate and its report.
struct TrainedGate {
    Model model;
    GateReport report;
};

/// Result of a work that was stopped before anything was trained: no model.
[[nodiscard]] TrainedGate interrupted_gate();

/// Returns the report as the text of a JSON object.
[[nodiscard]] std::string to_json(const GateReport& report);

/// The training of one gate on given states. These, the options and the seed determine the result,
/// bit for bit on one machine.
class GateTrainer {
public:
    /// @throws std::invalid_argument if an option is outside its range, or if the samples contain
    /// only events, or no event (for a level gate: no guard near its surface).
    /// @throws std::runtime_error if the checkpoint cannot be read, or is of another training.
    GateTrainer(const GateTraining& options, GateSamples training, GateSamples validation);
    ~GateTrainer();
    GateTrainer(const GateTrainer&) = delete;
    GateTrainer& operator=(const GateTrainer&) = delete;

    /// Runs one round. Returns false if the callback stopped it. A round that the checkpoint
    /// contains as finished is not run again.
    /// @throws std::runtime_error if the checkpoint cannot be written.
    [[nodiscard]] bool run(std::size_t round, const ProgressCallback& progress);

    /// Adds states for the rounds to come and for the thresholds.
    void add(const GateSamples& samples);

    /// Model with the best weights so far. The caller sets system, parameters and step range.
    [[nodiscard]] Model model() const;

    /// Report of the training so far.
    [[nodiscard]] GateReport report() const;

private:
    class State;
    std::unique_ptr<State> state_;
};

/// Validates the options. @throws std::invalid_argument naming the option.
void check(const GateTraining& training, bool fixed_step);

// The two classifiers of the bouncing ball, from surface samples to model.
//
// The exact map of free fall over a step is a parabola, and a step of h from
// height u and velocity v ends on or below the floor iff
//
//     u + v h - g h^2 / 2 <= 0,   that is   u / (g h^2) + v / (g h) <= 1/2.
//
// Margins are that difference over the sum of its terms' magnitudes.

/// Kinds of classifiers of the ball.
enum class BallModel {
    fixed_step,  ///< features (u, v), one step and one gravity, as in the source paper
    any_step,    ///< recipe `ballistic`: every gravity, restitution, height and step
};

/// Name of a kind: "fixed-step" or "any-step".
[[nodiscard]] std::string_view name(BallModel kind) noexcept;

/// The kind of this name. @throws std::invalid_argument naming what was given and what is known.
[[nodiscard]] BallModel ball_model_named(std::string_view name);

/// Data and options of a training of a classifier of the ball.
struct BallTraining {
    // Of a fixed-step model only.
    double gravity = 9.81;  ///< [m/s^2], positive
    double step = 0.01;     ///< [s], positive
    double height = 10;     ///< [m], positive; the highest drop the model is for

    std::size_t states = 200'000;       ///< sampled for training and testing, half of them events
    std::size_t fresh_events = 40'000;  ///< for the report, with as many clear states
    double margin = 0.1;                ///< clear states nearer to the boundary are not trained on
    std::uint64_t seed = 1;             ///< of sampling, splitting and training
    TrainingOptions training{};         ///< its seed is replaced by the one above
};

/// Default options, from which the models that come with the library were made.
///
/// A fixed-step model has five hidden layers like the paper's; their width, which the paper does
/// not state, is 16 here. An any-step model has one hidden layer of 16, trained on 400 000 states:
/// in its logarithmic features the boundary is two straight lines and a bend. A layer of 8 suffices
/// for most seeds, but for some it cuts off a corner of the boundary and misses events.
[[nodiscard]] BallTraining ball_training(BallModel kind);

/// States of a ball, sampled backward in time from the floor (and, for a tenth of them, forward),
/// the closest to the boundary at 1e-6 h from it.
///
/// - fixed step: speeds at the floor half uniform, half log-uniform, such that the
///   box of the model is filled: 15 % above `height` and 10 % above the speed of
///   a fall from it, and below the floor what two steps at that speed reach.
/// - any step: gravity in [0.1, 100] m/s^2, step in [1e-6, 100] s and speed at the
///   floor in [1e-3, 2e14] g h, all log-uniform, half of the speeds in
///   [0.03, 30] g h, where the boundary bends; |u| <= 1e14 g h^2, |v| <= 1e14 g h.
///
/// @param keep_band  whether to keep clear states whose margin is too small for training
[[nodiscard]] SurfaceSample sample_ball(BallModel kind, const BallTraining& training,
                                        std::size_t events, std::size_t clear, std::uint64_t seed,
                                        bool keep_band);

/// Samples, trains and assesses on fresh states. The model is complete and can be stored;
/// `Trained::misses_none` says whether it should be.
/// @throws as `train`, and std::invalid_argument if a parameter is outside its range.
[[nodiscard]] Trained train_bouncing_ball(BallModel kind, const BallTraining& training,
                                          const ProgressCallback& progress = {});

}  // namespace ricochet::learn
