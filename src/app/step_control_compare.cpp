#include "step_control_compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "files.hpp"
#include "input.hpp"
#include "json_text.hpp"
#include "registry.hpp"
#include "report.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/fault_bathe.hpp"
#include "ricochet/systems/sliding_mode.hpp"
#include "settings.hpp"
#include "step_actor.hpp"
#include "step_policy.hpp"
#include "systems/fault.hpp"
#include "timing.hpp"

namespace ricochet::app {

namespace {

using learn::StepProblem;
using learn::StepRule;
using learn::StepTrial;

constexpr double inf = std::numeric_limits<double>::infinity();
constexpr std::size_t samples = 600;

// Yardsticks: they need not reach the target.
constexpr std::string_view searched = "searched sequence";
constexpr std::string_view reinforced = "TQC, eq. 7";

bool is_yardstick(const std::string& rule)
{
    return rule == searched || rule == reinforced;
}

struct RuleRow {
    std::string rule{};
    std::string setting{};
    StepTrial trial{};
    double seconds = 0;
    bool reached = false;
};

/// A problem with what is particular to it.
struct Case {
    std::string system;
    StepProblem problem;
    StepLayout layout;
    double target = 1e-2;
    double coarsest = 0.1;     ///< tolerance that a ladder begins with
    double constant_span = 8;  ///< its constant steps, over the usual one
    std::size_t evaluations = 6000;
    std::function<RuleRow(double target)> event_driven{};
    std::function<learn::StepWorld(const learn::StepWorldOptions& options)> world{};
};

double seconds_of(const std::function<void()>& work)
{
    double best = inf;
    for (int i = 0; i < 5; ++i) {
        const auto start = std::chrono::steady_clock::now();
        work();
        const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
        best = std::min(best, taken.count());
    }
    return best;
}

/// The coarsest rule of a ladder from which on the error stays below the target.
RuleRow coarsest(const Case& of, std::string name,
                 const std::function<std::pair<StepRule, std::string>(int)>& rung)
{
    constexpr int rungs = 40;
    constexpr int enough = 4;  // finer ones that are looked at, too
    RuleRow out{.rule = std::move(name)};
    int below = 0;
    int first = -1;
    for (int i = 0; i < rungs && below <= enough; ++i) {
        const StepTrial trial = of.problem.run(rung(i).first);
        const bool good = trial.ended && trial.error <= of.target;
        below = good ? below + 1 : 0;
        first = !good ? -1 : first < 0 ? i : first;
    }
    if (first < 0) return out;
    const auto [rule, setting] = rung(first);
    out.setting = setting;
    out.reached = true;
    out.trial = of.problem.run(rule);
    out.seconds = seconds_of([&] { (void)of.problem.run(rule); });
    return out;
}

/// What a reinforcement learner made of the published reward: steps without a tolerance.
RuleRow by_actor(const Case& of)
{
    const Model actor = shipped_actor(of.system);
    const learn::StepWorld world = of.world(judged(actor));
    RuleRow out{.rule = std::string(reinforced),
                .setting = fmt::format("alpha {}", actor.parameters.at("alpha")),
                .trial = learn::follow(world, actor)};
    out.reached = out.trial.ended && out.trial.error <= of.target;
    out.seconds = seconds_of([&] { (void)learn::follow(world, actor); });
    return out;
}

std::vector<RuleRow> rows_of(const Case& of)
{
    std::vector<RuleRow> out;
    const auto finer = [](int i) { return std::pow(10.0, -i / 6.0); };
    out.push_back(coarsest(of, "constant", [&](int i) {
        const double step = of.constant_span * finer(i);
        return std::pair(StepRule{.controller = ConstantStep{}, .step = step},
                         fmt::format("{:.3g} s", step * of.problem.usual_step));
    }));
    const auto controlled = [&](std::string name, const StepController& controller,
                                ErrorEstimate estimate) {
        out.push_back(coarsest(of, std::move(name), [&, estimate](int i) {
            const double tolerance = of.coarsest * finer(i);
            return std::pair(
                StepRule{.controller = controller, .tolerance = tolerance, .estimate = estimate},
                fmt::format("{:.1e}", tolerance));
        }));
    };
    controlled("eq. 5, doubling", HeuristicStep{}, ErrorEstimate::doubling);
    controlled("PI 3333, doubling", FilteredStep::pi3333(), ErrorEstimate::doubling);
    controlled("h211b, doubling", FilteredStep::h211b(4), ErrorEstimate::doubling);
    const ErrorStep plain{.order = 3, .reject_above = 100};
    controlled("free estimate", plain, ErrorEstimate::embedded);
    const auto policy = named_policy(of.layout, std::nullopt);
    controlled("learned", LearnedStep{.policy = policy, .plain = plain}, ErrorEstimate::embedded);
    const RuleRow& learned = out.back();
    if (learned.reached) {
        RuleRow optimum{.rule = std::string(searched), .setting = "as many steps"};
        const auto found = learn::search_steps(
            of.problem, static_cast<std::size_t>(learned.trial.steps), of.evaluations);
        optimum.trial = found.trial;
        optimum.reached = found.trial.ended && found.trial.error <= of.target;
        optimum.seconds = std::numeric_limits<double>::quiet_NaN();
        out.push_back(std::move(optimum));
    }
    out.push_back(by_actor(of));
    out.push_back(of.event_driven(of.target));
    return out;
}

/// By hand-over between explicit steps and set-valued ones, as `ricochet simulate` does it.
RuleRow by_hand_over(const std::string& name, double target)
{
    const SystemEntry& system = find_system(name);
    const auto at = [&](double rtol, bool sampled) {
        RunRequest request;
        request.rtol = request.atol = rtol;
        if (system.state.size() > 1) request.stepper = "fehlberg78";
        RunSettings settings = resolve(system, request);
        const double span = settings.options.t_end - settings.options.t_start;
        for (std::size_t i = 1; sampled && i <= samples; ++i) {
            settings.options.sample_times.push_back(
                i == samples ? settings.options.t_end
                             : settings.options.t_start + span * static_cast<double>(i) / samples);
        }
        return settings;
    };
    const TimedRun exact = system.run(at(1e-13, true), 1);
    RuleRow out{.rule = "event-driven explicit"};
    for (int i = 0; i < 24 && !out.reached; ++i) {
        const double rtol = std::pow(10.0, -1 - i / 2.0);
        const TimedRun timed = system.run(at(rtol, true), 1);
        const auto& x = timed.run.trajectory.x;
        const auto& y = exact.run.trajectory.x;
        if (x.size() != y.size()) continue;
        double of_error = 0;
        double of_all = 0;
        for (std::size_t k = 0; k < x.size(); ++k) {
            for (std::size_t j = 0; j < x[k].size(); ++j) {
                of_error += (x[k][j] - y[k][j]) * (x[k][j] - y[k][j]);
                of_all += y[k][j] * y[k][j];
            }
        }
        out.trial.error = std::sqrt(of_error / of_all);
        out.trial.final_error = std::numeric_limits<double>::quiet_NaN();
        out.trial.steps = timed.run.statistics.steps;
        out.setting = fmt::format("{:.1e}", rtol);
        out.reached = out.trial.error <= target;
        out.seconds = inf;
        for (int batch = 0; batch < 5; ++batch) {
            out.seconds = std::min(out.seconds, system.run(at(rtol, false), 1).seconds);
        }
    }
    out.trial.ended = out.reached;
    return out;
}

RuleRow by_explicit_pair(const StrikeSlipFault& fault, double t_end, double target)
{
    RuptureOptions options{.t_end = t_end, .rtol = inf};
    for (std::size_t i = 1; i <= samples; ++i) {
        options.snapshot_times.push_back(i == samples ? t_end
                                                      : t_end * static_cast<double>(i) / samples);
    }
    options.step = 0.01 * fault.time_unit();
    const Rupture exact = ricochet::simulate(fault, options);
    RuleRow out{.rule = "event-driven explicit"};
    for (int i = 0; i < 24 && !out.reached; ++i) {
        options.step = 0.4 * fault.time_unit() * std::pow(10.0, -i / 6.0);
        const Rupture run = ricochet::simulate(fault, options);
        if (run.snapshots.size() != exact.snapshots.size()) continue;
        double of_error = 0;
        double of_all = 0;
        for (std::size_t k = 0; k < run.snapshots.size(); ++k) {
            of_error += (run.snapshots[k].velocity - exact.snapshots[k].velocity).squaredNorm();
            of_all += exact.snapshots[k].velocity.squaredNorm();
        }
        out.trial.error = std::sqrt(of_error / of_all);
        out.trial.final_error = std::abs(run.mean_slip / exact.mean_slip - 1);
        out.trial.steps = run.statistics.steps;
        out.setting = fmt::format("{:.3g} s", run.longest_step);
        out.reached = out.trial.error <= target;
    }
    out.trial.ended = out.reached;
    options.snapshot_times.clear();
    out.seconds = seconds_of([&] { (void)ricochet::simulate(fault, options); });
    return out;
}

Case case_of(const std::string& system, const CompareRequest& request)
{
    if (system == SlidingMode::name) {
        return {.system = system,
                .problem = learn::sliding_mode_problem(SlidingMode{}, SlidingMode::start,
                                                       SlidingMode::t_end),
                .layout = SlidingMode::step_layout(),
                .target = 1e-3,
                .event_driven = [system](double target) { return by_hand_over(system, target); },
                .world =
                    [system](const learn::StepWorldOptions& options) {
                        return source_world(system, options);
                    }};
    }
    if (system == DiodeCircuit::name) {
        return {.system = system,
                .problem = learn::diode_circuit_problem(DiodeCircuit{}, DiodeCircuit::start(),
                                                        DiodeCircuit::t_end),
                .layout = DiodeCircuit::step_layout(),
                .event_driven = [system](double target) { return by_hand_over(system, target); },
                .world =
                    [system](const learn::StepWorldOptions& options) {
                        return source_world(system, options);
                    }};
    }
    const SystemEntry& entry = find_system("fault");
    refuse_rate_and_state(request.set, entry);
    StrikeSlipFault::Parameters parameters = fault_parameters(parameter_values(entry, request.set));
    const bool given = std::any_of(request.set.begin(), request.set.end(),
                                   [](const auto& text) { return text.starts_with("elements="); });
    if (!given) parameters.elements = 5;
    constexpr int most = 50;
    if (parameters.elements > most) {
        throw BadInput(fmt::format("compare step-control takes at most {0} x {0} elements, got {1}",
                                   most, parameters.elements));
    }
    const StrikeSlipFault fault(parameters);
    const double t_end = parameters.side > 4000 ? 50 : 30;
    return {.system = system,
            .problem = learn::fault_problem(fault, t_end),
            .layout = fault_step_layout(),
            .evaluations = parameters.elements > 6 ? 500U : 2000U,
            .event_driven =
                [fault, t_end](double target) { return by_explicit_pair(fault, t_end, target); },
            .world =
                [fault, t_end](const learn::StepWorldOptions& options) {
                    return learn::step_world(fault, t_end, options);
                }};
}

std::string table(const Case& of, const std::vector<RuleRow>& rows)
{
    std::string out = fmt::format(
        "{}: the coarsest setting from which on the true error, relative L2 over time, stays "
        "below {:.0e}\n\n{:<24}{:>14}{:>7}{:>6}{:>8}{:>8}{:>12}{:>10}{:>10}\n",
        of.problem.description, of.target, "", "setting", "steps", "rej.", "solves", "iter.",
        "time", "error", "at end");
    for (const RuleRow& row : rows) {
        const StepTrial& t = row.trial;
        if (!row.reached && !(row.rule == reinforced && t.ended)) {
            const bool stuck = row.rule == reinforced;
            out += fmt::format("{:<24}{:>14}\n", row.rule, stuck ? "has no end" : "not reached");
            continue;
        }
        const bool implicit = t.solves > 0;
        out +=
            fmt::format("{:<24}{:>14}{:>7}{:>6}{:>8}{:>8}{:>12}{:>10.2e}{:>10}\n", row.rule,
                        row.setting, t.steps, t.rejected, implicit ? std::to_string(t.solves) : "-",
                        implicit ? std::to_string(t.iterations) : "-",
                        std::isnan(row.seconds) ? "-" : duration(row.seconds), t.error,
                        std::isnan(t.final_error) ? "-" : fmt::format("{:.2e}", t.final_error));
    }
    const bool above = std::any_of(rows.begin(), rows.end(), [](const RuleRow& r) {
        return r.rule == reinforced && r.trial.ended && !r.reached;
    });
    if (above) out += fmt::format("{}: has no tolerance, and stays above that error\n", reinforced);
    return out;
}

Json json(const Case& of, const std::vector<RuleRow>& rows)
{
    Json list = Json::array();
    for (const RuleRow& row : rows) {
        const StepTrial& t = row.trial;
        list.push_back({{"rule", row.rule},
                        {"setting", row.setting},
                        {"reached", row.reached},
                        {"steps", t.steps},
                        {"rejected", t.rejected},
                        {"solves", t.solves},
                        {"iterations", t.iterations},
                        {"seconds", row.seconds},
                        {"error", t.error},
                        {"final_error", t.final_error}});
    }
    return {{"system", of.system},
            {"problem", of.problem.description},
            {"target", of.target},
            {"rules", std::move(list)}};
}

}  // namespace

int compare_step_control(const CompareRequest& request, const std::string& system)
{
    if (request.csv) throw BadInput("--csv is of event times; take --json");
    const std::vector<std::string_view> known{SlidingMode::name, DiodeCircuit::name, "fault"};
    std::vector<std::string> wanted{system};
    if (system.empty()) {
        wanted.assign(known.begin(), known.end());
    } else if (std::find(known.begin(), known.end(), system) == known.end()) {
        throw unknown("system of compare step-control", system, known);
    }
    if (!request.set.empty() && system != "fault") {
        throw BadInput("--set of compare step-control needs --system fault");
    }
    // All is checked before anything is run.
    std::vector<Case> cases;
    for (const std::string& name : wanted) {
        cases.push_back(case_of(name, request));
        (void)named_policy(cases.back().layout, std::nullopt);
        (void)shipped_actor(name);
    }
    bool all = true;
    Json list = Json::array();
    for (const Case& each : cases) {
        const std::vector<RuleRow> rows = rows_of(each);
        all = all && std::all_of(rows.begin(), rows.end(), [](const RuleRow& r) {
                  return r.reached || is_yardstick(r.rule);
              });
        if (request.json) {
            list.push_back(json(each, rows));
        } else {
            print(table(each, rows) + '\n');
        }
    }
    if (request.json) print(json_text({{"cases", std::move(list)}}));
    return all ? 0 : 1;
}

}  // namespace ricochet::app
