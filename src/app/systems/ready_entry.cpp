#include "ready_entry.hpp"

namespace ricochet::app {

std::vector<Parameter> parameters_with_start(const SystemDescriptor& of)
{
    std::vector<Parameter> all = of.parameters;
    for (const Component& component : of.state) {
        if (component.start_meaning.empty()) continue;
        all.push_back({.name = component.title,
                       .initial = component.start,
                       .unit = component.unit,
                       .range = component.start_range,
                       .meaning = component.start_meaning});
    }
    return all;
}

std::vector<double> start_from(const SystemDescriptor& of, const std::vector<double>& parameters)
{
    std::vector<double> start;
    std::size_t next = of.parameters.size();
    for (const Component& component : of.state) {
        start.push_back(component.start_meaning.empty() ? component.start : parameters[next++]);
    }
    return start;
}

}  // namespace ricochet::app
