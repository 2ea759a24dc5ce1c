// Options of `ricochet ensemble`.
#include <limits>
#include <memory>

#include "../options.hpp"
#include "../program.hpp"
#include "ensemble_command.hpp"

namespace ricochet::app {

void add_ensemble(CLI::App& app, int& status, EnsembleHandler handler)
{
    CLI::App& command =
        *app.add_subcommand("ensemble", "Run a system for every row of a table, on all cores");
    auto request = std::make_shared<EnsembleRequest>();
    command
        .add_option("SYSTEM", request->system,
                    "its name, `ricochet systems` lists them; or a scene, a file ending in .json")
        ->type_name("");
    add_text(command, "--table", request->table, "FILE",
             "comma-separated values; columns are parameters, components of the start and options");
    add_whole_number(command, "--count", request->count, 1, 1'000'000'000,
                     "random rows in place of a table");
    command
        .add_option("--vary", request->vary,
                    "an interval that --count draws from, evenly, or by logarithms with :log, or a "
                    "mean and a deviation with :normal; may be repeated")
        ->type_name("name=lowest:highest ...");
    command
        .add_option("--grid", request->grid,
                    "values at equal distances, or with :log at equal ratios; of several, all "
                    "combinations")
        ->type_name("name=first:last:count ...");
    add_whole_number(command, "--events", request->events, 1, 1000,
                     "the times of the first N events are results, event_1, event_2, ...");
    add_whole_number(command, "--seed", request->seed, 0, std::numeric_limits<std::uint64_t>::max(),
                     "of random rows, default 1");
    add_text(command, "--out", request->out, "DIR", "where the results are kept; made if needed");
    add_text(command, "--share", request->share, "K/N",
             "run share K of N only; default: by the ranks of Open MPI, PMI or Slurm, or all");
    add_text(command, "--merge", request->merge, "DIR", "join the shares there, and run nothing");
    add_whole_number(command, "--threads", request->threads, 1, 1024,
                     "default: one for each core that may be used");
    add_text(command, "--plot", request->plot, "FILE",
             "draw the results over the first column with gnuplot, as .svg or .png; a second one "
             "gives the colour");
    command
        .add_option("--show", request->show,
                    "results in the plot; default: the times of --events, or the final state")
        ->type_name("NAME ...");
    command.add_flag("--json", request->json, "print JSON");
    add_run_options(command, request->run);
    command.footer(
        "Examples:\n"
        "  ricochet ensemble bouncing-ball --count 1000 --vary height=1:10 --out balls\n"
        "  ricochet ensemble bouncing-ball --table balls.csv --out balls --t-end 20\n"
        "  ricochet ensemble bin.json --grid gravity.y=-10:-1:10 --out bins --plot bins.svg\n"
        "  mpirun -n 4 ricochet ensemble bouncing-ball --table balls.csv --out balls\n"
        "  ricochet ensemble --merge balls\n\n"
        "A call that was ended early is repeated as it was, and goes on where it ended. The\n"
        "results, results.npy and results.csv in DIR, are the same for any shares and threads.");
    command.callback([&status, request, handler] { status = handler(*request); });
}

}  // namespace ricochet::app
