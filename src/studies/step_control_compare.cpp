#include "step_control_ladders.hpp"
#include "studies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "faults/fault.hpp"
#include "faults/step_progress.hpp"
#include "files.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "json_text.hpp"
#include "learn/step_environment.hpp"
#include "policy_advice.hpp"
#include "policy_lookup.hpp"
#include "registry.hpp"
#include "report.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"
#include "run_watch.hpp"
#include "settings.hpp"
#include "timing.hpp"

namespace ricochet::app {

namespace {

/// Steps by a reinforcement learner trained with the published reward, which have no tolerance.
RuleRow by_actor(const Case& of, LongRun& progress)
{
    const Model actor = shipped_actor(of.system);
    learn::StepEnvironmentOptions options = judged(actor);
    options.watch = [&](double done) {
        progress.show(fmt::format("{}: {}", of.system, reinforced), done);
        return true;
    };
    const learn::StepEnvironment runs = of.runs(options);
    RuleRow out{.rule = std::string(reinforced),
                .setting = fmt::format("alpha {}", actor.parameters.at("alpha")),
                .trial = learn::follow(runs, actor)};
    out.reached = out.trial.ended && out.trial.error <= of.target;
    out.seconds = seconds_of([&] { (void)learn::follow(runs, actor); }, 1);
    return out;
}

/// @throws Interrupted with the rows until then in `out`
void add_rows(const Case& of, std::vector<RuleRow>& out, LongRun& progress)
{
    const Ladders ladders(of, of.problem, progress);
    out.push_back(ladders.constant());
    constexpr auto doubling = ErrorEstimate::doubling;
    out.push_back(ladders.controlled("eq. 5, doubling", HeuristicStep{}, doubling));
    out.push_back(ladders.controlled("PI 3333, doubling", FilteredStep::pi3333(), doubling));
    out.push_back(ladders.controlled("h211b, doubling", FilteredStep::h211b(4), doubling));
    out.push_back(ladders.free_estimate());
    out.push_back(ladders.learned());
    const RuleRow& learned = out.back();
    if (learned.reached) {
        RuleRow optimum{.rule = std::string(searched), .setting = "as many steps"};
        const auto found =
            learn::search_steps(of.problem, static_cast<std::size_t>(learned.trial.steps),
                                of.evaluations, 1, 2, [&](double done) {
                                    progress.show(fmt::format("{}: {}", of.system, searched), done);
                                    return true;
                                });
        optimum.trial = found.trial;
        optimum.reached = found.trial.ended && found.trial.error <= of.target;
        optimum.seconds = std::numeric_limits<double>::quiet_NaN();
        out.push_back(std::move(optimum));
    }
    out.push_back(by_actor(of, progress));
    out.push_back(of.event_driven(of.target, progress));
    check_interrupt();  // its last run may have been cut short
}

/// The learned rule on problems beyond its training, beside constant steps and the free estimate.
/// @throws Interrupted; the problems done until then are in `out`
void add_beyond(const Case& of, std::vector<BeyondRows>& out, LongRun& progress)
{
    for (const Beyond& each : of.beyond) {
        const StepProblem problem = interruptible(each.problem([&](double done) {
            progress.show(fmt::format("{}: reference, {}", of.system, each.what), done);
            return true;
        }));
        const Ladders ladders(of, problem, progress);
        out.push_back({.what = each.what,
                       .description = problem.description,
                       .rows = {ladders.constant(), ladders.free_estimate(), ladders.learned()}});
    }
}

/// By hand-over between explicit steps and set-valued ones, as `ricochet simulate` does it.
RuleRow by_hand_over(const std::string& name, const std::vector<std::string>& set, double target)
{
    const SystemEntry& system = find_system(name);
    const auto at = [&](double rtol, bool sampled) {
        RunRequest request;
        request.set = set;
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
        check_interrupt();
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

RuleRow by_explicit_pair(const StrikeSlipFault& fault, double t_end, double target,
                         LongRun& progress)
{
    RuptureOptions options{.t_end = t_end, .rtol = inf};
    options.progress = [](double) { return !Interrupts::any(); };
    for (std::size_t i = 1; i <= samples; ++i) {
        options.snapshot_times.push_back(i == samples ? t_end
                                                      : t_end * static_cast<double>(i) / samples);
    }
    options.step = 0.01 * fault.time_unit();
    const Rupture exact = ricochet::simulate(fault, shown(options, progress, "fault: reference"));
    RuleRow out{.rule = "event-driven explicit"};
    for (int i = 0; i < 24 && !out.reached; ++i) {
        check_interrupt();
        options.step = 0.4 * fault.time_unit() * std::pow(10.0, -i / 6.0);
        const Rupture run =
            ricochet::simulate(fault, shown(options, progress, "fault: explicit steps"));
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
    out.seconds = seconds_of([&] { (void)ricochet::simulate(fault, options); }, 1);
    return out;
}

/// The value of a parameter of an entry, by name.
double value_of(const SystemEntry& entry, const std::vector<double>& values, std::string_view name)
{
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (entry.parameters[i].name == name) return values[i];
    }
    throw std::logic_error(fmt::format("{} has no parameter {}", entry.name, name));
}

Case sliding_mode_case(const std::vector<std::string>& set)
{
    const SystemEntry& entry = find_system(SlidingMode::name);
    const std::vector<double> values = parameter_values(entry, set);
    const auto value = [&](std::string_view name) { return value_of(entry, values, name); };
    const SlidingMode::Parameters p{
        .amplitude = value("amplitude"), .frequency = value("frequency"), .gain = value("gain")};
    const double from = value("start");
    if (!(p.gain > p.amplitude && from > 0)) {
        throw BadInput(fmt::format(
            "compare step-control knows the solution of the sliding mode for gain > amplitude and "
            "start > 0, got gain = {}, amplitude = {}, start = {}",
            p.gain, p.amplitude, from));
    }
    const auto problem = [](const SlidingMode::Parameters& parameters, double start) {
        return [=](const learn::StepWatch&) {
            const SlidingMode mode(parameters);
            return learn::sliding_mode_problem(mode, start, mode.reaching_time(start) / 0.4);
        };
    };
    constexpr double t_end = SlidingMode::t_end;
    Case out{.system = std::string(SlidingMode::name),
             .problem = learn::sliding_mode_problem(SlidingMode(p), from, t_end),
             .layout = SlidingMode::step_layout(),
             .target = 1e-3,
             .event_driven =
                 [set](double target, LongRun&) {
                     return by_hand_over(std::string(SlidingMode::name), set, target);
                 },
             .runs =
                 [p, from](const learn::StepEnvironmentOptions& options) {
                     return learn::step_environment(SlidingMode(p), from, t_end, options);
                 }};
    if (set.empty()) {
        out.beyond = {{"frequency 400 rad/s", problem({.frequency = 400}, SlidingMode::start)},
                      {"start 2", problem({}, 2)}};
    }
    return out;
}

Case diode_circuit_case(const std::vector<std::string>& set)
{
    const SystemEntry& entry = find_system(DiodeCircuit::name);
    const std::vector<double> values = parameter_values(entry, set);
    const auto value = [&](std::string_view name) { return value_of(entry, values, name); };
    const DiodeCircuit circuit({.capacitance_1 = value("capacitance-1"),
                                .capacitance_2 = value("capacitance-2"),
                                .resistance = value("resistance"),
                                .inductance = value("inductance"),
                                .current = value("current")});
    const Eigen::Vector3d start(value("V1"), value("V2"), value("i"));
    constexpr double t_end = DiodeCircuit::t_end;
    const auto problem = [start](const DiodeCircuit::Parameters& parameters) {
        return [=](const learn::StepWatch&) {
            return learn::diode_circuit_problem(DiodeCircuit(parameters), start, t_end);
        };
    };
    Case out{.system = std::string(DiodeCircuit::name),
             .problem = learn::diode_circuit_problem(circuit, start, t_end),
             .layout = DiodeCircuit::step_layout(),
             .event_driven =
                 [set](double target, LongRun&) {
                     return by_hand_over(std::string(DiodeCircuit::name), set, target);
                 },
             .runs =
                 [circuit, start](const learn::StepEnvironmentOptions& options) {
                     return learn::step_environment(circuit, start, t_end, options);
                 }};
    if (set.empty()) {
        DiodeCircuit::Parameters more_current;
        more_current.current *= 5;
        DiodeCircuit::Parameters more_resistance;
        more_resistance.resistance *= 10;
        out.beyond = {{"current x 5", problem(more_current)},
                      {"resistance x 10", problem(more_resistance)}};
    }
    return out;
}

Case fault_case(const std::vector<std::string>& set, LongRun& progress)
{
    const SystemEntry& entry = find_system(StrikeSlipFault::name);
    refuse_rate_and_state(set, entry);
    StrikeSlipFault::Parameters parameters = fault_parameters(parameter_values(entry, set));
    const bool given = std::any_of(set.begin(), set.end(),
                                   [](const auto& text) { return text.starts_with("elements="); });
    if (!given) parameters.elements = 5;
    constexpr int most = 50;
    if (parameters.elements > most) {
        throw BadInput(fmt::format("compare step-control takes at most {0} x {0} elements, got {1}",
                                   most, parameters.elements));
    }
    const StrikeSlipFault fault(parameters);
    const double t_end = parameters.side > 4000 ? 50 : 30;
    const auto watch = [&](double done) {
        progress.show("fault: reference", done);
        return true;
    };
    Case out{.system = std::string(StrikeSlipFault::name),
             .problem = learn::fault_problem(fault, t_end, 0, watch),
             .layout = fault_step_layout(),
             .evaluations = parameters.elements > 6 ? 500U : 2000U,
             .event_driven =
                 [fault, t_end](double target, LongRun& run) {
                     return by_explicit_pair(fault, t_end, target, run);
                 },
             .runs =
                 [fault, t_end](const learn::StepEnvironmentOptions& options) {
                     return learn::step_environment(fault, t_end, options);
                 }};
    if (!set.empty()) return out;
    const auto beyond = [&](std::string what, StrikeSlipFault::Parameters p) {
        p.elements = parameters.elements;
        out.beyond.push_back({std::move(what), [p](const learn::StepWatch& shown) {
                                  constexpr double ends = 30 / 0.8660254037844386;  // 30 s at 3 km
                                  const StrikeSlipFault other(p);
                                  return learn::fault_problem(other, ends * other.time_unit(), 0,
                                                              shown);
                              }});
    };
    beyond("damping 0.05", {.damping = 0.05});
    beyond("damping 0.8", {.damping = 0.8});
    beyond("side 12 km", {.side = 12000});
    beyond("overload 1e-2", {.overload = 1e-2});
    return out;
}

Case case_of(const std::string& system, const CompareRequest& request, LongRun& progress)
{
    if (system == SlidingMode::name) return sliding_mode_case(request.set);
    if (system == DiodeCircuit::name) return diode_circuit_case(request.set);
    return fault_case(request.set, progress);
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
    for (const RuleRow& row : rows) {
        if (row.given_up == 0) continue;
        out += fmt::format(
            "{}: {} {} given up, where {} steps covered less than 0.1 % of the time\n", row.rule,
            row.given_up, row.given_up == 1 ? "setting" : "settings", Standstill::standstill);
    }
    return out;
}

std::string table(const Case& of, const std::vector<BeyondRows>& beyond)
{
    if (beyond.empty()) return "";
    std::string out = fmt::format(
        "\noutside what its policy was trained for\n{:<24}{:<16}{:>14}{:>7}{:>6}{:>8}{:>8}"
        "{:>10}{:>10}{:>14}\n",
        "", "", "setting", "steps", "rej.", "solves", "iter.", "error", "at end", "left to rule");
    for (const BeyondRows& problem : beyond) {
        std::string_view name = problem.what;
        for (const RuleRow& row : problem.rows) {
            const StepTrial& t = row.trial;
            out += fmt::format("{:<24}{:<16}", name, row.rule);
            name = "";
            if (!row.reached) {
                out += fmt::format("{:>14}\n", "not reached");
                continue;
            }
            out += fmt::format("{:>14}{:>7}{:>6}{:>8}{:>8}{:>10.2e}{:>10.2e}{:>14}\n", row.setting,
                               t.steps, t.rejected, t.solves, t.iterations, t.error, t.final_error,
                               t.asked > 0 ? fmt::format("{} of {}", t.handed_over, t.asked) : "-");
        }
    }
    return out + std::string(policy_advice(of.system)) + '\n';
}

Json json(const std::vector<RuleRow>& rows)
{
    Json list = Json::array();
    for (const RuleRow& row : rows) {
        const StepTrial& t = row.trial;
        list.push_back({{"rule", row.rule},
                        {"setting", row.setting},
                        {"reached", row.reached},
                        {"given_up", row.given_up},
                        {"steps", t.steps},
                        {"rejected", t.rejected},
                        {"solves", t.solves},
                        {"iterations", t.iterations},
                        {"asked", t.asked},
                        {"handed_over", t.handed_over},
                        {"seconds", row.seconds},
                        {"error", t.error},
                        {"final_error", t.final_error}});
    }
    return list;
}

Json json(const Case& of, const std::vector<RuleRow>& rows, const std::vector<BeyondRows>& beyond)
{
    Json out{{"system", of.system},
             {"problem", of.problem.description},
             {"target", of.target},
             {"rules", json(rows)}};
    for (const BeyondRows& problem : beyond) {
        out["beyond"].push_back({{"what", problem.what},
                                 {"problem", problem.description},
                                 {"rules", json(problem.rows)}});
    }
    if (!beyond.empty()) out["advice"] = policy_advice(of.system);
    return out;
}

}  // namespace

double seconds_of(const std::function<void()>& work, double enough)
{
    double best = inf;
    double all = 0;
    for (int i = 0; i < 5 && all < enough; ++i) {
        const auto start = std::chrono::steady_clock::now();
        work();
        const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
        best = std::min(best, taken.count());
        all += taken.count();
    }
    return best;
}

int compare_step_control(const CompareRequest& request)
{
    const std::string system = request.of.value_or("");
    if (request.csv) throw BadInput("--csv is of event times; take --json");
    const std::vector<std::string_view> known{SlidingMode::name, DiodeCircuit::name, "fault"};
    std::vector<std::string> wanted{system};
    if (system.empty()) {
        wanted.assign(known.begin(), known.end());
    } else if (std::find(known.begin(), known.end(), system) == known.end()) {
        throw unknown("system of compare step-control", system, known);
    }
    if (!request.set.empty() && system.empty()) {
        throw BadInput("--set of compare step-control needs a --system");
    }
    LongRun progress;
    // Everything is checked before the first run.
    std::vector<Case> cases;
    for (const std::string& name : wanted) {
        cases.push_back(case_of(name, request, progress));
        (void)named_policy(cases.back().layout, std::nullopt);
        (void)shipped_actor(name);
    }
    const Interrupts interrupts;
    const RunWatch watch(0.25);
    bool all = true;
    Json list = Json::array();
    for (Case& each : cases) {
        if (Interrupts::any()) break;
        std::vector<RuleRow> rows;
        std::vector<BeyondRows> beyond;
        each.problem = interruptible(std::move(each.problem));
        try {
            add_rows(each, rows, progress);
            add_beyond(each, beyond, progress);
        } catch (const Interrupted&) {
            if (rows.empty()) break;
        }
        progress.clear();
        all = all && std::all_of(rows.begin(), rows.end(), [](const RuleRow& r) {
                  return r.reached || is_yardstick(r.rule);
              });
        if (request.json) {
            list.push_back(json(each, rows, beyond));
        } else {
            print(table(each, rows) + table(each, beyond) + '\n');
        }
    }
    Json out{{"cases", std::move(list)}};
    if (Interrupts::any()) out["incomplete"] = Interrupts::cause();
    if (request.json) print(json_text(out));
    if (Interrupts::any()) return ended_early("within the comparison");
    return all ? 0 : 1;
}

}  // namespace ricochet::app
