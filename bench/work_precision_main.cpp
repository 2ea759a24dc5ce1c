// ricochet_work_precision: the table of work against precision.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "work_precision.hpp"
#ifdef RICOCHET_BENCH_CVODE
#include "peers/cvode.hpp"
#endif

namespace {

namespace bench = ricochet::bench;

int run(int argc, char** argv)
{
    CLI::App app("Problem x method x tolerance: error, missed and spurious events, calls, time.");
    std::string filter;
    std::string json_file;
    double budget = 0.04;
    bool list = false;
    app.add_option("--filter", filter, "only cases whose name contains this, e.g. b1/dopri5");
    app.add_option("--json", json_file, "also write the table to this file");
    app.add_option("--seconds", budget, "processor time for each case")->check(CLI::PositiveNumber);
    app.add_flag("--list", list, "names of the cases, nothing is run");
    CLI11_PARSE(app, argc, argv);

    bench::CaseList cases = bench::standard_cases(RICOCHET_MODELS);
#ifdef RICOCHET_BENCH_CVODE
    bench::add_cvode(cases);
#endif
    const auto wanted = cases.select(
        [&](const bench::Case& c) { return c.name().find(filter) != std::string::npos; });
    if (list) {
        for (const bench::Case& c : wanted) fmt::print("{}\n", c.name());
        return 0;
    }

    const bench::Timing yardstick = bench::time_alone(bench::yardstick());
    std::vector<bench::Row> rows;
    for (const bench::Case& c : wanted) rows.push_back(bench::run(c, {.budget = budget}));
    fmt::print("{}", bench::table(rows, yardstick));

    if (!json_file.empty()) {
        std::ofstream file(json_file);
        file << bench::to_json(rows, yardstick).dump(2) << '\n';
        if (!file) throw std::runtime_error("cannot write " + json_file);
    }
    return 0;
}

}  // namespace

int main(int argc, char** argv)
{
    try {
        return run(argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "ricochet_work_precision: {}\n", error.what());
        return 2;
    }
}
