#include "model_lookup.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <optional>
#include <system_error>
#include <utility>

#include "input.hpp"
#include "registry.hpp"
#include "ricochet/nn/safetensors.hpp"

namespace ricochet::app {

namespace {

namespace fs = std::filesystem;

/// The file, or what was looked for.
struct Search {
    std::optional<fs::path> found;
    std::vector<std::string> looked;
};

Search search(const std::string& name)
{
    std::vector<fs::path> candidates{name};
    if (!name.empty() && !fs::path(name).has_parent_path()) {
        for (const fs::path& directory : model_directories()) {
            candidates.push_back(directory / name);
            candidates.push_back(directory / (name + ".safetensors"));
        }
    }
    Search result;
    std::error_code ignored;
    for (const fs::path& file : candidates) {
        if (fs::exists(file, ignored)) {
            result.found = file;
            return result;
        }
        result.looked.push_back(file.string());
    }
    return result;
}

/// Why `model` cannot be used for this run; empty if it can.
std::string objection(const SystemEntry& system, const RunSettings& settings, const Model& model)
{
    if (model.system != system.name) {
        return fmt::format("is for the system '{}', expected '{}'", model.system, system.name);
    }
    for (const auto& [name, trained] : model.parameters) {
        for (std::size_t i = 0; i < system.parameters.size(); ++i) {
            if (system.parameters[i].name == name && settings.parameters[i] != trained) {
                return fmt::format("is trained for {} = {}, got {}", name, trained,
                                   settings.parameters[i]);
            }
        }
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

/// Whether the start lies in the box of a model that sees the state as it is.
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
    directories.emplace_back(RICOCHET_INSTALLED_MODELS);
    return directories;
}

FoundModel named_model(const SystemEntry& system, const RunSettings& settings,
                       const std::string& given)
{
    const Search result = search(given);
    if (!result.found) {
        throw BadInput(fmt::format("model '{}' not found; looked for {}", given,
                                   fmt::join(result.looked, ", ")));
    }
    FoundModel model{.file = *result.found, .model = load_model(*result.found)};
    if (const std::string why = objection(system, settings, model.model); !why.empty()) {
        throw BadInput(fmt::format("model '{}' {}", model.file.string(), why));
    }
    return model;
}

FoundModel suitable_model(const SystemEntry& system, const RunSettings& settings)
{
    if (system.models.empty()) {
        throw BadInput(
            fmt::format("no model for {} comes with ricochet; expected --model FILE", system.name));
    }
    std::vector<std::string> reasons;
    for (const std::string_view name : system.models) {
        const Search result = search(std::string(name));
        if (!result.found) {
            reasons.push_back(fmt::format("'{}' was not found; looked for {}", name,
                                          fmt::join(result.looked, ", ")));
            continue;
        }
        FoundModel found{.file = *result.found, .model = load_model(*result.found)};
        const std::string why = objection(system, settings, found.model);
        if (why.empty() && holds_start(system, settings, found.model)) return found;
        reasons.push_back(
            fmt::format("'{}' {}", name, why.empty() ? "is not trained for this start" : why));
    }
    throw BadInput(fmt::format("no model for {} suits: {}", system.name, fmt::join(reasons, "; ")));
}

}  // namespace ricochet::app
