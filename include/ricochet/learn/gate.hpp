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
// `learn/train_gate.hpp` samples the runs and trains a gate in one call.
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
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/detail/adam.hpp"
#include "ricochet/detail/gate.hpp"
#include "ricochet/detail/random.hpp"
#include "ricochet/hybrid/system.hpp"
#include "ricochet/learn/classifier.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::learn {

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
    std::vector<Interval> box;  ///< box of all states of the runs

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

/// Result and cost of a training of a gate.
struct GateReport {
    TrainingOutcome outcome = TrainingOutcome::finished;
    std::size_t iterations = 0;
    double seconds = 0;               ///< [s] of training and sampling, without the trial
    std::size_t training_states = 0;  ///< training states, including those added after rounds
    std::size_t fatal_states = 0;     ///< of these, fatal
    std::uint64_t events = 0;         ///< in all runs before the trial
    double looks = 1;                 ///< exact checks per step, as estimated on the validation set
    GateTrial trial;
    /// Reason why the last checkpoint could not be written; empty if it was, or there is none.
    std::string checkpoint_trouble{};
};

/// A trained gate and its report.
struct TrainedGate {
    Model model;
    GateReport report;
};

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

}  // namespace ricochet::learn
