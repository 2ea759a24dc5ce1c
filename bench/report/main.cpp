// ricochet_report: solves cells of the report, for the program that scores and times them.
//
//     ricochet_report list             versions, references and cells, as JSON
//     ricochet_report serve <cell>     answers each line of standard input, in JSON: `solve` with
//                                      the answer, `time <n>` with the seconds of n runs
//     ricochet_report run <cell>       prints both once
#include <fmt/format.h>

#include <cstdio>
#include <ctime>
#include <exception>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>

#include "cells.hpp"
#include "timing.hpp"

namespace ricochet::report {

std::string Cell::name() const
{
    const std::string base = problem + "/" + peer + "/" + how;
    return value == 0 ? base : fmt::format("{}/{:g}", base, value);
}

namespace {

using Json = nlohmann::json;

Json json(const std::optional<std::uint64_t>& n)
{
    return n ? Json(*n) : Json(nullptr);
}

Json json(const Answer& answer)
{
    return {{"finished", answer.finished},
            {"times", answer.times},
            {"guards", answer.guards},
            {"samples", answer.samples},
            {"steps", json(answer.steps)},
            {"flow_calls", json(answer.flow_calls)},
            {"guard_calls", json(answer.guard_calls)},
            {"energy_change", answer.energy_change ? Json(*answer.energy_change) : Json(nullptr)},
            {"note", answer.note}};
}

Json json(const Reference& reference)
{
    Json times = Json::array();
    Json guards = Json::array();
    for (const Expected& event : reference.events) {
        times.push_back(event.t);
        guards.push_back(event.guard);
    }
    return {{"problem", reference.problem},
            {"title", reference.title},
            {"t_end", reference.t_end},
            {"scored_until", reference.scored_until},  // null where it is infinite
            {"times", times},
            {"guards", guards},
            {"sample_times", reference.sample_times},
            {"samples", reference.samples}};
}

/// [s] Processor time of n runs.
double seconds(const std::function<Answer()>& solve, std::size_t n)
{
    const auto now = [] {
        std::timespec time{};
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
        return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
    };
    const double start = now();
    for (std::size_t i = 0; i < n; ++i) {
        Answer answer = solve();
        bench::keep(answer);
    }
    return now() - start;
}

Cells all_cells()
{
    Cells cells;
    add_ours(cells);
    add_taylor(cells);
    add_scene(cells);
    add_sliding(cells);
    add_gas(cells);
    add_set_valued(cells);
    add_stiff(cells);
    add_slider(cells);
    add_fault(cells);
    add_odeint(cells);
#ifdef RICOCHET_REPORT_CVODE
    add_cvode(cells);
#endif
#ifdef RICOCHET_REPORT_ARKODE
    add_arkode(cells);
#endif
#ifdef RICOCHET_REPORT_GSL
    add_gsl(cells);
#endif
#ifdef RICOCHET_REPORT_ODE
    add_ode(cells);
#endif
#ifdef RICOCHET_REPORT_BULLET
    add_bullet(cells);
#endif
    cells.add({"yardstick", "odeint", "rk4", 0, [] {
                   return [work = bench::yardstick()] {
                       work(100000);
                       return Answer{.finished = true};
                   };
               }});
    return cells;
}

int list(const Cells& cells)
{
    Json out{{"versions", Json::object()}, {"problems", Json::array()}, {"cells", Json::array()}};
    for (const auto& [peer, version] : cells.versions()) out["versions"][peer] = version;
    for (const auto& make : cells.references()) out["problems"].push_back(json(make()));
    for (const Cell& cell : cells.all()) {
        out["cells"].push_back({{"name", cell.name()},
                                {"problem", cell.problem},
                                {"peer", cell.peer},
                                {"how", cell.how},
                                {"value", cell.value}});
    }
    std::cout << out << '\n';
    return 0;
}

int serve(const Cell& cell)
{
    const auto solve = cell.make();
    std::string line;
    while (std::getline(std::cin, line)) {
        std::istringstream words(line);
        std::string verb;
        std::size_t n = 1;
        words >> verb >> n;
        if (verb == "time") {
            std::cout << Json{{"seconds", seconds(solve, n)}} << std::endl;
        } else {
            std::cout << json(solve()) << std::endl;
        }
    }
    return 0;
}

int run(const Cell& cell)
{
    const auto solve = cell.make();
    std::cout << json(solve()) << '\n';
    double best = seconds(solve, 1);
    const auto n = static_cast<std::size_t>(std::max(1.0, 0.02 / best));
    for (int k = 0; k < 11; ++k) best = std::min(best, seconds(solve, n) / static_cast<double>(n));
    fmt::print("shortest run of {}: {:.4g} us of processor time\n", cell.name(), best * 1e6);
    return 0;
}

int main(int argc, char** argv)
{
    const Cells cells = all_cells();
    const std::string_view verb = argc > 1 ? argv[1] : "";
    if (verb == "list") return list(cells);
    if ((verb == "serve" || verb == "run") && argc == 3) {
        for (const Cell& cell : cells.all()) {
            if (cell.name() == argv[2]) return verb == "serve" ? serve(cell) : run(cell);
        }
        fmt::print(stderr, "ricochet_report: no cell '{}'; see `ricochet_report list`\n", argv[2]);
        return 2;
    }
    fmt::print(stderr, "usage: ricochet_report list | serve <cell> | run <cell>\n");
    return 2;
}

}  // namespace

}  // namespace ricochet::report

int main(int argc, char** argv)
{
    try {
        return ricochet::report::main(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "ricochet_report: {}\n", error.what());
        return 1;
    }
}
