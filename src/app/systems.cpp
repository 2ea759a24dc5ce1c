#include "systems.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <string>
#include <vector>

#include "joined.hpp"
#include "json_text.hpp"
#include "registry.hpp"
#include "report.hpp"

namespace ricochet::app {

namespace {

Json json(const Parameter& parameter)
{
    const Range& range = parameter.range;  // infinite ends become null
    return {{"name", parameter.name},
            {"meaning", parameter.meaning},
            {"default", parameter.initial},
            {"unit", parameter.unit},
            {"range",
             {{"lower", range.lower},
              {"upper", range.upper},
              {"lower_included", range.lower_included},
              {"upper_included", range.upper_included}}}};
}

std::string known_solution(const SystemEntry& system);

Json json(const SystemEntry& system)
{
    Json parameters = Json::array();
    for (const Parameter& parameter : system.parameters) parameters.push_back(json(parameter));
    Json state = Json::array();
    for (const Component& component : system.state) {
        state.push_back(
            {{"name", component.name}, {"meaning", component.meaning}, {"unit", component.unit}});
    }
    Json guards = Json::array();
    for (const GuardLabel& guard : system.guards) guards.push_back(guard.name);
    const std::string known = known_solution(system);
    return {{"name", system.name},       {"description", system.description},
            {"source", system.source},   {"equations", system.equations},
            {"parameters", parameters},  {"state", state},
            {"guards", guards},          {"modes", system.modes},
            {"t_start", system.t_start}, {"t_end", system.t_end},
            {"taylor", system.series},   {"known_solution", known.empty() ? Json() : Json(known)}};
}

std::string text(const SystemEntry& system)
{
    std::string out = fmt::format("{}\n    {}\n", system.name, system.description);
    for (const std::string_view line : system.equations) out += fmt::format("        {}\n", line);
    for (const Parameter& parameter : system.parameters) {
        const std::string_view unit = parameter.unit == "1" ? "" : parameter.unit;
        out += fmt::format("    {:<15} {:>6} {:<5} {:<12} {}\n", parameter.name, parameter.initial,
                           unit, to_string(parameter.range), parameter.meaning);
    }
    if (!system.modes.empty()) {
        out += fmt::format("    {:<15} {}\n", "modes", joined(system.modes, ", "));
    }
    if (system.series) out += fmt::format("    {:<15} taylor, too\n", "steppers");
    if (system.t_start != 0) {
        out += fmt::format("    {:<15} {:>6} s     default start of a run\n", "t-start",
                           system.t_start);
    }
    return out +
           fmt::format("    {:<15} {:>6} s     default end of a run\n", "t-end", system.t_end);
}

/// Known solution, in words.
std::string known_solution(const SystemEntry& system)
{
    if (!system.known_solution.empty()) return std::string(system.known_solution);
    if (system.exact_events != nullptr) {
        return fmt::format(
            "event times {}{}",
            system.numerical_reference ? "computed to higher accuracy" : "in closed form",
            system.any_parameters ? "" : ", for the default parameters");
    }
    return "";
}

/// A section of docs/systems.md.
std::string markdown(const SystemEntry& system)
{
    std::string out = fmt::format("## {}\n\n{}\n\n", system.name, system.description);
    if (!system.equations.empty()) {
        out += fmt::format("```text\n{}\n```\n\n", joined(system.equations, "\n"));
    }
    std::vector<std::string> state;
    for (const Component& x : system.state) {
        state.push_back(fmt::format("{} [{}], {}", x.name, x.unit, x.meaning));
    }
    out += fmt::format("- state: {}\n", joined(state, "; "));
    std::vector<std::string> guards;
    for (const GuardLabel& guard : system.guards) {
        guards.push_back(guard.name == guard.event
                             ? std::string(guard.name)
                             : fmt::format("{} ({})", guard.name, guard.event));
    }
    if (!guards.empty()) out += fmt::format("- guards: {}\n", joined(guards, ", "));
    if (!system.modes.empty()) out += fmt::format("- modes: {}\n", joined(system.modes, ", "));
    if (!system.integrators.empty()) {
        out += fmt::format("- integrators: {}\n", joined(system.integrators, ", "));
    }
    if (system.series) out += "- steppers: `taylor`, too\n";
    if (const std::string known = known_solution(system); !known.empty()) {
        out += fmt::format("- known: {}\n", known);
    }
    out += fmt::format("- run by default from {} to {} s\n", system.t_start, system.t_end);
    if (!system.source.empty()) out += fmt::format("- source: {}\n", system.source);
    if (system.parameters.empty()) return out;
    out += "\n| parameter | default | unit | range | meaning |\n|---|---|---|---|---|\n";
    for (const Parameter& p : system.parameters) {
        out += fmt::format("| `{}` | {} | {} | {} | {} |\n", p.name, p.initial, p.unit,
                           to_string(p.range), p.meaning);
    }
    return out;
}

std::string markdown()
{
    std::string out =
        "# The systems of the command line\n\n"
        "Written by `ricochet systems --markdown` from the descriptors of the systems; a test "
        "holds "
        "this page to them. `ricochet simulate NAME --set parameter=value` runs one, `ricochet "
        "compare NAME` beside its known solution.\n";
    for (const SystemEntry& system : systems()) out += '\n' + markdown(system);
    return out;
}

}  // namespace

int list_systems(ListFormat format)
{
    if (format == ListFormat::markdown) {
        print(markdown());
        return 0;
    }
    if (format == ListFormat::json) {
        Json all = Json::array();
        for (const SystemEntry& system : systems()) all.push_back(json(system));
        print(json_text(all));
        return 0;
    }
    std::string all;
    for (const SystemEntry& system : systems()) {
        if (!all.empty()) all += '\n';
        all += text(system);
    }
    print(all);
    return 0;
}

}  // namespace ricochet::app
