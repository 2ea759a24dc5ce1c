#include "train.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "files.hpp"
#include "gates.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "json_text.hpp"
#include "keep_model.hpp"
#include "learn/checkpoint.hpp"
#include "progress_bar.hpp"
#include "registry.hpp"
#include "report.hpp"
#include "ricochet/nn/model.hpp"
#include "say.hpp"
#include "timing.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;

std::string text(std::string_view set, const learn::Assessment& a)
{
    const learn::Confusion& c = a.confusion;
    return fmt::format("{:<11}{:>9}{:>7}{:>13}{:>8}{:>11.1e}{:>11.1e}{:>8.4f}\n", set, c.detected,
                       c.missed, c.false_alarms, c.cleared, a.miss_bound, a.false_alarm_rate,
                       a.cleared_share);
}

std::string text(const learn::Report& report, const learn::Progress& last)
{
    std::string out = fmt::format(
        "{} iterations in {} on {} states; {} clear states too near the boundary were left out\n",
        report.iterations, duration(report.seconds), report.training_states, report.band);
    out += fmt::format("{:<11}{:>9}{:>7}{:>13}{:>8}{:>11}{:>11}{:>8}\n", "", "detected", "missed",
                       "false alarms", "cleared", "miss bound", "alarm rate", "share");
    out += text("validation", report.validation) + text("held out", report.held_out);
    if (report.fresh) out += text("fresh", *report.fresh);
    out += fmt::format(
        "miss bound: 95 % upper bound of the share of events missed; alarm rate: of the clear "
        "states;\nshare: cleared, of the clear states with a margin above {}\n",
        report.validation.margin);
    if (report.outcome == learn::TrainingOutcome::stopped) {
        out += fmt::format("interrupted after {} of {} iterations\n", last.iteration, last.total);
    }
    return out + fmt::format("{}\n", describe(report.outcome));
}

std::string_view kind_named(const SystemEntry& system, const std::vector<TrainingKind>& kinds,
                            std::string_view given)
{
    if (given.empty()) return kinds.front().name;
    std::vector<std::string_view> known;
    for (const TrainingKind& kind : kinds) {
        if (given == kind.name || given == kind.other_name) return kind.name;
        known.push_back(kind.name);
    }
    throw unknown(fmt::format("kind of network for {}", system.name), given, known);
}

/// @throws BadInput if the checkpoint to resume does not exist or is of another training.
template <class Train>
auto run_training(const Train& train, const TrainingRequest& request,
                  const learn::ProgressCallback& progress)
{
    bool samples = false;
    bool started = false;
    try {
        return train(request, [&](const learn::Progress& now) {
            samples = samples || now.iteration > 0;
            started = started || now.stage == learn::Progress{}.stage;
            return progress(now);
        });
    } catch (const std::runtime_error& error) {
        if (request.resume && !started) throw BadInput(error.what());
        throw;
    } catch (const std::invalid_argument& error) {
        // This is known only after sampling: the training fails, and the input is not refused.
        if (samples) throw std::runtime_error(error.what());
        throw;
    }
}

std::string json(const learn::Report& report, const fs::path& out, bool written)
{
    auto object = Json::parse(learn::to_json(report));
    object["model"] = written ? Json(out.string()) : Json();
    return json_text(object);
}

/// One sentence with the remedy.
std::string why_not_written(const learn::Report& report)
{
    return report.outcome == learn::TrainingOutcome::diverged
               ? fmt::format("{}, and no model was written", describe(report.outcome))
               : std::string(
                     "events are missed and no model was written; --allow-misses writes the model "
                     "all the same");
}

std::string text(const learn::GateReport& report)
{
    const learn::GateTrial& t = report.trial;
    std::string out = fmt::format(
        "{} iterations in {} on {} states, {} of them fatal, from runs with {} events\n",
        report.iterations, duration(report.seconds), report.training_states, report.fatal_states,
        report.events);
    out += fmt::format(
        "fresh runs: {} steps, {} events, {} missed: at most {:.1e} of them at 95 % confidence\n"
        "guard calls: {} instead of {}, {:.1f} times fewer; the network was asked {} times, {} of "
        "them outside of its box\n",
        t.steps, t.events, t.misses, t.miss_bound(), t.gated_calls, t.exact_calls, t.gain(),
        t.network_calls, t.outside);
    const std::string verdict = learn::describe(t.rivals);
    if (!verdict.empty()) out += verdict + '\n';
    return out + fmt::format("{}\n", describe(report.outcome));
}

/// The kind of gate to train; the first that the system has where none is given.
/// @throws BadInput for one that it does not have
std::string_view gate_kind(const SystemEntry& system, std::string_view given)
{
    const std::vector<std::string_view> kinds = gate_kinds(system.name);
    if (given.empty()) return kinds.front();
    const auto found = std::find(kinds.begin(), kinds.end(), given);
    if (found != kinds.end()) return *found;
    throw unknown(fmt::format("kind of network for {}", system.name), given, kinds);
}

/// Says that the model misses events and is not written, and where the checkpoint is, if any.
void say_not_written(const fs::path& checkpoint)
{
    say("ricochet: events are missed and no model was written; --allow-misses writes the "
        "model all the same, with its miss rate\n");
    std::error_code error;
    if (fs::exists(checkpoint, error)) {
        say("ricochet: the best is kept in '{}'; the same command with --resume "
            "--allow-misses writes it\n",
            checkpoint.string());
    }
}

/// Trains a gate, like `train`.
int train_gate(const SystemEntry& system, const TrainRequest& request)
{
    TrainingRequest training = request.training;
    training.kind = gate_kind(system, training.kind);
    const bool own_checkpoint = training.checkpoint.empty();
    claim_training(request.out, training.checkpoint, training.resume);
    ProgressBar bar;
    const Interrupts watch;
    const auto train_it = [&](const TrainingRequest& wanted,
                              const learn::ProgressCallback& progress) {
        // A checkpoint that cannot be read is refused before states are sampled.
        if (wanted.resume) (void)learn::load_gate_checkpoint(wanted.checkpoint);
        return train_system_gate(system, wanted, progress);
    };
    const learn::TrainedGate trained =
        run_training(train_it, training, [&](const learn::Progress& progress) {
            bar.show(progress);
            return !Interrupts::any();
        });
    bar.finish();

    const learn::GateReport& report = trained.report;
    if (report.outcome == learn::TrainingOutcome::stopped) {
        // Its misses have not been measured: there is no model yet.
        if (report.iterations > 0 || training.resume) {
            say_what_is_kept(training.checkpoint, report.checkpoint_trouble);
        } else {
            say("ricochet: interrupted before the training began; nothing is kept\n");
        }
        return 1;
    }
    const bool diverged = report.outcome == learn::TrainingOutcome::diverged;
    const bool write = !diverged && (report.trial.misses == 0 || request.allow_misses);
    deliver({[&] {
                 if (!write) return;
                 keep_model(trained.model, request.out, training.checkpoint);
                 std::error_code ignored;
                 if (own_checkpoint) fs::remove(training.checkpoint, ignored);
             },
             [&] {
                 if (!request.json) return print(text(report));
                 auto object = Json::parse(learn::to_json(report));
                 object["model"] = write ? Json(request.out.string()) : Json();
                 print(json_text(object));
             }});
    if (write) {
        say("ricochet: the model is in '{}'\n", request.out.string());
        return 0;
    }
    if (diverged) {
        say("ricochet: {}, and no model was written\n", describe(report.outcome));
        return 1;
    }
    say_not_written(training.checkpoint);
    return 1;
}

}  // namespace

int train(const TrainRequest& request)
{
    const SystemEntry& system = find_system(request.system);
    if (!gate_kinds(system.name).empty()) return train_gate(system, request);
    if (system.name != "bouncing-ball") {
        throw BadInput(fmt::format("there is no training for the system {}", system.name));
    }
    TrainingRequest training = request.training;
    training.kind = kind_named(system, ball_kinds(), training.kind);
    const bool own_checkpoint = training.checkpoint.empty();
    claim_training(request.out, training.checkpoint, training.resume);

    ProgressBar bar;
    learn::Progress last;
    const Interrupts watch;
    const learn::Trained trained =
        run_training(train_ball, training, [&](const learn::Progress& progress) {
            last = progress;
            bar.show(progress);
            return !Interrupts::any();
        });
    bar.finish();

    const learn::Report& report = trained.report;
    const bool stopped = Interrupts::any() && last.iteration < last.total;
    const bool diverged = report.outcome == learn::TrainingOutcome::diverged;
    const bool write = !diverged && (trained.misses_none() || request.allow_misses);
    deliver({[&] {
                 if (!write) return;
                 keep_model(trained.model, request.out, training.checkpoint);
                 std::error_code ignored;
                 if (own_checkpoint && !stopped) fs::remove(training.checkpoint, ignored);
             },
             [&] { print(request.json ? json(report, request.out, write) : text(report, last)); }});
    if (write) {
        say("ricochet: {} is in '{}'\n", stopped ? "the best so far" : "the model",
            request.out.string());
    } else {
        say("ricochet: {}\n", why_not_written(report));
    }
    std::error_code error;
    const bool kept = fs::exists(training.checkpoint, error);
    if (!write && !diverged && !stopped && kept) {
        say("ricochet: the best is kept in '{}'; the same command with --resume "
            "--allow-misses writes it\n",
            training.checkpoint.string());
    }
    if (stopped) {
        say_what_is_kept(training.checkpoint, report.checkpoint_trouble);
    }
    return write && !stopped ? 0 : 1;
}

}  // namespace ricochet::app
