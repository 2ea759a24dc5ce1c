#include "step_policy.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "files.hpp"
#include "input.hpp"
#include "json_text.hpp"
#include "keep_model.hpp"
#include "policy_advice.hpp"
#include "progress_bar.hpp"
#include "report.hpp"
#include "ricochet/learn_steps/policies.hpp"
#include "say.hpp"
#include "step_environment.hpp"
#include "timing.hpp"
#include "train.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;
using learn::PolicyOutcome;
using learn::StepEnvironment;
using learn::TrainedPolicy;

learn::PolicyTraining training_of(const TrainPolicyRequest& request)
{
    learn::PolicyTraining out{.seed = request.seed.value_or(1), .report_every = 200};
    if (request.evaluations) out.steps = *request.evaluations;
    if (request.threads) out.threads = *request.threads;
    if (request.seconds) out.max_seconds = *request.seconds;
    out.checkpoint = checked_checkpoint(request);
    out.resume = request.resume;
    return out;
}

TrainedPolicy trained_by(const std::string& trainer, const learn::Environment& environment,
                         const learn::PolicyTraining& training)
{
    return train_under_bar(training.resume, [&](const auto& show) {
        const auto progress = [&](const learn::PolicyProgress& now, const Model&) {
            return show({.iteration = now.step,
                         .total = now.steps,
                         .loss = now.critic_loss,
                         .seconds = now.seconds});
        };
        return trainer == "tqc" ? learn::train_tqc(environment, {.training = training}, progress)
                                : learn::train_td3(environment, {.training = training}, progress);
    });
}

Model named(Model actor, const std::string& system, double alpha, std::uint64_t seed,
            const StepEnvironment& runs)
{
    actor.kind = step_actor_kind;
    actor.system = system;
    actor.recipe = step_actor_recipe;
    actor.parameters = {{"alpha", alpha}};
    actor.seed = seed;
    actor.step_min = runs.length_of(-1);
    actor.step_max = runs.length_of(1);
    return actor;
}

}  // namespace

int train_actor(const TrainPolicyRequest& request)
{
    const std::vector<std::string_view> known{"evolution", "tqc", "td3"};
    if (request.trainer != known[1] && request.trainer != known[2]) {
        throw unknown("trainer", request.trainer, known);
    }
    const double alpha = request.alpha.value_or(2);
    const StepEnvironment runs =
        source_environment(request.system, learn::published_step_environment(alpha));
    const learn::PolicyTraining training = training_of(request);
    const TrainedPolicy trained = trained_by(request.trainer, runs.environment, training);
    if (trained.outcome == PolicyOutcome::stopped) {
        say_what_is_kept(training.checkpoint, trained.checkpoint_trouble);
        return 1;
    }
    if (!trained.message.empty()) {
        throw std::runtime_error(fmt::format("{}, and no model was written", trained.message));
    }
    const Model actor = named(trained.policy, request.system, alpha, training.seed, runs);
    keep_model(actor, request.out, training.checkpoint);
    std::error_code ignored;
    if (request.checkpoint.empty()) fs::remove(training.checkpoint, ignored);
    const learn::StepTrial run =
        learn::follow(source_environment(request.system, judged(actor)), actor);
    if (request.json) {
        print(json_text({{"system", request.system},
                         {"trainer", request.trainer},
                         {"alpha", alpha},
                         {"seed", training.seed},
                         {"trained_steps", trained.steps},
                         {"seconds", trained.seconds},
                         {"ended", run.ended},
                         {"steps", run.steps},
                         {"solves", run.solves},
                         {"iterations", run.iterations},
                         {"error", run.error},
                         {"final_error", run.final_error},
                         {"model", request.out.string()}}));
    } else {
        print(fmt::format(
            "{} steps of training in {}; its run of the same problem: {} steps, {} "
            "solves, {} iterations{}, error {:.2e} (relative L2 over time), {:.2e} "
            "at the end\n",
            trained.steps, duration(trained.seconds), run.steps, run.solves, run.iterations,
            run.ended ? "" : " without coming to the end", run.error, run.final_error));
    }
    say("ricochet: the model is in '{}'\n", request.out.string());
    return 0;
}

}  // namespace ricochet::app
