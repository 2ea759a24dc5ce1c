#include "compare_set_valued.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "../files.hpp"
#include "../input.hpp"
#include "../interrupt.hpp"
#include "../json_text.hpp"
#include "../registry.hpp"
#include "../report.hpp"
#include "../run_watch.hpp"
#include "../timing.hpp"

namespace ricochet::app {

namespace {

struct Measured {
    std::string label;
    std::uint64_t steps = 0, solves = 0;
    std::size_t events = 0;
    double seconds = 0;
    double l2 = 0;        ///< square root of the integral of the squared error
    double relative = 0;  ///< the same over that of the solution
    double largest = 0;
    bool ended = false;
};

constexpr std::size_t grid = 5001;

/// Whether a solution in closed form is known for these parameters.
bool closed(const SystemEntry& system, const RunSettings& settings)
{
    return system.exact_state != nullptr &&
           !system.exact_state(settings.parameters, settings.options.t_start).empty();
}

std::vector<std::vector<double>> reference(const SystemEntry& system, const RunRequest& base,
                                           const std::vector<double>& times)
{
    std::vector<std::vector<double>> out;
    RunRequest request = base;
    request.rtol = request.atol = 1e-13;
    RunSettings settings = resolve(system, request);
    if (closed(system, settings)) {
        for (const double t : times) out.push_back(system.exact_state(settings.parameters, t));
        return out;
    }
    settings.options.sample_times = times;
    return system.run(settings, 1).run.trajectory.x;
}

double squared(const std::vector<double>& a)
{
    double sum = 0;
    for (const double value : a) sum += value * value;
    return sum;
}

Measured measure(const SystemEntry& system, std::string label, const RunRequest& request,
                 const std::vector<double>& times, const std::vector<std::vector<double>>& exact)
{
    RunSettings settings = resolve(system, request);
    Measured row{.label = std::move(label)};
    double best = std::numeric_limits<double>::infinity();
    for (int batch = 0; batch < 20 && !Interrupts::any(); ++batch)
        best = std::min(best, system.run(settings, 1).seconds);
    row.seconds = best;
    settings.options.sample_times = times;
    const TimedRun timed = system.run(settings, 1);
    const auto& x = timed.run.trajectory.x;
    row.ended = timed.run.outcome == Outcome::reached_end && x.size() == exact.size();
    row.steps = timed.run.statistics.steps + timed.run.statistics.rejected;
    if (timed.steps) {
        row.steps += timed.steps->attempted;
        row.solves = timed.steps->solves;
    }
    row.events = timed.run.events.size();
    if (!row.ended) return row;
    double of_error = 0;
    double of_solution = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        std::vector<double> off = x[i];
        for (std::size_t k = 0; k < off.size(); ++k) {
            off[k] -= exact[i][k];
            row.largest = std::max(row.largest, std::abs(off[k]));
        }
        const double weight = i == 0 || i + 1 == x.size() ? 0.5 : 1;
        of_error += weight * squared(off);
        of_solution += weight * squared(exact[i]);
    }
    row.l2 = std::sqrt(of_error * (times[1] - times[0]));
    row.relative = of_solution > 0 ? std::sqrt(of_error / of_solution) : 0;
    return row;
}

std::vector<std::pair<std::string, RunRequest>> ways(const SystemEntry& system,
                                                     const RunRequest& base)
{
    std::vector<std::pair<std::string, RunRequest>> out;
    const auto add = [&](std::string label, std::string integrator, std::string controller,
                         double step) -> RunRequest& {
        RunRequest request = base;
        request.integrator = std::move(integrator);
        if (!controller.empty()) request.controller = std::move(controller);
        if (step > 0) request.step = step;
        return out.emplace_back(std::move(label), std::move(request)).second;
    };
    const double step = system.set_valued_step;
    for (const double h : {8 * step, 4 * step, step, step / 8}) {
        add(fmt::format("bathe, constant {} s", h), "bathe", "constant", h);
    }
    add("bathe, heuristic", "bathe", "heuristic", step);
    add("bathe, PI 3333", "bathe", "pi", step);
    add("bathe, filter h211b", "bathe", "filter", step);
    add(fmt::format("backward Euler, {} s", step), "time-stepping", "", step);
    for (const double rtol : {1e-4, 3e-8, 1e-12}) {
        // Fehlberg's error estimate is zero for rates that depend on time alone.
        RunRequest& request = add(fmt::format("hand-over, rtol {:.0e}", rtol), "handover", "", 0);
        request.rtol = request.atol = rtol;
        if (system.state.size() > 1) request.stepper = "fehlberg78";
    }
    return out;
}

std::string table(const SystemEntry& system, const RunSettings& settings,
                  const std::vector<Measured>& rows, const std::vector<std::string_view>& published)
{
    std::string out = title(system, settings) + '\n';
    out += closed(system, settings)
               ? "errors against the closed solution"
               : "errors against a hand-over at rtol 1e-13, which the tests compare with matrix "
                 "exponentials";
    out += fmt::format("; {} samples, straight lines between the nodes of steps\n\n", grid);
    out += fmt::format("{:<28}{:>8}{:>8}{:>8}{:>12}{:>12}{:>12}{:>12}\n", "", "steps", "solves",
                       "events", "time", "L2", "relative", "largest");
    for (const Measured& row : rows) {
        out += fmt::format("{:<28}{:>8}{:>8}{:>8}{:>12}", row.label, row.steps, row.solves,
                           row.events, duration(row.seconds));
        out += row.ended
                   ? fmt::format("{:>12.2e}{:>12.2e}{:>12.2e}\n", row.l2, row.relative, row.largest)
                   : std::string("   did not end\n");
    }
    if (!published.empty()) {
        out +=
            "\npublished (D. M. Riley and others, Reinforcement Learning-based adaptive "
            "time-integration for nonsmooth dynamics), against a reference of its own:\n";
    }
    for (const std::string_view line : published) out += fmt::format("  {}\n", line);
    return out;
}

/// Times of the samples, from the start to the end.
std::vector<double> sample_times(const Options& options)
{
    std::vector<double> times(grid);
    const double span = options.t_end - options.t_start;
    for (std::size_t i = 0; i < grid; ++i) {
        times[i] = options.t_start + span * static_cast<double>(i) / static_cast<double>(grid - 1);
    }
    times.back() = options.t_end;
    return times;
}

Json json_of(const std::vector<Measured>& rows)
{
    Json methods = Json::array();
    for (const Measured& row : rows) {
        methods.push_back({{"method", row.label},
                           {"steps", row.steps},
                           {"solves", row.solves},
                           {"events", row.events},
                           {"seconds", row.seconds},
                           {"l2", row.l2},
                           {"relative", row.relative},
                           {"largest", row.largest},
                           {"reached_end", row.ended}});
    }
    return methods;
}

std::string csv_of(const std::vector<Measured>& rows)
{
    std::string csv = "method,steps,solves,events,seconds,L2,relative,largest\n";
    for (const Measured& row : rows) {
        csv += fmt::format("\"{}\",{},{},{},{},{},{},{}\n", row.label, row.steps, row.solves,
                           row.events, row.seconds, row.l2, row.relative, row.largest);
    }
    return csv;
}

}  // namespace

int compare_set_valued(const SystemEntry& system, const CompareRequest& request)
{
    RunRequest base;
    base.set = request.set;
    const RunSettings settings = resolve(system, base);
    Claims claims;
    if (request.csv) claims.writes("--csv", *request.csv);
    const std::vector<double> times = sample_times(settings.options);
    const Interrupts interrupts;
    std::optional<RunWatch> watch(0.25);
    const auto exact = reference(system, base, times);
    if (exact.size() != grid && !Interrupts::any()) {
        throw BadInput("no reference: its run did not reach the end");
    }
    const auto all = ways(system, base);
    std::vector<Measured> rows;
    for (const auto& [label, way] : all) {
        if (Interrupts::any()) break;
        Measured row = measure(system, label, way, times, exact);
        if (!Interrupts::any()) rows.push_back(std::move(row));
    }
    watch.reset();
    const bool complete = rows.size() == all.size();
    Json json{{"system", system.name}, {"t_end", settings.options.t_end}};
    if (!complete) json["incomplete"] = Interrupts::cause();
    json["methods"] = json_of(rows);
    std::string csv = csv_of(rows);
    // They are for the defaults.
    const std::vector<std::string_view> published =
        request.set.empty() ? system.published_errors : std::vector<std::string_view>{};
    json["published"] = published;
    if (!complete) csv += incomplete_line();
    deliver(
        {[&] { print(request.json ? json_text(json) : table(system, settings, rows, published)); },
         [&] {
             if (request.csv) write_file(*request.csv, csv);
         }});
    if (!complete)
        return ended_early(fmt::format("after {} of {} methods", rows.size(), all.size()));
    return std::all_of(rows.begin(), rows.end(), [](const Measured& row) { return row.ended; }) ? 0
                                                                                                : 1;
}

}  // namespace ricochet::app
