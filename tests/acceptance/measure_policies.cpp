#include "measure_policies.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string>

#include "ricochet/detail/step_environment.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/learn/policies.hpp"

namespace ricochet::bench {

namespace {

using learn::StepEnvironment;
using learn::StepEnvironmentOptions;
using learn::StepTrial;

StepEnvironment environment_of(const StepEnvironmentOptions& options, int elements = 1)
{
    return learn::step_environment(StrikeSlipFault({.elements = elements}), 30, options);
}

/// Assessment of runs: until rest, without an error estimate.
StepEnvironmentOptions judged(StepEnvironmentOptions options)
{
    options.until_rest = true;
    options.max_attempts = 5000;
    return options;
}

StepTrial constant_steps(const StepEnvironmentOptions& options, double h)
{
    StepEnvironmentOptions plain = judged(options);
    plain.estimate = ErrorEstimate::none;
    const StepEnvironment runs = environment_of(plain);
    std::array<double, 9> observation{};
    runs.environment.reset(0, observation);
    const double action = runs.action_of(h);
    for (;;) {
        const learn::Reaction reaction = runs.environment.step({&action, 1}, observation);
        if (reaction.terminal || reaction.truncated) return runs.trial();
    }
}

/// The iterations with which constant steps of the same scheme reach the same error.
double iterations_of_constant_steps(const StepEnvironmentOptions& options, double error)
{
    for (double h = 1.5; h > 0.01; h *= 0.97) {
        const StepTrial trial = constant_steps(options, h);
        if (trial.ended && trial.error <= error) return trial.work;
    }
    return std::nan("");
}

struct Learned {
    StepTrial trial;
    double gain = 0;  ///< iterations of constant steps over its own, at its error
};

Learned learn_by(const std::string& name, const StepEnvironmentOptions& options, double discount,
                 Measured& out)
{
    const learn::TrainedPolicy trained = learn::train_tqc(
        environment_of(options).environment, {.training = {.steps = 10'000, .discount = discount}});
    const auto told = [&](int elements) {
        const StepTrial trial =
            learn::follow(environment_of(judged(options), elements), trained.policy);
        out.details.push_back(fmt::format(
            "{}, {} x {}: {} attempts, {} solves, {} iterations, velocity off by {:.3g}, slip "
            "by {:.3g}{}",
            name, elements, elements, trial.steps + trial.rejected, trial.solves, trial.iterations,
            trial.error, trial.final_error, trial.ended ? "" : "; does not come to the end"));
        return trial;
    };
    Learned result{.trial = told(1)};
    (void)told(10);
    if (result.trial.ended) {
        result.gain = iterations_of_constant_steps(options, result.trial.error) / result.trial.work;
    }
    return result;
}

}  // namespace

Measured tqc_by_both_rewards()
{
    Measured out;
    const Learned published =
        learn_by("equation 7", learn::published_step_environment(2), 0.99, out);
    const Learned additive = learn_by("additive",
                                      {.reward = learn::StepReward::additive,
                                       .lambda = 1000,
                                       .h_min = 0.03,
                                       .h_max = 1.5,
                                       .until_rest = true},
                                      1, out);
    out.pass = published.trial.ended && additive.trial.ended &&
               additive.trial.error < published.trial.error;
    out.text = fmt::format(
        "velocity off by {:.3g} and {:.3g}, slip by {:.3g} and {:.3g}; iterations of constant "
        "steps at that error over their own: {:.2f} and {:.2f}",
        published.trial.error, additive.trial.error, published.trial.final_error,
        additive.trial.final_error, published.gain, additive.gain);
    return out;
}

}  // namespace ricochet::bench
