// The command line `ricochet`: `systems`, `simulate`, `inspect` and `compare`, which need the core
// only. Everything else is done by further programs, `ricochet-<name>`, that stand beside it.
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

#include "inspect.hpp"
#include "options.hpp"
#include "program.hpp"
#include "registry.hpp"
#include "systems.hpp"

namespace ricochet::app {

namespace {

char** all_arguments = nullptr;  ///< of main, for the programs that take its place

/// A program takes the place of this one. Returns only by an exception.
/// @param arguments  its own, from the first on
int run_instead(std::string_view name, char** arguments)
{
    const std::string program = fmt::format("ricochet-{}", name);
    const std::filesystem::path here = std::filesystem::read_symlink("/proc/self/exe");
    std::string file = (here.parent_path() / program).string();
    arguments[-1] = file.data();
    execv(file.c_str(), arguments - 1);
    throw std::runtime_error(fmt::format("'{}' cannot be run: {}; it is built by the target ricochet_{}",
                                         file, std::strerror(errno), name));
}

int simulate_here_or_there(const SimulateRequest& request)
{
    const SystemEntry& system = find_system(request.system);
    return system.program.empty() ? simulate(request)
                                  : run_instead(system.program, all_arguments + 1);
}

int compare_here_or_there(const CompareRequest& request)
{
    for (const std::string_view study : {"fault", "rate-and-state", "step-control"}) {
        if (request.system == study) return run_instead("studies", all_arguments + 1);
    }
    return compare(request);
}

void add_systems(CLI::App& app, int& status)
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
    command.callback([&status, format] { status = list_systems(*format); });
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

/// Commands that are programs, with what the list of commands says of them.
struct Program {
    std::string_view name;
    std::string_view meaning;
};
constexpr std::array<Program, 2> programs{
    {{"train", "Train a network that predicts events, or one that chooses steps"},
     {"certify", "Prove that where a model clears, its guard is above a margin"}}};

void add_commands(CLI::App& app, int& status)
{
    const auto add_program = [&app](const Program& program) {
        app.add_subcommand(std::string(program.name), std::string(program.meaning));
    };
    add_systems(app, status);
    add_simulate(app, status, simulate_here_or_there);
    add_program(programs[0]);
    add_inspect(app, status);
    add_program(programs[1]);
    add_compare(app, status, compare_here_or_there);
}

int run(int count, char** arguments)
{
    all_arguments = arguments;
    for (const Program& program : programs) {
        if (count < 2 || arguments[1] != program.name) continue;
        return run_program([&](CLI::App&, int&) { run_instead(program.name, arguments + 2); },
                           count, arguments);
    }
    return run_program(add_commands, count, arguments);
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    return ricochet::app::run(count, arguments);
}
