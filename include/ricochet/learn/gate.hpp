// Gates for a user's system: training, thresholds, and what they miss.
//
// A *horizon* gate is for guards of which nothing is known but the value or the sign. States
// come from runs; each is labelled with the time to the next event. Since a gated run examines
// the guard at the end of every horizon, it finds an event that was cleared, unless the guard,
// followed without its reset, has come back by then. Such states are *fatal*. The threshold of
// each horizon lies below the logit of every fatal state that was seen, and below what makes
// ways back more expensive than the checks that they save.
//
// A *level* gate is for a guard with a bound and a value: a regression from below of the guard,
// with a threshold for each level below the logit of every state whose guard is not above it.
//
// `learn/train_gate.hpp` makes the samples, and puts all together.
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

/// Deals out starts. One that the system refuses (behind a unilateral guard) is drawn again.
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

/// Horizons [s] of so many steps.
[[nodiscard]] inline std::vector<double> horizons(double step,
                                                  std::initializer_list<std::size_t> steps)
{
    std::vector<double> out;
    for (const std::size_t n : steps) out.push_back(static_cast<double>(n) * step);
    return out;
}

/// Gates of horizons [s], or of levels of the guard.
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
    double run_length = 10;  ///< [s] of a run; the next one starts somewhere else

    std::size_t events = 3000;             ///< of the training runs
    std::size_t states = 200'000;          ///< kept for training, at most
    std::size_t validation_events = 1000;  ///< choose weights and thresholds
    std::size_t fresh_events = 30'000;     ///< for the miss rate; 0: it is not measured
    std::size_t most_steps = 100'000'000;  ///< of each of these sets of runs

    std::vector<std::size_t> hidden{16, 16};
    std::size_t iterations = 4000;  ///< of a round
    std::size_t rounds = 2;         ///< after all but the last, hard states are added
    std::size_t hard_events = 0;    ///< of the runs in which they are sought; 0: as `events`
    std::size_t neighbours = 2;     ///< states sampled near each hard one
    std::size_t batch = 256;
    double rate = 3e-3;  ///< learning rate at the start of a round
    double final_rate = 3e-5;
    std::size_t evaluate_every = 250;
    std::size_t patience = 8;    ///< evaluations of a round without gain before it ends
    double fatal_weight = 4;     ///< of a fatal state in the loss
    double quantile = 0.98;      ///< of a level gate: the share of states that it stays below
    double logit_margin = 0.25;  ///< of the threshold below the lowest fatal logit
    std::uint64_t seed = 1;

    std::filesystem::path checkpoint{};  ///< written at every evaluation; empty: none
    bool resume = false;                 ///< continue from `checkpoint`, to the same bits
    /// Asked before every iteration; true stops, as the callback does. Null: it is not asked.
    const std::atomic<bool>* cancelled = nullptr;
};

/// States of runs, and what became of them.
struct GateSamples {
    std::size_t width = 0;         ///< features of a state
    std::vector<double> features;  ///< row by row
    std::vector<double> event;     ///< [s] to the next event; infinite: beyond all horizons
    std::vector<double> back;      ///< [s] until the guard is seen on its side again, without reset
    std::vector<double> value;     ///< of the guard, on the side on which it is armed
    std::vector<double> weight;    ///< how many states of the runs it stands for; 0: none
    std::uint64_t events = 0;      ///< of the runs
    std::uint64_t steps = 0;
    std::vector<Interval> box;  ///< that the runs stayed in

    [[nodiscard]] std::size_t size() const noexcept { return event.size(); }
    /// Features of state i.
    [[nodiscard]] std::span<const double> row(std::size_t i) const noexcept
    {
        return {features.data() + i * width, width};
    }
    /// Appends one state.
    void append(std::span<const double> row, double event, double back, double value,
                double weight);
    /// All states of `other`, which are of as many features.
    void append(const GateSamples& other);
    /// Widens the box.
    void visit(std::span<const double> row);
};

/// A gate in runs, side by side with the exact detector.
struct GateTrial {
    std::uint64_t events = 0;       ///< of the exact runs
    std::uint64_t misses = 0;       ///< of these, not found, or not at the same time but for errors
    std::uint64_t steps = 0;        ///< of the exact runs
    std::uint64_t exact_calls = 0;  ///< of the guard, with a check of every step
    std::uint64_t gated_calls = 0;  ///< of the guard, with the gate
    std::uint64_t network_calls = 0;  ///< of the gate
    std::uint64_t outside = 0;        ///< of its box
    std::uint64_t repeated = 0;       ///< steps taken again
    double seconds = 0;               ///< of processor time, both
    std::vector<Rival> rivals{};  ///< other ways of looking, on some of these runs; the gate last

    [[nodiscard]] double miss_bound() const;  ///< at 95 % confidence
    /// Guard calls saved: of every step over gated.
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
    double seconds = 0;               ///< of training and sampling, without the trial
    std::size_t training_states = 0;  ///< with those of the rounds
    std::size_t fatal_states = 0;     ///< of these
    std::uint64_t events = 0;         ///< in all runs before the trial
    double looks = 1;                 ///< exact looks per step, as expected from the validation set
    GateTrial trial;
    /// Why the last checkpoint could not be written; empty: it was, or there is none.
    std::string checkpoint_trouble{};
};

/// A trained gate and its report.
struct TrainedGate {
    Model model;
    GateReport report;
};

/// The report as a JSON object.
[[nodiscard]] std::string to_json(const GateReport& report);

/// The training of one gate on states that are handed to it.
///
/// Everything follows from the seed, to the bit on one machine.
class GateTrainer {
public:
    /// @throws std::invalid_argument if an option is outside its range, or the samples hold no
    /// event (or guard near its surface), or nothing else.
    /// @throws std::runtime_error if the checkpoint cannot be read, or is of another training.
    GateTrainer(const GateTraining& options, GateSamples training, GateSamples validation);
    ~GateTrainer();
    GateTrainer(const GateTrainer&) = delete;
    GateTrainer& operator=(const GateTrainer&) = delete;

    /// One round. False: it was stopped by the callback. A round that the checkpoint has behind it
    /// is not run again.
    /// @throws std::runtime_error if the checkpoint cannot be written.
    [[nodiscard]] bool run(std::size_t round, const ProgressCallback& progress);

    /// More states, for the rounds to come and for the thresholds.
    void add(const GateSamples& samples);

    /// The best so far. System, parameters and step range are left to the caller.
    [[nodiscard]] Model model() const;

    /// Report of the training so far.
    [[nodiscard]] GateReport report() const;

private:
    class State;
    std::unique_ptr<State> state_;
};

/// @throws std::invalid_argument naming the option.
void check(const GateTraining& training, bool fixed_step);

}  // namespace ricochet::learn
