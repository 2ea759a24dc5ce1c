#include <algorithm>
#include <cmath>
#include <memory>

#include "ricochet/learn_steps/step_control.hpp"

namespace ricochet::learn {

namespace {

StepRule prescribed(std::vector<double> lengths)
{
    return {.controller = PrescribedSteps{
                .lengths = std::make_shared<const std::vector<double>>(std::move(lengths))}};
}

}  // namespace

double first_step(const StepRule& rule, double usual_step)
{
    const auto* given = std::get_if<PrescribedSteps>(&rule.controller);
    return given ? given->lengths->front() : rule.step * usual_step;
}

SearchedSteps search_steps(const StepProblem& problem, std::size_t count, std::size_t evaluations,
                           std::uint64_t seed, unsigned threads, const StepWatch& watch)
{
    // Takes even steps as far as the motion goes: some motions come to rest long before their time.
    const StepTrial even = problem.run({.controller = ConstantStep{}});
    const double span = static_cast<double>(even.steps) * problem.usual_step;
    const std::vector<double> start(count, std::log(span / static_cast<double>(count)));
    const auto lengths_of = [&](std::span<const double> x) {
        std::vector<double> out(count);
        for (std::size_t i = 0; i < count; ++i) out[i] = std::exp(std::clamp(x[i], -40.0, 40.0));
        return out;
    };
    const EvolutionResult found = evolve(
        [&](std::span<const double> x) {
            const StepTrial trial = problem.run(prescribed(lengths_of(x)));
            // More steps than requested, because the last was repeated, are no gain.
            const double more =
                std::max(0.0, static_cast<double>(trial.steps) / static_cast<double>(count) - 1);
            return std::log(std::max(trial.error, 1e-12)) + 10 * more + (trial.ended ? 0 : 10);
        },
        start, {.spread = 0.6, .seed = seed, .max_evaluations = evaluations, .threads = threads},
        [&](const EvolutionProgress& p) {
            return !watch ||
                   watch(static_cast<double>(p.evaluations) / static_cast<double>(evaluations));
        });
    SearchedSteps out{.lengths = lengths_of(found.x), .trial = {}};
    out.trial = problem.run(prescribed(out.lengths));
    return out;
}

}  // namespace ricochet::learn
