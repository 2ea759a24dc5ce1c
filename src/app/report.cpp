#include "report.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <limits>

#include "files.hpp"
#include "interrupt.hpp"
#include "joined.hpp"
#include "json_text.hpp"
#include "say.hpp"
#include "set_valued.hpp"
#include "timing.hpp"

namespace ricochet::app {

namespace {

using PlainRun = Run<std::vector<double>>;
using PlainEvent = Event<std::vector<double>>;

Json json(const SystemEntry& system, const PlainEvent& event)
{
    Json guards = Json::array();
    if (event.guard != no_guard) guards.push_back(system.guards.at(event.guard).name);
    Json out{{"t", event.t}, {"guards", guards}, {"kind", name(event.kind)}};
    if (!system.modes.empty()) {
        out["mode_before"] = system.modes.at(event.mode_before);
        out["mode_after"] = system.modes.at(event.mode_after);
    }
    out["state_before"] = event.before;
    out["state_after"] = event.after;
    out["bracket"] = Json::array({event.bracket.lo, event.bracket.hi});
    out["slope"] = event.slope;
    out["error"] = event.error;
    out["late"] = event.late;
    return out;
}

Json json(const Statistics& s)
{
    return {{"steps", s.steps},
            {"rejected", s.rejected},
            {"refined_steps", s.refined_steps},
            {"unresolved_steps", s.unresolved_steps},
            {"resteps", s.resteps},
            {"flow_calls", s.flow_calls},
            {"guard_calls", s.guard_calls},
            {"network_calls", s.network_calls},
            {"false_alarms", s.false_alarms},
            {"missed_events", s.missed_events},
            {"late_events", s.late_events},
            {"checks_deferred", s.checks_deferred},
            {"checks_put_off", s.checks_deferred},  // its name before version 0.2
            {"outside_domain", s.outside_domain},
            {"suppressed", s.suppressed},
            {"disabled", s.disabled},
            {"unmet_conditions", s.unmet_conditions},
            {"ineffective_resets", s.ineffective_resets},
            {"either_relays", s.either_relays},
            {"armed_beyond", s.armed_beyond},
            {"evidence",
             {{"proved", s.evidence.proved},
              {"checked", s.evidence.checked},
              {"gated", s.evidence.gated},
              {"assumed", s.evidence.assumed}}}};
}

/// Removes the sign of zero from output for people.
double unsigned_zero(double value)
{
    return value == 0 ? 0 : value;
}

std::string with_unit(double value, std::string_view unit)
{
    const double shown = unsigned_zero(value);
    return unit == "1" ? fmt::format("{}", shown) : fmt::format("{} {}", shown, unit);
}

/// "u [m]"
std::string label(const Component& component)
{
    return fmt::format("{} [{}]", component.name, component.unit);
}

/// Cause of the event: the guard, or the time.
std::string_view cause(const SystemEntry& system, const PlainEvent& event)
{
    return event.guard == no_guard ? name(event.kind) : system.guards.at(event.guard).name;
}

/// The guard whose reset contradicts that of the guard that ended the run.
std::string_view opponent(const SystemEntry& system, const PlainRun& run)
{
    return run.other_guard == time_event_reset ? std::string_view("time event")
                                               : system.guards.at(run.other_guard).name;
}

/// "floor", "floor, touch", "too-cold: off -> on"
std::string title(const SystemEntry& system, const PlainEvent& event)
{
    std::string out(cause(system, event));
    if (event.guard != no_guard && event.kind != EventKind::crossing) {
        out += fmt::format(", {}", name(event.kind));
    }
    if (event.mode_before != event.mode_after) {
        out += fmt::format(": {} -> {}", system.modes.at(event.mode_before),
                           system.modes.at(event.mode_after));
    }
    return out;
}

bool changed(const PlainEvent& event)
{
    return event.before != event.after;
}

/// The state after an event is omitted if it equals the state before.
std::string events_table(const SystemEntry& system, const PlainRun& run)
{
    constexpr int wide = 24;
    const bool any_changed = std::any_of(run.events.begin(), run.events.end(), changed);
    const bool any_late = run.statistics.late_events > 0;
    std::size_t first = 8;
    for (const PlainEvent& event : run.events) {
        first = std::max(first, title(system, event).size() + 1);
    }
    std::string out = fmt::format("{:>4}  {:<{}}{:>{}}", "", "guard", first, "t [s]", wide - 2);
    const auto head = [&](std::string_view side) {
        for (const Component& component : system.state) {
            out += fmt::format("{:>{}}", label(component) + std::string(side), wide);
        }
    };
    head(any_changed ? " before" : "");
    if (any_changed) head(" after");
    out += '\n';
    for (std::size_t i = 0; i < run.events.size(); ++i) {
        const auto& event = run.events[i];
        out += fmt::format("{:>4}  {:<{}}{:>{}}", i + 1, title(system, event), first, event.t,
                           wide - 2);
        const auto show = [&](const std::vector<double>& x) {
            for (const double value : x) {
                out += fmt::format("{:>{}}", unsigned_zero(value), wide);
            }
        };
        show(event.before);
        if (changed(event)) show(event.after);
        out += any_late && event.late ? "  late\n" : "\n";
    }
    return out;
}

}  // namespace

std::vector<Row> rows(const SystemEntry& system, const PlainRun& run)
{
    std::vector<Row> out;
    std::size_t sample = 0;
    const double first = !run.trajectory.t.empty() ? run.trajectory.t.front()
                         : !run.events.empty()     ? run.events.front().t
                                                   : run.t;
    const double sense = first > run.t ? -1 : 1;  // of time
    const auto samples_before = [&](double t) {
        for (; sample < run.trajectory.t.size() && sense * (t - run.trajectory.t[sample]) > 0;
             ++sample) {
            out.push_back({.t = run.trajectory.t[sample], .x = run.trajectory.x[sample]});
        }
    };
    for (const auto& event : run.events) {
        samples_before(event.t);
        const std::string_view what = cause(system, event);
        out.push_back({event.t, event.before, fmt::format("before {}", what)});
        out.push_back({event.t, event.after, fmt::format("after {}", what)});
    }
    samples_before(sense * std::numeric_limits<double>::infinity());
    if (out.empty() || sense * (run.t - out.back().t) > 0) out.push_back({.t = run.t, .x = run.x});
    return out;
}

std::string title(const SystemEntry& system, const RunSettings& settings)
{
    std::vector<std::string> parts;
    for (std::size_t i = 0; i < system.parameters.size(); ++i) {
        parts.push_back(fmt::format("{} {}", system.parameters[i].name,
                                    with_unit(settings.parameters[i], system.parameters[i].unit)));
    }
    return fmt::format("{}{}{}", system.name, parts.empty() ? "" : ": ", joined(parts, ", "));
}

std::string to_json(const SystemEntry& system, const RunSettings& settings, const TimedRun& timed,
                    bool with_trajectory)
{
    const PlainRun& run = timed.run;
    Json parameters = Json::object();
    for (std::size_t i = 0; i < system.parameters.size(); ++i) {
        parameters[std::string(system.parameters[i].name)] = settings.parameters[i];
    }
    Json events = Json::array();
    for (const auto& event : run.events) events.push_back(json(system, event));

    Json out{{"system", system.name},
             {"parameters", parameters},
             {"detector", name(settings.detector)},
             {"locator", name(settings.locator)},
             {"stepper", settings.stepper.name()}};
    if (settings.fixed_step) {
        out["step"] = settings.options.step;
    } else {
        out["rtol"] = settings.options.rtol;
        out["atol"] = settings.options.atol;
    }
    if (settings.network || settings.gate) out["model"] = settings.model.string();
    out["outcome"] = ricochet::name(run.outcome);
    if (run.outcome == Outcome::cancelled) out["incomplete"] = Interrupts::cause();
    out["t"] = run.t;
    out["state"] = run.x;
    if (!system.modes.empty()) out["mode"] = system.modes.at(run.mode);
    if (run.guard != no_guard) out["ended_by"] = system.guards.at(run.guard).name;
    if (run.other_guard != no_guard) {
        const bool in_turn = run.outcome == Outcome::zeno;
        out[in_turn ? "in_turn_with" : "conflicts_with"] = opponent(system, run);
    }
    out["events"] = std::move(events);
    out["statistics"] = json(run.statistics);
    add_set_valued(out, settings, timed);
    if (with_trajectory) out["trajectory"] = {{"t", run.trajectory.t}, {"state", run.trajectory.x}};
    out["seconds"] = timed.seconds;
    return json_text(out);
}

std::string to_text(const SystemEntry& system, const RunSettings& settings, const TimedRun& timed)
{
    const PlainRun& run = timed.run;
    const Statistics& s = run.statistics;
    std::string out = title(system, settings) + '\n';
    out += fmt::format("{}; events: {}, {}{}\n\n", describe_integration(settings),
                       name(settings.detector), name(settings.locator),
                       settings.network || settings.gate
                           ? fmt::format(", model {}", settings.model.filename().string())
                           : "");
    if (!run.events.empty()) out += events_table(system, run) + '\n';

    std::vector<std::string> state;
    for (std::size_t i = 0; i < system.state.size(); ++i) {
        state.push_back(fmt::format("{} = {}", system.state[i].name,
                                    with_unit(run.x[i], system.state[i].unit)));
    }
    if (!system.modes.empty()) {
        state.push_back(fmt::format("mode {}", system.modes.at(run.mode)));
    }
    out += fmt::format("{} at t = {} s, {}\n", ricochet::name(run.outcome), run.t,
                       joined(state, ", "));
    if (run.outcome != Outcome::reached_end) {
        std::string guard =
            run.guard == no_guard ? "" : fmt::format("guard {}", system.guards.at(run.guard).name);
        if (run.other_guard != no_guard) guard += fmt::format(" and {}", opponent(system, run));
        if (!guard.empty()) guard += ": ";
        out += run.outcome == Outcome::cancelled
                   ? fmt::format("  incomplete: {}\n", Interrupts::cause())
                   : fmt::format("  {}{}\n", guard, describe(run.outcome));
    }
    std::vector<std::string> names;
    for (const GuardLabel& guard : system.guards) names.emplace_back(guard.name);
    const std::string more = describe(s, names);
    if (!more.empty()) out += fmt::format("  {}\n", more);
    out +=
        fmt::format("{} event{}, {} steps ({} rejected), {} flow calls, {} guard calls", s.events,
                    s.events == 1 ? "" : "s", s.steps, s.rejected, s.flow_calls, s.guard_calls);
    if (s.network_calls > 0) {
        out += fmt::format(
            ",\n{} predictions: {} checks deferred, {} false alarms, {} missed events ({} late)",
            s.network_calls, s.checks_deferred, s.false_alarms, s.missed_events, s.late_events);
    }
    if (s.outside_domain > 0) {
        out += fmt::format(",\n{} of them of states outside of the model's box, checked exactly",
                           s.outside_domain);
    }
    out += set_valued_text(timed);
    out += fmt::format("\nsteps without an event: {} proved, {} checked, {} gated, {} assumed\n",
                       s.evidence.proved, s.evidence.checked, s.evidence.gated, s.evidence.assumed);
    return out + fmt::format("{}\n", duration(timed.seconds));
}

std::string to_csv(const SystemEntry& system, const PlainRun& run)
{
    std::string out = "t [s]";
    for (const Component& component : system.state) out += ',' + label(component);
    out += ",event\n";
    for (Row& row : rows(system, run)) {
        for (double& value : row.x) value = unsigned_zero(value);
        out += fmt::format("{},{},{}\n", unsigned_zero(row.t), joined(row.x, ","), row.event);
    }
    if (run.outcome == Outcome::cancelled) out += incomplete_line();
    return out;
}

int ended_early(std::string_view where)
{
    say("ricochet: {} {}; the result is incomplete\n", Interrupts::cause(), where);
    return Interrupts::status();
}

std::string incomplete_line()
{
    return fmt::format("# incomplete: {}\n", Interrupts::cause());
}

void print(std::string_view text)
{
    const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size();
    if (std::fflush(stdout) != 0 || !written) {
        throw WriteError("cannot write to standard output");
    }
}

}  // namespace ricochet::app
