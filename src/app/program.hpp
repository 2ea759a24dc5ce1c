// Parts that `ricochet` and its further programs, `ricochet-<name>`, share.
//
// Exit status: 0 success; 1 a run or training with an outcome other than the desired one (its
// result is printed nevertheless) or a file that could not be written at the end;
// 2 bad input: one sentence on standard error, nothing printed, nothing written;
// 129, 130 and 143 a run or comparison ended by a signal, with its result printed as incomplete.
#pragma once

#include <functional>
#include <string_view>

#include "compare.hpp"
#include "inspect.hpp"
#include "simulate.hpp"
#include "systems.hpp"

namespace CLI {
class App;
}

namespace ricochet::app {

/// Adds the commands of a program; each sets the exit status when it is run.
using AddCommands = std::function<void(CLI::App& app, int& status)>;

using SystemsHandler = int (*)(ListFormat format);
using InspectHandler = int (*)(const InspectRequest& request);
using SimulateHandler = int (*)(const SimulateRequest& request);
using CompareHandler = int (*)(const CompareRequest& request);

void add_systems(CLI::App& app, int& status, SystemsHandler handler);
void add_inspect(CLI::App& app, int& status, InspectHandler handler);

/// `simulate` and `compare` with all their options, for several programs.
void add_simulate(CLI::App& app, int& status, SimulateHandler handler);
void add_compare(CLI::App& app, int& status, CompareHandler handler);

/// The options of a run, which `simulate` and `ensemble` share.
void add_run_options(CLI::App& command, RunRequest& run);

/// A command that is a program of its own, for the list of commands.
void add_program(CLI::App& app, std::string_view name, std::string_view meaning);

/// The main function of a program with these commands. @return the exit status
int run_program(const AddCommands& add, int count, char** arguments);

/// The same for a program of one command, whose name is not typed: `ricochet-train SYSTEM ...`.
int run_command(std::string_view command, const AddCommands& add, int count, char** arguments);

}  // namespace ricochet::app
