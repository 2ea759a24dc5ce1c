#include "ricochet/learn/classifier.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <tuple>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/require.hpp"
#include "checkpoint.hpp"
#include "checkpoint_file.hpp"
#include "trainable_mlp.hpp"

namespace ricochet::learn {

namespace {

constexpr ricochet::detail::Refuse refuse{"train"};

void require_share(double value, const char* name)
{
    if (!(value >= 0 && value < 1)) {
        refuse(std::string(name) + " must lie in [0, 1), got " + std::to_string(value));
    }
}

void check(const TrainingOptions& options, const DataSet& data)
{
    require_share(options.test_share, "test_share");
    require_share(options.validation_share, "validation_share");
    require_share(options.hard_pool, "hard_pool");
    require_share(options.gap_share, "gap_share");
    require_share(options.cleared_at_least, "cleared_at_least");
    if (!(options.hard_share >= 0 && options.hard_share <= 1)) {
        refuse("hard_share must lie in [0, 1], got " + std::to_string(options.hard_share));
    }
    if (options.batch == 0 || options.evaluate_every == 0 || options.hard_every == 0 ||
        options.checkpoint_every == 0) {
        refuse("batch, evaluate_every, hard_every and checkpoint_every must be positive");
    }
    if (!(options.rate > 0 && options.final_rate > 0)) {
        refuse("learning rates must be positive, got " + std::to_string(options.rate) + " and " +
               std::to_string(options.final_rate));
    }
    if (!(options.logit_margin >= 0)) {
        refuse("logit_margin must not be negative, got " + std::to_string(options.logit_margin));
    }
    if (options.resume && options.checkpoint.empty()) refuse("no checkpoint to resume from");
    for (const auto* values : {&options.offset, &options.scale}) {
        if (!values->empty() && values->size() != data.width()) {
            refuse("expected " + std::to_string(data.width()) + " offsets and scales, found " +
                   std::to_string(values->size()));
        }
    }
    for (const double scale : options.scale) {
        if (!(std::isfinite(scale) && scale != 0)) refuse("a scale is zero or not finite");
    }
}

/// A data set as the network sees it: features offset, scaled and, as for a
/// model in single precision, rounded to float.
struct Prepared {
    std::vector<double> states;
    std::vector<std::uint8_t> labels;
    std::vector<std::size_t> events;
    std::vector<std::size_t> clear;
};

Prepared prepare(const DataSet& data, const std::vector<double>& offset,
                 const std::vector<double>& scale)
{
    Prepared prepared;
    prepared.labels = data.labels;
    prepared.states.reserve(data.features.size());
    for (std::size_t i = 0; i < data.size(); ++i) {
        const auto row = data.row(i);
        for (std::size_t c = 0; c < row.size(); ++c) {
            prepared.states.push_back(static_cast<float>((row[c] - offset[c]) * scale[c]));
        }
        (data.labels[i] != 0 ? prepared.events : prepared.clear).push_back(i);
    }
    return prepared;
}

std::vector<double> means(const DataSet& data)
{
    std::vector<double> mean(data.width(), 0.0);
    for (std::size_t i = 0; i < data.features.size(); ++i) {
        mean[i % data.width()] += data.features[i] / static_cast<double>(data.size());
    }
    return mean;
}

std::vector<double> inverse_deviations(const DataSet& data, const std::vector<double>& mean)
{
    std::vector<double> scale(data.width(), 0.0);
    for (std::size_t i = 0; i < data.features.size(); ++i) {
        const double away = data.features[i] - mean[i % data.width()];
        scale[i % data.width()] += away * away / static_cast<double>(data.size());
    }
    for (double& s : scale) s = s > 0 ? 1 / std::sqrt(s) : 1;
    return scale;
}

std::vector<ValueRange> ranges(const DataSet& data)
{
    constexpr double inf = std::numeric_limits<double>::infinity();
    std::vector<ValueRange> domain(data.width(), {.lower = inf, .upper = -inf});
    for (std::size_t i = 0; i < data.features.size(); ++i) {
        ValueRange& range = domain[i % data.width()];
        range.lower = std::min(range.lower, data.features[i]);
        range.upper = std::max(range.upper, data.features[i]);
    }
    return domain;
}

double choose_threshold(const Prepared& set, const std::vector<double>& logits,
                        const TrainingOptions& options)
{
    double lowest = std::numeric_limits<double>::infinity();
    for (const std::size_t i : set.events) lowest = std::min(lowest, logits[i]);
    std::vector<double> clear;
    clear.reserve(set.clear.size());
    for (const std::size_t i : set.clear) clear.push_back(logits[i]);
    const double gap = lowest - *std::max_element(clear.begin(), clear.end());
    const double threshold = lowest - std::max(options.logit_margin, options.gap_share * gap);

    const auto wanted = static_cast<std::size_t>(
        std::ceil(options.cleared_at_least * static_cast<double>(clear.size())));
    if (wanted == 0) return threshold;
    const auto last_cleared = clear.begin() + static_cast<std::ptrdiff_t>(wanted - 1);
    std::nth_element(clear.begin(), last_cleared, clear.end());
    const double above = std::nextafter(*last_cleared, std::numeric_limits<double>::infinity());
    return std::max(threshold, above);
}

Score score(const Prepared& set, const std::vector<double>& logits, double threshold)
{
    Score result;
    for (const std::size_t i : set.events) {
        result.misses += logits[i] >= threshold ? 0 : 1;
        result.loss += cross_entropy(logits[i], true);
    }
    for (const std::size_t i : set.clear) {
        result.false_alarms += logits[i] < threshold ? 0 : 1;
        result.loss += cross_entropy(logits[i], false);
    }
    result.loss /= static_cast<double>(logits.size());
    return result;
}

bool better(const Score& a, const Score& b)
{
    return std::tie(a.misses, a.false_alarms, a.loss) < std::tie(b.misses, b.false_alarms, b.loss);
}

/// A hash of everything that determines the weights: a checkpoint with another one is
/// refused.
class Fingerprint {
public:
    void add(std::uint64_t value)
    {
        for (unsigned shift = 0; shift < 64; shift += 8) {
            hash_ = (hash_ ^ ((value >> shift) & 0xffU)) * 0x100000001b3U;  // FNV-1a
        }
    }
    void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
    template <class Number>
    void add(const std::vector<Number>& values)
    {
        add(std::uint64_t{values.size()});
        for (const Number value : values) add(value);
    }
    [[nodiscard]] std::uint64_t value() const { return hash_; }

private:
    std::uint64_t hash_ = 0xcbf29ce484222325U;
};

std::uint64_t fingerprint(const DataSet& data, const TrainingOptions& o)
{
    Fingerprint print;
    print.add(data.features);
    for (const std::uint8_t label : data.labels) print.add(std::uint64_t{label});
    print.add(std::vector<std::uint64_t>(o.hidden.begin(), o.hidden.end()));
    print.add(static_cast<std::uint64_t>(o.activation));
    print.add(o.offset);
    print.add(o.scale);
    for (const std::size_t count : {o.iterations, o.batch, o.hard_every, o.evaluate_every}) {
        print.add(std::uint64_t{count});
    }
    for (const double number : {o.rate, o.final_rate, o.adam.beta1, o.adam.beta2, o.adam.epsilon,
                                o.hard_share, o.hard_pool, o.test_share, o.validation_share,
                                o.logit_margin, o.gap_share, o.cleared_at_least}) {
        print.add(number);
    }
    print.add(o.seed);
    return print.value();
}

/// The state of one training, and its steps.
class Trainer {
public:
    Trainer(const DataSet& data, const TrainingOptions& options)
        : options_(options),
          random_(options.seed),
          fingerprint_(fingerprint(data, options)),
          sets_(divide(data, options)),
          offset_(options.offset.empty() ? means(sets_.training) : options.offset),
          scale_(options.scale.empty() ? inverse_deviations(sets_.training, means(sets_.training))
                                       : options.scale),
          training_(prepare(sets_.training, offset_, scale_)),
          validation_(prepare(sets_.validation, offset_, scale_)),
          network_(data.width(), options.hidden, options.activation, random_),
          adam_(network_.parameters().size(), options.adam),
          gradient_(network_.parameters().size())
    {
        for (const Prepared* set : {&training_, &validation_}) {
            if (set->events.empty() || set->clear.empty()) {
                refuse("the training and the validation set each need events and clear states");
            }
        }
        if (options.resume) resume();
    }

    Trained run(const ProgressCallback& progress)
    {
        const auto start = std::chrono::steady_clock::now();
        const double before = seconds_;
        TrainingOutcome outcome = TrainingOutcome::finished;
        while (true) {
            const bool last = iteration_ == options_.iterations;
            if (last || iteration_ % options_.evaluate_every == 0) {
                const Progress now = evaluate();
                const std::chrono::duration<double> spent =
                    std::chrono::steady_clock::now() - start;
                seconds_ = before + spent.count();
                if (!std::isfinite(now.loss)) {
                    outcome = TrainingOutcome::diverged;
                    break;
                }
                if (iteration_ != 0 && (last || iteration_ % options_.checkpoint_every == 0)) {
                    keep_([this] { save(); });
                }
                if (progress && !progress({.iteration = now.iteration,
                                           .total = now.total,
                                           .loss = now.loss,
                                           .misses = now.misses,
                                           .seconds = seconds_})) {
                    if (!last) outcome = TrainingOutcome::stopped;
                    keep_([this] { save(); });
                    break;
                }
            }
            if (last) break;
            if (options_.cancelled && *options_.cancelled) {
                outcome = TrainingOutcome::stopped;
                keep_([this] { save(); });
                break;
            }
            step();
        }
        return result(outcome);
    }

private:
    struct Sets {
        DataSet training;
        DataSet validation;
        DataSet test;
    };

    static Sets divide(const DataSet& data, const TrainingOptions& options)
    {
        Split outer = split(data, options.test_share, options.seed);
        Split inner = split(outer.kept, options.validation_share, options.seed + 1);
        return {.training = std::move(inner.kept),
                .validation = std::move(inner.held_out),
                .test = std::move(outer.held_out)};
    }

    [[nodiscard]] double rate() const
    {
        const double done =
            static_cast<double>(iteration_) / static_cast<double>(options_.iterations);
        return options_.final_rate + (options_.rate - options_.final_rate) * 0.5 *
                                         (1 + std::cos(std::numbers::pi * done));
    }

    void step()
    {
        if (iteration_ % options_.hard_every == 0) find_hard();
        const std::size_t width = network_.inputs();
        batch_states_.resize(options_.batch * width);
        batch_labels_.resize(options_.batch);
        for (std::size_t s = 0; s < options_.batch; ++s) {
            const std::vector<std::size_t>& half = s % 2 == 0 ? training_.events : training_.clear;
            const bool hard = !hard_.empty() && random_.chance(options_.hard_share);
            const std::size_t i =
                hard ? hard_[random_.below(hard_.size())] : half[random_.below(half.size())];
            std::copy_n(training_.states.begin() + static_cast<std::ptrdiff_t>(i * width), width,
                        batch_states_.begin() + static_cast<std::ptrdiff_t>(s * width));
            batch_labels_[s] = training_.labels[i];
        }
        network_.loss_and_gradient(batch_states_, batch_labels_, gradient_);
        adam_.step(network_.parameters(), gradient_, rate());
        ++iteration_;
    }

    /// The training states of the largest loss. There are none before the network has
    /// learned anything, when the largest loss means little.
    void find_hard()
    {
        hard_.clear();
        const auto pool = static_cast<std::size_t>(options_.hard_pool *
                                                   static_cast<double>(training_.labels.size()));
        if (iteration_ == 0 || pool == 0) return;
        logits_.resize(training_.labels.size());
        network_.evaluate(training_.states, logits_);
        std::vector<std::pair<double, std::size_t>> losses;
        losses.reserve(logits_.size());
        for (std::size_t i = 0; i < logits_.size(); ++i) {
            const double loss = cross_entropy(logits_[i], training_.labels[i] != 0);
            if (!std::isfinite(loss)) return;
            losses.emplace_back(-loss, i);
        }
        const auto end = losses.begin() + static_cast<std::ptrdiff_t>(pool);
        std::nth_element(losses.begin(), end, losses.end());
        for (auto it = losses.begin(); it != end; ++it) hard_.push_back(it->second);
        std::sort(hard_.begin(), hard_.end());
    }

    /// Assesses the present weights, rounded to float, and keeps them if they are
    /// the best so far.
    Progress evaluate()
    {
        const std::vector<double> exact(network_.parameters().begin(), network_.parameters().end());
        for (double& p : network_.parameters()) p = static_cast<float>(p);
        logits_.resize(validation_.labels.size());
        network_.evaluate(validation_.states, logits_);
        Progress progress{.iteration = iteration_,
                          .total = options_.iterations,
                          .loss = std::numeric_limits<double>::quiet_NaN(),
                          .misses = 0,
                          .seconds = 0};
        for (const std::size_t i : validation_.events) progress.misses += logits_[i] >= 0 ? 0 : 1;
        if (std::all_of(logits_.begin(), logits_.end(),
                        [](double z) { return std::isfinite(z); })) {
            const double threshold = choose_threshold(validation_, logits_, options_);
            const Score now = score(validation_, logits_, threshold);
            progress.loss = now.loss;
            if (best_.empty() || better(now, best_score_)) {
                best_.assign(network_.parameters().begin(), network_.parameters().end());
                best_threshold_ = threshold;
                best_score_ = now;
            }
        }
        std::copy(exact.begin(), exact.end(), network_.parameters().begin());
        return progress;
    }

    Trained result(TrainingOutcome outcome)
    {
        std::copy(best_.begin(), best_.end(), network_.parameters().begin());
        Trained trained;
        Model& model = trained.model;
        model.offset = offset_;
        model.scale = scale_;
        model.domain = ranges(join(join(sets_.training, sets_.validation), sets_.test));
        model.activation = options_.activation;
        model.precision = Precision::f32;
        model.threshold = best_threshold_;
        model.seed = options_.seed;
        model.layers = network_.layers();
        const DataSet sample = select(sets_.validation, std::vector<std::size_t>{0});
        model.self_test = {.input = sample.features, .output = logits(model, sample)};

        Report& report = trained.report;
        report.iterations = iteration_;
        report.seconds = seconds_;
        report.training_states = sets_.training.size();
        report.validation = assess(model, sets_.validation);
        report.held_out = assess(model, sets_.test);
        report.outcome = outcome;
        report.checkpoint_trouble = keep_.trouble();
        if (outcome != TrainingOutcome::diverged && !trained.misses_none()) {
            report.outcome = TrainingOutcome::misses_remain;
        }
        return trained;
    }

    void save() const
    {
        save_checkpoint({.fingerprint = fingerprint_,
                         .iteration = iteration_,
                         .seconds = seconds_,
                         .random = random_.state(),
                         .parameters = {network_.parameters().begin(), network_.parameters().end()},
                         .adam = adam_.state(),
                         .hard = {hard_.begin(), hard_.end()},
                         .best_parameters = best_,
                         .best_threshold = best_threshold_,
                         .best_score = best_score_},
                        options_.checkpoint);
    }

    void resume()
    {
        Checkpoint checkpoint = load_checkpoint(options_.checkpoint);
        const std::size_t n = network_.parameters().size();
        const bool fits =
            std::all_of(checkpoint.hard.begin(), checkpoint.hard.end(),
                        [this](std::uint64_t i) { return i < training_.labels.size(); });
        if (checkpoint.fingerprint != fingerprint_ || checkpoint.parameters.size() != n ||
            checkpoint.best_parameters.size() != n || !fits) {
            throw std::runtime_error("train: checkpoint '" + options_.checkpoint.string() +
                                     "' belongs to other data or options");
        }
        iteration_ = static_cast<std::size_t>(checkpoint.iteration);
        seconds_ = checkpoint.seconds;
        random_ = Random(checkpoint.random);
        std::copy(checkpoint.parameters.begin(), checkpoint.parameters.end(),
                  network_.parameters().begin());
        adam_.restore(std::move(checkpoint.adam));
        hard_.assign(checkpoint.hard.begin(), checkpoint.hard.end());
        best_ = std::move(checkpoint.best_parameters);
        best_threshold_ = checkpoint.best_threshold;
        best_score_ = checkpoint.best_score;
    }

    const TrainingOptions& options_;
    Random random_;
    std::uint64_t fingerprint_;
    Sets sets_;
    std::vector<double> offset_;
    std::vector<double> scale_;
    Prepared training_;
    Prepared validation_;
    TrainableMlp network_;
    Adam adam_;
    std::vector<double> gradient_;

    std::size_t iteration_ = 0;
    double seconds_ = 0;
    std::vector<std::size_t> hard_;
    std::vector<double> best_;
    double best_threshold_ = 0;
    Score best_score_;
    Keeper keep_{options_.checkpoint};

    std::vector<double> batch_states_;
    std::vector<std::uint8_t> batch_labels_;
    std::vector<double> logits_;
};

std::string_view name(TrainingOutcome outcome)
{
    switch (outcome) {
        case TrainingOutcome::finished: return "finished";
        case TrainingOutcome::stopped: return "stopped";
        case TrainingOutcome::misses_remain: return "misses_remain";
        case TrainingOutcome::diverged: return "diverged";
    }
    return "";
}

nlohmann::ordered_json json(const Assessment& a)
{
    return {{"detected", a.confusion.detected},
            {"missed", a.confusion.missed},
            {"false_alarms", a.confusion.false_alarms},
            {"cleared", a.confusion.cleared},
            {"miss_bound", a.miss_bound},
            {"false_alarm_rate", a.false_alarm_rate},
            {"margin", a.margin},
            {"well_clear", a.well_clear},
            {"cleared_share", a.cleared_share},
            {"lowest_event", a.lowest_event}};
}

}  // namespace

std::string_view describe(TrainingOutcome outcome) noexcept
{
    switch (outcome) {
        case TrainingOutcome::finished: return "no event was missed";
        case TrainingOutcome::stopped:
            return "stopped early, no event was missed; resume from the checkpoint to continue";
        case TrainingOutcome::misses_remain:
            return "events are still missed; train longer, widen the network, or look for states "
                   "labelled both ways";
        case TrainingOutcome::diverged:
            return "the loss is not finite; lower the learning rate or check the features";
    }
    return "";
}

bool Trained::misses_none() const noexcept
{
    return report.validation.confusion.missed == 0 && report.held_out.confusion.missed == 0 &&
           (!report.fresh || report.fresh->confusion.missed == 0);
}

Trained train(const DataSet& data, const TrainingOptions& options, const ProgressCallback& progress)
{
    check(data);
    check(options, data);
    return Trainer(data, options).run(progress);
}

std::string to_json(const Report& report)
{
    nlohmann::ordered_json out{{"outcome", name(report.outcome)},
                               {"iterations", report.iterations},
                               {"seconds", report.seconds},
                               {"training_states", report.training_states},
                               {"band", report.band},
                               {"validation", json(report.validation)},
                               {"held_out", json(report.held_out)}};
    out["fresh"] = report.fresh ? json(*report.fresh) : nlohmann::ordered_json();
    return out.dump(2);
}

}  // namespace ricochet::learn
