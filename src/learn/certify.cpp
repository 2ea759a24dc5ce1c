#include "ricochet/learn/certify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <new>

#include "base/require.hpp"
#include "branch_and_bound.hpp"
#include "certify_checkpoint.hpp"
#include "checkpoint_file.hpp"
#include "proof.hpp"
#include "ricochet/base/random.hpp"

namespace ricochet::learn {

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start)
{
    return std::chrono::duration<double>(Clock::now() - start).count();
}

void check(const CertifyOptions& o)
{
    constexpr ricochet::detail::Require require{"certify"};
    const auto number = [](std::size_t n) { return static_cast<double>(n); };
    require(std::isfinite(o.margin) && o.margin >= 0, "margin must be finite and not negative",
            o.margin);
    require(o.levels >= 1 && o.levels <= 32, "levels must lie in [1, 32]", number(o.levels));
    require(std::isfinite(o.ratio) && o.ratio > 1, "ratio must be above 1", o.ratio);
    require(o.levels == 1 || o.margin > 0, "several levels need a positive margin", o.margin);
    double before = -1;
    for (const double m : o.margins) {
        require(std::isfinite(m) && m >= 0 && m > before,
                "margins must be finite, not negative and rise", m);
        before = m;
    }
    require(o.margins.size() <= 32, "there may be at most 32 margins", number(o.margins.size()));
    require(o.closest > 0 && o.closest < 1, "closest must lie in (0, 1)", o.closest);
    require(o.smallest > 0 && o.smallest <= 1, "smallest must lie in (0, 1]", o.smallest);
    require(o.limit > 0, "limit must be positive", o.limit);
    require(o.time_limit > 0, "time_limit must be positive", o.time_limit);
    require(o.threads >= 1 && o.threads <= 64, "threads must lie in [1, 64]", o.threads);
}

constexpr std::string_view level_gate = "gate-level";

/// Fills in the margins of a gate of levels, unless others are given.
CertifyOptions completed(const Model& model, CertifyOptions o)
{
    if (model.kind == level_gate && o.margins.empty()) {
        for (const GateLevel& level : model.levels) o.margins.push_back(level.value);
    }
    if (!o.margins.empty()) o.levels = o.margins.size();
    return o;
}

void check_recipe(const Model& model)
{
    if (model.kind == "gate-horizon") {
        throw std::invalid_argument(
            "certify: expected a classifier or a gate of levels, got a gate of horizons, which "
            "says "
            "nothing of the guard's value");
    }
    if (model.recipe == name(ricochet::detail::Recipe::state)) return;
    throw std::invalid_argument(
        fmt::format("certify: expected a model with the recipe 'state', whose features are the "
                    "components of the state, got the recipe '{}'",
                    model.recipe));
}

/// Draws a random state of the domain.
void draw(const Model& model, Random& random, std::vector<double>& x)
{
    for (std::size_t i = 0; i < x.size(); ++i) {
        x[i] = random.uniform(model.domain[i].lower, model.domain[i].upper);
    }
}

/// Properties in which a checkpoint must agree. The guard is identified by its values at a few
/// states.
std::string key(const Model& model, const GuardProblem& problem, const CertifyOptions& o)
{
    Random random(1);
    std::vector<double> x(model.domain.size());
    std::string out =
        fmt::format("{} {} {} {} {} {} {} {} {}", fingerprint(model), o.margin, o.levels, o.ratio,
                    o.search, o.closest, o.smallest, o.max_unproved, o.seed);
    for (const double margin : o.margins) out += fmt::format(" {}", margin);
    for (int i = 0; i < 4; ++i) {
        draw(model, random, x);
        if (problem.least) out += fmt::format(" {}", problem.least(x.data(), x.data()));
        out += fmt::format(" {} {}", problem.guard(x.data()), problem.slack(x.data()));
    }
    return out;
}

class Certifier {
public:
    Certifier(const Model& model, const GuardProblem& problem, const CertifyOptions& options,
              const CertifyCallback& progress)
        : model_(model),
          problem_(problem),
          o_(completed(model, options)),
          progress_(progress),
          classifier_(model),
          bounds_(model),
          key_(key(model, problem, o_))
    {
        if (o_.resume) all_ = load(key_, o_.checkpoint);
    }

    CertifiedModel run()
    {
        CertifyOutcome outcome = CertifyOutcome::proved;
        try {
            while (all_.levels.size() < o_.levels && outcome == CertifyOutcome::proved) {
                outcome = level();
            }
        } catch (const std::bad_alloc&) {
            outcome = CertifyOutcome::out_of_memory;
        } catch (const CertifyInterrupted&) {
            outcome = CertifyOutcome::interrupted;
        }
        keep_([this] { save(all_, key_, o_.checkpoint); });
        return result(outcome);
    }

    Estimate estimate_statement(double margin, double threshold, std::size_t rounds)
    {
        const Statement statement = state(margin, threshold);
        const auto start = Clock::now();
        const Frontier frontier = grow(statement, frontier_boxes);
        const double growing = seconds_since(start);
        Estimate out = estimate_below(statement, frontier, rounds, o_.seed);
        out.seconds = frontier.open.empty()
                          ? growing
                          : growing + out.seconds / static_cast<double>(o_.threads);
        return out;
    }

private:
    static constexpr std::size_t few_rounds = 2;
    static constexpr std::size_t many_rounds = 12;
    static constexpr double checkpoint_every = 5;  // [s]

    [[nodiscard]] Statement state(double margin, double threshold) const
    {
        return {classifier_, bounds_, problem_, o_.smallest, margin, threshold};
    }

    [[nodiscard]] double margin_of(std::size_t level) const
    {
        if (!o_.margins.empty()) return o_.margins[level];
        return o_.margin * std::pow(o_.ratio, static_cast<double>(level));
    }

    [[nodiscard]] Attempt first_attempt(double margin) const
    {
        constexpr std::size_t sampled = 4096;
        constexpr std::size_t sought = 20'000;
        Random random(o_.seed);
        std::vector<double> x(model_.domain.size());
        std::vector<double> logits;
        for (std::size_t i = 0; i < sampled; ++i) {
            draw(model_, random, x);
            logits.push_back(classifier_.logit(x.data()));
        }
        std::sort(logits.begin(), logits.end());
        const double low = logits[sampled / 20];
        const LowestLogit found = lowest_logit(model_, problem_, margin, sought, o_.seed);
        const double highest = std::min(found.logit, logits.back());
        return {.highest = highest, .spread = highest - low, .closest = o_.closest};
    }

    /// Descends from inexpensive thresholds to expensive ones.
    /// @returns nothing if even the least expensive is above the limit, or the logits do not
    ///          separate the states within the margin from the others
    std::optional<Started> search(double margin, const Attempt& attempt)
    {
        constexpr double first = 0.9;
        constexpr double factor = 0.7;
        std::optional<Started> best;
        for (double gap = std::max(first, attempt.closest);;
             gap = std::max(attempt.closest, gap * factor)) {
            double threshold = attempt.highest - gap * attempt.spread;
            if (!all_.levels.empty()) {
                threshold = std::min(threshold, all_.levels.back().threshold);
            }
            const Estimate e = estimate_statement(margin, threshold, few_rounds);
            const bool cheap = e.seconds <= (best ? o_.limit / 2 : o_.limit) &&
                               e.unproved <= static_cast<double>(o_.max_unproved);
            if (!cheap) {
                if (!best) last_estimate_ = e;
                break;
            }
            best = Started{.threshold = threshold, .estimate = e};
            if (gap <= attempt.closest) break;
        }
        if (best) {
            best->estimate = estimate_statement(margin, best->threshold, many_rounds);
            best->lowering = attempt.highest - best->threshold;
        }
        return best;
    }

    CertifyOutcome level()
    {
        const std::size_t index = all_.levels.size();
        const double margin = margin_of(index);
        if (o_.search || index > 0) return search_and_prove(margin);
        if (all_.current) return prove(margin);
        return begin({.threshold = model_.threshold,
                      .estimate = estimate_statement(margin, model_.threshold, many_rounds)},
                     margin);
    }

    /// Repeats a proof that failed, with a threshold farther below the counterexamples.
    CertifyOutcome search_and_prove(double margin)
    {
        constexpr int attempts = 6;
        if (!all_.attempt) all_.attempt = first_attempt(margin);
        if (!(all_.attempt->spread > 0)) return CertifyOutcome::not_provable;
        for (;;) {
            CertifyOutcome outcome = CertifyOutcome::proved;
            if (all_.current) {
                outcome = prove(margin);
            } else if (const auto started = search(margin, *all_.attempt)) {
                outcome = begin(*started, margin);
            } else {
                all_.estimates.push_back(last_estimate_);
                return last_estimate_.seconds > o_.limit ? CertifyOutcome::too_long
                                                         : CertifyOutcome::not_provable;
            }
            const bool failed =
                outcome == CertifyOutcome::refuted || outcome == CertifyOutcome::not_provable;
            if (!failed) return outcome;
            Attempt& attempt = *all_.attempt;
            if (++attempt.number == attempts) return outcome;
            attempt.closest = std::min(1.0, 2 * attempt.closest);
            if (outcome == CertifyOutcome::refuted) {
                attempt.highest =
                    std::min(attempt.highest, classifier_.logit(counterexample_.data()));
            }
        }
    }

    CertifyOutcome begin(const Started& started, double margin)
    {
        all_.estimates.resize(all_.levels.size());
        all_.estimates.push_back(started.estimate);
        if (started.estimate.seconds > o_.limit) return CertifyOutcome::too_long;
        all_.current = started;
        return prove(margin);
    }

    [[nodiscard]] Stop report(const Started& started, double margin, std::uint64_t boxes,
                              double seconds)
    {
        if (seconds_since(start_) > o_.time_limit) return Stop::out_of_time;
        if (!progress_) return Stop::none;
        CertifyProgress now{.level = all_.levels.size(),
                            .levels = o_.levels,
                            .margin = margin,
                            .threshold = started.threshold,
                            .estimate = started.estimate,
                            .boxes = boxes,
                            .seconds = started.seconds + seconds};
        const auto done = static_cast<double>(boxes);
        now.rate = now.seconds > 0 ? done / now.seconds : 0;
        now.seconds_left = now.rate > 0 ? std::max(0.0, started.estimate.boxes - done) / now.rate
                                        : started.estimate.seconds;
        now.share = std::min(1.0, done / std::max(started.estimate.boxes, 1.0));
        return progress_(now) ? Stop::none : Stop::interrupted;
    }

    CertifyOutcome prove(double margin)
    {
        Started& started = *all_.current;
        if (const Stop stop = report(started, margin, 0, 0); stop != Stop::none) {
            return outcome_of(stop);
        }
        const auto start = Clock::now();
        const Statement statement = state(margin, started.threshold);
        Proof proof(statement, grow(statement, frontier_boxes), o_.max_unproved, started);
        auto saved = Clock::now();
        proof.run(o_.threads, [&](std::uint64_t boxes) {
            if (seconds_since(saved) > checkpoint_every) {
                const double before = started.seconds;
                started.seconds += seconds_since(start);
                keep_([this] { save(all_, key_, o_.checkpoint); });
                started.seconds = before;
                saved = Clock::now();
            }
            return report(started, margin, boxes, seconds_since(start));
        });
        started.seconds += seconds_since(start);
        if (proof.stopped() != Stop::none) return outcome_of(proof.stopped());
        if (proof.refuted()) {
            counterexample_ = proof.total().counterexample;
            all_.current.reset();
            return CertifyOutcome::refuted;
        }
        if (proof.too_many()) {
            all_.current.reset();
            return CertifyOutcome::not_provable;
        }
        finish(proof.total(), margin);
        return CertifyOutcome::proved;
    }

    /// Every box is proved or has no logit below `lowest`: with this threshold all are proved.
    void finish(const Tally& total, double margin)
    {
        const Started& started = *all_.current;
        CertificateLevel level{.margin = margin,
                               .threshold = started.threshold,
                               .boxes = total.boxes,
                               .seconds = started.seconds,
                               .unproved = total.unproved};
        const double lowest = std::min(total.lowest, started.threshold);
        // A gate has no list of exceptions.
        if (started.threshold - lowest <= started.lowering ||
            (model_.kind == level_gate && std::isfinite(lowest))) {
            level.threshold = lowest;
            level.unproved.clear();
        }
        all_.levels.push_back(std::move(level));
        all_.current.reset();
        all_.attempt.reset();
    }

    [[nodiscard]] static CertifyOutcome outcome_of(Stop stop)
    {
        switch (stop) {
            case Stop::out_of_time: return CertifyOutcome::out_of_time;
            case Stop::out_of_memory: return CertifyOutcome::out_of_memory;
            default: return CertifyOutcome::interrupted;
        }
    }

    /// The levels that a gate may keep: proved without exception.
    [[nodiscard]] std::vector<GateLevel> proved_gate() const
    {
        std::vector<GateLevel> out;
        for (const CertificateLevel& level : all_.levels) {
            if (!(level.margin > 0) || !level.unproved.empty()) continue;
            out.push_back({.value = level.margin, .threshold = level.threshold});
        }
        return out;
    }

    /// Fraction of the domain where each level clears the state, in none of its unproved boxes.
    [[nodiscard]] std::vector<double> cleared_shares() const
    {
        constexpr int states = 4096;  // a standard error below 0.8 %
        std::vector<double> out(all_.levels.size());
        Random random(o_.seed);
        std::vector<double> x(model_.domain.size());
        for (int i = 0; i < states; ++i) {
            draw(model_, random, x);
            const double logit = classifier_.logit(x.data());
            for (std::size_t k = 0; k < out.size(); ++k) {
                const CertificateLevel& level = all_.levels[k];
                if (logit < level.threshold && !is_unproved(level, x)) out[k] += 1.0 / states;
            }
        }
        return out;
    }

    [[nodiscard]] static bool is_unproved(const CertificateLevel& level,
                                          const std::vector<double>& x)
    {
        return std::any_of(level.unproved.begin(), level.unproved.end(), [&](const auto& box) {
            return std::equal(x.begin(), x.end(), box.begin(),
                              [](double value, const ValueRange& r) {
                                  return value >= r.lower && value <= r.upper;
                              });
        });
    }

    CertifiedModel result(CertifyOutcome outcome)
    {
        CertifiedModel out{.model = model_, .report = {}};
        out.model.certificate.clear();
        const std::vector<GateLevel> gate = proved_gate();
        if (!all_.levels.empty() && (model_.kind != level_gate || !gate.empty())) {
            if (model_.kind == level_gate) {
                out.model.levels = gate;
                out.model.calibration = {};
            }
            out.model.threshold = all_.levels.front().threshold;
            out.model.certificate = to_text(Certificate{.tool = RICOCHET_TOOL,
                                                        .fingerprint = fingerprint(out.model),
                                                        .system = model_.system,
                                                        .parameters = model_.parameters,
                                                        .box = model_.domain,
                                                        .levels = all_.levels});
        }
        const bool listed = std::any_of(all_.levels.begin(), all_.levels.end(),
                                        [](const auto& l) { return !l.unproved.empty(); });
        if (outcome == CertifyOutcome::proved && listed) outcome = CertifyOutcome::partly_proved;
        out.report = {.outcome = outcome,
                      .levels = all_.levels,
                      .clears = cleared_shares(),
                      .estimates = all_.estimates,
                      .counterexample = outcome == CertifyOutcome::refuted ? counterexample_
                                                                           : std::vector<double>{},
                      .seconds = seconds_since(start_),
                      .checkpoint_trouble = keep_.trouble()};
        return out;
    }

    const Model& model_;
    const GuardProblem& problem_;
    const CertifyOptions o_;
    const CertifyCallback& progress_;
    Classifier classifier_;
    NetworkBounds bounds_;
    std::string key_;
    Progressed all_{};
    Estimate last_estimate_{};
    std::vector<double> counterexample_{};
    Clock::time_point start_ = Clock::now();
    Keeper keep_{o_.checkpoint};
};

}  // namespace

std::string_view describe(CertifyOutcome outcome) noexcept
{
    switch (outcome) {
        case CertifyOutcome::proved:
            return "proved wherever in the domain the network clears the state";
        case CertifyOutcome::partly_proved:
            return "proved wherever in the domain the network clears the state, but for the boxes "
                   "that the record lists, where the exact guard is evaluated; a smaller edge or a "
                   "lower threshold leaves fewer";
        case CertifyOutcome::refuted:
            return "a state clears although its guard is within the margin; lower the threshold, "
                   "or "
                   "let it be searched for";
        case CertifyOutcome::not_provable:
            return "too many boxes are left over; lower the threshold or the margin, or train the "
                   "network further";
        case CertifyOutcome::too_long:
            return "the estimate is above the limit and nothing was started; raise the limit, or "
                   "lower the threshold";
        case CertifyOutcome::out_of_time:
            return "the time is up; what is done is kept in the checkpoint, to be resumed";
        case CertifyOutcome::out_of_memory:
            return "the memory is used up; what is done is kept in the checkpoint, to be resumed";
        case CertifyOutcome::interrupted:
            return "interrupted; what is done is kept in the checkpoint, to be resumed";
    }
    return "";
}

std::string describe(const CertifyReport& report)
{
    const std::string outcome(describe(report.outcome));
    const bool proved =
        report.outcome == CertifyOutcome::proved || report.outcome == CertifyOutcome::partly_proved;
    if (!proved || report.clears.empty()) return outcome;
    return fmt::format("{}; it clears {:.2g} % of the domain", outcome,
                       100 * report.clears.front());
}

CertifiedModel certify(const Model& model, const GuardProblem& problem,
                       const CertifyOptions& options, const CertifyCallback& progress)
{
    check(options);
    check_recipe(model);
    return Certifier(model, problem, options, progress).run();
}

Estimate estimate(const Model& model, const GuardProblem& problem, double margin, double threshold,
                  const CertifyOptions& options)
{
    check(options);
    check_recipe(model);
    constexpr std::size_t rounds = 12;
    CertifyOptions alone = options;
    alone.resume = false;
    return Certifier(model, problem, alone, {}).estimate_statement(margin, threshold, rounds);
}

LowestLogit lowest_logit(const Model& model, const GuardProblem& problem, double margin,
                         std::size_t states, std::uint64_t seed)
{
    struct Found {
        std::vector<double> x;
        double logit, guard;
    };
    constexpr std::size_t pool = 32;
    const Classifier classifier(model);
    Random random(seed);
    const std::size_t n = model.domain.size();
    // Outside the margin nearer states are better; within it, states with a lower logit.
    const auto better = [margin](const Found& a, const Found& b) {
        const bool in_a = a.guard <= margin;
        const bool in_b = b.guard <= margin;
        if (in_a != in_b) return in_a;
        return in_a ? a.logit < b.logit : a.guard < b.guard;
    };
    const auto look = [&](std::vector<double> x) {
        const double logit = classifier.logit(x.data());
        const double guard = problem.guard(x.data());
        return Found{.x = std::move(x), .logit = logit, .guard = guard};
    };
    std::vector<Found> best;
    std::vector<double> x(n);
    for (std::size_t i = 0; i < states / 2; ++i) {
        draw(model, random, x);
        Found found = look(x);
        if (best.size() == pool && !better(found, best.back())) continue;
        best.insert(std::upper_bound(best.begin(), best.end(), found, better), std::move(found));
        if (best.size() > pool) best.pop_back();
    }
    const std::size_t steps = best.empty() ? 0 : (states - states / 2) / best.size();
    for (Found& at : best) {
        for (std::size_t i = 0; i < steps; ++i) {
            const double radius = random.log_uniform(1e-6, 0.2);
            x = at.x;
            for (std::size_t k = 0; k < n; ++k) {
                const ValueRange& range = model.domain[k];
                const double step = radius * (range.upper - range.lower) * random.uniform(-1, 1);
                x[k] = std::clamp(x[k] + step, range.lower, range.upper);
            }
            Found found = look(x);
            if (better(found, at)) at = std::move(found);
        }
    }
    LowestLogit out;
    for (const Found& found : best) {
        if (found.guard <= margin && found.logit < out.logit) {
            out = {.logit = found.logit, .x = found.x};
        }
    }
    return out;
}

void detail::check_certifiable(const Model& model, std::string_view system, std::size_t components)
{
    check_recipe(model);
    if (model.system != system) {
        throw std::invalid_argument(fmt::format(
            "certify: the model is for the system '{}', expected '{}'", model.system, system));
    }
    if (model.layers.empty() || model.layers.front().inputs != components) {
        throw std::invalid_argument(fmt::format(
            "certify: the model takes {} features, but the state of {} has {} "
            "components",
            model.layers.empty() ? 0 : model.layers.front().inputs, system, components));
    }
}

void detail::check_parameter(const std::string& name, double trained, std::optional<double> value)
{
    if (value == trained) return;
    throw std::invalid_argument(
        value
            ? fmt::format("certify: the model is for {} = {}, the system has {}", name, trained,
                          *value)
            : fmt::format("certify: the model depends on the parameter '{}', which the system does "
                          "not tell",
                          name));
}

}  // namespace ricochet::learn
