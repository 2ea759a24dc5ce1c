// The command line `ricochet`.
//
// Exit status: 0 fine; 1 a run or training that ended otherwise than hoped (its
// result is printed all the same) or a file that could not be written in the end;
// 2 bad input: one sentence on standard error, nothing printed, nothing written;
// 130 and 143 a run or comparison ended by a signal, its result printed as incomplete.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "certify.hpp"
#include "compare.hpp"
#include "files.hpp"
#include "input.hpp"
#include "inspect.hpp"
#include "rate_and_state.hpp"
#include "report.hpp"
#include "ricochet/nn/safetensors.hpp"
#include "simulate.hpp"
#include "step_control_compare.hpp"
#include "step_policy.hpp"
#include "systems.hpp"
#include "train.hpp"

namespace ricochet::app {

namespace {

/// An option with a finite number.
void add_number(CLI::App& command, const std::string& option, std::optional<double>& out,
                const std::string& value, const std::string& help)
{
    command
        .add_option_function<std::string>(
            option, [&out, option](const std::string& text) { out = number(option, text); }, help)
        ->type_name(value);
}

/// An option with a whole number in [lowest, highest].
template <class Number>
void add_whole_number(CLI::App& command, const std::string& option, std::optional<Number>& out,
                      std::uint64_t lowest, std::uint64_t highest, const std::string& help)
{
    command
        .add_option_function<std::string>(
            option,
            [&out, option, lowest, highest](const std::string& text) {
                out = whole_number(option, text, lowest, highest);
            },
            help)
        ->type_name("N");
}

template <class Text>
CLI::Option* add_text(CLI::App& command, const std::string& option, std::optional<Text>& out,
                      const std::string& value, const std::string& help)
{
    return command
        .add_option_function<std::string>(
            option, [&out](const std::string& text) { out = text; }, help)
        ->type_name(value);
}

void add_system(CLI::App& command, std::string& out)
{
    command.add_option("SYSTEM", out, "its name; `ricochet systems` lists them")
        ->required()
        ->type_name("");
}

void add_systems(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand("systems", "List the systems and their parameters");
    auto json = std::make_shared<bool>(false);
    command.add_flag("--json", *json, "print JSON");
    command.footer("Example:\n  ricochet systems");
    command.callback([&status, json] { status = list_systems(*json); });
}

void add_simulate(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand("simulate", "Run a system and print its events");
    auto request = std::make_shared<SimulateRequest>();
    RunRequest& run = request->run;
    add_system(command, request->system);
    command.add_option("--set", run.set, "a parameter of the system; may be repeated")
        ->type_name("name=value ...");
    add_number(command, "--t-start", run.t_start, "T",
               "time at the start [s], default: the system's");
    add_number(command, "--t-end", run.t_end, "T",
               "time at the end [s], default: the system's; before the start: backward in time");
    add_text(command, "--mode", run.mode, "NAME",
             "mode at the start, where the system has modes; default: the system's");
    add_text(command, "--detector", run.detector, "NAME",
             "ends, extremum (default), bernstein, network (default with --model), line, verified, "
             "certified or calibrated");
    add_text(command, "--gate", run.gate, "NAME",
             "how far a model that clears several steps is trusted: verified (not at all), "
             "certified (where it has been proved right) or calibrated (by name only: events may "
             "be missed, see inspect)");
    add_text(command, "--model", run.model, "FILE",
             "network to use, by path or name; default: one that suits");
    add_text(command, "--locator", run.locator, "NAME", "newton (default), bisection or toms748");
    add_text(command, "--stepper", run.stepper, "NAME",
             "rk4 (default with --step), dopri5 (default without), fehlberg78, cash-karp54 or "
             "euler");
    add_number(command, "--step", run.step, "H", "take fixed steps of H [s]");
    add_text(command, "--integrator", run.integrator, "NAME",
             "of set-valued systems: handover (default), event, bathe or time-stepping");
    add_text(command, "--controller", run.controller, "NAME",
             "of the steps of bathe: constant (default), error, heuristic, pi, filter or learned "
             "(by --model, default: the system's own policy)");
    add_number(command, "--rtol", run.rtol, "R", "relative error allowed in a step, default 1e-8");
    add_number(command, "--atol", run.atol, "A", "absolute error allowed in a step, default 1e-10");
    add_number(command, "--event-tolerance", run.event_tolerance, "T",
               "width to which events are located [s], default: neighbouring doubles");
    add_whole_number(command, "--max-steps", run.max_steps, 1,
                     std::numeric_limits<std::uint64_t>::max(),
                     "end the run after N steps, as step_limit; default 10 million");
    add_whole_number(
        command, "--samples", request->samples, 2, 10'000'000,
        "points of the trajectory in --csv and --plot, default 1001, and in --json if given");
    command.add_flag("--json", request->json, "print JSON");
    add_text(command, "--csv", request->csv, "FILE", "write the sampled trajectory");
    add_text(command, "--plot", request->plot, "FILE", "draw it with gnuplot, as .svg or .png");
    add_text(command, "--kernel", request->kernel, "FILE",
             "of fault: stresses for slip, a .npy file [1/km], in place of the medium's");
    command.footer(
        "Examples:\n"
        "  ricochet simulate bouncing-ball --set restitution=0.8 --plot ball.svg\n"
        "  ricochet simulate bouncing-ball --detector network --step 0.01 --json\n"
        "  ricochet simulate thermostat --mode on --t-end 5\n"
        "  ricochet simulate spring-slider --set ratio=0.4 --plot stick-slip.svg\n\n"
        "Why a step is taken to hold no event:\n"
        "  proved    a bound, or the polynomial of the step (bernstein), excludes it\n"
        "  checked   the ends and the turning points of the guard were looked at (extremum)\n"
        "  gated     a calibrated network skipped the check, within its miss rate\n"
        "  assumed   only the ends were looked at (ends), or a network was believed\n"
        "A late event was found at a step after the one that held it.");
    command.callback([&status, request] {
        status = request->system == spring_slider_name ? simulate_spring_slider(*request)
                                                       : simulate(*request);
    });
}

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
    command.add_flag("--resume", training.resume, "go on from the checkpoint");
    command.add_flag("--allow-misses", request->allow_misses,
                     "write the model even if it misses events");
    command.add_flag("--json", request->json, "print the report as JSON");
    add_number(command, "--seconds", policy->seconds, "S", "of a step policy: stop then [s]");
    add_whole_number(command, "--threads", policy->threads, 1, 64, "of a step policy, default 2");
    command
        .add_option("--trainer", policy->trainer,
                    "of a step policy: evolution (default; the true cost), or tqc or td3 with the "
                    "published reward")
        ->type_name("NAME");
    add_number(command, "--alpha", policy->alpha, "A",
               "of the published reward: weight of the error, default 2");
    command.footer(
        "Examples:\n"
        "  ricochet train bouncing-ball --out ball.safetensors\n"
        "  ricochet train step-policy fault --out steps.safetensors");
    command.callback([&status, request, policy] {
        status = request->system == step_policy_name ? train_policy(policy_of(*request, *policy))
                                                     : train(event_network(*request, *policy));
    });
}

void add_inspect(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand("inspect", "Print what a model file is");
    auto request = std::make_shared<InspectRequest>();
    command.add_option("MODEL", request->model, "by path, or the name of one that comes along")
        ->required()
        ->type_name("");
    command.add_flag("--json", request->json, "print JSON");
    command.footer("Example:\n  ricochet inspect bouncing-ball");
    command.callback([&status, request] { status = inspect(*request); });
}

void add_certify(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand(
        "certify", "Prove that where a model clears, its guard is above a margin");
    auto request = std::make_shared<CertifyRequest>();
    command.add_option("MODEL", request->model, "by path, or the name of one that comes along")
        ->required()
        ->type_name("");
    add_number(command, "--margin", request->margin, "G",
               "to be proved, in units of the guard; default 0");
    add_whole_number(command, "--levels", request->levels, 1, 32,
                     "margins that grow by --ratio, each with a threshold; default 1");
    add_number(command, "--ratio", request->ratio, "R", "between margins, default 2");
    command.add_flag("--keep-threshold", request->keep_threshold,
                     "prove the stored threshold; else the highest that can be is looked for");
    add_number(command, "--limit", request->limit, "S",
               "begin nothing that takes longer by estimate [s], default 300");
    add_number(command, "--time-limit", request->time_limit, "S",
               "stop then [s], with a checkpoint; default: never");
    add_number(command, "--smallest", request->smallest, "W",
               "edge that is not cut further, as a share of the domain's; default 1/1024");
    add_whole_number(command, "--max-unproved", request->max_unproved, 0, 100'000,
                     "boxes that may be listed as unproved, default 256");
    add_whole_number(command, "--threads", request->threads, 1, 64, "default 2");
    command.add_option("--out", request->out, "the certified model, default: the model's own file")
        ->type_name("FILE");
    command
        .add_option("--checkpoint", request->checkpoint,
                    "where an interrupted proof is kept, default MODEL.checkpoint")
        ->type_name("FILE");
    command.add_flag("--resume", request->resume, "go on from the checkpoint");
    command.add_flag("--json", request->json, "print the result as JSON");
    command.footer("Example:\n  ricochet certify room.safetensors --margin 0.05 --levels 4");
    command.callback([&status, request] { status = certify(*request); });
}

void add_compare(CLI::App& app, int& status)
{
    CLI::App& command =
        *app.add_subcommand("compare", "Compare the detectors with known event times");
    auto request = std::make_shared<CompareRequest>();
    add_system(command, request->system);
    command.add_option("--set", request->set, "a parameter of the system; may be repeated")
        ->type_name("name=value ...");
    command.add_flag("--json", request->json, "print JSON");
    add_text(command, "--csv", request->csv, "FILE", "write the event times");
    auto of = std::make_shared<std::optional<std::string>>();
    add_text(command, "--system", *of, "NAME",
             "of step-control: sliding-mode, diode-circuit or fault; default: all of them");
    command.footer(
        "Examples:\n"
        "  ricochet compare bouncing-ball\n"
        "  ricochet compare thermostat --set low=19\n"
        "  ricochet compare rate-and-state     (the tables of a published study; a minute)\n"
        "  ricochet compare step-control --system fault");
    command.callback([&status, request, of] {
        if (request->system == step_control_name) {
            status = compare_step_control(*request, of->value_or(""));
            return;
        }
        if (*of) throw BadInput("--system is of compare step-control");
        status = request->system == rate_and_state_name ? compare_rate_and_state(*request)
                                                        : compare(*request);
    });
}

/// One thing that was typed where a value or a name belongs.
void check_value(std::string_view of, std::string_view value)
{
    constexpr std::size_t longest = 4096;  // of a path
    if (value.find_first_not_of(" \t\n") == std::string_view::npos) {
        throw BadInput(fmt::format("{} needs a value, got '{}'", of, value));
    }
    if (value.size() > longest) {
        throw BadInput(
            fmt::format("{} is longer than any value may be: {} characters", of, value.size()));
    }
}

/// All values of a command, before anything is made of them: every option that takes one has one,
/// once (but --set, which may be repeated); none is empty, or the option that follows.
void check_values(const CLI::App& command, const std::vector<std::string>& arguments)
{
    std::set<std::string> given;
    for (std::size_t i = 0; i < arguments.size(); ++i) {
        const std::string& argument = arguments[i];
        const std::size_t equals = argument.find('=');
        const std::string name = argument.substr(0, equals);
        const CLI::Option* option =
            name.starts_with("--") ? command.get_option_no_throw(name) : nullptr;
        if (option == nullptr) {
            check_value("an argument", argument);
            continue;
        }
        if (name != "--set" && !given.insert(name).second) {
            throw BadInput(fmt::format("{} is given twice", name));
        }
        if (option->get_items_expected_min() == 0) {
            if (equals != std::string::npos) {
                throw BadInput(fmt::format("{} takes no value, got '{}'", name,
                                           shortened(argument.substr(equals + 1))));
            }
        } else if (equals != std::string::npos) {
            check_value(name, std::string_view(argument).substr(equals + 1));
        } else if (i + 1 == arguments.size()) {
            throw BadInput(fmt::format("{} needs a value, got none", name));
        } else if (arguments[i + 1].starts_with("--")) {
            throw BadInput(
                fmt::format("{0} needs a value, got the option {1}; a value of that name "
                            "is written {0}={1}",
                            name, shortened(arguments[i + 1])));
        } else {
            check_value(name, arguments[++i]);
        }
    }
}

/// A first word that is no command gets a sentence of its own.
void check_command(const CLI::App& app, int count, char** arguments)
{
    std::vector<std::string> names;
    for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
    const std::vector<std::string_view> known(names.begin(), names.end());
    if (count < 2) {
        throw BadInput(fmt::format("a command is needed, one of {}; --help tells more",
                                   fmt::join(known, ", ")));
    }
    const std::string first = arguments[1];
    if (first.starts_with('-')) return;
    if (std::find(names.begin(), names.end(), first) == names.end()) {
        throw unknown("command", first, known);
    }
}

int run(int count, char** arguments)
{
    CLI::App app("Simulate hybrid systems: smooth motion, events, resets", "ricochet");
    app.set_version_flag("--version", "ricochet " RICOCHET_VERSION);
    app.require_subcommand(1);
    app.footer(
        "Example:\n  ricochet simulate bouncing-ball\n\n"
        "Exit status: 0 fine, 1 a run that ended early or a file that could not be written,\n"
        "2 bad input, 130 or 143 interrupted: the result so far is printed, as incomplete.");
    int status = 0;
    add_systems(app, status);
    add_simulate(app, status);
    add_train(app, status);
    add_inspect(app, status);
    add_certify(app, status);
    add_compare(app, status);

    check_command(app, count, arguments);
    const std::string first = arguments[1];
    if (!first.starts_with('-')) {
        check_values(*app.get_subcommand(first), {arguments + 2, arguments + count});
    }
    try {
        app.parse(count, arguments);
    } catch (const CLI::Success& success) {  // --help, --version
        return app.exit(success);
    } catch (const CLI::ParseError& error) {
        throw BadInput(error.what());
    }
    return status;
}

int fail(int status, std::string_view sentence)
{
    fmt::print(stderr, "ricochet: {}\n", printable(sentence));
    return status;
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    using namespace ricochet::app;
    // A file or a pipe that takes no more is an error like any other: what else there is to write
    // still is.
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
    try {
        return run(count, arguments);
    } catch (const BadInput& error) {
        return fail(2, error.what());
    } catch (const ricochet::ModelError& error) {
        return fail(2, error.what());
    } catch (const std::invalid_argument& error) {
        return fail(2, error.what());
    } catch (const std::bad_alloc&) {
        return fail(1, "there is not enough memory for this");
    } catch (const std::exception& error) {
        return fail(1, error.what());
    }
}
