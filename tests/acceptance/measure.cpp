// Target, measured value and verdict of every check, one line each, with the command that repeats
// it.
#include "measure.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace {

using ricochet::bench::Check;
using ricochet::bench::Measured;

std::string_view verdict(const Check& check, const Measured& measured)
{
    if (measured.pass) return "pass";
    return check.required ? "FAIL" : "not reached";
}

Measured run(const Check& check)
{
    try {
        return check.run();
    } catch (const std::exception& error) {
        return {.pass = false, .text = fmt::format("stopped: {}", error.what())};
    }
}

int run(const std::vector<Check>& checks, int argc, char** argv)
{
    CLI::App app("Runs what the library must show. Exit status 1 if a check fails.");
    std::vector<std::string> wanted_topics;
    std::vector<std::string> only;
    std::string json_file;
    bool list = false;
    app.add_option("TOPIC", wanted_topics, "only the checks of these topics")
        ->check(CLI::IsMember(std::vector<std::string>(ricochet::bench::topics.begin(),
                                                       ricochet::bench::topics.end())))
        ->type_name("");
    app.add_option("--only", only, "only the checks of these names");
    app.add_option("--json", json_file, "also write the results to this file");
    app.add_flag("--list", list, "names and sentences of the checks, nothing is run");
    CLI11_PARSE(app, argc, argv);

    nlohmann::json results = nlohmann::json::array();
    bool all_passed = true;
    bool any = false;
    for (const Check& check : checks) {
        const bool wanted = only.empty() || std::ranges::find(only, check.id) != only.end();
        const bool on_topic = wanted_topics.empty() ||
                              std::ranges::find(wanted_topics, check.topic) != wanted_topics.end();
        if (!on_topic || !wanted) continue;
        any = true;
        if (list) {
            fmt::print("{:<10}{:<24}{}\n", check.topic, check.id, check.sentence);
            continue;
        }
        const std::string command = fmt::format("{} --only {}", argv[0], check.id);
        const Measured measured = run(check);
        fmt::print("{:<11} {} | target: {} | measured: {} | {}\n", verdict(check, measured),
                   check.sentence, check.target, measured.text, command);
        for (const std::string& line : measured.details) fmt::print("            {}\n", line);
        std::fflush(stdout);
        all_passed = all_passed && (measured.pass || !check.required);
        results.push_back({{"topic", check.topic},
                           {"id", check.id},
                           {"sentence", check.sentence},
                           {"target", check.target},
                           {"measured", measured.text},
                           {"pass", measured.pass},
                           {"required", check.required},
                           {"command", command},
                           {"details", measured.details}});
    }
    if (!any) {
        throw std::invalid_argument(fmt::format(
            "no check of {}{}; --list shows all",
            wanted_topics.empty() ? "any topic" : fmt::format("{}", fmt::join(wanted_topics, ", ")),
            only.empty() ? "" : fmt::format(" is named '{}'", fmt::join(only, "' or '"))));
    }
    if (!json_file.empty()) {
        std::ofstream file(json_file);
        file << results.dump(2) << '\n';
        if (!file) throw std::runtime_error("cannot write " + json_file);
    }
    return all_passed ? 0 : 1;
}

}  // namespace

namespace ricochet::bench {

int run_checks(const std::vector<Check>& checks, int argc, char** argv)
{
    try {
        return run(checks, argc, argv);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}: {}\n", argv[0], error.what());
        return 2;
    }
}

}  // namespace ricochet::bench
