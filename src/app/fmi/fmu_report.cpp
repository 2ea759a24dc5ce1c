#include "fmu_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "../interrupt.hpp"
#include "../joined.hpp"
#include "../json_text.hpp"
#include "../plot.hpp"
#include "../report.hpp"
#include "../timing.hpp"

namespace ricochet::app {

namespace {

using fmi::Description;

std::string unit_of(const Description& d, const std::string& name)
{
    const auto element = d.find(name);
    return element ? d.variables[element->variable].unit : "";
}

/// "h [m]"
std::string label(const Description& d, const std::string& name)
{
    const std::string unit = unit_of(d, name);
    return unit.empty() || unit == "1" ? name : fmt::format("{} [{}]", name, unit);
}

/// "state (indicator 1)"
std::string title(const FmuRun& of, const fmi::Event& event)
{
    const Description& d = of.fmu;
    std::string out = describe(event.causes);
    if (event.watch != fmi::no_indicator) {
        const fmi::Watch& watch = of.options.watch[event.watch];
        return fmt::format("{} ({} = {})", out, watch.name, watch.level);
    }
    if (event.indicator != fmi::no_indicator) {
        out += fmt::format(" ({})", d.indicator_name(event.indicator));
    }
    return out;
}

std::string events_table(const FmuRun& of)
{
    constexpr int wide = 26;
    const std::vector<std::string> states = of.fmu.state_names();
    std::size_t first = 6;
    for (const fmi::Event& event : of.run.events) {
        first = std::max(first, title(of, event).size() + 1);
    }
    std::string out = fmt::format("{:>4}  {:<{}}{:>{}}", "", "cause", first, "t [s]", wide - 2);
    // States of large models would not fit beside each other.
    const std::size_t shown = states.size() <= 3 ? states.size() : 0;
    for (const std::string_view side : {" before", " after"}) {
        for (std::size_t i = 0; i < shown; ++i) {
            out += fmt::format("{:>{}}", label(of.fmu, states[i]) + std::string(side), wide);
        }
    }
    out += '\n';
    for (std::size_t k = 0; k < of.run.events.size(); ++k) {
        const fmi::Event& event = of.run.events[k];
        out +=
            fmt::format("{:>4}  {:<{}}{:>{}}", k + 1, title(of, event), first, event.t, wide - 2);
        for (const auto* x : {&event.before, &event.after}) {
            for (std::size_t i = 0; i < std::min(shown, x->size()); ++i) {
                out += fmt::format("{:>{}}", (*x)[i] + 0.0, wide);
            }
        }
        out += '\n';
    }
    return out;
}

std::string interfaces(const Description& d)
{
    std::vector<std::string> out;
    if (d.model_exchange) out.emplace_back("model exchange");
    if (d.co_simulation) out.emplace_back("co-simulation");
    if (d.scheduled_execution) out.emplace_back("scheduled execution");
    return joined(out, ", ");
}

std::string_view event_of(const fmi::Row& row)
{
    switch (row.place) {
        case fmi::Row::Place::before_event: return "before event";
        case fmi::Row::Place::after_event: return "after event";
        case fmi::Row::Place::sample: break;
    }
    return "";
}

Json json(const fmi::Calls& c)
{
    return {{"set_time", c.set_time},
            {"set_states", c.set_states},
            {"derivatives", c.derivatives},
            {"indicators", c.indicators},
            {"directional", c.directional},
            {"event_modes", c.event_modes},
            {"rounds", c.rounds},
            {"completed_steps", c.completed_steps},
            {"steps", c.steps}};
}

Json json(const Description& d, const fmi::Event& event)
{
    Json causes = Json::array();
    if (event.causes.state) causes.push_back("state");
    if (event.causes.time) causes.push_back("time");
    if (event.causes.step) causes.push_back("step");
    if (event.causes.input) causes.push_back("input");
    if (event.causes.passage) causes.push_back("passage");
    Json out{{"t", event.t}, {"causes", causes}};
    if (event.watch != fmi::no_indicator) out["watch"] = event.watch;
    if (event.indicator != fmi::no_indicator) {
        out["indicator"] = d.indicator_name(event.indicator);
    }
    out["state_before"] = event.before;
    out["state_after"] = event.after;
    return out;
}

std::string variable_line(const fmi::Variable& v)
{
    std::string start;
    if (v.start.size() == 1) start = fmt::format(" = {}", v.start[0]);
    std::string size;
    for (const std::size_t length : v.dimensions) size += fmt::format("[{}]", length);
    const std::string unit = v.unit.empty() ? "" : " " + v.unit;
    const std::string about = v.description.empty() ? "" : ": " + v.description;
    return fmt::format("  {}{}{}{}{}\n", v.name, size, start, unit, about);
}

}  // namespace

std::string fmu_run_text(const FmuRun& of)
{
    const fmi::Run& run = of.run;
    const std::string how = run.calls.steps > 0
                                ? "co-simulation"
                                : fmt::format("{}, rtol {}", name(run.method), of.options.rtol);
    std::string out = fmt::format("{}: {}, FMI {}; {}\n\n", of.fmu.file, of.fmu.model_name,
                                  of.fmu.version_text, how);
    if (!run.events.empty()) out += events_table(of) + '\n';
    std::vector<std::string> values;
    if (!run.rows.empty() && run.rows.back().t == run.t) {
        for (std::size_t i = 0; i < run.output.size(); ++i) {
            values.push_back(fmt::format("{} = {}", run.output[i], run.rows.back().values[i]));
        }
    } else {
        const std::vector<std::string> states = of.fmu.state_names();
        for (std::size_t i = 0; i < std::min(states.size(), run.x.size()); ++i) {
            values.push_back(fmt::format("{} = {}", states[i], run.x[i]));
        }
    }
    out += fmt::format("{} at t = {} s{}{}\n", fmi::name(run.end), run.t,
                       values.empty() ? "" : ", ", joined(values, ", "));
    if (run.end != fmi::End::reached_end) out += fmt::format("  {}\n", describe(run));
    for (const std::string& warning : run.warnings) out += fmt::format("  warning: {}\n", warning);
    out += fmt::format(
        "{} event{}, {} steps ({} rejected); calls of the FMU: {} derivatives, {} "
        "indicators, {} event modes\n",
        run.events.size(), run.events.size() == 1 ? "" : "s", run.steps, run.rejected,
        run.calls.derivatives, run.calls.indicators, run.calls.event_modes);
    return out + fmt::format("{}\n", duration(of.seconds));
}

std::string fmu_run_json(const FmuRun& of, bool with_trajectory)
{
    const fmi::Run& run = of.run;
    Json events = Json::array();
    for (const fmi::Event& event : run.events) events.push_back(json(of.fmu, event));
    Json state = Json::object();
    const std::vector<std::string> states = of.fmu.state_names();
    for (std::size_t i = 0; i < std::min(states.size(), run.x.size()); ++i) {
        state[states[i]] = run.x[i];
    }
    Json out{{"fmu", of.fmu.file},
             {"model", of.fmu.model_name},
             {"fmi", of.fmu.version_text},
             {"method", name(run.method)},
             {"rtol", of.options.rtol},
             {"outcome", fmi::name(run.end)},
             {"message", describe(run)},
             {"t", run.t},
             {"state", state},
             {"events", events},
             {"warnings", run.warnings},
             {"steps", run.steps},
             {"rejected", run.rejected},
             {"calls", json(run.calls)}};
    if (with_trajectory) {
        Json trajectory{{"t", Json::array()}};
        for (const fmi::Row& row : run.rows) trajectory["t"].push_back(row.t);
        for (std::size_t i = 0; i < run.output.size(); ++i) {
            Json column = Json::array();
            for (const fmi::Row& row : run.rows) column.push_back(row.values[i]);
            trajectory[run.output[i]] = column;
        }
        out["trajectory"] = trajectory;
    }
    out["seconds"] = of.seconds;
    return json_text(out);
}

std::string fmu_run_csv(const FmuRun& of)
{
    std::string out = "t [s]";
    for (const std::string& name : of.run.output) out += ',' + label(of.fmu, name);
    out += ",event\n";
    for (const fmi::Row& row : of.run.rows) {
        out += fmt::format("{}", row.t);
        for (const double value : row.values) out += fmt::format(",{}", value);
        out += fmt::format(",{}\n", event_of(row));
    }
    if (of.run.integration == Outcome::cancelled && Interrupts::any()) out += incomplete_line();
    return out;
}

void plot_fmu_run(const FmuRun& of, const std::filesystem::path& file)
{
    std::string rows;
    for (const fmi::Row& row : of.run.rows) {
        if (row.place == fmi::Row::Place::after_event) rows += '\n';  // breaks the curve
        rows += fmt::format("{}", row.t);
        for (const double value : row.values) rows += fmt::format(" {}", value);
        rows += '\n';
    }
    const std::size_t panels = of.run.output.size();
    std::string script = fmt::format(
        "set multiplot layout {},1 title {}.\"\\n\"\nset lmargin 15\nset rmargin 3\nset tmargin "
        "1.5\nunset key\nset offsets graph 0, graph 0, graph 0.06, graph 0.06\n",
        std::max<std::size_t>(panels, 1), single_quoted(of.fmu.model_name));
    for (std::size_t i = 0; i < panels; ++i) {
        if (i + 1 == panels) script += "set xlabel 'time t [s]'\n";
        script += fmt::format("set ylabel {}\nplot 'rows' using 1:{} with lines linestyle 1\n",
                              single_quoted(label(of.fmu, of.run.output[i])), i + 2);
    }
    const int height = static_cast<int>(100 + 260 * std::clamp<std::size_t>(panels, 1, 40));
    draw({{"rows", rows}}, plot_head(file, 1200, height) + script + "unset multiplot\n", file);
}

std::string fmu_text(const fmi::Fmu& fmu)
{
    const Description& d = fmu.description();
    std::string out = fmt::format("{}: FMI {}, {}\n", d.model_name, d.version_text, interfaces(d));
    if (!d.about.empty()) out += d.about + '\n';
    if (!d.tool.empty()) out += fmt::format("made by {}\n", d.tool);
    out += fmt::format(
        "{} states, {} event indicators, {} variables; {}\n", d.state_count, d.indicator_count,
        d.variables.size(),
        fmu.has_binary() ? "a library for this platform" : "no library for this platform");
    if (d.model_exchange) {
        out += fmt::format(
            "{}{}",
            d.model_exchange->directional_derivatives ? "gives directional derivatives\n" : "",
            d.model_exchange->needs_completed_step ? "wants to be told of every completed step\n"
                                                   : "");
    }
    if (d.t_end) {
        out +=
            fmt::format("default experiment: from {} to {} s\n", d.t_start.value_or(0), *d.t_end);
    }
    for (const auto& [causality, title] : {std::pair{fmi::Causality::parameter, "parameters"},
                                           {fmi::Causality::input, "inputs"},
                                           {fmi::Causality::output, "outputs"}}) {
        std::string lines;
        for (const fmi::Variable& v : d.variables) {
            if (v.causality == causality) lines += variable_line(v);
        }
        if (!lines.empty()) out += fmt::format("\n{}\n{}", title, lines);
    }
    return out;
}

std::string fmu_json(const fmi::Fmu& fmu)
{
    const Description& d = fmu.description();
    Json variables = Json::array();
    for (const fmi::Variable& v : d.variables) {
        variables.push_back({{"name", v.name},
                             {"causality", fmi::name(v.causality)},
                             {"variability", fmi::name(v.variability)},
                             {"unit", v.unit},
                             {"description", v.description},
                             {"start", v.start},
                             {"dimensions", v.dimensions}});
    }
    Json out{{"file", d.file},
             {"model", d.model_name},
             {"fmi", d.version_text},
             {"tool", d.tool},
             {"model_exchange", d.model_exchange.has_value()},
             {"co_simulation", d.co_simulation.has_value()},
             {"scheduled_execution", d.scheduled_execution},
             {"has_binary", fmu.has_binary()},
             {"states", d.state_names()},
             {"indicators", d.indicator_count},
             {"variables", variables}};
    if (d.t_start) out["t_start"] = *d.t_start;
    if (d.t_end) out["t_end"] = *d.t_end;
    return json_text(out);
}

std::string findings_text(const std::vector<fmi::Finding>& findings)
{
    std::string out;
    for (const fmi::Finding& finding : findings) {
        out += fmt::format("{}: {}\n", finding.fault ? "fault" : "remark", finding.text);
    }
    return out.empty() ? "no faults were found\n" : out;
}

std::string findings_json(const std::vector<fmi::Finding>& findings)
{
    Json out = Json::array();
    for (const fmi::Finding& finding : findings) {
        out.push_back({{"fault", finding.fault}, {"text", finding.text}});
    }
    return json_text({{"findings", out}});
}

}  // namespace ricochet::app
