#include "ricochet/learn_steps/policies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>

#include "base/require.hpp"
#include "base/workers.hpp"
#include "learn/checkpoint_file.hpp"
#include "learn/limits.hpp"
#include "ricochet/base/random.hpp"

namespace ricochet::learn {

namespace {

constexpr std::string_view first_line = "ricochet evolution checkpoint 1\n";
constexpr double checkpoint_interval = 1;  // [s]: an interruption loses no more

constexpr ricochet::detail::Refuse refuse_search{"evolve"};

void check(std::span<const double> x0, const EvolutionOptions& o)
{
    const auto positive = [](double value) { return value > 0 && std::isfinite(value); };
    if (x0.empty()) refuse_search("expected a start of at least one component, got none");
    for (std::size_t i = 0; i < x0.size(); ++i) {
        if (!std::isfinite(x0[i]))
            refuse_search(fmt::format("component {} of the start is {}", i, x0[i]));
    }
    if (o.population != 0 && o.population < 4) {
        refuse_search(fmt::format("population must be 0 or at least 4, got {}", o.population));
    }
    if (!positive(o.spread))
        refuse_search(fmt::format("spread must be positive, got {}", o.spread));
    if (!o.scales.empty() && o.scales.size() != x0.size()) {
        refuse_search(fmt::format("expected {} scales, got {}", x0.size(), o.scales.size()));
    }
    for (const double scale : o.scales) {
        if (!positive(scale)) refuse_search(fmt::format("scales must be positive, got {}", scale));
    }
    if (o.max_evaluations == 0) refuse_search("max_evaluations must be positive, got 0");
    if (!(o.max_seconds > 0)) {
        refuse_search(fmt::format("max_seconds must be positive, got {}", o.max_seconds));
    }
    if (std::isnan(o.target)) refuse_search("target is NaN");
    if (!(o.least_spread >= 0)) {
        refuse_search(fmt::format("least_spread must not be negative, got {}", o.least_spread));
    }
    if (o.threads < 1 || o.threads > 64) {
        refuse_search(fmt::format("threads must lie in [1, 64], got {}", o.threads));
    }
    if (o.resume && o.checkpoint.empty()) refuse_search("resume needs a checkpoint");
}

/// NaN ranks last.
bool better(double a, double b)
{
    return std::isnan(b) ? !std::isnan(a) : a < b;
}

/// Learning rates and weights, from dimension and population alone: the tutorial's
/// equations 49 to 58, and the factor (n + 2) / 3 of Ros and Hansen for the diagonal.
struct Rates {
    Rates(std::size_t dimension, std::size_t population) : weights(population / 2)
    {
        const auto n = static_cast<double>(dimension);
        const double middle = std::log((static_cast<double>(population) + 1) / 2);
        for (std::size_t i = 0; i < weights.size(); ++i) {
            weights[i] = middle - std::log(static_cast<double>(i) + 1);
        }
        const double sum = std::reduce(weights.begin(), weights.end());
        double squares = 0;
        for (double& weight : weights) {
            weight /= sum;
            squares += weight * weight;
        }
        mu = 1 / squares;
        step = (mu + 2) / (n + mu + 5);
        damping = 1 + 2 * std::max(0.0, std::sqrt((mu - 1) / (n + 1)) - 1) + step;
        path = (4 + mu / n) / (n + 4 + 2 * mu / n);
        const double faster = (n + 2) / 3;
        one = std::min(1.0, faster * 2 / ((n + 1.3) * (n + 1.3) + mu));
        many = std::min(1 - one, faster * 2 * (mu - 2 + 1 / mu) / ((n + 2) * (n + 2) + mu));
        length = std::sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n));
    }

    std::vector<double> weights;  ///< of the better half, best first; their sum is 1
    double mu;                    ///< number of equal weights with the same variance
    double step, damping;         ///< of the step's length
    double path;                  ///< of the path of the covariance
    double one, many;             ///< of the covariance: from the path, from the population
    double length;                ///< of a normal vector, on average
};

/// Everything that a checkpoint holds.
struct State {
    std::uint64_t generations = 0;
    std::uint64_t evaluations = 0;
    std::uint64_t stagnant = 0;  ///< generations in a row
    double seconds = 0;
    Random::State random{};
    double spread = 0;
    std::vector<double> mean;
    std::vector<double> deviation;  ///< square root of the covariance's diagonal
    std::vector<double> step_path;
    std::vector<double> path;
    std::vector<double> best;
    double best_score = nan;
};

template <class Stream, class Member>
void fields(Member&& member, Stream&& s)
{
    member(s.generations);
    member(s.evaluations);
    member(s.stagnant);
    member(s.seconds);
    for (auto& word : s.random) member(word);
    member(s.spread);
    member(s.mean);
    member(s.deviation);
    member(s.step_path);
    member(s.path);
    member(s.best);
    member(s.best_score);
}

std::size_t population_of(std::size_t dimension, const EvolutionOptions& options)
{
    if (options.population != 0) return options.population;
    return 4 + static_cast<std::size_t>(3 * std::log(static_cast<double>(dimension)));
}

class Search {
public:
    Search(const Objective& score, std::span<const double> x0, const EvolutionOptions& options)
        : score_(score),
          options_(options),
          rates_(x0.size(), population_of(x0.size(), options)),
          workers_(options.threads),
          scores_(population_of(x0.size(), options)),
          samples_(scores_.size()),
          tried_(scores_.size())
    {
        s_.random = Random(options.seed).state();
        s_.spread = options.spread;
        s_.mean.assign(x0.begin(), x0.end());
        s_.deviation.assign(x0.size(), 1.0);
        s_.step_path.assign(x0.size(), 0.0);
        s_.path.assign(x0.size(), 0.0);
        s_.best = s_.mean;
        fingerprint_ = fingerprint(x0);
        if (options.resume) load();
    }

    EvolutionResult run(const EvolutionCallback& progress)
    {
        const auto start = std::chrono::steady_clock::now();
        const double before = s_.seconds;
        double saved = before;
        std::optional<EvolutionOutcome> outcome;
        if (s_.evaluations == 0 && !completes([this] { try_start(); })) {
            outcome = EvolutionOutcome::stopped;
        } else {
            outcome = ended();
        }
        while (!outcome) {
            if (!completes([this] { generation(); })) {
                outcome = EvolutionOutcome::stopped;
                break;
            }
            const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
            s_.seconds = before + spent.count();
            outcome = ended();
            if (s_.seconds - saved >= checkpoint_interval) {
                keep_([this] { save(); });
                saved = s_.seconds;
            }
            if (progress && !progress(report()) && !outcome) outcome = EvolutionOutcome::stopped;
        }
        keep_([this] { save(); });
        return {.outcome = *outcome,
                .x = s_.best,
                .score = s_.best_score,
                .mean = s_.mean,
                .evaluations = static_cast<std::size_t>(s_.evaluations),
                .generations = static_cast<std::size_t>(s_.generations),
                .seconds = s_.seconds,
                .checkpoint_trouble = keep_.trouble()};
    }

private:
    /// False if a score was given up in a part of the search, which then counts as not started.
    template <class Part>
    [[nodiscard]] bool completes(const Part& part)
    {
        const Random::State random = s_.random;
        try {
            part();
            return true;
        } catch (const SearchStopped&) {
            s_.random = random;
            return false;
        }
    }

    void try_start()
    {
        keep_if_best(s_.best, score_(s_.best));
        s_.evaluations = 1;
    }

    void keep_if_best(const std::vector<double>& x, double score)
    {
        if (!(score < infinity) || !better(score, s_.best_score)) return;
        s_.best = x;
        s_.best_score = score;
    }

    /// Draws, tries and ranks a population, and moves the distribution.
    void generation()
    {
        draw();
        workers_.run(tried_.size(), [this](std::size_t k) { scores_[k] = score_(tried_[k]); });
        s_.evaluations += tried_.size();
        ++s_.generations;
        rank();
        for (const std::size_t k : order_) keep_if_best(tried_[k], scores_[k]);
        if (scores_[order_.front()] < infinity) {
            s_.stagnant = 0;
            move();
        } else {
            ++s_.stagnant;
            s_.spread /= 2;
            s_.mean = s_.best;
        }
    }

    void draw()
    {
        const std::size_t n = s_.mean.size();
        Random random(s_.random);
        for (std::size_t k = 0; k < samples_.size(); ++k) {
            samples_[k].resize(n);
            tried_[k].resize(n);
            for (std::size_t i = 0; i < n; ++i) {
                samples_[k][i] = random.normal();
                tried_[k][i] = s_.mean[i] + s_.spread * scale(i) * s_.deviation[i] * samples_[k][i];
            }
        }
        s_.random = random.state();
    }

    void rank()
    {
        order_.resize(scores_.size());
        std::iota(order_.begin(), order_.end(), std::size_t{0});
        std::stable_sort(order_.begin(), order_.end(), [this](std::size_t a, std::size_t b) {
            return better(scores_[a], scores_[b]);
        });
    }

    /// The tutorial's equations 41 to 47, with a diagonal covariance.
    void move()
    {
        const auto n = s_.mean.size();
        double length = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const double z = recombined(i);
            s_.mean[i] += s_.spread * scale(i) * s_.deviation[i] * z;
            s_.step_path[i] = (1 - rates_.step) * s_.step_path[i] +
                              std::sqrt(rates_.step * (2 - rates_.step) * rates_.mu) * z;
            length += s_.step_path[i] * s_.step_path[i];
        }
        length = std::sqrt(length);

        const double settled =
            std::sqrt(1 - std::pow(1 - rates_.step, 2 * static_cast<double>(s_.generations)));
        const bool moving =
            length / settled < (1.4 + 2 / (static_cast<double>(n) + 1)) * rates_.length;
        for (std::size_t i = 0; i < n; ++i) adapt(i, moving);
        s_.spread *=
            std::exp(std::min(1.0, rates_.step / rates_.damping * (length / rates_.length - 1)));
    }

    /// The mean of the better half, in units of the deviation.
    [[nodiscard]] double recombined(std::size_t i) const
    {
        double z = 0;
        for (std::size_t k = 0; k < rates_.weights.size(); ++k) {
            z += rates_.weights[k] * samples_[order_[k]][i];
        }
        return z;
    }

    /// Component i of the covariance.
    void adapt(std::size_t i, bool moving)
    {
        const double old = s_.deviation[i] * s_.deviation[i];
        s_.path[i] *= 1 - rates_.path;
        if (moving) {
            s_.path[i] += std::sqrt(rates_.path * (2 - rates_.path) * rates_.mu) * s_.deviation[i] *
                          recombined(i);
        }
        double squares = 0;
        for (std::size_t k = 0; k < rates_.weights.size(); ++k) {
            const double z = samples_[order_[k]][i];
            squares += rates_.weights[k] * z * z;
        }
        const double lost = moving ? 0 : rates_.one * rates_.path * (2 - rates_.path);
        const double variance = (1 - rates_.one - rates_.many + lost) * old +
                                rates_.one * s_.path[i] * s_.path[i] + rates_.many * old * squares;
        s_.deviation[i] = std::sqrt(variance);
    }

    [[nodiscard]] double scale(std::size_t i) const
    {
        return options_.scales.empty() ? 1 : options_.scales[i];
    }

    [[nodiscard]] double largest_spread() const
    {
        return s_.spread * *std::max_element(s_.deviation.begin(), s_.deviation.end());
    }

    [[nodiscard]] std::optional<EvolutionOutcome> ended() const
    {
        if (s_.best_score <= options_.target) return EvolutionOutcome::target;
        if (s_.stagnant >= stagnant_generations) return EvolutionOutcome::none_allowed;
        if (s_.evaluations >= options_.max_evaluations) return EvolutionOutcome::max_evaluations;
        if (s_.seconds >= options_.max_seconds) return EvolutionOutcome::max_seconds;
        if (largest_spread() < options_.least_spread) return EvolutionOutcome::converged;
        return std::nullopt;
    }

    [[nodiscard]] EvolutionProgress report() const
    {
        return {.generation = static_cast<std::size_t>(s_.generations),
                .evaluations = static_cast<std::size_t>(s_.evaluations),
                .best = s_.best_score,
                .generation_best = scores_[order_.front()],
                .generation_median = scores_[order_[order_.size() / 2]],
                .spread = largest_spread(),
                .seconds = s_.seconds};
    }

    [[nodiscard]] std::uint64_t fingerprint(std::span<const double> x0) const
    {
        Writer all;
        all.put(std::vector<double>(x0.begin(), x0.end()));
        all.put(std::uint64_t{scores_.size()});
        all.put(options_.spread);
        all.put(options_.scales);
        all.put(options_.seed);
        all.put(checksum(options_.problem));
        return checksum(all.bytes());
    }

    void save() const
    {
        Writer writer;
        writer.put(fingerprint_);
        fields([&writer](const auto& member) { writer.put(member); }, s_);
        write_checkpoint(first_line, writer, options_.checkpoint);
    }

    void load()
    {
        const std::string bytes = read_checkpoint(first_line, options_.checkpoint);
        Reader reader(bytes, options_.checkpoint);
        std::uint64_t found = 0;
        reader.get(found);
        if (found != fingerprint_) {
            refuse_checkpoint(
                options_.checkpoint,
                "is of another search: problem, start, population, spread or seed differ");
        }
        const std::size_t n = s_.mean.size();
        fields([&reader](auto& member) { reader.get(member); }, s_);
        reader.finish();
        for (const auto* list : {&s_.mean, &s_.deviation, &s_.step_path, &s_.path, &s_.best}) {
            if (list->size() != n) refuse_checkpoint(options_.checkpoint, "has been altered");
        }
    }

    const Objective& score_;
    const EvolutionOptions& options_;
    Rates rates_;
    ricochet::detail::Workers workers_;
    State s_;
    std::uint64_t fingerprint_ = 0;
    std::vector<double> scores_;                ///< of this generation
    std::vector<std::vector<double>> samples_;  ///< standard normal
    std::vector<std::vector<double>> tried_;
    std::vector<std::size_t> order_;  ///< best first
    Keeper keep_{options_.checkpoint};
};

}  // namespace

std::string_view describe(EvolutionOutcome outcome) noexcept
{
    switch (outcome) {
        case EvolutionOutcome::max_evaluations:
            return "reached the number of evaluations; resume with more if the score still falls";
        case EvolutionOutcome::max_seconds:
            return "reached the time allowed; resume with more if the score still falls";
        case EvolutionOutcome::target: return "reached the target";
        case EvolutionOutcome::converged: return "the spread is too small to change anything";
        case EvolutionOutcome::stopped: return "stopped; resume to continue";
        case EvolutionOutcome::none_allowed:
            return "no vector had a score below infinity; start nearer, or with less spread";
    }
    return "unknown";
}

EvolutionResult evolve(const Objective& score, std::span<const double> x0,
                       const EvolutionOptions& options, const EvolutionCallback& progress)
{
    check(x0, options);
    return Search(score, x0, options).run(progress);
}

}  // namespace ricochet::learn
