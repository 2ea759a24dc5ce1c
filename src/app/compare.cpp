#include "compare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "files.hpp"
#include "input.hpp"
#include "json_text.hpp"
#include "registry.hpp"
#include "report.hpp"

namespace ricochet::app {

namespace {

/// Event times beside the exact ones.
struct Accuracy {
    std::vector<double> found;  ///< [s] one per exact event; NaN: missed
    double largest_error = 0;   ///< [s]
    std::size_t missed = 0;
    std::size_t spurious = 0;
};

/// Matches the events in order. One further than half an interval from every exact
/// event that is left is spurious.
Accuracy judge(const std::vector<double>& exact, std::span<const double> times)
{
    Accuracy out{.found = std::vector<double>(exact.size(), std::nan(""))};
    for (const double t : times) {
        std::size_t nearest = 0;
        for (std::size_t i = 1; i < exact.size(); ++i) {
            if (std::fabs(exact[i] - t) < std::fabs(exact[nearest] - t)) nearest = i;
        }
        if (exact.empty() || std::isfinite(out.found[nearest])) {
            ++out.spurious;
            continue;
        }
        out.found[nearest] = t;
        out.largest_error = std::max(out.largest_error, std::fabs(t - exact[nearest]));
    }
    out.missed = static_cast<std::size_t>(
        std::count_if(out.found.begin(), out.found.end(), [](double t) { return std::isnan(t); }));
    return out;
}

/// Seconds per run, over many batches of runs.
struct Timing {
    double median = 0;
    double lower = 0;  ///< quartile
    double upper = 0;  ///< quartile
};

Timing summarise(std::vector<double> seconds)
{
    std::sort(seconds.begin(), seconds.end());
    const std::size_t n = seconds.size();
    return {.median = seconds[n / 2], .lower = seconds[n / 4], .upper = seconds[3 * n / 4]};
}

struct Method {
    std::string name;      ///< of the detector
    std::string stepping;  ///< in words
    RunSettings settings;
    bool in_table;  ///< whether its times have a column
    Accuracy accuracy{};
    Statistics statistics{};
    Timing timing{};
};

std::vector<Method> methods(const SystemEntry& system)
{
    struct Choice {
        const char* detector;
        bool fixed;
        bool in_table;
    };
    std::vector<Method> out;
    for (const Choice choice : {Choice{"network", true, true}, Choice{"ends", true, true},
                                Choice{"extremum", true, true}, Choice{"network", false, false},
                                Choice{"ends", false, false}, Choice{"extremum", false, true}}) {
        RunRequest request{.detector = choice.detector};
        if (choice.fixed) request.step = system.comparison_step;
        RunSettings settings = resolve(system, request);
        out.push_back(
            {.name = choice.detector,
             .stepping = fmt::format(
                 "{}{}", name(settings.stepper),
                 choice.fixed ? fmt::format(" h={}", settings.options.step) : std::string()),
             .settings = std::move(settings),
             .in_table = choice.in_table});
    }
    return out;
}

/// Runs each method once, with its events.
void check_answers(const SystemEntry& system, const std::vector<double>& exact,
                   std::vector<Method>& methods)
{
    for (Method& method : methods) {
        const TimedRun timed = system.run(method.settings, 1);
        std::vector<double> times;
        for (const auto& event : timed.run.events) times.push_back(event.t);
        method.accuracy = judge(exact, times);
        method.statistics = timed.run.statistics;
    }
}

/// Times the methods in turn, so that whatever else the machine does meets all of
/// them alike. Events are counted and not recorded.
void measure(const SystemEntry& system, std::vector<Method>& methods)
{
    constexpr std::size_t rounds = 101;
    constexpr double batch_seconds = 2e-4;
    std::vector<std::vector<double>> seconds(methods.size());
    std::vector<int> repeats;
    for (Method& method : methods) {
        method.settings.options.record_events = false;
        const double once = system.run(method.settings, 20).seconds;
        repeats.push_back(1 + static_cast<int>(batch_seconds / once));
    }
    for (std::size_t round = 0; round < rounds; ++round) {
        for (std::size_t i = 0; i < methods.size(); ++i) {
            seconds[i].push_back(system.run(methods[i].settings, repeats[i]).seconds);
        }
    }
    for (std::size_t i = 0; i < methods.size(); ++i) {
        methods[i].timing = summarise(std::move(seconds[i]));
    }
}

const Method& find(const std::vector<Method>& methods, std::string_view name, bool fixed_step)
{
    return *std::find_if(methods.begin(), methods.end(), [&](const Method& method) {
        return method.name == name && method.settings.fixed_step == fixed_step;
    });
}

/// What the measured times say about the network on this system.
std::string verdict(const std::vector<Method>& methods)
{
    const Method& network = find(methods, "network", true);
    const Method& ends = find(methods, "ends", true);
    const double difference = network.timing.median - ends.timing.median;
    const auto saved = static_cast<double>(ends.statistics.guard_calls) -
                       static_cast<double>(network.statistics.guard_calls);
    return fmt::format(
        "With {} a run takes {} with the network and {} with ends: on this scene the network "
        "costs {} than the {} guard calls it saves, by {} a run ({} a step).",
        network.stepping, duration(network.timing.median), duration(ends.timing.median),
        difference > 0 ? "more" : "less", saved, duration(std::fabs(difference)),
        duration(std::fabs(difference) / static_cast<double>(network.statistics.steps)));
}

std::string times_table(const std::vector<double>& exact, const std::vector<Method>& methods)
{
    constexpr int wide = 21;
    std::string names = fmt::format("{:>3}{:>{}}", "", "closed form", wide);
    std::string steppings = fmt::format("{:>3}{:>{}}", "", "t [s]", wide);
    for (const Method& method : methods) {
        if (!method.in_table) continue;
        names += fmt::format("{:>{}}", method.name, wide);
        steppings += fmt::format("{:>{}}", method.stepping, wide);
    }
    std::string out = names + '\n' + steppings + '\n';
    for (std::size_t i = 0; i < exact.size(); ++i) {
        out += fmt::format("{:>3}{:>{}.15f}", i + 1, exact[i], wide);
        for (const Method& method : methods) {
            if (!method.in_table) continue;
            const double t = method.accuracy.found[i];
            out += std::isnan(t) ? fmt::format("{:>{}}", "missed", wide)
                                 : fmt::format("{:>{}.15f}", t, wide);
        }
        out += '\n';
    }
    return out;
}

std::string cost_table(const SystemEntry& system, const std::vector<double>& exact,
                       const std::vector<Method>& methods)
{
    std::string out = fmt::format("{:<32}{:>11}{:>8}{:>10}{:>6}{:>7}{:>7}{:>7}{:>9}{:>12}  {}\n",
                                  "", "largest", "missed", "spurious", "late", "steps", "flow",
                                  "guard", "network", "time", "middle half");
    out +=
        fmt::format("{:<32}{:>11}{:>8}{:>10}{:>6}{:>7}{:>7}{:>7}{:>9}{:>12}  {}\n", "", "error [s]",
                    "", "", "", "", "calls", "calls", "calls", "per run", "of the times");
    for (const Method& method : methods) {
        const Statistics& s = method.statistics;
        out += fmt::format("{:<32}{:>11.1e}{:>8}{:>10}{:>6}{:>7}{:>7}{:>7}{:>9}{:>12}  {} to {}\n",
                           fmt::format("{}, {}", method.name, method.stepping),
                           method.accuracy.largest_error, method.accuracy.missed,
                           method.accuracy.spurious, s.late_events, s.steps, s.flow_calls,
                           s.guard_calls, s.network_calls, duration(method.timing.median),
                           duration(method.timing.lower), duration(method.timing.upper));
    }
    for (const Published& published : system.published) {
        const Accuracy accuracy = judge(exact, published.times);
        out += fmt::format("{:<32}{:>11.1e}{:>8}{:>10}\n", published.name, accuracy.largest_error,
                           accuracy.missed, accuracy.spurious);
    }
    return out;
}

std::string to_text(const SystemEntry& system, const std::vector<double>& exact,
                    const std::vector<Method>& methods)
{
    const RunSettings& settings = methods.front().settings;
    std::string out =
        fmt::format("{}, to t = {} s\n\n", title(system, settings), settings.options.t_end);
    out += times_table(exact, methods) + '\n' + cost_table(system, exact, methods) + '\n';
    const Options& controlled = find(methods, "extremum", false).settings.options;
    out += fmt::format("Where no step h is given the error is controlled, rtol {}, atol {}.\n",
                       controlled.rtol, controlled.atol);
    if (!system.published.empty()) {
        out += fmt::format("paper: {}.\n", system.published.front().source);
    }
    return out + verdict(methods) + '\n';
}

Json json(const std::vector<double>& exact, const Accuracy& accuracy)
{
    Json errors = Json::array();
    for (std::size_t i = 0; i < exact.size(); ++i) errors.push_back(accuracy.found[i] - exact[i]);
    return {{"times", accuracy.found},
            {"errors", errors},
            {"largest_error", accuracy.largest_error},
            {"missed", accuracy.missed},
            {"spurious", accuracy.spurious}};
}

std::string to_json(const SystemEntry& system, const std::vector<double>& exact,
                    const std::vector<Method>& methods)
{
    Json rows = Json::array();
    for (const Method& method : methods) {
        const RunSettings& settings = method.settings;
        Json row{{"detector", method.name},
                 {"stepper", name(settings.stepper)},
                 {"step", settings.fixed_step ? Json(settings.options.step) : Json()},
                 {"rtol", settings.fixed_step ? Json() : Json(settings.options.rtol)},
                 {"atol", settings.fixed_step ? Json() : Json(settings.options.atol)},
                 {"model", settings.network ? Json(settings.model.string()) : Json()}};
        row.update(json(exact, method.accuracy));
        const Statistics& s = method.statistics;
        row["late"] = s.late_events;
        row["false_alarms"] = s.false_alarms;
        row["steps"] = s.steps;
        row["flow_calls"] = s.flow_calls;
        row["guard_calls"] = s.guard_calls;
        row["network_calls"] = s.network_calls;
        row["seconds"] = {{"median", method.timing.median},
                          {"lower_quartile", method.timing.lower},
                          {"upper_quartile", method.timing.upper}};
        rows.push_back(std::move(row));
    }
    Json published = Json::array();
    for (const Published& column : system.published) {
        Json row{{"name", column.name}, {"source", column.source}};
        row.update(json(exact, judge(exact, column.times)));
        published.push_back(std::move(row));
    }
    return json_text({{"system", system.name},
                      {"t_end", methods.front().settings.options.t_end},
                      {"closed_form", exact},
                      {"methods", rows},
                      {"published", published},
                      {"verdict", verdict(methods)}});
}

std::string to_csv(const SystemEntry& system, const std::vector<double>& exact,
                   const std::vector<Method>& methods)
{
    std::string out = "event,closed form [s]";
    for (const Method& method : methods) {
        out += fmt::format(",{} {} [s]", method.name, method.stepping);
    }
    for (const Published& column : system.published) out += fmt::format(",{} [s]", column.name);
    out += '\n';
    for (std::size_t i = 0; i < exact.size(); ++i) {
        out += fmt::format("{},{}", i + 1, exact[i]);
        const auto cell = [](double t) {
            return std::isnan(t) ? std::string(",") : fmt::format(",{}", t);
        };
        for (const Method& method : methods) out += cell(method.accuracy.found[i]);
        for (const Published& column : system.published) {
            out += cell(judge(exact, column.times).found[i]);
        }
        out += '\n';
    }
    return out;
}

}  // namespace

int compare(const CompareRequest& request)
{
    const SystemEntry& system = find_system(request.system);
    if (system.exact_events == nullptr) {
        throw BadInput(
            fmt::format("the system {} has no exact event times to compare with", system.name));
    }
    if (request.csv) check_writable("--csv", *request.csv);
    std::vector<Method> all = methods(system);
    const RunSettings& settings = all.front().settings;
    const std::vector<double> exact =
        system.exact_events(settings.parameters, settings.options.t_end);
    check_answers(system, exact, all);
    measure(system, all);

    print(request.json ? to_json(system, exact, all) : to_text(system, exact, all));
    if (request.csv) write_file(*request.csv, to_csv(system, exact, all));
    const bool all_found = std::all_of(all.begin(), all.end(), [](const Method& method) {
        return method.accuracy.missed == 0 && method.accuracy.spurious == 0;
    });
    return all_found ? 0 : 1;
}

}  // namespace ricochet::app
