#include "fmi/parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace ricochet::fmi {

Simulation::Parts::Parts(const Fmu& fmu, const Options& given, Kind kind)
    : options(given), instance(fmu.unpacked(), kind), inputs(instance.description(), given.inputs)
{
    resolve_times();
    resolve_output();
}

void Simulation::Parts::resolve_times()
{
    const auto refuse = [](const std::string& what) {
        throw std::invalid_argument("fmi::Options: " + what);
    };
    const Description& d = instance.description();
    t = t_start = options.t_start.value_or(d.t_start.value_or(0));
    t_end = options.t_end.value_or(std::max(d.t_end.value_or(t + 1), t));
    if (!std::isfinite(t) || !std::isfinite(t_end) || t_end < t) {
        refuse(fmt::format("t_end must be finite and not before t_start = {}, got {}", t, t_end));
    }
    if (!(options.rtol > 0 && options.rtol < 1)) {
        refuse(fmt::format("rtol must lie between 0 and 1, got {}", options.rtol));
    }
    if (!(options.h_max > 0)) refuse(fmt::format("h_max must be positive, got {}", options.h_max));
    if (options.step && !(*options.step > 0 && std::isfinite(*options.step))) {
        refuse(fmt::format("step must be positive and finite, got {}", *options.step));
    }
    double before = t;
    for (const double s : options.sample_times) {
        if (!(s >= before && s <= t_end)) {
            refuse(fmt::format("sample_times must ascend from {} to {}, got {} after {}", t, t_end,
                               s, before));
        }
        before = s;
    }
    run.t = t;
}

void Simulation::Parts::resolve_output()
{
    const Description& d = instance.description();
    for (const std::string& name : options.output) {
        const std::optional<Element> element = d.find(name);
        if (!element) throw Error(fmt::format("{}: has no variable '{}'", d.file, name));
        const Variable& variable = d.variables[element->variable];
        if (!is_number(variable.type)) {
            throw Error(fmt::format("{}: '{}' is not a number", d.file, name));
        }
        if (variable.dimensions.empty() || name.ends_with(']')) {
            output_.push_back(*element);
        } else {
            for (std::size_t k = 0; k < variable.size; ++k) {
                output_.push_back({element->variable, k});
            }
        }
    }
    const auto add = [&](std::size_t i) {
        for (std::size_t k = 0; k < d.variables[i].size; ++k) output_.push_back({i, k});
    };
    for (std::size_t i = 0; options.output.empty() && i < d.variables.size(); ++i) {
        const Variable& v = d.variables[i];
        if (v.causality == Causality::output && is_number(v.type)) add(i);
    }
    if (output_.empty()) std::ranges::for_each(d.states, add);
    for (const Element& element : output_) run.output.push_back(d.name_of(element));
}

void Simulation::Parts::set_start_values()
{
    const Description& d = instance.description();
    for (const auto& [name, value] : options.start) {
        const std::optional<Element> element = d.find(name);
        if (!element) throw Error(fmt::format("{}: has no variable '{}'", d.file, name));
        const Variable& v = d.variables[element->variable];
        const bool fits = v.variability != Variability::constant && !v.starts_calculated &&
                          v.causality != Causality::structural_parameter &&
                          v.causality != Causality::calculated_parameter &&
                          v.causality != Causality::independent;
        if (!fits) {
            throw Error(fmt::format("{}: '{}' cannot be set: it is {} {}{}", d.file, name,
                                    v.variability == Variability::constant ? "a constant" : "a",
                                    fmi::name(v.causality),
                                    v.starts_calculated ? ", and calculated" : ""));
        }
        if (inputs.gives(*element)) {
            throw Error(fmt::format("{}: '{}' has a start value and a table", d.file, name));
        }
        instance.set(*element, value);
    }
}

void Simulation::Parts::initialize()
{
    try {
        set_start_values();
        instance.enter_initialization(t, t_end, options.rtol);
        inputs.set_all(instance, t);
        instance.exit_initialization();
    } catch (const CallError& error) {
        throw Error(fmt::format("{} in its initialization", error.what()));
    }
}

void Simulation::Parts::end(End how, std::string message)
{
    ended = true;
    run.end = how;
    run.message = std::move(message);
}

void Simulation::Parts::record(Row::Place place)
{
    Row row{.t = t, .place = place, .values = {}};
    for (const Element& element : output_) row.values.push_back(instance.get(element));
    run.rows.push_back(std::move(row));
}

bool Simulation::Parts::sample_is_due(double by, bool or_at) const
{
    if (next_sample == options.sample_times.size()) return false;
    const double sample = options.sample_times[next_sample];
    return or_at ? sample <= by : sample < by;
}

void Simulation::Parts::skip_samples(double up_to)
{
    while (sample_is_due(up_to, true)) ++next_sample;
}

}  // namespace ricochet::fmi
