#include "model_lookup.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "input.hpp"
#include "joined.hpp"
#include "ricochet/detail/features.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;

/// The first of the files that exists.
/// @throws BadInput naming each of them, and `hint`.
fs::path first_of(std::string_view name, const std::vector<fs::path>& candidates,
                  std::string_view hint = "")
{
    std::vector<std::string> looked;
    std::error_code ignored;
    for (const fs::path& file : candidates) {
        if (fs::exists(file, ignored)) return file;
        looked.push_back(file.string());
    }
    throw BadInput(
        fmt::format("model '{}' not found; searched for {}{}", name, joined(looked, ", "), hint));
}

/// The reason why the output of `model` is not an event of `system`; empty if it may be.
std::string objection_to_shape(const SystemEntry& system, const Model& model)
{
    if (model.kind != "event-classifier") {
        return fmt::format("is a {}, expected an event-classifier", model.kind);
    }
    detail::Recipe recipe{};
    try {
        recipe = detail::recipe_named(model.recipe);
    } catch (const std::invalid_argument& error) {
        return fmt::format("has an {}", error.what());
    }
    const std::size_t expected = detail::dimension(recipe, system.state.size());
    const std::size_t features = model.layers.front().inputs;
    if (features != expected) {
        return fmt::format("takes {} features, but the recipe '{}' makes {} of a state of {}",
                           features, model.recipe, expected, system.name);
    }
    const std::size_t outputs = model.layers.back().outputs;
    if (outputs != 1) return fmt::format("has {} outputs, expected 1", outputs);
    return {};
}

/// The reason why `model` is not for the system with these parameters; empty if it is.
std::string objection_to_parameters(const SystemEntry& system, const RunSettings& settings,
                                    const Model& model)
{
    for (const auto& [name, trained] : model.parameters) {
        const auto found =
            std::find_if(system.parameters.begin(), system.parameters.end(),
                         [&wanted = name](const Parameter& p) { return p.name == wanted; });
        if (found == system.parameters.end()) {
            return fmt::format("depends on the parameter '{}', which {} does not have", name,
                               system.name);
        }
        const auto i = static_cast<std::size_t>(found - system.parameters.begin());
        if (settings.parameters[i] != trained) {
            return fmt::format("is trained for {} = {}, got {}", name, trained,
                               settings.parameters[i]);
        }
    }
    return {};
}

std::string objection_to_system(const SystemEntry& system, const Model& model)
{
    return model.system == system.name
               ? std::string()
               : fmt::format("is for the system '{}', expected '{}'", model.system, system.name);
}

/// The reason why `model` cannot be used for this run; empty if it can.
std::string objection(const SystemEntry& system, const RunSettings& settings, const Model& model)
{
    if (std::string why = objection_to_system(system, model); !why.empty()) return why;
    if (std::string why = objection_to_shape(system, model); !why.empty()) return why;
    if (std::string why = objection_to_parameters(system, settings, model); !why.empty()) {
        return why;
    }
    const double step = settings.options.step;
    if (settings.fixed_step && !(model.step_min <= step && step <= model.step_max)) {
        return model.step_min == model.step_max
                   ? fmt::format("is trained for steps of {} s, got {}", model.step_min, step)
                   : fmt::format("is trained for steps in [{}, {}] s, got {}", model.step_min,
                                 model.step_max, step);
    }
    if (!settings.fixed_step && model.step_min == model.step_max) {
        return fmt::format("is trained for steps of {} s; expected --step {}, got error control",
                           model.step_min, model.step_min);
    }
    return {};
}

/// Whether the start lies in the box of a model whose inputs are the state itself.
bool holds_start(const SystemEntry& system, const RunSettings& settings, const Model& model)
{
    if (model.recipe != "state") return true;
    const std::vector<double> x = system.start(settings.parameters);
    for (std::size_t i = 0; i < std::min(x.size(), model.domain.size()); ++i) {
        if (!(model.domain[i].lower <= x[i] && x[i] <= model.domain[i].upper)) return false;
    }
    return true;
}

}  // namespace

std::vector<fs::path> model_directories()
{
    std::vector<fs::path> directories;
    std::error_code error;
    const fs::path program = fs::read_symlink("/proc/self/exe", error);
    if (!error) {
        directories.push_back(program.parent_path().parent_path() / "share/ricochet/models");
    }
    const fs::path installed(RICOCHET_INSTALLED_MODELS);
    if (std::ranges::find(directories, installed) == directories.end()) {
        directories.push_back(installed);
    }
    return directories;
}

fs::path find_model(const std::string& given)
{
    std::vector<fs::path> candidates{given};
    std::string hint;
    for (const fs::path& directory : model_directories()) {
        if (fs::path(given).has_parent_path()) {
            hint += fmt::format("{}{}", hint.empty() ? "; models given by name are in " : ", ",
                                directory.string());
            continue;
        }
        if (given.empty()) continue;
        candidates.push_back(directory / given);
        if (!given.ends_with(".safetensors")) {
            candidates.push_back(directory / (given + ".safetensors"));
        }
    }
    return first_of(given, candidates, hint);
}

fs::path find_model(const OwnModel& own)
{
    std::vector<fs::path> candidates;
    for (const fs::path& directory : model_directories())
        candidates.push_back(directory / own.file);
    return first_of(own.file, candidates);
}

FoundModel named_model(const SystemEntry& system, const RunSettings& settings,
                       const std::string& given)
{
    const fs::path file = find_model(given);
    FoundModel found{.file = file, .model = load_model(file)};
    if (const std::string why = objection(system, settings, found.model); !why.empty()) {
        throw BadInput(fmt::format("model '{}' {}", file.string(), why));
    }
    return found;
}

FoundModel named_gate(const SystemEntry& system, const RunSettings& settings,
                      const std::string& given)
{
    const fs::path file = find_model(given);
    FoundModel found{.file = file, .model = load_model(file)};
    std::string why = objection_to_system(system, found.model);
    if (why.empty()) why = objection_to_parameters(system, settings, found.model);
    if (why.empty() && found.model.kind == "event-classifier" && found.model.certificate.empty()) {
        why = "predicts the events of single steps, expected a gate";
    }
    if (!why.empty()) throw BadInput(fmt::format("model '{}' {}", file.string(), why));
    return found;
}

std::vector<double> parameters_of(const SystemEntry& system, const Model& model)
{
    std::vector<double> values;
    for (const Parameter& parameter : system.parameters) values.push_back(parameter.initial);
    for (const auto& [name, value] : model.parameters) {
        const auto found =
            std::find_if(system.parameters.begin(), system.parameters.end(),
                         [&wanted = name](const Parameter& p) { return p.name == wanted; });
        if (found == system.parameters.end()) {
            throw std::invalid_argument(
                fmt::format("the model depends on the parameter '{}', which {} does not have", name,
                            system.name));
        }
        values[static_cast<std::size_t>(found - system.parameters.begin())] = value;
    }
    return values;
}

FoundModel suitable_model(const SystemEntry& system, const RunSettings& settings)
{
    std::vector<std::string> reasons;
    for (const OwnModel& own : system.models) {
        fs::path file;
        try {
            file = find_model(own);
        } catch (const BadInput& not_found) {
            reasons.emplace_back(not_found.what());
            continue;
        }
        FoundModel found{.file = file, .model = load_model(file)};
        const std::string why = objection(system, settings, found.model);
        if (why.empty() && holds_start(system, settings, found.model)) return found;
        reasons.push_back(
            fmt::format("'{}' {}", own.file, why.empty() ? "is not trained for this start" : why));
    }
    throw BadInput(fmt::format("no model for {} suits: {}", system.name, joined(reasons, "; ")));
}

}  // namespace ricochet::app
