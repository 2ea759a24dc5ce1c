#include "systems.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "json_text.hpp"
#include "rate_and_state.hpp"
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
    return {{"name", system.name},       {"description", system.description},
            {"parameters", parameters},  {"state", state},
            {"guards", guards},          {"modes", system.modes},
            {"t_start", system.t_start}, {"t_end", system.t_end}};
}

std::string text(const SystemEntry& system)
{
    std::string out = fmt::format("{}\n    {}\n", system.name, system.description);
    for (const Parameter& parameter : system.parameters) {
        const std::string_view unit = parameter.unit == "1" ? "" : parameter.unit;
        out += fmt::format("    {:<15} {:>6} {:<5} {:<12} {}\n", parameter.name, parameter.initial,
                           unit, to_string(parameter.range), parameter.meaning);
    }
    if (!system.modes.empty()) {
        out += fmt::format("    {:<15} {}\n", "modes", fmt::join(system.modes, ", "));
    }
    if (system.t_start != 0) {
        out += fmt::format("    {:<15} {:>6} s     default start of a run\n", "t-start",
                           system.t_start);
    }
    return out +
           fmt::format("    {:<15} {:>6} s     default end of a run\n", "t-end", system.t_end);
}

}  // namespace

int list_systems(bool as_json)
{
    if (as_json) {
        Json all = Json::array();
        for (const SystemEntry& system : systems()) all.push_back(json(system));
        all.push_back(json(spring_slider_entry()));
        print(json_text(all));
        return 0;
    }
    std::string all;
    for (const SystemEntry& system : systems()) {
        if (!all.empty()) all += '\n';
        all += text(system);
    }
    all += '\n' + text(spring_slider_entry());
    print(all);
    return 0;
}

}  // namespace ricochet::app
