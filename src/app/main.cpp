// The command line `ricochet`: `systems`, `simulate`, `inspect` and `compare`, which need only the
// core. Further programs beside it, `ricochet-<name>`, execute all other
// commands.
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

#include "inspect.hpp"
#include "program.hpp"
#include "registry.hpp"
#include "systems.hpp"

namespace ricochet::app {

namespace {

constexpr std::string_view nonsmooth = "nonsmooth";
constexpr std::string_view scene = "scene";
constexpr std::string_view fmi = "fmi";

char** all_arguments = nullptr;  ///< of main, for the programs that replace it

/// Replaces this program by another one. Returns only by an exception.
/// @param arguments  those of the other program, from the first on
int run_instead(std::string_view name, char** arguments)
{
    const std::string program = fmt::format("ricochet-{}", name);
    const std::filesystem::path here = std::filesystem::read_symlink("/proc/self/exe");
    std::string file = (here.parent_path() / program).string();
    arguments[-1] = file.data();
    execv(file.c_str(), arguments - 1);
    // ricochet_nonsmooth, ricochet_scene and ricochet_fmi are libraries.
    const std::string_view kind = name == nonsmooth || name == scene || name == fmi ? "_app" : "";
    throw std::runtime_error(
        fmt::format("'{}' cannot be run: {}; it is built by the target ricochet_{}{}", file,
                    std::strerror(errno), name, kind));
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
    return find_system(request.system).program == nonsmooth
               ? run_instead(nonsmooth, all_arguments + 1)
               : compare(request);
}

/// Commands that are programs, with their texts in the list of commands.
struct Program {
    std::string_view name;
    std::string_view meaning;
};
constexpr std::array<Program, 3> programs{
    {{"ensemble", "Run a system for every row of a table, on all cores"},
     {"train", "Train a network that predicts events, or one that chooses steps"},
     {"certify", "Prove that where a model clears, its guard is above a margin"}}};

void add_commands(CLI::App& app, int& status)
{
    add_systems(app, status, list_systems);
    add_simulate(app, status, simulate_here_or_there);
    add_program(app, programs[0].name, programs[0].meaning);
    add_program(app, programs[1].name, programs[1].meaning);
    add_inspect(app, status, inspect);
    add_program(app, programs[2].name, programs[2].meaning);
    add_compare(app, status, compare_here_or_there);
    add_program(app, "explain", "Say how a scene would be run: ricochet explain SCENE.json");
    add_program(app, "fmu", "Say what an FMU is: ricochet fmu MODEL.fmu; or export a ready system");
}

/// Whether the command is about a file with that ending: `simulate FILE`, or the command `other`.
bool is_of_file(int count, char** arguments, std::string_view ending, std::string_view other)
{
    if (count < 2) return false;
    const std::string_view command = arguments[1];
    if (command == other) return true;
    if (command != "simulate") return false;
    // The file may come after options, and the value of an option may be a file, too.
    for (int k = 2; k < count; ++k) {
        const std::string_view before = arguments[k - 1];
        const std::string_view argument = arguments[k];
        const bool value =
            before.starts_with("--") && before != "--json" && before != "--co-simulation";
        if (!value && !argument.starts_with('-') && argument.ends_with(ending)) return true;
    }
    return false;
}

int run(int count, char** arguments)
{
    all_arguments = arguments;
    for (const auto& [program, ending, other] :
         {std::array<std::string_view, 3>{scene, ".json", "explain"}, {fmi, ".fmu", "fmu"}}) {
        if (!is_of_file(count, arguments, ending, other)) continue;
        return run_program([&](CLI::App&, int&) { run_instead(program, arguments + 1); }, count,
                           arguments);
    }
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
