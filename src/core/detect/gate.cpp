#include "ricochet/gate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "ricochet/gates.hpp"

namespace ricochet {

namespace {

using Kind = GateRecipe::Kind;

constexpr std::array<std::pair<std::string_view, Kind>, 6> kinds{
    {{"state", Kind::state},
     {"state-rate", Kind::state_rate},
     {"state-phase", Kind::state_phase},
     {"angles", Kind::angles},
     {"chain", Kind::chain},
     {"own", Kind::own}}};

[[noreturn]] void refuse_recipe(std::string_view given)
{
    throw std::invalid_argument(fmt::format(
        "unknown gate recipe '{}'; known are state, state-rate, state-phase(frequency), angles, "
        "chain and own, each also with ' mode(number of modes)' behind it",
        given));
}

/// Splits "name(number)" into its parts; the number is NaN if there is none.
std::pair<std::string_view, double> call(std::string_view text, std::string_view whole)
{
    const std::size_t open = text.find('(');
    if (open == std::string_view::npos) return {text, std::nan("")};
    double number = 0;
    const char* const end = text.data() + text.size();
    const auto [stopped, error] = std::from_chars(text.data() + open + 1, end, number);
    if (error != std::errc{} || stopped + 1 != end || *stopped != ')' || !std::isfinite(number)) {
        refuse_recipe(whole);
    }
    return {text.substr(0, open), number};
}

void refuse(const Model& model, const std::string& what)
{
    const std::string system = model.system.empty() ? "a system without a name" : model.system;
    throw std::invalid_argument(fmt::format("Gate: the model for {} {}", system, what));
}

bool checked_kind(const Model& model)
{
    const bool horizon = model.kind == "gate-horizon";
    if (!horizon && model.kind != "gate-level") {
        refuse(model, fmt::format("is of the kind '{}', expected a gate", model.kind));
    }
    return horizon;
}

}  // namespace

std::string to_string(const GateRecipe& recipe)
{
    std::string text;
    for (const auto& [name, kind] : kinds) {
        if (kind == recipe.kind) text = name;
    }
    if (recipe.kind == Kind::state_phase) text += fmt::format("({})", recipe.frequency);
    if (recipe.modes > 0) text += fmt::format(" mode({})", recipe.modes);
    return text;
}

GateRecipe gate_recipe(std::string_view spelled)
{
    GateRecipe recipe;
    const std::size_t blank = spelled.find(' ');
    if (blank != std::string_view::npos) {
        const auto [word, modes] = call(spelled.substr(blank + 1), spelled);
        if (word != "mode" || !(modes >= 1 && modes <= 32) || modes != std::floor(modes)) {
            refuse_recipe(spelled);
        }
        recipe.modes = static_cast<std::size_t>(modes);
    }
    const auto [word, number] = call(spelled.substr(0, blank), spelled);
    for (const auto& [name, kind] : kinds) {
        if (word != name) continue;
        if ((kind == Kind::state_phase) == std::isnan(number)) break;
        recipe.kind = kind;
        if (kind == Kind::state_phase) recipe.frequency = number;
        return recipe;
    }
    refuse_recipe(spelled);
}

namespace gates {

Gate::Gate(Model model)
    : classifier_(detail::Shared<Classifier>::make(std::move(model))),
      recipe_(gate_recipe(classifier_->model().recipe)),
      horizon_(checked_kind(classifier_->model()))
{
    const Model& m = classifier_->model();
    const std::size_t outputs = classifier_->outputs();
    if (m.levels.empty() || (horizon_ ? m.levels.size() != outputs : outputs != 1)) {
        refuse(m, fmt::format("has {} outputs and {} levels, expected {}", outputs, m.levels.size(),
                              horizon_ ? "one output for each" : "one output and at least one"));
    }
    double before = 0;
    for (const GateLevel& level : m.levels) {
        if (!(level.value > before) || !std::isfinite(level.value)) {
            refuse(m, fmt::format("has levels that do not rise: {} after {}", level.value, before));
        }
        before = level.value;
    }
    if (m.domain.empty()) refuse(m, "has no domain, and a gate needs one");
    if (classifier_->inputs() > GateRecipe::most) {
        refuse(m, fmt::format("has {} features, expected at most {}", classifier_->inputs(),
                              GateRecipe::most));
    }
}

double Gate::cleared(const double* features) const noexcept
{
    std::array<double, Mlp<double>::max_width> logits;
    classifier_->logits(features, logits.data());
    double value = 0;
    const auto& levels = model().levels;
    for (std::size_t k = 0; k < levels.size(); ++k) {
        if (!(logits[horizon_ ? k : 0] < levels[k].threshold)) break;
        value = levels[k].value;
    }
    return value;
}

void Gate::check_step(double smallest, double largest) const
{
    if (largest < model().step_min || smallest > model().step_max) {
        refuse(model(), fmt::format("is trained for steps in [{}, {}] s, got [{}, {}]",
                                    model().step_min, model().step_max, smallest, largest));
    }
}

}  // namespace gates

namespace detail {

void check_gate_system(const Model& model, std::string_view name)
{
    if (model.system != name) refuse(model, fmt::format("cannot be used for {}", name));
}

void check_gate_parameter(const Model& model, std::string_view name, double trained,
                          std::optional<double> value)
{
    if (!value) {
        refuse(model, fmt::format("is trained for {} = {}, which this system does not declare",
                                  name, trained));
    }
    if (*value != trained) {
        refuse(model, fmt::format("is trained for {} = {}, got {}", name, trained, *value));
    }
}

void check_gate_layout(const Model& model, const GateRecipe& recipe, std::size_t features,
                       std::size_t modes)
{
    if (features != model.offset.size()) {
        refuse(model, fmt::format("takes {} features, but '{}' of this state are {}",
                                  model.offset.size(), model.recipe, features));
    }
    if (recipe.modes > 0 && recipe.modes != modes) {
        refuse(model,
               fmt::format("tells {} modes apart, and this system has {}", recipe.modes, modes));
    }
}

void check_certified(const Model& model)
{
    if (model.domain.empty()) refuse(model, "has no domain, and a certified one needs one");
    if (model.offset.size() > GateRecipe::most) {
        refuse(model, fmt::format("has {} features, expected at most {}", model.offset.size(),
                                  GateRecipe::most));
    }
}

void check_gate_kind(const gates::Gate& gate, bool horizon)
{
    if (gate.is_horizon() == horizon) return;
    throw std::invalid_argument(
        horizon ? "Calibrated: expected a horizon gate, got one of levels; see CalibratedBounds"
                : "CalibratedBounds: expected a level gate, got one of horizons; see Calibrated");
}

std::size_t longest_horizon(const gates::Gate& gate) noexcept
{
    constexpr double least = 256;
    constexpr double most = 65'536;
    const Model& model = gate.model();
    if (!(model.step_min > 0)) return static_cast<std::size_t>(least);
    const double steps = std::ceil(model.levels.back().value / model.step_min);
    return static_cast<std::size_t>(std::clamp(steps, least, most));
}

void check_longest_interval(std::size_t steps)
{
    if (steps == 0) {
        throw std::invalid_argument("Calibrated: longest_interval must be at least 1 step, got 0");
    }
}

}  // namespace detail

}  // namespace ricochet
