// `ricochet-fmi`: `simulate` and `fmu` of Functional Mock-up Units in files.
#include <limits>
#include <memory>

#include "../options.hpp"
#include "../program.hpp"
#include "fmu_command.hpp"

namespace ricochet::app {

namespace {

void add_file(CLI::App& command, FmuRequest& request)
{
    command.add_option("MODEL", request.file, "a file that ends in .fmu")
        ->required()
        ->type_name("");
    command.add_flag("--json", request.json, "print JSON");
}

void add_simulate_fmu(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand("simulate", "Run an FMU and print its events");
    auto request = std::make_shared<FmuRequest>();
    add_file(command, *request);
    command.add_option("--set", request->set, "a parameter or start value; may be repeated")
        ->type_name("name=value ...");
    add_text(command, "--input", request->input, "FILE",
             "inputs as CSV: a header, the time in the first column; two rows of one time are a "
             "jump");
    add_text(command, "--output", request->output, "NAMES",
             "variables of --csv, --plot and --json, with commas; default: the outputs");
    add_number(command, "--t-start", request->t_start, "T",
               "time at the start [s], default: the FMU's");
    add_number(command, "--t-end", request->t_end, "T", "time at the end [s], default: the FMU's");
    add_number(command, "--rtol", request->rtol, "R",
               "relative error allowed in a step, default 1e-8; the absolute one is R times the "
               "nominal value");
    add_text(command, "--method,--stepper", request->method, "NAME",
             "automatic (default), dopri5, fehlberg78 or rosenbrock4");
    command.add_flag("--co-simulation", request->co_simulation,
                     "let the FMU integrate itself; default where it offers nothing else");
    command
        .add_option("--watch", request->watch,
                    "locate where a variable passes a level, in co-simulation; may be repeated")
        ->type_name("name=level ...");
    add_number(command, "--step", request->step, "H", "communication step of co-simulation [s]");
    add_whole_number(command, "--max-steps", request->max_steps, 1,
                     std::numeric_limits<std::uint64_t>::max(),
                     "end the run after N steps; default 2 million");
    add_whole_number(command, "--samples", request->samples, 2, 10'000'000,
                     "points in --csv and --plot, default 1001, and in --json if given");
    add_text(command, "--csv", request->csv, "FILE", "write the outputs");
    add_text(command, "--plot", request->plot, "FILE", "draw them with gnuplot: .svg or .png");
    command.footer("Example:\n  ricochet simulate ball.fmu --set e=0.5 --plot ball.svg");
    command.callback([&status, request] { status = simulate_fmu(*request); });
}

void add_describe_fmu(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand("fmu", "Say what an FMU is");
    auto request = std::make_shared<FmuRequest>();
    command
        .add_option("MODEL", request->words,
                    "a file that ends in .fmu; before it `check`, to look for faults of its "
                    "library; or `export` and the name of a ready system or a scene "
                    "file")
        ->required()
        ->expected(1, 2)
        ->type_name("");
    command.add_flag("--json", request->json, "print JSON");
    add_text(command, "--out,-o", request->out, "FILE", "the FMU that `export` writes");
    command.add_option("--set", request->set, "a parameter or start value of `export`")
        ->type_name("name=value ...");
    command.add_option("--fmi", request->version, "version of FMI of `export`, default 3")
        ->check(CLI::IsMember({2, 3}))
        ->type_name("2|3");
    command.footer(
        "Examples:\n  ricochet fmu ball.fmu\n  ricochet fmu check ball.fmu\n"
        "  ricochet fmu export bouncing-ball --set restitution=0.8 -o ball.fmu\n"
        "  ricochet fmu export bin.json -o bin.fmu");
    command.callback([&status, request] { status = describe_fmu(*request); });
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    using namespace ricochet::app;
    return run_program(
        [](CLI::App& app, int& status) {
            add_simulate_fmu(app, status);
            add_describe_fmu(app, status);
        },
        count, arguments);
}
