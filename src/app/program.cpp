#include "program.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <limits>
#include <memory>
#include <new>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "core/detect/named_detectors.hpp"
#include "joined.hpp"
#include "options.hpp"
#include "report.hpp"
#include "ricochet/nn/model.hpp"
#include "say.hpp"

namespace ricochet::app {

namespace {

/// Checks one argument that was typed as a value or a name.
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

/// Checks all values of a command before they are used: every option that takes a value has exactly
/// one (except --set, --vary and --grid, which may be repeated), and none is empty or the next
/// option.
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
        const bool repeats = name == "--set" || name == "--vary" || name == "--grid";
        if (!repeats && !given.insert(name).second) {
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

/// A first word that is no command is refused with its own sentence.
void check_command(const CLI::App& app, int count, char** arguments)
{
    std::vector<std::string> names;
    for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
    const std::vector<std::string_view> known(names.begin(), names.end());
    if (count < 2) {
        throw BadInput(
            fmt::format("a command is needed, one of {}; --help tells more", joined(known, ", ")));
    }
    const std::string first = arguments[1];
    if (first.starts_with('-')) return;
    if (std::find(names.begin(), names.end(), first) == names.end()) {
        throw unknown("command", first, known);
    }
}

int run(const AddCommands& add, int count, char** arguments)
{
    CLI::App app("Simulate hybrid systems: smooth motion, events, resets", "ricochet");
    app.set_version_flag("--version", "ricochet " RICOCHET_VERSION);
    app.require_subcommand(1);
    app.footer(
        "Example:\n  ricochet simulate bouncing-ball\n\n"
        "Exit status: 0 fine, 1 a run that ended early or a file that could not be written,\n"
        "2 bad input, 129, 130 or 143 interrupted: the result so far is printed, as incomplete.");
    int status = 0;
    add(app, status);

    check_command(app, count, arguments);
    const std::string first = arguments[1];
    if (!first.starts_with('-')) {
        check_values(*app.get_subcommand(first), {arguments + 2, arguments + count});
    }
    try {
        app.parse(count, arguments);
    } catch (const CLI::Success& success) {  // --help, --version
        std::ostringstream text;
        const int code = app.exit(success, text);
        print(text.str());
        return code;
    } catch (const CLI::ParseError& error) {
        throw BadInput(error.what());
    }
    return status;
}

int fail(int status, std::string_view sentence)
{
    say("ricochet: {}\n", printable(sentence));
    return status;
}

}  // namespace

void add_systems(CLI::App& app, int& status, SystemsHandler handler)
{
    CLI::App& command = *app.add_subcommand("systems", "List the systems and their parameters");
    auto format = std::make_shared<ListFormat>(ListFormat::text);
    CLI::Option* json = command.add_flag_callback(
        "--json", [format] { *format = ListFormat::json; }, "print JSON");
    command
        .add_flag_callback(
            "--markdown", [format] { *format = ListFormat::markdown; }, "print docs/systems.md")
        ->excludes(json);
    command.footer("Example:\n  ricochet systems");
    command.callback([&status, format, handler] { status = handler(*format); });
}

void add_inspect(CLI::App& app, int& status, InspectHandler handler)
{
    CLI::App& command = *app.add_subcommand("inspect", "Print what a model file is");
    auto request = std::make_shared<InspectRequest>();
    command.add_option("MODEL", request->model, "by path, or the name of one that comes along")
        ->required()
        ->type_name("");
    command.add_flag("--json", request->json, "print JSON");
    command.footer("Example:\n  ricochet inspect bouncing-ball");
    command.callback([&status, request, handler] { status = handler(*request); });
}

void add_program(CLI::App& app, std::string_view name, std::string_view meaning)
{
    app.add_subcommand(std::string(name), std::string(meaning));
}

void add_run_options(CLI::App& command, RunRequest& run)
{
    command.add_option("--set", run.set, "a parameter of the system; may be repeated")
        ->type_name("name=value ...");
    add_number(command, "--t-start", run.t_start, "T",
               "time at the start [s], default: the system's");
    add_number(command, "--t-end", run.t_end, "T",
               "time at the end [s], default: the system's; before the start: backward in time");
    add_text(command, "--mode", run.mode, "NAME",
             "mode at the start, where the system has modes; default: the system's");
    add_text(command, "--detector", run.detector, "NAME",
             "extremum (default), another of " + ricochet::detail::spelled_detectors() +
                 ", network (default with --model), line, verified, certified or calibrated");
    add_text(command, "--gate", run.gate, "NAME",
             "how far a model that clears several steps is trusted: verified (not at all), "
             "certified (where it has been proved right) or calibrated (by name only: events may "
             "be missed, see inspect); network: the detector of that name");
    add_text(command, "--model", run.model, "FILE",
             "network to use, by path or name; default: one that suits");
    add_text(command, "--locator", run.locator, "NAME", "newton (default), bisection or toms748");
    add_text(command, "--stepper,--method", run.stepper, "NAME",
             "rk4 (default with --step), dopri5 (default without), another of " +
                 ricochet::detail::spelled_methods(false) +
                 " or, where ricochet systems says so, taylor");
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
                     "end the run after N steps, as step_limit; default 2 million");
}

void add_simulate(CLI::App& app, int& status, SimulateHandler handler)
{
    CLI::App& command = *app.add_subcommand("simulate", "Run a system and print its events");
    auto request = std::make_shared<SimulateRequest>();
    add_system(command, request->system,
               "a system's name, see `ricochet systems`, a scene file (.json) or an FMU (.fmu)");
    add_run_options(command, request->run);
    add_whole_number(
        command, "--samples", request->samples, 2, 10'000'000,
        "points of the trajectory in --csv and --plot, default 1001, and in --json if given");
    command.add_flag("--json", request->json, "print JSON");
    add_text(command, "--csv", request->csv, "FILE", "write the sampled trajectory");
    add_text(command, "--plot", request->plot, "FILE", "draw it with gnuplot, as .svg or .png");
    add_text(command, "--phase", request->phase, "U,V",
             "draw the component V of the state over U instead of all over time");
    add_text(command, "--kernel", request->kernel, "FILE",
             "of fault: stresses for slip, a .npy or .safetensors file [1/km], in place of the "
             "medium's");
    command.footer(
        "Examples:\n"
        "  ricochet simulate bouncing-ball --set restitution=0.8 --plot ball.svg\n"
        "  ricochet simulate bouncing-ball --detector network --step 0.01 --json\n"
        "  ricochet simulate thermostat --mode on --t-end 5\n"
        "  ricochet simulate stick-slip --plot cycle.svg --phase u,v\n"
        "  ricochet simulate spring-slider --set ratio=0.4 --plot stick-slip.svg\n\n"
        "Why a step is taken to hold no event:\n"
        "  proved    a bound, or the polynomial of the step (bernstein), excludes it\n"
        "  checked   the guard was evaluated at the ends and the turning points (extremum)\n"
        "  gated     a calibrated network skipped the check, within its miss rate\n"
        "  assumed   the guard was evaluated at the ends only (ends), or a network predicted no "
        "event\n"
        "A late event was found at a step after the one that held it.");
    command.callback([&status, request, handler] { status = handler(*request); });
}

void add_compare(CLI::App& app, int& status, CompareHandler handler)
{
    CLI::App& command =
        *app.add_subcommand("compare", "Compare the detectors with known event times");
    auto request = std::make_shared<CompareRequest>();
    add_system(command, request->system);
    command.add_option("--set", request->set, "a parameter of the system; may be repeated")
        ->type_name("name=value ...");
    command.add_flag("--json", request->json, "print JSON");
    add_text(command, "--csv", request->csv, "FILE", "write the event times");
    add_text(command, "--system", request->of, "NAME",
             "of step-control: sliding-mode, diode-circuit or fault; default: all of them");
    command.footer(
        "Examples:\n"
        "  ricochet compare bouncing-ball\n"
        "  ricochet compare thermostat --set low=19\n"
        "  ricochet compare rate-and-state     (the tables of a published study; a minute)\n"
        "  ricochet compare step-control --system fault");
    command.callback([&status, request, handler] {
        if (request->of && request->system != "step-control") {
            throw BadInput("--system is of compare step-control");
        }
        status = handler(*request);
    });
}

namespace {

/// Opens those of standard input, output and error that are closed, so that no file of the command
/// takes their numbers and receives the printed output. Printing to an output that was closed still
/// fails.
void keep_standard_descriptors()
{
    for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
        if (fcntl(descriptor, F_GETFD) != -1 || errno != EBADF) continue;
        // The lowest free number is this one.
        const int flags = descriptor == STDOUT_FILENO ? O_RDONLY : O_RDWR;
        if (open("/dev/null", flags) != descriptor) return;
    }
}

}  // namespace

int run_program(const AddCommands& add, int count, char** arguments)
{
    // A file or a pipe that accepts no more is an error like any other: the remaining output is
    // still written.
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
    keep_standard_descriptors();
    try {
        return run(add, count, arguments);
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

int run_command(std::string_view command, const AddCommands& add, int count, char** arguments)
{
    std::vector<char*> all{arguments[0], const_cast<char*>(command.data())};
    all.insert(all.end(), arguments + std::min(count, 1), arguments + count);
    all.push_back(nullptr);
    return run_program(add, static_cast<int>(all.size()) - 1, all.data());
}

}  // namespace ricochet::app
