#include "set_valued.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "files.hpp"
#include "input.hpp"
#include "interrupt.hpp"
#include "policy_lookup.hpp"
#include "report.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"
#include "run_watch.hpp"
#include "systems/inclusion_options.hpp"
#include "timing.hpp"

namespace ricochet::app {

namespace {

constexpr double default_rtol = 1e-10;
constexpr double default_atol = 1e-12;
constexpr double default_rtol_of_steps = 1e-3;
constexpr double default_atol_of_steps = 1e-6;

std::string one_of(std::string_view what, const std::optional<std::string>& given,
                   const std::vector<std::string_view>& known)
{
    if (!given) return std::string(known.front());
    if (std::find(known.begin(), known.end(), *given) == known.end()) {
        throw unknown(what, *given, known);
    }
    return *given;
}

void refuse(bool given, std::string_view option, std::string_view why)
{
    if (given) throw BadInput(fmt::format("{} {}", option, why));
}

double tolerance(std::string_view option, const std::optional<double>& given, double otherwise)
{
    if (given && !(*given >= 0)) {
        throw BadInput(fmt::format("{} must be zero or positive, got {}", option, *given));
    }
    return given.value_or(otherwise);
}

/// What the policies of a system are asked about.
/// @throws BadInput naming the systems that have some.
const StepLayout& layout_of(const SystemEntry& system)
{
    const std::vector<std::string_view> known{SlidingMode::name, DiodeCircuit::name, "fault"};
    if (system.name == known[0]) return SlidingMode::step_layout();
    if (system.name == known[1]) return DiodeCircuit::step_layout();
    throw unknown("system for --controller learned", system.name, known);
}

StepController controller(const SetValuedSettings& settings)
{
    const std::string& name = settings.controller;
    if (name == "learned") return LearnedStep{.policy = settings.policy};
    if (name == "error") return ErrorStep{.order = 3, .reject_above = 100};
    if (name == "heuristic") return HeuristicStep{};
    if (name == "pi") return FilteredStep::pi3333();
    if (name == "filter") return FilteredStep::h211b(4);
    return ConstantStep{};
}

}  // namespace

bool choose_set_valued(const SystemEntry& system, const RunRequest& request, RunSettings& settings)
{
    if (system.integrators.empty()) {
        if (request.integrator && *request.integrator != "event") {
            throw BadInput(
                fmt::format("--integrator {} is for differential inclusions, and {} is none; "
                            "expected event",
                            *request.integrator, system.name));
        }
        refuse(request.controller.has_value(), "--controller",
               "is for --integrator bathe of differential inclusions");
        return false;
    }
    SetValuedSettings chosen;
    chosen.integrator = one_of("integrator", request.integrator, system.integrators);
    if (system.integrators.front() == "event" && chosen.integrator == "event") {
        refuse(request.controller.has_value(), "--controller", "is for --integrator bathe");
        return false;
    }
    chosen.controller = one_of("controller", request.controller,
                               {"constant", "error", "heuristic", "pi", "filter", "learned"});
    const bool steps = chosen.integrator == "bathe" || chosen.integrator == "time-stepping";
    const bool controlled = chosen.controller != "constant";
    refuse(controlled && chosen.integrator != "bathe", "--controller", "is for --integrator bathe");
    refuse(request.detector && *request.detector != "extremum", "--detector",
           "of a differential inclusion can only be extremum");
    refuse(request.locator && *request.locator != "newton", "--locator",
           "of a differential inclusion can only be newton");
    const bool learned = chosen.controller == "learned";
    refuse(request.model && !learned, "--model",
           "of a differential inclusion is for --controller learned");
    refuse(request.atol && measured_by_norm(chosen), "--atol",
           "is not for --controller error and learned, whose errors are relative to the norm of "
           "the start");
    if (learned) {
        settings.model = policy_file(layout_of(system), request.model);
        chosen.policy = named_policy(layout_of(system), request.model);
    }
    refuse(request.gate.has_value(), "--gate", "is not for differential inclusions");
    refuse(request.mode.has_value(), "--mode",
           "of a differential inclusion follows from its state");
    refuse(steps && request.stepper, "--stepper", "is for --integrator handover and event");
    refuse(steps && !controlled && (request.rtol || request.atol), "--rtol and --atol",
           "need a --controller that looks at errors");
    refuse(!steps && request.step && chosen.integrator == "event", "--step",
           "is for set-valued steps, and --integrator event has none");
    chosen.step = request.step.value_or(system.set_valued_step);
    if (!(chosen.step > 0)) {
        throw BadInput(fmt::format("--step must be positive, got {}", chosen.step));
    }
    if (request.stepper) {
        const std::string stepper = one_of("stepper of a differential inclusion", request.stepper,
                                           {"dopri5", "fehlberg78"});
        if (stepper == "fehlberg78") settings.stepper = MethodName::fehlberg78;
    }
    Options& options = settings.options;
    if (!(options.t_end >= options.t_start)) {
        throw BadInput(
            fmt::format("a differential inclusion runs forward in time; expected --t-end "
                        "of at least {}, got {}",
                        options.t_start, options.t_end));
    }
    options.rtol = tolerance("--rtol", request.rtol, steps ? default_rtol_of_steps : default_rtol);
    options.atol = tolerance("--atol", request.atol, steps ? default_atol_of_steps : default_atol);
    if (options.rtol + options.atol == 0) {
        throw BadInput("--rtol or --atol must be positive, got zero for both");
    }
    settings.fixed_step = steps && !controlled;
    options.step = settings.fixed_step ? chosen.step : 0;
    settings.set_valued = std::move(chosen);
    return true;
}

bool measured_by_norm(const SetValuedSettings& settings) noexcept
{
    return settings.controller == "error" || settings.controller == "learned";
}

SetValuedOptions set_valued_options(const RunSettings& settings)
{
    const SetValuedSettings& chosen = settings.set_valued.value();
    SetValuedOptions options;
    options.t_start = settings.options.t_start;
    options.t_end = settings.options.t_end;
    options.step = chosen.step;
    options.controller = controller(chosen);
    options.rtol = settings.options.rtol;
    options.atol = settings.options.atol;
    options.max_attempts = settings.options.max_steps;
    if (measured_by_norm(chosen)) {
        options.estimate = ErrorEstimate::embedded;
        options.scheme.first_stage = FirstStage::switch_aware;
    } else if (chosen.controller != "constant") {
        // As the source of these rules estimates and limits.
        options.estimate = ErrorEstimate::doubling;
        options.error_order = 1;
        options.h_max = 10 * chosen.step;
    }
    if (chosen.integrator == "time-stepping") options.scheme.scheme = Scheme::backward_euler;
    return options;
}

Outcome as_outcome(HandOverOutcome outcome) noexcept
{
    switch (outcome) {
        case HandOverOutcome::reached_end: return Outcome::reached_end;
        case HandOverOutcome::law_violated:
        case HandOverOutcome::not_converged: return Outcome::not_converged;
        case HandOverOutcome::step_underflow: return Outcome::step_underflow;
        case HandOverOutcome::step_limit: return Outcome::step_limit;
        case HandOverOutcome::non_finite: return Outcome::non_finite;
        case HandOverOutcome::cancelled: return Outcome::cancelled;
        case HandOverOutcome::released: return Outcome::reached_end;
        case HandOverOutcome::not_handed_over: break;
    }
    return Outcome::zeno;
}

Outcome as_outcome(SetValuedOutcome outcome) noexcept
{
    switch (outcome) {
        case SetValuedOutcome::not_converged: return Outcome::not_converged;
        case SetValuedOutcome::step_underflow: return Outcome::step_underflow;
        case SetValuedOutcome::step_limit: return Outcome::step_limit;
        case SetValuedOutcome::running: return Outcome::cancelled;
        default: return Outcome::reached_end;
    }
}

std::string describe_integration(const RunSettings& settings)
{
    if (!settings.set_valued) return describe_stepping(settings);
    const SetValuedSettings& chosen = *settings.set_valued;
    if (chosen.integrator == "time-stepping") {
        return fmt::format("time-stepping, step {} s", chosen.step);
    }
    if (chosen.integrator != "bathe") {
        return fmt::format("{}: {}", chosen.integrator, describe_stepping(settings));
    }
    if (chosen.controller == "constant") return fmt::format("bathe, step {} s", chosen.step);
    return fmt::format("bathe, {}, first step {} s, rtol {}, atol {}", chosen.controller,
                       chosen.step, settings.options.rtol, settings.options.atol);
}

std::string set_valued_text(const TimedRun& timed)
{
    std::string out;
    if (timed.steps) {
        const SetValuedSteps& s = *timed.steps;
        out +=
            fmt::format("\nset-valued: {} steps attempted, {} accepted, {} solves, {} iterations",
                        s.attempted, s.accepted, s.solves, s.iterations);
    }
    for (const HandOverPhase& phase : timed.phases) {
        out += fmt::format("\nfrom {} s {}: {}", phase.from,
                           phase.set_valued ? "set-valued" : "event-driven", phase.cause);
    }
    return out;
}

void add_set_valued(Json& out, const RunSettings& settings, const TimedRun& timed)
{
    if (!settings.set_valued) return;
    out["integrator"] = settings.set_valued->integrator;
    out["controller"] = settings.set_valued->controller;
    out["set_valued_step"] = settings.set_valued->step;
    if (timed.steps) {
        const SetValuedSteps& s = *timed.steps;
        out["set_valued_statistics"] = {{"attempted", s.attempted}, {"accepted", s.accepted},
                                        {"rejected", s.rejected},   {"unsolved", s.unsolved},
                                        {"solves", s.solves},       {"iterations", s.iterations},
                                        {"switches", s.switches}};
    }
    Json phases = Json::array();
    for (const HandOverPhase& phase : timed.phases) {
        phases.push_back(
            {{"from", phase.from}, {"set_valued", phase.set_valued}, {"cause", phase.cause}});
    }
    out["phases"] = std::move(phases);
}

// --- comparison ---

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
        // Fehlberg's error estimate is blind to rates of time alone.
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

}  // namespace

int compare_set_valued(const SystemEntry& system, const CompareRequest& request)
{
    RunRequest base;
    base.set = request.set;
    const RunSettings settings = resolve(system, base);
    Claims claims;
    if (request.csv) claims.writes("--csv", *request.csv);
    std::vector<double> times(grid);
    const double start = settings.options.t_start;
    const double span = settings.options.t_end - start;
    for (std::size_t i = 0; i < grid; ++i) {
        times[i] = start + span * static_cast<double>(i) / static_cast<double>(grid - 1);
    }
    times.back() = settings.options.t_end;
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
    Json methods = Json::array();
    std::string csv = "method,steps,solves,events,seconds,L2,relative,largest\n";
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
        csv += fmt::format("\"{}\",{},{},{},{},{},{},{}\n", row.label, row.steps, row.solves,
                           row.events, row.seconds, row.l2, row.relative, row.largest);
    }
    json["methods"] = std::move(methods);
    // They are of the defaults.
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
