#include "ricochet/learn_steps/step_control.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include "base/workers.hpp"
#include "ricochet/base/random.hpp"

namespace ricochet::learn {

namespace {

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double final_margin = 0.05;  // of the logarithm of work
constexpr double tiny = 1e-12;         // errors below this count as equal

/// Tolerances of the classical curves.
std::vector<double> fine_tolerances()
{
    std::vector<double> out;
    for (int i = 0; i <= 26; ++i) out.push_back(0.3 * std::pow(10.0, -i / 5.5));
    return out;
}

/// Constant steps as long as the free estimate's steps on average at about that tolerance.
StepRule constant_rule(double tolerance)
{
    return {.controller = ConstantStep{}, .step = 20 * std::cbrt(tolerance)};
}

double log_error(double error)
{
    return std::log(std::clamp(error, tiny, 10.0));
}

/// Work and errors of a rule on the problems of a group.
struct Mean {
    double work = 0;         ///< mean of the logarithm
    double error = 0;        ///< mean of the logarithm
    double final_error = 0;  ///< logarithm of the root mean square
    double failed = 0;       ///< fraction of runs that did not reach the end
};

Mean mean_of(const std::vector<const StepProblem*>& problems, const StepRule& rule)
{
    Mean out;
    double squares = 0;
    for (const StepProblem* problem : problems) {
        const StepTrial trial = problem->run(rule);
        out.work += std::log(std::max(trial.work, 1.0));
        out.error += log_error(trial.error);
        squares += std::min(trial.final_error, 10.0) * std::min(trial.final_error, 10.0);
        out.failed += trial.ended ? 0 : 1;
    }
    const auto n = static_cast<double>(problems.size());
    out.work /= n;
    out.error /= n;
    out.final_error = log_error(std::sqrt(squares / n));
    out.failed /= n;
    return out;
}

}  // namespace

void WorkCurve::finish(double share)
{
    std::sort(points_.begin(), points_.end(),
              [](const Point& a, const Point& b) { return a.work < b.work; });
    std::vector<Point> out;
    for (const Point& at : points_) {
        double sum = 0;
        double count = 0;
        for (const Point& other : points_) {
            if (std::abs(other.work - at.work) > share) continue;
            sum += other.error;
            ++count;
        }
        out.push_back({at.work, sum / count});
    }
    points_ = std::move(out);
}

double WorkCurve::work_at(double log_error) const
{
    if (points_.empty()) return inf;
    const Point& last = points_.back();
    constexpr double slope = -0.5;
    if (!(last.error <= log_error)) return last.work + slope * (log_error - last.error);
    std::size_t i = points_.size() - 1;
    while (i > 0 && points_[i - 1].error <= log_error) --i;
    const Point& below = points_[i];
    if (i == 0) return below.work + slope * (log_error - below.error);
    const Point& above = points_[i - 1];
    const double x = (above.error - log_error) / (above.error - below.error);
    return std::lerp(above.work, below.work, x);
}

StepScore::StepScore(const StepFamily& family, unsigned threads) : family_(family)
{
    std::map<int, Group> groups;
    for (const StepProblem& problem : family.problems) {
        groups[problem.group].problems.push_back(&problem);
    }
    const std::vector<double> fine = fine_tolerances();
    ricochet::detail::Workers team(threads);
    for (auto& numbered : groups) {
        Group& group = numbered.second;  // a structured binding cannot be captured below
        group.number = numbered.first;
        for (const bool constant : {false, true}) {
            std::vector<Mean> means(fine.size());
            team.run(fine.size(), [&](std::size_t i) {
                means[i] = mean_of(group.problems, constant ? constant_rule(fine[i])
                                                            : StepRule{.tolerance = fine[i]});
            });
            WorkCurve error;
            WorkCurve final_error;
            for (const Mean& mean : means) {
                if (mean.failed > 0) continue;
                error.add(mean.work, mean.error);
                final_error.add(mean.work, mean.final_error);
            }
            error.finish();
            // A root mean square of a few errors with changing signs is smoothed.
            final_error.finish(0.2);
            group.of_error.push_back(std::move(error));
            group.of_final.push_back(std::move(final_error));
        }
        for (const double tolerance : family.tolerances) {
            group.target.push_back(mean_of(group.problems, {.tolerance = tolerance}).error);
        }
        groups_.push_back(std::move(group));
    }
}

std::vector<StepScore::Part> StepScore::parts(const LearnedStep& rule) const
{
    std::vector<Part> out;
    for (const Group& group : groups_) {
        for (std::size_t i = 0; i < family_.tolerances.size(); ++i) {
            const double tolerance = family_.tolerances[i];
            const Mean mean = mean_of(group.problems, {.controller = rule, .tolerance = tolerance});
            const auto gain = [&](const std::vector<WorkCurve>& curves, double error) {
                double least = inf;
                for (const WorkCurve& curve : curves) least = std::min(least, curve.work_at(error));
                return least - mean.work;
            };
            out.push_back({.group = group.number,
                           .tolerance = tolerance,
                           .gain = gain(group.of_error, mean.error),
                           .final_gain = gain(group.of_final, mean.final_error),
                           .off = mean.error - group.target[i],
                           .failed = mean.failed});
        }
    }
    return out;
}

double StepScore::operator()(const LearnedStep& rule) const
{
    double sum = 0;
    const std::vector<Part> all = parts(rule);
    for (const Part& part : all) {
        sum += -part.gain + 0.2 * part.off * part.off + 5 * part.failed;
        if (family_.judges_final) sum += std::max(0.0, final_margin - part.final_gain);
    }
    return sum / static_cast<double>(all.size());
}

namespace {

LearnedStep rule_of(const StepLayout& layout, const std::vector<double>& weights)
{
    return {.policy = std::make_shared<const StepPolicy>(step_policy_model(layout, weights))};
}

/// Random weights with a zero last layer, and the range in which each may vary.
struct Start {
    std::vector<double> x;
    std::vector<double> scales;
};

Start start_of(std::uint64_t seed)
{
    Random random(seed);
    Start out;
    const auto layer = [&](std::size_t inputs, std::size_t outputs, double spread) {
        const double scale = 1 / std::sqrt(static_cast<double>(inputs));
        for (std::size_t i = 0; i < (inputs + 1) * outputs; ++i) {
            out.x.push_back(spread * scale * random.uniform(-1, 1));
            out.scales.push_back(scale);
        }
    };
    layer(StepPolicy::inputs, 8, 1);
    layer(8, 8, 1);
    layer(8, 1, 0);
    return out;
}

/// Name of the system and all problems, so that no checkpoint of other ones is resumed.
std::string name_of(const StepFamily& family)
{
    std::string out(family.layout.system);
    for (const StepProblem& problem : family.problems) out += '\n' + problem.description;
    return out;
}

}  // namespace

StepFamily stoppable(StepFamily family, std::function<bool()> goes_on)
{
    for (StepProblem& problem : family.problems) {
        problem.run = [run = std::move(problem.run), goes_on](const StepRule& rule) {
            if (!goes_on()) throw SearchStopped{};
            StepRule watched = rule;
            watched.watch = [&](double done) {
                return goes_on() && (!rule.watch || rule.watch(done));
            };
            StepTrial trial = run(watched);
            if (!goes_on()) throw SearchStopped{};
            return trial;
        };
    }
    return family;
}

namespace {

/// Ranges of the inputs that the policy and the classical rule meet on the family, a tenth wider.
auto domain_of(const StepFamily& family, const std::vector<double>& x)
{
    StepRanges seen;
    for (const std::vector<double>& weights : {x, std::vector<double>{}}) {
        LearnedStep rule = rule_of(family.layout, weights);
        rule.seen = &seen;
        for (const StepProblem& problem : family.problems) {
            for (const double tolerance : family.tolerances) {
                for (const double factor : {4.0, 1.0, 0.25}) {
                    (void)problem.run({.controller = rule, .tolerance = factor * tolerance});
                }
            }
        }
    }
    return seen.domain(0.1);
}

TrainedStepPolicy train_on(const StepFamily& family, const StepTrainingOptions& options,
                           const EvolutionCallback& progress)
{
    const StepScore score(family, options.threads);
    const Start start = start_of(options.seed);
    TrainedStepPolicy out;
    out.search = evolve(
        [&](std::span<const double> x) {
            return score(rule_of(family.layout, std::vector<double>(x.begin(), x.end())));
        },
        start.x,
        {.population = 20,
         .spread = 0.5,
         .scales = start.scales,
         .seed = options.seed,
         .problem = name_of(family),
         .max_evaluations = options.evaluations,
         .max_seconds = options.seconds,
         .threads = options.threads,
         .checkpoint = options.checkpoint,
         .resume = options.resume},
        progress);
    out.model = step_policy_model(family.layout, out.search.x);
    out.model.seed = options.seed;
    try {
        out.model.domain = domain_of(family, out.search.x);
    } catch (const SearchStopped&) {
        out.search.outcome = EvolutionOutcome::stopped;
    }
    return out;
}

}  // namespace

TrainedStepPolicy train_step_policy(const StepFamily& family, const StepTrainingOptions& options,
                                    const EvolutionCallback& progress)
{
    if (!options.goes_on) return train_on(family, options, progress);
    try {
        return train_on(stoppable(family, options.goes_on), options, progress);
    } catch (const SearchStopped&) {  // before the search, or after it
        TrainedStepPolicy out;
        out.search.outcome = EvolutionOutcome::stopped;
        return out;
    }
}

}  // namespace ricochet::learn
