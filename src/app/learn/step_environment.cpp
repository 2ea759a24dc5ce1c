#include "step_environment.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <vector>

#include "input.hpp"
#include "model_lookup.hpp"
#include "policy_advice.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::app {

namespace fs = std::filesystem;
using learn::StepEnvironment;
using learn::StepEnvironmentOptions;

StepEnvironment source_environment(const std::string& system, const StepEnvironmentOptions& options)
{
    const std::vector<std::string_view> known{"fault", SlidingMode::name, DiodeCircuit::name};
    if (system == known[0]) {
        return learn::step_environment(StrikeSlipFault({.elements = 1}), 30, options);
    }
    if (system == known[1]) {
        return learn::step_environment(SlidingMode{}, SlidingMode::start, SlidingMode::t_end,
                                       options);
    }
    if (system == known[2]) {
        return learn::step_environment(DiodeCircuit{}, DiodeCircuit::start(), DiodeCircuit::t_end,
                                       options);
    }
    throw unknown("system for a step policy", system, known);
}

Model shipped_actor(std::string_view system)
{
    const fs::path file = find_model(fmt::format("{}-tqc", system));
    Model actor = load_model(file);
    const auto refuse = [&](std::string_view what, const std::string& given,
                            std::string_view expected) {
        throw BadInput(fmt::format("model '{}': {} is '{}', expected '{}'", file.string(), what,
                                   given, expected));
    };
    if (actor.kind != step_actor_kind) refuse("its kind", actor.kind, step_actor_kind);
    if (actor.system != system) refuse("its system", actor.system, system);
    if (actor.recipe != step_actor_recipe) refuse("its recipe", actor.recipe, step_actor_recipe);
    if (!actor.parameters.contains("alpha")) refuse("parameter alpha", "missing", "a number");
    return actor;
}

StepEnvironmentOptions judged(const Model& actor)
{
    StepEnvironmentOptions options =
        learn::published_step_environment(actor.parameters.at("alpha"));
    options.h_min = actor.step_min;
    options.h_max = actor.step_max;
    options.until_rest = true;
    options.max_attempts = 5000;
    return options;
}

}  // namespace ricochet::app
