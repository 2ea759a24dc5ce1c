#include "step_policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include "files.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "json_text.hpp"
#include "keep_model.hpp"
#include "progress_bar.hpp"
#include "report.hpp"
#include "run_watch.hpp"
#include "say.hpp"
#include "timing.hpp"
#include "train.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t held_out = 1'000'003;  // added to a seed, for other problems

std::string table(const std::vector<learn::StepScore::Part>& parts, bool judges_final)
{
    std::string out = fmt::format("{:<8}{:>12}{:>8}{}{:>10}\n", "group", "tolerance", "gain",
                                  judges_final ? fmt::format("{:>10}", "final") : "", "error");
    for (const auto& part : parts) {
        out += fmt::format("{:<8}{:>12}{:>8.2f}{}{:>10.2f}\n", part.group, part.tolerance,
                           std::exp(part.gain),
                           judges_final ? fmt::format("{:>10.2f}", std::exp(part.final_gain)) : "",
                           std::exp(part.off));
    }
    return out +
           "gain: work of the best classical rule over that of the policy, at the true error "
           "reached;\n" +
           (judges_final ? "final: the same at the final error; group: elements per side; " : "") +
           "error: over that of the free estimate's rule at that tolerance\n";
}

Json rows(const std::vector<learn::StepScore::Part>& parts, bool judges_final)
{
    Json out = Json::array();
    for (const auto& part : parts) {
        out.push_back({{"group", part.group},
                       {"tolerance", part.tolerance},
                       {"gain", std::exp(part.gain)},
                       {"error_ratio", std::exp(part.off)},
                       {"failed", part.failed}});
        if (judges_final) out.back()["final_gain"] = std::exp(part.final_gain);
    }
    return out;
}

learn::TrainedStepPolicy trained_policy(const learn::StepFamily& family,
                                        const learn::StepTrainingOptions& options)
{
    return train_under_bar(options.resume, [&](const auto& show) {
        return learn::train_step_policy(
            family, options, [&](const learn::EvolutionProgress& progress) {
                return show({.iteration = std::min(progress.evaluations, options.evaluations),
                             .total = options.evaluations,
                             .loss = progress.best,
                             .seconds = progress.seconds});
            });
    });
}

}  // namespace

learn::StepFamily step_family(const std::string& system, std::uint64_t seed)
{
    const std::vector<std::string_view> known{"fault", "sliding-mode", "diode-circuit"};
    if (system == known[0]) return learn::fault_family({.seed = seed});
    if (system == known[1]) return learn::sliding_mode_family(seed);
    if (system == known[2]) return learn::diode_circuit_family(seed);
    throw unknown("system for a step policy", system, known);
}

fs::path checked_checkpoint(const TrainPolicyRequest& request)
{
    if (request.seconds && !(*request.seconds > 0)) {
        throw BadInput(fmt::format("--seconds must be positive, got {}", *request.seconds));
    }
    fs::path checkpoint = request.checkpoint;
    claim_training(request.out, checkpoint, request.resume);
    return checkpoint;
}

int train_policy(const TrainPolicyRequest& request)
{
    if (!request.trainer.empty() && request.trainer != "evolution") return train_actor(request);
    if (request.alpha) throw BadInput("--alpha is of --trainer tqc and td3");
    const std::uint64_t seed = request.seed.value_or(1);
    learn::StepTrainingOptions options{.seed = seed,
                                       .checkpoint = checked_checkpoint(request),
                                       .resume = request.resume,
                                       .goes_on = [] { return !Interrupts::any(); }};
    if (request.evaluations) options.evaluations = *request.evaluations;
    if (request.seconds) options.seconds = *request.seconds;
    if (request.threads) options.threads = *request.threads;
    const RunWatch watch(0.5);  // a generation, and the assessment at the end, may take long
    const learn::StepFamily family = step_family(request.system, seed);
    const learn::TrainedStepPolicy trained = trained_policy(family, options);
    const bool stopped = trained.search.outcome == learn::EvolutionOutcome::stopped;
    if (stopped) {
        say_what_is_kept(options.checkpoint, trained.search.checkpoint_trouble);
        return 1;
    }
    if (!std::isfinite(trained.search.score)) {
        say("ricochet: {}, and no model was written\n", describe(trained.search.outcome));
        return 1;
    }
    keep_model(trained.model, request.out, options.checkpoint);
    std::error_code ignored;
    if (request.checkpoint.empty()) fs::remove(options.checkpoint, ignored);
    const learn::StepFamily others = step_family(request.system, seed + held_out);
    const learn::StepScore score(others, options.threads);
    const auto parts = score.parts({.policy = std::make_shared<const StepPolicy>(trained.model)});
    if (request.json) {
        print(json_text({{"system", request.system},
                         {"seed", seed},
                         {"score", trained.search.score},
                         {"evaluations", trained.search.evaluations},
                         {"seconds", trained.search.seconds},
                         {"held_out", rows(parts, family.judges_final)},
                         {"model", request.out.string()}}));
    } else {
        print(fmt::format("{} evaluations in {}, score {:.4f} on {} problems; {} problems held "
                          "out:\n",
                          trained.search.evaluations, duration(trained.search.seconds),
                          trained.search.score, family.problems.size(), others.problems.size()) +
              table(parts, family.judges_final));
    }
    say("ricochet: the model is in '{}'\n", request.out.string());
    return 0;
}

}  // namespace ricochet::app
