#include "fmi/inputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace ricochet::fmi {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

void check_table(const Input& input)
{
    const auto refuse = [&](std::string_view what) {
        throw std::invalid_argument(fmt::format("fmi::Input '{}': {}", input.name, what));
    };
    if (input.function) {
        if (!input.t.empty()) refuse("has a table and a function; expected one of them");
        return;
    }
    if (input.t.empty() || input.t.size() != input.values.size()) {
        refuse(fmt::format("has {} times and {} values; expected as many of both, and at least one",
                           input.t.size(), input.values.size()));
    }
    for (std::size_t i = 0; i < input.t.size(); ++i) {
        if (!std::isfinite(input.t[i]) || !std::isfinite(input.values[i])) {
            refuse(fmt::format("row {} is not finite", i + 1));
        }
        if (i > 0 && input.t[i] < input.t[i - 1]) {
            refuse(fmt::format("time {} follows {}; expected ascending times", input.t[i],
                               input.t[i - 1]));
        }
    }
}

}  // namespace

Inputs::Inputs(const Description& d, const std::vector<Input>& given)
{
    for (const Input& input : given) {
        const std::optional<Element> element = d.find(input.name);
        if (!element) throw Error(fmt::format("{}: has no variable '{}'", d.file, input.name));
        const Variable& variable = d.variables[element->variable];
        if (variable.causality != Causality::input || !is_number(variable.type)) {
            throw Error(fmt::format("{}: '{}' is no input with a number, but {}", d.file,
                                    input.name, name(variable.causality)));
        }
        if (gives(*element)) {
            throw Error(fmt::format("{}: the input '{}' is given twice", d.file, input.name));
        }
        check_table(input);
        const bool discrete = variable.variability != Variability::continuous;
        if (discrete && input.function) {
            throw std::invalid_argument(fmt::format(
                "fmi::Input '{}': a discrete input changes at known times; expected a table",
                input.name));
        }
        inputs_.push_back({*element, discrete, input});
    }
}

bool Inputs::gives(const Element& element) const noexcept
{
    return std::ranges::any_of(inputs_, [&](const One& one) {
        return one.element.variable == element.variable && one.element.offset == element.offset;
    });
}

double Inputs::next_break(double t) const
{
    double next = infinity;
    for (const One& one : inputs_) {
        const auto& times = one.table.t;
        const auto after = std::upper_bound(times.begin(), times.end(), t);
        if (after != times.end()) next = std::min(next, *after);
    }
    return next;
}

bool Inputs::jumps_at(double t) const
{
    return std::ranges::any_of(inputs_,
                               [&](const One& one) { return one.at(t, false) != one.at(t, true); });
}

double Inputs::One::at(double t, bool after) const
{
    if (table.function) return table.function(t);
    const auto& times = table.t;
    const auto& values = table.values;
    // The first row beyond t: after a jump, those at t lie before it.
    const auto beyond = after ? std::upper_bound(times.begin(), times.end(), t)
                              : std::lower_bound(times.begin(), times.end(), t);
    const auto k = static_cast<std::size_t>(beyond - times.begin());
    if (k == 0) return values.front();
    if (k == times.size() || discrete) return values[k - 1];
    const double share = (t - times[k - 1]) / (times[k] - times[k - 1]);
    return std::lerp(values[k - 1], values[k], share);
}

void Inputs::set_continuous(Instance& instance, double t, bool after) const
{
    for (const One& one : inputs_) {
        if (!one.discrete) instance.set(one.element, one.at(t, after));
    }
}

void Inputs::set_all(Instance& instance, double t) const
{
    for (const One& one : inputs_) instance.set(one.element, one.at(t, true));
}

}  // namespace ricochet::fmi
