// `ricochet-scene`: `simulate` and `explain` of scenes in files.
#include <limits>
#include <memory>

#include "../options.hpp"
#include "../program.hpp"
#include "scene_command.hpp"

namespace ricochet::app {

namespace {

void add_file(CLI::App& command, SceneRequest& request)
{
    command.add_option("SCENE", request.file, "a file of JSON")->required()->type_name("");
    add_number(command, "--t-start", request.t_start, "T", "time at the start [s]");
    add_number(command, "--t-end", request.t_end, "T", "time at the end [s]");
    add_number(command, "--rtol", request.rtol, "R",
               "relative error allowed in a step of bodies with springs or drag");
    add_number(command, "--atol", request.atol, "A", "absolute error allowed there");
    add_number(command, "--contact-step", request.contact_step, "H",
               "steps of bodies in lasting contact [s]");
}

void add_simulate_scene(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand("simulate", "Run a scene and print its events");
    auto request = std::make_shared<SceneRequest>();
    add_file(command, *request);
    add_whole_number(command, "--max-events", request->max_events, 1,
                     std::numeric_limits<std::uint64_t>::max(),
                     "end the run after N events, as step_limit");
    add_whole_number(command, "--samples", request->samples, 2, 1'000'000,
                     "times at which --csv, --plot and --animate have the bodies, default 501, and "
                     "--json if given");
    command.add_flag("--json", request->json, "print JSON");
    command.add_flag("--no-events", request->no_events, "count events, and print none");
    add_text(command, "--csv", request->csv, "FILE", "write the bodies at each sample");
    add_text(command, "--plot", request->plot, "FILE", "draw the ways with gnuplot: .svg or .png");
    add_text(command, "--animate", request->animate, "FILE", "write the motion as one .svg");
    command.footer(
        "Examples:\n"
        "  ricochet simulate examples/scenes/cradle.json\n"
        "  ricochet simulate examples/scenes/bin.json --animate bin.svg --plot bin.png\n\n"
        "What the options leave open the file says under \"run\" (docs/scenes.md).");
    command.callback([&status, request] { status = simulate_scene(*request); });
}

void add_explain_scene(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand("explain", "Say how a scene would be run");
    auto request = std::make_shared<SceneRequest>();
    add_file(command, *request);
    command.footer("Example:\n  ricochet explain examples/scenes/cradle.json");
    command.callback([&status, request] { status = explain_scene(*request); });
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    using namespace ricochet::app;
    return run_program(
        [](CLI::App& app, int& status) {
            add_simulate_scene(app, status);
            add_explain_scene(app, status);
        },
        count, arguments);
}
