#include "set_valued_options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../input.hpp"
#include "../joined.hpp"
#include "../policy_lookup.hpp"
#include "../registry.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::app {

namespace {

constexpr double default_rtol = 1e-10;
constexpr double default_atol = 1e-12;
constexpr double default_rtol_of_steps = 1e-3;
constexpr double default_atol_of_steps = 1e-6;

std::string one_of(std::string_view what, const std::optional<std::string>& given,
                   const std::vector<std::string_view>& known)
{
    if (!given) return std::string(known.front());
    if (std::find(known.begin(), known.end(), *given) == known.end()) {
        throw unknown(what, *given, known);
    }
    return *given;
}

void refuse(bool given, std::string_view option, std::string_view why)
{
    if (given) throw BadInput(fmt::format("{} {}", option, why));
}

double tolerance(std::string_view option, const std::optional<double>& given, double otherwise)
{
    if (given && !(*given >= 0)) {
        throw BadInput(fmt::format("{} must be zero or positive, got {}", option, *given));
    }
    return given.value_or(otherwise);
}

/// @param steps  whether all steps are set-valued
/// @throws BadInput for tolerances that are negative, or both zero
void choose_tolerances(const RunRequest& request, bool steps, Options& options)
{
    options.rtol = tolerance("--rtol", request.rtol, steps ? default_rtol_of_steps : default_rtol);
    options.atol = tolerance("--atol", request.atol, steps ? default_atol_of_steps : default_atol);
    if (options.rtol + options.atol == 0) {
        throw BadInput("--rtol or --atol must be positive, got zero for both");
    }
}

/// Inputs of the policies of a system.
/// @throws BadInput naming the systems that have policies.
const StepLayout& layout_of(const SystemEntry& system)
{
    const std::vector<std::string_view> known{SlidingMode::name, DiodeCircuit::name, "fault"};
    if (system.name == known[0]) return SlidingMode::step_layout();
    if (system.name == known[1]) return DiodeCircuit::step_layout();
    throw BadInput(fmt::format("--controller learned: found no policy for '{}'; expected one of {}",
                               system.name, joined(known, ", ")));
}

StepController controller(const SetValuedSettings& settings)
{
    const std::string& name = settings.controller;
    if (name == "learned") return LearnedStep{.policy = settings.policy};
    if (name == "error") return ErrorStep{.order = 3, .reject_above = 100};
    if (name == "heuristic") return HeuristicStep{};
    if (name == "pi") return FilteredStep::pi3333();
    if (name == "filter") return FilteredStep::h211b(4);
    return ConstantStep{};
}

}  // namespace

bool choose_set_valued(const SystemEntry& system, const RunRequest& request, RunSettings& settings)
{
    SetValuedSettings chosen;
    chosen.integrator = one_of("integrator", request.integrator, system.integrators);
    if (system.integrators.front() == "event" && chosen.integrator == "event") {
        refuse(request.controller.has_value(), "--controller", "is for --integrator bathe");
        return false;
    }
    chosen.controller = one_of("controller", request.controller,
                               {"constant", "error", "heuristic", "pi", "filter", "learned"});
    const bool steps = chosen.integrator == "bathe" || chosen.integrator == "time-stepping";
    const bool controlled = chosen.controller != "constant";
    refuse(controlled && chosen.integrator != "bathe", "--controller", "is for --integrator bathe");
    refuse(request.detector && *request.detector != "extremum", "--detector",
           "of a differential inclusion can only be extremum");
    refuse(request.locator && *request.locator != "newton", "--locator",
           "of a differential inclusion can only be newton");
    const bool learned = chosen.controller == "learned";
    refuse(request.model && !learned, "--model",
           "of a differential inclusion is for --controller learned");
    refuse(request.atol && measured_by_norm(chosen), "--atol",
           "is not for --controller error and learned, whose errors are relative to the norm of "
           "the start");
    if (learned) {
        settings.model = policy_file(layout_of(system), request.model);
        chosen.policy = named_policy(layout_of(system), request.model);
    }
    refuse(request.gate.has_value(), "--gate", "is not for differential inclusions");
    refuse(request.mode.has_value(), "--mode",
           "of a differential inclusion follows from its state");
    refuse(steps && request.stepper, "--stepper", "is for --integrator handover and event");
    refuse(steps && !controlled && (request.rtol || request.atol), "--rtol and --atol",
           "need a --controller that uses errors");
    refuse(!steps && request.step && chosen.integrator == "event", "--step",
           "is for set-valued steps, and --integrator event has none");
    chosen.step = request.step.value_or(system.set_valued_step);
    if (!(chosen.step > 0)) {
        throw BadInput(fmt::format("--step must be positive, got {}", chosen.step));
    }
    if (request.stepper) {
        const std::string stepper = one_of("stepper of a differential inclusion", request.stepper,
                                           {"dopri5", "fehlberg78"});
        if (stepper == "fehlberg78") settings.stepper = MethodName::fehlberg78;
    }
    Options& options = settings.options;
    if (!(options.t_end >= options.t_start)) {
        throw BadInput(
            fmt::format("a differential inclusion runs forward in time; expected --t-end "
                        "of at least {}, got {}",
                        options.t_start, options.t_end));
    }
    choose_tolerances(request, steps, options);
    settings.fixed_step = steps && !controlled;
    options.step = settings.fixed_step ? chosen.step : 0;
    settings.set_valued = std::move(chosen);
    return true;
}

bool measured_by_norm(const SetValuedSettings& settings) noexcept
{
    return settings.controller == "error" || settings.controller == "learned";
}

SetValuedOptions set_valued_options(const RunSettings& settings)
{
    const SetValuedSettings& chosen = settings.set_valued.value();
    SetValuedOptions options;
    options.t_start = settings.options.t_start;
    options.t_end = settings.options.t_end;
    options.step = chosen.step;
    options.controller = controller(chosen);
    options.rtol = settings.options.rtol;
    options.atol = settings.options.atol;
    options.max_attempts = settings.options.max_steps;
    if (measured_by_norm(chosen)) {
        options.estimate = ErrorEstimate::embedded;
        options.scheme.first_stage = FirstStage::switch_aware;
    } else if (chosen.controller != "constant") {
        // The source of these rules estimates and limits in this way.
        options.estimate = ErrorEstimate::doubling;
        options.error_order = 1;
        options.h_max = 10 * chosen.step;
    }
    if (chosen.integrator == "time-stepping") options.scheme.scheme = Scheme::backward_euler;
    return options;
}

}  // namespace ricochet::app
