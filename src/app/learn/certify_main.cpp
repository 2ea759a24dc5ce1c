// `ricochet-certify`: the program of `ricochet certify`.
#include <memory>

#include "certify.hpp"
#include "options.hpp"
#include "program.hpp"

namespace ricochet::app {

namespace {

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
                     "prove the stored threshold; else the highest provable one is searched for");
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
    command.add_flag("--resume", request->resume, "continue from the checkpoint");
    command.add_flag("--json", request->json, "print the result as JSON");
    command.footer("Example:\n  ricochet certify room.safetensors --margin 0.05 --levels 4");
    command.callback([&status, request] { status = certify(*request); });
}

}  // namespace

}  // namespace ricochet::app

int main(int count, char** arguments)
{
    using namespace ricochet::app;
    return run_command("certify", add_certify, count, arguments);
}
