#include "compare.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <span>

#include "files.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "joined.hpp"
#include "json_text.hpp"
#include "model_lookup.hpp"
#include "registry.hpp"
#include "report.hpp"
#include "run_watch.hpp"
#include "timing.hpp"

namespace ricochet::app {

namespace {

/// Event times beside the exact ones.
struct Accuracy {
    std::vector<double> found;  ///< [s] one per known event; NaN: missed
    double largest_error = 0;   ///< [s]
    std::size_t missed = 0;
    std::size_t spurious = 0;
};

/// Matches the events in order. An event farther than half an interval from every exact
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

struct Method {
    std::string label;     ///< of the detector: "network any-step"
    std::string stepping;  ///< in words
    RunSettings settings;
    bool in_table;  ///< whether its times have a column
    Accuracy accuracy{};
    Statistics statistics{};
    Timing timing{};
};

/// Detectors in fixed steps and under error control, and Taylor series where they apply.
class MethodList {
public:
    MethodList(const SystemEntry& system, const std::vector<std::string>& set)
        : system_(system), set_(set)
    {
    }

    void add(DetectorKind detector, bool fixed_step, bool in_table, const OwnModel* model = nullptr,
             std::optional<Stepper> with = {})
    {
        RunRequest request{.set = set_, .detector = std::string(name(detector))};
        if (with) request.stepper = std::string(with->name());
        if (fixed_step) request.step = system_.comparison_step;
        if (model != nullptr) request.model = find_model(*model).string();
        RunSettings settings = resolve(system_, request);
        const std::string_view stepper = settings.stepper.name();
        std::string label(name(detector));
        if (model != nullptr) label += fmt::format(" {}", model->kind);
        methods_.push_back({.label = std::move(label),
                            .stepping = fixed_step
                                            ? fmt::format("{} h={}", stepper, settings.options.step)
                                            : std::string(stepper),
                            .settings = std::move(settings),
                            .in_table = in_table});
    }

    [[nodiscard]] std::vector<Method> take() { return std::move(methods_); }

private:
    const SystemEntry& system_;
    const std::vector<std::string>& set_;
    std::vector<Method> methods_;
};

/// The table of times has the paper's columns, and ours beside them. The other
/// methods differ in the last digits at most.
std::vector<Method> methods(const SystemEntry& system, const std::vector<std::string>& set)
{
    MethodList list(system, set);
    for (const bool fixed : {true, false}) {
        for (const OwnModel& model : system.models) {
            if (!fixed && !model.any_step) continue;
            if (!set.empty() && !model.any_step) continue;  // it is for the defaults
            list.add(DetectorKind::network, fixed, fixed != model.any_step, &model);
        }
        if (!system.line.empty()) list.add(DetectorKind::line, fixed, false);
        if (!system.models.empty()) list.add(DetectorKind::verified, fixed, !fixed);
        list.add(DetectorKind::ends, fixed, fixed);
        list.add(DetectorKind::extremum, fixed, fixed);
        list.add(DetectorKind::bernstein, fixed, false);
    }
    if (system.series) {
        list.add(DetectorKind::extremum, false, false, nullptr, Stepper::taylor());
    }
    return list.take();
}

/// Runs each method once, with its events. An interrupt omits the remaining methods.
void check_answers(const SystemEntry& system, const std::vector<double>& exact,
                   std::vector<Method>& methods)
{
    for (std::size_t i = 0; i < methods.size(); ++i) {
        Method& method = methods[i];
        const TimedRun timed = system.run(method.settings, 1);
        if (Interrupts::any()) {
            methods.resize(i);
            return;
        }
        std::vector<double> times;
        for (const auto& event : timed.run.events) times.push_back(event.t);
        method.accuracy = judge(exact, times);
        method.statistics = timed.run.statistics;
    }
}

/// Times the methods in turn, so that other loads on the machine affect all of
/// them alike. Events are counted and not recorded.
void measure(const SystemEntry& system, std::vector<Method>& methods)
{
    constexpr std::size_t rounds = 101;
    constexpr std::size_t fewest = 3;
    constexpr double batch_seconds = 2e-4;
    constexpr std::chrono::seconds enough(20);  // runs of seconds are measured less often
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::vector<double>> seconds(methods.size());
    std::vector<int> repeats;
    for (Method& method : methods) {
        method.settings.options.record_events = false;
        double once = system.run(method.settings, 1).seconds;
        if (once < batch_seconds) once = system.run(method.settings, 20).seconds;
        repeats.push_back(1 + static_cast<int>(std::min(batch_seconds / once, 1e6)));
    }
    for (std::size_t round = 0; round < rounds && !Interrupts::any(); ++round) {
        if (round >= fewest && std::chrono::steady_clock::now() - start > enough) break;
        for (std::size_t i = 0; i < methods.size(); ++i) {
            const double taken = system.run(methods[i].settings, repeats[i]).seconds;
            if (!Interrupts::any()) seconds[i].push_back(taken);
        }
    }
    for (std::size_t i = 0; i < methods.size(); ++i) {
        methods[i].timing = summarise(std::move(seconds[i]));
    }
}

/// The method with that detector, by default any of its models; null if there is none.
const Method* find(const std::vector<Method>& methods, DetectorKind detector, bool fixed_step)
{
    const auto found = std::find_if(methods.begin(), methods.end(), [&](const Method& method) {
        return method.settings.detector == detector && method.settings.fixed_step == fixed_step;
    });
    return found == methods.end() ? nullptr : &*found;
}

/// [s]
double per_step(const Method& method)
{
    return method.timing.median / static_cast<double>(method.statistics.steps);
}

/// Time of a step of `method` beyond one of `base`: "+12.3 ns".
std::string extra(const Method& method, const Method& base)
{
    return fmt::format("{:+.1f} ns", (per_step(method) - per_step(base)) * 1e9);
}

/// Verdict from the measured times, under one stepping, on whether a network before a step pays.
void add_verdict(const std::vector<Method>& methods, bool fixed_step,
                 std::vector<std::string>& sentences)
{
    const Method& ends = *find(methods, DetectorKind::ends, fixed_step);
    const Method& extremum = *find(methods, DetectorKind::extremum, fixed_step);
    std::vector<std::string> asked;
    const Method* network = nullptr;  // the cheapest
    for (const Method& method : methods) {
        const DetectorKind detector = method.settings.detector;
        if (method.settings.fixed_step != fixed_step) continue;
        if (detector != DetectorKind::network && detector != DetectorKind::line) continue;
        asked.push_back(fmt::format("{} {}", method.label, extra(method, ends)));
        const bool cheaper = network == nullptr || per_step(method) < per_step(*network);
        if (detector == DetectorKind::network && cheaper) network = &method;
    }
    if (!asked.empty()) {
        sentences.push_back(fmt::format("{}: a step takes {} with ends; asking first: {}.",
                                        ends.stepping, duration(per_step(ends)),
                                        joined(asked, ", ")));
    }
    if (network != nullptr) {
        sentences.push_back(
            fmt::format("{}: on this scene the network costs {} than the checks it saves.",
                        ends.stepping, per_step(*network) > per_step(ends) ? "more" : "less"));
    }
    if (const Method* verified = find(methods, DetectorKind::verified, fixed_step)) {
        const bool same = verified->accuracy.found == extremum.accuracy.found;
        sentences.push_back(fmt::format(
            "{}: verified deferred {} checks and takes {} a step beyond extremum ({}), with {} "
            "events.",
            verified->stepping, verified->statistics.checks_deferred, extra(*verified, extremum),
            duration(per_step(extremum)), same ? "the same" : "other"));
    }
}

/// Sentences that compare the methods; empty after an interrupt, since some were not run.
std::vector<std::string> verdict(const std::vector<Method>& methods)
{
    std::vector<std::string> sentences;
    if (Interrupts::any()) return sentences;
    add_verdict(methods, true, sentences);
    add_verdict(methods, false, sentences);
    return sentences;
}

/// Description of the known times.
std::string_view reference(const SystemEntry& system)
{
    return system.numerical_reference ? "reference" : "closed form";
}

std::string times_table(const SystemEntry& system, const std::vector<double>& exact,
                        const std::vector<Method>& methods)
{
    std::size_t wide = 19;
    for (const double t : exact) wide = std::max(wide, 1 + fmt::formatted_size("{:.15f}", t));
    std::string labels = fmt::format("{:>3}{:>{}}", "", reference(system), wide);
    std::string steppings = fmt::format("{:>3}{:>{}}", "", "t [s]", wide);
    for (const Method& method : methods) {
        if (!method.in_table) continue;
        labels += fmt::format("{:>{}}", method.label, wide);
        steppings += fmt::format("{:>{}}", method.stepping, wide);
    }
    std::string out = labels + '\n' + steppings + '\n';
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
    const auto row = [](const auto&... cells) {
        return fmt::format("{:<31}{:>9}{:>7}{:>9}{:>5}{:>6}{:>7}{:>7}{:>8}{:>8}{:>9}{:>8}\n",
                           cells...);
    };
    std::string out =
        row("", "largest", "missed", "spurious", "late", "steps", "flow", "guard", "asked",
            "checks", "time", "spread") +
        row("", "error [s]", "", "", "", "", "calls", "calls", "", "deferred", "per run", "");
    for (const Method& method : methods) {
        const Statistics& s = method.statistics;
        const Accuracy& a = method.accuracy;
        out += row(fmt::format("{}, {}", method.label, method.stepping),
                   fmt::format("{:.1e}", a.largest_error), a.missed, a.spurious, s.late_events,
                   s.steps, s.flow_calls, s.guard_calls, s.network_calls, s.checks_deferred,
                   duration(method.timing.median), spread(method.timing));
    }
    for (const Published& published : system.published) {
        const Accuracy a = judge(exact, published.times);
        out += fmt::format("{:<31}{:>9.1e}{:>7}{:>9}\n", published.name, a.largest_error, a.missed,
                           a.spurious);
    }
    return out;
}

std::string to_text(const SystemEntry& system, const std::vector<double>& exact,
                    const std::vector<Method>& methods)
{
    const RunSettings& settings = methods.front().settings;
    std::string out =
        fmt::format("{}, to t = {} s\n\n", title(system, settings), settings.options.t_end);
    out += times_table(system, exact, methods) + '\n' + cost_table(system, exact, methods) + '\n';
    if (const Method* controlled = find(methods, DetectorKind::extremum, false)) {
        const Options& options = controlled->settings.options;
        out += fmt::format("Where no step h is given the error is controlled, rtol {}, atol {}.\n",
                           options.rtol, options.atol);
    }
    if (!system.line.empty()) {
        out += fmt::format("line: the boundary itself, {}, is asked in place of a network.\n",
                           system.line);
    }
    if (!system.published.empty()) {
        out += fmt::format("paper: {}.\n", system.published.front().source);
    }
    return out + fmt::format("{}\n", joined(verdict(methods), "\n"));
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
        Json row{{"label", method.label},
                 {"detector", name(settings.detector)},
                 {"stepper", settings.stepper.name()},
                 {"step", settings.fixed_step ? Json(settings.options.step) : Json()},
                 {"rtol", settings.fixed_step ? Json() : Json(settings.options.rtol)},
                 {"atol", settings.fixed_step ? Json() : Json(settings.options.atol)},
                 {"model", settings.network ? Json(settings.model.string()) : Json()}};
        row.update(json(exact, method.accuracy));
        const Statistics& s = method.statistics;
        row["missed_events"] = s.missed_events;
        row["late"] = s.late_events;
        row["false_alarms"] = s.false_alarms;
        row["steps"] = s.steps;
        row["flow_calls"] = s.flow_calls;
        row["guard_calls"] = s.guard_calls;
        row["network_calls"] = s.network_calls;
        row["checks_deferred"] = s.checks_deferred;
        row["checks_put_off"] = s.checks_deferred;  // its name before version 0.2
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
    Json out{{"system", system.name},
             {"t_end", methods.front().settings.options.t_end},
             {"reference", exact},
             {"reference_kind", system.numerical_reference ? "numerical" : "closed form"},
             {"methods", rows},
             {"published", published},
             {"verdict", verdict(methods)}};
    if (Interrupts::any()) out["incomplete"] = Interrupts::cause();
    return json_text(out);
}

std::string to_csv(const SystemEntry& system, const std::vector<double>& exact,
                   const std::vector<Method>& methods)
{
    std::string out = fmt::format("event,{} [s]", reference(system));
    for (const Method& method : methods) {
        out += fmt::format(",{} {} [s]", method.label, method.stepping);
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
    return Interrupts::any() ? out + incomplete_line() : out;
}

}  // namespace

int compare(const CompareRequest& request)
{
    SystemEntry system = find_system(request.system);
    if (system.exact_events == nullptr) {
        throw BadInput(
            fmt::format("the system {} has no known event times to compare with", system.name));
    }
    if (!request.set.empty()) {
        if (!system.any_parameters) {
            throw BadInput(fmt::format(
                "the event times of {} are known of its default parameters only, got --set {}",
                system.name, joined(request.set, " ")));
        }
        system.published.clear();  // they are of the defaults
    }
    Claims claims;
    std::vector<Method> all = methods(system, request.set);
    const std::size_t wanted = all.size();
    for (const Method& method : all) {
        if (!method.settings.model.empty()) claims.reads("the model", method.settings.model);
    }
    if (request.csv) claims.writes("--csv", *request.csv);
    const RunSettings& settings = all.front().settings;
    const std::vector<double> exact =
        system.exact_events(settings.parameters, settings.options.t_end);
    const Interrupts interrupts;
    std::optional<RunWatch> watch(0.25);
    check_answers(system, exact, all);
    if (all.empty()) return ended_early("before anything was compared");
    measure(system, all);
    watch.reset();

    deliver(
        {[&] { print(request.json ? to_json(system, exact, all) : to_text(system, exact, all)); },
         [&] {
             if (request.csv) write_file(*request.csv, to_csv(system, exact, all));
         }});
    if (Interrupts::any()) {
        return ended_early(fmt::format("after {} of {} methods", all.size(), wanted));
    }
    const bool all_found = std::all_of(all.begin(), all.end(), [](const Method& method) {
        return method.accuracy.missed == 0 && method.accuracy.spurious == 0;
    });
    return all_found ? 0 : 1;
}

}  // namespace ricochet::app
