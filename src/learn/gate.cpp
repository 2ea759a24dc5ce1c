#include "ricochet/learn/classifier.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/require.hpp"
#include "checkpoint.hpp"
#include "checkpoint_file.hpp"
#include "limits.hpp"
#include "ricochet/base/random.hpp"
#include "ricochet/learn/assessment.hpp"
#include "trainable_mlp.hpp"

namespace ricochet::learn {

namespace {

constexpr ricochet::detail::Refuse refuse_gate{"train_gate"};

/// The network's target for a state: the higher, the nearer the event.
double target_of(double value, double unit)
{
    return -std::asinh(value / unit);
}

}  // namespace

/// States as the network sees them, and the weights in training.
class GateTrainer::State {
public:
    State(const GateTraining& options, GateSamples training, GateSamples validation)
        : options_(options),
          random_(options.seed),
          training_(std::move(training)),
          validation_(std::move(validation)),
          network_((check_samples(), training_.width), options.hidden, Activation::relu, random_,
                   horizon() ? options.levels.size() : 1),
          gradient_(network_.parameters().size())
    {
        normalise();
        prepare(validation_, validation_states_);
        prepare(training_, training_states_);
        sort_out();
        fingerprint_ = fingerprint();
        if (options_.resume) load();
    }

    bool run(std::size_t round, const ProgressCallback& progress)
    {
        if (resumed_ && round < resumed_->round) {
            best_ = resumed_->best_parameters[round];
            thresholds_ = resumed_->best_thresholds[round];
            keep_round(round);
            return true;
        }
        Adam adam(network_.parameters().size(), {});
        best_cost_ = infinity;  // with more states the best thresholds may be too high
        std::size_t since_best = 0;
        std::size_t i = 0;
        const bool goes_on = resumed_ && round == resumed_->round;
        if (goes_on) {
            i = static_cast<std::size_t>(resumed_->iteration);
            since_best = static_cast<std::size_t>(resumed_->since_best);
            restore(adam);
        }
        const auto start = std::chrono::steady_clock::now();
        const double before = seconds_;
        for (bool judged = goes_on;; ++i, judged = false) {
            const bool last = i == options_.iterations;
            if (!judged && (last || (i > 0 && i % options_.evaluate_every == 0))) {
                const double loss = evaluate(since_best);
                const std::chrono::duration<double> spent =
                    std::chrono::steady_clock::now() - start;
                seconds_ = before + spent.count();
                if (!std::isfinite(loss)) {
                    outcome_ = TrainingOutcome::diverged;
                    return false;
                }
                keep_round(round);
                keep_([&] { save(round, i, since_best, adam); });
                if (progress && !progress({.iteration = round * options_.iterations + i,
                                           .total = options_.rounds * options_.iterations,
                                           .loss = loss,
                                           .misses = 0,
                                           .seconds = seconds_})) {
                    outcome_ = TrainingOutcome::stopped;
                    return false;
                }
            }
            if (last || since_best >= options_.patience) return true;
            if (options_.cancelled && *options_.cancelled) {
                // Before the first evaluation nothing is worth keeping: no state is cleared.
                if (!best_.empty()) keep_([&] { save(round, i, since_best, adam); });
                outcome_ = TrainingOutcome::stopped;
                return false;
            }
            const double done = static_cast<double>(i) / static_cast<double>(options_.iterations);
            const double rate = options_.final_rate + (options_.rate - options_.final_rate) * 0.5 *
                                                          (1 + std::cos(std::numbers::pi * done));
            step(adam, rate);
        }
    }

    /// The best of this round so far, from which the next one draws its hard states.
    void keep_round(std::size_t round)
    {
        best_parameters_.resize(round + 1);
        best_thresholds_.resize(round + 1);
        best_parameters_[round] = best_;
        best_thresholds_[round] = thresholds_;
    }

    void add(const GateSamples& samples)
    {
        for (std::size_t i = 0; i < samples.box.size(); ++i) {
            training_.box[i].lower = std::min(training_.box[i].lower, samples.box[i].lower);
            training_.box[i].upper = std::max(training_.box[i].upper, samples.box[i].upper);
        }
        training_.append(samples);
        prepare(samples, training_states_);
        sort_out();
        if (!best_.empty()) judge_again();
    }

    [[nodiscard]] Model model() const
    {
        Model model;
        model.kind = name(options_.kind);
        model.recipe = to_string(options_.recipe);
        model.offset = offset_;
        model.scale = scale_;
        model.domain = box();
        model.activation = Activation::relu;
        model.precision = Precision::f32;
        model.seed = options_.seed;
        TrainableMlp copy = network_;
        if (!best_.empty()) std::copy(best_.begin(), best_.end(), copy.parameters().begin());
        for (double& p : copy.parameters()) p = static_cast<float>(p);
        model.layers = copy.layers();
        for (std::size_t k = 0; k < options_.levels.size(); ++k) {
            const double threshold = k < thresholds_.size() ? thresholds_[k] : -infinity;
            // Stored thresholds are finite: no logit of a sound network is below this one.
            model.levels.push_back(
                {.value = options_.levels[k], .threshold = std::max(threshold, -never)});
        }
        model.threshold = model.levels.front().threshold;
        return model;
    }

    [[nodiscard]] GateReport report() const
    {
        GateReport report;
        report.outcome = outcome_;
        report.checkpoint_trouble = keep_.trouble();
        report.iterations = iterations_;
        report.seconds = seconds_;
        report.training_states = training_.size();
        report.fatal_states = horizon() ? fatal_.size() : near_.size();
        report.events = training_.events + validation_.events;
        report.looks = best_cost_;
        return report;
    }

private:
    static constexpr double never = 1e30;

    /// Hash of everything that determines the training.
    [[nodiscard]] std::uint64_t fingerprint() const
    {
        std::uint64_t hash = 0xcbf29ce484222325U;  // FNV-1a over 64-bit words
        const auto add = [&](double value) {
            hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 0x100000001b3U;
        };
        const auto count = [&](std::size_t n) { add(static_cast<double>(n)); };
        const GateTraining& o = options_;
        count(horizon() ? 1 : 2);
        for (const char c : to_string(o.recipe)) count(static_cast<unsigned char>(c));
        for (const double level : o.levels) add(level);
        for (const double value : {o.step_min, o.step_max, o.run_length, o.rate, o.final_rate,
                                   o.fatal_weight, o.quantile, o.logit_margin}) {
            add(value);
        }
        for (const std::size_t n :
             {o.events, o.states, o.validation_events, o.iterations, o.rounds, o.hard_events,
              o.neighbours, o.batch, o.evaluate_every, o.patience}) {
            count(n);
        }
        for (const std::size_t width : o.hidden) count(width);
        add(std::bit_cast<double>(o.seed));
        for (const GateSamples* set : {&training_, &validation_}) {
            for (const double value : set->features) add(value);
            for (const double value : set->event) add(value);
        }
        return hash;
    }

    void load()
    {
        GateCheckpoint found = load_gate_checkpoint(options_.checkpoint);
        const bool fits = found.fingerprint == fingerprint_ && found.round < options_.rounds &&
                          found.best_parameters.size() == found.round + 1 &&
                          found.best_thresholds.size() == found.round + 1 &&
                          found.parameters.size() == network_.parameters().size() &&
                          found.iteration <= options_.iterations &&
                          std::all_of(found.best_parameters.begin(), found.best_parameters.end(),
                                      [&](const auto& p) {
                                          return p.empty() || p.size() == found.parameters.size();
                                      });
        if (!fits) {
            throw std::runtime_error(
                fmt::format("checkpoint '{}' is of a gate with other data or options",
                            options_.checkpoint.string()));
        }
        resumed_ = std::move(found);
    }

    void save(std::size_t round, std::size_t iteration, std::size_t since_best,
              const Adam& adam) const
    {
        GateCheckpoint now{
            .fingerprint = fingerprint_,
            .round = round,
            .iteration = iteration,
            .iterations = iterations_,
            .since_best = since_best,
            .seconds = seconds_,
            .random = random_.state(),
            .parameters = {network_.parameters().begin(), network_.parameters().end()},
            .adam = adam.state(),
            .best_cost = best_cost_,
            .best_parameters = best_parameters_,
            .best_thresholds = best_thresholds_};
        save_checkpoint(now, options_.checkpoint);
    }

    /// Restores the round in which the checkpoint was written.
    void restore(Adam& adam)
    {
        const GateCheckpoint& from = *resumed_;
        std::copy(from.parameters.begin(), from.parameters.end(), network_.parameters().begin());
        adam.restore(from.adam);
        random_ = Random(from.random);
        best_ = from.best_parameters.back();
        thresholds_ = from.best_thresholds.back();
        keep_round(static_cast<std::size_t>(from.round));
        best_cost_ = from.best_cost;
        iterations_ = static_cast<std::size_t>(from.iterations);
        seconds_ = from.seconds;
    }

    [[nodiscard]] bool horizon() const noexcept { return options_.kind == GateKind::horizon; }
    [[nodiscard]] double largest() const noexcept { return options_.levels.back(); }
    [[nodiscard]] std::size_t outputs() const noexcept { return network_.outputs(); }

    void check_samples() const
    {
        for (const GateSamples* set : {&training_, &validation_}) {
            std::size_t near = 0;
            for (std::size_t i = 0; i < set->size(); ++i) {
                near += (horizon() ? set->event[i] : set->value[i]) <= largest() ? 1 : 0;
            }
            const std::string_view what =
                horizon() ? "with an event within the longest horizon" : "below the highest level";
            if (near == 0) {
                refuse_gate(
                    fmt::format("of {} states of runs there is none {}; sample elsewhere, or "
                                "longer",
                                set->size(), what));
            }
            if (near == set->size()) {
                refuse_gate(
                    fmt::format("all {} states of runs are {}: nothing is ever clear; take "
                                "shorter horizons or lower levels",
                                set->size(), what));
            }
        }
    }

    /// Mean and deviation of the states of the runs.
    void normalise()
    {
        const std::size_t width = training_.width;
        const auto n = static_cast<double>(training_.size());
        offset_.assign(width, 0);
        scale_.assign(width, 0);
        for (std::size_t i = 0; i < training_.features.size(); ++i) {
            offset_[i % width] += training_.features[i] / n;
        }
        for (std::size_t i = 0; i < training_.features.size(); ++i) {
            const double away = training_.features[i] - offset_[i % width];
            scale_[i % width] += away * away / n;
        }
        for (double& s : scale_) s = s > 1e-24 ? 1 / std::sqrt(s) : 1;
    }

    void prepare(const GateSamples& samples, std::vector<double>& states) const
    {
        for (std::size_t i = 0; i < samples.features.size(); ++i) {
            const std::size_t c = i % samples.width;
            states.push_back(static_cast<float>((samples.features[i] - offset_[c]) * scale_[c]));
        }
    }

    /// Sorts states into the classes from which batches are made.
    void sort_out()
    {
        if (options_.logarithmic) return sort_by_octave();
        fatal_.clear();
        near_.clear();
        clear_.clear();
        for (std::size_t i = 0; i < training_.size(); ++i) {
            if (horizon() && training_.back[i] <= largest()) fatal_.push_back(i);
            const double distance = horizon() ? training_.event[i] : training_.value[i];
            (distance <= largest() ? near_ : clear_).push_back(i);
        }
        critical_states_.clear();
        for (const std::size_t i : critical()) {
            const auto row =
                training_states_.begin() + static_cast<std::ptrdiff_t>(i * training_.width);
            critical_states_.insert(critical_states_.end(), row,
                                    row + static_cast<std::ptrdiff_t>(training_.width));
        }
    }

    /// States by the shortest horizon that contains their event, or none, and those of weight 0.
    void sort_by_octave()
    {
        octaves_.assign(options_.levels.size() + 2, {});
        for (std::size_t i = 0; i < training_.size(); ++i) {
            const auto k = std::lower_bound(options_.levels.begin(), options_.levels.end(),
                                            training_.event[i]) -
                           options_.levels.begin();
            const std::size_t pool =
                training_.weight[i] == 0 ? options_.levels.size() + 1 : static_cast<std::size_t>(k);
            octaves_[pool].push_back(i);
        }
    }

    [[nodiscard]] std::size_t draw_by_octave()
    {
        const std::size_t horizons = options_.levels.size();
        const double u = random_.uniform();
        std::size_t pool = random_.below(horizons);
        if (u < 0.4) pool = horizons;
        if (u >= 0.2 && u < 0.8 && !octaves_[horizons + 1].empty()) pool = horizons + 1;
        while (octaves_[pool].empty()) pool = (pool + 1) % octaves_.size();
        return octaves_[pool][random_.below(octaves_[pool].size())];
    }

    /// The training states that a threshold must not clear, at one level or another.
    [[nodiscard]] const std::vector<std::size_t>& critical() const noexcept
    {
        return horizon() ? fatal_ : near_;
    }

    [[nodiscard]] std::size_t draw()
    {
        const double u = random_.uniform();
        const std::vector<std::size_t>& pool = u < 0.2 && !fatal_.empty() ? fatal_
                                               : u < 0.6                  ? near_
                                                                          : clear_;
        return pool[random_.below(pool.size())];
    }

    void step(Adam& adam, double rate)
    {
        const std::size_t width = network_.inputs();
        batch_.resize(options_.batch * width);
        drawn_.resize(options_.batch);
        for (std::size_t s = 0; s < options_.batch; ++s) {
            drawn_[s] = options_.logarithmic ? draw_by_octave() : draw();
            std::copy_n(training_states_.begin() + static_cast<std::ptrdiff_t>(drawn_[s] * width),
                        width, batch_.begin() + static_cast<std::ptrdiff_t>(s * width));
        }
        network_.loss_and_gradient(
            batch_, options_.batch,
            [this](std::size_t s, const double* logits, double* slopes) {
                return loss(training_, drawn_[s], logits, slopes);
            },
            gradient_);
        adam.step(network_.parameters(), gradient_, rate);
        ++iterations_;
    }

    double loss(const GateSamples& set, std::size_t i, const double* logits, double* slopes) const
    {
        if (horizon()) {
            double sum = 0;
            for (std::size_t k = 0; k < options_.levels.size(); ++k) {
                const bool event = set.event[i] <= options_.levels[k];
                const bool fatal = set.back[i] <= options_.levels[k];
                const double weight = fatal ? options_.fatal_weight : 1;
                sum += weight * cross_entropy(logits[k], event);
                slopes[k] = weight * (1 / (1 + std::exp(-logits[k])) - (event ? 1 : 0));
            }
            return sum;
        }
        // Pinball loss: the logit should be above the target for `quantile` of the states.
        const double above = target_of(set.value[i], options_.levels.front()) - logits[0];
        const double q = options_.quantile;
        slopes[0] = above > 0 ? -q : 1 - q;
        return above > 0 ? q * above : (q - 1) * above;
    }

    /// Assesses the present weights, as they would be stored, and keeps them if they are the best.
    double evaluate(std::size_t& since_best)
    {
        const std::vector<double> exact(network_.parameters().begin(), network_.parameters().end());
        for (double& p : network_.parameters()) p = static_cast<float>(p);
        double loss_sum = 0;
        std::vector<double> slopes(outputs());
        logits_.resize(validation_.size() * outputs());
        network_.evaluate(validation_states_, logits_);
        for (std::size_t i = 0; i < validation_.size(); ++i) {
            loss_sum += loss(validation_, i, logits_.data() + i * outputs(), slopes.data());
        }
        const double mean = loss_sum / static_cast<double>(validation_.size());
        if (std::isfinite(mean)) {
            const Choice choice = choose();
            ++since_best;
            if (choice.cost < best_cost_) {
                best_.assign(network_.parameters().begin(), network_.parameters().end());
                thresholds_ = choice.thresholds;
                best_cost_ = choice.cost;
                since_best = 0;
            }
        }
        std::copy(exact.begin(), exact.end(), network_.parameters().begin());
        return mean;
    }

    /// Computes the thresholds of the best weights again, after more states were added.
    void judge_again()
    {
        const std::vector<double> exact(network_.parameters().begin(), network_.parameters().end());
        std::copy(best_.begin(), best_.end(), network_.parameters().begin());
        logits_.resize(validation_.size() * outputs());
        network_.evaluate(validation_states_, logits_);
        const Choice choice = choose();
        thresholds_ = choice.thresholds;
        best_cost_ = choice.cost;
        std::copy(exact.begin(), exact.end(), network_.parameters().begin());
    }

    struct Choice {
        std::vector<double> thresholds;
        double cost = infinity;
    };

    /// The least expensive thresholds that clear no fatal state. The logits of the validation set
    /// are in `logits_`.
    [[nodiscard]] Choice choose()
    {
        if (options_.logarithmic) return choose_by_quantile();
        std::vector<double> lowest(options_.levels.size(), infinity);
        for (std::size_t i = 0; i < validation_.size(); ++i) {
            lower(validation_, i, logits_.data() + i * outputs(), lowest);
        }
        critical_logits_.resize(critical().size() * outputs());
        network_.evaluate(critical_states_, critical_logits_);
        for (std::size_t c = 0; c < critical().size(); ++c) {
            lower(training_, critical()[c], critical_logits_.data() + c * outputs(), lowest);
        }
        for (double& threshold : lowest) threshold -= options_.logit_margin;
        if (!horizon()) return {.thresholds = lowest, .cost = cost(lowest)};
        Choice best;
        for (const double cap : {-6.0, -5.0, -4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0}) {
            Choice choice;
            for (const double threshold : lowest) {
                choice.thresholds.push_back(std::min(threshold, cap));
            }
            choice.cost = cost(choice.thresholds);
            if (choice.cost < best.cost) best = std::move(choice);
        }
        return best;
    }

    /// Logits below which one in a thousand of the fatal states lies; a calibration shifts them.
    [[nodiscard]] Choice choose_by_quantile()
    {
        Choice choice;
        for (std::size_t k = 0; k < options_.levels.size(); ++k) {
            std::vector<double> fatal;
            for (std::size_t i = 0; i < validation_.size(); ++i) {
                if (validation_.back[i] > options_.levels[k]) continue;
                fatal.push_back(logits_[i * outputs() + k]);
            }
            const auto at = fatal.begin() + static_cast<std::ptrdiff_t>(fatal.size() / 1000);
            std::nth_element(fatal.begin(), at, fatal.end());
            choice.thresholds.push_back(at == fatal.end() ? -never : *at);
        }
        choice.cost = cost(choice.thresholds);
        return choice;
    }

    /// Lowers the lowest logit of states that must not be cleared, for each level, by state i.
    void lower(const GateSamples& set, std::size_t i, const double* logits,
               std::vector<double>& lowest) const
    {
        const double until = horizon() ? set.back[i] : set.value[i];
        for (std::size_t k = options_.levels.size(); k-- > 0;) {
            if (!(until <= options_.levels[k])) break;
            lowest[k] = std::min(lowest[k], logits[horizon() ? k : 0]);
        }
    }

    /// Checks per step (or per time in which the guard can change by half the first level).
    [[nodiscard]] double cost(const std::vector<double>& thresholds) const
    {
        double sum = 0;
        double states = 0;
        const double unit = 0.5 * options_.levels.front();
        for (std::size_t i = 0; i < validation_.size(); ++i) {
            double cleared = unit;
            for (std::size_t k = 0; k < thresholds.size(); ++k) {
                if (!(logits_[i * outputs() + (horizon() ? k : 0)] < thresholds[k])) break;
                cleared = options_.levels[k];
            }
            const double steps = cleared / unit;
            double looks = 1 / steps;
            if (horizon() && validation_.event[i] <= cleared) {
                looks *= 1 + std::log2(steps);  // the interval is halved until the event is found
            }
            sum += validation_.weight[i] * looks;
            states += validation_.weight[i];
        }
        return states > 0 ? sum / states : 1;
    }

    [[nodiscard]] std::vector<ValueRange> box() const
    {
        std::vector<ValueRange> box = training_.box;
        for (std::size_t i = 0; i < box.size(); ++i) {
            box[i].lower = std::min(box[i].lower, validation_.box[i].lower);
            box[i].upper = std::max(box[i].upper, validation_.box[i].upper);
        }
        return box;
    }

    GateTraining options_;
    Random random_;
    GateSamples training_;
    GateSamples validation_;
    TrainableMlp network_;
    std::vector<double> gradient_;
    std::vector<double> offset_, scale_;
    std::vector<double> training_states_, validation_states_;
    std::vector<std::size_t> fatal_, near_, clear_;
    std::vector<std::vector<std::size_t>> octaves_;  ///< pools of states, where sampling is so
    std::vector<double> batch_, logits_, critical_states_, critical_logits_;
    std::vector<std::size_t> drawn_;
    std::vector<double> best_, thresholds_;
    double best_cost_ = infinity;
    std::size_t iterations_ = 0;
    double seconds_ = 0;
    TrainingOutcome outcome_ = TrainingOutcome::finished;
    std::uint64_t fingerprint_ = 0;
    std::optional<GateCheckpoint> resumed_;
    Keeper keep_{options_.checkpoint};
    std::vector<std::vector<double>> best_parameters_, best_thresholds_;  ///< of every round
};

GateTrainer::GateTrainer(const GateTraining& options, GateSamples training, GateSamples validation)
    : state_(std::make_unique<State>(options, std::move(training), std::move(validation)))
{
}

GateTrainer::~GateTrainer() = default;

bool GateTrainer::run(std::size_t round, const ProgressCallback& progress)
{
    return state_->run(round, progress);
}

void GateTrainer::add(const GateSamples& samples)
{
    state_->add(samples);
}

Model GateTrainer::model() const
{
    return state_->model();
}

GateReport GateTrainer::report() const
{
    return state_->report();
}

}  // namespace ricochet::learn
