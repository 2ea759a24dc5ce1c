// `ricochet-train`: the program of `ricochet train`.
#include <fmt/format.h>

#include <limits>
#include <memory>
#include <string_view>
#include <utility>

#include "options.hpp"
#include "program.hpp"
#include "step_policy.hpp"
#include "train.hpp"

namespace ricochet::app {

namespace {

/// The request for a policy, from the options that both kinds of training have.
TrainPolicyRequest policy_of(const TrainRequest& request, TrainPolicyRequest policy)
{
    const TrainingRequest& t = request.training;
    const std::pair<bool, std::string_view> others[] = {{!t.kind.empty(), "--kind"},
                                                        {!t.set.empty(), "--set"},
                                                        {t.step.has_value(), "--step"},
                                                        {t.states.has_value(), "--states"},
                                                        {t.fresh_events.has_value(), "--fresh"},
                                                        {request.allow_misses, "--allow-misses"}};
    for (const auto& [given, option] : others) {
        if (given) throw BadInput(fmt::format("{} is not for a step policy", option));
    }
    if (policy.system.empty()) {
        throw BadInput(
            "a step policy is for a system: fault, sliding-mode or diode-circuit; got none");
    }
    policy.out = request.out;
    policy.checkpoint = t.checkpoint;
    policy.seed = t.seed;
    policy.evaluations = t.iterations;
    policy.resume = t.resume;
    policy.json = request.json;
    return policy;
}

const TrainRequest& event_network(const TrainRequest& request, const TrainPolicyRequest& policy)
{
    if (!policy.system.empty()) {
        throw BadInput(
            fmt::format("train takes one system, got {} and {}", request.system, policy.system));
    }
    if (policy.seconds || policy.threads || !policy.trainer.empty() || policy.alpha) {
        throw BadInput("--seconds, --threads, --trainer and --alpha are for a step policy");
    }
    return request;
}

/// Adds the options that are for a step policy alone.
void add_policy_options(CLI::App& command, TrainPolicyRequest& policy)
{
    add_number(command, "--seconds", policy.seconds, "S", "of a step policy: stop then [s]");
    add_whole_number(command, "--threads", policy.threads, 1, 64, "of a step policy, default 2");
    command
        .add_option("--trainer", policy.trainer,
                    "of a step policy: evolution (default; the true cost), or tqc or td3 with the "
                    "published reward")
        ->type_name("NAME");
    add_number(command, "--alpha", policy.alpha, "A",
               "of the published reward: weight of the error, default 2");
}

void add_train(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand(
        "train", "Train a network that predicts events, or one that chooses steps");
    auto request = std::make_shared<TrainRequest>();
    auto policy = std::make_shared<TrainPolicyRequest>();
    TrainingRequest& training = request->training;
    command.add_option("SYSTEM", request->system, "its name, or step-policy and its name")
        ->required()
        ->type_name("");
    command
        .add_option("OF", policy->system,
                    "after step-policy: fault, sliding-mode or "
                    "diode-circuit")
        ->type_name("");
    command.add_option("--out", request->out, "the model, a .safetensors file")
        ->required()
        ->type_name("FILE");
    command
        .add_option("--kind", training.kind,
                    "of the ball: fixed-step (default; as in the paper, for one step) or any-step "
                    "(dimensionless, for all); of other systems: gate (default; fixed steps) or "
                    "gate-adaptive (error control)")
        ->type_name("NAME");
    command.add_option("--set", training.set, "parameters that the network is for")
        ->type_name("name=value ...");
    add_number(command, "--step", training.step, "H", "step [s] of a network for fixed steps");
    add_whole_number(command, "--seed", training.seed, 0, std::numeric_limits<std::uint64_t>::max(),
                     "of sampling and training");
    add_whole_number(command, "--iterations", training.iterations, 1, 1'000'000'000,
                     "of the training; of a step policy: evaluations, or steps of tqc and td3");
    add_whole_number(command, "--states", training.states, 100, 100'000'000,
                     "sampled for training and testing");
    add_whole_number(command, "--fresh", training.fresh_events, 1, 100'000'000,
                     "fresh events for the report");
    command
        .add_option("--checkpoint", training.checkpoint,
                    "where an interrupted training is kept, default FILE.checkpoint")
        ->type_name("FILE");
    command.add_flag("--resume", training.resume, "continue from the checkpoint");
    command.add_flag("--allow-misses", request->allow_misses,
                     "write the model even if it misses events");
    command.add_flag("--json", request->json, "print the report as JSON");
    add_policy_options(command, *policy);
    command.footer(
        "Examples:\n"
        "  ricochet train bouncing-ball --out ball.safetensors\n"
        "  ricochet train step-policy fault --out steps.safetensors");
    command.callback([&status, request, policy] {
        status = request->system == step_policy_name ? train_policy(policy_of(*request, *policy))
                                                     : train(event_network(*request, *policy));
    });
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    using namespace ricochet::app;
    return run_command("train", add_train, count, arguments);
}
