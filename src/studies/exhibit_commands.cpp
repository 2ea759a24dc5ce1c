// `ricochet-studies list`, `table PAPER NUMBER` and `figure PAPER NUMBER`.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>
#include <optional>

#include "files.hpp"
#include "interrupt.hpp"
#include "options.hpp"
#include "papers.hpp"
#include "report.hpp"
#include "run_watch.hpp"

namespace ricochet::app {

namespace {

struct ExhibitRequest {
    ExhibitKind kind = ExhibitKind::figure;
    std::string paper{}, number{};
    std::optional<std::filesystem::path> out{};
    bool json = false, full = false;
};

std::vector<Paper> papers()
{
    return {event_detection_paper(), step_control_paper(), potentials_paper()};
}

/// @throws BadInput naming the available exhibits.
const ExhibitEntry& find(const std::vector<Paper>& all, const ExhibitRequest& request,
                         const Paper*& paper)
{
    std::vector<std::string_view> names;
    for (const Paper& each : all) {
        names.push_back(each.name);
        if (each.name == request.paper) paper = &each;
    }
    if (paper == nullptr) throw unknown("paper", request.paper, names);
    std::vector<int> known;
    for (const ExhibitEntry& entry : paper->exhibits) {
        if (entry.kind != request.kind) continue;
        known.push_back(entry.number);
        if (fmt::format("{}", entry.number) != request.number) continue;
        if (entry.make != nullptr) return entry;
        throw BadInput(fmt::format("{} {} of {} is not computed: {}", name(request.kind),
                                   request.number, paper->name, entry.why_none));
    }
    throw BadInput(fmt::format("unknown {} '{}' of {}; known are {}", name(request.kind),
                               shortened(request.number), paper->name, fmt::join(known, ", ")));
}

void check_output(const ExhibitRequest& request)
{
    if (request.kind == ExhibitKind::table) return;
    if (!request.out) {
        if (request.json) return;
        throw BadInput("figure needs --out FILE, ending in .svg or .png, or --json");
    }
    const auto ending = request.out->extension();
    if (ending != ".svg" && ending != ".png") {
        throw BadInput(fmt::format("--out must be a file ending in .svg or .png, got '{}'",
                                   request.out->string()));
    }
    Claims().writes("--out", *request.out);
}

int run_exhibit(const ExhibitRequest& request)
{
    const std::vector<Paper> all = papers();
    const Paper* paper = nullptr;
    const ExhibitEntry& entry = find(all, request, paper);
    check_output(request);
    const Interrupts interrupts;
    Exhibit exhibit;
    try {
        const RunWatch watch(0.25);
        exhibit = entry.make({.full = request.full});
        check_exhibit();
    } catch (const ExhibitInterrupted&) {
        return ended_early(fmt::format("before the {} was complete", name(request.kind)));
    }
    const std::string heading = fmt::format("{} {} of {}: {}", name(request.kind), request.number,
                                            paper->name, entry.title);
    if (request.json) {
        Json out{{"paper", paper->name},
                 {"kind", name(entry.kind)},
                 {"number", entry.number},
                 {"title", entry.title}};
        out.update(to_json(exhibit));
        print(json_text(out));
    } else {
        print(fmt::format("{}\n\n{}", heading, to_text(exhibit)));
    }
    if (request.out) draw(exhibit, heading, *request.out);
    for (const Agreement& each : exhibit.agreements) {
        if (!each.holds()) return 1;
    }
    return 0;
}

int list(bool as_json)
{
    std::string text;
    Json json = Json::array();
    for (const Paper& paper : papers()) {
        text += fmt::format("{}: {}\n", paper.name, paper.source);
        for (const ExhibitEntry& entry : paper.exhibits) {
            const std::string label = fmt::format("{} {}", name(entry.kind), entry.number);
            text += fmt::format(
                "  {:<10} {}{}\n", label, entry.title,
                entry.make != nullptr ? "" : fmt::format(" (not computed: {})", entry.why_none));
            json.push_back({{"paper", paper.name},
                            {"kind", name(entry.kind)},
                            {"number", entry.number},
                            {"title", entry.title},
                            {"computed", entry.make != nullptr}});
            if (entry.make == nullptr) json.back()["why"] = entry.why_none;
        }
    }
    print(as_json ? json_text(json) : text);
    return 0;
}

void add_exhibit(CLI::App& app, int& status, ExhibitKind kind)
{
    const bool figure = kind == ExhibitKind::figure;
    CLI::App& command = *app.add_subcommand(std::string(name(kind)),
                                            figure ? "Draw a figure of a paper from our own runs"
                                                   : "Print a table of a paper beside ours");
    auto request = std::make_shared<ExhibitRequest>(ExhibitRequest{.kind = kind});
    command.add_option("PAPER", request->paper, "its name; `list` has them")
        ->required()
        ->type_name("");
    command.add_option("NUMBER", request->number, "as in the paper")->required()->type_name("");
    if (figure) {
        add_text(command, "--out", request->out, "FILE", "draw it with gnuplot, as .svg or .png");
    }
    command.add_flag("--json", request->json, "print JSON, with all that is drawn");
    command.add_flag("--full", request->full,
                     "with the paper's meshes and longer trainings: minutes");
    command.callback([&status, request] { status = run_exhibit(*request); });
}

}  // namespace

void add_exhibits(CLI::App& app, int& status)
{
    CLI::App& command = *app.add_subcommand("list", "List the tables and figures of the papers");
    auto as_json = std::make_shared<bool>(false);
    command.add_flag("--json", *as_json, "print JSON");
    command.callback([&status, as_json] { status = list(*as_json); });
    add_exhibit(app, status, ExhibitKind::table);
    add_exhibit(app, status, ExhibitKind::figure);
}

}  // namespace ricochet::app
